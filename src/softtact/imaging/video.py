"""Frames of a video at the depth that it was coded with."""

import importlib.util
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.extras import how_to_install
from softtact.imaging.stills import check_size

_MOST_BITS = 16
_ENOUGH = 0.9     # of the stated length; what ends before was cut off


def video_frames(file: Path) -> Iterator[tuple[int, Callable[[], np.ndarray]]]:
    """Pairs (number, function that gives the frame): (rows, columns) of a deep grey video, (rows, columns, 3) of others."""
    if importlib.util.find_spec("av") is None:
        raise InputError(f"{file}: {how_to_install('av')}")
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
    """Seconds until the last frame begins, as the file states it for its video alone; 0 where it does not."""
    if len(container.streams) > 1 or not container.duration or not stream.average_rate:
        return 0.0
    return container.duration / 1e6 - 2 / float(stream.average_rate)


def _values(frame):
    bits, grey = max(part.bits for part in frame.format.components), frame.format.name.startswith("gray")
    if bits > _MOST_BITS:
        raise ValueError(f"its frames have {bits} bits ({frame.format.name})")
    deep = bits > 8 and not frame.format.has_palette
    return frame.to_ndarray(format=("gray16le" if grey else "rgb48le") if deep else "rgb24")
