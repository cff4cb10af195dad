"""A press of a placed object with one model: from the object's underside and forces to a `PressResult`."""

import time
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from trimesh import Trimesh

from softtact.contact.height_field import HeightField, SweptSurface
from softtact.contact.motion import Motion
from softtact.contact.underside import Underside
from softtact.errors import ConvergenceError, ExtrapolationWarning, InputError
from softtact.models.elastic.compliance import Compliance, LayerPress, press_layer
from softtact.models.foundation.solve import FoundationMaps, press_foundation
from softtact.models.hyperelastic import path
from softtact.models.hyperelastic.build_plain import lower_side
from softtact.models.hyperelastic.deformed_mesh import pressed_body
from softtact.press.elastic_motion import press_motion
from softtact.press.result import PressResult
from softtact.press.validity import valid_elastic, valid_foundation, valid_hyperelastic
from softtact.progress import announce, progress
from softtact.readout.capacitance import ideal_counts

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_CORNER = 0.01            # share of a layer: strains at an edge of the object go beyond any data
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
            _timed(record, len(forces), label, times, start=start)
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


def press_hyperelastic(sensor: "Sensor", placed: Trimesh, forces: np.ndarray | Motion, *, label: str, threads: int,
                       keep_body: bool = False) -> PressResult:
    """Load step by load step with the hyperelastic model; a ConvergenceError holds the load steps before.

    forces (l,) in N, or a `Motion`;  keep_body: let the result hold the whole body's displacements at each load step
    """
    surface = HeightField(placed)
    lowest = surface.first_touch_mm(sensor.spec.map_x_mm, sensor.spec.map_y_mm)
    count = len(forces.steps) if isinstance(forces, Motion) else len(forces)
    if isinstance(forces, Motion):
        path.check_motion(forces)
    body = sensor.body(threads=threads, surface=_swept(surface, forces))
    grid = np.stack(np.meshgrid(sensor.spec.map_x_mm, sensor.spec.map_y_mm), axis=-1).reshape(-1, 2)
    sampling, lower = body.slab.sampling(grid), None if sensor.spec.base_held else lower_side(body.slab, grid)
    announce(f"{label}: {sensor.spec.parts_in_words}, {count} load steps of the hyperelastic model, some seconds each")
    record: list[dict[str, Any]] = []
    times: list[float] = []
    bodies: list[Any] = []

    def read(load_step):
        _refuse_beyond_the_board(load_step, lowest, sensor.spec.deepest_mm)
        record.append(_read_load_step(body, (sampling, lower, grid), load_step,
                                      from_mm=lowest if isinstance(forces, Motion) else 0.0))
        if keep_body:
            bodies.append(pressed_body(body, load_step.state))

    load_steps = (path.press_motion(body, surface, forces, lowest, settings=sensor.solver) if isinstance(forces, Motion)
                  else path.press_load_steps(body, surface, forces, settings=sensor.solver))
    try:
        _timed((read(load_step) for load_step in load_steps), count, label, times)
    except ConvergenceError as error:
        error.result = _of_record(sensor, body, record, times, bodies) if record else None
        raise
    finally:
        body.close()
    return _of_record(sensor, body, record, times, bodies)


def _swept(surface, forces):
    """The underside at all places of the object together, where the mesh is to be fine."""
    return SweptSurface(surface, forces.offsets_mm()) if isinstance(forces, Motion) and not forces.straight else surface


def _refuse_beyond_the_board(load_step, lowest_mm, thickness_mm):
    """Raise ConvergenceError where a tip that no contact point feels has gone farther down than the sensor is thick."""
    depth = load_step.state.indentation - lowest_mm
    if depth > thickness_mm:
        raise ConvergenceError(
            f"The load step of {load_step.force_n:g} N was not reached: the object's tip would be {depth:.3g} mm deep in a sensor "
            f"{thickness_mm:g} mm thick, for it slips in between the points of the cover that feel contact. Ask for smaller "
            "forces, a finer cover (--mesh-quality fine), or use a blunter tip.")


def _of_record(sensor, body, record, times, bodies):
    numbers = {name: np.array([load_step[name] for load_step in record]) for name in record[0]}
    forces, displacement = numbers.pop("normal_force_n"), numbers["displacement_mm"]
    numbers["displacement_mm"] = displacement.reshape(len(record), *sensor.spec.map_shape, 3)
    numbers["slip"] = numbers["slip"].reshape(len(record), *sensor.spec.map_shape)
    _warn_extrapolation(numbers["extrapolated_volume_fraction"], forces)
    valid = valid_hyperelastic(compression_mm=numbers["frustum_compression_mm"], depth_mm=numbers["indentation_mm"],
                               contact_error_mm=numbers.pop("contact_error_mm"), points=numbers.pop("points"),
                               frustum_mm=sensor.spec.frustum_height_mm, forces_n=forces,
                               allowed_mm=sensor.solver.largest_penetration_mm)
    result = make_result(sensor, "hyperelastic", body.method, -displacement[..., 2], forces, np.array(times),
                         within_validity=valid, **numbers)
    return replace(result, bodies=tuple(bodies))


def _warn_extrapolation(shares, forces):
    """Warn of the first load step at which a layer is strained beyond the data behind its card in more than a corner."""
    outside = [(force, share) for force, share in zip(forces, shares, strict=False) if share > _CORNER]
    if outside:
        force, share = outside[0]
        warnings.warn(f"At {force:g} N {share:.1%} of a layer is strained beyond the data behind its material card"
                      " (`result.extrapolated_volume_fraction`): what its law says there is extrapolated.",
                      ExtrapolationWarning, stacklevel=5)


def _read_load_step(body, maps, load_step, *, from_mm):
    """The numbers of a load step by their names in a result; fields over the map's points (y * x,).

    maps: what samples the map's plane, what samples a free lower side (or None), and the points (y * x, 2);  from_mm: the
    indentation from which depths count
    """
    sampling, lower, grid = maps
    slab, support, top = load_step.state.slab, load_step.state.support, body.slab.top
    force, torque = top.resultant(slab)
    free_below = {} if lower is None else {"lower_maps": -(lower @ slab.displacement[:, 2])}
    return free_below | {"normal_force_n": load_step.force_n, "force_n": force, "torque_nmm": torque,
            "displacement_mm": sampling @ slab.displacement, "slip": top.slip_at(slab, grid),
            "indentation_mm": load_step.state.indentation - from_mm, "contact_area_mm2": top.area_under_pressure(slab),
            "penetration_mm": load_step.penetration_mm, "contact_error_mm": body.contact_error(load_step.state),
            "points": np.count_nonzero(top.under_pressure(slab)),
            "frustum_compression_mm": body.support.largest_compression(support.displacement), "residual_n": load_step.residual_n,
            "extrapolated_volume_fraction": body.share_outside_window(load_step.state), "iterations": load_step.iterations}


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


# Those that take a `Motion` in place of forces.
MOTIONS = {"elastic": press_elastic_motion, "hyperelastic": press_hyperelastic}
PRESSES = {"elastic": press_elastic, "foundation": press_on_foundation, "hyperelastic": press_hyperelastic}


def make_result(sensor: "Sensor", model: str, solver: str, maps: np.ndarray, forces: np.ndarray, times: np.ndarray,
                **numbers: Any) -> PressResult:
    """A `PressResult` of maps (l, points) or (l, ny, nx) and numbers by the result's names.

    lower_maps among these: of the lower side where it moves; capacitance follows the change of thickness
    """
    spec, maps = sensor.spec, maps.reshape(len(forces), *sensor.spec.map_shape)
    lower_maps = numbers.pop("lower_maps", None)
    thinning = maps if lower_maps is None else maps - lower_maps.reshape(maps.shape)
    flags: dict[str, Any] = {"converged": np.ones(len(forces), dtype=np.int8),
                             "within_validity": np.asarray(numbers.pop("within_validity"), dtype=np.int8)}
    arrays: dict[str, Any] = {name: np.asarray(values) for name, values in numbers.items()}
    return PressResult(deformation_map_mm=maps, tactile_map=ideal_counts(spec, thinning), normal_force_n=forces, wall_time_s=times,
                       x_mm=spec.map_x_mm, y_mm=spec.map_y_mm, model=model, sensor=spec.name, solver=solver,
                       largest_counts=spec.largest_counts,
                       attributes={"thickness_mm": spec.thickness_mm, **_friction(spec, model), **sensor.attributes}, **flags,
                       **arrays)


def _friction(spec, model):
    """Attributes that state the friction of a result."""
    if model != "hyperelastic":
        return {"friction": f"none: the {model} model knows no friction"}
    return spec.support_facts


def _timed(load_steps, count, label, times, *, start=None):
    """The load steps as a list, and into `times` the seconds that each took; the solver's preparation counts to the first."""
    out, start = [], start or time.perf_counter()
    for load_step in progress(load_steps, label=label, total=count):
        now = time.perf_counter()
        out.append(load_step)
        times.append(now - start)
        start = now
    return out
