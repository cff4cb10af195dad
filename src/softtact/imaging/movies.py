"""Movies of images: MP4 (extra `optics`) or GIF by the ending of the file's name."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError, require
from softtact.files import atomic_path

MOVIES = (".mp4", ".gif")
_COLOURS = 128      # of a GIF's frame


def check_movie(path: str | Path) -> None:
    """Refuse the name of a movie of another kind, and MP4 where its writer is not installed."""
    ending = Path(path).suffix.lower()
    if ending not in MOVIES:
        raise InputError(f"{path}: the file is written as {' or '.join(MOVIES)}; give a name with such an ending.")
    require("av" if ending == ".mp4" else "PIL", path)


def write_movie(path: str | Path, frames: Iterable[np.ndarray], *, fps: float, options: Mapping[str, str] | None = None) -> None:
    """Write frames (height, width, 3) uint8, all of one size, whole or not at all; an MP4 loses an odd last row or column.

    fps: frames a second, at least 1 in an MP4;  options: of the encoder of an MP4, libx264
    """
    check_movie(path)
    with atomic_path(path) as temporary:
        if Path(path).suffix.lower() == ".gif":
            _write_gif(temporary, frames, fps)
        else:
            _write_mp4(temporary, frames, fps, dict(options or {}))


def _write_gif(path, frames, fps):
    from PIL import Image

    first, *others = [Image.fromarray(frame).quantize(_COLOURS) for frame in frames]
    first.save(path, format="GIF", save_all=True, append_images=others, duration=round(1000 / fps), loop=0)


def _write_mp4(path, frames, fps, options):
    import av

    with av.open(str(path), "w", format="mp4") as container:
        stream: Any = container.add_stream("libx264", rate=max(round(fps), 1), options=options)
        stream.pix_fmt = "yuv420p"
        for number, frame in enumerate(frames):
            even = np.ascontiguousarray(frame[:frame.shape[0] // 2 * 2, :frame.shape[1] // 2 * 2])
            if not number:
                stream.height, stream.width = even.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        container.mux(stream.encode())
