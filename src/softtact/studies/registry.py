"""The kinds of studies, with the functions that read their configurations, list their jobs and estimate their costs.

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
    """A kind of study; functions are given as `module:function` and imported when called."""

    read: str
    """(path) -> mapping: a configuration file merged into the defaults of its kind."""
    load: str
    """(mapping, path) -> checked study with `.name`; paths in it may be relative to the folder of `path`."""
    jobs: str
    """(study, results folder) -> [Job]; empty if workflow/rules/KIND.smk itself lists inputs and outputs."""
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
    "decide": Kind("softtact.studies.decide.config:read_values", "softtact.studies.decide.config:load_study",
                   "softtact.studies.decide.jobs:jobs"),
    "markers": Kind("softtact.studies.markers.config:read_values", "softtact.studies.markers.config:load_study",
                    "softtact.studies.markers.jobs:jobs"),
    "real": Kind("softtact.studies.real.config:read_values", "softtact.studies.real.config:load_study",
                 "softtact.studies.real.jobs:jobs"),
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
        """The costs of its stages, and of the jobs not yet finished in a results folder."""
        return KINDS[self.kind].call("costs", self, measured, folder)


def kind_of(values: Mapping[str, Any], *, where: str = "the configuration") -> str:
    """The kind of a configuration; hybrid by default."""
    kind = values.get("kind", "hybrid")
    refuse_unknown(str(kind), list(KINDS), kind="kind of study", where=where)
    return kind


def checked_study(values: Mapping[str, Any], path: str | Path | None = None) -> OpenStudy:
    """The study of a mapping from the file `path`; raises an InputError of one sentence for the first fault."""
    kind = kind_of(values, where=str(path or "the configuration"))
    return OpenStudy(kind, KINDS[kind].call("load", values, None if path is None else here_or_shipped(path)))


def open_study(path: str | Path, *, kind: str | None = None) -> OpenStudy:
    """The study of a configuration file in the working folder or, if it is not there, in the package.

    kind: of the study, if the file need not state it because a command of that kind reads it
    """
    kind = kind or kind_of(read_mapping(path), where=str(path))
    return OpenStudy(kind, KINDS[kind].call("load", KINDS[kind].call("read", path), here_or_shipped(path)))
