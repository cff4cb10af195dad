"""A rigid object that presses a wide layer and drags it with Coulomb friction, increment by increment.

`wide_motion` follows a `Motion` with it.

The history is that of `sliding`: forces, and for each touching point its place under the object, which a stuck point keeps and a
sliding one changes by its slip. Places are in the object's frame, so the object may turn about the vertical. The object's underside
is evaluated at these places, exact to its triangles. Displacement by pressure alone moves no place: with it (`pressure_moves`, for
comparisons) forces are farther from those of finite strains (docs/explanation/gels.md). A point that loses contact keeps its place
until it is free of the object at its place by friction's displacement, too. Pressure acts along z, and the surface's rotation is
neglected: the model is linear in all but the contact.

Increments are solved on a window of the grid around the contact (`grid_contact`). Fields outside of it follow where they are asked
for, since forces are zero there. With friction an increment moves the object aside, at the rim of what it presses, by at most
`_ASIDE` of the points' distance, and down by `_DOWN` of it, so that about one ring of points comes to touch.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from softtact.contact.coulomb import CoulombSettings, Increment
from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.motion import MotionStep
from softtact.contact.unilateral import depth_on_springs
from softtact.errors import InputError, MissError
from softtact.models.elastic.grid_contact import GridContact, GridSolver
from softtact.models.elastic.wide_layer import WideLayer

Surface = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

# Of the points' distance: the largest movements in an increment with friction; down, while nothing touches. The fastest increment
# over the last one that takes over its trend, in which a turn counts as the way of a point at this distance.
_ASIDE, _DOWN, _DOWN_AT_FIRST, _FASTEST, _ARM_MM = 0.8, 0.8, 0.2, 5.0, 1.0
_MARGIN, _BLOCK = 3, 8          # points around the contact in a window, and the multiple to which its sides are rounded up
_BULGE, _LEAST_MM = 1.1, 0.03   # the surface may touch where the object is below these times the depth, and so much more
# Passes of an increment with friction and without, between which places and heights follow the surface; halvings of the time of
# touch. The first pass' tolerance over the last one's; the change of heights over the tolerance after which no pass follows.
_PASSES, _PASSES_WITHOUT, _HALVINGS = 4, 12, 6
_ROUGH, _SETTLED = 10.0, 10.0
_MOST_INCREMENTS = 2000         # of one step
_SETTINGS = CoulombSettings(tolerance_mm=2e-4, inner_share=0.5, inner_fall=0.3)
_SINGLE_MM = 2e-5               # tolerance from which products in single precision are exact enough


@dataclass(frozen=True)
class WideStep:
    """The state at a step's end, on the map's grid (ny, nx). Frame: the sensor's, z out of the surface."""

    position: np.ndarray
    """(3,) in mm: the object's displacement along x and y, and its depth from first touch."""
    turned_deg: float
    """Its rotation about the vertical."""
    displacement_mm: np.ndarray
    """(ny, nx, 3): of the surface."""
    force_n: np.ndarray
    """(ny, nx, 3): of the object on the surface around each point."""
    path_mm: np.ndarray
    """(ny, nx): how far a point has slid on the object since it came to touch; nan where it does not touch."""
    slides: np.ndarray
    """(ny, nx): which points touch and have slid in this step."""
    gap_mm: np.ndarray
    """(ny, nx): along z from the surface to the object; inf where no object is above."""
    stored_mj: float
    """Elastic energy of the layer."""
    work_mj: float
    """Work of the object's forces on the surface since the start."""
    dissipated_mj: float
    """Work of friction since the start."""
    turns: int
    """Turns of the normal and the tangential problem in this step."""
    increments: int
    """Into how many increments the step was divided."""
    at_rim: bool
    """Whether the object touches the outermost points of the map, beyond which the model has no contact."""

    @property
    def normal(self) -> np.ndarray:
        """(ny, nx) in N, downwards."""
        return -self.force_n[..., 2]

    @property
    def penetration_mm(self) -> float:
        """Deepest overlap."""
        return max(0.0, -float(self.gap_mm.min(initial=0.0)))


@dataclass(frozen=True)
class _Window:
    """Rows and columns of the grid."""

    rows: slice
    columns: slice

    @property
    def at(self):
        return ..., self.rows, self.columns

    @property
    def shape(self):
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    def holds(self, other: "_Window") -> bool:
        return all(mine.start <= its.start and its.stop <= mine.stop
                   for mine, its in ((self.rows, other.rows), (self.columns, other.columns)))


@dataclass
class _State:
    """What an increment starts from; fields on the whole grid, but those of displacement on the window alone."""

    position: np.ndarray
    angle: float
    place: np.ndarray
    normal: np.ndarray
    tangential: np.ndarray
    path: np.ndarray
    sticks: np.ndarray
    tracked: np.ndarray
    window: _Window | None = None
    moved: np.ndarray = field(default_factory=lambda: np.zeros(0))
    aside: np.ndarray = field(default_factory=lambda: np.zeros(0))
    down: np.ndarray = field(default_factory=lambda: np.zeros(0))
    trend: np.ndarray | None = None
    heights: np.ndarray | None = None
    stored_mj: float = 0.0
    work_mj: float = 0.0
    dissipated_mj: float = 0.0
    turns: int = 0


class WideObject:
    """An object over a wide layer. It starts at first touch; `follow` moves it by one step of a motion and returns the `WideStep`.

    underside(x, y): heights (n,) in mm and normals (n, 3), as of `HeightField`, in the frame in which the object was placed
    x_mm (nx,), y_mm (ny,): lines of the grid, evenly spaced;  first_touch_mm: height of its lowest point over the surface
    about_mm (2,): point about which it turns;  friction: Coulomb's coefficient
    """

    def __init__(self, layer: WideLayer, underside: Surface, grid: tuple[np.ndarray, np.ndarray], *, first_touch_mm: float,
                 friction: float, about_mm: tuple[float, float] = (0.0, 0.0), pressure_moves: bool = False,
                 settings: CoulombSettings = _SETTINGS) -> None:
        self.layer, self.friction, self.settings, self.pressure_moves = layer, friction, settings, pressure_moves
        self._underside, self._first_touch, self._about = underside, first_touch_mm, np.array(about_mm)
        self.points = np.stack(np.meshgrid(*grid))
        self._shape = self.points.shape[1:]
        self._solvers: dict[tuple[int, ...], GridSolver] = {}
        self._pace: np.ndarray | None = None     # of the last increments
        self._before: tuple[np.ndarray, np.ndarray] | None = None     # forces before the last increment, if the next goes on as it
        self._ratio = 0.0                        # of the next increment to the last one
        zeros = np.zeros(self._shape)
        self._state = _State(np.zeros(3), 0.0, self.points.copy(), zeros, np.zeros_like(self.points), zeros.copy(), zeros > 0,
                             zeros > 0)

    # --- the object ---

    def aside_of(self, found: GridContact) -> np.ndarray:
        """Displacement aside (2, ...) in mm that moves the surface's points under the object."""
        return found.dragged + found.by_normal if self.pressure_moves else found.dragged

    def heights(self, place: np.ndarray) -> np.ndarray:
        """Heights (...) in mm, from first touch, of the object over places (2, ...) in its own frame."""
        found = self._underside(place[0].ravel(), place[1].ravel())[0] - self._first_touch
        return found.reshape(place.shape[1:])

    def _to_object(self, points, position, angle):
        """Places (2, ...) in the object's frame of points (2, ...) of the sensor's."""
        moved = points - _column(position[:2], points)
        return moved if not angle else _column(self._about, points) + _turn(moved - _column(self._about, points), -angle)

    def _from_object(self, place, position, angle):
        if angle:
            place = _column(self._about, place) + _turn(place - _column(self._about, place), angle)
        return place + _column(position[:2], place)

    # --- steps ---

    def follow(self, step: MotionStep, load: float | None = None) -> WideStep:
        """The state at the end of a step, under a normal load (N) where one is given; else at the depth that the step prescribes.

        Raises ConvergenceError where the contact does not settle, InputError where the object leaves the gel or needs too many
        increments.
        """
        way, angle = np.array([step.ways.get("x", 0.0), step.ways.get("y", 0.0)]), np.radians(step.ways.get("rz", 0.0))
        depth = None if load is not None else self._state.position[2] - step.ways.get("z", 0.0)
        count = self._increments(way, angle, depth, load)
        path, touched, turns = self._state.path.copy(), self._state.normal > 0, self._state.turns
        begin, loads = self._state.position[2], self._loads(load, count)
        self._set_pace(None if depth is None else np.array([*way, angle * _ARM_MM, depth - begin]) / count)
        for part in range(1, count + 1):
            self._advance(way / count, angle / count, None if depth is None else begin + (depth - begin) * part / count,
                          None if load is None else loads[part - 1])
        return self._step(path, touched, self._state.turns - turns, count)

    def _set_pace(self, pace):
        """Whether, and how much faster, increments of a pace (4,) go on along the last ones; under a load no pace is known."""
        last, self._pace = self._pace, pace
        self._ratio = 0.0
        if pace is not None and last is not None and last.any():
            ratio = (pace @ last) / (last @ last)
            self._ratio = ratio if 0 < ratio <= _FASTEST and np.abs(pace - ratio * last).max() < 1e-9 else 0.0
        if not self._ratio:
            self._before = None

    def _increments(self, way, angle, depth, load):
        if self.friction == 0:
            return 1
        spacing, state = min(self.layer.step_mm), self._state
        down_share = _DOWN if state.normal.any() else _DOWN_AT_FIRST
        down = (self._depth_on_springs(load) - self._depth_on_springs(state.normal.sum()) if depth is None
                else depth - state.position[2])
        turned = abs(angle) * self._reach_about(max(state.position[2], depth or 0.0)) if angle else 0.0
        aside = np.linalg.norm(way) + turned
        count = max(1, *(int(np.ceil(distance / (share * spacing) - 1e-9))
                         for distance, share in ((aside, _ASIDE), (abs(down), down_share))))
        if count > _MOST_INCREMENTS:
            raise InputError(f"A step of {aside:.3g} mm aside and {abs(down):.3g} mm down needs {count} increments to follow the "
                             f"path of friction, more than {_MOST_INCREMENTS}; divide it into steps, or take a coarser map.")
        return count

    def _reach_about(self, depth):
        """Largest distance (mm) of what may touch from the axis about which the object turns."""
        low = self._low_points(self._below(depth))
        return np.linalg.norm(low - self._about, axis=1).max(initial=0.0)

    def _loads(self, load, count):
        """Loads (count,) in N to the given one that lower the object about evenly, after its shape on springs."""
        if load is None:
            return []
        begin = self._state.normal.sum()
        if count == 1:
            return [load]
        depths = np.linspace(self._depth_on_springs(begin), self._depth_on_springs(load), count + 1)
        heights = self._heights_now()
        carried = np.array([np.clip(depth - heights, 0.0, None).sum() for depth in depths])
        grown = carried[1:] - carried[0]
        return list(begin + (load - begin) * (grown / grown[-1] if grown[-1] else np.linspace(0, 1, count + 1)[1:]))

    def _heights_now(self):
        return self.heights(self._to_object(self.points, self._state.position, self._state.angle))

    def _depth_on_springs(self, load):
        """Depth in mm of a load on springs side by side."""
        heights = self._heights_now()
        there = heights[heights < 0.5 * NO_CONTACT_MM]
        if not len(there):
            raise InputError("The object has slid off the gel and carries no load any more; move it less far.")
        lowest = there.min()
        if load <= 0:
            return float(lowest)
        area = np.full(len(there), np.prod(self.layer.step_mm))
        return float(lowest + depth_on_springs(there - lowest, area, load / self.layer.foundation_modulus))

    # --- windows ---

    def _below(self, depth):
        return _BULGE * max(depth, 0.0) + _LEAST_MM

    def _low_points(self, reach):
        """Points (n, 2) in the object's frame around all that is below a height over first touch."""
        if isinstance(self._underside, HeightField):
            return self._underside.points_below(reach + self._first_touch)
        return self.points[:, self.heights(self.points) < reach].T

    def _window(self, position, angle, reach):
        """The window of what touches now and of what is below a height, where the object is then; the last one where it does."""
        low = self._low_points(reach)
        state, touched = self._state, np.argwhere(self._state.normal > 0)
        (x, y), (dx, dy) = self._from_object(low.T, position, angle), self.layer.step_mm
        index = np.column_stack([(y - self.points[1, 0, 0]) / dy, (x - self.points[0, 0, 0]) / dx])
        index = np.concatenate([index, touched]) if len(touched) else index
        if not len(index):
            raise MissError("The object is nowhere near the gel; move it over the gel.")
        sides = []
        for axis, count in enumerate(self._shape):
            least = int(np.clip(np.floor(index[:, axis].min()) - _MARGIN, 0, count - 1))
            most = int(np.clip(np.ceil(index[:, axis].max()) + _MARGIN + 1, least + 1, count))
            size = min(count, -(-(most - least) // _BLOCK) * _BLOCK)
            start = int(np.clip(least - (size - (most - least)) // 2, 0, count - size))
            sides.append(slice(start, start + size))
        wanted = _Window(*sides)
        old = state.window
        return old if old is not None and old.holds(wanted) and np.prod(old.shape) <= 2 * np.prod(wanted.shape) else wanted

    def _solver(self, window):
        if window.shape not in self._solvers:
            operator = self.layer.operator(window.shape, single=self.settings.tolerance_mm >= _SINGLE_MM)
            self._solvers[window.shape] = GridSolver(operator, self.settings)
        return self._solvers[window.shape]

    def _enter(self, window):
        """Take a window: the displacements in it follow from the forces."""
        state = self._state
        if state.window == window:
            return
        operator = self._solver(window).operator
        normal, tangential = state.normal[window.at], state.tangential[window.at]
        if normal.any():
            dragged = operator.aside_of_aside(tangential)
            state.moved = dragged + operator.aside_of_down(normal)
            state.aside = state.moved if self.pressure_moves else dragged
            state.down = operator.down_of_down(normal) + operator.down_of_aside(tangential)
        else:
            state.aside = state.moved = np.zeros((2, *window.shape))
            state.down = np.zeros(window.shape)
        state.window, state.trend, state.heights = window, None, None
        if self._before is not None:
            before, now = (np.stack([*tangential[window.at], normal[window.at]])
                           for normal, tangential in (self._before, (state.normal, state.tangential)))
            state.trend = operator(now - before)

    # --- one increment ---

    def _advance(self, way, angle, depth, load):
        """Move the object by `way` (2,) in mm and an angle, to a depth in mm or under a load in N."""
        state = self._state
        position = np.append(state.position[:2] + way, state.position[2] if depth is None else depth)
        expected = max(position[2] if depth is not None else self._depth_on_springs(load), state.position[2])
        while True:
            window = self._window(position, state.angle + angle, self._below(expected))
            self._enter(window)
            move = _Move(self, window, position, angle, depth, load)
            found = move.solve()
            if load is None or found.depth <= max(expected, 0.0) + _LEAST_MM or window.shape == self._shape:
                break
            expected = 1.1 * found.depth
        move.finish(found)

    def _step(self, path, touched, turns, increments):
        """The `WideStep` of the state now; path, touched (ny, nx): at the step's start."""
        state, touches = self._state, self._state.normal > 0
        force = np.stack([*state.tangential, state.normal])
        moved = np.zeros_like(force)
        if touches.any():
            moved = self.layer.operator(self._shape, single=True)(force).astype(float)
        place = self._to_object(self.points + self._dragged_everywhere(moved, state), state.position, state.angle)
        place[:, state.tracked] = state.place[:, state.tracked]
        heights = self.heights(place)
        if state.heights is not None and state.window is not None:     # those of which the contact is the solution
            heights[state.window.at] = state.heights
        rim = np.concatenate([touches[0], touches[-1], touches[:, 0], touches[:, -1]])
        sign = np.array([1.0, 1.0, -1.0])
        return WideStep(position=state.position.copy(), turned_deg=float(np.degrees(state.angle)),
                        displacement_mm=np.moveaxis(moved, 0, -1) * sign, force_n=np.moveaxis(force, 0, -1) * sign,
                        path_mm=np.where(touches, state.path, np.nan),
                        slides=touches & (state.path > 0) & ((state.path != path) | ~touched),
                        gap_mm=np.where(heights < 0.5 * NO_CONTACT_MM, heights - state.position[2] + moved[2], np.inf),
                        stored_mj=state.stored_mj, work_mj=state.work_mj, dissipated_mj=state.dissipated_mj, turns=turns,
                        increments=increments, at_rim=bool(rim.any()))

    def _dragged_everywhere(self, moved, state):
        """Displacement aside (2, ny, nx) by tangential forces: known on the window, and about that by all forces elsewhere."""
        everywhere = moved[:2].copy()
        if state.window is not None:
            everywhere[state.window.at] = state.aside
        return everywhere


class _Move:
    """One increment of a `WideObject` on a window."""

    def __init__(self, mover, window, position, angle, depth, load):
        self.mover, self.window, self.position, self.depth, self.load = mover, window, position, depth, load
        state = mover._state
        self.angle, at = state.angle + angle, window.at
        self.points, self.normal, self.tangential = mover.points[at], state.normal[at], state.tangential[at]
        self.touched, self.sticks, self.tracked = self.normal > 0, state.sticks[at], state.tracked[at]
        here = self.points + state.aside
        self.begin = np.where(self.tracked, state.place[at], mover._to_object(here, state.position, state.angle))
        here = np.where(self.tracked, mover._from_object(self.begin, state.position, state.angle), here)
        self.way = mover._from_object(self.begin, position, self.angle) - here
        self.place = np.where(self.sticks, self.begin, mover._to_object(here, position, self.angle))
        self.trend = np.zeros((3, *self.points.shape[1:])) if state.trend is None else mover._ratio * state.trend
        self.still = not (self.way.any() and mover.friction > 0 and self.touched.any())

    def solve(self) -> GridContact:
        """The contact; its depth is the object's."""
        mover, state = self.mover, self.mover._state
        allowed = np.ones_like(self.touched) if self.still else self.touched
        expected, guess = state.position[2] if self.depth is None else self.depth, (self.normal, self.tangential)
        solver, heights, rough = mover._solver(self.window), mover.heights(self.place), _ROUGH
        for number in range(_PASSES if mover.friction else _PASSES_WITHOUT):
            self.gap = np.where(allowed, heights, NO_CONTACT_MM) if (heights[allowed] < 0.5 * NO_CONTACT_MM).any() else heights
            share = self._share(expected)
            carried = state.moved + share * self.way + (1 - share) * self.trend[:2]
            increment = Increment(self.gap, carried, mover.friction, self.depth, self.load)
            found = solver.solve(increment, *self._guess(guess), rough=rough)
            self.place, expected = self._places(found), found.depth
            heights, guess, allowed = mover.heights(self.place), (found.normal, found.tangential), np.ones_like(self.touched)
            change = np.abs(heights - self.gap)[found.normal > 0].max(initial=0.0)
            if rough == 1.0 and change <= _SETTLED * mover.settings.tolerance_mm:
                break
            rough = 1.0 if number or change <= _SETTLED * rough * mover.settings.tolerance_mm else 0.3 * rough
        return found

    def _guess(self, guess):
        """Forces to begin with: of the last pass, or of an increment before, extrapolated where that was of the same step."""
        normal, tangential = guess
        if guess[0] is self.normal and self.mover._before is not None:
            ratio = self.mover._ratio
            normal, tangential = ((1 + ratio) * now - ratio * before[self.window.at] for now, before in
                                  zip(guess, self.mover._before, strict=True))
            normal = np.where(self.normal > 0, np.maximum(normal, 0.0), 0.0)
        if normal.any() or self.load is None:
            return normal, tangential
        lowest, area = self.gap.min(), np.full(self.gap.size, np.prod(self.mover.layer.step_mm))
        spring = area * self.mover.layer.foundation_modulus
        depth = lowest + depth_on_springs(self.gap.ravel() - lowest, spring, self.load)
        return np.clip(depth - self.gap, 0.0, None) * spring[0], tangential

    def _share(self, depth):
        """The share (ny, nx) of an increment in which a point touches: 1 if it did before, else from where its gap closes.

        Until then it goes on as in the increment before (`trend`).
        """
        mover, state, share = self.mover, self.mover._state, np.ones(self.window.shape)
        if mover.friction == 0:
            return share
        coming = ~self.touched & (self.gap - depth + state.down < 0)
        begin, end, down, trend = self.begin[:, coming], self.place[:, coming], state.down[coming], self.trend[2][coming]
        low, high = np.zeros(begin.shape[1]), np.ones(begin.shape[1])
        for _ in range(_HALVINGS if begin.shape[1] else 0):
            middle = 0.5 * (low + high)
            lowered = state.position[2] + middle * (depth - state.position[2])
            closed = mover.heights(begin + middle * (end - begin)) - lowered + down + middle * trend < 0
            low, high = np.where(closed, low, middle), np.where(closed, middle, high)
        share[coming] = 1 - 0.5 * (low + high)
        return share

    def _places(self, found):
        """Places (2, ny, nx) under the object after an increment that was solved with `place`; as in `sliding`."""
        mover, state = self.mover, self.mover._state
        aside = mover.aside_of(found)
        place = mover._to_object(self.points + aside, self.position, self.angle)
        if mover.friction == 0:
            return place
        along = _turn(aside - state.aside - self.way, -self.angle) * ~found.sticks
        place = np.where(self.tracked, self.begin + along, place)
        new = np.flatnonzero(((found.normal > 0) & ~self.tracked).ravel())
        if len(new):
            flat = place.reshape(2, -1)
            out = new[mover.heights(flat[:, new]) >= 0.5 * NO_CONTACT_MM]
            flat[:, out] = self.place.reshape(2, -1)[:, out]
        return place

    def _still_over(self, found, touching):
        """Which points (ny, nx) have lost contact, but would overlap the object at the place that friction alone gives them."""
        lost = self.tracked & ~touching
        if not lost.any() or self.mover.friction == 0:
            return np.zeros_like(lost)
        free = self.mover._to_object((self.points + self.mover.aside_of(found))[:, lost], self.position, self.angle)
        lost[lost] = self.mover.heights(free) - found.depth + found.down[lost] < 0
        return lost

    def finish(self, found):
        """Make the contact the state, with its energies by the trapezoidal rule."""
        state, at, touching = self.mover._state, self.window.at, found.normal > 0
        moved = found.by_normal + found.dragged
        slip = np.where(touching, found.slip, np.where(self.touched, moved - state.moved - self.way, 0.0))
        down = found.depth - state.position[2]
        work = 0.5 * float(((self.tangential + found.tangential) * self.way).sum() + down * (self.normal + found.normal).sum())
        rubbed = -0.5 * float(((self.tangential + found.tangential) * slip).sum())
        path, place = state.path.copy(), state.place.copy()
        path[at] = np.where(touching, state.path[at] * self.touched + np.linalg.norm(slip, axis=0), 0.0)
        place[at] = self.place
        self.mover._before, self.mover._ratio = (state.normal, state.tangential), 1.0
        trend = np.stack([*(moved - state.moved), found.down - state.down])
        fields = {name: _spread(getattr(state, name), at, values) for name, values in
                  (("normal", found.normal), ("tangential", found.tangential), ("sticks", found.sticks),
                   ("tracked", touching | self._still_over(found, touching)))}
        self.mover._state = replace(
            state, position=np.append(self.position[:2], found.depth), angle=self.angle, place=place, path=path, moved=moved,
            aside=self.mover.aside_of(found), down=found.down, work_mj=state.work_mj + work,
            dissipated_mj=state.dissipated_mj + rubbed, trend=trend, heights=self.gap,
            stored_mj=0.5 * float((found.normal * found.down).sum() + (found.tangential * moved).sum()),
            turns=state.turns + found.turns, **fields)


def _column(pair, like):
    return np.reshape(pair, (2, *[1] * (like.ndim - 1)))


def _turn(vectors, angle):
    """Vectors (2, ...) turned by an angle in radians."""
    if not angle:
        return vectors
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vectors[0] - s * vectors[1], s * vectors[0] + c * vectors[1]])


def _spread(whole, at, values):
    """A field of the whole grid that is zero but for its values on a window."""
    out = np.zeros_like(whole)
    out[at] = values
    return out
