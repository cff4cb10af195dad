"""A study as a list of jobs, each a stage on files. The workflow makes its rules from them; `run_jobs` runs them without it.

A stage is `softtact.studies.KIND.stages.NAME` with a function `run(*, inputs, outputs, settings, threads)`, or a function NAME of
a module in that package (or of the module `stages` itself).
"""

import importlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import softtact
from softtact.errors import InputError
from softtact.files import read_json, write_json
from softtact.outputs import held, refuse_overwriting
from softtact.progress import announce
from softtact.studies.code_closure import code_digest

SOURCE = Path(softtact.__file__).parents[1]
RECORD = ".made.json"
Paths = Mapping[str, "str | Sequence[str]"]


@dataclass(frozen=True)
class Job:
    """A stage on files."""

    stage: str
    """Its name, also of the rule, the log and the benchmark."""
    inputs: Paths
    """{name: path or paths} of the files that it reads."""
    outputs: Paths
    """{name: path or paths} of the files that it writes; a `{wildcard}` distinguishes the jobs of a stage."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """JSON values: only those that the stage uses, because a change of them reruns it."""
    wildcards: Mapping[str, str] = field(default_factory=dict)
    """{wildcard: value} in the outputs' names."""
    work: Mapping[str, float] = field(default_factory=dict)
    """{unit: number}: amounts of work, from which config/costs.yaml gives its time."""
    threads: int = 1
    """Cores that it uses in a workflow."""

    @property
    def label(self) -> str:
        """The job in words."""
        return " ".join([self.stage, *self.wildcards.values()])

    def made(self) -> dict[str, str | list[str]]:
        """The outputs with the wildcards' values in place."""
        def named(path):
            return path.format(**self.wildcards)

        return {name: named(paths) if isinstance(paths, str) else list(map(named, paths)) for name, paths in self.outputs.items()}


def paths_of(named: Mapping[str, Any]) -> list[str]:
    """The paths of named inputs or outputs as one list."""
    return [path for paths in named.values() for path in ([paths] if isinstance(paths, str) else paths)]


def figure_files(folder: str, name: str) -> dict[str, str]:
    """The outputs of a job that draws a figure into a study's results folder."""
    return {kind: f"{folder}/figures/{name}.{kind}" for kind in ("png", "svg")}


def from_here(path: str | Path) -> str:
    """A path below the working folder relative to it, so that a job does not rerun when that folder is moved; else unchanged."""
    path = Path(path)
    return os.path.relpath(path) if path.resolve().is_relative_to(Path.cwd().resolve()) else str(path)


def files_made(jobs: Sequence[Job], start: str, end: str = "") -> list[str]:
    """The paths among the outputs of some jobs that start with `start` and end with `end`, in their order."""
    return [path for job in jobs for path in paths_of(job.made()) if path.startswith(start) and path.endswith(end)]


def stage_source(stage: str, *, source: Path = SOURCE) -> str:
    """`module` or `module:function` of a stage KIND.NAME, found without importing it."""
    kind, _, name = stage.partition(".")
    place = source / "softtact/studies" / kind / "stages"
    if (place / f"{name}.py").is_file() and not name.startswith("_"):
        return f"softtact.studies.{kind}.stages.{name}"
    for path in [place.with_suffix(".py"), *sorted(place.glob("[!_]*.py"))]:
        if path.is_file() and name in _functions(path):
            return ".".join(path.with_suffix("").relative_to(source).parts) + f":{name}"
    known = ", ".join(stages_of(kind, source=source)) or "those of a kind of study"
    raise InputError(f"there is no stage {stage!r}; the stages are {known}.")


def stages_of(kind: str, *, source: Path = SOURCE) -> list[str]:
    """The names KIND.NAME of all stages of a kind of study."""
    place = source / "softtact/studies" / kind / "stages"
    paths = [path for path in [place.with_suffix(".py"), *place.glob("[!_]*.py")] if path.is_file()]
    names = {name for path in paths for name in (["run"] if "run" in _functions(path) else _functions(path))
             for name in [path.stem if name == "run" else name]}
    return sorted(f"{kind}.{name}" for name in names)


def _functions(path: Path) -> list[str]:
    """The stages among a module's functions."""
    return re.findall(r"^def ([a-z]\w*)\(\*, inputs", path.read_text(encoding="utf-8"), flags=re.MULTILINE)


def find_stage(stage: str) -> Callable[..., None]:
    """Import and return the function of a stage KIND.NAME."""
    module, _, function = stage_source(stage).partition(":")
    return getattr(importlib.import_module(module), function or "run")


def run_jobs(kind: str, jobs: Sequence[Job], folder: str | Path, *, threads: int = 1, label: str = "") -> None:
    """Run the unfinished jobs of a study in this process, in their order.

    A job is finished if its outputs exist and were made from the same inputs, settings and code, of which `.made.json` in the
    folder holds a hash. A job that fails ends the run; earlier outputs are kept.
    """
    folder = Path(folder)
    with held(folder):
        record = _Record(folder)
        for number, job in enumerate(jobs, start=1):
            digest = _job_digest(kind, job)
            if record.has(job, digest):
                continue
            announce(f"{label or folder.name}: {number}/{len(jobs)} {job.label}")
            record.forget(job)
            inputs, outputs = ({name: Path(paths) if isinstance(paths, str) else [Path(path) for path in paths]
                                for name, paths in named.items()} for named in (job.inputs, job.made()))
            refuse_overwriting(map(Path, paths_of(job.inputs)), {path: Path(path) for path in paths_of(job.made())})
            find_stage(f"{kind}.{job.stage}")(inputs=inputs, outputs=outputs, settings=json.loads(json.dumps(job.settings)),
                                              threads=threads)
            record.keep(job, digest)


class _Record:
    """The file with {first output: hash of inputs, settings and code} of the finished jobs of a folder."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / RECORD
        try:
            self._digests = read_json(self._path)
        except InputError:     # missing or damaged: all jobs run
            self._digests = {}

    def has(self, job: Job, digest: str) -> bool:
        made = paths_of(job.made())
        return self._digests.get(made[0]) == digest and all(Path(path).exists() for path in made)

    def forget(self, job: Job) -> None:
        if self._digests.pop(paths_of(job.made())[0], None) is not None:
            write_json(self._path, self._digests)

    def keep(self, job: Job, digest: str) -> None:
        self._digests[paths_of(job.made())[0]] = digest
        write_json(self._path, self._digests)


def _job_digest(kind, job):
    """Hash of everything that determines a job's outputs: its settings, the contents of its inputs, the code of its stage."""
    found = sha256(code_digest(stage_source(f"{kind}.{job.stage}"), source=SOURCE).encode())
    found.update(json.dumps([job.stage, job.settings], sort_keys=True).encode())
    for name, paths in job.inputs.items():
        found.update(name.encode())
        for path in [paths] if isinstance(paths, str) else paths:
            if not Path(path).is_file():
                raise InputError(f"{path}: there is no such file, which {job.label} reads.")
            found.update(sha256(Path(path).read_bytes()).digest())
    return found.hexdigest()
