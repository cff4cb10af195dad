"""A block of elements of one material: energy, internal force and tangent at finite strain.

The volumetric energy (K - k)/2 (J-1)^2 sees J only through its projection on linear functions in each element
(four modes: discontinuous linear pressure). The element does not lock for nearly incompressible rubber, the pressure needs
no unknown of its own, and the tangent stays symmetric (Sussman and Bathe, Computers & Structures 26 (1987) 357).

A rest, k/4 (J^2 - 1 - 2 ln J), may see J at every point. Between the modes J is free otherwise, and the edges of frusta
that fold onto the PCB snap to J = 0.1, where no further step converges: with k = mu a sphere stalls at 40 N, with k = 4 mu it
takes 13 iterations to 50 N. Alone it would be a material of Poisson's ratio 0.38, far from locking; it makes the unit cell
1 % stiffer with two layers a frustum, 4 % with four narrow ones.

Frusta want full quadrature (27 points): with 8 points they soften by spurious modes once they fold (13 % more compression
at 0.4 MPa) and Newton's method stalls.
"""

from dataclasses import dataclass

import numpy as np

from softtact.materials.laws.stretches import stretch_range
from softtact.mechanics import kernels
from softtact.mechanics.elements import gauss, hex20, hex27, reference_gradients, wedge18, wedge_rule
from softtact.mechanics.parallel import SERIAL, slices, unique_rows

_AT_ONCE = 400   # elements whose fields at the points are in memory at once, mostly in the processor's cache


@dataclass(frozen=True)
class BlockState:
    """What one evaluation leaves for the tangent: energy (mJ), force (e, 3 m) in N, and the fields at the points."""

    energy: float
    force: np.ndarray
    displacement: np.ndarray


class SolidBlock:
    """Elements of one kind and one law, by their shape functions' gradients.

    gradients (u, g, m, 3) in 1/mm and volumes (u, g) in mm3 of the shapes that occur; shapes (e,): which is an element's, by
    default each its own; points (g, 3) of the quadrature in parent coordinates; local_over_shear: k / mu, one or of each
    shape (u,). Displacements come per element (e, m, 3) in mm.
    """

    def __init__(self, gradients, volumes, points, law, *, shapes=None, local_over_shear=0.0):
        self.law, self._local_over_shear = law, local_over_shear
        self.gradients, self.volumes = np.ascontiguousarray(gradients), np.ascontiguousarray(volumes)
        self.shapes = np.arange(len(gradients)) if shapes is None else shapes
        self.basis = np.column_stack([np.ones(len(points)), points])   # (g, 4): 1, xi, eta, zeta
        gram = np.einsum("eg,gp,gq->epq", self.volumes, self.basis, self.basis, optimize=True)
        self.gram_inverse = np.linalg.inv(gram)

    @property
    def local_modulus(self):
        """k of each shape (u,) in MPa."""
        return np.minimum(self._local_over_shear * self.law.mu0, self.law.bulk_modulus) * np.ones(len(self.volumes))

    @property
    def projected_modulus(self):
        """K - k of each shape (u,) in MPa."""
        return self.law.bulk_modulus - self.local_modulus

    def evaluate(self, displacement, *, workers=SERIAL):
        """Energy and internal force; None if an element is turned inside out (J <= 0 at a quadrature point)."""
        parts = workers.map(lambda part: self._evaluate(displacement[part], self.shapes[part]), slices(len(self.shapes), _AT_ONCE))
        if any(part is None for part in parts):
            return None
        energies, forces = zip(*parts, strict=True)
        return BlockState(energy=sum(energies), force=np.concatenate(forces), displacement=displacement)

    def _evaluate(self, displacement, shapes):
        F, C, J = kernels.deformation(displacement, self.gradients, shapes)
        if not J.min() > 0:
            return None
        response = self.law.isochoric(C, tangent=False)
        modes, pressure = self._pressure(J, shapes)
        local = 0.25 * self.local_modulus[shapes, None] * (J * J - 1 - 2 * np.log(J))
        energy = float(self.volumes[shapes].ravel() @ (response.energy + local.ravel()) + 0.5 * (modes[0] * modes[1]).sum())
        return energy, kernels.internal_force(F, C, J, self.gradients, self.volumes, shapes, response.stress, pressure)

    def tangent(self, displacement, elements=slice(None)):
        """Tangent (e, 3 m, 3 m) in N/mm of the chosen elements, whose displacement (e, m, 3) is given."""
        shapes = self.shapes[elements]
        F, C, J = kernels.deformation(displacement, self.gradients, shapes)
        response = self.law.isochoric(C, tangent=True)
        _, pressure = self._pressure(J, shapes)
        return kernels.tangent(F, C, J, self.gradients, self.volumes, shapes, response.stress, response.tangent, pressure,
                               self.basis, self.gram_inverse, self.projected_modulus, self.local_modulus)

    @property
    def volume(self):
        """Volume of all elements in mm3."""
        return float(self.volumes.sum(axis=1)[self.shapes].sum())

    def volume_outside(self, displacement, window):
        """Volume (mm3) in which an isochoric principal stretch lies outside of `window` (lowest, highest)."""
        _, C, _ = kernels.deformation(displacement, self.gradients, self.shapes)
        low, high = stretch_range(C)
        return float(self.volumes[self.shapes].ravel() @ ((low < window[0]) | (high > window[1])))

    def _pressure(self, J, shapes):
        """Modes of the volume change with their conjugate pressures, and the whole pressure (e, g) at the points."""
        change = ((J - 1) * self.volumes[shapes]) @ self.basis
        conjugate = self.projected_modulus[shapes, None] * np.einsum("epq,eq->ep", self.gram_inverse[shapes], change)
        return (change, conjugate), conjugate @ self.basis.T + 0.5 * self.local_modulus[shapes, None] * (J - 1 / J)


def _unlike(coordinates):
    """Elements (u,) of all different shapes among coordinates (e, m, 3), and for each (e,) which of these is its own."""
    return unique_rows((coordinates - coordinates[:, :1]).reshape(len(coordinates), -1))


class HexBlock(SolidBlock):
    """Hexahedra of 20 or 27 nodes given by coordinates (e, 20 or 27, 3) in mm; local_over_shear: one, or of each (e,)."""

    def __init__(self, coordinates, law, *, points_per_side=3, local_over_shear=0.0):
        points, weights = gauss(points_per_side, 3)
        shape = {20: hex20, 27: hex27}[coordinates.shape[1]]
        first, shapes = _unlike(coordinates)
        gradients, volumes = reference_gradients(coordinates[first], shape(points)[1], weights)
        if np.ndim(local_over_shear):
            local_over_shear = np.asarray(local_over_shear)[first]
        super().__init__(gradients, volumes, points, law, shapes=shapes, local_over_shear=local_over_shear)


class WedgeBlock(SolidBlock):
    """18-node wedges given by coordinates (e, 18, 3) in mm."""

    def __init__(self, coordinates, law, *, local_over_shear=0.0):
        points, weights = wedge_rule()
        first, shapes = _unlike(coordinates)
        gradients, volumes = reference_gradients(coordinates[first], wedge18(points)[1], weights)
        super().__init__(gradients, volumes, points, law, shapes=shapes, local_over_shear=local_over_shear)
