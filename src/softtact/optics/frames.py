"""Camera frames of frustrated total internal reflection: contact shines where rubber touches the glass."""

import numpy as np
from scipy.ndimage import gaussian_filter

BACKGROUND = 0.05   # of full scale: light that leaks where nothing touches
BRIGHTNESS = 0.85   # of full scale: a contact at the frame's centre


def render_frame(x_mm, y_mm, area_mm2, *, footprint_mm, pixel_mm, blur_mm, noise, falloff, seed):
    """An 8-bit frame (rows along y, columns along x) of discs with given centres (n,) and areas (n,).

    blur_mm: standard deviation of the lens' blur; noise: standard deviation as a share of full scale;
    falloff: share of light lost from the centre to the corners
    """
    columns, rows = (int(round(side / pixel_mm)) for side in footprint_mm)
    cover = _coverage((rows, columns), x_mm, y_mm, area_mm2, footprint_mm, pixel_mm)
    light = gaussian_filter(BACKGROUND + (BRIGHTNESS - BACKGROUND) * cover, blur_mm / pixel_mm)
    light *= _illumination((rows, columns), falloff)
    light += noise * np.random.default_rng(seed).standard_normal(light.shape)
    return np.round(255 * np.clip(light, 0, 1)).astype(np.uint8)


def _coverage(shape, x_mm, y_mm, area_mm2, footprint_mm, pixel_mm):
    """Share of each pixel that lies in a disc: a linear ramp over one pixel across the rim."""
    cover = np.zeros(shape)
    for x, y, area in zip(x_mm, y_mm, area_mm2, strict=True):
        radius = np.sqrt(area / np.pi) / pixel_mm
        column, row = (x + 0.5 * footprint_mm[0]) / pixel_mm - 0.5, (y + 0.5 * footprint_mm[1]) / pixel_mm - 0.5
        rows = slice(max(0, int(row - radius - 2)), int(row + radius + 3))
        columns = slice(max(0, int(column - radius - 2)), int(column + radius + 3))
        r, c = np.mgrid[rows, columns]
        inside = (r < shape[0]) & (c < shape[1])
        disc = np.clip(radius + 0.5 - np.hypot(r - row, c - column), 0, 1)
        part = cover[rows, columns]
        np.maximum(part, disc[:part.shape[0], :part.shape[1]], out=part, where=inside[:part.shape[0], :part.shape[1]])
    return cover


def _illumination(shape, falloff):
    r, c = np.mgrid[-1:1:shape[0] * 1j, -1:1:shape[1] * 1j]
    return 1 - 0.5 * falloff * (r**2 + c**2)
