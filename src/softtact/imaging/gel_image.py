"""What a camera behind a gel sees of its moved surface: slopes, colours and markers, pixel by pixel.

A pixel's ray meets the surface at a point X of the surface at rest with

    X + u(X) = q (distance + z(X)),          q: direction of the ray, u, z: in-plane displacement and height of the surface,

which fixed-point iteration solves. The slope there is that of the moved surface, F^-T grad z with F = I + grad u, along the image's
axes. A shading model gives its colour; markers are discs that lie on the surface and deform with it.

Rays are followed at about as many pixels as the map has points, and colours are linear between them. Compiled loops look a shading
up in a table, which is exact in the place, as the shadings are polynomials of a low degree there, and bilinear over the tilt.
`colours_by_formula` at all pixels is the slow twin of these loops.
"""

import functools
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from softtact.compiled import compiled
from softtact.imaging.pinhole import Pinhole

_TILTS = 161              # cells' corners of the table over the sine of the surface's angle: bilinear within 0.02 grey levels
_STEEPEST = 0.985         # largest sine in the table: a slope of 5.7
_DEGREES = (0, 1, 2, 3)   # of the shading in the place, tried in turn
_EXACT = 0.02             # grey levels: largest error of the table in the place
_PASSES = 12              # of the search for a ray's point
_CLOSE = 0.005            # of a cell of the map: change at which the search ends
_LEAST_STRETCH = 0.1      # of the surface: a model's ratio of areas below it is not to be inverted


class Shades(Protocol):
    """A shading model: `softtact.imaging.shading.Shading`, or one of a user's own."""

    def difference(self, slope_x: np.ndarray, slope_y: np.ndarray, x_px: np.ndarray, y_px: np.ndarray) -> np.ndarray:
        """Colour minus background (..., 3) in grey levels."""


@dataclass(frozen=True)
class Relief:
    """A sensing surface at one load step, at points of a regular grid at rest."""

    x_mm: np.ndarray
    """(nx,) evenly spaced."""
    y_mm: np.ndarray
    """(ny,) evenly spaced."""
    moved_mm: np.ndarray
    """(ny, nx, 3): displacement along x and y, and height z over the surface at rest (of a curved one: over its highest point)."""
    rest_z_mm: np.ndarray | None = None
    """(ny, nx) height at rest; None: 0 everywhere."""

    @property
    def grid(self) -> np.ndarray:
        """(4,) first x, first y, 1 / spacing along x, 1 / spacing along y."""
        return np.array([self.x_mm[0], self.y_mm[0], 1 / (self.x_mm[1] - self.x_mm[0]), 1 / (self.y_mm[1] - self.y_mm[0])])

    def at(self, points_mm: np.ndarray) -> np.ndarray:
        """(n, 3) displacement along x, y and height at points (n, 2) at rest, bilinear; the border's values beyond it."""
        out = np.empty((len(points_mm), 3))
        _sample_points(np.ascontiguousarray(self.moved_mm), self.grid, np.ascontiguousarray(points_mm, dtype=float), out)
        return out

    def places(self, points_mm: np.ndarray) -> np.ndarray:
        """(n, 3) where points (n, 2) of the surface at rest are, in mm."""
        moved = self.at(points_mm)
        moved[:, :2] += points_mm
        return moved


def slopes_of(relief: Relief, turn: np.ndarray) -> np.ndarray:
    """(ny, nx, 2) slopes of the moved surface at the map's points, along the axes of an image; turn: (2, 2), see `Pinhole.turn`.

    Of a surface that is curved at rest: less its slope there, which the untouched image already shows.
    """
    slopes = np.empty((*relief.moved_mm.shape[:2], 2))
    rest = np.zeros((1, 1)) if relief.rest_z_mm is None else np.ascontiguousarray(relief.rest_z_mm)
    _slopes(np.ascontiguousarray(relief.moved_mm), rest, relief.grid, turn, slopes)
    return slopes


def pixel_step(relief: Relief, camera: Pinhole) -> int:
    """Pixels from one to the next whose ray is searched, about as many as between two points of the map."""
    spacing = min(relief.x_mm[1] - relief.x_mm[0], relief.y_mm[1] - relief.y_mm[0])
    return max(1, int(round(spacing / camera.mm_per_px)))


@functools.lru_cache(maxsize=16)
def rays_of(camera: Pinhole, step: int = 1) -> np.ndarray:
    """(rows, columns, 2) directions of the rays of each `step`-th pixel and one beyond the last, see `Pinhole.directions`."""
    columns, rows = (np.arange(0, count - 1 + step, step, dtype=float) for count in (camera.columns, camera.rows))
    rays: np.ndarray = np.ascontiguousarray(camera.directions(np.stack(np.meshgrid(columns, rows), axis=-1)))
    rays.flags.writeable = False
    return rays


def seen(relief: Relief, camera: Pinhole, fields: np.ndarray, *, step: int = 1, steep: bool = False) -> np.ndarray:
    """(rows, columns, k) of fields (ny, nx, k) on the surface at the points that pixels see, each `step`-th; 0 beyond the map.

    steep: whether walls may hide what lies behind them: each search then begins at the height that is nearest to the camera
    """
    rays = rays_of(camera, step)
    out = np.empty((*rays.shape[:2], fields.shape[2]), dtype=np.float32)
    _see(rays, np.ascontiguousarray(relief.moved_mm), np.ascontiguousarray(fields), relief.grid, camera.distance_mm, steep, out)
    return out


def between(values: np.ndarray, camera: Pinhole, step: int) -> np.ndarray:
    """(rows, columns, k) at all pixels, linear between those of each `step`-th pixel (see `seen`)."""
    y, x = np.arange(camera.rows) / step, np.arange(camera.columns) / step
    for axis, at in enumerate((y, x)):
        low = np.minimum(at.astype(int), values.shape[axis] - 2) if values.shape[axis] > 1 else np.zeros(len(at), dtype=int)
        high = np.minimum(low + 1, values.shape[axis] - 1)
        share = (at - low).reshape(-1, *[1] * (2 - axis))
        values = (1 - share) * np.take(values, low, axis=axis) + share * np.take(values, high, axis=axis)
    return values


@dataclass(frozen=True)
class ShadingTable:
    """A shading on a grid of tilts, times monomials of the place: what compiled loops read."""

    values: np.ndarray
    """(tilt along y, tilt along x, monomial, channel), grey levels; a fourth channel fills the line and is not read."""
    degree: int
    """Of the monomials."""
    middle: np.ndarray
    """(2,) px: the place's origin."""
    unit: float
    """px: its unit."""


def tabulate(shading: Shades, camera: Pinhole) -> ShadingTable | None:
    """The table of a shading for a camera; None where it is no polynomial of the place up to the third degree."""
    middle, unit = camera.centre_px, 0.5 * max(camera.columns, camera.rows)
    tilts = np.linspace(-_STEEPEST, _STEEPEST, _TILTS)
    slope_x, slope_y = _slopes_of_tilts(*np.meshgrid(tilts, tilts))
    few = (slope_x[::20, ::20].ravel(), slope_y[::20, ::20].ravel())
    for degree in _DEGREES:
        nodes = _nodes(degree)
        inverse = np.linalg.inv(_monomials(nodes[:, 0], nodes[:, 1], degree))

        def terms(x, y, inverse=inverse, nodes=nodes):
            at_nodes = [shading.difference(x, y, *(np.full(x.shape, value) for value in middle + unit * node)) for node in nodes]
            return np.einsum("mn,n...c->...mc", inverse, np.array(at_nodes))

        tried = terms(*few)
        errors = [np.abs(np.einsum("m,kmc->kc", _monomials(x, y, degree), tried) - shading.difference(
            *few, np.full(len(few[0]), middle[0] + unit * x), np.full(len(few[0]), middle[1] + unit * y))).max()
            for x, y in ((0.71, -0.33), (-0.88, 0.52), (0.13, 0.94))]
        if max(errors) < _EXACT:
            values = np.pad(terms(slope_x, slope_y), [(0, 0), (0, 0), (0, 0), (0, 1)])
            return ShadingTable(values.astype(np.float32), degree, middle, unit)
    return None


def colours_by_table(slopes: np.ndarray, step: int, table: ShadingTable, background: np.ndarray, light: np.ndarray,
                     dimming: np.ndarray | None = None) -> np.ndarray:
    """(rows, columns, 3) uint8 of slopes at each `step`-th pixel (see `seen`).

    background: (rows, columns, 3) grey levels of the untouched gel;  light: (rows, columns) share that markers leave
    dimming: (rows, columns, 3) share that shadows take, at the pixels of the slopes; by default none
    """
    image = np.empty((*light.shape, 3), dtype=np.uint8)
    tilts = (slopes / np.sqrt(1 + (slopes**2).sum(axis=2, keepdims=True))).astype(np.float32)
    difference = np.empty((*tilts.shape[:2], 4), dtype=np.float32)
    _look_up(tilts, step, table.values, table.degree, table.middle, 1 / table.unit, difference)
    shadows = np.zeros((*tilts.shape[:2], 3), dtype=np.float32) if dimming is None else np.ascontiguousarray(dimming)
    _colour(difference, shadows, step, background, light, image)
    return image


def colours_by_formula(slopes: np.ndarray, shading: Shades, background: np.ndarray, light: np.ndarray,
                       dimming: np.ndarray | None = None) -> np.ndarray:
    """The same by the shading's own formula, with slopes (rows, columns, 2) and dimming at each pixel."""
    y, x = np.mgrid[:background.shape[0], :background.shape[1]]
    colours = np.clip(background + shading.difference(slopes[..., 0], slopes[..., 1], x, y), 0, 255)
    colours = colours if dimming is None else colours * (1 - dimming)
    image: np.ndarray = np.round(colours * light[..., None]).astype(np.uint8)
    return image


def light_past_markers(relief: Relief, camera: Pinhole, markers: Any, points_mm: np.ndarray) -> np.ndarray:
    """(rows, columns) share of the light that markers at points (n, 2) at rest leave: discs that deform with the surface.

    markers: with radius_mm, darkness and edge_px, see `softtact.readout.camera.MarkerGrid`
    """
    light = np.ones((camera.rows, camera.columns), dtype=np.float32)
    if not len(points_mm):
        return light
    h = 0.5 * markers.radius_mm
    around = np.array([[0, 0], [h, 0], [-h, 0], [0, h], [0, -h]])
    px = camera.project(relief.places((points_mm[:, None] + around).reshape(-1, 2))).reshape(len(points_mm), 5, 2)
    stretch = np.stack([px[:, 1] - px[:, 2], px[:, 3] - px[:, 4]], axis=-1) / (2 * h)        # (n, px, mm)
    _draw_discs(np.ascontiguousarray(px[:, 0]), np.linalg.inv(stretch), float(markers.radius_mm), float(markers.darkness),
                float(markers.edge_px), light)
    return light


# --- the table's places: monomials 1, x, y, x2, xy, y2, ... and nodes that determine them ---


def _monomials(x, y, degree):
    return np.stack([x**(total - k) * y**k for total in range(degree + 1) for k in range(total + 1)], axis=-1)


def _nodes(degree):
    """(n, 2) places of a triangle of points, as many as there are monomials."""
    if degree == 0:
        return np.zeros((1, 2))
    return np.array([(2 * i / degree - 1, 2 * j / degree - 1) for i in range(degree + 1) for j in range(degree + 1 - i)]) * 0.6


def _slopes_of_tilts(tilt_x, tilt_y):
    """Slopes of sines of the surface's angle; those outside the steepest circle are drawn onto it."""
    size = np.hypot(tilt_x, tilt_y)
    shrink = np.minimum(1.0, _STEEPEST / np.maximum(size, 1e-9))
    along = 1 / np.sqrt(1 - np.minimum(size, _STEEPEST)**2)
    return tilt_x * shrink * along, tilt_y * shrink * along


# --- compiled loops ---


@compiled(error_model="numpy")
def _cell(value, count):
    """Number of the cell that a place on a line of `count` points lies in, and the share of the way through it."""
    low = min(max(int(value), 0), count - 2)
    return low, min(max(value - low, 0.0), 1.0)


@compiled(error_model="numpy")
def _sample_points(field, grid, points, out):
    for k in range(len(points)):
        i, s = _cell((points[k, 0] - grid[0]) * grid[2], field.shape[1])
        j, t = _cell((points[k, 1] - grid[1]) * grid[3], field.shape[0])
        for c in range(field.shape[2]):
            out[k, c] = ((1 - t) * ((1 - s) * field[j, i, c] + s * field[j, i + 1, c])
                         + t * ((1 - s) * field[j + 1, i, c] + s * field[j + 1, i + 1, c]))


@compiled(error_model="numpy")
def _slopes(moved, rest, grid, turn, out):
    ny, nx = moved.shape[:2]
    curved = rest.shape[0] > 1
    for j in range(ny):
        below, above = max(j - 1, 0), min(j + 1, ny - 1)
        over_y = grid[3] / (above - below)
        for i in range(nx):
            left, right = max(i - 1, 0), min(i + 1, nx - 1)
            over_x = grid[2] / (right - left)
            fxx = 1 + (moved[j, right, 0] - moved[j, left, 0]) * over_x
            fyx = (moved[j, right, 1] - moved[j, left, 1]) * over_x
            zx = (moved[j, right, 2] - moved[j, left, 2]) * over_x
            fxy = (moved[above, i, 0] - moved[below, i, 0]) * over_y
            fyy = 1 + (moved[above, i, 1] - moved[below, i, 1]) * over_y
            zy = (moved[above, i, 2] - moved[below, i, 2]) * over_y
            over = 1 / max(fxx * fyy - fxy * fyx, _LEAST_STRETCH)
            sx, sy = (fyy * zx - fyx * zy) * over, (fxx * zy - fxy * zx) * over
            if curved:
                sx -= (rest[j, right] - rest[j, left]) * over_x
                sy -= (rest[above, i] - rest[below, i]) * over_y
            out[j, i, 0] = turn[0, 0] * sx + turn[0, 1] * sy
            out[j, i, 1] = turn[1, 0] * sx + turn[1, 1] * sy


@compiled(error_model="numpy")
def _see(rays, moved, fields, grid, distance, steep, out):
    """Search each pixel's point, from that of its left neighbour on, or from the nearest height, and sample the fields there."""
    ny, nx, count = fields.shape
    nearest = moved[..., 2].min()
    for row in range(rays.shape[0]):
        ux, uy, z = 0.0, 0.0, 0.0
        for column in range(rays.shape[1]):
            qx, qy = rays[row, column, 0], rays[row, column, 1]
            if steep:
                ux, uy, z = 0.0, 0.0, nearest
            x, y = qx * (distance + z) - ux, qy * (distance + z) - uy
            for _ in range(_PASSES):
                i, s = _cell((x - grid[0]) * grid[2], nx)
                j, t = _cell((y - grid[1]) * grid[3], ny)
                a, b, c, d = (1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s
                ux = a * moved[j, i, 0] + b * moved[j, i + 1, 0] + c * moved[j + 1, i, 0] + d * moved[j + 1, i + 1, 0]
                uy = a * moved[j, i, 1] + b * moved[j, i + 1, 1] + c * moved[j + 1, i, 1] + d * moved[j + 1, i + 1, 1]
                z = a * moved[j, i, 2] + b * moved[j, i + 1, 2] + c * moved[j + 1, i, 2] + d * moved[j + 1, i + 1, 2]
                next_x, next_y = qx * (distance + z) - ux, qy * (distance + z) - uy
                change = abs(next_x - x) * grid[2] + abs(next_y - y) * grid[3]
                x, y = next_x, next_y
                if change < _CLOSE:
                    break
            at_x, at_y = (x - grid[0]) * grid[2], (y - grid[1]) * grid[3]
            if at_x >= 0 and at_y >= 0 and at_x <= nx - 1 and at_y <= ny - 1:
                i, s = _cell(at_x, nx)
                j, t = _cell(at_y, ny)
                a, b, c, d = (1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s
                for k in range(count):
                    out[row, column, k] = (a * fields[j, i, k] + b * fields[j, i + 1, k]
                                           + c * fields[j + 1, i, k] + d * fields[j + 1, i + 1, k])
            else:
                for k in range(count):
                    out[row, column, k] = 0.0


@compiled(error_model="numpy", fastmath=True)
def _look_up(tilts, step, table, degree, middle, over_unit, out):
    """Colours minus background (rows, columns, 4) of tilts (rows, columns, 2) at each `step`-th pixel."""
    size, count = table.shape[0], table.shape[2]
    scale, half, place = 0.5 * (size - 1) / _STEEPEST, 0.5 * (size - 1), np.empty(count, dtype=np.float32)
    for row in range(tilts.shape[0]):
        y = (row * step - middle[1]) * over_unit
        for column in range(tilts.shape[1]):
            i, s = _cell(half + scale * tilts[row, column, 0], size)
            j, t = _cell(half + scale * tilts[row, column, 1], size)
            a, b, c, d = (1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s
            _place_terms((column * step - middle[0]) * over_unit, y, degree, place)
            for k in range(4):
                out[row, column, k] = 0
            for m in range(count):
                for k in range(4):
                    out[row, column, k] += place[m] * (a * table[j, i, m, k] + b * table[j, i + 1, m, k]
                                                       + c * table[j + 1, i, m, k] + d * table[j + 1, i + 1, m, k])


@compiled(error_model="numpy", fastmath=True)
def _colour(difference, dimming, step, background, light, image):
    """Colours of all pixels from differences (rows, columns, 4) and dimming (rows, columns, 3) at each `step`-th, linear."""
    over_step, zero, most, round_up = np.float32(1 / step), np.float32(0), np.float32(255), np.float32(0.5)
    line, rise = np.empty((difference.shape[1], 3), dtype=np.float32), np.zeros((difference.shape[1], 3), dtype=np.float32)
    lit, lit_rise = np.empty_like(line), np.zeros_like(line)
    for row in range(image.shape[0]):
        at = row // step
        share = (row - at * step) * over_step
        below = at + 1 if share > 0 else at
        for k in range(line.shape[0]):
            for c in range(3):
                line[k, c] = difference[at, k, c] + share * (difference[below, k, c] - difference[at, k, c])
                lit[k, c] = np.float32(1) - dimming[at, k, c] - share * (dimming[below, k, c] - dimming[at, k, c])
        for k in range(line.shape[0] - 1):
            for c in range(3):
                rise[k, c] = over_step * (line[k + 1, c] - line[k, c])
                lit_rise[k, c] = over_step * (lit[k + 1, c] - lit[k, c])
        for k in range(line.shape[0]):
            for phase in range(min(step, image.shape[1] - k * step)):
                column, far = k * step + phase, np.float32(phase)
                left = light[row, column]
                for c in range(3):
                    value = background[row, column, c] + line[k, c] + far * rise[k, c]
                    shade = (lit[k, c] + far * lit_rise[k, c]) * left
                    image[row, column, c] = np.uint8(min(max(value, zero), most) * shade + round_up)


@compiled(error_model="numpy", inline="always")
def _place_terms(x, y, degree, out):
    """1, x, y, x2, xy, y2, ... up to the degree, at most 3."""
    out[0] = 1
    if degree > 0:
        out[1], out[2] = x, y
    if degree > 1:
        out[3], out[4], out[5] = x * x, x * y, y * y
    if degree > 2:
        out[6], out[7], out[8], out[9] = x * x * x, x * x * y, x * y * y, y * y * y


@compiled(error_model="numpy", fastmath=True)
def _draw_discs(px, back, radius, darkness, edge, light):
    """Darken pixels by discs at px (n, 2), whose places in mm are back (n, 2, 2) times the distance in px from their middle."""
    rows, columns = light.shape
    for k in range(len(px)):
        reach, a, b, c, d = edge + 1.0, back[k, 0, 0], back[k, 0, 1], back[k, 1, 0], back[k, 1, 1]
        det = abs(a * d - b * c)
        wide = reach + radius * np.sqrt(d * d + b * b) / det      # half sides of the ellipse's box
        high = reach + radius * np.sqrt(a * a + c * c) / det
        for j in range(max(int(px[k, 1] - high), 0), min(int(px[k, 1] + high) + 2, rows)):
            for i in range(max(int(px[k, 0] - wide), 0), min(int(px[k, 0] + wide) + 2, columns)):
                dx, dy = i - px[k, 0], j - px[k, 1]
                away = np.sqrt((a * dx + b * dy)**2 + (c * dx + d * dy)**2)
                far = np.sqrt(dx * dx + dy * dy)
                inside = (radius / away - 1) * far if away > 1e-9 else edge
                if inside > -0.5 * edge:
                    light[j, i] *= 1 - darkness * min(0.5 + inside / edge, 1.0)
