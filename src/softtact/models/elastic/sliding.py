"""A rigid object that presses the elastic layer and drags it with Coulomb friction, increment by increment, along a `Motion`.

The history consists of the forces at the top's nodes, their tangential displacements, and each node's position under the object. A
node that sticks keeps this position; for a sliding or a free node the position changes by the object's displacement minus the
surface's tangential displacement by friction. The tangential displacement by pressure alone does not change the positions, as in
a press straight down (`compliance`); without friction the results of both agree. The object's underside is evaluated at these
positions, exact to its triangles. Normal forces act along z, and torques refer to the undeformed surface: the model is linear.

The model moves the object along x, y and z. With friction a step is divided into increments with lateral displacements of at most
half of the nodes' spacing (so that the object skips no node, and each node sticks where it comes into contact), and with descents
of at most an eighth of it. Without friction there is no history, and each step is one increment.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from softtact.contact.coulomb import ContactCompliance, CoulombSettings, Increment, solve_increment
from softtact.contact.height_field import NO_CONTACT_MM
from softtact.contact.motion import Motion, MotionStep
from softtact.contact.unilateral import LEAST_REACH_MM, REACH, RISE, among_candidates, depth_on_springs, highest_missed
from softtact.errors import ConvergenceError, InputError
from softtact.models.elastic.tangential import SurfaceCompliance

_ASIDE, _DOWN = 0.5, 0.125      # of the nodes' spacing: the largest movements in an increment with friction
_REFUSED = "the elastic model prescribes x, y and z and loads z only; leave {} out or take another model."
_SETTINGS = CoulombSettings()
_LOW_MM = 0.02                           # what is so little above the lowest point counts as where the object first touches
_HALVINGS = 6                            # the moment of touch is found to a 64th of an increment


# Solutions of an increment, between which the places under the object are brought up to date. The first one of a movement aside has
# only nodes that touched before: the others' places follow from how far these drag the surface along.
_PASSES = 3


@dataclass(frozen=True)
class SlidingState:
    """Object and surface at an increment's end; n nodes of the grid."""

    position: np.ndarray
    """(3,) in mm: the object's displacement in x and y, and its depth from first touch."""
    place: np.ndarray
    """(n, 2) in mm: where a node lies under the object, in the frame in which the object was placed."""
    normal: np.ndarray
    """(n,) in N, downwards on the surface."""
    tangential: np.ndarray
    """(n, 2) in N, on the surface."""
    moved: np.ndarray
    """(n, 2) in mm: the surface's tangential displacement."""
    dragged: np.ndarray
    """(n, 2) in mm: the part of it that the tangential forces cause."""
    path: np.ndarray
    """(n,) in mm: how far a node has slid on the object since it came to touch; 0 where it does not touch."""
    sticks: np.ndarray
    """(n,): which nodes touch and did not slide in the last increment."""
    stored_mj: float = 0.0
    """Elastic energy of the layer."""
    work_mj: float = 0.0
    """Work of the object's force on the surface since the start."""
    dissipated_mj: float = 0.0
    """Work of friction against slip since the start."""
    penetration_mm: float = 0.0
    """Deepest overlap."""
    turns: int = 0
    """Turns of the normal and the tangential problem since the start."""

    @property
    def force_n(self) -> np.ndarray:
        """The object's force (3,) in N on the surface: x, y, z; pressing down is negative."""
        return np.append(self.tangential.sum(axis=0), -self.normal.sum())


class SlidingObject:
    """An object over a layer: `start`, and `advance` from state to state. What it keeps between calls changes no result.

    compliance: `SurfaceCompliance`;  underside(x, y): heights (n,) in mm and normals (n, 3), as of `HeightField`
    first_touch_mm: height of the object's lowest point over the surface, where depth 0 is;  friction: Coulomb's coefficient
    """

    def __init__(self, compliance: SurfaceCompliance, underside: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]],
                 *, first_touch_mm: float, friction: float, deepest_mm: float, settings: CoulombSettings = _SETTINGS) -> None:
        self.compliance, self.friction, self.settings = compliance, friction, settings
        self._underside, self._first_touch, self.deepest_mm = underside, first_touch_mm, deepest_mm
        self._operators = (b"", None)

    @property
    def start(self) -> SlidingState:
        """The object at first touch, the surface at rest."""
        points = self.compliance.grid.points
        zero, zeros = np.zeros(len(points)), np.zeros((len(points), 2))
        return SlidingState(np.zeros(3), points, zero, zeros, zeros, zeros, zero, zero > 0)

    def heights(self, place: np.ndarray) -> np.ndarray:
        """Height (n,) in mm of the object over places (n, 2), counted from first touch."""
        return self._underside(*place.T)[0] - self._first_touch

    def advance(self, state: SlidingState, way: np.ndarray, *, depth: float | None = None,
                load: float | None = None) -> SlidingState:
        """The state where the object has moved aside by `way` (2,) in mm, and is `depth` mm deep, or carries `load` N.

        Raises ConvergenceError where the contact does not settle, InputError where the object has nothing below it to carry a load.
        """
        place = np.where(state.sticks[:, None], state.place, state.place - way)
        expected = state.position[2] if depth is None else depth
        touched = state.normal > 0
        allowed = touched if self.friction > 0 and way.any() and touched.any() else np.ones_like(touched)
        for _ in range(1 if self.friction == 0 else _PASSES):
            found = self._solve(state, place, allowed, way, depth, load, expected=expected)
            place, expected, allowed = self._places(state, found, place, way), found.depth, np.ones_like(touched)
        return self._finish(state, found, place, way)

    def _solve(self, state, place, allowed, way, depth, load, *, expected):
        """The contact for given places, with as many candidate nodes as its depth asks for; expected: its depth in mm."""
        heights = self.heights(place)
        if (heights[allowed] < self.deepest_mm).any():
            heights = np.where(allowed, heights, NO_CONTACT_MM)
        reach = REACH * max(self._expected_depth(heights, load) if depth is None else depth, state.position[2]) + LEAST_REACH_MM

        def solve(reach):
            nodes = np.flatnonzero(heights < reach)
            if not len(nodes):
                return self._free(state, depth)
            among, spread = self._operators_of(nodes)
            carried = state.moved[nodes] + self._share_in_contact(state, among, nodes, heights, place, expected)[:, None] * way
            contact = solve_increment(among, Increment(heights[nodes], carried, self.friction, depth, load),
                                      normal=state.normal[nodes], tangential=state.tangential[nodes], settings=self.settings)
            return _Found(nodes, contact, heights[nodes], *spread(contact), contact.depth)

        def needed(found, reach):
            return reach if found.contact is None else max(RISE * found.depth, self._highest_missed(found, heights, reach))

        return among_candidates(solve, needed, reach_mm=reach, most_mm=self.deepest_mm)

    def _highest_missed(self, found, heights, reach):
        """Height in mm of the highest node beyond a reach where the surface bulges into the object; the reach if there is none."""
        nodes, touching, acting = np.flatnonzero((heights >= reach) & (heights < self.deepest_mm)), found.touching, found.acting
        if not len(nodes) or not len(touching):
            return reach
        force = np.column_stack([found.contact.tangential, found.contact.normal])[acting]
        down = self.compliance.between(nodes, touching, row_axes=(2,), dtype=np.float32) @ force
        return highest_missed(heights[nodes], -np.inf, down.T, np.array([found.depth]))

    def _share_in_contact(self, state, among, nodes, heights, place, depth):
        """The share (c,) of an increment in which a node touches: 1 for those that did, for others from where their gap closes."""
        share = np.ones(len(nodes))
        if self.friction == 0:
            return share
        down = (among.normal @ state.normal[nodes, None] + among.coupling @ state.tangential[nodes])[:, 0]
        coming = np.flatnonzero((state.normal[nodes] == 0) & (heights[nodes] - depth + down < 0))
        begin, end, down = state.place[nodes[coming]], place[nodes[coming]], down[coming]
        low, high = np.zeros(len(coming)), np.ones(len(coming))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            lowered = state.position[2] + middle * (depth - state.position[2])
            closed = self.heights(begin + middle[:, None] * (end - begin)) - lowered + down < 0
            low, high = np.where(closed, low, middle), np.where(closed, middle, high)
        share[coming] = 1 - 0.5 * (low + high)
        return share

    def _expected_depth(self, heights, load):
        """Depth in mm of a load on springs side by side."""
        there = heights[heights < self.deepest_mm]
        if not len(there):
            raise InputError("The object has slid off the sensor's free surface and carries no load any more; move it less far.")
        lowest, area = there.min(), np.full(len(there), np.prod(self.compliance.grid.step))
        if load <= 0:
            return lowest
        return lowest + float(depth_on_springs(there - lowest, area, load / self.compliance.foundation_modulus))

    def fractions(self, state: SlidingState, load: float, count: int) -> np.ndarray:
        """Loads (count,) in N from the state's to `load` that lower the object about evenly, after its shape on springs."""
        heights, begin = self.heights(state.place), state.normal.sum()
        depths = np.array([self._expected_depth(heights, max(force, 0.0)) for force in (begin, load)])
        on_springs = [np.clip(depth - heights, 0.0, None).sum() for depth in np.linspace(depths[0], depths[1], count + 1)]
        grown = np.array(on_springs[1:]) - on_springs[0]
        return begin + (load - begin) * (grown / grown[-1] if grown[-1] else np.linspace(0, 1, count + 1)[1:])

    def depth_of(self, state: SlidingState, load: float) -> float:
        """Depth in mm that a load is expected to have where the object is now: an estimate, to divide steps by."""
        return self._expected_depth(self.heights(state.place), load)

    def _operators_of(self, nodes):
        """The compliance among nodes, and what spreads a contact's forces to all nodes' tangential displacements."""
        key, found = self._operators
        if key != nodes.tobytes():
            between, everywhere = self.compliance.between, np.arange(self.compliance.grid.count)
            among = ContactCompliance(between(nodes, nodes, row_axes=(2,), column_axes=(2,)),
                                      between(nodes, nodes, row_axes=(2,), column_axes=(0, 1)),
                                      between(nodes, nodes, row_axes=(0, 1), column_axes=(0, 1)))
            by_normal, by_tangential = (between(everywhere, nodes, row_axes=(0, 1), column_axes=axes, dtype=np.float32)
                                        for axes in ((2,), (0, 1)))

            def spread(contact):
                return by_normal @ contact.normal[:, None], by_tangential @ contact.tangential

            found = among, spread
            self._operators = nodes.tobytes(), found
        return found

    def _free(self, state, depth):
        zeros = np.zeros_like(state.moved)
        return _Found(np.zeros(0, dtype=int), None, np.zeros(0), zeros, zeros, depth)

    def _places(self, state, found, used, way):
        """Places (n, 2) of all nodes under the object after an increment that was solved with places `used`.

        A node that came to touch keeps what was used where its traction would carry it back out from under an edge.
        """
        position, points = state.position[:2] + way, self.compliance.grid.points
        if self.friction == 0:
            return points - position
        place = points - position + found.dragged
        touching, contact = found.touching, found.contact
        if len(touching):
            stayed, sliding = state.normal[touching] > 0, ~contact.sticks[found.acting]
            along = found.dragged[touching] - state.dragged[touching] - way
            out = ~stayed & (self.heights(place[touching]) >= self.deepest_mm)
            place[touching[stayed]] = (state.place[touching] + np.where(sliding[:, None], along, 0.0))[stayed]
            place[touching[out]] = used[touching[out]]
        return place

    def _finish(self, state, found, place, way):
        """The next state, with its energies by the trapezoidal rule."""
        normal, tangential, moved = np.zeros_like(state.normal), np.zeros_like(state.moved), found.by_normal + found.dragged
        slip = np.where((state.normal > 0)[:, None], moved - state.moved - way, 0.0)      # of those that lose contact, too
        sticks, stored, overlap, turns = np.zeros(len(normal), dtype=bool), 0.0, 0.0, 0
        if found.contact is not None:
            contact, nodes = found.contact, found.nodes
            normal[nodes], tangential[nodes], sticks[nodes] = contact.normal, contact.tangential, contact.sticks
            acting = contact.normal > 0
            slip[nodes[acting]] = contact.slip[acting]
            turns, down = contact.turns, contact.gap - found.height + contact.depth
            stored = 0.5 * float(contact.normal @ down + (contact.tangential * moved[nodes]).sum())
            overlap = max(0.0, -float(contact.gap.min()))
        after = replace(state, position=np.append(state.position[:2] + way, found.depth), place=place, normal=normal,
                        tangential=tangential, moved=moved, dragged=found.dragged,
                        path=np.where(normal > 0, state.path * (state.normal > 0) + np.linalg.norm(slip, axis=1), 0.0),
                        sticks=sticks, stored_mj=stored, penetration_mm=overlap, turns=state.turns + turns)
        mean_force = 0.5 * (state.force_n + after.force_n)
        travelled = np.append(way, state.position[2] - found.depth)
        rubbed = -0.5 * float(((state.tangential + tangential) * slip).sum())
        return replace(after, work_mj=state.work_mj + float(mean_force @ travelled), dissipated_mj=state.dissipated_mj + rubbed)


@dataclass(frozen=True)
class _Found:
    """A solved contact at candidate nodes (c,), their heights (c,), and all nodes' tangential displacements (n, 2) by its parts."""

    nodes: np.ndarray
    contact: object
    height: np.ndarray
    by_normal: np.ndarray
    dragged: np.ndarray
    depth: float | None = None

    @property
    def acting(self):
        return self.contact.normal > 0 if self.contact is not None else np.zeros(0, dtype=bool)

    @property
    def touching(self):
        return self.nodes[self.acting]


@dataclass(frozen=True)
class ElasticMotion:
    """The ends of a motion's steps on the elastic layer. Frame: the sensor's, z out of the surface."""

    depth_mm: np.ndarray
    """(step,): how far the object is below its first touch."""
    displacement_mm: np.ndarray
    """(step, y, x, 3): of the surface's points on the map's grid; a deformation map is minus the last component."""
    sunk_mm: np.ndarray
    """(step, 2 y - 1, 2 x - 1): how far the surface's nodes, at half the map's steps, are down."""
    force_n: np.ndarray
    """(step, 3): the object's force on the sensor's surface; pressing down is negative in z."""
    torque_nmm: np.ndarray
    """(step, 3): its moment about the sensor frame's origin, of forces at the undeformed surface's points."""
    slip: np.ndarray
    """(step, y, x) in mm: the length of the path on which a point has slid on the object since it last came to touch; nan where it
    does not touch. Slip is the surface's tangential displacement less the object's; 0 where a point has stuck throughout."""
    traction_mpa: np.ndarray
    """(step, y, x, 3): the object's force on the surface per area at rest, the mean around a point of the map's grid."""
    slides: np.ndarray
    """(step, y, x) bool: which points touch and have slid in this step."""
    gap_mm: np.ndarray
    """(step, y, x): along z from the surface to the object; inf where no object is above."""
    contact_area_mm2: np.ndarray
    """(step,): area of the nodes under pressure."""
    points: np.ndarray
    """(step,): how many nodes are under pressure."""
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
                  settings: CoulombSettings = _SETTINGS) -> ElasticMotion:
    """The `ElasticMotion` of an object with an `underside(x, y)` (heights (n,) in mm and normals) over a layer.

    first_touch_mm: height of its lowest point over the surface;  friction: Coulomb's coefficient
    deepest_mm: the layer's thickness
    Raises InputError for freedoms that the model does not know, and ConvergenceError with `result`, the `ElasticMotion` of the
    steps before (or None), where a step is not reached.
    """
    mover = SlidingObject(compliance, underside, first_touch_mm=first_touch_mm, friction=friction, deepest_mm=deepest_mm,
                          settings=settings)
    steps: list[tuple[SlidingState, int]] = []
    try:
        steps.extend(steps_on_layer(mover, motion))
    except ConvergenceError as error:
        error.result = motion_of(mover, steps) if steps else None
        raise
    return motion_of(mover, steps)


def steps_on_layer(mover: SlidingObject, motion: Motion) -> Iterator[tuple[SlidingState, int]]:
    """The state at each step's end and the number of its increments. Raises as `move_on_layer`, without a `result`."""
    check_motion(motion)
    state, load = mover.start, None
    for number, step in enumerate(motion.steps, start=1):
        load = load_after(step, load)
        if load is None:     # before what takes long to solve
            _refuse_deep(mover, state.position[2] - step.ways.get("z", 0.0), number)
        state, count = _follow_step(mover, state, step, load)
        if load is not None and state.position[2] > mover.deepest_mm:
            _refuse_leaving(mover, state.position[:2], number)
        _refuse_deep(mover, state.position[2], number)
        yield state, count


def _refuse_deep(mover, depth, number):
    """Refuse a step at whose end the object is deeper than the layer is thick."""
    if depth > mover.deepest_mm:
        raise ConvergenceError(f"Step {number} was not reached: the object would be {depth:.3g} mm deep in a layer "
                               f"{mover.deepest_mm:g} mm thick; press less deep or with less force.")


def _refuse_leaving(mover, aside, number):
    """Refuse a step that takes the middle of what first touches off the surface: what is left over it does not carry the load."""
    grid = mover.compliance.grid
    heights, half = mover.heights(grid.points), np.array([grid.x[-1], grid.y[-1]]) + (0.0 if grid.sides else grid.step)
    x, y = grid.points[heights <= heights.min() + _LOW_MM].mean(axis=0) + aside
    if abs(x) > half[0] or abs(y) > half[1]:
        raise ConvergenceError(f"Step {number} was not reached: it takes the object off the sensor; what touches first would be at "
                               f"x {x:.4g}, y {y:.4g} mm, and the sensor ends at {half[0]:g} and {half[1]:g} mm; move it less far.")


def motion_of(mover: SlidingObject, steps: Sequence[tuple[SlidingState, int]]) -> ElasticMotion:
    """The `ElasticMotion` of steps of `steps_on_layer` from the first on."""
    return _result(mover, [mover.start, *(state for state, _ in steps)], [count for _, count in steps])


def check_motion(motion: Motion, *, prescribed: Sequence[str] = ("x", "y", "z"), refused: str = _REFUSED) -> None:
    """Raise InputError for what an elastic model does not know.

    prescribed: freedoms that it prescribes;  refused: the sentence, with {} for what it does not bear
    """
    if not motion.steps:
        raise InputError("The motion has no steps; add one, for example with Motion().press(force_n=5).")
    for number, step in enumerate(motion.steps, start=1):
        turned = [name for name in step.ways if name not in prescribed]
        loaded = [name for name in step.loads if name != "z"]
        if turned or loaded:
            what = f"the rotation {turned[0]}" if turned else f"the load on {loaded[0]}"
            raise InputError(f"Step {number} of the motion: {refused.format(what)}")
        if step.loads.get("z", -1.0) >= 0:
            raise InputError(f"Step {number} of the motion: a load of {step.loads['z']:g} N along z does not press; give one "
                             "below 0, or prescribe z.")


def load_after(step: MotionStep, load: float | None) -> float | None:
    """The normal load (N, positive) at a step's end, or None where the depth is prescribed."""
    if "z" in step.loads:
        return -step.loads["z"]
    return None if "z" in step.ways else load


def _follow_step(mover: SlidingObject, state: SlidingState, step: MotionStep, load: float | None) -> tuple[SlidingState, int]:
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


def _result(mover, states, counts):
    """The numbers and maps of the states at the steps' ends; the first state is the start."""
    compliance, ends = mover.compliance, states[1:]
    grid, forces = compliance.grid, np.array([state.force_n for state in ends])
    sunk = np.stack([_sunk(compliance, state) for state in ends])
    return ElasticMotion(
        depth_mm=np.array([state.position[2] for state in ends]),
        displacement_mm=np.stack([_displacement(compliance, state) for state in ends]),
        sunk_mm=sunk, traction_mpa=np.stack([_traction(grid, state) for state in ends]),
        slides=np.stack([_on_map(grid, slid_since(before, state), False) for before, state in zip(states, ends, strict=False)]),
        gap_mm=np.stack([_gap(mover, state, down[::2, ::2]) for state, down in zip(ends, sunk, strict=True)]),
        force_n=forces, torque_nmm=np.stack([_torque(grid, state) for state in ends]),
        slip=np.stack([_slip_map(grid, state) for state in ends]),
        contact_area_mm2=np.array([grid.areas(np.flatnonzero(state.normal > 0)).sum() for state in ends]),
        points=np.array([(state.normal > 0).sum() for state in ends]),
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


def _sunk(compliance, state):
    """(2 y - 1, 2 x - 1) in mm: how far all nodes are down, with sides that are held."""
    grid, touching = compliance.grid, np.flatnonzero(state.normal > 0)
    down = np.zeros(grid.count)
    if len(touching):
        force = np.column_stack([state.tangential, state.normal])[touching]
        down = (compliance.between(np.arange(grid.count), touching, row_axes=(2,), dtype=np.float32) @ force)[:, 0]
    return grid.with_held_sides(down.reshape(grid.shape))


def _torque(grid, state):
    (x, y), (fx, fy), fz = grid.points.T, state.tangential.T, -state.normal
    return np.array([(y * fz).sum(), -(x * fz).sum(), (x * fy - y * fx).sum()])


def slid_since(before: SlidingState, state: SlidingState) -> np.ndarray:
    """Which points (n,) touch and have slid since an earlier state."""
    return (state.normal > 0) & (state.path > 0) & (state.path != before.path)


def _traction(grid, state):
    """(y, x, 3) in MPa on the map's grid: nodes between its points share their forces among these."""
    force = np.column_stack([state.tangential, -state.normal]).T.reshape(3, *grid.shape)
    for axis in (1, 2):
        line = np.moveaxis(grid.with_held_sides(force) if axis == 1 else force, axis, 0)
        shared = line[::2].copy()
        shared[:-1] += 0.5 * line[1::2]
        shared[1:] += 0.5 * line[1::2]
        force = np.moveaxis(shared, 0, axis)
    inside = [np.where(np.arange(count) % (count - 1), 1.0, 0.5) for count in force.shape[1:]]
    return np.moveaxis(force / (4 * np.prod(grid.step) * np.outer(*inside)), 0, -1)


def _gap(mover, state, down):
    """(y, x) in mm between surface and object on the map's grid, the surface being `down` (y, x) in mm."""
    grid = mover.compliance.grid
    x, y = (np.concatenate([line[:1] - step, line, line[-1:] + step])[::2] if not grid.sides else line[::2]
            for line, step in zip((grid.x, grid.y), grid.step, strict=True))
    place = np.stack(np.meshgrid(x, y), axis=-1) - state.position[:2]
    inner = slice(None) if grid.sides else slice(1, -1)
    place[inner, inner] = state.place[grid.second_nodes].reshape(*grid.every_second.shape, 2)
    heights = mover.heights(place.reshape(-1, 2)).reshape(down.shape)
    return np.where(heights < 0.5 * NO_CONTACT_MM, heights - state.position[2] + down, np.inf)


def _slip_map(grid, state):
    return _on_map(grid, np.where(state.normal > 0, state.path, np.nan), np.nan)


def _on_map(grid, values, beside):
    """Values (n,) of nodes on the map's grid (y, x), and `beside` on sides that are held."""
    inner = values[grid.second_nodes].reshape(grid.every_second.shape)
    return inner if grid.sides else np.pad(inner, 1, constant_values=beside)
