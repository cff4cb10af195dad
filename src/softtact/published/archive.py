"""Which files of the published archive lie in a folder, by their names.

    {Flat|Curved}_{Real|Simulation}_{Abaqus|Isaac}[_variant].csv      Flat: indenters, Curved: grasped objects

The names are those that the repository's viewer opens (Lab-CORO/TactileDataset, GUI.py 12-18). Files of the share carry endings
(`_V1`, `_V2`, `_V1_Noise`) and write Isaac as `Issac` too, so a file is known by how its name begins.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from softtact.errors import InputError

SOURCE = "published archive"
WHERE = ("https://github.com/Lab-CORO/TactileDataset, whose README links to a share where each CSV is fetched by a click; "
         "docs/how-to/published_archive.md tells the way")
SETS = {"flat": "Flat", "curved": "Curved"}
MODELS = {"abaqus": "hyperelastic", "isaac": "elastic"}     # the paper's solver of each model
SPELLINGS = {"abaqus": "abaqus", "isaac": "isaac", "issac": "isaac"}
_NAME = re.compile(r"(flat|curved)_(real|simulation)_(abaqus|isaac|issac)(?:_(.*))?", flags=re.IGNORECASE)


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
        """What a folder may hold only one file of."""
        return self.set, self.kind, self.solver


@dataclass(frozen=True)
class Archive:
    """The files that are read. real: {set: [file, ...]}, the first serves;  simulated: {model: {set: file}}."""

    real: dict
    simulated: dict

    def files(self) -> list[ArchiveFile]:
        """All files, real ones first."""
        return [file for files in self.real.values() for file in files] + [
            file for of_set in self.simulated.values() for file in of_set.values()]


def describe(path: Path) -> ArchiveFile | None:
    """The `ArchiveFile` that a path's name tells, or None."""
    found = _NAME.fullmatch(path.stem)
    if path.suffix.lower() != ".csv" or found is None:
        return None
    of_set, kind, solver, variant = found.groups()
    return ArchiveFile(path, of_set.lower(), kind.lower(), SPELLINGS[solver.lower()], variant or "")


def find_archive(folder: str | Path, *, models: Sequence[str], variant: str | None = None) -> Archive:
    """The `Archive` in a folder and those below it, with those of the `models` whose simulation files are there.

    variant: the ending of the files to read ("V1"); None: the only one that is there
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
    """The one file of its kind to be read: that of the `variant`, or else the only one, if it has no other ending."""
    wanted = (variant or "").lower()
    matching = [file for file in files if file.variant.lower() == wanted] if variant is not None else files
    if not matching and len(files) == 1 and not files[0].variant:
        matching = files
    if len(matching) != 1:
        names = " and ".join(str(file.path.relative_to(folder)) for file in files)
        found = "are files of one kind" if len(files) > 1 else "is the only file of its kind"
        raise InputError(f"{folder}: {names} {found}; name the one to read by its ending in 'data.variant' "
                         f"(it is {variant!r}), or take the others away.")
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
