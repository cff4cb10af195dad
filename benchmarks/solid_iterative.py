"""Would a solver without a factor serve large solids? `python benchmarks/solid_iterative.py --unknowns 1e5 4e5` (needs pyamg).

The last matrix of the race's first increment (`solid_races`), and of the same press with a nearly incompressible rubber. Conjugate
gradients to 1e-3 of the solution's energy norm, the error being that against a solution to round-off, with
  factor      a factor in single precision, as the presses take it
  two levels  three Chebyshev steps on the quadratic nodes before and after a factor on the corners alone
  multigrid   pyamg's smoothed aggregation with rigid motions as its near kernel, block Gauss-Seidel
Writes benchmarks/results/solid_iterative.json.
"""

import argparse
import resource
import time

import numpy as np
import record
import scipy.sparse as sp
import solid_races as races

from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.refined import RefinedSolver
from softtact.linalg.workers import Workers
from softtact.materials.laws.registry import make_law
from softtact.models.solid.path import SolidPath

ENOUGH, MOST = 1e-3, 400
EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))     # of a tetrahedron, in the order of its nodes 4 to 9


def last_system(unknowns, ratio, threads):
    """The body, and the last matrix (upper triangle) and right-hand side of the race's first increment."""
    races.LAW = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=ratio)
    body, kept = races.make_body(races.make_mesh(unknowns), threads), {}
    inner = body.solver.solve

    def keeping(upper, right, **how):
        kept.update(upper=upper, right=right[:, 0].copy())
        return inner(upper, right, **how)

    body.solver.solve = keeping
    list(SolidPath(body, {"top": races.motion(1)}).run())
    body.solver.close()
    return body, kept["upper"].copy(), kept["right"]


def solved(product, right, precondition, exact=None):
    """(solution, steps) by conjugate gradients; to 1e-3 of the exact solution's energy norm, without one to round-off."""
    found, rest, way, before = np.zeros_like(right), right.copy(), np.zeros_like(right), 1.0
    scale = None if exact is None else np.sqrt(exact @ product(exact))
    for step in range(MOST):
        correction = precondition(rest)
        size = rest @ correction
        way = correction + size / before * way
        pushed = product(way)
        found, rest, before = found + size / (way @ pushed) * way, rest - size / (way @ pushed) * pushed, size
        off = np.linalg.norm(rest) / np.linalg.norm(right) / 1e-8 if exact is None else (
            np.sqrt(abs((found - exact) @ product(found - exact))) / scale / ENOUGH)
        if off < 1:
            return found, step + 1
    return found, None


class TwoLevels:
    """A V-cycle: Chebyshev's polynomial of the nodes' own blocks, then a factor of the matrix on the corners, then Chebyshev's."""

    def __init__(self, body, whole, product, workers, *, degree=3):
        self.product, self.degree = product, degree
        self.lift = to_all(body)
        places = np.arange(whole.shape[0])
        blocks = whole[places[:, None] // 3 * 3 + np.arange(3), places[:, None]].toarray().reshape(-1, 3, 3)
        self.own = np.linalg.inv(blocks)
        self.highest = 1.1 * self._highest(len(places))
        coarse = sp.csr_matrix(sp.triu(self.lift.T @ whole @ self.lift))
        coarse.sort_indices()
        coarse.indices, coarse.indptr = coarse.indices.astype(np.int32), coarse.indptr.astype(np.int32)
        corners = np.unique(np.concatenate([nodes[:, :4] for _, _, nodes in body.mesh.cells]))
        free = corners[body.free_components[corners].all(axis=1)]
        self.factor = DissectedSolver(np.repeat(body.points[free], 3, axis=0), workers=workers)
        if not self.factor.factor(coarse):
            raise ArithmeticError("The matrix on the corners is not positive definite.")

    def _scaled(self, force):
        return np.einsum("nij,nj->ni", self.own, force.reshape(-1, 3)).ravel()

    def _highest(self, n):
        x = np.random.default_rng(0).standard_normal(n)
        for _ in range(15):
            x = self._scaled(self.product(x / np.linalg.norm(x)))
        return np.linalg.norm(x)

    def _smoothed(self, x, right):
        """Chebyshev's steps for the upper nine tenths of the spectrum (Saad, section 12.3)."""
        middle, half = 0.55 * self.highest, 0.45 * self.highest
        sigma = middle / half
        rho, step = 1 / sigma, self._scaled(right - self.product(x) if x.any() else right) / middle
        for _ in range(self.degree - 1):
            x = x + step
            after = 1 / (2 * sigma - rho)
            step = after * rho * step + 2 * after / half * self._scaled(right - self.product(x))
            rho = after
        return x + step

    def __call__(self, right):
        x = self._smoothed(np.zeros_like(right), right)
        x = x + self.lift @ self.factor.solve(self.lift.T @ (right - self.product(x)))
        return self._smoothed(x, right)


def to_all(body):
    """Values at all free unknowns from those at the free corners, as a sparse matrix: middles of edges are means."""
    ends = np.column_stack([np.arange(len(body.points))] * 2)
    for _, _, nodes in body.mesh.cells:
        for middle, edge in enumerate(EDGES, 4):
            ends[nodes[:, middle]] = nodes[:, edge]
    corners = np.unique(np.concatenate([nodes[:, :4] for _, _, nodes in body.mesh.cells]))
    free = body.free_components.all(axis=1)
    number = np.full(len(body.points), -1)
    number[corners[free[corners]]] = np.arange(free[corners].sum())
    rows, columns = np.repeat(np.flatnonzero(free), 2), number[ends[free]].ravel()
    there = columns >= 0
    own = np.cumsum(free) - 1
    lift = sp.csr_matrix((np.full(there.sum(), 0.5), (own[rows[there]], columns[there])), shape=(free.sum(), number.max() + 1))
    return sp.csr_matrix(sp.kron(lift, sp.identity(3)))


def rigid_motions(points):
    """The six rigid motions (unknowns, 6) of points (n, 3)."""
    x, y, z = (points - points.mean(axis=0)).T
    zero, one = np.zeros_like(x), np.ones_like(x)
    columns = [(one, zero, zero), (zero, one, zero), (zero, zero, one), (zero, -z, y), (z, zero, -x), (-y, x, zero)]
    return np.stack([np.column_stack(column).ravel() for column in columns], axis=1)


def multigrid(whole, points):
    """A V-cycle of pyamg."""
    import pyamg
    levels = pyamg.smoothed_aggregation_solver(
        whole.tobsr((3, 3)), B=rigid_motions(points), strength=("symmetric", {"theta": 0.0}), max_coarse=1000,
        presmoother=("block_gauss_seidel", {"sweep": "symmetric"}), postsmoother=("block_gauss_seidel", {"sweep": "symmetric"}))
    return levels.aspreconditioner(cycle="V").matvec


def row(unknowns, ratio, threads):
    """Seconds to set up and to solve, and steps, of each way for one matrix."""
    body, upper, right = last_system(unknowns, ratio, threads)
    if not (body.free.reshape(-1, 3) % 3 == [0, 1, 2]).all():
        raise ValueError("This needs bodies whose nodes are free in all directions or in none.")
    workers, points = Workers(threads), body.points[body.free[::3] // 3]
    plain = RefinedSolver(np.repeat(points, 3, axis=0), workers=workers)
    whole = sp.csr_matrix(upper + sp.triu(upper, 1).T)

    def product(x):
        return plain.product(upper, x)

    def factored():
        direct = DissectedSolver(np.repeat(points, 3, axis=0), workers=workers)
        direct.factor(upper)
        return direct.solve

    exact, _ = solved(product, right, factored())
    found = {"unknowns": len(right), "bulk_over_shear": ratio, "threads": threads}
    for name, make in (("factor", factored), ("two levels", lambda: TwoLevels(body, whole, product, workers)),
                       ("multigrid", lambda: multigrid(whole, points))):
        began = time.perf_counter()
        precondition = make()
        ready = time.perf_counter()
        _, steps = solved(product, right, precondition, exact)
        found[name] = {"set_up_s": ready - began, "solve_s": time.perf_counter() - ready, "steps": steps}
        print(f"{len(right):10,} unknowns, K/mu {ratio:g}, {name}: set up {ready - began:.1f} s, solved in "
              f"{time.perf_counter() - ready:.1f} s, {steps} steps", flush=True)
    return found | {"peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--unknowns", type=float, nargs="+", default=[1e5, 4e5])
    parser.add_argument("--ratios", type=float, nargs="+", default=[5, 100], help="of the bulk modulus to the shear modulus")
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    print(record.write("solid_iterative", rows=[row(n, ratio, given.threads) for n in given.unknowns for ratio in given.ratios]))
