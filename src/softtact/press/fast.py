"""Presses of a placed object with the elastic and the foundation model: from its underside and forces to a `PressResult`."""

import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from trimesh import Trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.contact.shell import pad_forces
from softtact.contact.underside import Underside
from softtact.contact.undersides import underside_of
from softtact.contact.unilateral import LEAST_REACH_MM, REACH, RISE, among_candidates
from softtact.errors import ConvergenceError, InputError, NarrowPartWarning
from softtact.linalg.workers import on_one_thread
from softtact.models.elastic.compliance import LayerPress, press_object
from softtact.models.elastic.sliding import SlidingObject, SlidingState, check_motion, motion_of, steps_on_layer
from softtact.models.foundation.solve import FoundationMaps, lifted, press_foundation
from softtact.press.cache import cached_surface_compliance
from softtact.press.making import make_result, warn_of_shell
from softtact.press.objects import shell_of, target_of
from softtact.press.result import PressResult
from softtact.press.task import RunControl
from softtact.press.validity import flagged, flags_elastic, flags_foundation
from softtact.progress import Watch
from softtact.readout.capacitance import felt_displacement
from softtact.readout.registry import PlaneMotion

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_ROUND_OFF = 1e-6         # of a force
# Search of the force at a depth: the least force over the largest, force over depth to this power at first, and the relative error.
_LEAST_FORCE, _POWER, _DEPTH_TOLERANCE, _SECANTS = 1e-6, 1.3, 2e-3, 40


def press_elastic(sensor: "Sensor", placed: Trimesh, forces: np.ndarray, control: RunControl) -> PressResult:
    """Press all load steps at once with the elastic model, which has only the surface's compliance and no body to keep."""
    sensor.prepared("elastic", control.threads)
    return press_underside(sensor, HeightField.of(placed), forces)


def press_underside(sensor: "Sensor", surface: HeightField, forces: np.ndarray, *, model: str = "elastic") -> PressResult:
    """The press through forces (l,) in N of an object by its underside, which presses of one object can share.

    model: elastic or foundation
    """
    start = time.perf_counter()
    if model == "foundation":
        near = surface.near_touch(sensor.spec.map_x_mm, sensor.spec.map_y_mm)
        return _on_foundation(sensor, near, forces, RunControl(label=""), start)
    compliance, underside = _over(sensor, surface)
    _, press = press_object(compliance, underside, forces)
    seconds = np.full(len(forces), (time.perf_counter() - start) / len(forces))
    return elastic_result(sensor, press, forces, seconds, touch_mm=underside.touch_mm)


def force_at_depth(sensor: "Sensor", surface: HeightField, depth_mm: float, *, guess_n: float) -> float:
    """The force (N) at which the elastic model's object is `depth_mm` below first touch; the sensor's largest if none suffices.

    surface: the underside of the object;  guess_n: a force nearby
    """
    compliance, underside = _over(sensor, surface)
    return _at_depth(sensor, compliance, underside, depth_mm, guess_n)[0]


@dataclass(frozen=True)
class DepthPress:
    """The elastic model's press of an object at a depth, by forces at points."""

    result: PressResult
    """Of one load step, at the force that the depth needs, or at the sensor's largest if none suffices."""
    points_mm: np.ndarray
    """(c, 2) in mm: the points under pressure."""
    forces_n: np.ndarray
    """(c,) in N: of the object on them, downwards."""
    areas_mm2: np.ndarray
    """(c,) in mm2 of the points."""


def press_to_depth(sensor: "Sensor", surface: HeightField, depth_mm: float, *, guess_n: float) -> DepthPress:
    """The `DepthPress` of an object by its underside, `depth_mm` below first touch; guess_n: a force nearby, in N."""
    start, (compliance, underside) = time.perf_counter(), _over(sensor, surface)
    force, points, press = _at_depth(sensor, compliance, underside, depth_mm, guess_n)
    found = np.array([press.contact.force.sum() if press.contact.force.any() else force])
    result = elastic_result(sensor, press, found, np.array([time.perf_counter() - start]), touch_mm=underside.touch_mm)
    pressed = press.contact.force[:, 0] > 0
    return DepthPress(result, compliance.grid.points[points.nodes[pressed]][:, :2], press.contact.force[pressed, 0],
                      press.areas[pressed])


def _at_depth(sensor, compliance, underside, depth_mm, guess_n):
    """The force at a depth, and the points and the `LayerPress` of the force that was tried last."""
    low, high = np.log(_LEAST_FORCE * sensor.spec.force_range_n[1]), np.log(sensor.spec.force_range_n[1])
    wanted, force, power, before = np.log(depth_mm), float(np.clip(np.log(guess_n), low, high)), _POWER, None
    for _ in range(_SECANTS):
        points, press = press_object(compliance, underside, np.exp([force]))
        reached = np.log(max(press.contact.depth[-1] - underside.touch_mm, np.finfo(float).tiny))
        if abs(reached - wanted) <= _DEPTH_TOLERANCE:
            break
        low, high = (force, high) if reached < wanted else (low, force)
        if before is not None and reached != before[1]:
            power = (force - before[0]) / (reached - before[1])
        before, force = (force, reached), force + power * (wanted - reached)
        if force >= high and before[0] < high:
            force = high
        elif not low < force <= high:
            force = 0.5 * (low + high)
        if high - low <= _DEPTH_TOLERANCE:
            break
    return float(np.exp(force)), points, press


def thinning_maps(sensor: "Sensor", surface: HeightField, forces_n: np.ndarray, *, model: str) -> np.ndarray:
    """Maps (l, ny, nx) in mm of the decrease in thickness of a sensor at rising forces (N), from which its readings follow.

    surface: the underside of an object;  model: elastic or foundation
    Raises MissError where the object misses the sensor, ConvergenceError for a force that is not reached.
    """
    if sensor.spec.edge.far:
        raise InputError(f"{sensor.spec.name} is a gel with far sides, of which no maps over force are kept; press it by motions.")
    if model == "foundation":
        return press_underside(sensor, surface, forces_n, model=model).deformation_map_mm
    compliance, underside = _over(sensor, surface)
    _, press = press_object(compliance, underside, forces_n, patches=True)
    warn_of_shell(sensor.spec, forces_n, _snapped(forces_n, press.contact.force.sum(axis=0)))
    return felt_displacement(sensor.spec, press.thinning)


def _over(sensor, surface):
    """The sensor's compliance, and the `PosedUnderside` of an object over its grid."""
    compliance = sensor.prepared("elastic")
    return compliance, underside_of(surface.triangles, target_of(sensor, compliance.grid))


def first_touch_mm(sensor: "Sensor", surface: HeightField) -> float:
    """Height (mm) of an object's underside over the sensing surface: its descent from the pose to first touch."""
    return surface.first_touch_mm(sensor.spec.map_x_mm, sensor.spec.map_y_mm)


def shell_stop_mm(sensor: "Sensor", surface: HeightField) -> float:
    """Descent (mm) of an object from its pose until it rests on the sensor's shell; infinite if it never does."""
    return shell_of(sensor).stop_mm(surface)


def elastic_result(sensor: "Sensor", press: LayerPress, forces: np.ndarray, seconds: np.ndarray, *, touch_mm: float | np.ndarray,
                   presses: int = 1) -> PressResult:
    """The result of a `LayerPress`, which may hold the load steps of several presses in turn.

    touch_mm: descent to first touch, of the object or at each load step;  presses: each of as many load steps, is read by itself
    """
    felt = np.concatenate([felt_displacement(sensor.spec, one) for one in np.split(press.thinning, presses)])
    contact, unknown = press.contact, np.full(len(forces), np.nan)
    depth = contact.depth - touch_mm
    return make_result(sensor, "elastic", "conjugate gradients", press.maps, forces, seconds, indentation_mm=depth,
                       pad_force_n=_snapped(forces, contact.force.sum(axis=0)),
                       contact_area_mm2=press.areas @ (contact.force > 0),
                       penetration_mm=contact.penetration,
                       flags=flags_elastic(depth, press.fields, (contact.force > 0).sum(axis=0),
                                           thickness_mm=sensor.spec.thickness_mm,
                                           dielectric_mm=sensor.spec.dielectric_thickness_mm),
                       frustum_compression_mm=unknown, residual_n=unknown, extrapolated_volume_fraction=unknown,
                       felt_mm=felt, iterations=contact.iterations)


def press_on_foundation(sensor: "Sensor", placed: Trimesh, forces: np.ndarray, control: RunControl) -> PressResult:
    """Press load step by load step with the foundation model, which has no body to keep."""
    start = time.perf_counter()
    sensor.prepared("foundation", control.threads)
    near = HeightField.of(placed).near_touch(sensor.spec.map_x_mm, sensor.spec.map_y_mm)
    return _on_foundation(sensor, near, forces, control, start)


@on_one_thread
def _on_foundation(sensor: "Sensor", surface: HeightField, forces: np.ndarray, control: RunControl, start: float) -> PressResult:
    """The result for an object by its underside, which is near the sensing surface."""
    compliance = sensor.prepared("foundation")
    underside, touch, stop = Underside(surface, compliance.grid), first_touch_mm(sensor, surface), shell_stop_mm(sensor, surface)
    load_steps: list[Any] = []
    watch = Watch(limit_s=control.time_limit_s)

    def record(load_step):
        watch.report(f"{load_step.force_n:.4g} N")
        load_steps.append(load_step)

    def so_far(points):
        return _of_load_steps(sensor, compliance, points, load_steps, forces, control.reached.times, touch)

    def solve(points):
        load_steps.clear()
        control.reached.follow(map(record, _steps_on_pad(compliance, points, forces, stop, touch)), len(forces),
                               partial(so_far, points), label=control.label, start=start)

    reach = REACH * underside.depth_on_springs(forces[-1], compliance.foundation_modulus) + LEAST_REACH_MM
    points, _ = _of_candidates(underside, underside.points, reach, sensor.spec.thickness_mm, solve, lambda _: load_steps[-1].depth)
    return so_far(points)


def _steps_on_pad(compliance, points, forces, stop, touch):
    """A `FoundationLoadStep` for each force (l,); once the object rests on the shell, the same one for all larger forces."""
    steps, reached = press_foundation(compliance, points, forces), 0
    while reached < len(forces):
        try:
            step = next(steps)
        except ConvergenceError:     # a force that the pad cannot carry alone
            if np.isinf(stop):
                raise
            break
        if step.depth > stop:
            break
        reached += 1
        yield step
    if reached == len(forces):
        return
    on_pad = pad_forces(forces, stop_mm=stop, touch_mm=touch,
                        depth_of=lambda force: next(press_foundation(compliance, points, [force])).depth)
    *_, rest = press_foundation(compliance, points, np.unique(on_pad)) if on_pad.any() else [lifted(compliance, points, stop)]
    for _ in forces[reached:]:
        yield rest


def _snapped(forces, found):
    """The prescribed forces (l,) where the computed ones agree with them to rounding, else the computed ones (l,)."""
    return np.where(np.abs(found - forces) <= _ROUND_OFF * forces, forces, found)


def _of_load_steps(sensor, compliance, points, load_steps, forces, times, touch_mm):
    """The result of the load steps of a foundation press whose times are recorded, also after a failed load step."""
    load_steps = load_steps[:len(times)]
    area, count = points.covered * compliance.grid.areas(points.nodes), len(load_steps)
    compression = np.array([load_step.compression.max() for load_step in load_steps])
    depth = np.array([load_step.depth for load_step in load_steps]) - touch_mm
    touching = np.array([load_step.touching.sum() for load_step in load_steps])
    flags = flags_foundation(compression, depth, touching, frustum_mm=sensor.spec.dielectric.frusta.height_mm,
                             thickness_mm=sensor.spec.thickness_mm, law_limit_mm=compliance.law.limit_mm)
    unknown = np.full(count, np.nan)
    numbers = {"indentation_mm": depth, "pad_force_n": [load_step.force_n for load_step in load_steps],
               "penetration_mm": [load_step.penetration for load_step in load_steps],
               "contact_area_mm2": [area[load_step.touching].sum() for load_step in load_steps],
               "iterations": [load_step.iterations for load_step in load_steps], "frustum_compression_mm": compression}
    return make_result(sensor, "foundation", "dense", FoundationMaps(compliance, points)(load_steps), forces[:count],
                       np.array(times), flags=flags, residual_n=unknown, extrapolated_volume_fraction=unknown,
                       **numbers)


def _of_candidates(underside, points_within, reach, deepest, solve, depth_of):
    """Candidate contact points within a first reach (mm), and the result of `solve` for them; repeated with more points if deeper.

    Beside the object the surface rises, so points slightly above the object's depth can touch, too.
    """
    def among(reach):
        points = points_within(reach)
        return points, solve(points)

    return among_candidates(among, lambda found, _: RISE * (depth_of(found[1]) - underside.lowest_mm), reach_mm=reach,
                            most_mm=deepest)


# What a result takes over from an `ElasticMotion`.
_OF_MOTION = ("displacement_mm", "force_n", "torque_nmm", "slip", "iterations", "contact_area_mm2", "penetration_mm")


def press_elastic_motion(sensor: "Sensor", placed: Trimesh, motion: Motion, control: RunControl) -> PressResult:
    """Press step by step along a motion with the elastic model, which has no body to keep."""
    if not sensor.spec.base_held:
        raise InputError(f"{sensor.spec.name} has support 'none', which the elastic model presses straight down by force only; use "
                         "the hyperelastic model for this motion.")
    found = _moved_elastic(sensor, placed, motion, control)
    if not _between_nodes(sensor, HeightField.of(placed)):
        return found
    warnings.warn("The object has walls or pins that fall between the points of the elastic model's surface in some places of the "
                  "motion: no step is within its validity; use the hyperelastic model.", NarrowPartWarning, stacklevel=4)
    return flagged(found, "walls or pins of the object fall between the points of the surface in some places of the motion",
                   np.ones(found.steps, dtype=bool))


def _between_nodes(sensor, surface):
    """Whether nodes miss parts of an object in its place, or half a step beside it."""
    grid = sensor.prepared_models["elastic_surface"].grid
    beside = (np.append(0.5 * grid.step * share, 0.0) for share in ((0, 0), (1, 0), (0, 1), (1, 1)))
    return any(Underside(surface.moved(way), grid).narrow_parts(sensor.spec.thickness_mm) for way in beside)


def _moved_elastic(sensor, placed, motion, control):
    """The result of a mesh placed in the sensor's frame along a motion.

    Raises InputError for rotations, lateral loads, and an object that misses the sensor; ConvergenceError for a step that is not
    reached.
    """
    check_motion(motion)     # before what takes long to prepare
    if "elastic_surface" not in sensor.prepared_models:
        sensor.prepared_models["elastic_surface"] = cached_surface_compliance(sensor.spec, threads=control.threads)
    spec, surface, shell = sensor.spec, HeightField.of(placed), shell_of(sensor)
    lowest = surface.first_touch_mm(spec.map_x_mm, spec.map_y_mm)
    mover = SlidingObject(sensor.prepared_models["elastic_surface"], surface, first_touch_mm=lowest,
                          friction=spec.friction.object, deepest_mm=spec.thickness_mm)
    watch, reached = Watch(control.label, limit_s=control.time_limit_s), control.reached
    steps: list[tuple[SlidingState, int]] = []

    def followed() -> Iterator[None]:
        for state, count in steps_on_layer(mover, motion):
            shell.refuse_motion(surface, state.position[:2], state.position[2] + lowest, lowest, step=len(steps) + 1)
            steps.append((state, count))
            yield
            if len(steps) < len(motion.steps):     # the step is kept, and more are to come
                watch.report(f"step {len(steps)} of {len(motion.steps)}, {state.position[2]:.3f} mm deep")

    def so_far() -> PressResult:
        return _of_motion(sensor, motion_of(mover, steps[:len(reached.times)]), reached.times, placed, motion)

    reached.follow(followed(), len(motion.steps), so_far)
    return so_far()


def _of_motion(sensor, moved, seconds, placed, motion):
    """The result of an `ElasticMotion` of a placed mesh along a `Motion`, or of its first steps."""
    from softtact.imaging.depth_image import MovedObject

    unknown, spec = np.full(len(moved.depth_mm), np.nan), sensor.spec
    touch = HeightField.of(placed).first_touch_mm(spec.map_x_mm, spec.map_y_mm)
    followed = MovedObject(placed, touch, motion.aside_mm[:len(unknown)], moved.depth_mm, np.zeros(len(unknown)))
    plane = PlaneMotion(spec.map_x_mm, spec.map_y_mm, moved.displacement_mm, moved.traction_mpa, moved.slides, moved.gap_mm)
    attributes = {"friction_object": sensor.spec.friction.object, "friction": "of the object, Coulomb's"}
    result = make_result(sensor, "elastic", "Panagiotopoulos' turns", -moved.displacement_mm[..., 2], -moved.force_n[:, 2],
                         np.array(seconds[:len(unknown)]), indentation_mm=moved.depth_mm,
                         felt_mm=felt_displacement(sensor.spec, moved.sunk_mm),
                         flags=flags_elastic(moved.depth_mm, moved.sunk_mm, moved.points, thickness_mm=sensor.spec.thickness_mm,
                                             dielectric_mm=sensor.spec.dielectric_thickness_mm),
                         frustum_compression_mm=unknown, residual_n=unknown, extrapolated_volume_fraction=unknown, plane=plane,
                         seen_object=followed, **{name: getattr(moved, name) for name in _OF_MOTION})
    return replace(result, attributes=result.attributes | attributes)
