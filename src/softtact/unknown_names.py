"""Sections of files whose keys are all known, and the nearest known name for a key or a name that is not."""

import difflib
from collections.abc import Collection, Iterable
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails


class Section(BaseModel):
    """A mapping of a file whose keys are all known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def unknown(name: object, known: Collection[object], *, kind: str) -> str:
    """That there is no `kind` of thing called `name`, with the nearest of the `known`."""
    near = difflib.get_close_matches(str(name), [str(right) for right in known], n=1)
    remedy = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(map(str, known)) or 'none'}"
    return f"there is no {kind} {name!r}; {remedy}"


def nearest(name: object, known: Iterable[str]) -> str:
    """The known name that is nearest to `name`, as an aside in a sentence; empty where none is near."""
    near = difflib.get_close_matches(str(name), known, n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def known_keys(model: type[BaseModel], path: Iterable[Any]) -> list[str]:
    """Keys of the section that the keys `path` lead to from a pydantic model; of all, where it may be one of several."""
    models = [model]
    for key in path:     # the index of a list, the name of an entry, the kind of a section lead no further
        below = [found for model in models if key in model.model_fields for found in _models(model.model_fields[key].annotation)]
        models = below or models
    return [name for model in models for name in model.model_fields]


def first_fault(error: ValidationError) -> ErrorDetails:
    """Of a pydantic ValidationError's faults the one to report: a misspelt key before the right one that is missing for it."""
    return min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")


def _models(annotation):
    """The pydantic models in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]
