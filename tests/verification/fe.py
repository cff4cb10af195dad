"""A naive reference solver: meshes of 20-node hexahedra, all unknowns in one sparse matrix, plain Newton's method.

Short rather than fast. It shares the element (`HexBlock`) with the sensor's solver and nothing else: no condensation, no tied
meshes, no pattern kept, no tangent used twice.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from softtact.fem.elements import QUAD8
from softtact.fem.extruded_mesh import Mesh2D, disc_mesh_2d
from softtact.fem.quadrature import gauss
from softtact.fem.solid_block import HexBlock
from softtact.linalg.direct import SuperLUSolver, make_solver


@dataclass(frozen=True)
class Solid:
    """points (n, 3) in mm, hexes (e, 20) and their block."""

    points: np.ndarray
    hexes: np.ndarray
    block: HexBlock

    def energy_and_force(self, displacement):
        """Energy (mJ) and internal nodal forces (n, 3) in N at displacement (n, 3) in mm."""
        state = self.block.evaluate(displacement[self.hexes])
        force = np.zeros_like(self.points)
        np.add.at(force, self.hexes.ravel(), state.force.reshape(-1, 3))
        return state.energy, force

    def stiffness(self, displacement):
        """Tangent (3 n, 3 n) as a sparse matrix in N/mm."""
        return assemble(self.block.tangent(displacement[self.hexes]), self.hexes, len(self.points))


def solid(mesh, law, **options):
    """A `Solid` of one law from a mesh with points and hexes; options go to `HexBlock`."""
    return Solid(mesh.points, mesh.hexes, HexBlock(mesh.points[mesh.hexes], law, **options))


def assemble(matrices, hexes, nodes):
    """Sum of element matrices (e, 60, 60) as a sparse matrix (3 nodes, 3 nodes)."""
    dofs = (3 * hexes[:, :, None] + np.arange(3)).reshape(len(hexes), -1)
    rows, columns = np.repeat(dofs, dofs.shape[1], axis=1), np.tile(dofs, (1, dofs.shape[1]))
    return sp.csr_matrix((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * nodes, 3 * nodes))


def solve_linear(matrix, right):
    """Solution of a symmetric positive definite sparse system; right (n,) or (n, k)."""
    solver = SuperLUSolver() if matrix.shape[0] < 2000 else make_solver()   # small: PARDISO's start costs more
    upper = sp.triu(matrix, format="csr")
    upper.sort_indices()
    if not solver.factor(upper):
        raise ArithmeticError("the reference solver's matrix is not positive definite")
    solution = solver.solve(right)
    solver.close()
    return solution


def small_strain(body, held, prescribed, load=0.0):
    """Displacement (n, 3) of linear elasticity: the tangent at rest. held (n, 3) bool, prescribed (n, 3) mm, load (n, 3) N."""
    matrix = body.stiffness(np.zeros_like(body.points))
    free = np.flatnonzero(~held.ravel())
    displacement = np.where(held, prescribed, 0.0).ravel()
    right = np.broadcast_to(load, body.points.shape).ravel() - matrix @ displacement
    displacement[free] = solve_linear(matrix[free][:, free], right[free])
    return displacement.reshape(-1, 3)


def equilibrium(body, held, prescribed, load=0.0, *, start=None, tolerance=1e-13, iterations=30):
    """Displacement (n, 3) at finite strain by Newton's method with whole steps; tolerance (N) on free nodal forces.

    The first step moves the held nodes from `start` to where they belong, and the free ones along with them linearly.
    """
    free = ~held.ravel()
    displacement = np.zeros_like(body.points) if start is None else start.copy()
    jump = np.where(held, prescribed - displacement, 0.0).ravel()
    for _ in range(iterations):
        residual = (body.energy_and_force(displacement)[1] - load).ravel()
        if np.abs(residual[free]).max() < tolerance and not jump.any():
            return displacement
        matrix = body.stiffness(displacement)[free]
        step = jump.copy()
        step[free] = -solve_linear(matrix[:, free], residual[free] + matrix @ jump)
        displacement, jump = displacement + step.reshape(-1, 3), np.zeros_like(jump)
    raise ArithmeticError(f"no equilibrium after {iterations} iterations; residual {np.abs(residual[free]).max():.1e} N")


def face_load(points, quads, traction):
    """Nodal forces (n, 3) in N of a traction (3,) in MPa on faces (f, 8)."""
    where, weights = gauss(3, 2)
    values, slopes = QUAD8.shape(where)
    edges = np.einsum("fad,gai->fgdi", points[quads], slopes)
    area = np.linalg.norm(np.cross(edges[..., 0], edges[..., 1]), axis=-1) * weights
    load = np.zeros_like(points)
    np.add.at(load, quads.ravel(), (np.einsum("fg,ga->fa", area, values)[..., None] * np.asarray(traction)).reshape(-1, 3))
    return load


def mapped(mesh, function):
    """The mesh with its corner nodes moved by function(points); mid-side nodes stay in the middle, so sides stay straight."""
    points = mesh.points.copy()
    corners = np.unique(mesh.hexes[:, :8])
    points[corners] = function(mesh.points[corners])
    for middle, (a, b) in enumerate(_EDGES, start=8):
        points[mesh.hexes[:, middle]] = 0.5 * (points[mesh.hexes[:, a]] + points[mesh.hexes[:, b]])
    return replace(mesh, points=points)


# Ends of the edges that nodes 8 to 19 of the hexahedron halve.
_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


def fine_disc(parts):
    """Unit disc: each quad of `disc_mesh_2d` cut into parts x parts, its outer nodes put on the circle."""
    side = np.linspace(-1, 1, 2 * parts + 1)
    xi, eta = np.meshgrid(side, side)
    values = QUAD8.shape(np.column_stack([xi.ravel(), eta.ravel()]))[0]
    coarse = disc_mesh_2d()
    patches = np.einsum("pa,qad->qpd", values, coarse.points[coarse.quads[:, :8]])
    outer = np.tile(np.isclose(xi.ravel(), 1.0), (5, 1))
    outer[0] = False                                              # the first quad is the core, the others the ring
    patches[outer] /= np.linalg.norm(patches[outer], axis=1)[:, None]
    number = np.arange(side.size**2).reshape(side.size, -1)
    low, mid, high = slice(0, -1, 2), slice(1, None, 2), slice(2, None, 2)
    cuts = [(low, low), (low, high), (high, high), (high, low), (low, mid), (mid, high), (high, mid), (mid, low)]
    local = np.stack([number[cut].ravel() for cut in cuts], axis=1)
    quads = np.vstack([local + k * number.size for k in range(5)])
    return _merged(patches.reshape(-1, 2), quads)


def _merged(points, quads):
    """A plan mesh without double or unused points, element corners first."""
    _, first, same = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    quads = same.ravel()[quads]
    corners = np.unique(quads[:, :4])
    order = np.concatenate([corners, np.setdiff1d(np.unique(quads), corners)])
    number = np.full(len(first), -1)
    number[order] = np.arange(len(order))
    return Mesh2D(points[first[order]], number[quads], len(corners))
