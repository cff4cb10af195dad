"""How large solids are solved: `python benchmarks/solid_iterative.py [--unknowns 1e5 4e5]` (needs pyamg).

The last matrix of the race's first increment (`solid_races`), for several compressibilities. Conjugate gradients to 1e-3 of
the solution's energy norm, the error being that against a solution to round-off, with
  factor      a factor of the whole in single precision
  two levels  `softtact.linalg.two_levels`
  multigrid   pyamg's smoothed aggregation with rigid motions as its near kernel, block Gauss-Seidel, one thread
Writes benchmarks/results/solid_iterative.json.
"""

import argparse
import time
from functools import partial

import numpy as np
import record
import scipy.sparse as sp
import solid_races as races

from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.refined import RefinedSolver
from softtact.linalg.two_levels import TwoLevels
from softtact.linalg.workers import Workers
from softtact.materials.laws.registry import make_law
from softtact.models.solid import blocks
from softtact.models.solid.path import SolidPath

ENOUGH, ROUNDING, MOST = 1e-3, 1e-8, 400
blocks._LARGE, blocks._MOST_BULK = 0, np.inf     # to see where they should lie


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
    for step in range(MOST):
        correction = precondition(rest)
        size = rest @ correction
        way = correction + size / before * way
        pushed = product(way)
        found, rest, before = found + size / (way @ pushed) * way, rest - size / (way @ pushed) * pushed, size
        if exact is None:
            done = np.linalg.norm(rest) <= ROUNDING * np.linalg.norm(right)
        else:     # the energy of what is off is its product with the residual
            done = (exact - found) @ rest <= ENOUGH**2 * (exact @ right)
        if done:
            return found, step + 1
    return found, None


def rigid_motions(points):
    """The six rigid motions (unknowns, 6) of points (n, 3)."""
    x, y, z = (points - points.mean(axis=0)).T
    zero, one = np.zeros_like(x), np.ones_like(x)
    columns = [(one, zero, zero), (zero, one, zero), (zero, zero, one), (zero, -z, y), (z, zero, -x), (-y, x, zero)]
    return np.stack([np.column_stack(column).ravel() for column in columns], axis=1)


def multigrid(upper, points):
    """A V-cycle of pyamg."""
    import pyamg
    sweep = ("block_gauss_seidel", {"sweep": "symmetric"})
    whole = sp.csr_matrix(upper + sp.triu(upper, 1).T).tobsr((3, 3))
    levels = pyamg.smoothed_aggregation_solver(whole, B=rigid_motions(points), strength=("symmetric", {"theta": 0.0}),
                                               max_coarse=1000, coarse_solver="splu", presmoother=sweep, postsmoother=sweep)
    return levels.aspreconditioner(cycle="V").matvec


def row(unknowns, ratio, threads):
    """Seconds to set up and to solve, and steps, of each way for one matrix."""
    body, upper, right = last_system(unknowns, ratio, threads)
    workers, places = Workers(threads), body.points[body.free // 3]
    product = partial(RefinedSolver(places, workers=workers).product, upper)
    lift = blocks.lift_from_corners(body.mesh, body.laws, body.free)

    def factored():
        direct = DissectedSolver(places, workers=workers)
        direct.factor(upper)
        return direct.solve

    def on_two_levels():
        levels = TwoLevels(places, lift, workers=workers)
        levels.factor(upper, product)
        return levels.solve

    exact, _ = solved(product, right, factored())
    found = {"unknowns": len(right), "bulk_over_shear": ratio, "threads": threads}
    for name, make in (("factor", factored), ("two levels", on_two_levels), ("multigrid", partial(multigrid, upper, places[::3]))):
        began = time.perf_counter()
        precondition = make()
        ready = time.perf_counter()
        _, steps = solved(product, right, precondition, exact)
        found[name] = {"set_up_s": ready - began, "solve_s": time.perf_counter() - ready, "steps": steps}
        print(f"{len(right):10,} unknowns, K/mu {ratio:g}, {name}: set up {ready - began:.1f} s, solved in "
              f"{time.perf_counter() - ready:.1f} s, {steps} steps", flush=True)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--unknowns", type=float, nargs="+", default=[1e5])
    parser.add_argument("--ratios", type=float, nargs="+", default=[5, 100, 1000], help="of the bulk modulus to the shear modulus")
    parser.add_argument("--threads", type=int, default=2)
    given = parser.parse_args()
    print(record.write("solid_iterative", rows=[row(n, ratio, given.threads) for n in given.unknowns for ratio in given.ratios]))
