"""Read and check a study's configuration; an error message names the field, the value and the remedy."""

from collections.abc import Collection, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.sensors.library import sensor_file
from softtact.unknown_names import first_fault, known_keys, unknown

SHIPPED = Path(str(resources.files("softtact.studies"))) / "data"     # a copy of the project's config/

_Checked = TypeVar("_Checked", bound=BaseModel)


def here_or_shipped(path: str | Path) -> Path:
    """The named file or, if the working folder has no such file below config/, the one that ships with the package."""
    path = Path(path)
    if path.exists() or path.parts[:1] != ("config",):
        return path
    shipped = SHIPPED.joinpath(*path.parts[1:])
    return shipped if shipped.exists() else path


def found_sensor(name: str | Path) -> Path:
    """The file of a configuration's sensor; it ships with the package where the working folder has none of its name."""
    return here_or_shipped(sensor_file(name))


def read_mapping(path: str | Path) -> dict[str, Any]:
    """The keys and values of a configuration file. Raises InputError if it has none."""
    missing = "there is no such configuration; give the path of one, from the project's folder."
    values = read_yaml(here_or_shipped(path), missing=missing)
    if not isinstance(values, dict):
        raise InputError(f"{path}: it holds no keys; write a configuration such as config/tiny.yaml.")
    return values


def read_over(default: str | Path, path: str | Path) -> dict[str, Any]:
    """The keys and values of a configuration file over those of the default one; a key that it states is taken as a whole."""
    return read_mapping(default) | (read_mapping(path) if Path(path) != Path(default) else {})


def validated(model: type[_Checked], values: object, *, where: str) -> _Checked:
    """`model` from plain values; raises an InputError with the field and the remedy for the first fault."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise InputError(_fault_sentence(model, first_fault(error), where=where)) from None


def _fault_sentence(model, fault, *, where):
    """One sentence on a fault found by pydantic."""
    *parents, last = fault["loc"] or ("",)
    section = f"{where}, at {'.'.join(map(str, parents))!r}" if parents else where
    if fault["type"] == "missing":
        return f"{section}: the key {last!r} is missing; add it."
    if fault["type"] == "extra_forbidden":
        return _sentence(f"{section}: {unknown(last, known_keys(model, parents), kind='key')}")
    at = ".".join(str(part) for part in fault["loc"] if part != "[key]")
    given = "" if isinstance(fault["input"], dict) else f" (it is {fault['input']!r:.60})"
    return _sentence(f"{where}, at {at!r}{given}: {fault['msg'].removeprefix('Value error, ')}")


def refuse_unknown(name: str, known: Collection[str], *, kind: str, where: str) -> None:
    """Raise an `InputError` with the nearest known name if `name` is not one of the `known`."""
    if name not in known:
        raise InputError(_sentence(f"{where}: {unknown(name, known, kind=kind)}"))


def refuse_named_twice(names: Sequence[str], *, where: str) -> None:
    """Raise an `InputError` if a name is there twice."""
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{where}: it names {twice[0]!r} twice; remove one of the two.")


def _sentence(text):
    """The text as a sentence."""
    return text if text.endswith(("?", ".")) else f"{text}."
