"""Contact on simple bodies for the verification: graded lines, undersides of objects, and a slab pressed without frusta."""

from dataclasses import dataclass

import numpy as np

from softtact.contact.penalty import Contact
from softtact.fem.extruded_mesh import SheetMesh2D, grid_mesh_2d, merge, with_centres
from softtact.linalg.direct import make_solver
from softtact.models.hyperelastic.slab import Layer, Slab, SlabMesh

_LOOKED_UP = 10     # steps


def graded(fine, cells, far, count):
    """Lines from 0: `cells` equal cells up to `fine`, then `count` cells growing in a constant ratio up to `far` (mm)."""
    growth = fine * (far / fine) ** (np.arange(1, count + 1) / count)
    return np.concatenate([np.linspace(0, fine, cells + 1), growth])


def mirrored(lines):
    """Lines on both sides of 0."""
    return np.concatenate([-lines[:0:-1], lines])


def paraboloid(radius):
    """Underside of a smooth ball near its tip: heights (n,) and outward normals (n, 3), as `HeightField` gives them."""

    def surface(x, y):
        normals = np.column_stack([x / radius, y / radius, -np.ones_like(x)])
        return (x**2 + y**2) / (2 * radius), normals / np.linalg.norm(normals, axis=1)[:, None]

    return surface


def flat_punch(radius):
    """Underside of a flat cylinder; beside it there is nothing."""

    def surface(x, y):
        heights = np.where(x**2 + y**2 < radius**2, 0.0, 1e3)
        return heights, np.tile([0.0, 0.0, -1.0], (len(x), 1))

    return surface


@dataclass(frozen=True)
class SlabPress:
    """One equilibrium: displacement (n, 3) of the slab's nodes, pressure (p,) in MPa at the top's points, depth, energy."""

    displacement: np.ndarray
    pressure: np.ndarray
    force: float
    depth: float


class HeldSlab:
    """The hyperelastic model's slab alone: its elements and its contact, base held, no frusta, no bordered system."""

    def __init__(self, x, y, z, laws, *, sides, stiffness, smoothing=1e-9):
        """Grid lines x, y, z and a law for each layer of elements: of one law, or of one below and another above."""
        above = next((k for k, law in enumerate(laws) if law is not laws[0]), 1)
        layers = Layer(np.asarray(z)[:above + 1], laws[0]), Layer(np.asarray(z)[above:], laws[-1])
        self.slab = Slab(*layers, SlabMesh(_without_frusta(x, y), x, y), sides=sides,
                         contact=Contact(stiffness=stiffness, smoothing=smoothing))
        self._hold_the_base()
        self.slab.build_pattern(np.zeros(0, dtype=int), [], precision=np.float64)     # whole Newton steps to the last digit

    def _hold_the_base(self):
        slab = self.slab
        free = np.zeros(3 * slab.nodes, dtype=bool)
        free[slab.free] = True
        free.reshape(-1, 3)[slab.bottom] = False
        slab.free = np.flatnonzero(free)

    def press(self, surface, depth, *, tolerance=1e-9, iterations=40):
        """Equilibrium with the object lowered by `depth` mm, by Newton steps; tolerance relative to the force.

        Where the points lie under the object is looked up in the first steps, as in a press: the tangent knows nothing of it.
        """
        slab, displacement = self.slab, np.zeros((self.slab.nodes, 3))
        solver = make_solver()
        for iteration in range(iterations):
            if iteration < _LOOKED_UP:
                planes = slab.project(displacement, surface)
            state = slab.evaluate(displacement, planes, depth)
            residual = state.force.ravel()[slab.free]
            if np.abs(residual).max() < tolerance * abs(state.indentation_force):
                solver.close()
                return SlabPress(displacement, self._pressure(state), state.indentation_force, depth)
            matrix = slab.tangent(state, [])
            if not solver.factor(matrix):
                raise ArithmeticError("the slab's tangent is not positive definite")
            step = np.zeros_like(displacement)
            step.ravel()[slab.free] = solver.solve(residual)
            # From where points are looked up no more, points at an edge may take turns for ever unless some steps are cut.
            share = 1.0 if iteration < _LOOKED_UP else self._share(displacement, step, planes, depth, np.abs(residual).max())
            displacement = displacement - share * step
        raise ArithmeticError(f"no equilibrium after {iterations} iterations")

    def _share(self, displacement, step, planes, depth, before):
        """The first of 1, 1/2, ... of the step after which less is unbalanced."""
        for share in 0.5 ** np.arange(8):
            force = self.slab.evaluate(displacement - share * step, planes, depth).force
            if np.abs(force.ravel()[self.slab.free]).max() < before:
                break
        return share

    def _pressure(self, state):
        c = self.slab.top.contact_of(state)
        depth, stiffness = np.maximum(-state.gaps, 0.0), 1 / (1 / c.stiffness + c.contact_compliance)
        return stiffness * np.where(depth > c.smoothing, depth - c.smoothing / 2, depth**2 / (2 * c.smoothing))


def _without_frusta(x, y):
    """Plan of a sheet on a grid, without cells."""
    grid = grid_mesh_2d(x, y)
    none = np.zeros((0, 4), dtype=int)
    return SheetMesh2D(merge(with_centres(grid.points[grid.quads])), np.zeros((0, 25), dtype=int), 0, (none, np.zeros(3)))


def interpolate(slab, field, points):
    """A nodal field (n, 3) of the top at points (p, 2)."""
    quads, values = slab.underside.locate(points)
    return np.einsum("pa,pad->pd", values, field[slab.top.faces[quads]])
