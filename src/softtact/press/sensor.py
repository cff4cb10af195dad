"""The public face: a sensor, and a press of a rigid mesh on it.

    sensor = softtact.load_sensor("coro")
    result = sensor.press(mesh, force_n=[5, 20, 50], model="auto")
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from threadpoolctl import threadpool_limits

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.devices import find_device
from softtact.errors import ConvergenceError, InputError
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose
from softtact.materials.config import law_from_printed
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic import newton
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.build import build_plain_body, build_sensor_body
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.asked import check_loads, checked_forces, cores, given_forces, mesh_of, motion_of
from softtact.press.cache import cached_compliance, cached_foundation, seconds_to_prepare_foundation
from softtact.press.choice import TOLERANCE_MM, press_auto, with_expected_error
from softtact.press.making import Course
from softtact.press.many import press_many, raise_first
from softtact.press.models import MOTIONS, PRESSES
from softtact.press.placed_object import placed_object
from softtact.press.result import PressResult
from softtact.press.soft_object import SoftObject
from softtact.press.solid import press_soft
from softtact.press.validity import flag_buried, flag_overloaded
from softtact.sensors.library import material_file, sensor_file
from softtact.sensors.specification import AnySpec, read_spec

MODELS = ("auto", *PRESSES, "solid")     # the last one of soft objects alone
BODIES: dict[str, Callable[..., LayeredBody]] = {"frusta": build_sensor_body, "layers": build_plain_body}    # by kind


def load_sensor(name_or_yaml: str | Path, *, materials: Mapping[str, Law] | None = None) -> "Sensor":
    """The `Sensor` of a name or of a YAML file.

    name_or_yaml: config/sensors/NAME.yaml of the working folder comes first, then what ships with the package: coro (its product's
    name, tsf85, means the same sensor), pad, and without frusta sheet and pad4x4; materials that a
    sensor names are found in the same way
    materials: {"dielectric": Law, "cover": Law}, or one of them, to replace the Mooney-Rivlin constants printed for its materials
    A `calibration` in the file (see `softtact calibrate`) scales the moduli of the elastic layer and of the laws that are not
    replaced, and gives the taxels' readings.
    Raises InputError that lists the known names, or names the file and the field that is wrong.
    """
    spec = read_spec(sensor_file(name_or_yaml))
    laws = dict(materials or {})
    for layer in sorted(set(laws) - set(spec.materials)):
        raise InputError(f"{spec.name} has no layer {layer!r} for the material given; its layers are {', '.join(spec.materials)}.")
    stiffness = 1.0
    if spec.calibration is not None:
        stiffness = spec.calibration.modulus_scale
        layer_of_all = spec.elastic_layer.model_copy(update={"young_mpa": stiffness * spec.elastic_layer.young_mpa})
        spec = spec.model_copy(update={"elastic_layer": layer_of_all})
    for layer, material in spec.materials.items():
        if layer not in laws:
            laws[layer] = law_from_printed(material_file(material), "mooney_rivlin").scaled(stiffness)
    return Sensor(spec, laws)


@dataclass
class Sensor:
    """A sensor with one law per layer; `mesh` sets the layered body's resolution, `solver` what counts as solved.

    device: where the hyperelastic model sums up its elements: `cpu`, `cuda`, or `auto`: a GPU where torch finds one
    prepared_models: {"elastic": Compliance, "foundation": FoundationCompliance}, what the fast models start from; else the
    user's cache
    """

    spec: AnySpec
    laws: dict
    mesh: MeshSettings = MeshSettings()
    solver: newton.NewtonSettings = newton.NewtonSettings()
    prepared_models: dict = field(default_factory=dict)
    scatter: tuple | None = None
    attributes: dict = field(default_factory=dict)
    device: str = "cpu"

    def press(self, mesh: "trimesh.Trimesh | SoftObject | str | Path", *, unit: str | None = None,
              pose: Pose | np.ndarray | Sequence[float] | None = None, force_n: float | Sequence[float] | None = None,
              motion: Motion | None = None, model: str = "auto", policy: str = "error", tolerance_mm: float = TOLERANCE_MM,
              label: str = "press", threads: int | None = None, keep_body: bool = False, keep_object: bool = False,
              time_limit_s: float | None = None, on_step: Callable[[PressResult], None] | None = None) -> PressResult:
        """Press a mesh (trimesh in mm, or a file with its `unit`) through forces (N) or a `Motion`; return a `PressResult`.

        mesh: a rigid object, or a `SoftObject`, for which sensor and object are solids that meet (model `solid`)
        force_n: one force, or an increasing list

        motion: steps down by force or to a depth, and aside, with friction where the sensor's `friction.object` states it; the
        elastic and the hyperelastic model take any, `auto` then means the hyperelastic one, the foundation model only forces.

        pose: `Pose`, 4 x 4 matrix or six numbers (mm, degrees) of the mesh in the sensor frame; by default its bounding box is
        centred over the sensor, its lowest side down.
        model: elastic, foundation, hyperelastic, or auto: chosen by a policy, `error` (the cheapest model that is expected to be
        within `tolerance_mm` of the hyperelastic one; see `choice`) or `paper` (complexity of the contact).
        threads: by default one for each core.
        keep_body: let the result hold the deformed body at each force (`PressResult.pressed_body`), some 20 MB each; of the
        hyperelastic model and of a soft object's press, for the others have displacements of the map's plane alone.
        keep_object: let the result hold the object where it stands at each step (`PressResult.placed_object`).
        time_limit_s: seconds after which the press ends in a TimeLimitError;  on_step: called with the result so far at each
        load step that is reached but the last.
        Raises ConvergenceError at a force that is not reached; its `result` holds the forces before, as those of a
        KeyboardInterrupt and of a TimeLimitError do.
        """
        if isinstance(mesh, SoftObject):
            return self._press_soft(mesh, pose, motion_of(force_n, motion), model,
                                    Course(label, threads or cores(), keep_body, time_limit_s, on_step))
        mesh, pose = mesh_of(mesh, unit), Pose.of(pose)
        if model not in MODELS:
            raise InputError(f"Model {model!r} is unknown; use one of {', '.join(MODELS)}.")
        if model == "solid":
            raise InputError("model='solid' presses a soft object; give a SoftObject, or another model for a rigid mesh.")
        placed = place(mesh, pose=pose)
        stand = self._standing(placed, motion) if keep_object else lambda result: result
        course = Course(label, threads or cores(), keep_body, time_limit_s, on_step and (lambda result: on_step(stand(result))))
        if motion is not None and force_n is None and not motion.forces_n:
            return self._press_motion(placed, motion, model, course, stand)
        forces = self.checked_forces(given_forces(force_n, motion))
        check_over_sensor(placed, self.spec.footprint_mm)
        height = self._height_mm(placed)
        # Dense products of some hundred rows would wait for each other on more threads, up to five times as long.
        press = PRESSES[model] if model != "auto" else partial(press_auto, policy=policy, tolerance_mm=tolerance_mm)
        try:
            with threadpool_limits(limits=course.threads if model == "elastic" else 1):
                return stand(flag_buried(with_expected_error(self, press(self, placed, forces, course)), height))
        except (ConvergenceError, KeyboardInterrupt) as error:
            error.result = _flagged_if_any(error, lambda result: stand(flag_buried(result, height)))     # type: ignore[union-attr]
            raise

    def _press_soft(self, soft: SoftObject, pose: Any, motion: Motion, model: str, course: Course) -> PressResult:
        """A press of a soft object by the solid model."""
        if model not in ("auto", "solid"):
            raise InputError(f"model={model!r}: a soft object is pressed by the solid model alone; use model='solid', or give a "
                             "rigid mesh.")
        check_loads(motion, self.spec.force_range_n, self.spec.name)
        return press_soft(self, soft, None if pose is None else Pose.of(pose), motion, course)

    def _press_motion(self, placed: trimesh.Trimesh, motion: Motion, model: str, course: Course,
                      stand: Callable[[PressResult], PressResult]) -> PressResult:
        """A press that does more than go straight down by growing forces."""
        press = MOTIONS.get("hyperelastic" if model == "auto" else model)
        if press is None:
            raise InputError(f"model={model!r}: the {model} model presses straight down by force only; use elastic or hyperelastic "
                             "for this motion, or give force_n.")
        check_loads(motion, self.spec.force_range_n, self.spec.name)
        check_over_sensor(placed, self.spec.footprint_mm)
        height = self._height_mm(placed)
        try:
            with threadpool_limits(limits=course.threads if model == "elastic" else 1):
                return stand(self._flagged(press(self, placed, motion, course), height))
        except (ConvergenceError, KeyboardInterrupt) as error:
            error.result = _flagged_if_any(error, lambda result: stand(self._flagged(result, height)))  # type: ignore[union-attr]
            raise

    def _standing(self, placed: trimesh.Trimesh, motion: Motion | None) -> Callable[[PressResult], PressResult]:
        """What adds to a result the object where it stands."""
        def stand(result: PressResult) -> PressResult:
            touch = HeightField(placed).first_touch_mm(self.spec.map_x_mm, self.spec.map_y_mm)
            aside = np.zeros((len(result.indentation_mm), 2)) if motion is None else motion.aside_mm
            return replace(result, placed_object=placed_object(placed, touch_mm=touch, indentation_mm=result.indentation_mm,
                                                               aside_mm=aside))
        return stand

    def _height_mm(self, placed: trimesh.Trimesh) -> float:
        """Height (mm) of an object's top over where it first touches."""
        return float(placed.bounds[1, 2]) - HeightField(placed).first_touch_mm(self.spec.map_x_mm, self.spec.map_y_mm)

    def _flagged(self, result: PressResult, height_mm: float) -> PressResult:
        """A motion's result with the steps flagged that bury the object or overload the sensor."""
        return flag_overloaded(flag_buried(result, height_mm), self.spec.force_range_n[1])

    def press_many(self, meshes: trimesh.Trimesh | Sequence[trimesh.Trimesh],
                   poses: Sequence[Pose | np.ndarray | Sequence[float] | None] | None = None, *,
                   force_n: float | Sequence[float], model: str = "auto", workers: int | None = None, device: str = "auto",
                   failures: str = "raise", label: str = "presses", **options: Any) -> list[PressResult]:
        """Press each of `meshes` in its pose, all through the same forces; a list of `PressResult`s in their order.

        meshes: one for each press, or a single one for all poses;  poses: a `Pose` or None (centred) for each press
        workers: processes, by default one for each core;  device: `cuda`, or `auto` where there is one, takes all presses of the
        elastic model to a GPU as one batch; the other models', and those on the `cpu`, go over processes
        failures: `raise` the first, after all are done, or `keep` each error in its press' place
        options: policy, tolerance_mm, as for `press`
        """
        if isinstance(meshes, trimesh.Trimesh):
            meshes = [meshes] * (1 if poses is None else len(poses))
        places = [Pose.of(pose) for pose in ([None] * len(meshes) if poses is None else poses)]
        if len(meshes) != len(places):
            raise InputError(f"There are {len(meshes)} meshes and {len(places)} poses; give one pose for each mesh, or one mesh.")
        if failures not in ("raise", "keep"):
            raise InputError(f"failures={failures!r} is unknown; write 'raise' or 'keep'.")
        results = press_many(self, list(meshes), places, self.checked_forces(force_n), model=model, workers=workers or cores(),
                             device=device, label=label, options=options)
        return raise_first(results) if failures == "raise" else results

    def prepared(self, model: str, threads: int = 1) -> Any:
        """What a fast model starts from: `Compliance` or `FoundationCompliance`, computed on first use."""
        self.spec.check_for(model)
        if model not in self.prepared_models:
            self.prepared_models[model] = (cached_compliance(self.spec, threads=threads) if model == "elastic"
                                 else cached_foundation(self.spec, self.laws, threads=threads))     # type: ignore[arg-type]
        return self.prepared_models[model]

    def seconds_to_prepare_foundation(self) -> float:
        """About how long the foundation model's `prepared` takes; 0 where it is there."""
        if "foundation" in self.prepared_models:
            return 0.0
        return seconds_to_prepare_foundation(self.spec, self.laws)     # type: ignore[arg-type]

    def body(self, *, threads: int = 1, surface: HeightField | None = None) -> LayeredBody:
        """The `LayeredBody` that the hyperelastic model presses on."""
        device = find_device(self.device)
        laws = {f"{layer}_law": self.laws[layer] for layer in self.spec.materials}
        body = BODIES[self.spec.kind](self.spec, **laws, mesh=self.mesh, scatter=self.scatter, threads=threads, surface=surface)
        if device != "cpu":
            from softtact.fem.kernels_torch import DeviceKernels  # torch, which takes seconds to import

            body.sum_with(DeviceKernels(device))
        return body

    def checked_forces(self, force_n: float | Sequence[float]) -> np.ndarray:
        """Forces (N) as an increasing array within the sensor's range; others are refused."""
        return checked_forces(force_n, self.spec.force_range_n, self.spec.name)


def _flagged_if_any(error: BaseException, flag: Callable[[PressResult], PressResult]) -> PressResult | None:
    """The result that an error holds of the steps before it, flagged; None where it holds none."""
    result = getattr(error, "result", None)
    return None if result is None else flag(result)
