"""Frames from files: an image, a folder of images, the pages of a TIFF, a video. One frame is in memory at a time."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import tifffile

from softtact.errors import InputError
from softtact.extras import how_to_install

IMAGES = (".png", ".jpg", ".jpeg", ".bmp")
STACKS = (".tif", ".tiff")
VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".gif")


def read_frames(path: str | Path, *, every: int = 1) -> Iterator[tuple[str, np.ndarray]]:
    """Pairs (name, frame) of a file, or of the images in a folder in order of name; each `every`-th of them.

    A frame is (rows, columns) or (rows, columns, channels) in the file's own depth. Frames of a video and pages of a TIFF are
    named after the file and their number, from 0: clip.mp4:00012.
    """
    files = image_files(path)
    if len(files) == 1:
        yield from _numbered(files[0], every=every)
        return
    for file in files[::every]:
        yield from _numbered(file, every=1)


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
    return next(_frames(Path(file)))


def _numbered(file, *, every):
    """Pairs (name, frame) of one file; a single frame bears the file's own name."""
    single = file.suffix.lower() in IMAGES or (file.suffix.lower() in STACKS and _pages(file) == 1)
    for number, frame in enumerate(_frames(file)):
        if number % every == 0:
            yield file.name if single else f"{file.name}:{number:05d}", frame


def _frames(file):
    """The frames of one file; whatever its reader raises becomes one sentence."""
    if not Path(file).is_file():
        raise InputError(f"{file}: there is no such file.")
    kind, found = file.suffix.lower(), False
    try:
        for frame in _reader(kind)(file):
            found = True
            yield frame
    except (OSError, ValueError, SyntaxError, EOFError, IndexError, KeyError, RuntimeError) as error:
        raise InputError(f"{file}: not a readable {'video' if kind in VIDEOS else 'image'} ({_short(error)}); "
                         "save it again, or convert it to PNG.") from None
    if not found:
        raise InputError(f"{file}: holds no frame; save it again.")


def _reader(kind):
    """The function that gives the frames of a file of this kind."""
    if kind in STACKS:
        return _tiff
    if kind in IMAGES:
        return lambda file: [iio.imread(file, plugin="pillow")]
    if kind in VIDEOS:
        return _video
    raise ValueError(f"{kind or 'no ending'} is none of {' '.join(IMAGES + STACKS + VIDEOS)}")


def _video(file):
    if importlib.util.find_spec("av") is None:
        raise InputError(f"{file}: {how_to_install('av')}")
    return iio.imiter(file, plugin="pyav")


def _tiff(file):
    with tifffile.TiffFile(file) as stack:
        for page in stack.pages:
            colours_first = page.axes.startswith("S")   # planes of colour, one after the other
            yield page.asarray().transpose(1, 2, 0) if colours_first else page.asarray()


def _pages(file):
    """Number of pages of a TIFF; 1 where it cannot be read, which reading it will tell."""
    try:
        with tifffile.TiffFile(file) as stack:
            return len(stack.pages)
    except (OSError, ValueError):
        return 1


def _short(error):
    """The first line of what a reader said."""
    lines = str(error).splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__
