"""Frames from files: an image, a folder of images, the pages of a TIFF, a video. One frame is in memory at a time."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.imaging.stills import still_frames
from softtact.imaging.tiff import tiff_frames
from softtact.imaging.video import video_frames

IMAGES = (".png", ".jpg", ".jpeg", ".bmp")
STACKS = (".tif", ".tiff")
VIDEOS = (".mp4", ".avi", ".mov", ".mkv")
ANIMATIONS = (".gif",)
LOSSY = (".jpg", ".jpeg", *VIDEOS)
_READERS = {**dict.fromkeys(IMAGES + ANIMATIONS, still_frames), **dict.fromkeys(STACKS, tiff_frames),
            **dict.fromkeys(VIDEOS, video_frames)}


def read_frames(path: str | Path, *, every: int = 1) -> Iterator[tuple[str, np.ndarray]]:
    """Pairs (name, frame) of a file, or of the images in a folder in order of name; each `every`-th of them.

    A frame is (rows, columns) or (rows, columns, channels) in the file's own depth, and its values grow with light. Frames of a
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
    return Path(name.partition(":")[0]).suffix.lower() in LOSSY


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
    """Pairs (name, frame) of one file; the only frame of an image bears the file's own name."""
    if not file.is_file():
        raise InputError(f"{file}: there is no such file.")
    with _in_one_sentence(file):
        number = -1
        for number, (own, read) in enumerate(_reader(file)(file)):
            if number % every == 0:
                yield file.name if own is None else f"{file.name}:{own:05d}", read()
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
    """Whatever a reader raises becomes one sentence that names the file."""
    try:
        yield
    except InputError as error:
        raise error if str(error).startswith(str(file)) else InputError(f"{file}: {error}") from None
    except Exception as error:     # of a damaged file, decoders raise anything
        kind = "video" if file.suffix.lower() in VIDEOS else "image"
        raise InputError(f"{file}: not a readable {kind} ({_short(error)}); save it again, or convert it to PNG.") from None


def _short(error):
    """The first line of what a reader said."""
    lines = str(error).splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__
