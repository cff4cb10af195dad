"""Capacitances of the taxels: Laplace's equation between the board's electrodes and the grounded upper side.

The board carries the taxels, a gap without electrode around each, and the guard everywhere else. Fields end at the free sides. A
taxel's capacitance is its charge per volt while the guard and the other taxels are driven with it, as the converter does. In the
Maxwell matrix they are grounded in turn. Charges are those of the weak form, so they obey reciprocity and the balance of charge
and energy to round-off (Jackson, Classical Electrodynamics, sec. 1.11).
"""

from functools import cached_property

import numpy as np
from skfem import Basis, BilinearForm, ElementTetP2

from softtact.errors import InputError
from softtact.linalg.direct import make_solver
from softtact.skin.elasticity import upper_triangle
from softtact.skin.layer_mesh import LayerMesh, displaced
from softtact.skin.layout import Layout

VACUUM_FF_PER_MM = 8.8541878128  # permittivity of vacuum, CODATA 2018
_FREE, _GROUND = -1, -2
_REACH = 3.0  # thicknesses: exp(-3 pi) is 8e-5


@BilinearForm
def _laplace(u, v, w):
    return u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1] + u.grad[2] * v.grad[2]


class ElectricField:
    """The electric field in a deformed layer; potentials in V, charges in fC, capacitances in fF.

    order: of quadrature; 2 is exact for straight elements, and off by 8e-5 of a capacitance where the circles curve them
    """

    def __init__(self, mesh: LayerMesh, layout: Layout, *, permittivity: float, displacement_mm: np.ndarray | None = None,
                 order: int = 2) -> None:
        self._layout = layout
        self._permittivity = VACUUM_FF_PER_MM * permittivity
        moved = mesh.nodes_mm if displacement_mm is None else mesh.nodes_mm + displacement_mm
        self.basis = Basis(displaced(mesh.mesh, moved), ElementTetP2(), intorder=order)
        self._refuse_folded(mesh)
        self._electrode = _electrodes(mesh, layout)
        self._free = np.flatnonzero(self._electrode == _FREE)

    @cached_property
    def capacitance_ff(self) -> np.ndarray:
        """(taxel,): with the guard and all taxels driven together."""
        return self._charges(self.driven)[:-1]

    @cached_property
    def maxwell_ff(self) -> np.ndarray:
        """(taxel + 1, taxel + 1): charge of each electrode per volt on one of them, the others grounded; the guard is last."""
        return np.column_stack([self._charges(self._alone[:, k]) for k in range(self._alone.shape[1])])

    @cached_property
    def driven(self) -> np.ndarray:
        """Potential (node,) with 1 V on the guard and on all taxels."""
        return self._solved((self._electrode >= 0).astype(float)[:, None])[:, 0]

    def energy_fj(self, potential: np.ndarray) -> float:
        """Energy of a potential (node,)."""
        return float(0.5 * potential @ (self._matrix @ potential))

    def gradient(self) -> np.ndarray:
        """Derivative of each capacitance by the nodes' places in fF/mm: (node, 3, taxel).

        The shape derivative of the bilinear form at two stationary potentials, the driven one and that of the taxel alone
        (Sokolowski and Zolesio, Introduction to Shape Optimization, sec. 2.30). The latter decays with the distance x as
        exp(-pi x / thickness), so only elements within three thicknesses of the guard's edge are taken.
        """
        basis, taxels = self.basis, len(self._layout.centres_mm)
        slopes, dofs = np.stack([function[0].grad for function in basis.basis]), basis.element_dofs
        driven = np.einsum("ke,kaeq->aeq", self.driven[dofs], slopes)
        middle = basis.mesh.p[:2, basis.mesh.t].mean(axis=1).T
        reach = self._layout.guard_radius_mm + _REACH * basis.mesh.doflocs[2].max()
        columns = np.zeros((len(self._electrode), 3, taxels))
        for taxel, centre in enumerate(self._layout.centres_mm):
            near = np.flatnonzero(np.linalg.norm(middle - centre, axis=1) < reach)
            alone = np.einsum("ke,kaeq->aeq", self._alone[dofs[:, near], taxel], slopes[:, :, near])
            value = _shape_derivative(slopes[:, :, near], driven[:, near], alone, basis.dx[near])
            for axis in range(3):
                columns[:, axis, taxel] = np.bincount(dofs[:, near].ravel(), weights=value[:, axis].ravel(), minlength=len(columns))
        return self._permittivity * columns

    @cached_property
    def _matrix(self):
        return (self._permittivity * _laplace.assemble(self.basis)).tocsr()

    @cached_property
    def _alone(self):
        """Potentials (node, electrode) with 1 V on one electrode, the others grounded; the guard is last."""
        electrodes = len(self._layout.centres_mm) + 1
        return self._solved((self._electrode[:, None] == np.arange(electrodes)).astype(float))

    def _solved(self, potential):
        """Potentials (node, k), given on the electrodes, with those of the free nodes filled in."""
        rows = self._matrix[self._free]
        solver = make_solver()     # on one thread, as in `BondedLayer`
        solver.factor(upper_triangle(rows[:, self._free]))
        potential[self._free] = solver.solve(np.ascontiguousarray(-(rows @ potential)))
        solver.close()
        return potential

    def _charges(self, potential):
        """Charges (electrode,) of a potential, the guard last."""
        nodal = self._matrix @ potential
        on = self._electrode >= 0
        return np.bincount(self._electrode[on], weights=nodal[on], minlength=len(self._layout.centres_mm) + 1)

    def _refuse_folded(self, mesh):
        at_rest = mesh.basis.mapping.detDF(np.full((3, 1), 0.25))
        if (self.basis.mapping.detDF(self.basis.X) * np.sign(at_rest) <= 0).any():
            raise InputError("load: it folds elements of the elastomer, where small strains do not hold; choose less pressure or a "
                             "thicker or stiffer layer.")


def _electrodes(mesh, layout):
    """Electrode (node,): number of a taxel, their count for the guard, _GROUND on the upper side, _FREE elsewhere."""
    electrode = np.full(len(mesh.nodes_mm), _FREE)
    floor = mesh.floor
    distances = np.linalg.norm(mesh.nodes_mm[floor, None, :2] - layout.centres_mm, axis=2)
    nearest, distance = distances.argmin(axis=1), distances.min(axis=1)
    electrode[floor[distance >= layout.guard_radius_mm - 1e-6]] = len(layout.centres_mm)
    on_taxel = distance <= layout.radius_mm + 1e-6
    electrode[floor[on_taxel]] = nearest[on_taxel]
    electrode[mesh.top] = _GROUND
    return electrode


def _shape_derivative(slopes, one, other, weight):
    """Derivative (function, axis, element) of the form by a node's place along an axis, at two gradients (axis, element, point).

    slopes: gradients of the functions, (function, axis, element, point);  weight: of the points (element, point)
    """
    dot, one_weighted, other_weighted = (one * other).sum(axis=0) * weight, one * weight, other * weight
    along_one = np.einsum("kaeq,aeq->keq", slopes, one)
    along_other = np.einsum("kaeq,aeq->keq", slopes, other)
    return (
        np.einsum("eq,kaeq->kae", dot, slopes)
        - np.einsum("aeq,keq->kae", one_weighted, along_other)
        - np.einsum("aeq,keq->kae", other_weighted, along_one)
    )
