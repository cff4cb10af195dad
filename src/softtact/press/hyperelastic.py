"""A press of a placed object with the hyperelastic model: from its mesh and forces, or a `Motion`, to a `PressResult`."""

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from trimesh import Trimesh

from softtact.contact.height_field import HeightField, SweptSurface
from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError, ExtrapolationWarning
from softtact.models.hyperelastic import path
from softtact.models.hyperelastic.build import lower_side
from softtact.models.hyperelastic.deformed_mesh import pressed_body
from softtact.press.cache import in_words
from softtact.press.foretelling import warn_before
from softtact.press.making import make_result
from softtact.press.objects import shell_of
from softtact.press.result import PressResult
from softtact.press.task import RunControl
from softtact.press.validity import flags_hyperelastic
from softtact.progress import Watch, announce
from softtact.readout.registry import Samples

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_FIRST_S, _STEP_S, _FRUSTA = 17.0, 1.2, 540     # of a press and of each load step, for so many frusta
_CORNER = 0.01            # share of a layer that may exceed the data: strains at an edge of the object always exceed them


def press_hyperelastic(sensor: "Sensor", placed: Trimesh, forces: np.ndarray | Motion, control: RunControl) -> PressResult:
    """Press load step by load step with the hyperelastic model, by forces (l,) in N or a `Motion`.

    A ConvergenceError, which a time limit raises too, and a KeyboardInterrupt hold the load steps before.
    """
    surface = HeightField.of(placed)
    touch = surface.first_touch_mm(sensor.spec.map_x_mm, sensor.spec.map_y_mm)
    count = len(forces.steps) if isinstance(forces, Motion) else len(forces)
    if isinstance(forces, Motion):
        path.check_motion(forces)
    else:
        warn_before(sensor, placed, float(forces[-1]))
    body = sensor.body(threads=control.threads, surface=_swept(surface, forces))
    if control.label:
        steps = f"{count} load step{'s' * (count > 1)}"
        announce(f"{control.label}: {sensor.spec.parts_in_words}, {steps} of the hyperelastic model{time_in_words(sensor, count)}")
    body.watch = Watch(control.label, limit_s=control.time_limit_s)
    record = _Record(sensor, body, surface, touch, control)
    load_steps = map(record.take, _allowed(_load_steps(sensor, body, surface, forces, touch), sensor, surface, forces, touch))
    try:
        control.reached.follow(load_steps, count, record.result)
        return record.result()
    finally:
        body.watch.end()
        body.close()


def time_in_words(sensor: "Sensor", count: int) -> str:
    """How long a press with the default mesh takes on two idle cores, after docs/performance.md; nothing without frusta."""
    if np.isnan(sensor.spec.frustum_height_mm):
        return ""
    seconds = (_FIRST_S + _STEP_S * count) * np.prod(sensor.spec.frusta_counts) / _FRUSTA
    return f": {in_words(seconds)} on two idle cores, more for fine details"


def _load_steps(sensor, body, surface, forces, touch_mm):
    """The path's `LoadStep`s, one after the other."""
    if isinstance(forces, Motion):
        return path.press_motion(body, surface, forces, touch_mm, settings=sensor.solver)
    return path.press_load_steps(body, surface, forces, settings=sensor.solver, touch_mm=touch_mm,
                                 stop_mm=shell_of(sensor).stop_mm(surface))


def _allowed(load_steps, sensor, surface, forces, touch_mm):
    """The load steps, with a ConvergenceError at the first one in which the object passes the board or, in a motion, the shell."""
    shell = shell_of(sensor)
    for number, load_step in enumerate(load_steps, start=1):
        _refuse_beyond_the_board(load_step, touch_mm, sensor.spec.deepest_mm)
        if isinstance(forces, Motion):
            state = load_step.state
            shell.refuse_motion(surface, state.slab.projection.offset_mm, state.indentation, touch_mm, step=number)
        yield load_step


def _swept(surface, forces):
    """The envelope of the underside over all positions of the object, for the refinement of the mesh."""
    return SweptSurface(surface, forces.offsets_mm()) if isinstance(forces, Motion) and not forces.straight else surface


def _refuse_beyond_the_board(load_step, lowest_mm, thickness_mm):
    """Raise ConvergenceError if a tip between the contact points is deeper than the sensor is thick."""
    depth = load_step.state.indentation - lowest_mm
    if depth > thickness_mm:
        raise ConvergenceError(
            f"The load step of {load_step.force_n:g} N was not reached: the object's tip would be {depth:.3g} mm deep in a sensor "
            f"{thickness_mm:g} mm thick, as it slips between the contact points of the cover. Ask for smaller "
            "forces, a finer cover (--mesh-quality fine), or use a blunter tip.")


class _Record:
    """The numbers of a press' load steps, and the bodies if they are kept."""

    def __init__(self, sensor, body, surface, touch_mm, control):
        self._sensor, self._body, self._surface, self._touch_mm, self._control = sensor, body, surface, touch_mm, control
        self._grid = np.stack(np.meshgrid(sensor.spec.map_x_mm, sensor.spec.map_y_mm), axis=-1).reshape(-1, 2)
        self._sampling = body.slab.sampling(self._grid)
        self._lower = None if sensor.spec.base_held else lower_side(body.slab, self._grid)
        self._steps: list[dict[str, Any]] = []
        self._bodies: list[Any] = []

    def take(self, load_step):
        """Record the numbers of a load step; its time is recorded by the caller."""
        maps = self._sampling, self._lower, self._grid
        numbers = _read_load_step(self._body, maps, load_step, from_mm=self._touch_mm)
        if numbers["pad_force_n"] <= 0 and not self._reaches(load_step.state):
            numbers["points"] = np.inf      # there is nothing to carry
        self._steps.append(numbers)
        if self._control.keep_body:
            self._bodies.append(pressed_body(self._body, load_step.state))

    def _reaches(self, state):
        """Whether the object reaches below the free surface of the pad, which must carry it then."""
        spec, offset = self._sensor.spec, state.slab.projection.offset_mm
        low, high = (np.array([spec.map_x_mm[end], spec.map_y_mm[end]]) - offset for end in (0, -1))
        return state.indentation - self._surface.lowest_over(low, high) > self._sensor.solver.largest_penetration_mm

    def result(self):
        """The `PressResult` of the load steps whose time is recorded: an interruption may come just before that."""
        sensor, times = self._sensor, self._control.reached.times
        steps = self._steps[:len(times)]
        pressure = [load_step["pressure"] for load_step in steps]
        numbers = {name: np.array([load_step[name] for load_step in steps]) for name in steps[0] if name != "pressure"}
        forces, displacement = numbers.pop("normal_force_n"), numbers["displacement_mm"]
        numbers["displacement_mm"] = displacement.reshape(len(steps), *sensor.spec.map_shape, 3)
        numbers["slip"] = numbers["slip"].reshape(len(steps), *sensor.spec.map_shape)
        _warn_extrapolation(numbers["extrapolated_volume_fraction"], forces)
        flags = flags_hyperelastic(compression_mm=numbers["frustum_compression_mm"], depth_mm=numbers["indentation_mm"],
                                   contact_error_mm=numbers.pop("contact_error_mm"), points=numbers.pop("points"),
                                   rough=numbers.pop("rough"), residual_n=numbers["residual_n"],
                                   volume_ratio=numbers["least_volume_ratio"],
                                   frustum_mm=sensor.spec.frustum_height_mm, forces_n=forces,
                                   allowed_mm=sensor.solver.largest_penetration_mm)
        made = make_result(sensor, "hyperelastic", self._body.method, -displacement[..., 2], forces, np.array(times),
                           flags=flags, pressure=pressure, **numbers)
        return replace(made, bodies=tuple(self._bodies[:len(steps)]))


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

    maps: sampling of the map's plane, of a free lower side (or None), and the points (y * x, 2);  from_mm: indentation at which
    depths are zero
    """
    sampling, lower, grid = maps
    slab, support, top = load_step.state.slab, load_step.state.support, body.slab.top
    force, torque = top.resultant(slab)
    on_shell = load_step.elsewhere_n
    free_below = {} if lower is None else {"lower_maps": -(lower @ slab.displacement[:, 2])}
    return free_below | {"normal_force_n": load_step.force_n, "pad_force_n": load_step.force_n - on_shell,
            "force_n": force - [0.0, 0.0, on_shell], "torque_nmm": np.full(3, np.nan) if on_shell else torque,
            "displacement_mm": sampling @ slab.displacement, "slip": top.slip_at(slab, grid),
            "indentation_mm": load_step.state.indentation - from_mm, "contact_area_mm2": top.area_under_pressure(slab),
            "penetration_mm": load_step.penetration_mm, "contact_error_mm": body.contact_error(load_step.state),
            "points": np.count_nonzero(top.under_pressure(slab)),
            "frustum_compression_mm": body.support.largest_compression(support.displacement), "residual_n": load_step.residual_n,
            "least_volume_ratio": body.slab.cover_mesh.least_volume_ratio(slab.displacement),
            "edge_radius_mm": slab.projection.edge_radius_mm,
            "extrapolated_volume_fraction": body.share_outside_window(load_step.state), "iterations": load_step.iterations,
            "rough": load_step.rough, "pressure": _pressure(top, slab)}


def _pressure(top, slab):
    """Samples of the contact pressure, the mean over each face of the sensing surface."""
    count = len(top.faces)
    places = top.reference.reshape(count, -1, 3).mean(axis=1) * [1.0, 1.0, 0.0]
    return Samples(places, top.area.reshape(count, -1).sum(axis=1), top.pressure_of_faces(slab))
