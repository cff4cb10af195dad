"""A `Motion` on the elastic layer: its steps, divided into increments where the path matters, and what a result holds of each.

The model moves the object along x, y and z. With friction a step is divided so that the object moves aside by at most half of the
nodes' spacing in an increment (no node is passed over, and each takes hold where it comes to touch), and down by an eighth of it.
Without friction there is no history, and each step is one increment.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from softtact.contact.coulomb import CoulombSettings
from softtact.contact.motion import Motion, MotionStep
from softtact.errors import ConvergenceError, InputError
from softtact.models.elastic.sliding import SlidingObject, SlidingState
from softtact.models.elastic.tangential import SurfaceCompliance

_SETTINGS = CoulombSettings()
_ASIDE, _DOWN = 0.5, 0.125      # of the nodes' spacing: the largest ways of an increment with friction
_REFUSED = "the elastic model moves the object along x, y and z by ways and loads z only; leave {} out or take another model."


@dataclass(frozen=True)
class ElasticMotion:
    """The ends of a motion's steps on the elastic layer. Frame: the sensor's, z out of the surface."""

    depth_mm: np.ndarray
    """(step,): how far the object is below its first touch."""
    displacement_mm: np.ndarray
    """(step, y, x, 3): of the surface's points on the map's grid; a deformation map is minus the last component."""
    force_n: np.ndarray
    """(step, 3): the object's force on the sensor's surface; pressing down is negative in z."""
    torque_nmm: np.ndarray
    """(step, 3): its moment about the sensor frame's origin, of forces at the undeformed surface's points."""
    slip: np.ndarray
    """(step, y, x) in mm: the length of the path on which a point has slid on the object since it last came to touch; nan where it
    does not touch. Slip is the surface's tangential displacement less the object's way; 0 where a point has stuck throughout."""
    contact_area_mm2: np.ndarray
    """(step,): area of the nodes under pressure."""
    penetration_mm: np.ndarray
    """(step,): deepest overlap."""
    iterations: np.ndarray
    """(step,): turns of the normal and the tangential problem, of all increments of the step."""
    increments: np.ndarray
    """(step,): into how many increments the step was divided."""
    dissipated_mj: np.ndarray
    """(step,): work of friction since the motion began."""
    stored_mj: np.ndarray
    """(step,): elastic energy of the layer."""
    work_mj: np.ndarray
    """(step,): work of the object's force since the motion began; stored and dissipated energy, to the increments' order."""


def move_on_layer(compliance: SurfaceCompliance, underside: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
                  motion: Motion, *, first_touch_mm: float, friction: float, deepest_mm: float,
                  settings: CoulombSettings = _SETTINGS, on_step: Callable[[SlidingState], None] | None = None) -> ElasticMotion:
    """The `ElasticMotion` of an object with an `underside(x, y)` (heights (n,) in mm and normals) over a layer.

    first_touch_mm: height of its lowest point over the surface;  friction: Coulomb's coefficient
    deepest_mm: the layer's thickness;  on_step: called with each step's `SlidingState`, which it may refuse
    Raises InputError for freedoms that the model does not know, and ConvergenceError with `result`, the `ElasticMotion` of the
    steps before (or None), where a step is not reached.
    """
    check_motion(motion)
    mover = SlidingObject(compliance, underside, first_touch_mm=first_touch_mm, friction=friction, deepest_mm=deepest_mm,
                          settings=settings)
    states, counts, load = [mover.start], [], None
    try:
        for number, step in enumerate(motion.steps, start=1):
            load = _load_after(step, load)
            state, count = _step(mover, states[-1], step, load)
            if state.position[2] > deepest_mm:
                raise ConvergenceError(f"Step {number} was not reached: the object would be {state.position[2]:.3g} mm deep in a "
                                       f"layer {deepest_mm:g} mm thick; press less deep or with less force.")
            if on_step:
                on_step(state)
            states.append(state)
            counts.append(count)
    except ConvergenceError as error:
        error.result = _result(compliance, states, counts) if counts else None
        raise
    return _result(compliance, states, counts)


def check_motion(motion: Motion) -> None:
    """Raise InputError for what the elastic model does not know."""
    if not motion.steps:
        raise InputError("The motion has no steps; add one, for example with Motion().press(force_n=5).")
    for number, step in enumerate(motion.steps, start=1):
        turned = [name for name in step.ways if name not in ("x", "y", "z")]
        loaded = [name for name in step.loads if name != "z"]
        if turned or loaded:
            what = f"the rotation {turned[0]}" if turned else f"the load on {loaded[0]}"
            raise InputError(f"Step {number} of the motion: {_REFUSED.format(what)}")
        if step.loads.get("z", -1.0) >= 0:
            raise InputError(f"Step {number} of the motion: a load of {step.loads['z']:g} N along z does not press; give one "
                             "below 0, or a way along z.")


def _load_after(step: MotionStep, load: float | None) -> float | None:
    """The normal load (N, positive) at a step's end, or None where the depth is prescribed."""
    if "z" in step.loads:
        return -step.loads["z"]
    return None if "z" in step.ways else load


def _step(mover: SlidingObject, state: SlidingState, step: MotionStep, load: float | None) -> tuple[SlidingState, int]:
    """The state at a step's end, and the number of its increments."""
    aside = np.array([step.ways.get("x", 0.0), step.ways.get("y", 0.0)])
    down = -step.ways.get("z", 0.0)
    count = _increments(mover, state, aside, down, load)
    begin = state.position[2]
    loads = [None] * count if load is None else mover.fractions(state, load, count)
    depths = [None] * count if load is not None else begin + down * np.arange(1, count + 1) / count
    for depth, carried in zip(depths, loads, strict=True):
        state = mover.advance(state, aside / count, depth=depth, load=carried)
    return state, count


def _increments(mover, state, aside, down, load):
    if mover.friction == 0:
        return 1
    spacing = mover.compliance.grid.step.min()
    if load is not None and abs(load - state.normal.sum()) > 1e-9 * load:
        down = mover.depth_of(state, load) - mover.depth_of(state, max(state.normal.sum(), 0.0))
    return max(1, *(int(np.ceil(way / (share * spacing) - 1e-9))
                    for way, share in ((np.linalg.norm(aside), _ASIDE), (abs(down), _DOWN))))


def _result(compliance, states, counts):
    """The numbers and maps of the states at the steps' ends; the first state is the start."""
    ends, grid = states[1:], compliance.grid
    forces = np.array([state.force_n for state in ends])
    return ElasticMotion(
        depth_mm=np.array([state.position[2] for state in ends]),
        displacement_mm=np.stack([_displacement(compliance, state) for state in ends]),
        force_n=forces, torque_nmm=np.stack([_torque(grid, state) for state in ends]),
        slip=np.stack([_slip_map(grid, state) for state in ends]),
        contact_area_mm2=np.array([grid.areas(np.flatnonzero(state.normal > 0)).sum() for state in ends]),
        penetration_mm=np.array([state.penetration_mm for state in ends]),
        iterations=np.diff([state.turns for state in states]), increments=np.array(counts),
        **{name: np.array([getattr(state, name) for state in ends]) for name in ("dissipated_mj", "stored_mj", "work_mj")})


def _displacement(compliance, state):
    """(y, x, 3) in mm on the map's grid, with sides that are held."""
    grid, touching = compliance.grid, np.flatnonzero(state.normal > 0)
    moved = np.zeros((3, *grid.every_second.shape))
    if len(touching):
        force = np.column_stack([state.tangential, state.normal])[touching]
        found = compliance.between(grid.second_nodes, touching, dtype=np.float32) @ force
        moved[:] = (found * [1.0, 1.0, -1.0]).T.reshape(moved.shape)
    return np.moveaxis(grid.with_held_sides(moved), 0, -1)


def _torque(grid, state):
    (x, y), (fx, fy), fz = grid.points.T, state.tangential.T, -state.normal
    return np.array([(y * fz).sum(), -(x * fz).sum(), (x * fy - y * fx).sum()])


def _slip_map(grid, state):
    path = np.where(state.normal > 0, state.path, np.nan)[grid.second_nodes].reshape(grid.every_second.shape)
    return path if grid.sides else np.pad(path, 1, constant_values=np.nan)
