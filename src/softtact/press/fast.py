"""Presses of a placed object with the elastic and the foundation model: from its underside and forces to a `PressResult`."""

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from trimesh import Trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.contact.underside import Underside
from softtact.errors import ConvergenceError, InputError
from softtact.models.elastic.compliance import Compliance, LayerPress, press_layer
from softtact.models.foundation.solve import FoundationMaps, press_foundation
from softtact.press.elastic_motion import press_motion
from softtact.press.making import make_result, timed
from softtact.press.result import PressResult
from softtact.press.validity import valid_elastic, valid_foundation

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_MARGIN, _LEAST_MARGIN_MM = 1.3, 0.1     # of the depth on springs, within which points are looked for at first
_RISE = 1.15              # of the object's depth: points within may touch


def press_elastic(sensor: "Sensor", placed: Trimesh, forces: np.ndarray, *, label: str, threads: int,
                  keep_body: bool = False) -> PressResult:
    """All load steps at once with the elastic model, which has no body to keep: the surface's compliance is all that it knows."""
    start, compliance = time.perf_counter(), sensor.prepared("elastic", threads)
    underside = Underside(HeightField(placed), compliance.grid)
    points, press = _within_reach(underside, underside.nodes, compliance.foundation_modulus, forces, sensor.spec.deepest_mm,
                                  lambda points: press_layer(compliance, points, forces), lambda press: press.contact.depth[-1])
    seconds = np.full(len(forces), (time.perf_counter() - start) / len(forces))
    return elastic_result(sensor, compliance, press, forces, seconds, lowest_mm=underside.lowest_mm)


def elastic_result(sensor: "Sensor", compliance: Compliance, press: LayerPress, forces: np.ndarray, seconds: np.ndarray, *,
                   lowest_mm: float) -> PressResult:
    """The result of a `LayerPress`; lowest_mm: of the object over the free surface."""
    contact, unknown, thickness = press.contact, np.full(len(forces), np.nan), sensor.spec.thickness_mm
    return make_result(sensor, "elastic", "conjugate gradients", press.maps, forces, seconds, indentation_mm=contact.depth,
                       contact_area_mm2=press.areas @ (contact.force > 0),
                       penetration_mm=contact.penetration,
                       within_validity=valid_elastic(contact.depth - lowest_mm, thickness_mm=thickness),
                       frustum_compression_mm=unknown, residual_n=unknown, extrapolated_volume_fraction=unknown,
                       lower_maps=press.lower_maps, iterations=contact.iterations)


def press_on_foundation(sensor: "Sensor", placed: Trimesh, forces: np.ndarray, *, label: str, threads: int,
                        keep_body: bool = False) -> PressResult:
    """Load step by load step with the foundation model, which has no body to keep."""
    start, compliance = time.perf_counter(), sensor.prepared("foundation", threads)
    underside = Underside(HeightField(placed), compliance.grid)
    load_steps: list[Any] = []
    times: list[float] = []

    def solve(points):
        load_steps.clear()
        times.clear()
        record = (load_steps.append(load_step) for load_step in press_foundation(compliance, points, forces))
        try:
            timed(record, len(forces), label, times, start=start)
        except ConvergenceError as error:
            error.result = _of_load_steps(sensor, compliance, points, load_steps, forces, times) if load_steps else None
            raise

    points, _ = _within_reach(underside, underside.points, compliance.foundation_modulus, forces, sensor.spec.thickness_mm, solve,
                              lambda _: load_steps[-1].depth)
    return _of_load_steps(sensor, compliance, points, load_steps, forces, times)


def _of_load_steps(sensor, compliance, points, load_steps, forces, times):
    """The result of a foundation press' load steps, be it those before one that was not reached."""
    area, count = points.covered * compliance.grid.areas(points.nodes), len(load_steps)
    compression = np.array([load_step.compression.max() for load_step in load_steps])
    depth = np.array([load_step.depth for load_step in load_steps])
    valid = valid_foundation(compression, depth - points.gap.min(), frustum_mm=sensor.spec.dielectric.frusta.height_mm,
                             thickness_mm=sensor.spec.thickness_mm, law_limit_mm=compliance.law.limit_mm)
    unknown = np.full(count, np.nan)
    numbers = {"indentation_mm": depth, "penetration_mm": [load_step.penetration for load_step in load_steps],
               "contact_area_mm2": [area[load_step.touching].sum() for load_step in load_steps],
               "iterations": [load_step.iterations for load_step in load_steps], "frustum_compression_mm": compression}
    return make_result(sensor, "foundation", "dense", FoundationMaps(compliance, points)(load_steps), forces[:count],
                       np.array(times[:count]), within_validity=valid, residual_n=unknown, extrapolated_volume_fraction=unknown,
                       **numbers)


def _within_reach(underside, points_within, foundation_modulus, forces, deepest, solve, depth_of):
    """Points as far as the object may come down, and what `solve` makes of them; again with more where it came down further.

    Beside the object the surface rises, so points a little above its depth can touch, too.
    """
    reach = _MARGIN * underside.depth_on_springs(forces[-1], foundation_modulus) + _LEAST_MARGIN_MM
    while True:
        reach = min(reach, deepest)
        points = points_within(reach)
        found = solve(points)
        if reach == deepest or _RISE * (depth_of(found) - underside.lowest_mm) <= reach:
            return points, found
        reach *= _MARGIN


# What a result takes over from an `ElasticMotion`.
_OF_MOTION = ("displacement_mm", "force_n", "torque_nmm", "slip", "iterations", "contact_area_mm2", "penetration_mm")


def press_elastic_motion(sensor: "Sensor", placed: Trimesh, motion: Motion, *, label: str, threads: int,
                         keep_body: bool = False) -> PressResult:
    """Step by step with the elastic model, which has no body to keep; a ConvergenceError holds the steps before."""
    if not sensor.spec.base_held:
        raise InputError(f"{sensor.spec.name} has support 'none', which the elastic model presses straight down by force only; use "
                         "the hyperelastic model for this motion.")
    seconds: list[float] = []
    try:
        moved = press_motion(sensor, placed, motion, seconds, label=label, threads=threads)
    except ConvergenceError as error:
        error.result = error.result and _of_motion(sensor, error.result, seconds)
        raise
    return _of_motion(sensor, moved, seconds)


def _of_motion(sensor, moved, seconds):
    """The result of an `ElasticMotion`."""
    unknown = np.full(len(moved.depth_mm), np.nan)
    attributes = {"friction_object": sensor.spec.friction.object, "friction": "of the object, Coulomb's"}
    result = make_result(sensor, "elastic", "Panagiotopoulos' turns", -moved.displacement_mm[..., 2], -moved.force_n[:, 2],
                         np.array(seconds[:len(unknown)]), indentation_mm=moved.depth_mm,
                         within_validity=valid_elastic(moved.depth_mm, thickness_mm=sensor.spec.thickness_mm),
                         frustum_compression_mm=unknown, residual_n=unknown, extrapolated_volume_fraction=unknown,
                         **{name: getattr(moved, name) for name in _OF_MOTION})
    return replace(result, attributes=result.attributes | attributes)
