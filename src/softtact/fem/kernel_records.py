"""What the compiled loops take and give: named tuples of arrays, which numba passes to compiled code as they are."""

from typing import NamedTuple

import numpy as np


class ElementArrays(NamedTuple):
    """Elements (e,) of one kind at rest. Many are translations of each other, so what depends on the shape is kept once for each.

    gradients: (u, g, 3, m) of the shape functions of m nodes at g points, in 1/mm, of the u shapes that occur
    volumes: (u, g) of the points, in mm3
    shapes: (e,) which of the u shapes is an element's
    basis: (g, p) functions on which changes of volume are projected
    gram_inverse: (u, p, p) inverse of the integrals of their products, in 1/mm3
    """

    gradients: np.ndarray
    volumes: np.ndarray
    shapes: np.ndarray
    basis: np.ndarray
    gram_inverse: np.ndarray


class Deformation(NamedTuple):
    """Of elements at their points: deformation gradient F (e, g, 3, 3), C = F^T F (e*g, 6) and volume ratio J (e, g)."""

    F: np.ndarray
    C: np.ndarray
    J: np.ndarray


class VolumePenalties(NamedTuple):
    """Moduli (MPa) of what holds changes of volume that the projection does not see: k and q of `solid_block`."""

    unprojected: float
    quartic: float


class VolumeResponse(NamedTuple):
    """How elements answer changes of volume.

    energies: (e,) in mJ
    pressure: (e, g) by which they change with J, in MPa, positive in tension
    modulus: U'' in MPa where it is the same for every J
    stiffness: (e, g) U'' at the projected J in MPa where it is not, else (0, 0)
    unprojected: k in MPa
    quartic: (e, g) second derivative in MPa of the quartic penalty by what the projection does not see, (0, 0) without it
    """

    energies: np.ndarray
    pressure: np.ndarray
    modulus: float
    stiffness: np.ndarray
    unprojected: float
    quartic: np.ndarray

    def of(self, part: slice) -> "VolumeResponse":
        """The response of some of the elements."""
        return self._replace(energies=self.energies[part], pressure=self.pressure[part],
                             stiffness=self.stiffness[part] if self.stiffness.size else self.stiffness,
                             quartic=self.quartic[part] if self.quartic.size else self.quartic)
