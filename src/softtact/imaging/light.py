"""Light from the values of a frame: the meaning of its channels, its full scale, and which pixels are faulty.

A camera's file rarely states its full scale: 10 or 12 bits are stored in 16, masks as 0 and 1, floating-point light on any
scale. So full scale follows from the largest values that at least 3 x 3 pixels reach, which one hot pixel does not change.
"""

import warnings

import numpy as np
from scipy.ndimage import maximum_filter, median_filter, minimum_filter

from softtact.errors import FrameWarning, InputError
from softtact.imaging.regions import FAINTEST, pixel_noise, slope_of, steepest

SMALLEST_SIDE = 16       # pixels of a frame
TRANSFERS = ("linear", "srgb")
_CHANNELS = {1: (1, False), 2: (1, True), 3: (3, False), 4: (3, True)}   # stored: (of colour, whether the last is alpha)
_SHARED = 3              # pixels; side of the square in which all pixels must reach a value for it to count
_FEW, _APART = 0.05, 4.0   # overlay: largest share of the pixels, and brightness over that of all others
_CONTRAST = 3.0          # least span of a frame with more than noise, in standard deviations of the noise; noise alone has 1.2
_BEYOND = 2.0            # spans beyond the shared values, from which a pixel is hot or dead
_SURE = 12.0             # deviation of a pixel that is always allowed, in standard deviations of the noise
_FRAYED = 0.2            # largest share of isolated pixels along the borders of a mask
_DIM = 0.05              # floating-point frames with a smaller range are not on a scale from 0 to 1
_SEEN = 8.0              # standard deviations of the slope of noise
_FAINT = 1.5 / 255       # of full scale; more than rounding


def grey(frame: np.ndarray, *, transfer: str = "linear", lossy: bool = False) -> np.ndarray:
    """The light (rows, columns) in a frame of any depth, as a share of full scale; the colours have equal weight.

    frame: (rows, columns), or (rows, columns, channels) of grey, grey and alpha, RGB, or RGBA; alpha scales the light
    transfer: linear, where values are proportional to light, or srgb, where they are encoded for a screen (IEC 61966-2-1)
    lossy: whether the frame was compressed as JPEG or video; full scale is then that of its type, as faint values may be artefacts

    Full scale is 255 for 8-bit frames; for deeper integers that of the fewest bits, at least 8, that hold the frame's range;
    1 for floating-point numbers from 0 to 1, and their range for others. A frame of two values is a mask, of 0 and 1.
    Single pixels far outside the range of all others are replaced by the median of their neighbours.
    """
    frame = _checked(np.asarray(frame))
    colours, opacity = _colours_and_opacity(frame)
    whole = frame.dtype.kind in "ui" or bool((colours == np.rint(colours)).all())
    if transfer == "srgb":
        colours = _from_srgb(colours, _encoded_scale(frame, colours, whole=whole, lossy=lossy))
    elif transfer != "linear":
        raise InputError(f"transfer={transfer!r}: give one of {', '.join(TRANSFERS)}.")
    light = colours.mean(axis=2) * opacity
    if frame.dtype not in (np.uint8, np.bool_):
        light = _without_overlay(light)
    bottom, span, noise = _shared_range(light)
    light = _without_outliers(light, bottom, span, noise)
    on_a_scale = lossy or (frame.dtype == np.uint8 and not _is_mask(light, span))
    if frame.dtype.kind == "u" and on_a_scale:
        return light if transfer == "srgb" else light / np.iinfo(frame.dtype).max
    return (light - bottom) / _full_scale(light, bottom, span, noise, whole=whole, decoded=transfer == "srgb")


def _checked(frame):
    """The frame, checked for its shape and type."""
    if frame.ndim not in (2, 3) or min(frame.shape[:2]) < SMALLEST_SIDE:
        raise InputError(f"a frame of shape {frame.shape} is not a picture of at least {SMALLEST_SIDE} x {SMALLEST_SIDE} pixels; "
                         "give (rows, columns) or (rows, columns, channels).")
    if frame.ndim == 3 and frame.shape[2] not in _CHANNELS:
        raise InputError(f"a frame of shape {frame.shape} has {frame.shape[2]} channels, but only 1 (grey), 2 (grey, alpha), "
                         "3 (RGB) and 4 (RGBA) are read; give one plane at a time.")
    if frame.dtype.kind not in "buif":
        raise InputError(f"a frame holds {frame.dtype} in place of real numbers; save its magnitude.")
    if frame.dtype.kind == "f" and not np.isfinite(frame).all():
        first = tuple(int(index) for index in np.argwhere(~np.isfinite(frame))[0][:2])
        raise InputError(f"a frame holds {np.count_nonzero(~np.isfinite(frame))} values that are not finite numbers, the first at "
                         f"row, column {first}; fill them in and save it again.")
    return frame


def _colours_and_opacity(frame):
    """Channels of colour (rows, columns, 1 or 3) as float64, and the share of light (rows, columns) that alpha lets through.

    A constant alpha is ignored, because some cameras leave it at 0.
    """
    channels = frame[..., None] if frame.ndim == 2 else frame
    count, has_alpha = _CHANNELS[channels.shape[2]]
    colours = channels[..., :count].astype(float)
    if not has_alpha or np.ptp(alpha := channels[..., -1].astype(float)) == 0:
        return colours, 1.0
    warnings.warn("parts of the frame are transparent and count as dark; save it without an alpha channel if they are not.",
                  FrameWarning, stacklevel=3)
    return colours, alpha / alpha.max()


def _encoded_scale(frame, colours, *, whole, lossy):
    """The sRGB value of full light."""
    if frame.dtype.itemsize == 1:
        return 255.0
    if lossy and frame.dtype.kind == "u":
        return float(np.iinfo(frame.dtype).max)
    highest = float(minimum_filter(colours.mean(axis=2), _SHARED).max())
    return _whole_scale(highest) if whole else max(highest, 1.0)


def _from_srgb(colours, full):
    """Light from sRGB values up to `full`, on a scale from 0 to 1."""
    share = np.clip(colours / full, 0.0, 1.0)
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def _shared_range(light):
    """Lowest value and range that 3 x 3 pixels reach together, and the noise of a pixel; range 0 for a frame of only noise."""
    top, bottom = float(minimum_filter(light, _SHARED).max()), float(maximum_filter(light, _SHARED).min())
    return min(bottom, top), max(top - bottom, 0.0), pixel_noise(light)


def _without_overlay(light):
    """The light without an overlay, i.e. pixels far above all others with no values between, such as blurred edges have."""
    few = int(_FEW * light.size)
    top = np.sort(np.partition(light, light.size - few, axis=None)[light.size - few:]) - light.min()
    gaps = np.flatnonzero((top[1:] > _APART * top[:-1]) & (top[:-1] > 0))
    if not len(gaps):
        return light
    highest = light.min() + top[gaps[0]]
    above = light > highest
    rest = np.where(above, median_filter(light, _SHARED), light)     # this removes lines one pixel wide, but not blots
    wide = rest > highest
    rest[wide] = np.median(light)
    _, span, noise = _shared_range(rest)
    if span <= _CONTRAST * noise or span == 0:
        return light
    if wide.any():
        warnings.warn(f"{np.count_nonzero(above)} pixels are more than {_APART:g} times as bright as all others and are left out, "
                      "as faulty ones or a text laid over the frame.", FrameWarning, stacklevel=3)
    return rest


def _without_outliers(light, bottom, span, noise):
    """The light with hot and dead pixels replaced by the median of their neighbours."""
    margin = max(_BEYOND * span, _SURE * noise)
    far = (light > bottom + span + margin) | (light < bottom - margin)
    if margin == 0 or not far.any():
        return light
    return np.where(far, median_filter(light, _SHARED), light)


def _is_mask(light, span):
    """Whether the light has two values in regions with smooth borders; noise between two values would fray the borders."""
    low, high = light.min(), light.max()
    if not 0 < span == high - low or not ((light == low) | (light == high)).all():
        return False
    border = np.count_nonzero(minimum_filter(light, _SHARED) != maximum_filter(light, _SHARED))
    return np.count_nonzero(median_filter(light, _SHARED) != light) < _FRAYED * border


def _full_scale(light, bottom, span, noise, *, whole, decoded):
    """The light, above the lowest value, that becomes 1; decoded: whether it is a share of full scale, from sRGB values."""
    if _is_mask(light, span):
        return span
    if whole:
        return 1.0 if decoded else _whole_scale(span)
    if light.min() >= 0 and light.max() <= 1 and bottom + span > _DIM:
        return 1.0
    return span if span > 5 * noise else max(float(np.abs(light).max()), 1.0)


def _whole_scale(span):
    return 2.0 ** max(int(np.ceil(span)).bit_length(), 8) - 1


def warn_of_unseen_contrast(light: np.ndarray, *, lossy: bool) -> None:
    """Warn of a frame (rows, columns) without discs whose edges are steeper than noise explains."""
    slope = slope_of(median_filter(light, _SHARED))
    by_chance = np.percentile(slope, 25) / np.sqrt(-2 * np.log(0.75))   # the slope's size has a Rayleigh distribution
    if slope.max() > max(_SEEN * by_chance, steepest(FAINTEST if lossy else _FAINT, blur=0.0)):
        warnings.warn("no disc was found although there are edges; contacts must be bright on dark, with sharp edges and a "
                      f"contrast of {FAINTEST:.0%} of full scale.", FrameWarning, stacklevel=4)
