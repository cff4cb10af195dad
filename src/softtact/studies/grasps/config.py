"""The configuration of the study of grasps, and its objects."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt

from softtact.errors import InputError
from softtact.robot.settings import load_scene
from softtact.sensors.fields import plain_value
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import AnySpec, read_spec
from softtact.studies.configuration import here_or_shipped, read_mapping, read_over, refuse_named_twice, refuse_unknown, validated
from softtact.studies.hybrid.keys import CatalogueEntry, Law, Name, NotNegative, VirtualSensorKey
from softtact.studies.hybrid.objects import read_catalogue
from softtact.unknown_names import Section

DEFAULT = "config/grasps.yaml"
_Models = Annotated[list[Literal["elastic", "foundation", "hyperelastic"]], Field(min_length=1)]


class Places(Section):
    """Largest distance of a drawn position from the middle of the grip, to either side."""

    x_mm: NotNegative
    y_mm: NotNegative
    angle_deg: NotNegative


class OneEvent(Section):
    """Objects that several models press at the same event, on a cover with the printed constants of a law."""

    objects: list[str]
    models: _Models
    force_n: Annotated[PositiveFloat, BeforeValidator(plain_value)]
    cover_law: Annotated[Law, BeforeValidator(plain_value)]


class GraspValues(Section):
    """The keys of config/grasps.yaml."""

    study: Name = Field(description="its name, and its folder below results/")
    kind: Literal["grasps"] = Field(exclude=True, description="of study")
    seed: Annotated[int, Field(ge=0)] = Field(description="of drawn positions and of the virtual sensor")
    sensor: str = Field(description="name or YAML file of the sensor on both fingers")
    catalogue: str = Field(description="YAML file that lists the objects' meshes")
    objects: Annotated[list[str], Field(min_length=1)] = Field(description="names of the catalogue")
    positions: Annotated[PositiveInt, BeforeValidator(plain_value)] = Field(
        description="of each object: the first centred, the others drawn")
    places: Annotated[Places, BeforeValidator(plain_value)]
    force_n: PositiveFloat = Field(description="that both fingers press with")
    trials: PositiveInt = Field(description="readings of each position by the virtual sensor of both fingers")
    model: Literal["auto", "elastic", "foundation", "hyperelastic"] = Field(description="of the presses; auto: the policy's choice")
    policy: Literal["paper", "error"] = Field(description="for a model: by the object's details, or by the expected error")
    mesh: Literal["draft", "default", "stable", "fine"] = Field(description="preset of the hyperelastic model")
    one_event: OneEvent
    virtual_sensor: dict[VirtualSensorKey, Any] = Field(description="as of a hybrid study")
    scene: dict[str, Any] = Field(description="keys of a scene file that differ from softtact/robot/data/scene.yaml")


@dataclass(frozen=True)
class GraspItem:
    """One object in one position of the grip."""

    id: str
    """Its name in paths."""
    entry: CatalogueEntry
    """The object's line in the catalogue."""
    x_mm: float
    """Where its middle is, as `softtact.robot.scene.Placement` has it."""
    y_mm: float
    angle_deg: float


@dataclass(frozen=True)
class GraspStudy:
    """A checked configuration with what it grasps."""

    values: GraspValues
    """The configuration."""
    spec: AnySpec
    """The sensor on both fingers."""
    items: list[GraspItem]
    """The objects in their positions, in the order of the configuration."""
    catalogue: dict[str, CatalogueEntry]
    """By name, all objects that can be grasped."""

    @property
    def name(self) -> str:
        """The study's name, and its folder below results/."""
        return self.values.study


def read_values(path: str | Path) -> dict[str, Any]:
    """The configuration mapping of a file; what it does not state is as in config/grasps.yaml."""
    return read_over(DEFAULT, path)


def load_study(values: Mapping[str, Any], path: str | Path | None = None) -> GraspStudy:
    """The `GraspStudy` of a configuration mapping; keys that it leaves out are as in config/grasps.yaml.

    Raises InputError that names file, field and remedy.
    """
    where = str(path or "the configuration")
    checked = validated(GraspValues, read_mapping(DEFAULT) | dict(values), where=where)
    catalogue = read_catalogue(here_or_shipped(checked.catalogue))
    for key, names in (("objects", checked.objects), ("one_event.objects", checked.one_event.objects)):
        for name in names:
            refuse_unknown(name, list(catalogue), kind="object", where=f"{where}, at '{key}'")
        refuse_named_twice(names, where=f"{where}, at '{key}'")
    spec = read_spec(sensor_file(checked.sensor))
    _check_scene(checked, spec, where)
    items = [item for name in checked.objects for item in _positions(checked, catalogue[name])]
    return GraspStudy(checked, spec, items, catalogue)


def _check_scene(values, spec, where):
    """Refuse forces beyond the sensor's and a faulty scene before any grasp: a grasp that fails is a result."""
    low, high = spec.force_range_n
    for key, force_n in (("force_n", values.force_n), ("one_event.force_n", values.one_event.force_n)):
        if not low < force_n <= high:
            raise InputError(f"{where}, at '{key}': {force_n:g} N is out of the range of {spec.name}; give a force above {low:g} N "
                             f"and up to {high:g} N.")
    try:
        load_scene(**values.scene)
    except InputError as error:
        raise InputError(f"{where}, at 'scene': {error}") from None


def _positions(values, entry):
    """The positions of one object: the first one centred, the others drawn; each depends on the seed, the name and its number."""
    yield GraspItem(f"{entry.name}-0", entry, 0.0, 0.0, 0.0)
    for number in range(1, values.positions):
        rng = np.random.default_rng([values.seed, zlib.crc32(entry.name.encode()), number])
        x, y, angle = np.round(rng.uniform(-1, 1, 3) * [values.places.x_mm, values.places.y_mm, values.places.angle_deg], 2) + 0.0
        yield GraspItem(f"{entry.name}-{number}", entry, float(x), float(y), float(angle))
