"""The public face: a sensor of any kind, and a press of an object on it.

    sensor = softtact.load_sensor("coro")
    result = sensor.press("part.stl", unit="mm", force_n=[5, 20, 50])
    turned = sensor.press("part.stl", unit="mm", motion="fz -10; rz 15", model="solid")
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.devices import find_device
from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh
from softtact.geometry.pose import Pose
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.mesh_settings import MeshSettings, NewtonSettings
from softtact.press.cache import cached_compliance, cached_foundation, seconds_to_prepare_foundation
from softtact.press.kinds import KINDS, MODELS
from softtact.press.objects import SoftObject
from softtact.press.result import PressResult
from softtact.press.task import BatchOptions, PressOptions, checked_forces, motion_of, refuse_unknown, task_of
from softtact.readout.registry import Readout, make_readout, readings_of
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import read_any_spec

if TYPE_CHECKING:
    from softtact.models.hyperelastic.body import LayeredBody

__all__ = ["MODELS", "Sensor", "load_sensor", "load_solid_sensor"]


def load_sensor(name_or_yaml: str | Path, *, materials: Mapping[str, Law] | None = None, device: str = "cpu") -> "Sensor":
    """The `Sensor` of a name or of a YAML file, whatever its kind: of layers with or without frusta, or a solid.

    name_or_yaml: config/sensors/NAME.yaml of the working folder comes first, then what ships with the package: coro (its product's
    name, tsf85, means the same sensor), pad, and without frusta sheet and pad4x4; materials that a
    sensor names are found likewise
    materials: {layer or region: Law}, in place of those of the file: of layers dielectric and cover
    device: where elements are summed up, see `Sensor`
    A `calibration` in the file (see `softtact calibrate`) scales the moduli of the elastic layer and of the laws that are not
    replaced, and gives the taxels' readings.
    Raises InputError that lists the known names, or names the file and the field that is wrong.
    """
    path = sensor_file(name_or_yaml)
    spec = read_any_spec(path)
    kind = KINDS[spec.kind]     # type: ignore[attr-defined]
    try:
        sensor = Sensor(**kind.load(spec, dict(materials or {})), device=device)
        if spec.model_fields_set & {"readouts", "readings"}:
            readings_of(sensor.readouts, kind.at_rest(sensor))
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None
    return sensor


def load_solid_sensor(name_or_yaml: str | Path, *, laws: Mapping[str, Law] | None = None, device: str = "cpu") -> "Sensor":
    """`load_sensor` by its name of version 0.1; `laws` are its `materials`."""
    return load_sensor(name_or_yaml, materials=laws, device=device)


@dataclass
class Sensor:
    """A sensor of any kind, with a law for each layer or region."""

    spec: Any
    """Contents of its file: a `SensorSpec`, `LayersSpec` or `SolidSpec`."""
    laws: dict[str, Law]
    """By layer or region."""
    mesh: MeshSettings = MeshSettings()
    """Resolution of the hyperelastic model's body."""
    solver: NewtonSettings = NewtonSettings()
    """Tolerances of that model."""
    prepared_models: dict[str, Any] = field(default_factory=dict)
    """{"elastic": Compliance, "foundation": FoundationCompliance}, prepared data of the fast models; else from the user's cache."""
    scatter: tuple | None = None
    """Scatter of the heights and diameters of single frusta."""
    attributes: dict[str, Any] = field(default_factory=dict)
    """Facts that each of its results holds."""
    device: str = "cpu"
    """Where the hyperelastic model, and the solid model on a sensor of kind solid, sum up their elements: `cpu`, or with
    the extra `device` `cuda`, `auto` (a GPU where Warp finds one) or `warp` (Warp's kernels on the processor)."""
    elements: SolidMesh | None = None
    """Of a sensor of kind solid: its mesh at rest, in mm."""

    @property
    def readouts(self) -> dict[str, Readout]:
        """Its readouts by name."""
        return {name: make_readout(name, entry, where=self.spec.name) for name, entry in self.spec.stated_readouts.items()}

    def press(self, mesh: "trimesh.Trimesh | SoftObject | str | Path", *, unit: str | None = None,
              pose: Pose | np.ndarray | Sequence[float] | None = None, force_n: float | Sequence[float] | None = None,
              motion: Motion | str | None = None, model: str = "auto", **options: Unpack[PressOptions]) -> PressResult:
        """Press an object through forces (N) or a `Motion`; return a `PressResult`.

        mesh: a rigid object (trimesh in mm, or a file with its `unit`), or a `SoftObject`, which the model `solid` presses
        pose: `Pose`, 4 x 4 matrix or six numbers (mm, degrees) of the mesh in the sensor frame; by default its bounding box is
        centred over the sensor, its lowest side down
        force_n: one force down, or an increasing list
        motion: steps of any of the six freedoms in place of it, as a `Motion` or its text "z -1.0; x 1.0; rz 15"; with friction
        where the sensor's file states it
        model: auto, or by name. On layers elastic and hyperelastic move an object along x, y and z, foundation straight down by
        force, solid takes turns, lateral loads and soft objects, too. `auto` is solid for these, hyperelastic for other motions,
        and for forces alone chosen by a policy (see `policy`). On a gel, whose sides are far, elastic takes turns about z, too, and
        `auto` is elastic unless only solid can follow. A sensor of kind solid has the model solid alone.
        options: see `PressOptions`
        Raises InputError for what the model cannot bear, and names one that can; ConvergenceError at a load step that is not
        reached: its `result` holds those before, as that of a KeyboardInterrupt and of a TimeLimitError does.
        """
        press = KINDS[self.spec.kind].press(model, self.spec.name)
        task = task_of(self.spec, mesh, unit, pose, motion_of(self.spec, force_n, motion), options)
        with task.control.reached.kept():
            return press(self, task)

    def press_many(self, meshes: trimesh.Trimesh | SoftObject | Sequence[trimesh.Trimesh | SoftObject],
                   poses: Sequence[Pose | np.ndarray | Sequence[float] | None] | None = None, *,
                   force_n: float | Sequence[float], model: str = "auto", **options: Unpack[BatchOptions]) -> list[PressResult]:
        """Press each of `meshes` in its pose, all through the same forces; a list of `PressResult`s in their order.

        meshes: objects, one for each press, or a single one for all poses;  poses: a `Pose` or None (centred) for each press
        options: see `BatchOptions`
        """
        from softtact.press.many import Batch, press_many

        refuse_unknown(options, BatchOptions)
        if isinstance(meshes, trimesh.Trimesh | SoftObject):
            meshes = [meshes] * (1 if poses is None else len(poses))
        places = [Pose.of(pose) for pose in ([None] * len(meshes) if poses is None else poses)]
        if len(meshes) != len(places):
            raise InputError(f"There are {len(meshes)} meshes and {len(places)} poses; give one pose for each mesh, or one mesh.")
        return press_many(self, list(zip(meshes, places, strict=True)), Batch.of(self.checked_forces(force_n), model, options))

    def with_friction(self, coefficient: float) -> "Sensor":
        """The sensor with Coulomb's coefficient of an object on its surface, from 0 on. Raises InputError for another number."""
        if not 0 <= coefficient < float("inf"):
            raise InputError(f"friction {coefficient:g}: give a number from 0 on.")
        block, key = ("friction", "object") if self.spec.has_layers else ("contact", "friction")
        if block not in type(self.spec).model_fields:
            raise InputError(f"{self.spec.name}, a sensor of kind {self.spec.kind}: it is pressed without friction; leave it out.")
        changed = getattr(self.spec, block).model_copy(update={key: float(coefficient)})
        return replace(self, spec=self.spec.model_copy(update={block: changed}))

    def prepared(self, model: str, threads: int = 1) -> Any:
        """Prepared data of a fast model: `Compliance`, `WideLayer` of a gel, or `FoundationCompliance`, computed on first use."""
        self.spec.need_layers()
        self.spec.check_for(model)
        if model == "foundation":
            self.need_elastic("foundation model")
        if model not in self.prepared_models:
            self.prepared_models[model] = self._prepare(model, threads)
        return self.prepared_models[model]

    def _prepare(self, model, threads):
        if model != "elastic":
            return cached_foundation(self.spec, self.laws, threads=threads)
        if not self.spec.edge.far:
            return cached_compliance(self.spec, threads=threads)
        from softtact.press.gel import wide_layer

        return wide_layer(self.spec)

    def need_elastic(self, what: str, layers: Sequence[str] | None = None) -> None:
        """Raise InputError where the material of one of the layers, by default of any, softens or relaxes: `what` is elastic."""
        for layer in layers or self.laws:
            if self.laws[layer].inelastic is not None:
                raise InputError(
                    f"{self.spec.name}: the material of {layer!r} softens or relaxes ('mullins', 'prony'), and the {what} has "
                    "elastic materials; use model='solid' on a sensor without frusta or of kind solid, or a card without them; a "
                    "sensor whose layers relax alike states 'relaxation' in its file.")

    def seconds_to_prepare_foundation(self) -> float:
        """About how long the foundation model's `prepared` takes; 0 where it is there."""
        if "foundation" in self.prepared_models:
            return 0.0
        return seconds_to_prepare_foundation(self.spec, self.laws)

    def body(self, *, threads: int = 1, surface: HeightField | None = None) -> "LayeredBody":
        """The `LayeredBody` that the hyperelastic model presses on."""
        self.need_elastic("hyperelastic model")
        build, device = KINDS[self.spec.kind].body, find_device(self.device, library="warp")
        if build is None:
            raise InputError(f"{self.spec.name} has no layers, which the hyperelastic model needs; use the solid model.")
        laws = {f"{layer}_law": self.laws[layer] for layer in self.spec.materials}
        body = build(self.spec, **laws, mesh=self.mesh, scatter=self.scatter, threads=threads, surface=surface)
        if device != "cpu":
            from softtact.fem.kernels_warp import WarpKernels  # Warp, which takes seconds to import

            body.sum_with(WarpKernels(device))
        return body

    def checked_forces(self, force_n: float | Sequence[float]) -> np.ndarray:
        """Forces (N) as an increasing array within the sensor's range; others are refused."""
        return checked_forces(force_n, self.spec.force_range_n, self.spec.name)
