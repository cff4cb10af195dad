"""Frames of TIFF files: their pages, or the planes that ImageJ and others put behind a single page.

Light grows with the values that this gives: white-is-zero is turned, palettes and inks become RGB (TIFF 6.0, Adobe 1992).
Reduced copies (thumbnails, pyramids) are no frames.
"""

import logging
import math
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import tifffile

from softtact.errors import FrameWarning
from softtact.imaging.stills import SRGB_HINT, check_size, turned

_ORIENTATION, _ICC_PROFILE = 274, 34675
_ASSOCIATED, _UNASSOCIATED = 1, 2     # alpha that the colours are multiplied by already, and that they are not


def tiff_frames(file: Path) -> Iterator[tuple[int | None, Callable[[], np.ndarray]]]:
    """Pairs (number, function that reads the frame); the number of the only frame of a file is None.

    A function is to be called before the next pair is asked for.
    """
    with tifffile.TiffFile(file, _multifile=False) as stack:
        pages = [page for page in stack.pages if not _layout(page).is_reduced] or list(stack.pages)
        sizes = {(_layout(page).imagelength, _layout(page).imagewidth) for page in pages}
        if len(sizes) > 1:
            raise ValueError("its pages differ in size, " + ", ".join(f"{c} x {r}" for r, c in sorted(sizes))
                             + ", and one scale does not suit them")
        behind = {series.keyframe.index: series for series in _series(stack) if len(series.pages) == 1}
        if any(_ICC_PROFILE in page.tags for page in pages if isinstance(page, tifffile.TiffPage)):
            warnings.warn(SRGB_HINT, FrameWarning, stacklevel=2)
        frames = [frame for page in pages for frame in _frames_of(stack, page, behind.get(page.index))]
        for number, read in enumerate(frames):
            yield number if len(frames) > 1 else None, read


def _series(stack):
    """The series of a file; what tifffile only logs, such as planes that are missing at the end, is raised."""
    said: list[str] = []
    logger, handler = logging.getLogger("tifffile"), logging.Handler(logging.ERROR)
    handler.emit = lambda record: said.append(record.getMessage())
    logger.addHandler(handler)
    try:
        series = stack.series
    finally:
        logger.removeHandler(handler)
    if said:
        raise ValueError(said[0].partition("> ")[2] or said[0])
    return series


def _layout(page: tifffile.TiffPage | tifffile.TiffFrame) -> tifffile.TiffPage:
    """The page whose tags a page shares: itself, but in long stacks that are read in haste."""
    return cast(tifffile.TiffPage, page.keyframe)


def _frames_of(stack, page, series):
    """Functions that read the frames of one page: its own, and what lies behind it without pages of its own."""
    key = _layout(page)
    check_size(key.imagewidth, key.imagelength)
    planes = series.size // page.size if series is not None and page.size else 1
    if planes == 1 and key.imagedepth == 1:
        return [partial(_read, stack, page)]
    if key.imagedepth > 1 or series.dataoffset is None:
        raise ValueError(f"it holds {planes * key.imagedepth} planes in one page in a way that is not known")
    return [partial(_read_behind, stack, page, series.dataoffset + number * page.nbytes) for number in range(planes)]


def _check_extent(stack, page):
    """Refuse a page whose data lie beyond the end of the file, or are missing: they would be read as 0."""
    extents = list(zip(page.dataoffsets, page.databytecounts, strict=True))
    if not extents or any(count == 0 or offset + count > stack.filehandle.size for offset, count in extents):
        raise ValueError("parts of its data are missing")


def _read(stack, page):
    _check_extent(stack, page)
    return _light(page.asarray(), page)


def _read_behind(stack, page, offset):
    """The plane at an offset of the file, in the layout of `page`."""
    if offset + page.nbytes > stack.filehandle.size:
        raise ValueError("planes are missing at its end")
    stack.filehandle.seek(offset)
    plane = stack.filehandle.read_array(np.dtype(page.dtype).newbyteorder(stack.byteorder), math.prod(page.shape))
    return _light(plane.reshape(page.shape), page)


def _light(values, page):
    """Values of a page as light: (rows, columns) or (rows, columns, channels)."""
    key = _layout(page)
    if key.axes not in ("YX", "YXS", "SYX"):
        raise ValueError(f"its axes {key.axes} are not those of a picture")
    if key.axes == "SYX":     # planes of colour, one after the other
        values = values.transpose(1, 2, 0)
    values = _meaning(_without_extra(values, key), key)
    orientation = key.tags.valueof(_ORIENTATION, 1)
    return turned(values, orientation)


def _without_extra(values, key):
    """The values without channels that are no colour; alpha stays where colours are not multiplied by it."""
    extra = tuple(key.extrasamples)
    if not extra:
        return values
    colours = values.shape[2] - len(extra)
    if extra == (_ASSOCIATED,) or (extra == (0,) and colours == 3):
        return values[..., :colours]
    if extra == (_UNASSOCIATED,):
        return values
    raise ValueError(f"{len(extra)} of its {values.shape[2]} channels have no stated meaning")


def _meaning(values, key):
    """Values that grow with light, by the page's photometric interpretation."""
    name = key.photometric.name
    if name == "MINISWHITE":
        return _negative(values, key)
    if name == "PALETTE":
        return np.moveaxis(np.asarray(key.colormap)[:, values], 0, -1)
    if name == "SEPARATED" and values.shape[2:] == (4,):
        ink = values / np.float64(2**key.bitspersample - 1)
        return (1 - ink[..., :3]) * (1 - ink[..., 3:])
    if name in ("MINISBLACK", "RGB") or (name == "YCBCR" and key.compression.name == "JPEG"):     # which the codec turns into RGB
        return values
    raise ValueError(f"its values mean {name}, which is not read here")


def _negative(values, key):
    """White-is-zero turned around."""
    if values.dtype.kind == "f":
        return -values
    if values.dtype.kind == "b":
        return ~values
    if values.dtype.kind == "i":
        return -values.astype(np.int64)
    return (2**key.bitspersample - 1 - values.astype(np.uint64)).astype(values.dtype)
