"""Camera frames of frustrated total internal reflection: the glass shines where rubber touches it.

    light = illumination * (background + (disc - background) * (coverage blurred by the lens)) + noise,  cut to 0 ... 1, in 8 bits

Rows run along y, columns along x; the frame's centre is the origin. Coverage is the share of a pixel that lies in a disc.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

BACKGROUND = 0.05   # of full scale: stray light without contact
BRIGHTNESS = 0.85   # of full scale: contact at the frame's centre
_SUBROWS = 16       # lines per pixel along which a disc's chord is exact: coverage to 1e-4 of a disc of 4 pixels


@dataclass(frozen=True)
class Camera:
    """A camera behind the glass, with its lens and its light."""

    pixel_mm: float
    """Side of a pixel on the glass."""
    blur_mm: float
    """Standard deviation of the lens' blur."""
    noise: float
    """Standard deviation as a share of full scale, the same in every pixel."""
    falloff: float
    """Relative loss of light from the frame's centre to its corners."""
    background: float = BACKGROUND
    """Share of full scale at the frame's centre without contact."""
    brightness: float = BRIGHTNESS
    """The same with contact."""

    @property
    def signal_to_noise(self) -> float:
        """Contrast of a disc over the background at the frame's centre, before blur, over the noise of one pixel."""
        return (self.brightness - self.background) / self.noise


def render_frame(x_mm: np.ndarray, y_mm: np.ndarray, area_mm2: np.ndarray, camera: Camera, *, footprint_mm: tuple[float, float],
                 seed: int | Sequence[int]) -> np.ndarray:
    """An 8-bit frame (rows along y, columns along x) of discs with given centres (n,) and areas (n,).

    footprint_mm: sides (along x, along y) of what the camera sees
    Noise that reaches below 0 or above 1 is cut off, as in a camera; `Camera.signal_to_noise` is the ratio before that.
    """
    columns, rows = (int(round(side / camera.pixel_mm)) for side in footprint_mm)
    blur = camera.blur_mm / camera.pixel_mm
    beyond = int(np.ceil(4 * blur)) + 1   # discs just outside also shine into the frame
    cover = coverage(x_mm, y_mm, area_mm2, shape=(rows + 2 * beyond, columns + 2 * beyond), pixel_mm=camera.pixel_mm)
    return expose(gaussian_filter(cover, blur)[beyond:-beyond, beyond:-beyond], camera, seed=seed)


def expose(cover: np.ndarray, camera: Camera, *, seed: int | Sequence[int]) -> np.ndarray:
    """The 8-bit frame of a coverage (rows, columns), already blurred by the lens, of contacts of any shape."""
    light = illumination(cover.shape, camera.falloff) * (camera.background + (camera.brightness - camera.background) * cover)
    light += camera.noise * np.random.default_rng(seed).standard_normal(light.shape)
    return np.round(255 * np.clip(light, 0, 1)).astype(np.uint8)


def coverage(x_mm: np.ndarray, y_mm: np.ndarray, area_mm2: np.ndarray, *, shape: tuple[int, int], pixel_mm: float) -> np.ndarray:
    """Share (rows, columns) of each pixel that lies in a disc; touching discs share a pixel, overlapping ones count once."""
    cover = np.zeros(shape)
    middle = 0.5 * (np.array(shape) - 1)
    for x, y, area in zip(x_mm, y_mm, area_mm2, strict=True):
        _add_disc(cover, y / pixel_mm + middle[0], x / pixel_mm + middle[1], np.sqrt(area / np.pi) / pixel_mm)
    return np.minimum(cover, 1.0)


def _add_disc(cover, row, column, radius):
    """Add the coverage of one disc, in pixels: along x exactly, along y by the middles of thin strips."""
    (top, bottom), (left, right) = (
        np.clip((int(np.floor(m - radius)), int(np.ceil(m + radius)) + 2), 0, n)
        for m, n in zip((row, column), cover.shape, strict=True))
    strips = (np.arange((bottom - top) * _SUBROWS) + 0.5) / _SUBROWS + top - 0.5 - row
    half = np.sqrt(np.maximum(radius**2 - strips**2, 0.0))[:, None]
    pixel = np.arange(left, right) - column
    chord = np.clip(np.minimum(pixel + 0.5, half) - np.maximum(pixel - 0.5, -half), 0.0, 1.0)
    cover[top:bottom, left:right] += chord.reshape(bottom - top, _SUBROWS, right - left).mean(axis=1)


def illumination(shape: tuple[int, int], falloff: float) -> np.ndarray:
    """Light (rows, columns) relative to the centre: it falls with the square of the distance."""
    r, c = np.ogrid[-1:1:shape[0] * 1j, -1:1:shape[1] * 1j]
    return 1 - 0.5 * falloff * (r**2 + c**2)
