"""Files of the published archive in a folder, the arrangement of its taxels, and its number of maps.

    {Flat|Curved}_{Real|Simulation}_{Abaqus|Isaac}[_variant].csv      Flat: indenters, Curved: grasped objects

The names are those that the repository's viewer opens (Lab-CORO/TactileDataset, GUI.py 12-18). Files of the share have endings
(`_V1`, `_V2`, `_V1_Noise`) and some write Isaac as `Issac`, so a file is recognised by the start of its name.

The arrangement of tax1 to tax28 under the map is not documented. It is inferred: the mean depth over each taxel's part of the map
is correlated with the counts, for each of the eight orders that number a grid by rows or columns from any corner, and the order
with the largest correlation is taken.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.errors import InputError

SOURCE = "published archive"
WHERE = ("https://github.com/Lab-CORO/TactileDataset, whose README links to a share where each CSV is fetched by a click; "
         "see docs/how-to/published_archive.md")
SETS = {"flat": "Flat", "curved": "Curved"}
MODELS = {"abaqus": "hyperelastic", "isaac": "elastic"}     # the paper's solver of each model
SPELLINGS = {"abaqus": "abaqus", "isaac": "isaac", "issac": "isaac"}
_NAME = re.compile(r"(flat|curved)_(real|simulation)_(abaqus|isaac|issac)(?:_(.*))?", flags=re.IGNORECASE)
ARRANGEMENTS = [f"{order}{flip}" for order in ("rows", "columns") for flip in ("", "_x", "_y", "_xy")]
PRINTED = [  # quantity, source, printed number
    ("real maps", "abstract", 53400),
    ("real maps", "repository", 15400),
    ("maps of hyperelastic", "repository", 15400),
    ("maps of elastic", "repository", 15400),
    ("real maps", "text", 15400),
    ("real maps of indenters to train on", "text", 13000),
    ("real maps of unseen indenters", "text", 400),
    ("real maps of objects", "text", 2000),
]

# Mean SSIM that the paper prints (sec. 4.2), by set and model.
PRINTED_SSIM = {"validation": {"hyperelastic": 0.87, "elastic": 0.86}, "unseen": {"hyperelastic": 0.81, "elastic": 0.82},
                "grasps": {"hyperelastic": 0.72, "elastic": 0.63}}
# Maps as the paper counts them: 13,000 to train, 400 unseen cases, 2,000 grasps of 20 maps each, from closing to held.
MAPS_OF_SETS, MAPS_OF_A_GRASP, ALL_MAPS = (13_000, 400, 2_000), 20, 53_400


@dataclass(frozen=True)
class ArchiveFile:
    """One CSV of the archive. set: flat or curved;  kind: real or simulation;  solver: abaqus or isaac;  variant: V1, ... or ''."""

    path: Path
    set: str
    kind: str
    solver: str
    variant: str

    @property
    def stands_for(self) -> tuple[str, str, str]:
        """The kind of file of which a folder may hold only one."""
        return self.set, self.kind, self.solver


@dataclass(frozen=True)
class Archive:
    """The files to read. real: {set: [file, ...]}, of which the first is used;  simulated: {model: {set: file}}."""

    real: dict
    simulated: dict

    def files(self) -> list[ArchiveFile]:
        """All files, real ones first."""
        return [file for files in self.real.values() for file in files] + [
            file for of_set in self.simulated.values() for file in of_set.values()]


def describe(path: Path) -> ArchiveFile | None:
    """The `ArchiveFile` of a path's name, or None."""
    found = _NAME.fullmatch(path.stem)
    if path.suffix.lower() != ".csv" or found is None:
        return None
    of_set, kind, solver, variant = found.groups()
    return ArchiveFile(path, of_set.lower(), kind.lower(), SPELLINGS[solver.lower()], variant or "")


def find_archive(folder: str | Path, *, models: Sequence[str], variant: str | None = None) -> Archive:
    """The `Archive` in a folder and its subfolders, with those of the `models` that have simulation files.

    variant: the ending of the files to read ("V1"); None: the only one that exists
    """
    files = _files_in(folder)
    chosen = {key: _choose(folder, [file for file in files if file.stands_for == key], variant)
              for key in sorted({file.stands_for for file in files})}
    real = {name: [chosen[name, "real", solver] for solver in MODELS if (name, "real", solver) in chosen] for name in SETS}
    simulated = {model: {name: chosen[name, "simulation", solver] for name in SETS if (name, "simulation", solver) in chosen}
                 for solver, model in MODELS.items()}
    complete = {model: simulated[model] for model in models if len(simulated.get(model, ())) == len(SETS)}
    _check_complete(folder, real, complete, models)
    return Archive(real, complete)


def _files_in(folder):
    if not Path(folder).is_dir():
        raise InputError(f"{folder}: there is no such folder; put the archive's CSV files there or correct 'data.folder'. "
                         f"They come from {WHERE}.")
    return [file for file in map(describe, sorted(Path(folder).rglob("*.*"))) if file]


def _choose(folder, files, variant):
    """The file to read of its kind: that of the `variant`, or the only one if it has no ending."""
    wanted = (variant or "").lower()
    matching = [file for file in files if file.variant.lower() == wanted] if variant is not None else files
    if not matching and len(files) == 1 and not files[0].variant:
        matching = files
    if len(matching) != 1:
        names = " and ".join(str(file.path.relative_to(folder)) for file in files)
        found = "are files of one kind" if len(files) > 1 else "is the only file of its kind"
        raise InputError(f"{folder}: {names} {found}; name the one to read by its ending in 'data.variant' "
                         f"(it is {variant!r}), or remove the others.")
    return matching[0]


def _check_complete(folder, real, simulated, models):
    for name, title in SETS.items():
        if not real[name]:
            raise InputError(f"{folder}: there is no file {title}_Real_Abaqus*.csv; put it there. It comes from {WHERE}.")
    if not simulated:
        solvers = [solver.capitalize() for solver, model in MODELS.items() if model in models]
        wanted = " or ".join(f"Flat_Simulation_{name}*.csv with Curved_Simulation_{name}*.csv" for name in solvers)
        raise InputError(f"{folder}: there is no {wanted or 'simulation of a tested model'}; put both there. "
                         f"They come from {WHERE}.")


def arrange(counts: np.ndarray, arrangement: str, *, shape: tuple[int, int]) -> np.ndarray:
    """Counts (n, taxel) as tactile maps (n, row, column) of `shape`; `_x` and `_y`: numbered from the upper end of that axis."""
    order, _, flips = arrangement.partition("_")
    rows, columns = shape
    maps = counts.reshape(-1, rows, columns) if order == "rows" else counts.reshape(-1, columns, rows).swapaxes(1, 2)
    return np.ascontiguousarray(maps[:, ::-1 if "y" in flips else 1, ::-1 if "x" in flips else 1])


def taxel_depths(maps_mm: np.ndarray, *, shape: tuple[int, int]) -> np.ndarray:
    """Mean of maps (n, y, x) over each taxel's part of the grid: (n, row, column)."""
    rows, columns = (np.array_split(np.arange(size), parts) for size, parts in zip(maps_mm.shape[1:], shape, strict=True))
    return np.stack([np.stack([maps_mm[:, r[:, None], c].mean(axis=(1, 2)) for c in columns], axis=-1) for r in rows], axis=1)


def correlations(maps_mm: np.ndarray, counts: np.ndarray, *, shape: tuple[int, int]) -> dict[str, float]:
    """{arrangement: correlation over the taxels of depth and counts, each minus its mean over the map}.

    maps_mm (n, y, x);  counts (n, taxel).  Without that subtraction a strong press would correlate with any arrangement.
    """
    depth = _within(taxel_depths(maps_mm, shape=shape))
    return {name: _correlation(depth, _within(arrange(counts, name, shape=shape))) for name in ARRANGEMENTS}


def _within(values):
    return values - values.mean(axis=(1, 2), keepdims=True)


def _correlation(a, b):
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-300))


def counts_table(found: dict[str, int]) -> pd.DataFrame:
    """A row per printed count: what, where, printed, found, meets.  found {what: number}; a missing number means no file."""
    rows = [(what, where, printed, found.get(what), found.get(what) == printed) for what, where, printed in PRINTED]
    return pd.DataFrame(rows, columns=["what", "where", "printed", "found", "meets"])


def counts_sentence(table: pd.DataFrame) -> str:
    """One sentence on which of the three printed counts the archive meets."""
    verdicts = []
    for where, rows in table.groupby("where", sort=False):
        misses = [f"{row.what}: {row.printed} printed, {'no file' if pd.isna(row.found) else int(row.found)} found"
                  for row in rows[~rows.meets].itertuples()]
        verdicts.append(f"the count of the {where} is {'met' if not misses else 'not met (' + ', '.join(misses) + ')'}")
    return f"{'; '.join(verdicts)}.".capitalize()
