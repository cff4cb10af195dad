"""Frames of PNG, JPEG, BMP and GIF files, at the depth and with the colours that the file holds."""

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import imagecodecs
import numpy as np
from PIL import ExifTags, Image, ImageOps

from softtact.errors import FrameWarning, InputError

MOST_PIXELS = 100_000_000   # of a frame; detection takes about 170 bytes for each
SRGB_HINT = ("the file says that its values are encoded for a screen (sRGB), and they are taken as proportional to light; "
             "give --transfer srgb, or --transfer linear if they are.")
_FORMATS = ("PNG", "JPEG", "BMP", "DIB", "GIF")
_DEEP_COLOURS = (2, 4, 6)   # colour types of a PNG (RGB, grey and alpha, RGBA) that Pillow cuts to 8 bits
_DEPTH, _COLOUR_TYPE = 24, 25     # bytes of a PNG file
_ENCODED = 0.6              # a larger gamma in a PNG says that values are proportional to light
_AS_STORED = ("1", "L", "LA", "RGB", "RGBA", "I", "F", "I;16", "I;16B", "I;16L", "I;16N")
_EXIF_SRGB = 1


def still_frames(file: Path) -> Iterator[tuple[int | None, Callable[[], np.ndarray]]]:
    """Pairs (number, function that reads the frame): those of an animation, or the one picture, whose number is None.

    A function is to be called before the next pair is asked for.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            image = Image.open(file, formats=_FORMATS)
        except Image.DecompressionBombError as error:
            raise InputError(f"{' '.join(str(error).split(',')[:1])}; crop it, or average pixels.") from None
    with image:
        check_size(image.width, image.height)
        frames = getattr(image, "n_frames", 1) if image.format in ("PNG", "GIF") else 1
        _warn_of_encoding(image)
        if _is_deep(file, image):
            if frames > 1:
                raise ValueError(f"it is an animation of {frames} frames with 16 bits")
            yield None, partial(_deep_png, file, image)
            return
        for number in range(frames):
            yield number if frames > 1 or image.format == "GIF" else None, partial(_frame, image, number)


def check_size(width: int, height: int) -> None:
    """Refuse a frame that does not fit into memory, or whose sides are damaged."""
    if width * height > MOST_PIXELS:
        raise InputError(f"a frame of {width} x {height} pixels is larger than {MOST_PIXELS / 1e6:.0f} million pixels; "
                         "crop it, or average pixels.")


def _is_deep(file, image):
    """Whether a PNG holds 16 bits of colours or of grey with alpha."""
    if image.format != "PNG":
        return False
    with file.open("rb") as stream:
        head = stream.read(_COLOUR_TYPE + 1)
    return head[_DEPTH] == 16 and head[_COLOUR_TYPE] in _DEEP_COLOURS


def _deep_png(file, image):
    return turned(imagecodecs.png_decode(file.read_bytes()), image.getexif().get(ExifTags.Base.Orientation, 1))


def _frame(image, number):
    """One frame of an open image as (rows, columns) or (rows, columns, channels)."""
    image.seek(number)
    image.load()
    upright = ImageOps.exif_transpose(image) or image
    if upright.mode in _AS_STORED:
        return np.asarray(upright)
    transparent = upright.mode == "PA" or "transparency" in upright.info
    return np.asarray(upright.convert("RGBA" if transparent else "RGB"))     # palettes, CMYK, YCbCr, Lab


def turned(frame: np.ndarray, orientation: int) -> np.ndarray:
    """A frame as it is to be looked at, from the orientation 1 to 8 of TIFF and Exif."""
    if orientation >= 5:
        frame = frame.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        frame = frame[::-1]
    return frame[:, ::-1] if orientation in (2, 3, 6, 7) else frame


def _warn_of_encoding(image):
    exif_srgb = image.getexif().get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.ColorSpace) == _EXIF_SRGB
    if exif_srgb or "srgb" in image.info or "icc_profile" in image.info or 0 < image.info.get("gamma", 1.0) < _ENCODED:
        warnings.warn(SRGB_HINT, FrameWarning, stacklevel=2)
