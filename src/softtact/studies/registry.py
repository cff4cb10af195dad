"""The kinds of studies: how the configuration of each is read, what its jobs are, what they cost.

A new kind is a folder of `softtact.studies`, a line here, and a file `workflow/rules/KIND.smk`.
"""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.studies.configuration import here_or_shipped, read_mapping, refuse_unknown

if TYPE_CHECKING:
    from softtact.studies.cost import Cost
    from softtact.studies.jobs import Job


@dataclass(frozen=True)
class Kind:
    """A kind of study; functions are named `module:function` and imported when they are called."""

    read: str
    """(path) -> mapping: a configuration file over the defaults of its kind."""
    load: str
    """(mapping, path) -> study: checked, with `.name`; files that it names may be relative to the path's folder."""
    jobs: str
    """(study, results folder) -> [Job]; empty where workflow/rules/KIND.smk itself lists inputs and outputs."""
    costs: str = "softtact.studies.cost:costs_of_jobs"
    """(kind, study, measured, results folder) -> [Cost]."""

    def call(self, what: str, *arguments: Any) -> Any:
        """The result of one of these functions."""
        module, _, function = getattr(self, what).partition(":")
        return getattr(importlib.import_module(module), function)(*arguments)


KINDS = {
    "hybrid": Kind("softtact.studies.hybrid.config:read_values", "softtact.studies.hybrid.config:load_study", "",
                   "softtact.studies.hybrid.cost:costs_of_study"),
    "skin": Kind("softtact.studies.configuration:read_mapping", "softtact.studies.skin.jobs:load",
                 "softtact.studies.skin.jobs:jobs"),
    "palpation": Kind("softtact.studies.configuration:read_mapping", "softtact.studies.palpation.jobs:load",
                      "softtact.studies.palpation.jobs:jobs"),
    "grasps": Kind("softtact.studies.grasps.config:read_values", "softtact.studies.grasps.config:load_study",
                   "softtact.studies.grasps.jobs:jobs"),
}


@dataclass(frozen=True)
class OpenStudy:
    """A checked configuration with its kind."""

    kind: str
    study: Any

    @property
    def name(self) -> str:
        """The study's name, and its folder below results/."""
        return self.study.name

    def jobs(self, folder: str | Path) -> "list[Job]":
        """Its jobs, with their results below a folder."""
        return KINDS[self.kind].call("jobs", self.study, folder)

    def costs(self, measured: Mapping[str, Any], folder: str | Path) -> "list[Cost]":
        """What its stages cost, and what of it is left where results lie in a folder."""
        return KINDS[self.kind].call("costs", self, measured, folder)


def kind_of(values: Mapping[str, Any], *, where: str = "the configuration") -> str:
    """The kind of a configuration; one that states none is of the hybrid study."""
    kind = values.get("kind", "hybrid")
    refuse_unknown(str(kind), list(KINDS), kind="kind of study", where=where)
    return kind


def checked_study(values: Mapping[str, Any], path: str | Path | None = None) -> OpenStudy:
    """The study of a mapping that was read from the file `path`; the first fault becomes an `InputError` of one sentence."""
    kind = kind_of(values, where=str(path or "the configuration"))
    return OpenStudy(kind, KINDS[kind].call("load", values, None if path is None else here_or_shipped(path)))


def open_study(path: str | Path, *, kind: str | None = None) -> OpenStudy:
    """The study of a configuration file, which ships with the package where the working folder has none of its name.

    kind: of a file that need not state it, because a command of that kind reads it
    """
    kind = kind or kind_of(read_mapping(path), where=str(path))
    return OpenStudy(kind, KINDS[kind].call("load", KINDS[kind].call("read", path), here_or_shipped(path)))
