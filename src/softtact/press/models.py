"""A press of a placed object with one model: from the object's underside and forces to a `PressResult`."""

import time
import warnings
from dataclasses import replace

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.contact.underside import Underside
from softtact.errors import ConvergenceError, OutsideCardWarning
from softtact.models.elastic.compliance import press_layer
from softtact.models.foundation.solve import FoundationMaps, press_foundation
from softtact.models.hyperelastic import newton
from softtact.models.hyperelastic.deformed_mesh import pressed_body
from softtact.press.result import PressResult
from softtact.press.validity import valid_elastic, valid_foundation, valid_hyperelastic
from softtact.progress import announce, progress
from softtact.readout.capacitance import ideal_counts

_CORNER = 0.01            # share of a layer: strains at an edge of the object go beyond any data
_MARGIN, _LEAST_MARGIN_MM = 1.3, 0.1     # of the depth on springs, within which points are looked for at first
_RISE = 1.15              # of the object's depth: points within may touch


def press_elastic(sensor, placed, forces, *, label, threads, keep_body=False):
    """All levels at once with the elastic model, which has no body to keep: the surface's flexibility is all that it knows."""
    start, compliance = time.perf_counter(), sensor.prepared("elastic", threads)
    underside = Underside(HeightField(placed), compliance.grid)
    points, press = _within_reach(underside, underside.nodes, compliance.bedding, forces, sensor.spec.thickness_mm,
                                  lambda points: press_layer(compliance, points, forces), lambda press: press.contact.depth[-1])
    seconds = np.full(len(forces), (time.perf_counter() - start) / len(forces))
    return elastic_result(sensor, compliance, press, forces, seconds, lowest_mm=underside.lowest_mm)


def elastic_result(sensor, compliance, press, forces, seconds, *, lowest_mm):
    """The result of a `LayerPress`; lowest_mm: of the object over the free surface."""
    contact, unknown, thickness = press.contact, np.full(len(forces), np.nan), sensor.spec.thickness_mm
    return make_result(sensor, "elastic", "conjugate gradients", press.maps, forces, seconds, indentation_mm=contact.depth,
                       contact_area_mm2=np.prod(compliance.grid.step) * np.count_nonzero(contact.force > 0, axis=0),
                       penetration_mm=contact.penetration,
                       within_validity=valid_elastic(contact.depth - lowest_mm, thickness_mm=thickness),
                       frustum_compression_mm=unknown, residual_n=unknown, outside_card=unknown, iterations=contact.iterations)


def press_on_foundation(sensor, placed, forces, *, label, threads, keep_body=False):
    """Level by level with the foundation model, which has no body to keep."""
    start, flexibility = time.perf_counter(), sensor.prepared("foundation", threads)
    underside = Underside(HeightField(placed), flexibility.grid)
    levels, times = [], []

    def solve(points):
        levels.clear()
        times.clear()
        record = (levels.append(level) for level in press_foundation(flexibility, points, forces))
        try:
            _timed(record, forces, label, times, start=start)
        except ConvergenceError as error:
            error.result = _of_levels(sensor, flexibility, points, levels, forces, times) if levels else None
            raise

    points, _ = _within_reach(underside, underside.points, flexibility.bedding, forces, sensor.spec.thickness_mm, solve,
                              lambda _: levels[-1].depth)
    return _of_levels(sensor, flexibility, points, levels, forces, times)


def _of_levels(sensor, flexibility, points, levels, forces, times):
    """The result of a foundation press' levels, be it those before one that was not reached."""
    area, count = points.covered * np.prod(flexibility.grid.step), len(levels)
    compression = np.array([level.compression.max() for level in levels])
    depth = np.array([level.depth for level in levels])
    valid = valid_foundation(compression, depth - points.gap.min(), frustum_mm=sensor.spec.dielectric.frusta.height_mm,
                             thickness_mm=sensor.spec.thickness_mm, law_limit_mm=flexibility.law.limit_mm)
    unknown = np.full(count, np.nan)
    numbers = {"indentation_mm": depth, "penetration_mm": [level.penetration for level in levels],
               "contact_area_mm2": [area[level.touching].sum() for level in levels],
               "iterations": [level.iterations for level in levels], "frustum_compression_mm": compression}
    return make_result(sensor, "foundation", "dense", FoundationMaps(flexibility, points)(levels), forces[:count],
                       np.array(times[:count]), within_validity=valid, residual_n=unknown, outside_card=unknown,
                       **numbers)


def _within_reach(underside, points_within, bedding, forces, deepest, solve, depth_of):
    """Points as far as the object may come down, and what `solve` makes of them; again with more where it came down further.

    Beside the object the surface rises, so points a little above its depth can touch, too.
    """
    reach = _MARGIN * underside.depth_on_springs(forces[-1], bedding) + _LEAST_MARGIN_MM
    while True:
        reach = min(reach, deepest)
        points = points_within(reach)
        found = solve(points)
        if reach == deepest or _RISE * (depth_of(found) - underside.lowest_mm) <= reach:
            return points, found
        reach *= _MARGIN


def press_hyperelastic(sensor, placed, forces, *, label, threads, keep_body=False):
    """Level by level with the hyperelastic model; a ConvergenceError holds the levels before.

    keep_body: let the result hold the whole body's displacements at each level
    """
    surface = HeightField(placed)
    body = sensor.body(threads=threads, surface=surface)
    grid = np.stack(np.meshgrid(sensor.spec.map_x_mm, sensor.spec.map_y_mm), axis=-1).reshape(-1, 2)
    sampling = body.slab.sampling(grid)
    announce(f"{label}: {body.bed.count} frusta, {len(forces)} force levels of the hyperelastic model, some seconds each")
    record, times, bodies = [], [], []
    lowest = _lowest_over(placed, sensor.spec.footprint_mm)

    def read(level):
        _refuse_beyond_the_board(level, lowest, sensor.spec.thickness_mm)
        record.append(_read_level(body, sampling, level))
        if keep_body:
            bodies.append(pressed_body(body, level.state))

    levels = (read(level)
              for level in newton.press_levels(body, surface, forces, settings=sensor.solver))
    try:
        _timed(levels, forces, label, times)
    except ConvergenceError as error:
        error.result = _of_record(sensor, body, record, forces, times, bodies) if record else None
        raise
    finally:
        body.close()
    return _of_record(sensor, body, record, forces, times, bodies)


def _lowest_over(placed, footprint_mm):
    """Height (mm) of the lowest vertex over the sensor; infinite where there is none."""
    half = np.asarray(footprint_mm) / 2
    return placed.vertices[(np.abs(placed.vertices[:, :2]) <= half).all(axis=1), 2].min(initial=np.inf)


def _refuse_beyond_the_board(level, lowest_mm, thickness_mm):
    """Raise ConvergenceError where a tip that no contact point feels has gone farther down than the sensor is thick."""
    depth = level.state.indentation - lowest_mm
    if depth > thickness_mm:
        raise ConvergenceError(f"The level of {level.force_n:g} N was not reached: the object's tip would be {depth:.3g} mm deep "
                               f"in a sensor {thickness_mm:g} mm thick, for it slips in between the points of the cover that feel "
                               "contact. Ask for smaller forces, a finer cover (--mesh-quality fine), or use a blunter tip.")


def _of_record(sensor, body, record, forces, times, bodies):
    maps, levels = zip(*record, strict=True)
    numbers = {name: np.array([level[name] for level in levels]) for name in levels[0]}
    _warn_outside_card(numbers["outside_card"], forces)
    valid = valid_hyperelastic(compression_mm=numbers["frustum_compression_mm"], depth_mm=numbers["indentation_mm"],
                               contact_error_mm=numbers.pop("contact_error_mm"), points=numbers.pop("points"),
                               frustum_mm=sensor.spec.dielectric.frusta.height_mm,
                               allowed_mm=sensor.solver.largest_penetration_mm)
    result = make_result(sensor, "hyperelastic", body.method, np.stack(maps), forces[:len(maps)], np.array(times),
                         within_validity=valid, **numbers)
    return replace(result, bodies=tuple(bodies))


def _warn_outside_card(shares, forces):
    """Warn of the first level at which a layer is strained beyond the data behind its card in more than a corner."""
    outside = [(force, share) for force, share in zip(forces, shares, strict=False) if share > _CORNER]
    if outside:
        force, share = outside[0]
        warnings.warn(f"At {force:g} N {share:.1%} of a layer is strained beyond the data behind its material card"
                      " (`result.outside_card`): what its law says there is extrapolated.", OutsideCardWarning, stacklevel=5)


def _read_level(body, sampling, level):
    """The map (y * x,) in mm of a level, and its numbers by their names."""
    slab, bed, top = level.state.slab, level.state.bed, body.slab.top
    return -(sampling @ slab.displacement[:, 2]), {
        "indentation_mm": level.state.indentation, "contact_area_mm2": top.area_under_pressure(slab),
        "penetration_mm": level.penetration_mm, "contact_error_mm": body.contact_error(level.state),
        "points": np.count_nonzero(top.under_pressure(slab)),
        "frustum_compression_mm": body.bed.compression(bed.displacement).max(),
        "residual_n": level.residual_n, "outside_card": body.share_outside_window(level.state), "iterations": level.iterations}


PRESSES = {"elastic": press_elastic, "foundation": press_on_foundation, "hyperelastic": press_hyperelastic}


def make_result(sensor, model, solver, maps, forces, times, **numbers):
    """A `PressResult` of maps (l, points) or (l, ny, nx) and numbers by the result's names."""
    spec, maps = sensor.spec, maps.reshape(len(forces), *sensor.spec.map_shape)
    flags = {"converged": np.ones(len(forces), dtype=np.int8),
             "within_validity": np.asarray(numbers.pop("within_validity"), dtype=np.int8)}
    return PressResult(deformation_map_mm=maps, tactile_map=ideal_counts(spec, maps), force_n=forces, wall_time_s=times,
                       x_mm=spec.map_x_mm, y_mm=spec.map_y_mm, model=model, sensor=spec.name, solver=solver,
                       largest_counts=spec.largest_counts,
                       attributes={"thickness_mm": spec.thickness_mm, **_friction(spec, model), **sensor.attributes}, **flags,
                       **{name: np.asarray(values) for name, values in numbers.items()})


def _friction(spec, model):
    """Attributes that state the friction of a result."""
    if model != "hyperelastic":
        return {"friction": f"none: the {model} model knows no friction"}
    return {"friction_object": spec.friction.object, "friction_board": spec.friction.board, "tips_held": int(spec.tips_held)}


def _timed(levels, forces, label, times, *, start=None):
    """The levels as a list, and into `times` the seconds that each took; the solver's preparation counts to the first."""
    out, start = [], start or time.perf_counter()
    for level in progress(levels, label=label, total=len(forces)):
        now = time.perf_counter()
        out.append(level)
        times.append(now - start)
        start = now
    return out
