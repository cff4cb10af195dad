"""Presses of a placed object on a gel, a plain layer whose sides are far, with the elastic model: motion by motion, with friction.

Forces alone are a motion, too: every result has displacement, traction and slip.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation
from trimesh import Trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.imaging.depth_image import MovedObject
from softtact.models.elastic.wide_layer import WideLayer
from softtact.models.elastic.wide_motion import follow_motion
from softtact.models.elastic.wide_sliding import WideObject, WideStep
from softtact.press.making import make_result
from softtact.press.result import PressResult
from softtact.press.task import RunControl
from softtact.press.validity import Flags, few_points
from softtact.progress import Watch
from softtact.readout.registry import PlaneMotion

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor
    from softtact.sensors.base import BaseSpec

_DEEPEST = 0.5          # of the gel's thickness: docs/explanation/gels.md compares with the solid model
_LOW_MM = 0.02          # what is so little above the lowest point counts as where the object first touches


def wide_layer(spec: "BaseSpec") -> WideLayer:
    """The `WideLayer` of a sensor whose sides are far, under the points of its map."""
    step = tuple(float(line[1] - line[0]) for line in (spec.map_x_mm, spec.map_y_mm))
    return WideLayer.of(spec.elastic_layer, spec.thickness_mm, step, spec.map_shape)      # type: ignore[arg-type]


def press_gel(sensor: "Sensor", placed: Trimesh, given: np.ndarray | Motion, control: RunControl) -> PressResult:
    """Press along a motion, or straight down by forces (l,) in N.

    Raises InputError for what the model does not know, an object that leaves the gel or never touches it; ConvergenceError, with
    the steps before, where a step is not reached.
    """
    motion = given if isinstance(given, Motion) else Motion().press(force_n=list(given))
    spec, surface, layer = sensor.spec, HeightField.of(placed), sensor.prepared("elastic")
    touch = surface.first_touch_mm(spec.map_x_mm, spec.map_y_mm)
    about = tuple(placed.bounds.mean(axis=0)[:2].tolist())
    _refuse_leaving(spec, surface, touch, motion, about)
    mover = WideObject(layer, surface, (spec.map_x_mm, spec.map_y_mm), first_touch_mm=touch, friction=spec.friction.object,
                       about_mm=about)
    watch, steps, reached = Watch(control.label, limit_s=control.time_limit_s), list[WideStep](), control.reached

    def so_far() -> PressResult:
        return result_of(steps[:len(reached.times)])

    def result_of(steps: Sequence[WideStep]) -> PressResult:
        position = np.stack([step.position for step in steps])
        moved = MovedObject(placed, touch, position[:, :2], position[:, 2], np.array([step.turned_deg for step in steps]), about)
        return gel_result(sensor, steps, reached.times, moved)

    def followed() -> Iterator[None]:
        for step in follow_motion(mover, motion, deepest_mm=spec.thickness_mm):
            steps.append(step)
            yield
            if len(steps) < len(motion.steps):     # the step is kept, and more are to come
                watch.report(f"step {len(steps)} of {len(motion.steps)}, {step.position[2]:.3f} mm deep")

    reached.follow(followed(), len(motion.steps), so_far)
    if not any(step.normal.any() for step in steps):
        raise InputError(f"The object never touches {spec.name} in this motion, which begins at first touch; move it down, for "
                         'example by "z -0.5".')
    return result_of(steps)


def gel_result(sensor: "Sensor", steps: Sequence[WideStep], seconds: Sequence[float], moved: MovedObject) -> PressResult:
    """The result of steps on a gel, the wall-clock times (s) of each, and the object's places at them."""
    spec, unknown = sensor.spec, np.full(len(steps), np.nan)
    area = float(np.prod([line[1] - line[0] for line in (spec.map_x_mm, spec.map_y_mm)]))
    fields = {name: np.stack([getattr(step, name) for step in steps]) for name in
              ("displacement_mm", "force_n", "path_mm", "slides", "gap_mm")}
    force = fields["force_n"].sum(axis=(1, 2))
    plane = PlaneMotion(spec.map_x_mm, spec.map_y_mm, fields["displacement_mm"], fields["force_n"] / area, fields["slides"],
                        fields["gap_mm"])
    depth, touching = np.array([step.position[2] for step in steps]), np.array([int((step.normal > 0).sum()) for step in steps])
    numbers: dict[str, Any] = {
        "displacement_mm": plane.displacement_mm, "force_n": force, "torque_nmm": _torques(spec, fields["force_n"]),
        "slip": fields["path_mm"], "indentation_mm": depth, "contact_area_mm2": area * touching,
        "penetration_mm": np.array([step.penetration_mm for step in steps]), "iterations": np.array([step.turns for step in steps]),
        "frustum_compression_mm": unknown, "residual_n": unknown, "extrapolated_volume_fraction": unknown}
    result = make_result(sensor, "elastic", "conjugate gradients on Fourier transforms", -plane.displacement_mm[..., 2],
                         -force[:, 2], np.array(seconds[:len(steps)]), flags=_flags(spec, steps, depth, touching), plane=plane,
                         seen_object=moved, **numbers)
    return replace(result, attributes=result.attributes | {
        "friction_object": spec.friction.object, "friction": "of the object, Coulomb's", "point_area_mm2": area})


def _torques(spec, force):
    """Torques (l, 3) in N mm about the sensor frame's origin of forces (l, y, x, 3) at the undeformed surface's points."""
    x, y = np.meshgrid(spec.map_x_mm, spec.map_y_mm)
    fx, fy, fz = np.moveaxis(force, -1, 0)
    return np.stack([(y * fz).sum(axis=(1, 2)), -(x * fz).sum(axis=(1, 2)), (x * fy - y * fx).sum(axis=(1, 2))], axis=1)


def _flags(spec: "BaseSpec", steps: Sequence[WideStep], depth: np.ndarray, touching: np.ndarray) -> Flags:
    """Why which steps (l,) are not valid."""
    deepest = _DEEPEST * spec.thickness_mm
    return {f"the object is deeper in than {deepest:.3g} mm, {_DEEPEST:g} of the linear gel": ~(depth <= deepest),
            "the object touches the rim of the gel, beyond which the model has none": np.array([step.at_rim for step in steps]),
            **few_points(touching, of="map")}


def _refuse_leaving(spec: "BaseSpec", surface: HeightField, touch: float, motion: Motion, about: tuple[float, float]) -> None:
    """Refuse a motion that takes the middle of what first touches off the gel; about: where the object turns about z."""
    low = surface.points_below(touch + _LOW_MM)
    half = 0.5 * np.asarray(spec.footprint_mm)
    low = low[(np.abs(low) <= half + 1e-9).all(axis=1)]
    arm = (low.mean(axis=0) if len(low) else np.zeros(2)) - about
    turns = Rotation.from_euler("z", motion.turned_deg[:, None], degrees=True)
    for number, (x, y) in enumerate(about + turns.apply([*arm, 0.0])[:, :2] + motion.aside_mm, start=1):
        if (np.abs([x, y]) > half).any():
            raise InputError(f"Step {number} of the motion takes the object off {spec.name}: what touches first would be at "
                             f"x {x:.4g}, y {y:.4g} mm, and the gel ends at {half[0]:g} and {half[1]:g} mm; move it less far.")
