"""The discs of a user's camera frames: a table, an annotated picture of each frame, and a summary."""

import itertools
import os
import shutil
import warnings
from collections.abc import Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.errors import FrameWarning, InputError
from softtact.files import write_csv
from softtact.imaging.discs import discs_and_outlines
from softtact.imaging.light import grey
from softtact.imaging.reading import image_files, is_lossy, read_frames
from softtact.outputs import check_output_folder, check_outputs, refuse_overwriting, target_of, temporary_folder
from softtact.progress import progress
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import pandas as pd


COLOURS = {"whole": "#3fd0ff", "touching": "#ffb000", "clipped": "#ff4d6d"}   # distinct in grey and for the colour-blind
MOST_NUMBERS = 200   # discs; more numbers would overlap
_WIDEST = 9.0        # inches


def draw_discs(frame: np.ndarray, table: "pd.DataFrame", outlines: Sequence[np.ndarray], path: str | Path, *, pixel_mm: float,
               title: str) -> None:
    """Write a PNG: the frame in mm and the outlines (list of (corners, 2) in mm), coloured by kind: whole, touching, clipped."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrameWarning)     # which the detection gave
        light = grey(frame)
    plt = pyplot()
    sides = np.array(light.shape)[::-1] * pixel_mm   # x, y
    inches = sides / sides.max() * _WIDEST
    figure, axes = plt.subplots(figsize=(inches[0] + 1.0, inches[1] + 1.0), layout="constrained")
    axes.imshow(light, cmap="gray", extent=(-sides[0] / 2, sides[0] / 2, sides[1] / 2, -sides[1] / 2), interpolation="nearest")
    kinds = _kinds(table)
    _draw_outlines(axes, outlines, kinds)
    if 0 < len(table) <= MOST_NUMBERS:
        _draw_numbers(axes, table, kinds)
    _draw_scale(axes, sides)
    axes.set(xlabel="x (mm)", ylabel="y (mm), downwards",
             xlim=(-sides[0] / 2, sides[0] / 2), ylim=(sides[1] / 2, -sides[1] / 2))
    axes.set_title(f"{title}: {_words(table)}", loc="left")
    save(figure, path)


def _kinds(table):
    return np.select([table.clipped, table.touching], ["clipped", "touching"], "whole")


def _draw_outlines(axes, outlines, kinds):
    from matplotlib.collections import LineCollection

    for kind, colour in COLOURS.items():
        lines = [outline for outline, of in zip(outlines, kinds, strict=True) if of == kind]
        if lines:
            axes.add_collection(LineCollection(lines, colors=colour, linewidths=1.0, label=f"{kind} ({len(lines)})"))
    if len(outlines):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _draw_numbers(axes, table, kinds):
    for disc, x, y, kind in zip(table.disc, table.x_mm, table.y_mm, kinds, strict=True):
        axes.text(x, y, disc, color=COLOURS[kind], ha="center", va="center", fontsize=8, clip_on=True,
                  bbox={"facecolor": "black", "alpha": 0.6, "pad": 0.6, "linewidth": 0})


def _draw_scale(axes, sides):
    """Draw a scale bar of a round length near a fifth of the width, above the frame's upper right corner."""
    length = _round(0.2 * sides[0])
    y = -0.5 * sides[1] - 0.015 * sides.max()
    axes.plot([sides[0] / 2 - length, sides[0] / 2], [y, y], color="black", linewidth=3, solid_capstyle="butt", clip_on=False)
    axes.annotate(f"{length:g} mm", (sides[0] / 2 - length / 2, y), (0, 3), textcoords="offset points", ha="center", va="bottom",
                  annotation_clip=False)


def _round(length):
    """The largest of 1, 2 or 5 times a power of ten that is not above a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return max(factor * power for factor in (1, 2, 5) if factor * power <= length)


def _words(table):
    if table.empty:
        return "no disc"
    return f"{len(table)} disc{'s' if len(table) > 1 else ''}, {table.area_mm2.sum():.4g} mm² in all"


def report_discs(frames: str | Path, out: str | Path, *, picture: str | Path | None, pixel_mm: float, smallest_mm: float = 0.0,
                 every: int = 1, transfer: str | None = None) -> dict[str, Any]:
    """Write the table `out` (CSV) of all discs in the frames of a file or folder and their pictures; return the summary.

    picture: a PNG for a single frame, a folder for several, or None; a name without an ending suits both
    transfer: from values to light, see `softtact.imaging.light.grey`; None is linear, with a warning if a file states another
    The summary's warnings are {sentence: [names of frames]}.
    """
    warned: dict[str, list[str]] = {}
    stream = _collecting(read_frames(frames, every=every), warned, encoding=transfer is None)
    first = list(itertools.islice(stream, 2))   # one frame or several, without reading all
    target = _picture_path(picture, single=len(first) == 1)
    _check_places(frames, out, target)
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
    """The pairs (name, frame). Warnings of their readers are added to `warned`, those on the encoding only if `encoding`."""
    while True:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", FrameWarning)
            pair = next(frames, None)
        if pair is None:
            return
        _keep_warnings(warned, caught if encoding else [], pair[0])
        yield pair


def _detect(name, frame, warned, **how):
    """Table and outlines of one frame; warnings are added to `warned`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FrameWarning)
        try:
            table, outlines = discs_and_outlines(frame, **how)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    _keep_warnings(warned, caught, name)
    table.insert(0, "frame", name)
    return table, outlines


def _keep_warnings(warned, caught, name):
    """Add a frame to the warnings {sentence: [frames]}; warnings of other kinds are issued again."""
    for warning in caught:
        if issubclass(warning.category, FrameWarning):
            warned.setdefault(str(warning.message), []).append(name)
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)


def _row(name, table):
    """The summary of a frame."""
    return {"frame": name, "discs": len(table), "mean_area_mm2": float(table.area_mm2.mean()) if len(table) else None,
            "total_area_mm2": float(table.area_mm2.sum()), "clipped": int(table.clipped.sum()),
            "touching": int(table.touching.sum())}


def _picture_path(picture, *, single):
    """Path of the pictures: a file for a single frame, a folder for several."""
    if picture is None:
        return None
    picture = Path(picture)
    if single:
        return picture if picture.suffix.lower() == ".png" else picture.with_name(f"{picture.name}.png")
    if picture.suffix.lower() == ".png":
        raise InputError(f"{picture}: there are several frames, with a picture each; give --picture a folder.")
    return picture


def _check_places(frames, out, target):
    """Refuse a table or pictures that cannot be written, or would overwrite frames."""
    files = image_files(frames)
    single = target is not None and target.suffix.lower() == ".png"
    check_outputs(out, target if single else None)
    if target is not None and not single:
        check_output_folder(target)
    folder = target is not None and target.is_dir()
    refuse_overwriting(files, {"--out": Path(out), "--picture": None if folder else target})
    if folder and len(files) > 1 and target.samefile(files[0].parent):
        raise InputError(f"--picture {target}: it is the folder of the frames, which would be overwritten; choose another.")


def _file_name(name):
    """A picture's file name: the frame's with its ending, since a.png and a.tif may be in one folder."""
    return f"{name.replace(':', '_')}.png" if ":" in name or not name.lower().endswith(".png") else name


@contextmanager
def _pictures(target):
    """A temporary folder whose pictures move to the target at the end; None without a target."""
    if target is None:
        yield None
        return
    with temporary_folder(next(one for one in target.parents if one.exists())) as folder:
        yield folder
        drawn = sorted(folder.iterdir())
        if target.suffix.lower() == ".png":
            os.replace(drawn[0], target_of(target))
            return
        target.mkdir(parents=True, exist_ok=True)
        for file in drawn:
            shutil.move(file, target / file.name)
