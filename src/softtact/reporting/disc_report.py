"""The discs of a user's frames: one table, an annotated picture of each frame, a summary."""

import itertools
import os
import shutil
import tempfile
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd

from softtact.errors import FrameWarning, InputError
from softtact.files import refuse_overwriting, write_csv
from softtact.imaging.discs import discs_and_outlines
from softtact.imaging.reading import image_files, is_lossy, read_frames
from softtact.progress import progress
from softtact.reporting.disc_picture import draw_discs


def report_discs(frames: str | Path, out: str | Path, *, picture: str | Path | None, pixel_mm: float, smallest_mm: float = 0.0,
                 every: int = 1, transfer: str | None = None) -> dict[str, Any]:
    """Write the table `out` (CSV) of all discs in the frames of a file or folder and their pictures; return the summary.

    picture: None for none; a PNG for a single frame, a folder for several; without an ending it becomes the one that fits
    transfer: how values tell light, see `softtact.imaging.light.grey`; None is linear, with a warning where a file says otherwise
    The summary's warnings: {sentence: [names of frames]}
    """
    warned: dict[str, list[str]] = {}
    stream = _collecting(read_frames(frames, every=every), warned, encoding=transfer is None)
    first = list(itertools.islice(stream, 2))   # tells one frame from several without reading them all
    target = _picture_path(picture, single=len(first) == 1)
    _refuse_overwriting(frames, out, target)
    tables, rows = [], []
    with _pictures(target) as drawn:
        for name, frame in progress(itertools.chain(first, stream), label="discs in frames", total="?"):
            table, outlines = _detect(name, frame, warned, pixel_mm=pixel_mm, smallest_mm=smallest_mm,
                                      transfer=transfer or "linear", lossy=is_lossy(name))
            if drawn:
                draw_discs(frame, table, outlines, drawn / _file_name(name), pixel_mm=pixel_mm, title=name)
            tables.append(table)
            rows.append(_row(name, table))
        write_csv(out, pd.concat(tables))
    return {"pixel_mm": pixel_mm, "frames": rows, "table": str(out), "picture": target and str(target), "warnings": warned}


def _collecting(frames, warned, *, encoding):
    """The pairs (name, frame), whose readers' warnings go to `warned`; those of the values' encoding only on demand."""
    while True:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", FrameWarning)
            pair = next(frames, None)
        if pair is None:
            return
        _note(warned, said if encoding else [], pair[0])
        yield pair


def _detect(name, frame, warned, **how):
    """Table and outlines of one frame; warnings go to `warned`."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", FrameWarning)
        try:
            table, outlines = discs_and_outlines(frame, **how)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    _note(warned, said, name)
    table.insert(0, "frame", name)
    return table, outlines


def _note(warned, said, name):
    """Keep the names of the frames that a sentence is said of; other warnings go their way."""
    for warning in said:
        if issubclass(warning.category, FrameWarning):
            warned.setdefault(str(warning.message), []).append(name)
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)


def _row(name, table):
    """A frame's line of the summary."""
    return {"frame": name, "discs": len(table), "mean_area_mm2": float(table.area_mm2.mean()) if len(table) else None,
            "total_area_mm2": float(table.area_mm2.sum()), "clipped": int(table.clipped.sum()),
            "touching": int(table.touching.sum())}


def _picture_path(picture, *, single):
    """Where the pictures go: a file for a single frame, a folder for several."""
    if picture is None:
        return None
    picture = Path(picture)
    if single:
        return picture if picture.suffix.lower() == ".png" else picture.with_name(f"{picture.name}.png")
    if picture.suffix.lower() == ".png":
        raise InputError(f"{picture}: there are several frames, each with its picture; give --picture a folder.")
    if picture.is_file():
        raise InputError(f"{picture}: is a file where the folder of the pictures goes; give --picture another name.")
    return picture


def _refuse_overwriting(frames, out, target):
    """Refuse a table or pictures that would take the place of frames."""
    files = image_files(frames)
    folder = target is not None and target.is_dir()
    refuse_overwriting(files, {"--out": Path(out), "--picture": None if folder else target})
    if folder and len(files) > 1 and target.samefile(files[0].parent):
        raise InputError(f"--picture {target}: it is the folder of the frames, which would be lost; choose another.")


def _file_name(name):
    """A picture's file name: the frame's, with its ending, since a.png and a.tif may lie side by side."""
    return f"{name.replace(':', '_')}.png" if ":" in name or not name.lower().endswith(".png") else name


@contextmanager
def _pictures(target):
    """A folder to draw in, whose pictures move to the target when all is done; None where there is no target."""
    if target is None:
        yield None
        return
    with tempfile.TemporaryDirectory(prefix=f".{target.stem}-", dir=target.parent) as folder:
        yield Path(folder)
        drawn = sorted(Path(folder).iterdir())
        if target.suffix.lower() == ".png":
            os.replace(drawn[0], target)
            return
        target.mkdir(exist_ok=True)
        for file in drawn:
            shutil.move(file, target / file.name)
