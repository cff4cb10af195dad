"""A box of quadratic tetrahedra that is the same in every run: each cube of a grid in six (Kuhn, 1960)."""

from itertools import permutations

import numpy as np

from softtact.fem.quadratic_nodes import raised
from softtact.fem.solid_mesh import SolidMesh


def tetrahedra_box(size, divisions, region="body"):
    """Mesh of a box from the origin, with the faces x0, x1, y0, y1, z0 and z1."""
    grid = np.stack(np.meshgrid(*[np.arange(n + 1) for n in divisions], indexing="ij"), axis=-1)
    number = np.arange(grid[..., 0].size).reshape(grid.shape[:3])
    cubes = np.stack(np.meshgrid(*[np.arange(n) for n in divisions], indexing="ij"), axis=-1).reshape(-1, 3)
    found = []
    for order in permutations(range(3)):
        corners = [cubes]
        for axis in order:
            corners.append(corners[-1] + np.eye(3, dtype=int)[axis])
        nodes = np.stack([number[tuple(corner.T)] for corner in corners], axis=1)
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        found.append(nodes[:, [0, 2, 1, 3]] if odd else nodes)
    points, (nodes,), _ = raised(grid.reshape(-1, 3) * (np.array(size) / divisions), [("tetra", np.concatenate(found))])
    mesh = SolidMesh(points, ((region, "tetra10", nodes),))
    return mesh.with_faces(**{f"{axis}{end}": lambda x, i=i, end=end: np.abs(x[:, i] - end * size[i]) < 1e-9
                              for i, axis in enumerate("xyz") for end in (0, 1)})
