"""Cast shadows on a gel's surface: where its relief hides a low lamp.

A gel is lit from its sides, so a pressed place, which stands out towards the camera, throws a shadow behind it.
A lamp stands in the direction d of the image, e above the gel's plane. With the relief b (towards the camera),

    horizon(x) = max over s > 0 of (b(x + s d) - b(x)) / s,        slope(x) = d . grad b
    dimming    = strength [S(tan e - slope) - S(tan e - horizon)],       S: from 0 to 1 over the lamp's height, smoothly

What a surface loses by its own slope, as it turns away from the lamp, is the shading's (`imaging/shading.py`), so only what other
parts of the relief hide counts here: on the ball itself, which is convex, nothing changes. Horizons are found line by line to the
lamp: the upper hull of the heights passed is kept, so a line takes time in proportion to its points. One lamp lights each channel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.compiled import compiled

if TYPE_CHECKING:
    from softtact.imaging.gel_image import Relief


@dataclass(frozen=True)
class Lamps:
    """A lamp for each channel, far away."""

    azimuth_rad: np.ndarray
    """(3,) from the image's x axis towards its y axis."""
    elevation_rad: np.ndarray
    """(3,) above the gel's plane."""
    softness: np.ndarray
    """(3,) height of the lamp as a difference of tangents, over which a shadow's edge fades."""
    strength: np.ndarray
    """(3,) share of the colour that a full shadow takes; 0: no shadow."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if np.shape(value) != (3,) or not np.isfinite(value).all():
                raise ValueError(f"lamps.{one.name} is {value}; write one number for each of three channels")
        if (self.softness <= 0).any() or (self.strength < 0).any() or (self.strength > 1).any():
            raise ValueError("lamps.softness must be above 0, and lamps.strength from 0 to 1")

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Lamps:
        """The lamps of a file. Raises TypeError or ValueError for what is none."""
        return cls(**{name: np.array(value, dtype=float) for name, value in values.items()})

    @property
    def directions(self) -> np.ndarray:
        """(3, 2) towards the lamps, along the image's axes."""
        return np.stack([np.cos(self.azimuth_rad), np.sin(self.azimuth_rad)], axis=1)

    def dimming(self, horizons: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """(..., 3) share of each channel's colour that shadows take.

        horizons (..., 3), see `horizon`;  slopes: (..., 2) d height / d x and d height / d y, the height away from the camera
        """
        toward = -(slopes @ self.directions.T)
        hidden = self._open(toward) - self._open(np.maximum(horizons, toward))
        return np.asarray(self.strength * hidden)

    def _open(self, tangent):
        """Share of the lamp above a tangent, smooth."""
        part = np.clip(0.5 + (np.tan(self.elevation_rad) - tangent) / self.softness, 0, 1)
        return part * part * (3 - 2 * part)


def dimming_of(relief: Relief, lamps: Lamps, slopes: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(ny, nx, 3) share of the colours that shadows take at the points of a surface's map.

    slopes: (ny, nx, 2), see `gel_image.slopes_of`;  turn: (2, 2), see `Pinhole.turn`
    """
    rest = 0.0 if relief.rest_z_mm is None else relief.rest_z_mm
    height = rest - relief.moved_mm[..., 2]
    found = np.zeros((*height.shape, 3))
    for channel, direction in enumerate(lamps.directions @ turn):
        if lamps.strength[channel] > 0:
            found[..., channel] = horizon(height, direction, relief.x_mm[1] - relief.x_mm[0], relief.y_mm[1] - relief.y_mm[0],
                                          relief.moved_mm[..., :2] @ direction)
    return lamps.dimming(found, slopes)


def horizon(height: np.ndarray, direction: np.ndarray, step_x: float, step_y: float, moved: np.ndarray | None = None) -> np.ndarray:
    """(ny, nx) tangent of the horizon of a height field in a direction (2,); at the border, of what the map has.

    step_x, step_y: between points;  moved: (ny, nx) displacement of the points along the direction, by default none
    """
    along = np.zeros((1, 1)) if moved is None else np.ascontiguousarray(moved)
    right, down = direction[0] / step_x, direction[1] / step_y
    field = np.ascontiguousarray(height, dtype=float)
    if abs(down) > abs(right):      # lines go along the rows' direction
        turned = np.ascontiguousarray(along.T)
        return np.ascontiguousarray(_horizon(np.ascontiguousarray(field.T), turned, right / down, down > 0, 1 / abs(down)).T)
    out: np.ndarray = _horizon(field, along, down / right, right > 0, 1 / abs(right))
    return out


@compiled(error_model="numpy")
def _horizon(height, moved, tilt, forwards, length):
    """Along lines that go `tilt` rows and `length` further with each column; the lamp is where columns end, or begin."""
    rows, columns = height.shape
    shifts = moved.shape[0] > 1
    first = int(np.floor(min(0.0, -tilt * (columns - 1))))
    last = int(np.ceil(max(float(rows - 1), rows - 1 - tilt * (columns - 1))))
    lines = np.zeros((last - first + 1, columns))
    high, place, hull = np.empty(columns), np.empty(columns), np.empty(columns, dtype=np.int64)
    for line in range(first, last + 1):
        kept = 0
        for number in range(columns):
            i = columns - 1 - number if forwards else number
            row = line + tilt * i
            if row < 0 or row > rows - 1:
                continue
            j = min(int(row), rows - 2)
            part = row - j
            high[i] = (1 - part) * height[j, i] + part * height[j + 1, i]
            place[i] = -number * length
            if shifts:
                place[i] += (1 - part) * moved[j, i] + part * moved[j + 1, i]
            steepest = 0.0
            while kept > 0:
                steepest = (high[hull[kept - 1]] - high[i]) / max(place[hull[kept - 1]] - place[i], 1e-3 * length)
                if kept == 1:
                    break
                before = (high[hull[kept - 2]] - high[i]) / max(place[hull[kept - 2]] - place[i], 1e-3 * length)
                if before < steepest:
                    break
                kept -= 1
            hull[kept] = i
            kept += 1
            lines[line - first, i] = steepest
    return _back_to_rows(lines, rows, tilt, first)


@compiled(error_model="numpy")
def _back_to_rows(lines, rows, tilt, first):
    out = np.empty((rows, lines.shape[1]))
    for j in range(rows):
        for i in range(lines.shape[1]):
            at = j - tilt * i - first
            k = min(int(at), lines.shape[0] - 2)
            out[j, i] = (1 - at + k) * lines[k, i] + (at - k) * lines[k + 1, i]
    return out
