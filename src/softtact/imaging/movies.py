"""Movies of images: MP4 (extra `optics`) or GIF by the ending of the file's name."""

import importlib.util
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError, how_to_install
from softtact.files import atomic_path

MOVIES = (".mp4", ".gif")
_COLOURS = 128      # of a GIF's frame


def check_movie(path: str | Path) -> None:
    """Refuse the name of a movie of another kind, and MP4 where its writer is not installed."""
    ending = Path(path).suffix.lower()
    if ending not in MOVIES:
        raise InputError(f"{path}: the file is written as {' or '.join(MOVIES)}; give a name with such an ending.")
    if ending == ".mp4" and importlib.util.find_spec("av") is None:
        raise InputError(f"{path}: {how_to_install('av')}")


def write_movie(path: str | Path, frames: Iterable[np.ndarray], *, fps: float) -> None:
    """Write frames (height, width, 3) uint8, all of one size, whole or not at all; an MP4 loses an odd last row or column.

    fps: frames a second, at least 1 in an MP4
    """
    check_movie(path)
    write = _write_gif if Path(path).suffix.lower() == ".gif" else _write_mp4
    with atomic_path(path) as temporary:
        write(temporary, frames, fps)


def _write_gif(path, frames, fps):
    from PIL import Image

    first, *others = [Image.fromarray(frame).quantize(_COLOURS) for frame in frames]
    first.save(path, format="GIF", save_all=True, append_images=others, duration=round(1000 / fps), loop=0)


def _write_mp4(path, frames, fps):
    import av

    with av.open(str(path), "w", format="mp4") as container:
        stream: Any = container.add_stream("libx264", rate=max(round(fps), 1))
        stream.pix_fmt = "yuv420p"
        for number, frame in enumerate(frames):
            even = np.ascontiguousarray(frame[:frame.shape[0] // 2 * 2, :frame.shape[1] // 2 * 2])
            if not number:
                stream.height, stream.width = even.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        container.mux(stream.encode())
