"""A block of elements of one material: energy, internal force and tangent at finite strain.

The volumetric energy (K - k)/2 (J-1)^2 sees J only through its projection on some functions in each element: linear ones
(four modes: discontinuous linear pressure), or trilinear ones (eight). The pressure needs no unknown of its own, and the tangent
stays symmetric (Sussman and Bathe, Computers & Structures 26 (1987) 357). With linear functions the element does not lock
for any bulk modulus (Q2/P-1 is stable); trilinear ones do not pass that test, and are 1 to 3 % stiffer at K = 20 mu.

Volume changes that the functions do not see have no stiffness but the shear's. Where the pressure is several mu that is too
little: elements collapse to J = 0.1, where no further step converges. Frusta under sharp or deep objects are pressed so far.
Two terms hold them:
* k/4 (J^2 - 1 - 2 ln J) sees J at every point; alone it would be a material of Poisson's ratio 0.38 with k = 4 mu, far from
  locking.
* q/4 (J - its projection)^4 is nothing for small deviations, which are an element's error, and stops large ones: an element
  that gives way settles beside where it was, where without it it would collapse.
What both cost and save: docs/notebook/2026-11-23-folding-frusta.md.

Frusta want full quadrature (27 points): with 8 points they soften by spurious modes once they fold (13 % more compression
at 0.4 MPa) and Newton's method stalls.
"""

import copy
from dataclasses import dataclass

import numpy as np

from softtact.fem import kernels
from softtact.fem.elements import gauss, hex20, hex27, reference_gradients, wedge18, wedge_rule
from softtact.linalg.workers import SERIAL, slices, unique_rows
from softtact.materials.laws.stretches import stretch_range

_AT_ONCE = 400   # elements whose fields at the points are in memory at once, mostly in the processor's cache


@dataclass(frozen=True)
class BlockState:
    """What one evaluation leaves: the elements' energies (e,) in mJ, force (e, 3 m) in N, and displacement."""

    energies: np.ndarray
    force: np.ndarray
    displacement: np.ndarray

    @property
    def energy(self):
        """Energy of all elements in mJ."""
        return float(self.energies.sum())


@dataclass(frozen=True)
class Volumetric:
    """Energies (e,) in mJ of volume changes, pressure (e, g) by which they change with J, in MPa, and the second derivative (e, g)
    of their growing part by what the projection does not see, in MPa; (0, 0) where there is none.
    """

    energies: np.ndarray
    pressure: np.ndarray
    growing: np.ndarray


class SolidBlock:
    """Elements of one kind and one law, by their shape functions' gradients.

    gradients (u, g, m, 3) in 1/mm, kept as (u, g, 3, m), and volumes (u, g) in mm3 of the shapes that occur; shapes (e,): which is
    an element's, by default each its own; points (g, 3) of the quadrature in parent coordinates; unprojected_penalty_ratio: k / mu;
    quartic_penalty_ratio: q / mu; trilinear: project on trilinear instead of linear functions. Displacements come per element
    (e, m, 3) in mm. loops: what sums over points and nodes, `kernels` or `device_kernels`.
    """

    loops = kernels

    def __init__(self, gradients, volumes, points, law, *, shapes=None, unprojected_penalty_ratio=0.0, quartic_penalty_ratio=0.0,
                 trilinear=False):
        self.law, self._local_over_shear, self._quartic_penalty_ratio = law, unprojected_penalty_ratio, quartic_penalty_ratio
        self.gradients, self.volumes = np.ascontiguousarray(gradients.transpose(0, 1, 3, 2)), np.ascontiguousarray(volumes)
        self.shapes = np.arange(len(gradients)) if shapes is None else shapes
        self.basis = _pressure_modes(points, trilinear)
        gram = np.einsum("eg,gp,gq->epq", self.volumes, self.basis, self.basis, optimize=True)
        self.gram_inverse = np.linalg.inv(gram)

    @property
    def local_modulus(self):
        """k in MPa."""
        return min(self._local_over_shear * self.law.mu0, self.law.bulk_modulus)

    @property
    def growing_modulus(self):
        """q in MPa."""
        return self._quartic_penalty_ratio * self.law.mu0

    @property
    def projected_modulus(self):
        """K - k in MPa."""
        return self.law.bulk_modulus - self.local_modulus

    def evaluate(self, displacement, elements=slice(None), *, workers=SERIAL):
        """Energies and internal forces of the chosen elements; None if one is turned inside out (J <= 0 at a quadrature point)."""
        shapes = self.shapes[elements]
        parts = workers.map(lambda part: self._evaluate(displacement[part], shapes[part]), slices(len(shapes), _AT_ONCE))
        if any(part is None for part in parts):
            return None
        energies, forces = zip(*parts, strict=True)
        return BlockState(energies=np.concatenate(energies), force=np.concatenate(forces), displacement=displacement)

    def _evaluate(self, displacement, shapes):
        F, C, J = self.loops.deformation(displacement, self.gradients, shapes)
        if not J.min() > 0:
            return None
        response = self.law.isochoric(C, tangent=False)
        volumetric = self._volumetric(J, shapes)
        energies = (self.volumes[shapes] * response.energy.reshape(J.shape)).sum(axis=1) + volumetric.energies
        return energies, self.loops.internal_force(F, C, J, self.gradients, self.volumes, shapes, response.stress,
                                                 volumetric.pressure)

    def tangent(self, displacement, elements=slice(None), *, precision=np.float64):
        """Tangent (e, 3 m, 3 m) in N/mm of the chosen elements, whose displacement (e, m, 3) is given.

        precision: float32 takes two thirds of the time, for steps that are corrected by a residual in double precision
        """
        shapes = self.shapes[elements]
        F, C, J = self.loops.deformation(displacement, self.gradients, shapes)
        response = self.law.isochoric(C, tangent=True)
        volumetric = self._volumetric(J, shapes)
        return self.loops.tangent(F, C, J, self.gradients, self.volumes, shapes, response.stress, response.tangent,
                                  volumetric.pressure, self.basis, self.gram_inverse, self.projected_modulus,
                                  self.local_modulus, volumetric.growing, np.empty(0, precision))

    @property
    def volume(self):
        """Volume of all elements in mm3."""
        return float(self.volumes.sum(axis=1)[self.shapes].sum())

    def volume_outside(self, displacement, window):
        """Volume (mm3) in which an isochoric principal stretch lies outside of `window` (lowest, highest)."""
        _, C, _ = kernels.deformation(displacement, self.gradients, self.shapes)
        low, high = stretch_range(C)
        return float(self.volumes[self.shapes].ravel() @ ((low < window[0]) | (high > window[1])))

    def _volumetric(self, J, shapes):
        """The volumetric part of the energy of elements with volume changes J (e, g), a `Volumetric`."""
        return Volumetric(*kernels.volumetric(J, self.volumes, shapes, self.basis, self.gram_inverse, self.projected_modulus,
                                              self.local_modulus, self.growing_modulus))


def joined(parts):
    """The same elements in as few blocks as there are kinds of them; parts and result: [(nodes (e, m), block)].

    The kind is the law, the numbers of nodes and of points; the parts' blocks come to use their share of the new ones' arrays.
    """
    kinds = {}
    for nodes, block in parts:
        kinds.setdefault((id(block.law), type(block), *block.gradients.shape[1:]), []).append((nodes, block))
    return [(np.vstack([nodes for nodes, _ in alike]), _joined_block([block for _, block in alike])) for alike in kinds.values()]


def _joined_block(blocks):
    whole, first = copy.copy(blocks[0]), np.cumsum([0, *(len(block.gradients) for block in blocks)])
    whole.shapes = np.concatenate([block.shapes + start for block, start in zip(blocks, first, strict=False)])
    for name in ("gradients", "volumes", "gram_inverse"):
        values = np.concatenate([getattr(block, name) for block in blocks])
        setattr(whole, name, values)
        for k, block in enumerate(blocks):
            setattr(block, name, values[first[k]:first[k + 1]])
    return whole


def _pressure_modes(points, trilinear):
    """Functions of the pressure at parent points (g, 3): (g, 4), or (g, 8) if trilinear."""
    linear = np.column_stack([np.ones(len(points)), points])
    if not trilinear:
        return linear
    x, y, z = points.T
    return np.column_stack([linear, x * y, y * z, z * x, x * y * z])


def _unlike(coordinates):
    """Elements (u,) of all different shapes among coordinates (e, m, 3), and for each (e,) which of these is its own."""
    return unique_rows((coordinates - coordinates[:, :1]).reshape(len(coordinates), -1))


def _distinct(numbers):
    """The numbers of each row of (r, k), each once and rising, (r, w), short rows with their last one again; where each stands.

    Negative ones count for nothing, and stand at -1 in the places (r, k).
    """
    order = np.argsort(numbers, axis=1, kind="stable")
    rising = np.take_along_axis(numbers, order, axis=1)
    new = (rising >= 0) & (np.diff(rising, axis=1, prepend=-1) > 0)
    place = np.cumsum(new, axis=1) - 1
    rows, _ = np.nonzero(new)
    found = np.full((len(numbers), place.max() + 1), -1, dtype=numbers.dtype)
    found[rows, place[new]] = rising[new]
    back = np.empty_like(place)
    np.put_along_axis(back, order, place, axis=1)
    return np.maximum.accumulate(found, axis=1), back


class HexBlock(SolidBlock):
    """Hexahedra of 20 or 27 nodes given by coordinates (e, 20 or 27, 3) in mm; options as `SolidBlock` has them."""

    def __init__(self, coordinates, law, *, points_per_side=3, **options):
        points, weights = gauss(points_per_side, 3)
        shape = {20: hex20, 27: hex27}[coordinates.shape[1]]
        first, shapes = _unlike(coordinates)
        gradients, volumes = reference_gradients(coordinates[first], shape(points)[1], weights)
        super().__init__(gradients, volumes, points, law, shapes=shapes, **options)


class WedgeBlock(SolidBlock):
    """18-node wedges given by coordinates (e, 18, 3) in mm; options as `SolidBlock` has them."""

    def __init__(self, coordinates, law, **options):
        points, weights = wedge_rule()
        first, shapes = _unlike(coordinates)
        gradients, volumes = reference_gradients(coordinates[first], wedge18(points)[1], weights)
        super().__init__(gradients, volumes, points, law, shapes=shapes, **options)


def hanging_node_constraints(masters, weights, elements, block):
    """Nodes (e, w) that elements (e, m) hang on, and the block in terms of these."""
    masters, weights = masters[elements], weights[elements]
    nodes, column = _distinct(np.where(np.abs(weights) > 1e-12, masters, -1).reshape(len(elements), -1))
    follow = np.zeros((*elements.shape, nodes.shape[1]))
    element, node, _ = np.indices(masters.shape, sparse=True)
    column, used = column.reshape(masters.shape), column.reshape(masters.shape) >= 0
    np.add.at(follow, tuple(np.broadcast_to(index, masters.shape)[used] for index in (element, node, column)), weights[used])
    table = np.hstack([block.shapes[:, None], follow.reshape(len(follow), -1)])
    first, block.shapes = unique_rows(table)
    own = table[first, 0].astype(int)
    block.gradients = np.ascontiguousarray(np.einsum("egdm,emw->egdw", block.gradients[own], follow[first], optimize=True))
    block.volumes, block.gram_inverse = block.volumes[own], block.gram_inverse[own]
    return nodes, block
