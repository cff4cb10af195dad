"""The contents of a sensor's YAML file, by its `kind`: sizes in mm, layers, frusta, taxels. No mechanics.

    frusta   `SensorSpec`: a cover on a dielectric with frusta; the kind of a file without `kind`
    layers   `LayersSpec`: one or two plain layers
    solid    `SolidSpec`: any body of elements
    skin     `SkinSpec`: a robot skin, by the design of `softtact skin`
To add a kind, add a file with its class, a line to `KINDS`, and one to `press.kinds.KINDS` for loading and pressing it.
"""

from functools import reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from softtact.errors import InputError
from softtact.sensors.base import DEFAULT_KIND, BaseSpec, Specification, read_mapping
from softtact.sensors.frusta import ORIENTATIONS, Friction, SensorSpec
from softtact.sensors.layers import LayersSpec
from softtact.sensors.skin import SkinSpec
from softtact.sensors.solid import SolidSpec

__all__ = ["KINDS", "ORIENTATIONS", "AnySpec", "BaseSpec", "Friction", "LayersSpec", "SensorSpec", "any_spec", "read_any_spec",
           "read_spec", "sensor_schema", "spec_from_dict"]

KINDS: dict[str, type[Specification]] = {"frusta": SensorSpec, "layers": LayersSpec, "solid": SolidSpec, "skin": SkinSpec}
AnySpec = SensorSpec | LayersSpec     # any of layers


def read_any_spec(path: str | Path) -> Specification:
    """The specification in a sensor file, of the class that its `kind` names; a fault names the file and the field."""
    return any_spec(read_mapping(path), where=str(path), folder=Path(path).parent)


def any_spec(values: dict[str, Any], *, where: str = "sensor", folder: Path = Path()) -> Specification:
    """The specification of a mapping, of the class that its `kind` names; `folder`: to which its paths are relative."""
    kind = values.get("kind", DEFAULT_KIND)
    if kind not in KINDS:
        *names, last = KINDS
        raise InputError(f"{where}, at 'kind': {kind!r} is unknown; use {', '.join(names)} or {last}.")
    return KINDS[kind].from_dict(values, where=where, folder=folder)


def read_spec(path: str | Path) -> AnySpec:
    """The specification in the file of a sensor of layers; InputError where it is of another kind."""
    return _layered(read_any_spec(path))


def spec_from_dict(values: dict[str, Any], *, where: str = "sensor") -> AnySpec:
    """The specification of a mapping that describes a sensor of layers."""
    return _layered(any_spec(values, where=where))


def _layered(spec):
    spec.need_layers()
    return spec


def sensor_schema() -> dict[str, Any]:
    """JSON schema of a sensor file: one of the kinds, but skins, whose files are designs with a schema of their own."""
    described = [spec for spec in KINDS.values() if spec is not SkinSpec]
    return TypeAdapter(Annotated[reduce(or_, described), Field(discriminator="kind")]).json_schema()  # type: ignore[arg-type]
