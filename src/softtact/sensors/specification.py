"""The sensor as its YAML file describes it, by its `kind`: sizes in mm, layers, frusta, taxels. No mechanics.

    frusta   `SensorSpec`: a cover on a dielectric with frusta; a file without `kind` is of this one
    layers   `LayersSpec`: one or two plain layers
    solid    `SolidSpec`: any body of elements; it has no maps and no taxels, and so is read by itself (`sensors.solid`)
A new layered kind is a file with its class, and a line in `KINDS` and `AnySpec`.
"""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from softtact.errors import InputError
from softtact.sensors.base import BaseSpec, read_mapping
from softtact.sensors.frusta import ORIENTATIONS, Friction, SensorSpec
from softtact.sensors.layers import LayersSpec
from softtact.sensors.solid import SolidSpec

__all__ = ["KINDS", "ORIENTATIONS", "AnySpec", "BaseSpec", "Friction", "LayersSpec", "SensorSpec", "read_spec",
           "sensor_schema", "spec_from_dict"]

KINDS: dict[str, type[BaseSpec]] = {"frusta": SensorSpec, "layers": LayersSpec}
AnySpec = SensorSpec | LayersSpec


def read_spec(path: str | Path) -> AnySpec:
    """The specification in a sensor file, of the class that its `kind` names; a fault is told with the file and the field."""
    return spec_from_dict(read_mapping(path), where=str(path))


def spec_from_dict(values: dict[str, Any], *, where: str = "sensor") -> AnySpec:
    """The specification of a mapping, of the class that its `kind` names."""
    kind = values.get("kind", "frusta")
    if kind == "solid":
        raise InputError(f"{where}, at 'kind': a solid has no layers and no taxels, which are needed here; press it with `softtact "
                         "press` or `softtact.load_solid_sensor`, or give a sensor of kind frusta or layers.")
    if kind not in KINDS:
        raise InputError(f"{where}, at 'kind': {kind!r} is unknown; use {', '.join(KINDS)} or solid.")
    return KINDS[kind].from_dict(values, where=where)     # type: ignore[return-value]


def sensor_schema() -> dict[str, Any]:
    """JSON schema of a sensor file: one of the kinds."""
    return TypeAdapter(Annotated[AnySpec | SolidSpec, Field(discriminator="kind")]).json_schema()
