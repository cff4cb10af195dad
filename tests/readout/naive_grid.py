"""The field of the whole electrode grid by finite elements: the slow, plain way to what gaps, edges and coupling stand for.

Between the electrodes on the board and the fabric lie the frusta with their air, of the permittivity that gives the gap formula's
capacitance where field lines are straight, and the sheet; around the footprint air; below, the board. Fabric and electrodes end as
in `softtact.readout.electrodes`. So the difference from the gap formula is the field's shape alone.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from skfem import Basis, BilinearForm, ElementHex0, ElementHex1, MeshHex

from softtact.linalg.refined import RefinedSolver
from softtact.linalg.workers import Workers
from softtact.readout.capacitance import EPSILON_0_PF_PER_MM, equivalent_air_gap
from softtact.skin.elasticity import upper_triangle

BOARD_PERMITTIVITY, BOARD_MM, MARGIN_MM = 4.4, 1.6, 3.0     # FR4; what lies below and around is natural: no charge
FREE, FABRIC = -1, -2


@dataclass(frozen=True)
class Fineness:
    """Elements along an electrode's side, between two, in the frusta, in the sheet, and outwards."""

    side: int = 10
    between: int = 3
    frusta: int = 5
    sheet: int = 4
    outwards: int = 7

    def finer(self, factor):
        return Fineness(*(round(factor * count) for count in vars(self).values()))


class GridField:
    """Capacitances (pF) of the electrodes of a sensor on frusta where the fabric moved by a map (y, x) in mm."""

    def __init__(self, spec, map_mm, *, spacing_mm=0.3, board=BOARD_PERMITTIVITY, margin_mm=MARGIN_MM, fineness=None, threads=1):
        self.spec, self._map, self._board, self._threads = spec, map_mm, board, threads
        f = fineness or Fineness()
        x, y = (_line(side, count, spacing_mm, margin_mm, f) for side, count in
                zip(spec.footprint_mm, (spec.taxels.columns, spec.taxels.rows), strict=True))
        h, t = spec.dielectric.frusta.height_mm, spec.dielectric.sheet_thickness_mm
        below = margin_mm if board == 1 else BOARD_MM
        z = np.concatenate([-_outwards(below, f.outwards), _clustered(0, h, f.frusta), _clustered(h, h + t, f.sheet),
                            h + t + _outwards(margin_mm, f.outwards)])
        z = np.unique(z.round(9))
        self.mesh = MeshHex.init_tensor(x, y, z)
        self._rest, self._electrode = self.mesh.p.copy(), self._electrodes(spacing_mm, h + t)
        self._move(h, t)

    def _electrodes(self, spacing, top):
        """Number of the electrode at each node, row by row; FABRIC, FREE."""
        x, y, z = self.mesh.p
        width, length = self.spec.footprint_mm
        rows, columns = self.spec.taxels.rows, self.spec.taxels.columns
        out = np.full(len(x), FREE)
        within = (np.abs(x) <= width / 2 + 1e-6) & (np.abs(y) <= length / 2 + 1e-6)
        out[within & (np.abs(z - top) < 1e-6)] = FABRIC
        row, off_row = _part(y, length, rows, spacing)
        column, off_column = _part(x, width, columns, spacing)
        on = within & (np.abs(z) < 1e-6) & off_row & off_column
        out[on] = (row * columns + column)[on]
        return out

    def _move(self, h, t):
        x, y, z = self._rest
        spec = self.spec
        at = np.column_stack([np.clip(y, spec.map_y_mm[0], spec.map_y_mm[-1]), np.clip(x, spec.map_x_mm[0], spec.map_x_mm[-1])])
        self._moved = RegularGridInterpolator((spec.map_y_mm, spec.map_x_mm), self._map)(at)
        if self._moved.max() > 0.9 * h:
            raise ValueError(f"The fabric moves by {self._moved.max():.3g} mm: elements in frusta of {h:g} mm would turn over.")
        places = self._rest.copy()
        places[2] = np.where(z > 0, z - self._moved * np.clip(z / h, 0, 1), z)
        self.mesh = MeshHex(places, self.mesh.t)

    @cached_property
    def _matrix(self):
        h = self.spec.dielectric.frusta.height_mm
        t = self.spec.dielectric.sheet_thickness_mm
        eps = self.spec.dielectric.relative_permittivity
        middle, moved = self._rest[:, self.mesh.t].mean(axis=1), self._moved[self.mesh.t].mean(axis=0)
        inside = (np.abs(middle[0]) < self.spec.footprint_mm[0] / 2) & (np.abs(middle[1]) < self.spec.footprint_mm[1] / 2)
        frusta = (h - moved) / (equivalent_air_gap(self.spec, moved) - t / eps)
        of = np.ones(len(moved))
        of = np.where(middle[2] < 0, self._board, of)
        of = np.where(inside & (middle[2] > 0) & (middle[2] < h), frusta, of)
        of = np.where(inside & (middle[2] > h) & (middle[2] < h + t), eps, of)
        basis = Basis(self.mesh, ElementHex1())
        permittivity = Basis(self.mesh, ElementHex0(), quadrature=basis.quadrature).interpolate(of * EPSILON_0_PF_PER_MM)

        @BilinearForm
        def form(u, v, w):
            return w.eps * (u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1] + u.grad[2] * v.grad[2])

        return form.assemble(basis, eps=permittivity).tocsr()

    def _charges(self, volts):
        """Charges (electrode, k) for voltages (electrode, k)."""
        free, on = np.flatnonzero(self._electrode == FREE), self._electrode >= 0
        potential = np.zeros((len(self._electrode), volts.shape[1]))
        potential[on] = volts[self._electrode[on]]
        rows = self._matrix[free]
        solver = RefinedSolver(self._rest.T[free], workers=Workers(self._threads))
        potential[free] = solver.solve(upper_triangle(rows[:, free]), np.ascontiguousarray(-(rows @ potential)), doubt=True)
        solver.close()
        nodal = self._matrix @ potential
        return np.column_stack([np.bincount(self._electrode[on], nodal[on, k]) for k in range(volts.shape[1])])

    @cached_property
    def driven_together(self):
        """(rows, columns): all electrodes at 1 V, so that neighbours guard each other."""
        count = self.spec.taxels.rows * self.spec.taxels.columns
        return self._charges(np.ones((count, 1)))[:, 0].reshape(self.spec.taxels.rows, -1)

    @cached_property
    def maxwell(self):
        """(electrode, electrode): charge of each for 1 V on one of them, the others grounded."""
        return self._charges(np.eye(self.spec.taxels.rows * self.spec.taxels.columns))

    @property
    def driven_alone(self):
        """(rows, columns): one electrode at 1 V after the other, the others grounded."""
        return self.maxwell.diagonal().reshape(self.spec.taxels.rows, -1)


def _part(places, side, count, spacing):
    """In which of equal parts of a side places lie, and whether on its electrode."""
    part = np.clip(((places / side + 0.5) * count).astype(int), 0, count - 1)
    off = np.abs(places - (part + 0.5 - 0.5 * count) * side / count)
    return part, off <= 0.5 * (side / count - spacing) + 1e-6


def _line(side, count, spacing, margin, f):
    """Lines along one side: close where electrodes end, and outwards."""
    own = np.array([0.5 * spacing, side / count - 0.5 * spacing])
    ends = (np.arange(count)[:, None] / count - 0.5) * side + own
    parts = [_clustered(low, high, f.side) for low, high in ends]
    parts += [np.linspace(a[1], b[0], f.between + 1) for a, b in zip(ends, ends[1:], strict=False)]
    parts += [np.linspace(0.5 * side - 0.5 * spacing, 0.5 * side, 2), -np.linspace(0.5 * side - 0.5 * spacing, 0.5 * side, 2)]
    beyond = 0.5 * side + _outwards(margin, f.outwards)
    return np.unique(np.concatenate([*parts, beyond, -beyond]).round(9))


def _clustered(low, high, count):
    """Lines that stand closer at both ends."""
    return low + (high - low) * 0.5 * (1 - np.cos(np.pi * np.linspace(0, 1, count + 1)))


def _outwards(far, count):
    """Lines from 0 to `far` that stand closer at 0."""
    return far * (np.geomspace(1, 20, count + 1) - 1) / 19
