"""A rigid object pressed on an elastic surface of known compliance, all load steps at once.

The unknowns are the forces f >= 0 at the contact points:  gap = gap0 - depth + A f >= 0,  f gap = 0,  sum f = F,
with the compliance A among the points. Primal-dual active-set (semismooth Newton) method: points that penetrate join the set,
points in tension leave it. The equations on a set are solved by conjugate gradients on the plane sum f = const, in single precision
with the residual in double (iterative refinement). A product with A for twenty load steps takes only seven times as long as for
one; many presses on a GPU add more columns (`models/elastic/batch`). The method suits many points whose contact states settle
together; for few points use `active_set`, the reference method.
References: Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865; Gould, Hribar and Nocedal, SIAM J. Sci. Comput. 23
(2001) 1376 (projected conjugate gradients); Johnson, Contact Mechanics, sec. 5.9.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from array_api_compat import array_namespace, device

from softtact.errors import ConvergenceError

_Force = TypeVar("_Force", float, np.ndarray)

_ROUNDING = 1e-12     # of squared residuals in single precision
_AS_WIDE = 0.8    # least share of the last load step's points for which a load step starts from the last one's forces, scaled
# Candidate points lie within REACH times the expected depth plus LEAST_REACH_MM; points within RISE times the depth may touch.
REACH, LEAST_REACH_MM, RISE = 1.3, 0.1, 1.15


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


class ActingCompliance(Protocol):
    """The interface of `DenseCompliance`, for NumPy or torch arrays."""

    def double(self, force: Any) -> Any: ...

    def single(self, force: Any) -> Any: ...

    def precondition(self, x: Any) -> Any: ...


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

    def precondition(self, x: np.ndarray) -> np.ndarray:
        """Approximate inverse of `single`: the identity, as nothing is known about a dense matrix."""
        return x


def press_elastic(compliance: np.ndarray, gap0: np.ndarray, forces_n: Sequence[float] | np.ndarray, *,
                  area: np.ndarray | None = None, foundation_modulus: float = 1.0,
                  precondition: Callable[[np.ndarray], np.ndarray] | None = None,
                  settings: ContactSettings = ContactSettings()) -> ContactLoadSteps:
    """`ContactLoadSteps` of points with gaps gap0 (c,) in mm under forces (l,) in N.

    compliance (c, c): mm/N;  area (c,): in any unit, and foundation_modulus: force per area and depth, for a first guess
    precondition: approximate inverse of the compliance, of (c, l), or None. Raises ConvergenceError naming a load step not reached.
    """
    forces_n, acting = np.asarray(forces_n, dtype=float), DenseCompliance(compliance)
    if precondition is not None:
        acting.precondition = precondition     # type: ignore[method-assign, assignment]
    area = np.ones(len(gap0)) if area is None else area
    depth = depth_on_springs(gap0 - gap0.min(), area, forces_n / foundation_modulus) + gap0.min()
    load_steps = press_columns(acting, gap0[:, None], forces_n[None], depth[None], area=area, settings=settings)
    if not load_steps.settled.all():
        raise ConvergenceError(not_settled(forces_n[~load_steps.settled][0], settings))
    return load_steps


def not_settled(force_n: float, settings: ContactSettings = ContactSettings()) -> str:
    """The error message of a load step that did not converge."""
    return f"The elastic press did not settle its contact at {force_n:g} N in {settings.max_iterations} iterations."


def press_columns(compliance: ActingCompliance, gap0: Any, forces_n: Any, depth: Any, *, area: Any,
                  settings: ContactSettings = ContactSettings()) -> ContactLoadSteps:
    """`ContactLoadSteps` of many presses on one surface, with a column for each press and load step, a press' load steps side by
    side.

    compliance: has `double`, `single`, `precondition`, of (c, columns);  gap0 (c, p): in mm, far above any depth where an object
    has no point;  forces_n (p, l): in N, rising;  depth (p, l): first guesses in mm;  area (c,): of the points, in any unit
    All are arrays of one kind, NumPy's or torch's on any device; so are the load steps' fields.
    """
    return _Press(compliance, gap0, forces_n, settings).run(depth, area)


@dataclass
class _State:
    """Of all columns: forces f (c, m), the active set, depths, gaps, iterations, and which columns have converged."""

    f: np.ndarray
    active: np.ndarray
    depth: np.ndarray
    gap: np.ndarray
    iterations: np.ndarray
    settled: np.ndarray


class _Press:
    """The method on columns m; `press` (m,): the press of each column, `last` (m,): the column of its last load step."""

    def __init__(self, compliance, gap0, forces, settings):
        self.xp = array_namespace(gap0)
        self.compliance, self.gap0, self.settings = compliance, gap0, settings
        self.forces, load_steps = self.xp.reshape(forces, (-1,)), forces.shape[1]
        self.columns = self.xp.arange(len(self.forces), device=device(gap0))
        self.press, self.load_step = self.columns // load_steps, self.columns % load_steps
        self.last = self.press * load_steps + load_steps - 1

    def run(self, depth, area):
        state = self._first(self.xp.reshape(depth, (-1,)), area)
        self._settle(state, self.columns[self.columns == self.last])
        below = self.columns[self.columns != self.last]
        if len(below):
            self._scale_down(state, below)
            self._settle(state, below)
        return ContactLoadSteps(force=state.f, depth=state.depth, gap=state.gap, iterations=state.iterations, settled=state.settled)

    def _first(self, depth, area):
        """First guess: forces of independent springs under the object, at the depth that balances each force."""
        xp = self.xp
        pressed = xp.clip(depth - self.gap0[:, self.press], min=0.0) * area[:, None]
        pressed *= self.forces / xp.sum(pressed, axis=0)
        return _State(f=pressed, active=pressed > 0, depth=depth, gap=xp.zeros_like(pressed),
                      iterations=xp.zeros_like(self.columns), settled=self.columns < 0)

    def _scale_down(self, state, below):
        """Start the lower load steps from the last one's scaled forces, where the first guess has about as many active points."""
        xp, last = self.xp, self.last[below]
        points = xp.sum(xp.astype(state.active, xp.int64), axis=0)
        like = points[below] > _AS_WIDE * points[last]
        below, last = below[like], last[like]
        state.f[:, below] = state.f[:, last] * (self.forces[below] / self.forces[last])
        state.active[:, below] = state.active[:, last]

    def _settle(self, state, columns):
        """Iterate on some columns until each has converged or reached the iteration limit."""
        for _ in range(self.settings.max_iterations):
            state.settled[columns] = self._evaluate(state, columns)
            columns = columns[~state.settled[columns]]
            if not len(columns):
                return
            self._newton(state, columns)

    def _evaluate(self, state, columns):
        """Update the gaps and active sets of some columns; returns which of these columns have converged."""
        xp, tolerance = self.xp, self.settings.tolerance_mm
        f, active, forces = state.f[:, columns], state.active[:, columns], self.forces[columns]
        gap = self.gap0[:, self.press[columns]] + self.compliance.double(f)
        depth = xp.sum(xp.where(active, gap, 0.0), axis=0) / xp.sum(xp.astype(active, gap.dtype), axis=0)
        gap -= depth
        joining, pulling = ~active & (gap < -tolerance), active & (f < 0)
        state.depth[columns], state.gap[:, columns], state.active[:, columns] = depth, gap, (active | joining) & ~pulling
        unsettled = xp.any((xp.abs(gap) > tolerance) & active | joining | pulling, axis=0)
        return ~unsettled & (xp.abs(xp.sum(f, axis=0) - forces) <= 1e-9 * forces)

    def _newton(self, state, columns):
        """One Newton step of the forces of some columns; points that left the active set lose their force."""
        xp, single, precondition = self.xp, self.compliance.single, self.compliance.precondition
        active, before = state.active[:, columns], state.f[:, columns]
        f = xp.where(active, before, 0.0)
        lost = xp.astype(f - before, xp.float32)
        right = -state.gap[:, columns] - (single(lost) if xp.any(lost != 0) else 0.0)
        mask = xp.astype(active, xp.float32)
        f += projected_conjugate_gradients(lambda x: single(x) * mask, lambda x: precondition(x * mask) * mask, mask,
                                           xp.where(active, right, 0.0), self.forces[columns] - xp.sum(f, axis=0), self.settings)
        lacking = (self.forces[columns] - xp.sum(f, axis=0)) / xp.sum(xp.astype(active, f.dtype), axis=0)
        f += xp.where(active, lacking, 0.0)     # what single precision lost
        state.f[:, columns] = f
        state.iterations[columns] += 1


def depth_on_springs(gap: np.ndarray, area: np.ndarray, force_over_modulus: _Force) -> _Force:
    """Depth at which independent springs (Winkler foundation) carry a force; the first guess of an elastic press.

    gap (c,): >= 0 in mm, the least is 0;  area (c,): of the springs
    force_over_modulus: force over foundation modulus, that is area times depth, a number or (l,)
    """
    order = np.argsort(gap)
    weight, moment = np.cumsum(area[order]), np.cumsum((area * gap)[order])
    last = np.searchsorted(gap[order] * weight - moment, force_over_modulus, side="left") - 1     # the last one that is pressed
    return (force_over_modulus + moment[last]) / weight[last]


def projected_conjugate_gradients(apply: Callable[[Any], Any], precondition: Callable[[Any], Any], mask: Any, right: Any,
                                  total: Any, settings: ContactSettings) -> Any:
    """x (c, m), zero outside the mask (c, m), with sum x = total (m,) and apply(x) - right constant within the mask."""
    xp = array_namespace(mask)
    right = xp.astype(right, xp.float32)
    along = precondition(mask)
    weight = _dot(along, mask)

    def project(x):
        z = precondition(x)
        return z - along * (_dot(z, mask) / weight)

    x = along * (xp.astype(total, xp.float32) / weight)
    r = right - apply(x)
    z = project(r)
    p, rho = xp.asarray(z, copy=True), _dot(r, z)
    first = xp.clip(xp.maximum(rho, _dot(right, project(right))), min=1e-30)
    for _ in range(settings.inner_iterations):
        if xp.all(rho <= settings.inner_tolerance**2 * first):
            break
        q = apply(p)
        # A column that is solved to the rounding of single precision waits for the others: its p would have no length.
        step = xp.where(rho > _ROUNDING * first, rho / xp.clip(_dot(p, q), min=1e-30), 0.0)
        x += step * p
        before, r = r, r - step * q
        z = project(r)
        turned = xp.clip(_dot(r - before, z), min=0.0)     # Polak and Ribiere's: in single precision r is not quite conjugate to z
        p = z + xp.where(rho > 0, turned / xp.clip(rho, min=1e-30), 0.0) * p
        rho = _dot(r, z)
    return xp.astype(x, xp.float64)


def _dot(a, b):
    return array_namespace(a).sum(a * b, axis=0)


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
