"""The elastic model: one linear layer of tetrahedra, its surface's flexibility, and unilateral contact under force control.

The layer is held at its base and sides. Its vertical surface flexibility (mm/N) is computed once; a press is then a small
quadratic program: find nodal forces f >= 0 with f . gap = 0, gap >= 0 and sum f = F.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import Delaunay

from softtact.errors import ConvergenceError, InputError
from softtact.mechanics.linear_solvers import make_solver


@dataclass(frozen=True)
class Compliance:
    """points (n, 2): the surface's free nodes in mm; flexibility (n, n) in mm/N; area (n,) in mm2 that each stands for."""

    points: np.ndarray
    flexibility: np.ndarray
    area: np.ndarray
    sampling: sp.csr_matrix

    def save(self, path):
        """Write as a compressed NumPy archive."""
        coo = self.sampling.tocoo()
        np.savez(path, points=self.points, flexibility=self.flexibility, area=self.area, rows=coo.row, columns=coo.col,
                 weights=coo.data, shape=np.array(coo.shape))

    @classmethod
    def load(cls, path):
        """Read what `save` wrote."""
        with np.load(path, allow_pickle=False) as data:
            sampling = sp.csr_matrix((data["weights"], (data["rows"], data["columns"])), shape=tuple(data["shape"]))
            return cls(data["points"], data["flexibility"], data["area"], sampling)


def layer_mesh(footprint_mm, thickness_mm, *, edge_length_mm):
    """Tetrahedra of a box with its top at z = 0, by fTetWild: points (n, 3) in mm, tetrahedra (t, 4).

    fTetWild has no seed that fixes its mesh (wildmeshing/fTetWild, issue 72): two calls differ in details. A study makes the
    mesh once and keeps it as a file.
    """
    import pytetwild
    import trimesh

    size = np.array([*footprint_mm, thickness_mm])
    box = trimesh.creation.box(size)
    box.apply_translation([0, 0, -0.5 * thickness_mm])
    diagonal = float(np.linalg.norm(size))
    envelope = 1e-3   # of the diagonal: fTetWild's surface may leave the box's by so much
    points, tets = pytetwild.tetrahedralize(box.vertices, box.faces, edge_length_fac=edge_length_mm / diagonal,
                                            epsilon=envelope, num_threads=1)
    points, tets = _oriented(np.asarray(points, dtype=float), np.asarray(tets, dtype=np.int64))
    return _snapped(points, tets, box.bounds, 1.01 * envelope * diagonal)


def _snapped(points, tets, bounds, tolerance):
    """The mesh with its surface put on the box's planes, which it leaves by up to the tolerance; flattened slivers dropped."""
    faces = np.sort(tets[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    faces, count = np.unique(faces, axis=0, return_counts=True)
    surface = np.unique(faces[count == 1])
    snapped = points.copy()
    for plane in bounds:
        near = np.abs(points[surface] - plane) <= tolerance
        snapped[surface] = np.where(near, plane, snapped[surface])
    corners = snapped[tets]
    on_plane = (corners == bounds[0][None, None]) | (corners == bounds[1][None, None])
    tets = tets[~on_plane.all(axis=1).any(axis=1)]
    if (np.linalg.det(snapped[tets[:, 1:]] - snapped[tets[:, :1]]) <= 0).any():
        raise InputError("models.elastic.mesh.edge_length_mm: the layer's mesh has inverted tetrahedra; choose another length.")
    return snapped, tets


def _oriented(points, tets):
    volume = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])
    tets[volume < 0] = tets[volume < 0][:, [0, 2, 1, 3]]
    return points, tets


def linear_stiffness(points, tets, *, young_mpa, poisson):
    """Stiffness matrix (3 n, 3 n) in N/mm of linear tetrahedra (constant strain, Hooke's law)."""
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    volume = np.linalg.det(edges) / 6
    gradients = np.linalg.inv(edges).transpose(0, 2, 1)                      # rows: grad N_1..3
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    mu = young_mpa / (2 * (1 + poisson))
    lam = young_mpa * poisson / ((1 + poisson) * (1 - 2 * poisson))
    outer = np.einsum("tai,tbj->taibj", gradients, gradients)
    blocks = lam * outer + mu * outer.transpose(0, 1, 4, 3, 2)
    blocks += mu * np.einsum("tak,tbk,ij->taibj", gradients, gradients, np.eye(3))
    blocks *= volume[:, None, None, None, None]
    dofs = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), 12)
    rows, columns = np.repeat(dofs, 12, axis=1), np.tile(dofs, (1, 12))
    size = 3 * len(points)
    return sp.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))


def surface_compliance(points, tets, *, young_mpa, poisson, map_x_mm, map_y_mm, chunk=256):
    """Flexibility of the top surface (z = 0) of a layer held at its base and sides, and the map's sampling of it."""
    tolerance = 1e-6 * np.ptp(points, axis=0).max()
    low, high = points.min(axis=0), points.max(axis=0)
    held = points[:, 2] < low[2] + tolerance
    for axis in (0, 1):
        held |= (points[:, axis] < low[axis] + tolerance) | (points[:, axis] > high[axis] - tolerance)
    top = np.flatnonzero(points[:, 2] > high[2] - tolerance)
    free = np.flatnonzero(np.repeat(~held, 3))
    stiffness = linear_stiffness(points, tets, young_mpa=young_mpa, poisson=poisson)[free][:, free]
    upper = sp.triu(stiffness, format="csr")
    upper.sort_indices()
    solver = make_solver()
    solver.factor(upper)
    loaded = top[~held[top]]
    position = np.searchsorted(free, 3 * loaded + 2)
    flexibility = np.empty((len(loaded), len(loaded)))
    for start in range(0, len(loaded), chunk):
        part = position[start:start + chunk]
        right = np.zeros((len(free), len(part)))
        right[part, np.arange(len(part))] = 1.0
        flexibility[:, start:start + chunk] = solver.solve(right)[position]
    solver.close()
    area, sampling = _surface(points[top, :2], ~held[top], map_x_mm, map_y_mm)
    return Compliance(points[loaded, :2], 0.5 * (flexibility + flexibility.T), area, sampling)


def _surface(xy, free, map_x, map_y):
    """Area of the free top nodes (n,), and the linear interpolation (map points, n) from them."""
    triangulation = Delaunay(xy)
    corners = xy[triangulation.simplices]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.zeros(len(xy))
    np.add.at(area, triangulation.simplices.ravel(), np.repeat(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 6, 3))
    grid = np.stack(np.meshgrid(map_x * (1 - 1e-9), map_y * (1 - 1e-9)), axis=-1).reshape(-1, 2)
    found = triangulation.find_simplex(grid, tol=1e-9)
    transform = triangulation.transform[found]
    first = np.einsum("pij,pj->pi", transform[:, :2], grid - transform[:, 2])
    weights = np.column_stack([first, 1 - first.sum(axis=1)])
    rows = np.repeat(np.arange(len(grid)), 3)
    full = sp.csr_matrix((weights.ravel(), (rows, triangulation.simplices[found].ravel())), shape=(len(grid), len(xy)))
    return area[free], full[:, np.flatnonzero(free)].tocsr()


@dataclass(frozen=True)
class ElasticLevel:
    """One force level: nodal forces (n,) in N, vertical displacement (n,) of the surface in mm, indentation in mm."""

    force_n: float
    nodal_force: np.ndarray
    displacement: np.ndarray
    indentation: float
    iterations: int
    penetration: float


def press_elastic(compliance, gap0, forces_n, *, max_iterations=200):
    """Yield an `ElasticLevel` for each force; gap0 (n,) in mm is the object's height over the nodes at no indentation.

    Active-set method: solve the touching nodes' equations, drop those that pull, add those that penetrate; the set of one
    force starts the next. (Johnson, Contact Mechanics, sec. 5.9.)
    """
    active = gap0 <= gap0.min() + 1e-9
    for force in forces_n:
        level, active = _solve_level(compliance.flexibility, gap0, active, float(force), max_iterations)
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
    """Forces of touching nodes and indentation: flexibility f - indentation = -gap0, sum f = force."""
    solution = np.linalg.solve(flexibility, np.column_stack([np.ones(len(gap0)), gap0]))
    indentation = (force + solution[:, 1].sum()) / solution[:, 0].sum()
    return indentation * solution[:, 0] - solution[:, 1], indentation
