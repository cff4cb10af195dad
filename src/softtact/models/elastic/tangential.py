"""The elastic layer's whole surface compliance: forces in x, y and z at the top's nodes against their displacements in x, y and z.

`compliance` has z alone; motions that drag the surface aside need all three. By the same quarters and parities
(`quarter_symmetry`): a mirror in x turns the sign of u_x, and one in y that of u_y, so with D(s) = diag(s_x, s_y, 1) for a node
with signs s
    G(i s, j t) = D(s) [ 1/4 sum_pq (s_x t_x)^p (s_y t_y)^q G_pq(i, j) ] D(t)
where G_pq are 3 x 3 between the quarter's nodes. Symmetric, so the lower triangle is kept.
Directions here are x, y and down: a force or displacement into the sensor is positive in the third one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softtact.compiled import compiled
from softtact.contact.node_grid import NodeGrid
from softtact.files import read_arrays
from softtact.models.elastic.compliance import confined_modulus, elastic_slab, surface_grid
from softtact.models.quarter_symmetry import PARITIES, of_parities
from softtact.sensors.specification import AnySpec

_SIGNS = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])                                     # of x and y
_HADAMARD = np.array([[s[0]**p * s[1]**q for s in _SIGNS] for p, q in PARITIES], float)     # (parity, signs)
_QUARTER_HADAMARD = 0.25 * _HADAMARD.T                                                      # its inverse


@dataclass(frozen=True)
class SurfaceCompliance:
    """What the top does under forces in x, y and down, in mm/N."""

    grid: NodeGrid
    """The top's free nodes."""
    triangles: np.ndarray
    """(4, k (k + 1) / 2), single precision: for each parity the lower triangle of the compliance among the k = 3 m unknowns of a
    quarter's m nodes, x, y and down of one node side by side."""
    foundation_modulus: float
    """Pressure per depth in N/mm3 under a wide punch."""

    def save(self, path: Path) -> None:
        """Write as a NumPy archive, in single precision."""
        grid: dict[str, Any] = self.grid.arrays()
        np.savez(path, **grid, triangles=self.triangles, foundation_modulus=self.foundation_modulus)

    @classmethod
    def load(cls, path: Path) -> "SurfaceCompliance":
        """Read what `save` wrote."""
        with read_arrays(path) as data:
            return cls(grid=NodeGrid.of(data), triangles=data["triangles"],
                       foundation_modulus=float(data["foundation_modulus"]))

    def between(self, rows: np.ndarray, columns: np.ndarray, *, row_axes: tuple[int, ...] = (0, 1, 2),
                column_axes: tuple[int, ...] = (0, 1, 2), dtype: type[np.floating] = np.float64) -> "FoldedBlock":
        """Displacements at the grid's nodes `rows` (r,) from forces at nodes `columns` (c,), of some of the directions 0, 1, 2."""
        return FoldedBlock(self, _Folding(self.grid, rows, row_axes), _Folding(self.grid, columns, column_axes), dtype)


class _Folding:
    """Nodes (c,) of a grid with some directions (a,), as places of a quarter (m,) and signs."""

    def __init__(self, grid, nodes, axes):
        places, signs = grid.quarter(np.asarray(nodes))
        quarter, slot = np.unique(places, return_inverse=True)
        self.unknowns = (3 * quarter[:, None] + np.asarray(axes)).ravel()
        self.shape, self.axes = (len(quarter), len(axes)), axes
        self._slot, self._image = slot, (signs[:, 0] < 0) * 2 + (signs[:, 1] < 0)      # of _SIGNS
        self._turned = np.column_stack([signs, np.ones(len(signs), dtype=int)])[:, list(axes)].astype(float)

    def fold(self, values):
        """(4, m a): the parities' parts of values (c, a)."""
        images = np.zeros((4, *self.shape))
        images[self._image, self._slot] = values * self._turned
        return _HADAMARD @ images.reshape(4, -1)

    def unfold(self, parts):
        """Values (c, a) of the parities' parts (4, m a)."""
        images = (_QUARTER_HADAMARD @ parts).reshape(4, *self.shape)
        return images[self._image, self._slot] * self._turned


class FoldedBlock:
    """A part of the compliance as an operator: four dense blocks, one for each parity, among a quarter's nodes.

    An object in the middle of the sensor covers alike nodes of four quarters; then the blocks hold a quarter of the numbers that
    a dense matrix among its nodes would, and never more than four times as many.
    """

    def __init__(self, compliance: SurfaceCompliance, rows: _Folding, columns: _Folding, dtype: type[np.floating]) -> None:
        self._rows, self._columns = rows, columns
        parts = [_part(triangle, rows.unknowns, columns.unknowns) for triangle in compliance.triangles]
        self._blocks = np.stack(parts).astype(dtype)

    def __matmul__(self, force: np.ndarray) -> np.ndarray:
        """Displacements (r, axes) in mm of forces (c, axes) in N."""
        parts = self._columns.fold(force).astype(self._blocks.dtype, copy=False)
        moved = np.stack([block @ part for block, part in zip(self._blocks, parts, strict=True)])
        return self._rows.unfold(moved.astype(float))

    @property
    def diagonal(self) -> np.ndarray:
        """The compliance (c, axes) of each node under its force, where rows and columns are the same nodes and directions."""
        own = np.stack([np.diag(block) for block in self._blocks]).reshape(4, *self._rows.shape).sum(axis=0) / 4
        return own[self._rows._slot].astype(float)

    @property
    def T(self) -> "FoldedBlock":
        """The transposed operator."""
        out = object.__new__(FoldedBlock)
        out._rows, out._columns, out._blocks = self._columns, self._rows, self._blocks.transpose(0, 2, 1)
        return out


@compiled
def _part(triangle, rows, columns):
    """Rows (r,) and columns (c,) of a symmetric matrix that is given by its lower triangle, row by row."""
    out = np.empty((len(rows), len(columns)), dtype=triangle.dtype)
    for a in range(len(rows)):
        i = rows[a]
        for b in range(len(columns)):
            j = columns[b]
            out[a, b] = triangle[i * (i + 1) // 2 + j] if j <= i else triangle[j * (j + 1) // 2 + i]
    return out


def surface_compliance(spec: AnySpec, *, threads: int = 1, cells: tuple[int, int] | None = None) -> SurfaceCompliance:
    """The `SurfaceCompliance` of a sensor's elastic layer.

    cells: elements along a quarter's sides, if not as many as the map asks for
    """
    slab = elastic_slab(spec, cells=cells)
    kept = (3 * slab.top.ravel()[:, None] + np.arange(3)).ravel()
    lower = np.tril_indices(len(kept))
    down = np.tile([1.0, 1.0, -1.0], slab.top.size)        # the mesh's z points out of the sensor
    triangles = np.empty((4, len(lower[0])), dtype=np.float32)
    stiffness = slab.stiffness
    for number, full in enumerate(of_parities(lambda parity, threads: slab.compliance(stiffness, kept, parity, threads=threads),
                                              functionals=len(kept), threads=threads, label="")):
        full *= down[:, None]
        full *= down
        triangles[number] = full[lower]
    return SurfaceCompliance(grid=surface_grid(slab), triangles=triangles,
                             foundation_modulus=confined_modulus(spec.elastic_layer) / spec.thickness_mm)
