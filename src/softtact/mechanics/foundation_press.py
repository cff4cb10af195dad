"""A press in the foundation model: the object on the slab, the slab on the frusta, level by level.

Unknown are the object's forces f >= 0 on patches of the cover and the frusta's forces q >= 0:
    gap  = gap0 - depth + E u >= 0,     f gap = 0,  sum f = F
    w    = extension(q),                w <= 0 where q = 0       (w: how far the slab comes down on a frustum)
    u, w = G [E' f; -(q + r)]
Active sets and Newton's method, each step solved directly. Where the contact is large, four points that the object covers whole
share a patch and its uniform pressure, which leaves some hundred unknowns, at 0.1 to 0.4 % of the map (docs/fast_models.md).
Frusta rock: where the sheet moves sideways, one that is hardly pressed leans on the rim of its tip and lifts the sheet:
    extension(q) = w + rise,    see `FrustumLaw.rise`
Three effects of finite displacement that the linear slab lacks follow the deformation from step to step:
- pieces of the slab that rotate carry their membrane forces and the pressure between object and board with them: loads r =
  -div(N grad w) on the frusta, N the integrals over the height of s_xx + s_zz, s_yy + s_zz, s_xy (initial stress; von Karman's
  plate has the first terms). They press the deepest parts deeper and lift the slab beside;
- the top moves sideways, and the object's edges meet other points of it: points at edges move by half as much, because a point
  stands for the middle of what the object covers of its rectangle;
- what moves sideways under a slope meets another height.
Left out: finite strain in sheet and cover, the change of the frusta's lateral stiffness, friction. What each of these effects is
worth stands in docs/fast_models.md.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from softtact.errors import ConvergenceError

_PATIENCE = 8        # iterations, after which loads that swing are followed half of the way only
_SLOWLY = 5.0        # times as exact must what is followed half of the way only have settled
_ABSURD_MM = 1e6     # where an iteration has run away; on its first few points an object may be thought to sink by metres
_FIRST_PATCHES = 30
_LEVEL_MM = 0.02     # range of heights among the points of a patch
_MANY_POINTS = 800   # from which on patches save time; a small contact wants all of its points


@dataclass(frozen=True)
class FoundationSettings:
    """When a level counts as reached.

    tolerance: largest change of a frustum's force in the last step, of the whole force;  gap_mm: overlap that joins a contact
    follow: whether the effects of finite displacement are taken in;  rocking: whether frusta rock
    patches: whether four points share one
    """

    tolerance: float = 2e-5
    gap_mm: float = 1e-6
    max_iterations: int = 60
    follow: bool = True
    rocking: bool = True
    patches: bool = True


@dataclass(frozen=True)
class FoundationLevel:
    """One force level.

    load (n + b,): N at nodes and frusta;  touching (c,): points under pressure
    compression (b,): of frusta in mm, negative where one is lifted;  penetration in mm: of patches as a whole
    """

    force_n: float
    depth: float
    load: np.ndarray
    touching: np.ndarray
    compression: np.ndarray
    penetration: float
    iterations: int


def press_foundation(flexibility, points, forces_n, *, settings=FoundationSettings()):
    """Yield a `FoundationLevel` for each force (N, increasing). Raises ConvergenceError naming the level that was not reached."""
    press = _Press(flexibility, points, settings)
    state, path = press.first(), [(0.0, press.nothing())]
    for force in forces_n:
        if len(path) > 1:
            state.continue_along(path[-2:], force)
        yield press.level(state, float(force))
        path.append((force, (state.q, state.r, state.moved, state.rise)))


class FoundationMaps:
    """Deformation maps in mm of the levels of one press."""

    def __init__(self, flexibility, points):
        self._places = _Places(flexibility, points)

    def __call__(self, levels):
        """Maps (l, ny, nx) of some `FoundationLevel`s, with the held edges."""
        return self._places.maps(np.stack([level.load for level in levels], axis=1))


@dataclass
class _State:
    """Which patches and frusta act; the frusta's forces q and loads r in N; in mm the points' movement sideways (2, c) and the
    frusta's rise (b,)."""

    touching: np.ndarray
    standing: np.ndarray
    q: np.ndarray
    r: np.ndarray
    moved: np.ndarray
    rise: np.ndarray

    def continue_along(self, path, force):
        """Guess the next level on the line through the last two, each (force, (q, r, moved, rise))."""
        (first, before), (second, now) = path
        share = (force - second) / (second - first)
        self.q, self.r, self.moved, self.rise = (b + share * (b - a) for a, b in zip(before, now, strict=True))
        self.q, self.rise = np.maximum(self.q, 0.0), np.maximum(self.rise, 0.0)


class _Press:
    def __init__(self, flexibility, points, settings):
        self.law, self.points, self.settings = flexibility.law, points, settings
        self.step, self.lattice = flexibility.grid.step, flexibility.counts[::-1]
        places = _Places(flexibility, points)
        self.flexibility = places.surface()
        self.frusta = len(places.frusta)
        self.patch = _patches(points, flexibility.grid, settings.patches)
        self.half = np.ones(points.count)
        self.half[points.edge] = 0.5
        if settings.rocking:
            self.roots = places.roots()
        if settings.follow:
            self.membrane, self.sideways = places.membrane(), _Sideways(flexibility, points, places)

    def first(self):
        """Where a press begins: the lowest patches touch."""
        gap = self.patch @ self.points.gap
        return _State(gap <= np.sort(gap)[:_FIRST_PATCHES][-1], np.ones(self.frusta, dtype=bool), *self.nothing())

    def nothing(self):
        """q, r, moved and rise of the unloaded sensor."""
        return np.zeros(self.frusta), np.zeros(self.frusta), np.zeros((2, self.points.count)), np.zeros(self.frusta)

    def level(self, state, force):
        """Newton's method from a state, which is brought up to the level."""
        c = self.patch.shape[0]
        for iteration in range(1, self.settings.max_iterations + 1):
            if iteration <= 2:      # the movement is known well enough after one step; following it on would let points swing
                spread, gap0 = self._contact(state.moved)
                matrix = spread @ np.ascontiguousarray((spread @ self.flexibility).T)
            try:
                f, q, depth = self._solve(matrix, gap0, state, force)
            except sla.LinAlgError:
                break
            if not abs(depth) < _ABSURD_MM:
                break
            forces = np.concatenate([f, q + state.r])
            displacement = (matrix @ forces.astype(np.float32)).astype(float)
            gap, down, load = gap0 - depth + displacement[:c], -displacement[c:], spread.T @ forces
            change = max(self._take(state, q), self._rock(state, load),
                         self._follow(state, load, down, share=1.0 if iteration <= _PATIENCE else 0.5))
            if self._same_sets(state, f, q, gap, down) and change <= self.settings.tolerance * force:
                touched = self.patch.T @ (state.touching * 1.0) > 0
                return FoundationLevel(force_n=force, depth=depth, load=load, touching=touched, iterations=iteration,
                                       compression=down, penetration=float(max(0.0, -gap.min())))
        raise ConvergenceError(f"The foundation model did not reach {force:g} N in {iteration} iterations: its corrections for "
                               "finite displacement run away; ask for smaller forces, or for the hyperelastic model.")

    def _contact(self, moved):
        """Matrix (c + b, n + b) from the slab's displacements to those of patches and, upwards, of frusta; gaps (c,)."""
        points = self.points
        shift = -0.5 * moved[:, points.edge].T / self.step
        at = self.patch @ points.interpolation(points.weights(shift))
        gap0 = self.patch @ (points.gap + (points.slope.T * moved).sum(axis=0) * self.half)
        return sp.block_diag([at, -sp.eye(self.frusta)], format="csr").astype(np.float32), gap0

    def _solve(self, matrix, gap0, state, force):
        """Forces of patches (c,) and frusta (b,), and the depth, of the present active sets with the law's tangent."""
        c, law = len(gap0), self.law
        a, b = np.flatnonzero(state.touching), np.flatnonzero(state.standing)
        rows = np.concatenate([a, c + b])
        system = matrix[np.ix_(rows, rows)]
        slope = law.slope(state.q[b])
        place = np.arange(len(a), len(rows))
        system[place, place] += slope.astype(np.float32)
        by_loads = matrix[rows, c:] @ state.r.astype(np.float32)
        right = np.concatenate([-gap0[a], slope * state.q[b] - law.extension(state.q[b]) + state.rise[b]]) - by_loads
        at_rest, per_depth = _solve_positive(system, np.column_stack([right, np.arange(len(rows)) < len(a)])).T
        depth = (force - at_rest[:len(a)].sum()) / per_depth[:len(a)].sum()
        forces = np.zeros(len(matrix))
        forces[rows] = at_rest + depth * per_depth
        return forces[:c], forces[c:], depth

    @staticmethod
    def _take(state, q):
        """Take over the frusta's forces; the largest change of one in N."""
        pressing = np.maximum(q, 0.0)
        change = float(np.abs(pressing - state.q).max())
        state.q = pressing
        return change

    def _same_sets(self, state, f, q, gap, down):
        """Let patches and frusta join that overlap, and leave that pull; whether none did."""
        small = self.settings.gap_mm
        touching = np.where(state.touching, f >= 0, gap < -small)
        standing = np.where(state.standing, q >= 0, down + state.rise > small)
        same = bool((touching == state.touching).all() and (standing == state.standing).all())
        state.touching, state.standing = touching, standing
        return same

    def _rock(self, state, load):
        """Bring the rise of rocking frusta half of the way up to date, for all of it would swing: a force ends what lifts it.

        Returns what is missing as the largest change of a frustum's force in N, weighed more than others that settle at once.
        """
        if not self.settings.rocking:
            return 0.0
        sideways = np.hypot(*(self.roots @ load.astype(np.float32)).reshape(2, -1))
        missing = self.law.rise(sideways, state.q) - state.rise
        state.rise = state.rise + 0.5 * missing
        return _SLOWLY * float((np.abs(missing) / self.law.slope(state.q)).max())

    def _follow(self, state, load, down, *, share):
        """Bring loads and movement up to date, or go a share of the way; the largest change of a load in N."""
        if not self.settings.follow:
            return 0.0
        load = load.astype(np.float32)
        loads = rotating_loads(down.reshape(self.lattice), (self.membrane @ load).reshape(3, *self.lattice)).ravel()
        change = float(np.abs(loads - state.r).max())
        state.r, state.moved = state.r + share * (loads - state.r), self.sideways(load)
        return change


def _solve_positive(system, right):
    """Solve a positive definite system in single precision, with the residual corrected once."""
    factor = sla.cho_factor(system.T, lower=False, check_finite=False)      # the transpose is in LAPACK's order
    first = sla.cho_solve(factor, right.astype(np.float32), check_finite=False)
    return first + sla.cho_solve(factor, (right - system @ first).astype(np.float32), check_finite=False).astype(float)


def _patches(points, grid, shared):
    """Matrix (patches, c) of the points' shares in patches: four whole points of a square, level with each other, or one alone.

    Squares are counted from the middle, where a row's and a column's points go in pairs, so that a symmetric contact stays so.
    """
    label = np.arange(points.count)
    if shared and points.count > _MANY_POINTS:
        from_middle = [place - size // 2 for place, size in zip(np.divmod(points.nodes, grid.shape[1]), grid.shape, strict=True)]
        pair = [np.sign(place) * ((np.abs(place) + 1) // 2) for place in from_middle]
        full = np.prod([np.where(place == 0, 1, 2) for place in from_middle], axis=0)
        _, square = np.unique(np.stack(pair, axis=1), axis=0, return_inverse=True)
        square = square.ravel()
        whole = np.ones(points.count, dtype=bool)
        whole[points.edge] = False
        count = np.bincount(square, weights=whole)
        low, high = np.full(len(count), np.inf), np.full(len(count), -np.inf)
        np.minimum.at(low, square, points.gap)
        np.maximum.at(high, square, points.gap)
        together = (count[square] == full) & (high - low <= _LEVEL_MM)[square]
        label = np.where(together, points.count + square, label)
    _, label, size = np.unique(label, return_inverse=True, return_counts=True)
    return sp.csr_matrix((1.0 / size[label], (label, np.arange(points.count))))


class _Places:
    """A press' nodes and frusta in the quarter's numbers and signs, and the matrices between them and what a press asks for."""

    def __init__(self, flexibility, points):
        self.flexibility, grid = flexibility, flexibility.grid
        nodes, signs = grid.quarter(points.all_nodes)
        self.frusta, self.frustum_signs = lattice_places(flexibility.counts)
        quarter = (len(grid.x) // 2 + 1) * (len(grid.y) // 2 + 1)
        self.columns = np.concatenate([nodes, quarter + self.frusta])
        self.signs = np.vstack([signs, self.frustum_signs])
        self._map_start = quarter + len(self.frusta) // 4

    def surface(self):
        """Flexibility (n + b, n + b) of nodes and frusta."""
        return self.flexibility.surface.between(self.columns, self.signs, self.columns, self.signs)

    def maps(self, load):
        """Deformation maps (l, ny, nx) in mm under loads (n + b, l), with the held edges."""
        coarse = self.flexibility.grid.every_second
        numbers, signs = coarse.quarter(np.arange(coarse.count))
        rows = self.flexibility.surface.between(self._map_start + numbers, signs, self.columns, self.signs)
        return np.pad((rows @ load.astype(np.float32)).T.reshape(-1, *coarse.shape).astype(float), ((0, 0), (1, 1), (1, 1)))

    def sideways(self, nodes):
        """Movement in x and y (2 k, n + b) of some nodes (k,) of the grid of every second node."""
        numbers, signs = self.flexibility.grid.every_second.quarter(nodes)
        block = self.flexibility.sideways
        quarter = block.blocks.shape[1] // 2
        return np.vstack([block.between(axis * quarter + numbers, signs, self.columns, self.signs)
                          * signs[:, axis:axis + 1].astype(np.float32) for axis in (0, 1)])

    def roots(self):
        """Movement in x and y (2 b, n + b) of all frusta's roots."""
        block = self.flexibility.roots
        quarter = block.blocks.shape[1] // 2
        return np.vstack([block.between(axis * quarter + self.frusta, self.frustum_signs, self.columns, self.signs)
                          * self.frustum_signs[:, axis:axis + 1].astype(np.float32) for axis in (0, 1)])

    def membrane(self):
        """Membrane forces (3 b, n + b) of all cells."""
        block = self.flexibility.membrane
        quarter = block.blocks.shape[1] // 3
        rows = [block.between(k * quarter + self.frusta, self.frustum_signs, self.columns, self.signs) for k in range(3)]
        rows[2] *= self.frustum_signs.prod(axis=1).astype(np.float32)[:, None]
        return np.vstack(rows)


def lattice_places(counts):
    """Of all frusta, x fastest: their numbers in the quarter (b,), from the middle, and signs (b, 2)."""
    i, j = (grid.ravel() for grid in np.meshgrid(*(np.arange(count) for count in counts)))
    half = [count // 2 for count in counts]
    away = [np.where(k >= h, k - h, h - 1 - k) for k, h in zip((i, j), half, strict=True)]
    return away[1] * half[0] + away[0], np.column_stack([np.where(i < half[0], -1, 1), np.where(j < half[1], -1, 1)])


class _Sideways:
    """Movement of the points in x and y, interpolated between the nodes around them of the grid of every second node."""

    def __init__(self, flexibility, points, places):
        grid, coarse = flexibility.grid, flexibility.grid.every_second
        j, i = np.divmod(points.nodes, grid.shape[1])
        at = np.column_stack([i, j]) / 2 - 0.5        # in steps of the coarse grid, whose first node is the grid's second one
        low = np.floor(at).astype(int)
        share = at - low
        corner, weight = [], []
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = low[:, 0] + dx, low[:, 1] + dy
            inside = (x >= 0) & (x < coarse.shape[1]) & (y >= 0) & (y < coarse.shape[0])
            corner.append(np.where(inside, y * coarse.shape[1] + x, 0))
            product = np.where(dx, share[:, 0], 1 - share[:, 0]) * np.where(dy, share[:, 1], 1 - share[:, 1])
            weight.append(np.where(inside, product, 0.0))
        used, place = np.unique(np.stack(corner, axis=1), return_inverse=True)
        rows = np.repeat(np.arange(points.count), 4)
        self._between = sp.csr_matrix((np.stack(weight, axis=1).ravel(), (rows, place.ravel())), shape=(points.count, len(used)))
        self._nodes = places.sideways(used)

    def __call__(self, load):
        """Movement (2, c) in mm under a load (n + b,)."""
        return np.stack([self._between @ part for part in (self._nodes @ load).reshape(2, -1)])


def rotating_loads(down, forces):
    """Loads on the frusta (ny, nx), upwards in N, of membrane forces (3, ny, nx) in N/mm in a slab that has come down by `down`
    (ny, nx) in mm: the gradient of 1/2 sum N_ab w_a w_b over the cells; beyond the lattice the slab is held.

    Slopes w_a are taken over two pitches: the slab, thicker than a pitch, turns as a whole only over such lengths.
    """
    x, y = _centred(down, 1), _centred(down, 0)
    return -_centred(forces[0] * x + forces[2] * y, 1) - _centred(forces[1] * y + forces[2] * x, 0)


def _centred(values, axis):
    """Half the difference of the neighbours along an axis, zero beyond the borders; minus its own transpose."""
    padded = np.moveaxis(np.pad(values, [(1, 1) if k == axis else (0, 0) for k in range(2)]), axis, 0)
    return np.moveaxis(0.5 * (padded[2:] - padded[:-2]), 0, axis)
