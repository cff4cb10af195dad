"""Compliance of linear layers under a rectangle, from one quarter of the body. Side faces are fixed, from the top or from a depth
on, or free.

The body is symmetric in x and y, so a load is the sum of four parts that are even or odd in x and in y. Each needs only the quarter
x > 0, y > 0 with different conditions on the two planes of symmetry: four systems of a quarter of the size, and four blocks of
compliance with a quarter of the entries of the whole matrix.
Parity (p, q): 0 even, 1 odd in x and y. With the blocks G_pq between places i, j of the quarter, and signs s, t of x and y:
    G(i s, j t) = 1/4 sum_pq (s_x t_x)^p (s_y t_y)^q G_pq(i, j)
Elements: 27-node hexahedra with a discontinuous linear pressure (`solid_block`), which do not lock for nearly incompressible
rubber.
Reference: representation of the dihedral group; Healey and Treacy, Int. J. Numer. Meth. Engng 31 (1991) 265.
"""

import copy
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from softtact.compiled import compiled
from softtact.fem.elements import HEX27, dofs_of
from softtact.fem.solid_block import pressure_modes
from softtact.fem.structured_meshes import with_level
from softtact.linalg.dissected_inverse import inverse_between
from softtact.linalg.workers import one_thread_each
from softtact.progress import progress

_SAME_MM = 1e-9
_AT_ONCE = 6_000     # functionals of a parity, whose matrix of these takes 0.3 GB, up to which parities are computed at once
PARITIES = tuple(product((0, 1), repeat=2))
_Found = TypeVar("_Found")


@dataclass(frozen=True)
class LinearLayer:
    """thickness in mm, bulk and shear modulus in MPa; shares: thicknesses of its element layers from below, in sum 1."""

    thickness: float
    bulk_modulus: float
    shear_modulus: float
    shares: tuple = (1.0,)


class QuarterSlab:
    """The quarter x > 0, y > 0 of a stack of layers, from below, on `footprint_mm`.

    cells (nx, ny): elements along the quarter's sides; nodes lie at their corners, mid-sides and centres. base_held: else free.
    held_below_mm: depth below the top from which side faces are held, infinite: they are free; an element layer begins there
    """

    def __init__(self, footprint_mm: Sequence[float], layers: Sequence[LinearLayer], cells: Sequence[int], *,
                 base_held: bool, held_below_mm: float = 0.0) -> None:
        self.layers = _element_layers(layers, held_below_mm)
        self.cells, self.base_held, self.held_below_mm = cells, base_held, held_below_mm
        self.x, self.y = (np.linspace(0.0, 0.5 * side, 2 * count + 1) for side, count in zip(footprint_mm, cells, strict=True))
        self.numbers = np.arange((2 * len(self.layers) + 1) * len(self.y) * len(self.x)).reshape(-1, len(self.y), len(self.x))
        self.hexes = self._hexes()

    @property
    def heights(self) -> np.ndarray:
        """z (2 layers + 1,) in mm of the planes of nodes, 0 at the top."""
        levels = np.concatenate([[0.0], np.cumsum([thickness for _, thickness in self.layers])])
        return np.interp(np.arange(2 * len(levels) - 1) / 2, np.arange(len(levels)), levels - levels[-1])

    @property
    def points(self) -> np.ndarray:
        """Nodes (n, 3) in mm, z = 0 at the top."""
        z, y, x = np.meshgrid(self.heights, self.y, self.x, indexing="ij")
        return np.column_stack([x.ravel(), y.ravel(), z.ravel()])

    @property
    def unknowns(self) -> int:
        """Three for each node."""
        return 3 * self.numbers.size

    def below_top(self, boundary: int) -> np.ndarray:
        """Numbers (ny, nx) of the nodes in the plane over so many element layers that lie below those of the `top`.

        Some may be on sides that are fixed there: their compliance is zero.
        """
        return self.numbers[2 * boundary] if not self.side_held[-1] else self.numbers[2 * boundary, :-1, :-1]

    @property
    def side_held(self) -> np.ndarray:
        """Whether the sides are held (2 layers + 1,) at each plane of nodes."""
        return self.heights <= -self.held_below_mm + _SAME_MM

    def boundary_over(self, layer: LinearLayer) -> int:
        """Number of the boundary over an `LinearLayer` of the stack, for `below_top`."""
        return 1 + max(number for number, (own, _) in enumerate(self.layers) if own is layer)

    @property
    def top(self) -> np.ndarray:
        """Numbers (ny, nx) of the nodes on the top, those on sides that are held left out."""
        return self.below_top(len(self.layers))

    def _hexes(self):
        """Nodes (layers, nx ny, 27) of the elements."""
        k, j, i = np.meshgrid(*(np.arange(n) for n in (len(self.layers), self.cells[1], self.cells[0])), indexing="ij")
        dx, dy, dz = (HEX27.nodes + 1).astype(np.int64).T
        return self.numbers[2 * k[..., None] + dz, 2 * j[..., None] + dy, 2 * i[..., None] + dx].reshape(len(self.layers), -1, 27)

    def _sizes(self, thickness):
        return np.array([self.x[2], self.y[2], thickness])

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """The stiffness (unknowns, unknowns) in N/mm; elements of a layer are all alike, and summed up layer by layer."""
        whole = sp.csr_matrix((self.unknowns, self.unknowns))
        for (layer, thickness), hexes in zip(self.layers, self.hexes, strict=True):
            element = element_stiffness(layer, self._sizes(thickness))
            dofs = dofs_of(hexes).astype(np.int32)
            places = np.repeat(dofs, 81, axis=1).ravel(), np.tile(dofs, (1, 81)).ravel()
            whole = whole + sp.csr_matrix((np.tile(element.ravel(), len(dofs)), places), shape=whole.shape)
        return whole

    def free(self, parity: tuple[int, ...]) -> np.ndarray:
        """Unknowns that are not held at the sides, by the base, or by the parity on the planes of symmetry."""
        free = np.ones((*self.numbers.shape, 3), dtype=bool)
        free[self.side_held, :, -1] = free[self.side_held, -1] = False
        if self.base_held:
            free[0] = False
        for axis, odd in enumerate(parity):
            plane = free[:, :, 0] if axis == 0 else free[:, 0]
            plane[..., [k for k in range(3) if k != axis] if odd else axis] = False
        return np.flatnonzero(free.ravel())

    def interpolation(self, points: np.ndarray) -> sp.csr_matrix:
        """Matrix (p, nodes of a plane) that interpolates at points (p, 2) of the quarter, quadratic in each element."""
        (i, wx), (j, wy) = (_quadratic(line, values) for line, values in zip((self.x, self.y), points.T, strict=True))
        nodes = (j[:, :, None] * len(self.x) + i[:, None, :]).reshape(len(points), 9)
        weights = (wy[:, :, None] * wx[:, None, :]).reshape(len(points), 9)
        return sp.csr_matrix((weights.ravel(), (np.repeat(np.arange(len(points)), 9), nodes.ravel())),
                             shape=(len(points), len(self.x) * len(self.y)))

    def mean_forces(self, cells_of: Callable[[np.ndarray, np.ndarray], np.ndarray], count: int) -> list[sp.csr_matrix]:
        """Membrane forces in N/mm of cells in the x-y plane as functionals of the displacement: three matrices (count, unknowns).

        cells_of(x, y): number of the cell at points of the quarter, -1 where there is none. The forces are the integrals over the
        height, averaged over the cell, of s_xx, s_yy and s_xy.
        """
        points, weights, _ = HEX27.quadrature
        j, i = (grid.ravel() for grid in np.meshgrid(np.arange(self.cells[1]), np.arange(self.cells[0]), indexing="ij"))
        matrices = [sp.csr_matrix((count, self.unknowns)) for _ in range(3)]
        for (layer, thickness), hexes in zip(self.layers, self.hexes, strict=True):
            size = self._sizes(thickness)
            gradients, dofs = HEX27.shape(points)[1] * (2 / size), dofs_of(hexes)
            for point, weight, gradient in zip(points, weights * np.prod(size) / 8, gradients, strict=True):
                owner = cells_of((i + 0.5 + 0.5 * point[0]) * size[0], (j + 0.5 + 0.5 * point[1]) * size[1])
                inside = owner >= 0
                places = np.repeat(owner[inside], 81), dofs[inside].ravel()
                for axis, row in enumerate(_membrane_stress(layer, gradient)):
                    matrices[axis] += sp.csr_matrix((np.tile(weight * row, inside.sum()), places), shape=matrices[axis].shape)
        return matrices

    def compliance(self, stiffness: sp.csr_matrix, kept: np.ndarray, parity: tuple[int, ...], *, threads: int = 1,
                   dtype: type = np.float64) -> np.ndarray:
        """Compliance (k, k) among the unknowns `kept` of a stiffness, in one parity; zero for those that it holds."""
        return self.responses(stiffness, picked(kept, self.unknowns), parity, threads=threads, dtype=dtype)

    def responses(self, stiffness: sp.csr_matrix, functionals: sp.csr_matrix, parity: tuple[int, ...], *, threads: int = 1,
                  dtype: type = np.float64) -> np.ndarray:
        """Values (m, m) of functionals (m, unknowns) of the displacement under their conjugate unit loads, in one parity."""
        free = self.free(parity)
        upper = sp.triu(stiffness, format="csr")[free][:, free]
        upper.sort_indices()
        places = np.repeat(self.points[:, :2], 3, axis=0)[free]
        return inverse_between(upper, functionals[:, free], places, threads=threads, dtype=dtype)


def element_stiffness(layer: LinearLayer, size_mm: np.ndarray) -> np.ndarray:
    """Stiffness (81, 81) in N/mm of a box of sides (3,) in mm: that of a `HexBlock` at rest, which a new user would have to wait
    for until it is compiled.

    The shear modulus resists the strain's deviator at each point, the bulk modulus the volume change projected on linear functions.
    """
    points, weights, _ = HEX27.quadrature
    gradients, volumes = HEX27.shape(points)[1] * (2 / size_mm), weights * np.prod(size_mm) / 8
    products = np.einsum("g,gai,gbj->abij", volumes, gradients, gradients, optimize=True)
    shear = (np.einsum("abkk,ij->aibj", products, np.eye(3)) + products.transpose(0, 3, 1, 2)
             - 2 / 3 * products.transpose(0, 2, 1, 3))
    modes = pressure_modes(points)
    changes = np.einsum("g,gp,gai->pai", volumes, modes, gradients, optimize=True).reshape(modes.shape[1], 81)
    volume = changes.T @ np.linalg.solve(np.einsum("g,gp,gq->pq", volumes, modes, modes), changes)
    return layer.shear_modulus * shear.reshape(81, 81) + layer.bulk_modulus * volume


def of_parities(act: Callable[[tuple[int, ...], int], _Found], *, functionals: int, threads: int, label: str) -> Iterator[_Found]:
    """Yield act(parity, threads) for each of `PARITIES`, and report the progress.

    Several parities at once take half the time of the processor that one takes on all threads, and far less on a busy machine,
    where BLAS's threads wait for each other. Those of a large surface are computed in turn, because each takes much memory.
    """
    if threads == 1 or functionals > _AT_ONCE:
        yield from progress((act(parity, threads) for parity in PARITIES), label=label, total=len(PARITIES))
        return
    with one_thread_each(), ThreadPoolExecutor(threads) as pool:
        yield from progress(pool.map(lambda parity: act(parity, 1), PARITIES), label=label, total=len(PARITIES))


def picked(some: np.ndarray, count: int) -> sp.csr_matrix:
    """The functionals (k, count) that select unknowns (k,) by their numbers."""
    return sp.csr_matrix((np.ones(len(some)), some, np.arange(len(some) + 1)), shape=(len(some), count))


def _element_layers(layers, held_below_mm):
    """Element layers from below with their thickness [(layer, mm)], one of them beginning where side faces begin to be held."""
    out, top = [], 0.0
    for layer in reversed(layers):
        levels = top - layer.thickness + layer.thickness * np.concatenate([[0.0], np.cumsum(layer.shares)])
        out = [(layer, thickness) for thickness in np.diff(with_level(levels, -held_below_mm))] + out
        top -= layer.thickness
    return out


def _membrane_stress(layer, gradient):
    """Rows (3, 81) that give s_xx, s_yy, s_xy from an element's displacement, of gradients (27, 3)."""
    mu, lam = layer.shear_modulus, layer.bulk_modulus - 2 / 3 * layer.shear_modulus
    first, second, shear = lam * gradient, lam * gradient, np.zeros_like(gradient)
    for row, axis in ((first, 0), (second, 1)):
        row[:, axis] += 2 * mu * gradient[:, axis]
    shear[:, 0], shear[:, 1] = mu * gradient[:, 1], mu * gradient[:, 0]
    return first.ravel(), second.ravel(), shear.ravel()


def _quadratic(line, values):
    """Nodes (p, 3) and weights (p, 3) of quadratic interpolation in elements of three nodes on a line of equal steps."""
    width = line[2]
    element = np.clip((values / width).astype(np.int64), 0, len(line) // 2 - 1)
    t = 2 * (values / width - element) - 1
    return 2 * element[:, None] + np.arange(3), np.column_stack([0.5 * t * (t - 1), 1 - t * t, 0.5 * t * (t + 1)])


@dataclass(frozen=True)
class ParityBlocks:
    """Compliance between places on a rectangle, by the parity of load and displacement: blocks (4, k, m), in PARITIES' order."""

    blocks: np.ndarray

    def between(self, rows: np.ndarray, row_signs: np.ndarray, columns: np.ndarray, column_signs: np.ndarray) -> np.ndarray:
        """Compliance (r, c) of places given by their quarter's number (r,), (c,) and their signs of x and y (r, 2), (c, 2)."""
        args = [np.ascontiguousarray(values) for values in (rows, row_signs < 0, columns, column_signs < 0)]
        return _between(self.blocks, *args)

    def fields(self, shape: tuple[int, int], columns: np.ndarray, column_signs: np.ndarray, loads: np.ndarray, *,
               every: int = 1) -> np.ndarray:
        """Displacements (l, 2 ny - 1, 2 nx - 1) over the whole rectangle under loads (c, l) at places as for `between`,
        all different.

        shape: (rows, columns) of the quarter's nodes, whose numbers are those of the blocks' first places
        every: stride along x and y among these nodes, starting at the middle: ny along y and nx along x

        Computed parity by parity, without the rectangle's matrix, which is four times as large as the quarter's blocks.
        """
        (ny, nx), first = shape, int(columns.min(initial=self.blocks.shape[2]))
        width = max(int(columns.max(initial=0)) + 1 - first, 0)
        of_parity = np.zeros((len(PARITIES), width, loads.shape[1]), dtype=self.blocks.dtype)
        for sign in product((1, -1), repeat=2):     # the places of one image differ from each other
            image = np.flatnonzero((column_signs == sign).all(axis=1))
            load = loads[image].astype(self.blocks.dtype)
            for total, (p, q) in zip(of_parity, PARITIES, strict=True):
                total[columns[image] - first] += sign[0]**p * sign[1]**q * load
        rows = self.blocks[:, :ny * nx, first:first + width].reshape(len(PARITIES), ny, nx, width)[:, ::every, ::every]
        ee, eo, oe, oo = 0.25 * (rows @ of_parity[:, None])
        even, odd = (np.concatenate([(a - b)[:, :0:-1], a + b], axis=1) for a, b in ((ee, oe), (eo, oo)))
        return np.moveaxis(np.concatenate([(even - odd)[:0:-1], even + odd]), -1, 0)


class ParityProduct:
    """The compliance G (r, c) between places as a factor, G @ loads and forces @ G, without the matrix.

    Places that differ by their signs alone share a row or column of the blocks, so a product reads a quarter of G's entries where
    the places lie on all sides of the middle, and as many in all other cases.
    """

    __array_ufunc__ = None     # so that `forces @ G` comes here

    def __init__(self, blocks: ParityBlocks, rows: "SignedPlaces", columns: "SignedPlaces") -> None:
        (used_rows, self._rows), (used_columns, self._columns) = (one.folding(blocks.blocks.dtype) for one in (rows, columns))
        self._of_rows, self._of_columns = self._rows.T.tocsr(), self._columns.T.tocsr()
        self._blocks = np.stack([block[used_rows[:, None], used_columns] for block in blocks.blocks])     # as BLAS asks for

    def __matmul__(self, loads: np.ndarray) -> np.ndarray:
        """Displacements (r,) or (r, l) under loads (c,) or (c, l)."""
        return self._of_rows @ _by_parity(self._blocks, self._columns @ loads)

    def __rmatmul__(self, forces: np.ndarray) -> np.ndarray:
        """Displacements (c,) or (l, c) under the conjugate forces (r,) or (l, r)."""
        return (self._of_columns @ _by_parity(self._blocks.transpose(0, 2, 1), self._rows @ forces.T)).T

    def astype(self, dtype: type) -> "ParityProduct":
        """The same with blocks of another precision."""
        other = copy.copy(self)
        other._blocks = self._blocks.astype(dtype)
        return other


@dataclass(frozen=True)
class SignedPlaces:
    """Places on the rectangle: numbers (n,) in the quarter, signs (n, 2) of x and y, and factors (n,) of what is measured there."""

    numbers: np.ndarray
    signs: np.ndarray
    factors: np.ndarray | float = 1.0

    def folding(self, dtype: np.dtype) -> tuple[np.ndarray, sp.csr_matrix]:
        """The numbers (u,) that occur, and the matrix (4 u, n) from loads at the places to those of these numbers by parity."""
        used, place = np.unique(self.numbers, return_inverse=True)
        signs, numbers = np.where(self.signs < 0, -1.0, 1.0), np.arange(len(place))
        weights = [0.5 * self.factors * signs[:, 0]**p * signs[:, 1]**q for p, q in PARITIES]     # the other side has a half, too
        rows = [number * len(used) + place for number in range(len(PARITIES))]
        return used, sp.csr_matrix((np.concatenate(weights).astype(dtype), (np.concatenate(rows), np.tile(numbers, len(PARITIES)))),
                                   shape=(len(PARITIES) * len(used), len(place)))


def _by_parity(blocks, folded):
    """Products (4 r,) or (4 r, l) of blocks (4, r, u) with loads (4 u,) or (4 u, l)."""
    columns = folded.reshape(len(blocks), blocks.shape[2], *folded.shape[1:])
    return np.concatenate([block @ column for block, column in zip(blocks, columns, strict=True)])


@compiled
def _between(blocks, rows, row_negative, columns, column_negative):
    out, before, first, last = np.empty((len(rows), len(columns)), dtype=blocks.dtype), -1, blocks.shape[2], 0
    for b in range(len(columns)):
        first, last = min(first, columns[b]), max(last, columns[b] + 1)
    count = max(last - first, 0)
    images, place = np.empty(4 * count, dtype=blocks.dtype), np.empty((4, len(columns)), dtype=np.uint32)
    for own in range(4):
        for b in range(len(columns)):
            place[own, b] = (own ^ (2 * column_negative[b, 0] + column_negative[b, 1])) * count + columns[b] - first
    for a in np.argsort(rows):     # a place and its mirror images share what is read of the blocks
        if rows[a] != before:
            before = rows[a]
            _sum_up(images, blocks[:, before, first:last])
        own = 2 * row_negative[a, 0] + row_negative[a, 1]
        for b in range(len(columns)):
            out[a, b] = images[place[own, b]]
    return out


@compiled(inline="always")
def _sum_up(images, of_parity):
    """The compliance (4 m,) at places and their images along y, along x and both, from that of each parity (4, m)."""
    count, quarter = of_parity.shape[1], of_parity.dtype.type(0.25)
    for j in range(count):
        even, odd = of_parity[0, j] + of_parity[1, j], of_parity[0, j] - of_parity[1, j]
        along_x, both = of_parity[2, j], of_parity[3, j]
        images[j], images[count + j] = (even + along_x + both) * quarter, (odd + along_x - both) * quarter
        images[2 * count + j], images[3 * count + j] = (even - along_x - both) * quarter, (odd - along_x + both) * quarter
