"""One increment of a rigid object on a wide layer: `contact.coulomb` on a rectangular grid, with products by Fourier transforms.

Equations and signs are those of `contact.coulomb`; `solve_in_discs` is its own. The normal problem, too, is solved by conjugate
gradients on an active set, but a set is left as soon as its residual has fallen by a power of ten: nodes in tension leave it, nodes
that penetrate join it (Polonsky and Keer, Wear 231 (1999) 206, who change the set in each step). The inverse of the compliance,
cut off at the next neighbours, preconditions both: its symbol grows with the wave number, as the contact's stiffness does.
Both problems alternate, each as exactly as the other one's last change deserves.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from softtact.compiled import compiled
from softtact.contact.coulomb import CoulombSettings, Increment, Relaxation, largest_eigenvalue, solve_in_discs
from softtact.errors import ConvergenceError
from softtact.models.elastic.wide_layer import GridOperator

_FALL = 0.1             # of a residual, before the active set or the other problem gets its turn


@dataclass(frozen=True)
class GridContact:
    """The contact at an increment's end; fields on the grid."""

    normal: np.ndarray
    """(ny, nx) in N, downwards on the surface."""
    tangential: np.ndarray
    """(2, ny, nx) in N, on the surface."""
    depth: float
    """Depth of the object in mm."""
    down: np.ndarray
    """(ny, nx) in mm: the surface's displacement down."""
    by_normal: np.ndarray
    """(2, ny, nx) in mm: its displacement aside by the normal forces."""
    dragged: np.ndarray
    """(2, ny, nx) in mm: its displacement aside by the tangential forces."""
    slip: np.ndarray
    """(2, ny, nx) in mm: within the increment; exactly 0 where a point sticks."""
    sticks: np.ndarray
    """(ny, nx): whether a point touches and does not slip."""
    turns: int
    """Turns of the normal and the tangential problem."""
    products: int
    """Products with the compliance, those of tangential forces counted once."""


class Stencil3:
    """The inverse of a kernel, cut off at the eight neighbours."""

    def __init__(self, operator: GridOperator) -> None:
        ny, nx = operator.padded
        inverse = fft.irfft2(1 / np.maximum(operator.spectrum_of_down.T, 1e-12), s=(ny, nx))
        self._weights = inverse[0, 0], inverse[0, 1], inverse[1, 0], inverse[1, 1]

    def __call__(self, fields: np.ndarray) -> np.ndarray:
        """The product with fields (m, ny, nx), zero beyond the grid."""
        return _stencil3(fields, *self._weights)


@compiled
def _stencil3(fields, middle, along_x, along_y, corner):
    m, ny, nx = fields.shape
    out = np.empty_like(fields)
    for k in range(m):
        for j in range(ny):
            for i in range(nx):
                value = middle * fields[k, j, i]
                if i > 0:
                    value += along_x * fields[k, j, i - 1]
                if i < nx - 1:
                    value += along_x * fields[k, j, i + 1]
                for b in (j - 1, j + 1):
                    if 0 <= b < ny:
                        value += along_y * fields[k, b, i]
                        if i > 0:
                            value += corner * fields[k, b, i - 1]
                        if i < nx - 1:
                            value += corner * fields[k, b, i + 1]
                out[k, j, i] = value
    return out


class _Tangential:
    """The tangential compliance as an operator on forces (c, 2), for `solve_in_discs`."""

    def __init__(self, operator, stencil):
        self._operator, self._stencil = operator, stencil
        self.rounding, self.diagonal = operator.rounding, np.full((operator.shape[0] * operator.shape[1], 2), operator.diagonal[1])
        self._of_normal = operator.diagonal[0] / operator.diagonal[1]

    @property
    def largest_eigenvalue(self):
        """Upper bound of the largest eigenvalue over the diagonal, kept with the operator, which lives longer."""
        if self._operator.largest_aside is None:
            self._operator.largest_aside = largest_eigenvalue(self, self.diagonal[:, :1])
        return self._operator.largest_aside

    def __matmul__(self, force):
        return self._operator.aside_of_aside(_on_grid(force, self._operator.shape)).reshape(2, -1).T

    def precondition(self, residual):
        """About the inverse of the operator, of residuals (c, 2)."""
        return self._of_normal * self._stencil(_on_grid(residual, self._operator.shape)).reshape(2, -1).T


def _on_grid(values, shape):
    return np.ascontiguousarray(values.T).reshape(2, *shape)


class GridSolver:
    """`solve` of increments on one grid of points; what it keeps between calls changes no result."""

    def __init__(self, operator: GridOperator, settings: CoulombSettings) -> None:
        self.operator, self.settings = operator, settings
        self._stencil = Stencil3(operator)
        self._tangential = _Tangential(operator, self._stencil)

    def solve(self, increment: Increment, normal: np.ndarray, tangential: np.ndarray, *, rough: float = 1.0) -> GridContact:
        """The contact of an increment, from first guesses `normal` (ny, nx) and `tangential` (2, ny, nx) in N.

        rough: factor of the settings' tolerance
        Raises ConvergenceError where the problems or their turns do not settle.
        """
        operator, settings, p, q = self.operator, self.settings, normal.copy(), tangential.copy()
        turns, products, relaxation, tolerance = 0, 0, Relaxation(), rough * settings.tolerance_mm
        raised = operator.down_of_aside(q) if q.any() else np.zeros_like(p)
        dragged, by_normal, change_left = np.zeros_like(q), np.zeros_like(q), np.inf
        while turns < settings.max_turns:
            turns += 1
            p, depth, down, used = self._normal(increment, increment.gap + raised, p, tolerance)
            products += used
            by_normal = operator.aside_of_down(p)
            if not increment.friction:
                q, raised = np.zeros_like(q), np.zeros_like(p)
                break
            q, dragged, used = self._aside(increment, by_normal, p, q, tolerance)
            change = operator.down_of_aside(q) - raised
            products += used + 2
            change_left = np.abs(change[p > 0]).max(initial=0.0)
            if change_left <= tolerance:
                raised = raised + change
                break
            raised = raised + relaxation.of(change.ravel()) * change
        else:
            raise ConvergenceError(f"An increment of the elastic model did not settle pressure and friction in "
                                   f"{settings.max_turns} turns; move the object in more steps.")
        slip = by_normal + dragged - increment.carried
        bound = increment.bound(p)
        sticks = (bound > 0) & (np.linalg.norm(q - slip / operator.diagonal[1], axis=0) <= bound)
        slip[:, sticks] = 0.0
        return GridContact(p, q, depth, down + raised, by_normal, dragged, slip, sticks, turns, products)

    def _aside(self, increment, by_normal, p, q, tolerance):
        linear = (by_normal - increment.carried).reshape(2, -1).T
        settings = replace(self.settings, tolerance_mm=tolerance)
        q, dragged, used = solve_in_discs(self._tangential, linear, increment.bound(p).ravel(), q.reshape(2, -1).T,
                                          settings=settings)
        return _on_grid(q, p.shape), _on_grid(dragged, p.shape), used

    def _normal(self, increment, gap, p, tolerance):
        """Forces p (ny, nx), depth, displacement down (ny, nx) by p, and the number of products; gap (ny, nx): at depth 0."""
        load, depth, operator = increment.load, increment.depth, self.operator
        active = p > 0
        if load is not None and not active.any():
            active = gap <= gap.min()
        p = _loaded(p, active, load)
        down, products = operator.down_of_down(p), 1
        for _ in range(self.settings.max_iterations):
            open_by = gap + down
            if load is not None:
                depth = float(open_by[active].mean())
            residual = np.where(active, depth - open_by, 0.0)
            joining = ~active & (open_by - depth < -tolerance)
            largest = np.abs(residual).max(initial=0.0)
            if largest <= tolerance and not joining.any():
                return p, depth, down, products
            if joining.any():
                active = active | joining
                residual = np.where(active, depth - open_by, 0.0)
                largest = np.abs(residual).max()
            p, down, used = self._on_set(p, down, residual, active, load, max(0.3 * tolerance, _FALL * largest))
            products += used
            leaving = active & (p < 0)
            if leaving.any():
                active = active & ~leaving
                p = _loaded(np.where(active, p, 0.0), active, load)
                down, products = operator.down_of_down(p), products + 1
        raise ConvergenceError(f"An increment of the elastic model did not settle its contact in {self.settings.max_iterations} "
                               "active sets; move the object in more steps.")

    def _on_set(self, p, down, residual, active, load, least):
        """Preconditioned conjugate gradients on an active set until no residual is above `least`; sum p is kept under a load."""
        if not active.any():
            return p, down, 0
        ones = active.astype(float)
        even = self._stencil(ones[None])[0] * ones if load is not None else None

        def preconditioned(r):
            z = self._stencil(r[None])[0] * ones
            return z if even is None else z - even * (z.sum() / even.sum())

        def centred(r):
            return r if load is None else (r - r.sum() / ones.sum()) * ones

        residual, products = centred(residual), 0
        direction = z = preconditioned(residual)
        rho = (residual * z).sum()
        while np.abs(residual).max() > least and products < self.settings.inner_iterations:
            moved = self.operator.down_of_down(direction)
            step = rho / (direction * moved).sum()
            p, down, products = p + step * direction, down + step * moved, products + 1
            residual = centred(residual - step * moved * ones)
            z = preconditioned(residual)
            before, rho = rho, (residual * z).sum()
            direction = z + rho / before * direction
        return p, down, products


def _loaded(p, active, load):
    """Forces p on the active set, which do not pull, in proportion scaled to the load where one is given; else even."""
    if load is None:
        return p
    total = p.sum()     # an even change would let the weakest pull
    return p * (load / total) if total > 0 else active * (load / active.sum())
