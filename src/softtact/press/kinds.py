"""Loading and pressing sensors of each kind: one entry of `KINDS` for each kind of `sensors.specification.KINDS`.

To add a kind from outside the package, add a class of specification and a `Kind` to these registries under the kind's name.
Models and readouts that few presses need are imported inside functions: a command starts a third of a second sooner.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.errors import InputError
from softtact.geometry.meshes import check_over_sensor, default_pose, place
from softtact.linalg.workers import on_one_thread
from softtact.materials.config import law_from_printed
from softtact.materials.laws.base import Law
from softtact.materials.linear import LinearConstants
from softtact.press import choice
from softtact.press.creep import at_times, refuse_creep, slow_press
from softtact.press.fast import press_elastic_motion
from softtact.press.making import layered_surface
from softtact.press.objects import Origin, placed_object
from softtact.press.result import PressResult
from softtact.press.task import PressTask, checked_forces
from softtact.press.validity import flag_buried, flag_overloaded
from softtact.readout import points, taxels  # registered as they are imported  # noqa: F401
from softtact.readout.registry import PlaneMotion, SurfaceMotion, register_later
from softtact.sensors.layers import LayersSpec
from softtact.sensors.library import material_file
from softtact.sensors.specification import AnySpec, SensorSpec

if TYPE_CHECKING:
    from softtact.models.hyperelastic.body import LayeredBody
    from softtact.press.sensor import Sensor

Press = Callable[["Sensor", PressTask], PressResult]
MODELS = ("auto", "elastic", "foundation", "hyperelastic", "solid")


@dataclass(frozen=True)
class Kind:
    """A kind of sensor."""

    load: Callable[[Any, dict[str, Law]], dict[str, Any]]
    """From its specification, and laws in place of those of its file, to the fields of `Sensor`."""
    models: Mapping[str, Press]
    """Functions that press it by the names of the models, including `auto`."""
    at_rest: "Callable[[Sensor], SurfaceMotion]"
    """Its surface before any press, on which readouts are tried."""
    body: "Callable[..., LayeredBody] | None" = None
    """The body of the hyperelastic model, where that model presses it."""

    def press(self, model: str, sensor: str) -> Press:
        """The function that presses with a model. Raises InputError that names the available models."""
        if model in self.models:
            return self.models[model]
        if model not in MODELS:
            raise InputError(f"Model {model!r} is unknown; use one of {', '.join(self.models)}.")
        named = [name for name in self.models if name != "auto"]
        raise InputError(f"model={model!r}: {sensor} is a sensor that {' or '.join(f'model={name!r}' for name in named)} presses; "
                         "leave model out, or name this one.")


# --- sensors of layers: `frusta` and `layers` ---


def load_layers(spec: AnySpec, laws: dict[str, Law]) -> dict[str, Any]:
    """Specification and laws of a sensor of layers; `laws`: {layer: Law}. A `calibration` scales the laws of the file."""
    for layer in sorted(set(laws) - set(spec.materials)):
        raise InputError(f"{spec.name} has no layer {layer!r} for the material given; its layers are {', '.join(spec.materials)}.")
    stiffness = 1.0
    if "dielectric" in laws and isinstance(spec, LayersSpec) and spec.elastic_layer_follows_law:
        spec = spec.with_elastic_layer_of(LinearConstants.of_law(laws["dielectric"]))
    if spec.calibration is not None:
        stiffness = spec.calibration.modulus_scale
        layer_of_all = spec.elastic_layer.model_copy(update={"young_mpa": stiffness * spec.elastic_layer.young_mpa})
        spec = spec.model_copy(update={"elastic_layer": layer_of_all})
    for layer, material in spec.materials.items():
        if layer not in laws:
            laws[layer] = law_from_printed(material_file(material), "mooney_rivlin").scaled(stiffness)
    return {"spec": spec, "laws": laws}


def press_layers(sensor: "Sensor", task: PressTask, *, model: str) -> PressResult:
    """A press of a rigid object by the elastic, the foundation or the hyperelastic model."""
    if task.soft:
        raise InputError(f"model={model!r}: a soft object is pressed by the solid model alone; use model='solid', or give a "
                         "rigid mesh.")
    if sensor.spec.edge.far and model == "elastic":
        return _on_gel(sensor, task)
    if _by_force_alone(task.motion):
        return _by_forces(sensor, task, choice.PRESSES[model])
    motions = {"elastic": press_elastic_motion, "hyperelastic": choice.press_hyperelastic}
    if model not in motions:
        raise InputError(f"model={model!r}: the {model} model presses straight down by force only; use elastic, hyperelastic or "
                         "solid for this motion, or give force_n.")
    if task.motion.turns or task.motion.loaded_aside:
        raise InputError(f"model={model!r}: the {model} model neither turns an object nor loads it aside; use model='solid' for "
                         "this motion.")
    return _by_motion(sensor, task, motions[model])


def press_layers_auto(sensor: "Sensor", task: PressTask) -> PressResult:
    """A press by the model that fits: solid for soft objects and turns, hyperelastic for motions, else by a policy.

    On a gel: elastic for all that it can follow.
    """
    if sensor.spec.edge.far and not task.soft and _flat(task.motion):
        result = _on_gel(sensor, task)
        return replace(result, selection_reason="a gel's sides are far: the elastic model, which gives traction and slip")
    if task.soft or task.motion.turns or task.motion.loaded_aside:
        return press_solid(sensor, task)
    if not _by_force_alone(task.motion):
        return _by_motion(sensor, task, choice.press_hyperelastic)
    return _by_forces(sensor, task, partial(choice.press_auto, policy=task.policy, tolerance_mm=task.tolerance_mm))


def _on_gel(sensor, task):
    from softtact.press.gel import press_gel

    return _by_motion(sensor, task, press_gel)


def press_solid(sensor: "Sensor", task: PressTask) -> PressResult:
    """A press by the solid model, of a sensor of any kind."""
    from softtact.press import solid

    return (solid.press_pad if sensor.spec.has_layers else solid.press_body)(sensor, task)


def layered_body(spec: AnySpec, **options: Any) -> "LayeredBody":
    """The body of the hyperelastic model: with frusta, or of plain layers."""
    from softtact.models.hyperelastic.build import build_plain_body, build_sensor_body

    return build_sensor_body(spec, **options) if isinstance(spec, SensorSpec) else build_plain_body(spec, **options)


def _flat(motion):
    """Whether a motion has no tilts and no loads but along z."""
    return not any({*step.ways} & {"rx", "ry"} or {*step.loads} - {"z"} for step in motion.steps)


def _by_force_alone(motion):
    """Whether a motion presses straight down by force, in steps of which some may hold it for a time."""
    return motion.forces_n is not None or motion.times_s is not None and motion.held_forces_n is not None


@on_one_thread
def _by_forces(sensor, task, press):
    """A press straight down by increasing forces; with durations, over time."""
    complete = None
    if (motion := task.motion).times_s is not None:
        slow, load_step, effective_n = slow_press(motion, sensor.spec.creep)
        task, complete = replace(task, motion=slow), partial(at_times, load_step=load_step, effective_n=effective_n, motion=motion)
    forces = checked_forces(task.motion.forces_n, sensor.spec.force_range_n, sensor.spec.name)
    placed, finish = _placed(sensor, task)
    origin = Origin(sensor, task.pressed, task.pose or default_pose(task.pressed), hash(task.pressed))

    def finished(result: PressResult) -> PressResult:
        result = finish(choice.with_expected_error(sensor, result))
        return complete(result) if complete else replace(result, origin=origin)

    task.control.reached.finish = finished
    return task.control.reached.finish(press(sensor, placed, forces, task.control))


@on_one_thread
def _by_motion(sensor, task, press):
    """A press along a motion other than straight down by increasing forces."""
    times = refuse_creep(sensor.spec, task.motion)
    placed, finish = _placed(sensor, task)

    def finished(result: PressResult) -> PressResult:
        result = finish(flag_overloaded(result, sensor.spec.force_range_n[1]))
        return result if times is None else replace(result, time_s=times[:result.steps])

    task.control.reached.finish = finished
    return task.control.reached.finish(press(sensor, placed, task.motion, task.control))


def _placed(sensor: "Sensor", task: PressTask) -> tuple[trimesh.Trimesh, Callable[[PressResult], PressResult]]:
    """The object in its pose over the sensor, and a function that completes each result: flags, and the object if it is kept."""
    placed = place(task.pressed, pose=task.pose)      # type: ignore[arg-type]
    check_over_sensor(placed, sensor.spec.footprint_mm)
    touch = HeightField.of(placed).first_touch_mm(sensor.spec.map_x_mm, sensor.spec.map_y_mm)

    def finish(result: PressResult) -> PressResult:
        result = flag_buried(result, float(placed.bounds[1, 2]) - touch)
        if not task.control.keep_object:
            return result
        return replace(result, placed_object=placed_object(placed, touch_mm=touch, indentation_mm=result.indentation_mm,
                                                           motion=task.motion))

    return placed, finish


def layers_at_rest(sensor: "Sensor") -> SurfaceMotion:
    """The surface of layers at rest."""
    surface = layered_surface(sensor.spec, np.zeros((1, *sensor.spec.map_shape)), np.zeros((1, *sensor.spec.map_shape, 3)))
    return replace(surface, plane=PlaneMotion.at_rest(sensor.spec.map_x_mm, sensor.spec.map_y_mm))


_LAYERS = Kind(load=load_layers, at_rest=layers_at_rest, body=layered_body, models={
    "auto": press_layers_auto, **{model: partial(press_layers, model=model) for model in choice.PRESSES}, "solid": press_solid})


# --- sensors of kind solid ---


def _load_solid(spec, laws):
    from softtact.press.solid import load_solid

    elements, laws = load_solid(spec, laws)
    return {"spec": spec, "laws": laws, "elements": elements}


def solid_at_rest(sensor: "Sensor") -> SurfaceMotion:
    """The surface of a solid at rest."""
    from softtact.press.solid import surface_of

    return surface_of(sensor, [np.zeros_like(sensor.elements.points)])      # type: ignore[union-attr]


# --- sensors of kind skin ---


def _load_skin(spec, laws):
    from softtact.press.skin import load_skin

    return load_skin(spec, laws)


def _press_skin(sensor, task, *, model):
    from softtact.press.skin import press_skin

    return press_skin(sensor, task, model=model)


def _skin_at_rest(sensor):
    raise InputError(f"{sensor.spec.name}, a sensor of kind skin: it reads its own taxels; leave 'readouts' out.")


KINDS: dict[str, Kind] = {
    "frusta": _LAYERS, "layers": _LAYERS,
    "solid": Kind(load=_load_solid, at_rest=solid_at_rest, models={"auto": press_solid, "solid": press_solid}),
    "skin": Kind(load=_load_skin, at_rest=_skin_at_rest, models={
        "auto": partial(_press_skin, model="elastic"), "elastic": partial(_press_skin, model="elastic"),
        "solid": partial(_press_skin, model="solid")})}


# --- readouts of files that few sensors name ---


def _camera() -> None:
    from softtact.readout import camera  # noqa: F401


def _depth() -> None:
    from softtact.readout import depth  # noqa: F401


def _markers() -> None:
    from softtact.readout import markers  # noqa: F401


def _strip() -> None:
    from softtact.readout import strip  # noqa: F401


for _kind, _load in {"camera": _camera, "depth": _depth, "markers": _markers, "strip": _strip}.items():
    register_later(_kind, _load)
