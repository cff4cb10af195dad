"""A rigid object pressed on an elastic surface of known compliance, all load steps at once.

The unknowns are the forces f >= 0 at the contact points:  gap = gap0 - depth + A f >= 0,  f gap = 0,  sum f = F,
with the compliance A among the points. Primal-dual active-set (semismooth Newton) method: points that penetrate join the set,
points in tension leave it. The equations on a set are solved by conjugate gradients on the plane sum f = const, in single precision
with the residual in double (iterative refinement). A product with A for twenty load steps takes only seven times as long as for
one. The method suits many points whose contact states settle together; for few points use `active_set`, the reference method.
References: Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865; Gould, Hribar and Nocedal, SIAM J. Sci. Comput. 23
(2001) 1376 (projected conjugate gradients); Johnson, Contact Mechanics, sec. 5.9.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from softtact.compiled import compiled
from softtact.errors import ConvergenceError

_ROUNDING = 1e-12     # of squared residuals in single precision
_NEWTONS, _EXACT = 100, 1e-14     # steps to the depth on springs at most, and its relative error
_AS_WIDE = 0.8    # least share of the last load step's points for which a load step starts from the last one's forces, scaled
# Candidate points lie within REACH times the expected depth plus LEAST_REACH_MM; points within RISE times the depth may touch. The
# elastic layer is stiffer than springs, so that RISE times the depth on springs is enough, but for a recess into which it bulges.
REACH, LEAST_REACH_MM, RISE = 1.3, 0.1, 1.15
MISSED_MM = 2e-6      # overlap at points left out of a contact that is not the rounding of single precision
_Found = TypeVar("_Found")


@dataclass(frozen=True)
class ContactSettings:
    """tolerance_mm: largest gap under pressure, and largest overlap;  inner_*: limits of the conjugate gradients."""

    tolerance_mm: float = 1e-6
    max_iterations: int = 60
    inner_tolerance: float = 1e-2
    inner_iterations: int = 40


@dataclass(frozen=True)
class ContactLoadSteps:
    """Load steps l: forces (c, l) in N, depth (l,) in mm, gaps (c, l) in mm, iterations (l,), settled (l,): which converged."""

    force: np.ndarray
    depth: np.ndarray
    gap: np.ndarray
    iterations: np.ndarray
    settled: np.ndarray

    @property
    def penetration(self) -> np.ndarray:
        """Deepest overlap (l,) in mm."""
        return np.maximum(0.0, -self.gap.min(axis=0))


def among_candidates(solve: Callable[[float], _Found], needed_mm: Callable[[_Found, float], float], *, reach_mm: float,
                     most_mm: float) -> _Found:
    """A contact among candidate points within a reach over first touch; repeated with more of them until they are enough.

    solve(reach): the contact among points within a reach in mm, which begins with `reach_mm` and ends with `most_mm`, all points
    needed_mm(contact, reach): the reach that it asks for
    """
    while True:
        reach_mm = min(reach_mm, most_mm)
        found = solve(reach_mm)
        if reach_mm >= most_mm or needed_mm(found, reach_mm) <= reach_mm:
            return found
        reach_mm *= REACH


@compiled
def highest_missed(heights: np.ndarray, reach: float, down: np.ndarray, depth: np.ndarray) -> float:
    """Height in mm of the highest point beyond a reach at which the surface would penetrate the object; the reach if there is none.

    heights (n,), reach: in mm over first touch, as the depths (l,);  down (l, n): of the surface under the contact's forces in mm,
    negative where it bulges
    """
    highest = reach
    for n in range(len(heights)):
        if heights[n] > highest:
            for l in range(len(depth)):
                if heights[n] + down[l, n] < depth[l] - MISSED_MM:
                    highest = heights[n]
    return highest


class DenseCompliance:
    """A compliance matrix (c, c) in mm/N that acts on forces (c, l), in double and in single precision."""

    def __init__(self, matrix: np.ndarray) -> None:
        self._double, self._single = (matrix.astype(kind, copy=False) for kind in (np.float64, np.float32))

    def double(self, force: np.ndarray) -> np.ndarray:
        """Displacements (c, l) of forces (c, l) in double precision."""
        return self._double @ force

    def single(self, force: np.ndarray) -> np.ndarray:
        """The same in single precision."""
        return self._single @ force


def press_elastic(compliance: np.ndarray, gap0: np.ndarray, forces_n: Sequence[float] | np.ndarray, *,
                  area: np.ndarray | None = None, foundation_modulus: float = 1.0,
                  precondition: Callable[[np.ndarray], np.ndarray] = lambda x: x,
                  settings: ContactSettings = ContactSettings()) -> ContactLoadSteps:
    """`ContactLoadSteps` of points with gaps gap0 (c,) in mm under rising forces (l,) in N.

    compliance (c, c): mm/N;  area (c,): in any unit, and foundation_modulus: force per area and depth, for a first guess
    precondition: approximate inverse of the compliance, of (c, l). Raises ConvergenceError naming a load step not reached.
    """
    forces = np.asarray(forces_n, dtype=float)
    area = np.ones(len(gap0)) if area is None else area
    depth = np.array([depth_on_springs(gap0, area, force / foundation_modulus) for force in forces])
    load_steps = _Press(DenseCompliance(compliance), precondition, gap0[:, None], forces, settings).run(depth, area)
    if not load_steps.settled.all():
        raise ConvergenceError(not_settled(forces[~load_steps.settled][0], settings))
    return load_steps


def not_settled(force_n: float, settings: ContactSettings = ContactSettings()) -> str:
    """The error message of a load step that did not converge."""
    return f"The elastic press did not settle its contact at {force_n:g} N in {settings.max_iterations} iterations."


class _Press:
    """The method on load steps l: forces f (c, l), the active set, depths, gaps, iterations, and which load steps have settled."""

    def __init__(self, compliance, precondition, gap0, forces, settings):
        self.compliance, self.precondition, self.gap0, self.forces, self.settings = compliance, precondition, gap0, forces, settings
        self.iterations, self.settled = np.zeros(len(forces), dtype=int), np.zeros(len(forces), dtype=bool)

    def run(self, depth, area):
        """The `ContactLoadSteps`; first guess: forces of independent springs at depths (l,) that balance each force."""
        self.depth, pressed = depth, np.maximum(depth - self.gap0, 0.0) * area[:, None]
        self.f = pressed * (self.forces / pressed.sum(axis=0))
        self.active, self.gap = pressed > 0, np.zeros_like(pressed)
        *below, last = range(len(self.forces))
        self._settle(np.array([last]))
        if below:
            self._scale_down(np.array(below), last)
            self._settle(np.array(below))
        return ContactLoadSteps(force=self.f, depth=self.depth, gap=self.gap, iterations=self.iterations, settled=self.settled)

    def _scale_down(self, below, last):
        """Start the lower load steps from the last one's scaled forces, where the first guess has about as many active points."""
        points = self.active.sum(axis=0)
        like = below[points[below] > _AS_WIDE * points[last]]
        self.f[:, like] = self.f[:, [last]] * (self.forces[like] / self.forces[last])
        self.active[:, like] = self.active[:, [last]]

    def _settle(self, steps):
        """Iterate on some load steps until each has settled, or up to the limit."""
        for _ in range(self.settings.max_iterations):
            self.settled[steps] = self._evaluate(steps)
            steps = steps[~self.settled[steps]]
            if not len(steps):
                return
            self._newton(steps)

    def _evaluate(self, steps):
        """Update the gaps and active sets of some load steps; returns which of these have settled."""
        tolerance, forces = self.settings.tolerance_mm, self.forces[steps]
        f, active = self.f[:, steps], self.active[:, steps]
        gap = self.gap0 + self.compliance.double(f)
        depth = np.where(active, gap, 0.0).sum(axis=0) / active.sum(axis=0)
        gap -= depth
        joining, pulling = ~active & (gap < -tolerance), active & (f < 0)
        self.depth[steps], self.gap[:, steps], self.active[:, steps] = depth, gap, (active | joining) & ~pulling
        unsettled = ((np.abs(gap) > tolerance) & active | joining | pulling).any(axis=0)
        return ~unsettled & (np.abs(f.sum(axis=0) - forces) <= 1e-9 * forces)

    def _newton(self, steps):
        """One Newton step of the forces of some load steps; points that left the active set lose their force."""
        active, before, forces = self.active[:, steps], self.f[:, steps], self.forces[steps]
        single, precondition = self.compliance.single, self.precondition
        f = np.where(active, before, 0.0)
        lost = (f - before).astype(np.float32)
        right = -self.gap[:, steps] - (single(lost) if lost.any() else 0.0)
        mask = active.astype(np.float32)
        f += projected_conjugate_gradients(lambda x: single(x) * mask, lambda x: precondition(x * mask) * mask, mask,
                                           np.where(active, right, 0.0), forces - f.sum(axis=0), self.settings)
        lacking = (forces - f.sum(axis=0)) / active.sum(axis=0)
        self.f[:, steps] = f + np.where(active, lacking, 0.0)     # what single precision lost
        self.iterations[steps] += 1


@compiled
def depth_on_springs(heights: np.ndarray, area: np.ndarray, force_over_modulus: float) -> float:
    """Depth at which independent springs (Winkler foundation) below heights carry a force; the first guess of an elastic press.

    heights (c,): in mm;  area (c,): of the springs;  force_over_modulus: force over foundation modulus, that is area times depth
    Newton's method, which is exact after some steps, since the force on springs is piecewise linear and convex.
    """
    depth = heights.min()
    for _ in range(_NEWTONS):
        carried, carrying = 0.0, 0.0
        for n in range(len(heights)):
            if heights[n] <= depth:
                carried += area[n] * (depth - heights[n])
                carrying += area[n]
        step = (force_over_modulus - carried) / carrying
        depth += step
        if abs(step) <= _EXACT * abs(depth - heights.min()):
            break
    return depth


def projected_conjugate_gradients(apply: Callable[[np.ndarray], np.ndarray], precondition: Callable[[np.ndarray], np.ndarray],
                                  mask: np.ndarray, right: np.ndarray, total: np.ndarray, settings: ContactSettings) -> np.ndarray:
    """x (c, m), zero outside the mask (c, m), with sum x = total (m,) and apply(x) - right constant within the mask."""
    right = right.astype(np.float32)
    along = precondition(mask)
    weight = _dot(along, mask)

    def project(x):
        z = precondition(x)
        return z - along * (_dot(z, mask) / weight)

    x = along * (total.astype(np.float32) / weight)
    r = right - apply(x)
    z = project(r)
    p, rho = z, _dot(r, z)
    first = np.maximum(np.maximum(rho, _dot(right, project(right))), np.float32(1e-30))
    for _ in range(settings.inner_iterations):
        if (rho <= settings.inner_tolerance**2 * first).all():
            break
        q = apply(p)
        # A column that is solved to the rounding of single precision waits for the others: its p would have no length.
        step = np.where(rho > _ROUNDING * first, rho / np.maximum(_dot(p, q), np.float32(1e-30)), np.float32(0.0))
        x += step * p
        before, r = r, r - step * q
        z = project(r)
        turned = np.maximum(_dot(r - before, z), 0)     # Polak and Ribiere's: in single precision r is not quite conjugate to z
        p = z + np.where(rho > 0, turned / np.maximum(rho, np.float32(1e-30)), np.float32(0.0)) * p
        rho = _dot(r, z)
    return x.astype(float)


def _dot(a, b):
    return np.einsum("cm,cm->m", a, b)


@dataclass(frozen=True)
class ElasticLoadStep:
    """One load step: nodal forces (c,) in N, displacement (c,) of the points in mm, indentation in mm."""

    force_n: float
    nodal_force: np.ndarray
    displacement: np.ndarray
    indentation: float
    iterations: int
    penetration: float


def active_set(compliance: np.ndarray, gap0: np.ndarray, forces_n: Iterable[float], *,
               max_iterations: int = 200) -> Iterator[ElasticLoadStep]:
    """Yield an `ElasticLoadStep` for each force: the reference method, load step by load step, with direct solutions.

    It solves the equations of the active points, drops points in tension and adds points that penetrate. The active set of one
    force is the first guess for the next."""
    active = gap0 <= gap0.min() + 1e-9
    for force in forces_n:
        load_step, active = _solve_load_step(compliance, gap0, active, float(force), max_iterations)
        yield load_step


def _solve_load_step(compliance, gap0, active, force, max_iterations):
    tolerance = 1e-9
    for iteration in range(1, max_iterations + 1):
        nodes = np.flatnonzero(active)
        pressing, indentation = _bordered(compliance[np.ix_(nodes, nodes)], gap0[nodes], force)
        if (pressing < -tolerance * force).any():
            active[nodes[pressing < 0]] = False
            continue
        displacement = compliance[:, nodes] @ pressing
        gap = gap0 - indentation + displacement
        entering = (gap < -tolerance) & ~active
        if not entering.any():
            nodal = np.zeros(len(gap0))
            nodal[nodes] = np.maximum(pressing, 0.0)
            return ElasticLoadStep(force, nodal, displacement, indentation, iteration, float(max(0.0, -gap.min()))), active
        active |= entering
    raise ConvergenceError(f"The elastic press did not settle its contact at {force:g} N in {max_iterations} iterations.")


def _bordered(compliance, gap0, force):
    """Forces of touching points and indentation: compliance f - indentation = -gap0, sum f = force."""
    solution = np.linalg.solve(compliance, np.column_stack([np.ones(len(gap0)), gap0]))
    indentation = (force + solution[:, 1].sum()) / solution[:, 0].sum()
    return indentation * solution[:, 0] - solution[:, 1], indentation
