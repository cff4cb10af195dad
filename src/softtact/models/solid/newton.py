"""Balance of a `SolidBody` at a load step: Newton's method of `models.newton`, with the frames' loaded freedoms as unknowns."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softtact.errors import ConvergenceError
from softtact.linalg.workers import one_thread_each
from softtact.models.newton import Solution, lowers_potential, solve
from softtact.models.solid.body import SolidBody, SolidState

_SMALL = 1 / 16  # share of a step
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
    """Longest way of a node in one Newton step."""
    smallest_increment: float = 1 / 256
    """Smallest share of a step into which it is divided before it is given up."""


@dataclass(frozen=True)
class Target:
    """Where an increment leads."""

    ways: list[np.ndarray]
    """(6,) of each frame, mm and radians: what is prescribed within the increment; 0 where a freedom is loaded or stays."""
    loads: list[dict[int, float]]
    """Of each frame {freedom: load at the increment's end in N or N mm}."""
    pressures: np.ndarray
    """(f,) in MPa at the increment's end."""
    name: str = "balance"
    """What progress calls it."""

    @property
    def unknown(self) -> list[tuple[int, int]]:
        """(frame, freedom) of the loaded freedoms."""
        return [(frame, freedom) for frame, own in enumerate(self.loads) for freedom in sorted(own)]


@dataclass
class _Balance:
    """The balance under a `Target`, as a `Problem`; the first step takes the prescribed ways along."""

    body: SolidBody
    settings: SolidSettings
    target: Target
    pending: bool
    before: list[float] = field(default_factory=list)
    share: float = 1.0
    taken: int = 0
    just_predicted: bool = False

    def prepared(self, state: SolidState, iteration: int) -> SolidState:
        return state

    def _loads_off(self, state: SolidState) -> np.ndarray:
        loads = self.body.frame_loads(state)
        return np.array([loads[frame, freedom] - self.target.loads[frame][freedom] for frame, freedom in self.target.unknown])

    def residual(self, state: SolidState) -> float:
        off = self._loads_off(state)
        return float(max(np.abs(self.body.residual(state)).max(initial=0.0), np.abs(off).max(initial=0.0)))

    def balanced(self, state: SolidState, residual: float) -> bool:
        return not self.pending and residual <= self.settings.relative_residual * max(state.size, 1e-9)

    def step(self, state: SolidState) -> tuple[SolidState, Any]:
        body, unknown = self.body, self.target.unknown
        residual, off = body.residual(state).copy(), self._loads_off(state)
        ways = [np.zeros(6) for _ in body.frames]
        pressures = state.pressures
        if self.pending:
            pressures = self.target.pressures
            residual, off = self._predicted(state, residual, off, ways)
        columns, corner = [], np.zeros((len(unknown), len(unknown)))
        for k, (frame, freedom) in enumerate(unknown):
            column, loads = body.border(state, frame, np.eye(6)[freedom])
            columns.append(column)
            corner[:, k] = [loads[other] for other in unknown]
        # Right after a prescribed way surfaces overlap by far more than in balance, and turning them costs the definiteness.
        found = body.solve(state, np.column_stack([residual, *columns]), turning=not self.just_predicted)
        step = -found[:, 0]
        if unknown:
            # The loads' derivatives by the displacements: the columns once more where the tangent is symmetric, without friction.
            rubs = any(pair.friction for pair in body.pairs)
            felt = self._felt(state, found) if rubs else np.column_stack(columns).T @ found
            schur = corner - felt[:, 1:]
            amount = np.linalg.solve(schur if rubs else _definite(0.5 * (schur + schur.T)), -off + felt[:, 0])
            step = step - found[:, 1:] @ amount
            for (frame, freedom), value in zip(unknown, amount, strict=True):
                ways[frame][freedom] += value
        return state, (step, ways, pressures)

    def _felt(self, state: SolidState, steps: np.ndarray) -> np.ndarray:
        """Derivatives (unknown, k) of the loaded freedoms' loads along steps (unknowns, k) of the free displacements."""
        loads = [self.body.loads_along(state, step) for step in steps.T]
        return np.array([[own[other] for other in self.target.unknown] for own in loads]).T

    def _predicted(self, state, residual, off, ways):
        """What is out of balance after the prescribed ways and pressures, to first order; the ways are added to `ways`."""
        body = self.body
        for frame, way in enumerate(self.target.ways):
            if np.any(way):
                column, loads = body.border(state, frame, way)
                residual = residual + column
                off = off + np.array([loads[other] for other in self.target.unknown])
                ways[frame] += way
        if np.any(self.target.pressures != state.pressures):
            x = body.points + state.displacement
            force = np.zeros_like(x)
            for face, now, then in zip(body.pressures, state.pressures, self.target.pressures, strict=True):
                face.add_force(x, float(then - now), force)
            residual = residual + force.ravel()[body.free]
        return residual, off

    def first_share(self, step: Any) -> float:
        if self.pending:
            return 1.0
        largest = max(np.abs(step[0]).max(initial=0.0), max((np.abs(way[:3]).max() for way in step[1]), default=0.0))
        return min(1.0, self.settings.largest_step_mm / max(largest, 1e-30))

    def moved(self, state: SolidState, step: Any, share: float) -> SolidState | None:
        self.share = share
        if self.pending and share < 1.0:
            # The prescribed ways are taken whole, or the increment is too large.
            return self.body.moved(state, share * step[0], step[1], pressures=step[2]) if share == 0.5 else None
        return self.body.moved(state, share * step[0], [share * way for way in step[1]], pressures=step[2])

    def better(self, trial: SolidState, state: SolidState, residual: float) -> bool:
        if self.pending:
            return True
        smaller = self.residual(trial) < residual
        if np.any(state.pressures):  # their work is no function of the places where the surface is open
            return smaller
        lower = lowers_potential(state.energy, trial.energy - self._work(state, trial), abs(state.energy) + self.body.energy_noise)
        if any(pair.friction for pair in self.body.pairs):
            # It has no potential. A step is to be no worse than the last ones, or small: points that begin to slide stand in
            # the way of every larger one.
            return self.residual(trial) < max([*self.before, residual]) * (2.0 if self.share <= _SMALL else 1.0)
        return smaller if lower is None else lower  # a residual alone may fall and rise in turns where points touch and leave

    def _work(self, before: SolidState, after: SolidState) -> float:
        """Work in mJ of the loads of the frames' loaded freedoms on a step's way; rotations by their small angles."""
        work = 0.0
        for frame, freedom in self.target.unknown:
            old, new = before.poses[frame], after.poses[frame]
            if freedom < 3:
                way = new.translation[freedom] - old.translation[freedom]
            else:
                i, j = (freedom - 1) % 3, (freedom - 2) % 3
                turn = new.rotation @ old.rotation.T
                way = 0.5 * (turn[j, i] - turn[i, j])
            work += self.target.loads[frame][freedom] * way
        return work

    def accepted(self, state: SolidState, trial: SolidState) -> None:
        self.just_predicted = self.pending
        self.pending, self.taken = False, self.taken + 1
        self.before = [*self.before, self.residual(state)][-_REMEMBERED:]
        self.body.watch.beat(f"{self.target.name}, iteration {self.taken}, largest unbalanced force {self.residual(trial):.2g} N")

    def recovered(self, state: SolidState) -> bool:
        return False


def _definite(schur: np.ndarray) -> np.ndarray:
    """A symmetric matrix with its eigenvalues' magnitudes, none next to zero: a step uphill would lead away."""
    values, vectors = np.linalg.eigh(schur)
    least = 1e-8 * max(np.abs(values).max(), 1e-12)
    return (vectors * np.maximum(np.abs(values), least)) @ vectors.T


def _without_friction(body, start, target, settings, pending):
    """A first guess for a loaded frame: the balance without friction, which has a potential, and so is found from any start."""
    with body.frictionless():
        problem = _Balance(body, settings, target, pending)
        found = solve(problem, body.again(start, start.histories), max_iterations=settings.max_iterations)
    if found.state is None:
        return start, found.iterations, pending
    guess = body.evaluate(found.state.displacement, found.state.poses, start.histories, found.state.pressures, start)
    return guess, found.iterations, False


def balance(body: SolidBody, start: SolidState, target: Target, settings: SolidSettings) -> tuple[SolidState, int, float]:
    """The balanced state of a target, its iterations and the largest unbalanced force (N), contact settled to the penetration.

    Raises ConvergenceError where Newton's method or the augmentations do not end.
    """
    with one_thread_each():
        return _balance(body, start, target, settings)


def _balance(body, start, target, settings):
    pending = any(way.any() for way in target.ways) or bool(np.any(target.pressures != start.pressures))
    taken = 0
    if target.unknown and not pending and any(pair.friction for pair in body.pairs):
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


def _settled(body, state, target, settings, pending, iterations):
    """Newton's method from a state, and augmentations until the contacts are settled; `iterations` were taken before."""
    for _ in range(settings.max_augmentations + 1):
        problem = _Balance(body, settings, target, pending)
        found: Solution = solve(problem, state, max_iterations=settings.max_iterations)
        iterations += found.iterations
        if found.state is None:
            said = f"{found.residual_n:.3g} N are left unbalanced after {found.iterations} iterations."
            raise _UnbalancedError(said, iterations)
        state, pending = found.state, False
        if all(
            pair.settled(history, contact, settings.penetration_mm)
            for pair, history, contact in zip(body.pairs, state.histories, state.contacts, strict=True)
        ):
            return state, iterations, found.residual_n
        state = body.again(
            state,
            tuple(
                pair.augmented(history, contact)
                for pair, history, contact in zip(body.pairs, state.histories, state.contacts, strict=True)
            ),
        )
    worst = max(
        pair.overlap_mm(history, contact)
        for pair, history, contact in zip(body.pairs, state.histories, state.contacts, strict=True)
    )
    if worst <= settings.penetration_mm:
        raise ConvergenceError(
            "Points that press lie beside the facets that they meet, as where a surface ends or an edge presses into it: "
            "let the surface reach further, or round the edge."
        )
    raise ConvergenceError(f"The surfaces still overlap by {worst * 1000:.3g} um after {settings.max_augmentations} augmentations.")
