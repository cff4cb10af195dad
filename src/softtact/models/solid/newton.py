"""Balance of a `SolidBody` at a load step: Newton's method of `models.newton`, with the frames' loaded freedoms as unknowns."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softtact.errors import ConvergenceError
from softtact.linalg.workers import one_thread_each
from softtact.models.newton import Solution, lowers_potential, solve
from softtact.models.solid.body import SolidBody, SolidState
from softtact.models.solid.items import with_pressures

_SMALL = 1 / 16  # share of a step
_CARRIED = 1e-3  # share of a frame's load below which nothing carries it
_REMEMBERED = 4  # residuals that a step with friction may not exceed (Grippo, Lampariello and Lucidi, 1986)


@dataclass(frozen=True)
class SolidSettings:
    """When a step is good enough."""

    relative_residual: float = 1e-6
    """Largest unbalanced force over the sum of what presses and holds."""
    penetration_mm: float = 1e-3
    """Largest overlap of surfaces in contact, and widest gap across which pressure acts, in the mean and the slope over a facet."""
    max_iterations: int = 40
    """Newton steps of a load step, or of an augmentation."""
    max_augmentations: int = 12
    """Changes of the contacts' offsets."""
    largest_step_mm: float = 1.0
    """Largest displacement of a node in one Newton step."""
    smallest_increment: float = 1 / 256
    """Smallest share of a step into which it is divided before it is given up."""


@dataclass(frozen=True)
class Target:
    """Where an increment leads."""

    frame_steps: list[np.ndarray]
    """(6,) of each frame, mm and radians: prescribed increments of its freedoms; 0 where a freedom is loaded or stays."""
    loads: list[dict[int, float]]
    """Of each frame {freedom: load at the increment's end in N or N mm}."""
    pressures: np.ndarray
    """(f,) in MPa at the increment's end."""
    name: str = "balance"
    """For progress messages."""

    @property
    def unknown(self) -> list[tuple[int, int]]:
        """(frame, freedom) of the loaded freedoms."""
        return [(frame, freedom) for frame, loads in enumerate(self.loads) for freedom in sorted(loads)]


@dataclass
class _Balance:
    """The balance under a `Target`, as a `Problem`; its first step predicts with the prescribed increments."""

    body: SolidBody
    settings: SolidSettings
    target: Target
    pending: bool
    before: list[float] = field(default_factory=list)
    share: float = 1.0
    taken: int = 0
    just_predicted: bool = False
    floating: bool = False

    def prepared(self, state: SolidState, iteration: int) -> SolidState:
        # What is prescribed has moved now, so where new contacts met it is known, nearly, before friction acts on them.
        return _anchored(self.body, state) if self.just_predicted and self.body.frictional else state

    def _loads_off(self, state: SolidState) -> np.ndarray:
        loads = self.body.frame_loads(state)
        return np.array([loads[frame, freedom] - self.target.loads[frame][freedom] for frame, freedom in self.target.unknown])

    def residual(self, state: SolidState) -> float:
        off = self._loads_off(state)
        return float(max(np.abs(self.body.residual(state)).max(initial=0.0), np.abs(off).max(initial=0.0)))

    def balanced(self, state: SolidState, residual: float) -> bool:
        # Without loads rounding is all that is left, as in a body that moves freely, or forces of overlaps far below the allowed
        # one, as of an object that lies on the surface.
        size = max(state.size, self.body.unresolved_n(state, self.settings.penetration_mm))
        return not self.pending and residual <= max(self.settings.relative_residual * size, self.body.rounding_n(state))

    def step(self, state: SolidState) -> tuple[SolidState, Any]:
        body, unknown = self.body, self.target.unknown
        residual, off = body.residual(state).copy(), self._loads_off(state)
        self.floating = self._is_floating(off)
        frame_steps = [np.zeros(6) for _ in body.frames]
        histories = state.item_histories
        if self.pending:
            histories = with_pressures(body.items, histories, self.target.pressures)      # type: ignore[arg-type]
            residual, off = self._predicted(state, residual, off, frame_steps)
        columns, corner = [], np.zeros((len(unknown), len(unknown)))
        for k, (frame, freedom) in enumerate(unknown):
            column, loads = body.border(state, frame, np.eye(6)[freedom])
            columns.append(column)
            corner[:, k] = [loads[other] for other in unknown]
        # Right after a prescribed increment surfaces overlap by far more than in balance, and turning them costs the definiteness.
        found = body.solve(state, np.column_stack([residual, *columns]), turning=not self.just_predicted)
        step = -found[:, 0]
        if unknown:
            # The loads' derivatives by the displacements: the columns once more where the tangent is symmetric, without friction.
            unsymmetric = body.frictional
            changes = self._loads_along(state, found) if unsymmetric else np.column_stack(columns).T @ found
            schur = corner - changes[:, 1:]
            right = changes[:, 0] - off
            amount = _solved(schur, right) if unsymmetric else np.linalg.solve(_definite(schur), right)
            step = step - found[:, 1:] @ amount
            for (frame, freedom), value in zip(unknown, amount, strict=True):
                frame_steps[frame][freedom] += value
        return state, (step, frame_steps, histories)

    def _is_floating(self, off: np.ndarray) -> bool:
        """Whether nothing stands against the loads of a frame, which are all that is out of balance by `off` (unknown,)."""
        wanted = np.array([self.target.loads[frame][freedom] for frame, freedom in self.target.unknown])
        frames = np.array([frame for frame, _ in self.target.unknown])
        return any(np.abs(off + wanted)[frames == frame].max() < _CARRIED * np.abs(wanted[frames == frame]).max()
                   for frame in set(frames.tolist()))

    def _loads_along(self, state: SolidState, steps: np.ndarray) -> np.ndarray:
        """Derivatives (unknown, k) of the loaded freedoms' loads along steps (unknowns, k) of the free displacements."""
        loads = [self.body.loads_along(state, step) for step in steps.T]
        return np.array([[changes[other] for other in self.target.unknown] for changes in loads]).T

    def _predicted(self, state, residual, off, frame_steps):
        """What is out of balance after prescribed increments, added to `frame_steps`, and pressures, to first order."""
        body = self.body
        for frame, prescribed in enumerate(self.target.frame_steps):
            if np.any(prescribed):
                column, loads = body.border(state, frame, prescribed)
                residual = residual + column
                off = off + np.array([loads[other] for other in self.target.unknown])
                frame_steps[frame] += prescribed
        if np.any(self.target.pressures != state.pressures):
            x = body.points + state.displacement
            force = np.zeros_like(x)
            for face, now, then in zip(body.pressures, state.pressures, self.target.pressures, strict=True):
                change = float(then - now)
                face.add_forces(change, face.evaluate(change, x), force)
            residual = residual + force.ravel()[body.free]
        return residual, off

    def first_share(self, step: Any) -> float:
        if self.pending:
            return 1.0
        largest = max(np.abs(step[0]).max(initial=0.0), max((np.abs(moved[:3]).max() for moved in step[1]), default=0.0))
        return min(1.0, self.settings.largest_step_mm / max(largest, 1e-30))

    def moved(self, state: SolidState, step: Any, share: float) -> SolidState | None:
        self.share = share
        if self.pending and share < 1.0:
            # The prescribed increments are taken whole, or they are too large.
            return self.body.moved(state, share * step[0], step[1], histories=step[2]) if share == 0.5 else None
        return self.body.moved(state, share * step[0], [share * moved for moved in step[1]], histories=step[2])

    def better(self, trial: SolidState, state: SolidState, residual: float) -> bool:
        if self.pending:
            return True
        smaller = self.residual(trial) < residual
        if not all(item.conservative(history) for item, history, _ in self.body.item_states(state)):
            return smaller
        lower = lowers_potential(state.energy, trial.energy - self._work(state, trial), abs(state.energy) + self.body.energy_noise)
        if self.body.frictional:
            # Friction has no potential. A step is to be no worse than the last ones, or small: points that begin to slide stand in
            # the way of every larger one.
            return self.residual(trial) < max([*self.before, residual]) * (2.0 if self.share <= _SMALL else 1.0)
        return smaller if lower is None else lower  # a residual alone may fall and rise in turns where points touch and leave

    def _work(self, before: SolidState, after: SolidState) -> float:
        """Work in mJ of the loads of the frames' loaded freedoms in a step."""
        moved = [new.step_from(old) for old, new in zip(before.poses, after.poses, strict=True)]
        return sum(self.target.loads[frame][freedom] * float(moved[frame][freedom]) for frame, freedom in self.target.unknown)

    def accepted(self, state: SolidState, trial: SolidState) -> None:
        self.just_predicted = self.pending
        self.pending, self.taken = False, self.taken + 1
        self.before = [*self.before, self.residual(state)][-_REMEMBERED:]
        self.body.watch.report(f"{self.target.name}, iteration {self.taken}, largest unbalanced force {self.residual(trial):.2g} N")

    def recovered(self, state: SolidState) -> bool:
        return False


def _anchored(body, state):
    """The state with friction on points that came to touch since the increment began."""
    x = body.points + state.displacement
    histories = tuple(item.anchored(history, response, x) for item, history, response in body.item_states(state))
    same = all(one is other for one, other in zip(histories, state.item_histories, strict=True))
    return state if same else body.with_histories(state, histories)


def _solved(schur: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Steps of the loaded freedoms; of a frame that touches nothing, which nothing resists, along its load."""
    try:
        return np.asarray(np.linalg.solve(schur, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.solve(_definite(schur), right))


def _definite(schur: np.ndarray) -> np.ndarray:
    """A matrix' symmetric part with its eigenvalues' magnitudes, none next to zero: a step uphill would lead away."""
    schur = 0.5 * (schur + schur.T)
    values, vectors = np.linalg.eigh(schur)
    least = 1e-8 * max(np.abs(values).max(), 1e-12)
    return (vectors * np.maximum(np.abs(values), least)) @ vectors.T


def _without_friction(body, start, target, settings, pending):
    """A first guess for a loaded frame: the balance without friction, which has a potential, and so is found from any start."""
    with body.frictionless():
        problem = _Balance(body, settings, target, pending)
        found = solve(problem, body.with_histories(start, start.item_histories), max_iterations=settings.max_iterations)
    if found.state is None:
        return start, found.iterations, pending
    histories = with_pressures(body.items, start.item_histories, found.state.pressures)
    guess = body.evaluate(found.state.displacement, found.state.poses, histories, start)
    return _anchored(body, guess), found.iterations, False


def balance(body: SolidBody, start: SolidState, target: Target, settings: SolidSettings) -> tuple[SolidState, int, float]:
    """The balanced state of a target, its iterations and the largest unbalanced force (N), contact settled to the penetration.

    Raises ConvergenceError where Newton's method or the augmentations do not end.
    """
    with one_thread_each():
        return _balance(body, start, target, settings)


def _balance(body, start, target, settings):
    pending = any(prescribed.any() for prescribed in target.frame_steps) or bool(np.any(target.pressures != start.pressures))
    taken = 0
    if target.unknown and not pending and body.frictional:
        guess, taken, still = _without_friction(body, start, target, settings, pending)
        try:
            return _settled(body, guess, target, settings, still, taken)
        except _UnbalancedError as error:
            # Points that slid far in the guess and stick in truth overshoot in turns. From where they were they stick at once.
            taken = error.iterations
    return _settled(body, start, target, settings, pending, taken)


class _UnbalancedError(ConvergenceError):
    """Newton's method did not end; it carries the steps that were taken."""

    def __init__(self, words: str, iterations: int) -> None:
        super().__init__(words)
        self.iterations = iterations


class LostContactError(_UnbalancedError):
    """Newton's method did not end, and at its last step nothing stood against the load of a frame."""


def _settled(body, state, target, settings, pending, iterations):
    """Newton's method from a state, and augmentations until the contacts are settled; `iterations` were taken before."""
    for _ in range(settings.max_augmentations + 1):
        problem = _Balance(body, settings, target, pending)
        found: Solution = solve(problem, state, max_iterations=settings.max_iterations)
        iterations += found.iterations
        if found.state is None and problem.pending:
            raise _UnbalancedError("The prescribed step turns an element inside out.", iterations)
        if found.state is None:
            words = f"{found.residual_n:.3g} N are left unbalanced after {found.iterations} iterations."
            raise (LostContactError if problem.floating else _UnbalancedError)(words, iterations)
        state, pending = found.state, False
        if all(item.settled(*both, settings.penetration_mm) for item, *both in body.item_states(state)):
            return state, iterations, found.residual_n
        state = _anchored(body, state)
        state = body.with_histories(state, (item.augmented(*both) for item, *both in body.item_states(state)))
    worst = max(item.overlap_mm(*both) for item, *both in body.item_states(state))
    if worst <= settings.penetration_mm:
        raise ConvergenceError(
            "Points that press lie beside the facets that they meet, as where a surface ends or an edge presses into it: "
            "let the surface reach further, or round the edge."
        )
    raise ConvergenceError(f"The surfaces still overlap by {worst * 1000:.3g} um after {settings.max_augmentations} augmentations.")
