"""`softtact press` of several meshes: a folder of results for each and a table of all; one that fails does not stop the others."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from softtact.commands.common import show
from softtact.errors import ConvergenceError, InputError, SofttactError
from softtact.outputs import check_output_folder
from softtact.progress import announce

_PICTURES = ("vtu", "plot", "image", "movie")      # options that name a file in each object's folder


@dataclass(frozen=True)
class Column:
    """A number of the table of all objects."""

    name: str
    """Its name in the table's file."""
    title: str
    """Its heading in the printed table."""
    style: str
    """Its format in the printed table: width and digits, or "7s" for yes and no."""
    of: Callable[[dict[str, Any]], float]
    """Its value at the last load step of a summary."""


def last(key: str) -> Callable[[dict[str, Any]], float]:
    """A function that gives the value of a key at the last load step of a summary."""
    return lambda summary: float(summary[key][-1])


def _counts(summary):
    """Sum of the taxels' counts at the last load step; nan without taxels."""
    return float(sum(map(sum, summary["tactile_map"][-1]))) if "tactile_map" in summary else float("nan")


def _last_or_nan(key):
    """A function that gives the value of a key at the last load step; nan where the summary has none."""
    def value(summary: dict[str, Any]) -> float:
        found = summary[key][-1] if key in summary else None
        return float("nan") if found is None else float(found)

    return value


def _force(axis, place):
    return Column(f"force_{axis}_n", f"force {axis}, N", "12.4g", lambda summary: float(summary["load"][-1][place]))


ON_LAYERS = (Column("force_n", "force, N", "9.4g", last("normal_force_n")),
             Column("indentation_mm", "depth, mm", "12.4f", last("indentation_mm")),
             Column("contact_area_mm2", "contact, mm2", "14.1f", last("contact_area_mm2")),
             Column("largest_deformation_mm", "most deformed, mm", "19.4f", last("largest_deformation_mm")),
             Column("counts", "counts", "9.0f", _counts),
             Column("expected_error_mm", "error, mm", "11.4f", _last_or_nan("expected_error_mm")),
             Column("taxels_at_range_end", "at end", "8.0f", _last_or_nan("taxels_at_range_end")),
             Column("valid", "valid", "7s", last("within_validity")))
ON_SOLIDS = (*(_force(axis, place) for place, axis in enumerate("xyz")),
             Column("largest_displacement_mm", "most moved, mm", "16.4f", last("largest_displacement_mm")),
             Column("largest_pressure_mpa", "pressure, MPa", "15.4g", last("largest_pressure_mpa")))


@dataclass(frozen=True)
class Files:
    """The files that a press writes."""

    out: Path | None
    vtu: Path | None
    plot: Path | None
    image: Path | None = None
    movie: Path | None = None

    @property
    def all(self) -> tuple[Path | None, ...]:
        """All of them; None for one that was not asked for."""
        return self.out, self.vtu, self.plot, self.image, self.movie


def is_several(meshes: Sequence[Path]) -> bool:
    """Whether a command line names several meshes, or a folder of them."""
    return len(meshes) > 1 or meshes[0].is_dir()


def press_each(options: argparse.Namespace, press: Callable[..., tuple[dict[str, Any], BaseException | None]],
               columns: Sequence[Column] = ON_LAYERS) -> None:
    """Press each object with press(path, files, label), which returns a summary and the error that ended it early or None.

    columns: of the table of all objects, besides their names, status and model
    After all presses and the table, raises an error of the kind of the first failure.
    """
    objects, rows, folder = _named(options.mesh), [], _folder(options)
    try:
        for number, (name, path) in enumerate(objects.items(), start=1):
            announce(f"softtact press: {number} of {len(objects)}: {path}")
            row, error = _row(name, path, folder / name, options, press, columns)
            rows.append((row, error))
            if error:
                announce(f"softtact press: {name}: {error}")
            if isinstance(error, KeyboardInterrupt):
                raise error
    finally:
        if rows:
            _show(rows, folder, options, columns)
    failed = [(row, error) for row, error in rows if error]
    if failed:
        kind = ConvergenceError if all(isinstance(error, ConvergenceError) for _, error in failed) else InputError
        raise kind(f"{len(failed)} of {len(rows)} objects failed, {', '.join(row['object'] for row, _ in failed)}; the reasons "
                   "are above and in the table; press these again.")


def _named(meshes):
    """{name of its results folder: path} of all meshes, those of a folder sorted by name."""
    from softtact.geometry.formats import meshes_in

    paths: list[Path] = []
    for path in meshes:
        paths += meshes_in(path) if path.is_dir() else [path]
    stems = [path.stem for path in paths]
    names = [path.name if stems.count(path.stem) > 1 else path.stem for path in paths]
    for name, path in zip(names, paths, strict=True):
        if names.count(name) > 1:
            raise InputError(f"{path}: two objects have the file name {name}; rename one, because each gets a folder of that name.")
    return dict(zip(names, paths, strict=True))


def _folder(options):
    """The folder for all results."""
    if options.out is None:
        raise InputError("--out is missing: each of several objects gets a folder of results; give --out a folder for them.")
    if options.out.suffix.lower() == ".nc":
        raise InputError(f"--out {options.out}: each of several objects gets a folder of results; give --out a folder for them.")
    check_output_folder(options.out)
    for name in _PICTURES:
        path = getattr(options, name)
        if path and path.parent != Path("."):
            raise InputError(f"--{name} {path}: each of several objects gets one in its folder; give a name without a folder.")
    return options.out


def _row(name, path, folder, options, press, columns):
    """Press an object and write its files; return its row of the table, and its error or None."""
    files = Files(folder / "press.nc", *(given and folder / given for given in (getattr(options, name) for name in _PICTURES)))
    for old in files.all:
        if old:
            old.unlink(missing_ok=True)     # of an earlier run, so that they are not mistaken for new ones
    try:
        summary, error = press(path, files, label=name)
    except (SofttactError, KeyboardInterrupt) as stop:
        return dict.fromkeys(_names(columns)) | {"object": name, "status": "failed", "message": str(stop)}, stop
    row = {"object": name, "status": "stopped early" if error else "done", "model": summary["model"]}
    return row | {column.name: column.of(summary) for column in columns} | {"message": str(error or "")}, error


def _names(columns):
    return ("object", "status", "model", *(column.name for column in columns), "message")


def _show(rows, folder, options, columns):
    """Write and print the table of all objects."""
    import pandas as pd

    from softtact.files import write_csv

    table = [row for row, _ in rows]
    write_csv(folder / "summary.csv", pd.DataFrame(table, columns=list(_names(columns))))
    show({"objects": table, "written": str(folder)}, as_json=options.json, lines=_lines(table, folder, columns))


def _width(column):
    return int(column.style.partition(".")[0].removesuffix("s"))


def _shown(value, style):
    if style.endswith("s"):
        return "yes" if value else "no"
    return f"{value:{style}}"


def _lines(table, folder, columns=ON_LAYERS):
    width = max(len("object"), *(len(row["object"]) for row in table)) + 2
    titles = "".join(f"{column.title:>{_width(column)}}" for column in columns)
    yield f"{'object':{width}}{'status':15}{'model':14}{titles}"
    for row in table:
        numbers = "" if row["model"] is None else f"{row['model']:14}" + "".join(
            f"{_shown(row[column.name], column.style):>{_width(column)}}" for column in columns)
        yield f"{row['object']:{width}}{row['status']:15}{numbers}".rstrip()
    yield f"written: {folder}"
