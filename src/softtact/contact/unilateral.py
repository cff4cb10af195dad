"""A rigid object pressed on an elastic surface of known flexibility, all force levels at once.

Unknown are the forces f >= 0 at the contact points:  gap = gap0 - depth + A f >= 0,  f gap = 0,  sum f = F,
with the flexibility A among the points. Primal-dual active sets, that is a semismooth Newton method: points that penetrate join,
points that pull leave. The equations of a set are solved by conjugate gradients on the plane sum f = const, in single precision
with the residual in double (iterative refinement). A product with A for twenty levels takes seven times as long as for one,
which is what makes the levels cheap. Many points that settle together suit this; few and changing ones `active_set`, which is the
plain method and its specification.
References: Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865; Gould, Hribar and Nocedal, SIAM J. Sci. Comput. 23
(2001) 1376 (projected conjugate gradients); Johnson, Contact Mechanics, sec. 5.9.
"""

from dataclasses import dataclass

import numpy as np

from softtact.errors import ConvergenceError

_AS_WIDE = 0.8    # share of the last level's points from which on a level starts with the last level's forces, scaled


@dataclass(frozen=True)
class ContactSettings:
    """tolerance_mm: of gaps under pressure and overlaps;  inner_*: of the conjugate gradients."""

    tolerance_mm: float = 1e-6
    max_iterations: int = 60
    inner_tolerance: float = 1e-2
    inner_iterations: int = 40


@dataclass(frozen=True)
class ContactLevels:
    """Levels l: forces (c, l) in N, depth (l,) in mm, gaps (c, l) in mm, iterations (l,)."""

    force: np.ndarray
    depth: np.ndarray
    gap: np.ndarray
    iterations: np.ndarray

    @property
    def penetration(self):
        """Deepest overlap (l,) in mm."""
        return np.maximum(0.0, -self.gap.min(axis=0))


def press_elastic(flexibility, gap0, forces_n, *, area=None, bedding=1.0, precondition=None, settings=ContactSettings()):
    """`ContactLevels` of points with gaps gap0 (c,) in mm under forces (l,) in N.

    flexibility (c, c): mm/N;  area (c,): in any unit, and bedding: force per area and depth, for a first guess
    precondition: approximate inverse of the flexibility, of (c, l), or None. Raises ConvergenceError naming a level not reached.
    """
    area = np.ones(len(gap0)) if area is None else area
    return _Press(flexibility, gap0, np.asarray(forces_n, dtype=float), precondition, settings).run(area, bedding)


@dataclass
class _State:
    """Forces f (c, l) of all levels, which of them act, depths, gaps, iterations."""

    f: np.ndarray
    active: np.ndarray
    depth: np.ndarray
    gap: np.ndarray
    iterations: np.ndarray


class _Press:
    def __init__(self, flexibility, gap0, forces, precondition, settings):
        self.gap0, self.forces, self.settings = gap0[:, None], forces, settings
        self.double, self.single = flexibility.astype(np.float64), flexibility.astype(np.float32)
        self.precondition = precondition or (lambda x: x)

    def run(self, area, bedding):
        state, last = self._first(area, bedding), len(self.forces) - 1
        self._settle(state, np.array([last]))
        if last:
            self._scale_down(state, last)
            self._settle(state, np.arange(last))
        return ContactLevels(force=state.f, depth=state.depth, gap=state.gap, iterations=state.iterations)

    def _first(self, area, bedding):
        """Forces of springs side by side under the object, as deep as each force asks for."""
        gap = self.gap0[:, 0] - self.gap0.min()
        depth = depth_on_springs(gap, area, self.forces / bedding)
        pressed = np.maximum(0.0, depth - gap[:, None]) * area[:, None]
        return _State(f=pressed * (self.forces / pressed.sum(axis=0)), active=pressed > 0, depth=depth,
                      gap=np.zeros_like(pressed), iterations=np.zeros(len(self.forces), dtype=int))

    def _scale_down(self, state, last):
        """Start the levels below the last one with its forces, scaled, where the contact is about as wide at first guess."""
        like = np.flatnonzero(state.active[:, :last].sum(axis=0) > _AS_WIDE * state.active[:, last].sum())
        state.f[:, like] = state.f[:, [last]] * self.forces[like] / self.forces[last]
        state.active[:, like] = state.active[:, [last]]

    def _settle(self, state, levels):
        for _ in range(self.settings.max_iterations):
            settled = self._evaluate(state, levels)
            levels = levels[~settled]
            if not len(levels):
                return
            self._newton(state, levels)
        raise ConvergenceError(f"The elastic press did not settle its contact at {self.forces[levels[0]]:g} N in "
                               f"{self.settings.max_iterations} iterations.")

    def _evaluate(self, state, levels):
        """Gaps of some levels, with points joined that penetrate and left that pull; which of the levels have settled."""
        tolerance, f, active = self.settings.tolerance_mm, state.f[:, levels], state.active[:, levels]
        free_gap = self.gap0 + self.double @ f
        state.depth[levels] = np.where(active, free_gap, 0.0).sum(axis=0) / active.sum(axis=0)
        gap = free_gap - state.depth[levels]
        joining, pulling = ~active & (gap < -tolerance), active & (f < 0)
        state.gap[:, levels], state.active[:, levels] = gap, (active | joining) & ~pulling
        settled = ~((np.abs(gap) > tolerance) & active | joining | pulling).any(axis=0)
        return settled & (np.abs(f.sum(axis=0) - self.forces[levels]) <= 1e-9 * self.forces[levels])

    def _newton(self, state, levels):
        """One step of the forces of some levels; what acts no more loses its force."""
        active = state.active[:, levels]
        f = np.where(active, state.f[:, levels], 0.0)
        lost = (f - state.f[:, levels]).astype(np.float32)
        right = -state.gap[:, levels] - (self.single @ lost if lost.any() else 0.0)
        mask = active.astype(np.float32)
        f += projected_conjugate_gradients(lambda x: (self.single @ x) * mask, lambda x: self.precondition(x * mask) * mask, mask,
                                           right * mask, self.forces[levels] - f.sum(axis=0), self.settings)
        f += active * ((self.forces[levels] - f.sum(axis=0)) / active.sum(axis=0))     # what single precision lost
        state.f[:, levels] = f
        state.iterations[levels] += 1


def depth_on_springs(gap, area, force_over_bedding):
    """Depth at which springs side by side, under gaps (c,) >= 0 that begin at 0 and of areas (c,), take a force over their bedding.

    force_over_bedding: area times depth, a number or (l,); a first guess for what an object does on a surface.
    """
    order = np.argsort(gap)
    weight, moment = np.cumsum(area[order]), np.cumsum((area * gap)[order])
    last = np.searchsorted(gap[order] * weight - moment, force_over_bedding, side="left") - 1     # the last one that is pressed
    return (force_over_bedding + moment[last]) / weight[last]


def projected_conjugate_gradients(apply, precondition, mask, right, total, settings):
    """x (c, l), zero where mask (c, l) is, with sum x = total (l,) and apply(x) - right constant where it is not."""
    right = right.astype(np.float32)
    along = precondition(mask)
    weight = _dot(along, mask)

    def project(x):
        z = precondition(x)
        return z - along * (_dot(z, mask) / weight)

    x = along * (total.astype(np.float32) / weight)
    r = right - apply(x)
    z = project(r)
    p, rho = z.copy(), _dot(r, z)
    first = np.maximum(np.maximum(rho, _dot(right, project(right))), 1e-30)
    for _ in range(settings.inner_iterations):
        if (rho <= settings.inner_tolerance**2 * first).all():
            break
        q = apply(p)
        step = np.where(rho > 0, rho / np.maximum(_dot(p, q), 1e-30), 0.0)
        x += step * p
        before, r = r, r - step * q
        z = project(r)
        turned = np.maximum(_dot(r - before, z), 0.0)      # Polak and Ribiere's: in single precision r is not quite conjugate to z
        p = z + np.where(rho > 0, turned / np.maximum(rho, 1e-30), 0.0) * p
        rho = _dot(r, z)
    return x.astype(np.float64)


def _dot(a, b):
    return np.einsum("cl,cl->l", a, b)


@dataclass(frozen=True)
class ElasticLevel:
    """One force level: forces (c,) in N, displacement (c,) of the points in mm, indentation in mm."""

    force_n: float
    nodal_force: np.ndarray
    displacement: np.ndarray
    indentation: float
    iterations: int
    penetration: float


def active_set(flexibility, gap0, forces_n, *, max_iterations=200):
    """Yield an `ElasticLevel` for each force: the plain method, level by level, with direct solutions.

    Solve the touching points' equations, drop those that pull, add those that penetrate; the set of one force starts the next.
    """
    active = gap0 <= gap0.min() + 1e-9
    for force in forces_n:
        level, active = _solve_level(flexibility, gap0, active, float(force), max_iterations)
        yield level


def _solve_level(flexibility, gap0, active, force, max_iterations):
    tolerance = 1e-9
    for iteration in range(1, max_iterations + 1):
        nodes = np.flatnonzero(active)
        pressing, indentation = _bordered(flexibility[np.ix_(nodes, nodes)], gap0[nodes], force)
        if (pressing < -tolerance * force).any():
            active[nodes[pressing < 0]] = False
            continue
        displacement = flexibility[:, nodes] @ pressing
        gap = gap0 - indentation + displacement
        entering = (gap < -tolerance) & ~active
        if not entering.any():
            nodal = np.zeros(len(gap0))
            nodal[nodes] = np.maximum(pressing, 0.0)
            return ElasticLevel(force, nodal, displacement, indentation, iteration, float(max(0.0, -gap.min()))), active
        active |= entering
    raise ConvergenceError(f"The elastic press did not settle its contact at {force:g} N in {max_iterations} iterations.")


def _bordered(flexibility, gap0, force):
    """Forces of touching points and indentation: flexibility f - indentation = -gap0, sum f = force."""
    solution = np.linalg.solve(flexibility, np.column_stack([np.ones(len(gap0)), gap0]))
    indentation = (force + solution[:, 1].sum()) / solution[:, 0].sum()
    return indentation * solution[:, 0] - solution[:, 1], indentation
