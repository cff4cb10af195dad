"""Read frames from an image, a folder of images, the pages of a TIFF or a video. One frame is in memory at a time.

A frame keeps the file's depth and colours, and its values grow with light: white-is-zero is inverted, palettes and inks become
RGB (TIFF 6.0, Adobe 1992). A TIFF's frames are its pages, or the planes that ImageJ and others store after a single page;
reduced copies (thumbnails, pyramids) are skipped.
"""

import logging
import math
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from PIL import ExifTags, Image, ImageOps

from softtact.errors import FrameWarning, InputError, require
from softtact.inputs import VARIABLE, check_input, limit

if TYPE_CHECKING:
    from tifffile import TiffFrame, TiffPage

IMAGES = (".png", ".jpg", ".jpeg", ".bmp")
STACKS = (".tif", ".tiff")
VIDEOS = (".mp4", ".avi", ".mov", ".mkv")
ANIMATIONS = (".gif",)
LOSSY = (".jpg", ".jpeg", *VIDEOS)
SRGB_HINT = ("the file says that its values are encoded for a screen (sRGB), and they are taken as proportional to light; "
             "give --transfer srgb, or --transfer linear if they are.")
_FORMATS = ("PNG", "JPEG", "BMP", "DIB", "GIF")
_DEEP_COLOURS = (2, 4, 6)   # colour types of a PNG (RGB, grey and alpha, RGBA) that Pillow reduces to 8 bits
_DEPTH, _COLOUR_TYPE = 24, 25     # bytes of a PNG file
_ENCODED = 0.6              # a larger gamma in a PNG means that values are proportional to light
_AS_STORED = ("1", "L", "LA", "RGB", "RGBA", "I", "F", "I;16", "I;16B", "I;16L", "I;16N")
_EXIF_SRGB = 1
_ORIENTATION, _ICC_PROFILE = 274, 34675
_ASSOCIATED, _UNASSOCIATED = 1, 2     # whether the colours are already multiplied by alpha
_MOST_BITS = 16
_ENOUGH = 0.9     # of the stated length; a shorter video is truncated


def read_frames(path: str | Path, *, every: int = 1) -> Iterator[tuple[str, np.ndarray]]:
    """Pairs (name, frame) of a file, or of the images in a folder in order of name; each `every`-th of them.

    A frame is (rows, columns) or (rows, columns, channels) in the depth of the file, and its values grow with light. Frames of a
    video or an animation and pages of a TIFF are named after the file and their number, from 0: clip.mp4:00012.
    """
    files = image_files(path)
    if len(files) == 1:
        yield from _numbered(files[0], every=every)
        return
    for file in files[::every]:
        yield from _numbered(file, every=1)


def is_lossy(name: str) -> bool:
    """Whether a frame of this name (see `read_frames`) was compressed in a way that changes its values."""
    return Path(re.sub(r":\d{5,}$", "", name)).suffix.lower() in LOSSY


def image_files(path: str | Path) -> list[Path]:
    """The file itself, or a folder's images in order of name."""
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: there is no such file or folder.")
    if not path.is_dir():
        return [path]
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in IMAGES + STACKS and not file.name.startswith("."))
    if not files:
        raise InputError(f"{path}: the folder holds no PNG, JPEG, BMP or TIFF file; name the folder with the frames, or a video.")
    return files


def read_frame(file: str | Path) -> np.ndarray:
    """The first frame of a file."""
    return next(_numbered(Path(file), every=1))[1]


def _numbered(file, *, every):
    """Pairs (name, frame) of one file; a single image has the name of the file."""
    check_input(file, "picture" if file.suffix.lower() in IMAGES else "movie")
    with _in_one_sentence(file):
        number = -1
        for number, (label, read) in enumerate(_reader(file)(file)):
            if number % every == 0:
                yield file.name if label is None else f"{file.name}:{label:05d}", read()
        if number < 0:
            raise ValueError("it holds no frame")


def _reader(file):
    """The function that gives the frames of a file of this kind."""
    try:
        return _READERS[file.suffix.lower()]
    except KeyError:
        raise ValueError(f"{file.suffix or 'no ending'} is none of {' '.join(_READERS)}") from None


@contextmanager
def _in_one_sentence(file):
    """Turn any error of a reader into one sentence that names the file."""
    try:
        yield
    except InputError as error:
        raise error if str(error).startswith(str(file)) else InputError(f"{file}: {error}") from None
    except Exception as error:     # decoders raise errors of many kinds for a damaged file
        kind = "video" if file.suffix.lower() in VIDEOS else "image"
        raise InputError(f"{file}: not a readable {kind} ({_short(error)}); save it again, or convert it to PNG.") from None


def _short(error):
    """The first line of a reader's message."""
    lines = str(error).splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__


def still_frames(file: Path) -> Iterator[tuple[int | None, Callable[[], np.ndarray]]]:
    """Pairs (number, function that reads the frame) of an animation, or of a single picture with the number None.

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
    """Refuse a frame that is too large for the memory, or whose size is invalid."""
    if width * height > (most := limit("pixels")):
        raise InputError(f"a frame of {width} x {height} pixels is larger than {most / 1e6:.0f} million pixels; crop it, average "
                         f"pixels, or raise all limits: set {VARIABLE}=2 or more.")


def _is_deep(file, image):
    """Whether a PNG holds 16 bits of colours or of grey with alpha."""
    if image.format != "PNG":
        return False
    with file.open("rb") as stream:
        head = stream.read(_COLOUR_TYPE + 1)
    return head[_DEPTH] == 16 and head[_COLOUR_TYPE] in _DEEP_COLOURS


def _deep_png(file, image):
    require("imagecodecs", file)
    import imagecodecs

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
    """A frame turned upright, from its orientation 1 to 8 of TIFF and Exif."""
    if orientation >= 5:
        frame = frame.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        frame = frame[::-1]
    return frame[:, ::-1] if orientation in (2, 3, 6, 7) else frame


def _warn_of_encoding(image):
    exif_srgb = image.getexif().get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.ColorSpace) == _EXIF_SRGB
    if exif_srgb or "srgb" in image.info or "icc_profile" in image.info or 0 < image.info.get("gamma", 1.0) < _ENCODED:
        warnings.warn(SRGB_HINT, FrameWarning, stacklevel=2)


def tiff_frames(file: Path) -> Iterator[tuple[int | None, Callable[[], np.ndarray]]]:
    """Pairs (number, function that reads the frame); the number of a file's only frame is None.

    A function is to be called before the next pair is asked for.
    """
    require("tifffile", file)
    import tifffile

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
    """The series of a file. Raises ValueError for faults that tifffile only logs, such as missing planes at the end."""
    faults: list[str] = []
    logger, handler = logging.getLogger("tifffile"), logging.Handler(logging.ERROR)
    handler.emit = lambda record: faults.append(record.getMessage())
    logger.addHandler(handler)
    try:
        series = stack.series
    finally:
        logger.removeHandler(handler)
    if faults:
        raise ValueError(faults[0].partition("> ")[2] or faults[0])
    return series


def _layout(page: "TiffPage | TiffFrame") -> "TiffPage":
    """The page that holds a page's tags: itself, or the key frame where tifffile skipped reading the tags of a long stack."""
    return cast("TiffPage", page.keyframe)


def _frames_of(stack, page, series):
    """Functions that read the frames of one page: its picture, and planes stored after it without pages."""
    key = _layout(page)
    check_size(key.imagewidth, key.imagelength)
    planes = series.size // page.size if series is not None and page.size else 1
    if planes == 1 and key.imagedepth == 1:
        return [partial(_read, stack, page)]
    if key.imagedepth > 1 or series.dataoffset is None:
        raise ValueError(f"it holds {planes * key.imagedepth} planes in one page in an unknown layout")
    return [partial(_read_behind, stack, page, series.dataoffset + number * page.nbytes) for number in range(planes)]


def _check_extent(stack, page):
    """Refuse a page with data missing or beyond the end of the file, which would be read as 0."""
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
    """The values of the colours; alpha is kept if the colours are not multiplied by it."""
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
    if name in ("MINISBLACK", "RGB") or (name == "YCBCR" and key.compression.name == "JPEG"):     # the codec converts it to RGB
        return values
    raise ValueError(f"its photometric interpretation {name} is not supported")


def _negative(values, key):
    """Values of white-is-zero, inverted."""
    if values.dtype.kind == "f":
        return -values
    if values.dtype.kind == "b":
        return ~values
    if values.dtype.kind == "i":
        return -values.astype(np.int64)
    return (2**key.bitspersample - 1 - values.astype(np.uint64)).astype(values.dtype)


def video_frames(file: Path) -> Iterator[tuple[int, Callable[[], np.ndarray]]]:
    """Pairs (number, function that gives the frame): (rows, columns) of a deep grey video, (rows, columns, 3) of others."""
    require("av", file)
    import av

    try:
        with av.open(str(file)) as container:
            yield from _decoded(container)
    except av.error.FFmpegError as error:
        raise ValueError(str(error)) from None


def _decoded(container):
    if not container.streams.video:
        raise ValueError("it holds no video")
    stream = container.streams.video[0]
    check_size(stream.width, stream.height)
    if stream.sample_aspect_ratio not in (None, 0, 1):
        raise ValueError(f"its pixels are {stream.sample_aspect_ratio} times as wide as high")
    stream.thread_type, end_s, count = "AUTO", 0.0, 0
    for frame in container.decode(stream):
        if frame.is_corrupt:
            raise ValueError(f"frame {count} is damaged")
        yield count, partial(_values, frame)
        end_s, count = max(end_s, frame.time or 0.0), count + 1
    if count < _ENOUGH * stream.frames or end_s < _ENOUGH * _length_s(container, stream):
        raise ValueError("it ends before its stated length")


def _length_s(container, stream):
    """Start of the last frame in s, as stated by a file with a single stream; 0 if it states none."""
    if len(container.streams) > 1 or not container.duration or not stream.average_rate:
        return 0.0
    return container.duration / 1e6 - 2 / float(stream.average_rate)


def _values(frame):
    bits, grey = max(part.bits for part in frame.format.components), frame.format.name.startswith("gray")
    if bits > _MOST_BITS:
        raise ValueError(f"its frames have {bits} bits ({frame.format.name})")
    deep = bits > 8 and not frame.format.has_palette
    return frame.to_ndarray(format=("gray16le" if grey else "rgb48le") if deep else "rgb24")


_READERS = {**dict.fromkeys(IMAGES + ANIMATIONS, still_frames), **dict.fromkeys(STACKS, tiff_frames),
            **dict.fromkeys(VIDEOS, video_frames)}
