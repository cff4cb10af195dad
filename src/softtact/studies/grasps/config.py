"""The study of grasps: its configuration, what it grasps, and what that costs before it starts."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt

from softtact.errors import InputError
from softtact.files import digest, read_yaml
from softtact.geometry.complexity import choose_model, score
from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import Pose
from softtact.materials.config import law_from_printed
from softtact.models.hyperelastic.mesh_settings import PRESETS
from softtact.press.sensor import Sensor, load_sensor
from softtact.sensors.fields import plain_value
from softtact.sensors.library import material_file, sensor_file
from softtact.sensors.specification import AnySpec, read_spec
from softtact.studies.faults import refuse_unknown, validated
from softtact.studies.hybrid.config import here_or_shipped
from softtact.studies.hybrid.keys import CatalogueEntry, Law, Name, NotNegative, Section, VirtualSensorKey
from softtact.studies.hybrid.objects import read_catalogue

DEFAULT = "config/grasps.yaml"
_SIDES = {"left": np.diag([1.0, 1.0, 1.0, 1.0]), "right": np.diag([-1.0, 1.0, -1.0, 1.0])}     # the mesh as each sensor sees it
_Models = Annotated[list[Literal["elastic", "foundation", "hyperelastic"]], Field(min_length=1)]


class Places(Section):
    """How far a drawn position lies from the middle of the grip, to either side."""

    x_mm: NotNegative
    y_mm: NotNegative
    angle_deg: NotNegative


class OneEvent(Section):
    """Objects that several models press at one and the same event, on a cover of a law's printed constants."""

    objects: list[str]
    models: _Models
    force_n: Annotated[PositiveFloat, BeforeValidator(plain_value)]
    cover_law: Annotated[Law, BeforeValidator(plain_value)]


class GraspValues(Section):
    """The keys of config/grasps.yaml."""

    study: Name
    seed: Annotated[int, Field(ge=0)]
    sensor: str
    catalogue: str
    objects: Annotated[list[str], Field(min_length=1)]
    positions: Annotated[PositiveInt, BeforeValidator(plain_value)]
    places: Annotated[Places, BeforeValidator(plain_value)]
    force_n: PositiveFloat
    trials: PositiveInt
    model: Literal["auto", "elastic", "foundation", "hyperelastic"]
    policy: Literal["paper", "error"]
    mesh: Literal["draft", "default", "stable", "fine"]
    one_event: OneEvent
    virtual_sensor: dict[VirtualSensorKey, Any]
    scene: dict[str, Any]


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
    spec: AnySpec
    items: list[GraspItem]

    def digest_of(self, item: GraspItem) -> str:
        """Of all that a grasp of the study follows from: kept with its result, which it tells from one of other settings."""
        kept = self.values.model_dump(include={"force_n", "model", "policy", "mesh", "scene"})
        at = [item.x_mm, item.y_mm, item.angle_deg, item.entry.unit, sha256(Path(item.entry.file).read_bytes()).hexdigest()]
        return digest([kept, at, self.spec.model_dump(mode="json")])

    def sensor(self, *, cover_law: str | None = None) -> Sensor:
        """The sensor with the hyperelastic mesh of the study, on a cover of the constants that are printed for a law."""
        mesh, solver = PRESETS[self.values.mesh]
        cover = {} if cover_law is None else {"cover": law_from_printed(material_file(self.spec.materials["cover"]), cover_law)}
        return replace(load_sensor(self.values.sensor, materials=cover), mesh=mesh(), solver=solver())

    def ruled_model(self, entry: CatalogueEntry, side: str) -> str:
        """The model that the paper's rule takes for an object as a finger, `left` or `right`, sees it where it is centred."""
        return _ruled(entry.file, entry.unit, side, self.spec.footprint_mm, self.spec.thickness_mm)

    def ruled_at(self, entry: CatalogueEntry, pose: Pose) -> str:
        """The model that the paper's rule takes for an object in a pose: what of it is over the pad counts."""
        placed = place(read_mesh(entry.file, unit=entry.unit), pose=pose)
        return _chosen(placed, self.spec.footprint_mm, self.spec.thickness_mm)


@lru_cache
def _ruled(file, unit, side, footprint_mm, reach_mm):
    mesh = read_mesh(file, unit=unit)
    mesh.apply_transform(_SIDES[side])
    return _chosen(place(mesh), footprint_mm, reach_mm)


def _chosen(placed, footprint_mm, reach_mm):
    counts = score(placed.triangles, footprint_mm=footprint_mm, reach_mm=reach_mm)
    return choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)


def load_grasp_study(path: str | Path) -> GraspStudy:
    """The `GraspStudy` of a file; what it does not say is as in config/grasps.yaml.

    Raises InputError that names file, field and remedy.
    """
    values = _mapping(DEFAULT) | (_mapping(path) if Path(path) != Path(DEFAULT) else {})
    checked = validated(GraspValues, values, where=str(path))
    catalogue = read_catalogue(here_or_shipped(checked.catalogue))
    for name in [*checked.objects, *checked.one_event.objects]:
        refuse_unknown(name, list(catalogue), kind="object", where=f"{path}, at 'objects'")
    spec = read_spec(sensor_file(checked.sensor))
    items = [item for name in checked.objects for item in _positions(checked, catalogue[name])]
    return GraspStudy(checked, spec, items)


def entry_of(study: GraspStudy, name: str) -> CatalogueEntry:
    """An object's line in the catalogue."""
    return read_catalogue(here_or_shipped(study.values.catalogue))[name]


def cost_lines(study: GraspStudy, folder: Path, costs: dict[str, Any], *, cores: int) -> Iterator[str]:
    """What is left to do and how long it takes, before it starts; costs as of `study.cost.read_costs`."""
    left = [item for item in study.items if not (folder / "grasps" / item.id / "readings.nc").exists()]
    presses: dict[str, int] = {}
    for item in left:
        for side in _SIDES:
            for _ in ("contact", "grip"):
                model = study.values.model if study.values.model != "auto" else study.ruled_model(item.entry, side)
                presses[model] = presses.get(model, 0) + 1
    for name in study.values.one_event.objects:
        if not (folder / "one_event" / f"{name}.nc").exists():
            for model in study.values.one_event.models:
                presses[model] = presses.get(model, 0) + 1
    measured = costs["grasps"]
    minutes = (measured["scene_s"] * len(left) + sum(count * measured["press_s"][model] for model, count in presses.items())) / 60
    told = ", ".join(f"{count} {model}" for model, count in presses.items()) or "none"
    yield (f"{study.values.study}: {len(study.items)} grasps, {len(left)} left; presses left: {told}; about {minutes:.0f} minutes "
           f"on one core, {minutes / cores:.0f} on {cores}.")
    if study.values.model == "auto" and study.values.policy == "error":
        yield "The policy error may take a costlier model than the paper's rule, by which this was told."
    yield f"Times: {measured['origin']}"


def _positions(values, entry):
    """The positions of one object: the first one centred, the others drawn; each depends on the seed, the name and its number."""
    yield GraspItem(f"{entry.name}-0", entry, 0.0, 0.0, 0.0)
    for number in range(1, values.positions):
        rng = np.random.default_rng([values.seed, zlib.crc32(entry.name.encode()), number])
        x, y, angle = np.round(rng.uniform(-1, 1, 3) * [values.places.x_mm, values.places.y_mm, values.places.angle_deg], 2) + 0.0
        yield GraspItem(f"{entry.name}-{number}", entry, float(x), float(y), float(angle))


def _mapping(path):
    """The keys and values of a configuration."""
    values = read_yaml(here_or_shipped(path), missing="there is no such configuration; correct the path.")
    if not isinstance(values, dict):
        raise InputError(f"{path}: a study must hold keys and values; see config/grasps.yaml.")
    return values

