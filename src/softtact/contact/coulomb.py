"""One increment of a rigid object that presses and drags an elastic surface of known compliance, with Coulomb's exact law.

The unknowns are a normal force p >= 0 and a tangential force q (x, y) at each contact point, both on the surface, p downwards:
    gap  = gap0 - depth + N p + C q >= 0,   p gap = 0            (Signorini)
    slip = T q + C' p - carried                                  the surface's slip on the object within the increment
    |q| <= mu p,   slip = 0 where |q| < mu p,   slip = -l q with l >= 0 where |q| = mu p       (Coulomb)
with the parts N, C, T of the surface's compliance. `carried` is the surface's tangential displacement at the increment's start plus
the object's displacement in the increment: a point that sticks moves with the object. The load history is in `carried` alone.

The normal problem for given q, and the tangential one for given p, are convex; they are solved alternately until both converge
(Panagiotopoulos' process; Kalker's NORM and TANG), with Aitken's relaxation. Each is solved by an active-set method with conjugate
gradients on the set (`unilateral` solves many load steps at once, but only under prescribed forces). `solve_block_by_block` is the
reference method. The tangential problem minimises 1/2 q.T q + b.q subject to |q_i| <= bound_i. In each iteration, points inside
their discs are free, and points on the rim whose force pushes outwards may only turn. Conjugate gradients find the minimum on this
face; forces that leave their disc are projected back on its rim. Where the energy does not decrease, the step is shortened;
the last resort is a projected gradient step, which always decreases it.
References: Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), ch. 4; Panagiotopoulos, Ing.-Arch. 44 (1975) 421;
Jourdan, Alart and Jean, Comput. Methods Appl. Mech. Engng 155 (1998) 31 (block Gauss-Seidel).
Dostal and Kozubek, Optim. Methods Softw. 27 (2012) 1099 (separable round constraints).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from softtact.contact.unilateral import depth_on_springs
from softtact.errors import ConvergenceError

_ON_RIM = 1 - 1e-12     # share of a disc's radius from which a force counts as being on the rim
_SHORTENED = (1.0, 0.5, 0.25)
_ROUNDING = 1e-13     # of an energy, by operators in double precision


def solve_in_discs(compliance: "Operator", linear: np.ndarray, bound: np.ndarray, q: np.ndarray, *,
                   settings: "CoulombSettings") -> tuple[np.ndarray, np.ndarray, int]:
    """q (c, 2) in N, the displacement T q (c, 2), and the number of products; from a first guess q.

    compliance: T, mm/N, with a `precondition` of residuals (c, 2) or none
    linear (c, 2): b in mm;  bound (c,): radii in N, 0 where there is no contact
    """
    diagonal = compliance.diagonal.max(axis=1, keepdims=True)
    q, products = into_discs(q, bound), 1
    moved, safe = compliance @ q, None
    for _ in range(settings.max_iterations):
        slip = moved + linear
        wrong = diagonal * (q - into_discs(q - slip / diagonal, bound))
        largest = np.abs(wrong).max(initial=0.0)
        if largest <= settings.tolerance_mm:
            break
        face = _Face(q, slip, bound)
        least=max(settings.inner_share * settings.tolerance_mm, settings.inner_fall * largest)
        change, moved_by, used = _on_face(compliance, face, slip, diagonal, settings, least=least)
        products += used
        found, used = _shortened(compliance, linear, bound, q, moved, change, moved_by, face)
        products += used
        if found is None:
            safe = safe or getattr(compliance, "largest_eigenvalue", None) or largest_eigenvalue(compliance, diagonal)
            trial = into_discs(q - slip / (safe * diagonal), bound)
            found, products = (trial, compliance @ trial), products + 1
        q, moved = found
    else:
        raise ConvergenceError(f"An increment of the elastic model did not settle its friction in {settings.max_iterations} sets "
                               "of sliding points; move the object in more steps.")
    return q, moved, products


def into_discs(q: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Each force of q (c, 2) projected on its disc of radius bound (c,)."""
    length = np.linalg.norm(q, axis=1)
    share = np.where(length > bound, bound / np.maximum(length, 1e-300), 1.0)
    return q * share[:, None]


class _Face:
    """The face of the feasible set: points that are free, points on the rim that may only turn, and the multipliers of these."""

    def __init__(self, q, slip, bound):
        length = np.linalg.norm(q, axis=1)
        outwards = -(q * slip).sum(axis=1)
        self.rim = (bound > 0) & (length >= bound * _ON_RIM) & (outwards > 0)
        self.free = (bound > 0) & ~self.rim
        radius = np.where(self.rim, length, 1.0)[:, None]
        self.along = np.where(self.rim[:, None], q[:, ::-1] * [-1, 1] / radius, 0.0)
        self.multiplier = np.where(self.rim[:, None], outwards[:, None] / radius**2, 0.0)

    def project(self, x):
        """The part of x (c, 2) along the admissible directions of the face."""
        return x * self.free[:, None] + self.along * (self.along * x).sum(axis=1, keepdims=True)


def _on_face(compliance, face, slip, diagonal, settings, *, least):
    """The change of q (c, 2) that minimises the energy on a face, T times it, and the number of products."""
    change, moved_by, products = np.zeros_like(slip), np.zeros_like(slip), 0
    residual = -face.project(slip)
    scale = 1 / (diagonal + face.multiplier)
    precondition = _preconditioner(compliance, scale, diagonal)
    direction = z = face.project(precondition(residual))
    rho = (residual * z).sum()
    while np.abs(residual).max(initial=0.0) > least and products < settings.inner_iterations:
        moved = compliance @ direction
        products += 1
        curved = face.project(moved + face.multiplier * direction)
        step = rho / (direction * curved).sum()
        change, moved_by = change + step * direction, moved_by + step * moved
        residual = residual - step * curved
        z = face.project(precondition(residual))
        before, rho = rho, (residual * z).sum()
        direction = z + rho / before * direction
    return change, moved_by, products


def _preconditioner(compliance, scale, diagonal):
    """About the inverse of the compliance on a face, of residuals (c, 2): its own, or else its diagonal's."""
    own = getattr(compliance, "precondition", None)
    if own is None:
        return lambda residual: scale * residual
    root = np.sqrt(scale * diagonal)      # 1 but for points on the rim, which turn against their force
    return lambda residual: root * own(root * residual)


def _shortened(compliance, linear, bound, q, moved, change, moved_by, face):
    """q and T q after the change, or a part of it, if that lowers the energy, else None; and the number of products."""
    before, products = _energy(q, moved, linear), 0
    rounding = getattr(compliance, "rounding", _ROUNDING)
    for share in _SHORTENED:
        trial = q + share * change
        rim = face.rim
        trial[rim] *= (bound[rim] / np.linalg.norm(trial[rim], axis=1))[:, None]
        trial = into_discs(trial, bound)
        if np.array_equal(trial, q + change):
            return (trial, moved + moved_by), products     # no point left its disc: the quadratic's minimum on the face
        trial_moved, products = compliance @ trial, products + 1
        if _energy(trial, trial_moved, linear) <= before + rounding * abs(before):
            return (trial, trial_moved), products
    return None, products


def _energy(q, moved, linear):
    return 0.5 * (q * moved).sum() + (q * linear).sum()


def largest_eigenvalue(compliance: "Operator", diagonal: np.ndarray, *, iterations: int = 20) -> float:
    """Upper bound of the largest eigenvalue of T scaled by its `diagonal` (c, 1): power iteration with a margin."""
    x = np.sin(np.arange(2 * len(diagonal)) + 1.0).reshape(-1, 2)
    for _ in range(iterations):
        x = (compliance @ (x / np.sqrt(diagonal))) / np.sqrt(diagonal)
        size = np.linalg.norm(x)
        x /= size
    return 1.2 * float(size)


@dataclass(frozen=True)
class CoulombSettings:
    """Tolerance and iteration limits of an increment."""

    tolerance_mm: float = 1e-7
    """Of gaps under pressure, overlaps, and slips of points that stick."""
    max_turns: int = 60
    """Turns of the normal and the tangential problem."""
    max_iterations: int = 100
    """Active sets within each."""
    inner_iterations: int = 400
    """Conjugate gradients on one active set."""
    inner_share: float = 0.1
    """Of the tolerance, to which friction is solved on one set of sliding points, ..."""
    inner_fall: float = 0.01
    """... or of the largest error when that set was found."""


class Operator(Protocol):
    """A linear operator that acts on forces (c, axes) by `@`, such as `DenseBlock`."""

    def __matmul__(self, force: np.ndarray) -> np.ndarray: ...

    @property
    def T(self) -> "Operator": ...

    @property
    def diagonal(self) -> np.ndarray: ...


@dataclass(frozen=True)
class ContactCompliance:
    """Compliance in mm/N among contact points (c,) as operators that act on forces by `@`; the directions are x, y and down."""

    normal: Operator
    """Normal displacements (c, 1) from normal forces (c, 1)."""
    coupling: Operator
    """Normal displacements (c, 1) from tangential forces (c, 2)."""
    tangential: Operator
    """Tangential displacements (c, 2) from tangential forces (c, 2)."""

    @classmethod
    def dense(cls, matrix: np.ndarray) -> "ContactCompliance":
        """From a matrix (c, 3, c, 3): point and direction of the displacement, then point and direction of the force."""
        n, t = [2], [0, 1]
        return cls(*(DenseBlock(matrix[:, rows][:, :, :, columns]) for rows, columns in ((n, n), (n, t), (t, t))))


class DenseBlock:
    """A matrix (c, a, c, b) that acts on forces (c, b)."""

    def __init__(self, matrix: np.ndarray) -> None:
        self._shape, count = (matrix.shape[0], matrix.shape[1]), matrix.shape[0]
        self.matrix = np.ascontiguousarray(matrix.reshape(count * matrix.shape[1], -1))

    def __matmul__(self, force: np.ndarray) -> np.ndarray:
        return (self.matrix @ force.ravel()).reshape(self._shape)

    @property
    def T(self) -> "DenseBlock":
        """The transposed operator."""
        return DenseBlock(self.matrix.T.reshape(self._shape[0], -1, *self._shape))

    @property
    def diagonal(self) -> np.ndarray:
        """Displacement (c, a) of each point per unit force on that point."""
        return np.diag(self.matrix).reshape(self._shape)


@dataclass(frozen=True)
class Increment:
    """Gaps, displacements and loads prescribed for one increment at contact points (c,), or at the points of a grid (ny, nx)."""

    gap: np.ndarray
    """The object's height (c,) in mm over the undeformed surface, at depth 0."""
    carried: np.ndarray
    """(c, 2) in mm, on a grid (2, ny, nx): tangential displacement of a point that sticks."""
    friction: float
    """Coulomb's coefficient; infinite: every touching point sticks."""
    depth: float | None = None
    """Prescribed depth in mm, or None where `load` is prescribed."""
    load: float | None = None
    """Prescribed normal force in N, or None where `depth` is prescribed."""

    def bound(self, normal: np.ndarray) -> np.ndarray:
        """The largest tangential forces (c,) in N at normal forces (c,)."""
        return self.friction * normal if np.isfinite(self.friction) else np.where(normal > 0, np.inf, 0.0)


@dataclass(frozen=True)
class CoulombContact:
    """The contact at an increment's end."""

    normal: np.ndarray
    """p (c,) in N."""
    tangential: np.ndarray
    """q (c, 2) in N, on the surface."""
    depth: float
    """Depth of the object in mm."""
    gap: np.ndarray
    """(c,) in mm; below 0 only by the tolerance."""
    slip: np.ndarray
    """(c, 2) in mm: the surface's slip on the object within the increment; exactly 0 where a point sticks."""
    sticks: np.ndarray
    """(c,): whether a point touches and does not slip."""
    turns: int
    """Turns of the normal and the tangential problem."""
    products: int
    """Total number of products with the compliance."""


def solve_increment(compliance: ContactCompliance, increment: Increment, *, normal: np.ndarray | None = None,
                    tangential: np.ndarray | None = None, settings: CoulombSettings = CoulombSettings()) -> CoulombContact:
    """The contact of an increment, from first guesses `normal` (c,) and `tangential` (c, 2) in N.

    Raises ConvergenceError where the turns do not agree.
    """
    count = len(increment.gap)
    p = _first_guess(compliance, increment) if normal is None or not normal.any() else normal.copy()
    q = np.zeros((count, 2)) if tangential is None else tangential.copy()
    turns, products, raised, relaxation = 0, 0, (compliance.coupling @ q)[:, 0], Relaxation()
    while turns < settings.max_turns:
        turns += 1
        p, depth, deflection, used = _solve_normal(compliance.normal, increment.gap + raised, p, increment, settings)
        products += used
        if not increment.friction:
            q, dragged, raised = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros(count)
            break
        by_pressure = compliance.coupling.T @ p[:, None] - increment.carried
        bound = increment.bound(p)
        q, dragged, used = solve_in_discs(compliance.tangential, by_pressure, bound, q, settings=settings)
        products += used + 2
        change = (compliance.coupling @ q)[:, 0] - raised
        if np.abs(change)[p > 0].max(initial=0.0) <= settings.tolerance_mm:
            raised = raised + change
            break
        raised = raised + relaxation.of(change) * change
    else:
        raise ConvergenceError(f"An increment of the elastic model did not settle pressure and friction in {settings.max_turns} "
                               "turns; move the object in more steps.")
    slip = compliance.coupling.T @ p[:, None] + dragged - increment.carried
    sticks = _sticking(q - slip / compliance.tangential.diagonal.max(axis=1, keepdims=True), increment.bound(p))
    slip[sticks] = 0.0
    return CoulombContact(p, q, depth, increment.gap + raised + deflection - depth, slip, sticks, turns, products + 2)


class Relaxation:
    """Aitken's relaxation factor: with high friction full changes oscillate with growing amplitude.
    Kuettler and Wall, Comput. Mech. 43 (2008) 61.
    """

    _LEAST, _MOST = 0.02, 1.0

    def __init__(self):
        self._share, self._last = self._MOST, None

    def of(self, change: np.ndarray) -> float:
        """The relaxation factor for this turn's change (c,)."""
        if self._last is not None:
            turned = change - self._last
            aitken = -self._share * (self._last @ turned) / max(turned @ turned, 1e-300)
            self._share = min(max(abs(aitken), self._LEAST), self._MOST)
        self._last = change
        return self._share


def _sticking(pulled, bound):
    """Which points stick: those whose trial forces (c, 2), corrected by the slip, lie within their discs; |q| alone is rounded."""
    return (bound > 0) & (np.linalg.norm(pulled, axis=1) <= bound)


def _first_guess(compliance, increment):
    """Forces of independent springs whose stiffnesses are the inverse diagonal of the compliance."""
    lowest = increment.gap.min()
    if increment.load is None:
        return np.clip(increment.depth - increment.gap, 0.0, None) / compliance.normal.diagonal[:, 0]
    spring = 1 / compliance.normal.diagonal[:, 0]
    depth = lowest + depth_on_springs(increment.gap - lowest, spring, increment.load)
    return np.clip(depth - increment.gap, 0.0, None) * spring


def _solve_normal(compliance, gap, p, increment, settings):
    """Forces p (c,), depth, deflections (c,) under p, and the number of products; gap (c,): at depth 0 without p."""
    active, products, depth = p > 0, 0, increment.depth
    for _ in range(settings.max_iterations):
        if increment.load is not None and not active.any():
            active = gap <= gap.min()
        p = np.where(active, p, 0.0)
        if increment.load is not None:
            p[active] += (increment.load - p.sum()) / active.sum()
        deflection = (compliance @ p[:, None])[:, 0]
        p, deflection, used = _on_active_set(compliance, gap, p, deflection, active, increment.depth, settings)
        products += used + 1
        open_by = gap + deflection
        if increment.load is not None:
            depth = open_by[active].mean()
        joining, leaving = ~active & (open_by - depth < -settings.tolerance_mm), active & (p < 0)
        if not joining.any() and not leaving.any():
            return p, float(depth), deflection, products
        active = (active | joining) & ~leaving
    raise ConvergenceError(f"An increment of the elastic model did not settle its contact in {settings.max_iterations} active "
                           "sets; move the object in more steps.")


def _on_active_set(compliance, gap, p, deflection, active, depth, settings):
    """Conjugate gradients for gap + N p = depth on the active set; the sum of p is kept where the depth is not prescribed."""
    if not active.any():
        return p, deflection, 0
    scale = np.where(active, 1 / compliance.diagonal[:, 0], 0.0)

    def project(residual):
        return residual - (scale @ residual) / scale.sum() * active if depth is None else residual

    def reduced(p, deflection):
        lacking = np.where(active, (0.0 if depth is None else depth) - gap - deflection, 0.0)
        return project(lacking)

    residual = reduced(p, deflection)
    direction = z = scale * residual
    rho, products = residual @ z, 0
    while np.abs(residual).max() > 0.1 * settings.tolerance_mm and products < settings.inner_iterations:
        moved = (compliance @ direction[:, None])[:, 0]
        step = rho / (direction @ moved)
        p, deflection, products = p + step * direction, deflection + step * moved, products + 1
        residual = project(residual - step * np.where(active, moved, 0.0))
        z = scale * residual
        before, rho = rho, residual @ z
        direction = z + rho / before * direction
    return p, deflection, products


def solve_block_by_block(matrix: np.ndarray, increment: Increment, *, tolerance_mm: float = 1e-9,
                         max_sweeps: int = 20000) -> CoulombContact:
    """The increment for a matrix (c, 3, c, 3) at a prescribed depth by block Gauss-Seidel; for a few hundred points.

    At each point the normal force is updated first, then the tangential one, which is projected on its disc.
    """
    count = len(increment.gap)
    force, moved = np.zeros((count, 3)), np.zeros((count, 3))
    columns = matrix.reshape(3 * count, count, 3)
    for sweep in range(1, max_sweeps + 1):
        largest = 0.0
        for i in range(count):
            block, before = matrix[i, :, i], force[i].copy()
            gap = increment.gap[i] - increment.depth + moved[i, 2]
            force[i, 2] = max(0.0, force[i, 2] - gap / block[2, 2])
            slip = moved[i, :2] + block[:2, 2] * (force[i, 2] - before[2]) - increment.carried[i]
            force[i, :2] = _in_disc(force[i, :2] - slip / max(block[0, 0], block[1, 1]), increment.friction * force[i, 2])
            change = force[i] - before
            moved += (columns[:, i] @ change).reshape(count, 3)
            largest = max(largest, np.abs(block @ change).max())
        if largest <= tolerance_mm:
            gap = increment.gap - increment.depth + moved[:, 2]
            slip = moved[:, :2] - increment.carried
            diagonal = np.einsum("iaia->ia", matrix[:, :2, :, :2]).max(axis=1, keepdims=True)
            sticks = _sticking(force[:, :2] - slip / diagonal, increment.bound(force[:, 2]))
            return CoulombContact(force[:, 2], force[:, :2], increment.depth,     # type: ignore[arg-type]
                                  gap, slip, sticks, sweep, sweep)
    raise ConvergenceError(f"The plain contact method did not settle in {max_sweeps} sweeps.")


def _in_disc(force, radius):
    length = np.linalg.norm(force)
    return force if length <= radius else force * (radius / length)
