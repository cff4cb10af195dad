"""Sections of a file that allow only known keys, and the nearest known name for an unknown one."""

import difflib
from collections.abc import Collection, Iterable
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails


class Section(BaseModel):
    """A mapping of a file that allows only known keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def unknown(name: object, known: Collection[object], *, kind: str) -> str:
    """A message that there is no `kind` called `name`, with the nearest of the `known` names."""
    near = difflib.get_close_matches(str(name), [str(right) for right in known], n=1)
    remedy = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(map(str, known)) or 'none'}"
    return f"there is no {kind} {name!r}; {remedy}"


def nearest(name: object, known: Iterable[str]) -> str:
    """` (did you mean ...?)` with the known name nearest to `name`; empty if none is near."""
    near = difflib.get_close_matches(str(name), known, n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


def known_keys(model: type[BaseModel], path: Iterable[Any]) -> list[str]:
    """Keys of the section at `path` below a pydantic model; of all candidates if the section can be one of several."""
    models = [model]
    for key in path:     # a list's index, an entry's name and a section's kind lead to no other model
        below = [found for model in models if key in model.model_fields for found in _models(model.model_fields[key].annotation)]
        models = below or models
    return [name for model in models for name in model.model_fields]


def first_fault(error: ValidationError) -> ErrorDetails:
    """The fault of a pydantic ValidationError to report: a misspelt key comes before the key that is missing because of it."""
    return min(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")


def _models(annotation):
    """The pydantic models in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]
