"""The bed of frusta between the sheet and the PCB: every frustum a finite-strain body of its own, tied to the sheet.

A frustum touches the rest of the sensor only through its root. So its inner unknowns are eliminated frustum by frustum
(static condensation, exact within Newton's method), and the global matrix knows the roots only. Contact, all unilateral:
tip and folding side on the PCB; the side on the symmetric plane towards each neighbour, attached to the root's outermost node,
which the two neighbours share when they touch. The sheet's lower side on the frusta's sides is left out: in the unit cell
they come no nearer than 0.01 mm up to 1 MPa.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from softtact.contact.penalty import penalty
from softtact.mechanics.blocks import HexBlock
from softtact.mechanics.condensation import Condensation
from softtact.mechanics.elements import HEX27_BOTTOM, HEX27_SIDES, gauss, quad9
from softtact.mechanics.hex_mesh import disc_plan, extrude

DIRECTIONS = ((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))   # axis and sign of the four neighbours: +x, +y, -x, -y
_CHUNK = 45                         # frusta whose element tangents are in memory at once


@dataclass(frozen=True)
class BedGeometry:
    """Frusta by their centres (n, 2), heights (n,), tip diameters (n,) in mm, and `neighbours` (n, 4) in DIRECTIONS."""

    centres: np.ndarray
    heights: np.ndarray
    tip_diameters: np.ndarray
    root_diameter: float
    neighbours: np.ndarray


@dataclass(frozen=True)
class BedState:
    """energy (mJ), force (n, nodes, 3) on the frusta's nodes, gaps (n, p) at the contact points, displacement."""

    energy: float
    force: np.ndarray
    gaps: np.ndarray
    displacement: np.ndarray


@dataclass(frozen=True)
class ContactSettings:
    """Penalty stiffness in N/mm3 and smoothing depth in mm."""

    stiffness: float = 2000.0
    smoothing: float = 1e-3


class FrustumBed:
    """All frusta of a sensor with one law. Local node numbers are those of `self.mesh`; roots are `self.root`."""

    def __init__(self, geometry, law, *, levels, root_z_mm, pcb_z_mm, tips_held, contact, local_over_shear, refinement=0):
        self.geometry, self.contact = geometry, contact
        plan = disc_plan(refinement)
        self.mesh = extrude(plan, levels)
        self.outer_faces = self._outer_faces(plan)
        self.count = len(geometry.heights)
        self.nodes = len(self.mesh.points)
        self.root, self.tip = self.mesh.planes[-1], self.mesh.planes[0]
        self.coordinates = self._place(levels, root_z_mm)
        self.block = HexBlock(self._per_element(self.coordinates), law, local_over_shear=local_over_shear)
        self._contact_points(pcb_z_mm)
        self._number_unknowns(tips_held)
        self.condensed = Condensation(self.count, self.inner_count, len(self.root_dofs))

    def _place(self, levels, root_z):
        """Nodal coordinates (n, nodes, 3): the unit disc scaled by the cone's radius, the height by each frustum's own."""
        g = self.geometry
        fraction = self.mesh.points[:, 2] / levels[-1]
        radius = 0.5 * (g.tip_diameters[:, None] * (1 - fraction) + g.root_diameter * fraction)
        plan = self.mesh.points[None, :, :2] * radius[..., None] + g.centres[:, None, :]
        z = root_z - g.heights[:, None] * (1 - fraction)
        return np.concatenate([plan, z[..., None]], axis=2)

    def _per_element(self, field):
        return np.ascontiguousarray(field[:, self.mesh.hexes].reshape(-1, 27, 3))

    def _outer_faces(self, plan):
        """Nodes (layers * sides, 9) of the cone's faces."""
        quads, sides = plan.outer_sides()
        return np.vstack([self.mesh.layer(k)[quads[:, None], HEX27_SIDES[sides]] for k in range(self.mesh.layers)])

    def _contact_points(self, pcb_z):
        """Points with their nodes, weights, axis: gap = gap0 + sum(weights * displacement[nodes, axis])."""
        points, weights = gauss(3, 2)
        values, slopes = quad9(points)
        on_pcb = np.vstack([self.mesh.layer(0)[:, HEX27_BOTTOM], self.outer_faces])
        records = [(face, value, 2, 1.0, face[0], 0.0, -1) for face in on_pcb for value in values]
        root_xy = self.mesh.points[self.root, :2]
        for k, (axis, sign) in enumerate(DIRECTIONS):
            plane_node = self.root[np.argmax(sign * root_xy[:, axis])]
            facing = sign * self.mesh.points[self.outer_faces][..., axis].mean(axis=1) > 1e-6
            records += [(face, -sign * value, axis, sign, plane_node, sign, k)
                        for face in self.outer_faces[facing] for value in values]
        self.point_nodes = np.array([[*r[0], r[4]] for r in records])
        self.point_weights = np.array([[*r[1], r[5]] for r in records])
        self.point_axis = np.array([r[2] for r in records])
        self.point_neighbour = np.array([r[6] for r in records])
        offset = np.where(self.point_neighbour < 0, -pcb_z, 0.0)
        self.gap0 = self._along(self.coordinates) + offset
        self.point_area = self._areas(np.array([r[0] for r in records]).reshape(-1, len(weights), 9)[:, 0], slopes, weights)
        absent = (self.point_neighbour[None] >= 0) & ~self.geometry.neighbours[:, self.point_neighbour]
        self.point_area[absent] = 0.0

    def _along(self, field):
        """Weighted component (n, p) of a nodal field along each contact point's axis."""
        return _weighted_component(field, self.point_nodes, self.point_weights, self.point_axis)

    def _areas(self, faces, slopes, weights):
        """Reference areas (n, p) of the quadrature points of faces (f, 8)."""
        edges = np.einsum("nfad,gai->nfgdi", self.coordinates[:, faces], slopes, optimize=True)
        normal = np.cross(edges[..., 0], edges[..., 1])
        return (np.linalg.norm(normal, axis=-1) * weights).reshape(self.count, -1)

    def _number_unknowns(self, tips_held):
        """Local order of the unknowns: inner ones first, then the root's; held ones get -1."""
        number = np.zeros((self.nodes, 3), dtype=np.int64)
        if tips_held:
            number[self.tip, :2] = -1
        number[self.root] = -1
        inner = number.ravel() == 0
        self.inner_count = int(inner.sum())
        order = np.full(3 * self.nodes, -1, dtype=np.int64)
        order[inner] = np.arange(self.inner_count)
        root = (3 * self.root[:, None] + np.arange(3)).ravel()
        order[root] = self.inner_count + np.arange(len(root))
        self.order, self.inner, self.root_dofs = order, np.flatnonzero(inner), root

    def evaluate(self, displacement):
        """Energy, nodal forces and gaps for displacement (n, nodes, 3); None if an element is inside out."""
        body = self.block.evaluate(self._per_element(displacement))
        if body is None:
            return None
        gaps = self.gap0 + self._along(displacement)
        energy, pressure, _ = penalty(gaps, stiffness=self.contact.stiffness, smoothing=self.contact.smoothing)
        force = np.zeros((self.count, self.nodes, 3))
        per_element = body.force.reshape(self.count, -1, 27, 3)
        for k, nodes in enumerate(self.mesh.hexes):
            force[:, nodes] += per_element[:, k]
        _scatter_contact(force, -pressure * self.point_area, self.point_nodes, self.point_weights, self.point_axis)
        return BedState(energy=body.energy + float((energy * self.point_area).sum()), force=force, gaps=gaps,
                        displacement=displacement)

    def refresh(self, state, frusta):
        """Recompute the condensed tangents of the given frusta (numbers)."""
        for start in range(0, len(frusta), _CHUNK):
            self._condense(state, frusta[start:start + _CHUNK])

    def contact_slope(self, gaps):
        """Stiffness (n, p) of the contact points in N/mm3."""
        return penalty(gaps, stiffness=self.contact.stiffness, smoothing=self.contact.smoothing)[2]

    def _condense(self, state, frusta):
        layers = len(self.mesh.hexes)
        elements = (frusta[:, None] * layers + np.arange(layers)).ravel()
        dense = np.zeros((len(frusta), self.inner_count + len(self.root_dofs), self.inner_count + len(self.root_dofs)))
        tangents = self.block.tangent(self._per_element(state.displacement[frusta]), elements)
        slope = self.contact_slope(state.gaps[frusta])
        _assemble_dense(dense, tangents, self.mesh.hexes, self.order)
        _contact_tangent(dense, slope * self.point_area[frusta], self.point_nodes, self.point_weights, self.point_axis,
                         self.order)
        for matrix, frustum in zip(dense, frusta, strict=True):
            self.condensed.set(frustum, matrix)

    def condensed_residual(self, state):
        """Root forces (n, 75) after the inner residual has been eliminated, and what `inner_step` needs again."""
        flat = state.force.reshape(self.count, -1)
        passed_on, half = self.condensed.residual(flat[:, self.inner])
        return flat[:, self.root_dofs] + passed_on, half

    def inner_step(self, half, root_step):
        """Newton step (n, nodes, 3) of the frusta for the roots' step (n, 75)."""
        step = np.zeros((self.count, 3 * self.nodes))
        step[:, self.inner] = self.condensed.recover(half, root_step)
        step[:, self.root_dofs] = root_step
        return step.reshape(self.count, self.nodes, 3)

    def inner_residual(self, state):
        """Unbalanced forces (n, inner) of the inner unknowns."""
        return state.force.reshape(self.count, -1)[:, self.inner]

    def compression(self, displacement):
        """Mean shortening (n,) of each frustum in mm: root against tip."""
        return displacement[:, self.tip, 2].mean(axis=1) - displacement[:, self.root, 2].mean(axis=1)


@njit(cache=True, nogil=True)
def _weighted_component(field, nodes, weights, axis):
    out = np.zeros((field.shape[0], nodes.shape[0]))
    for f in range(field.shape[0]):
        for p in range(nodes.shape[0]):
            for k in range(nodes.shape[1]):
                out[f, p] += weights[p, k] * field[f, nodes[p, k], axis[p]]
    return out


@njit(cache=True, nogil=True)
def _scatter_contact(force, magnitude, nodes, weights, axis):
    for f in range(force.shape[0]):
        for p in range(nodes.shape[0]):
            if magnitude[f, p] != 0.0:
                for k in range(nodes.shape[1]):
                    force[f, nodes[p, k], axis[p]] += magnitude[f, p] * weights[p, k]


@njit(cache=True, nogil=True)
def _assemble_dense(dense, tangents, hexes, order):
    """Add element matrices into the upper triangles of dense (f, n, n)."""
    layers, size = hexes.shape[0], 3 * hexes.shape[1]
    for f in range(dense.shape[0]):
        for e in range(layers):
            K = tangents[f * layers + e]
            for i in range(size):
                row = order[3 * hexes[e, i // 3] + i % 3]
                if row >= 0:
                    for j in range(size):
                        column = order[3 * hexes[e, j // 3] + j % 3]
                        if column >= row:
                            dense[f, row, column] += K[i, j]


@njit(cache=True, nogil=True)
def _contact_tangent(dense, slope, nodes, weights, axis, order):
    for f in range(dense.shape[0]):
        for p in range(nodes.shape[0]):
            if slope[f, p] != 0.0:
                for i in range(nodes.shape[1]):
                    row = order[3 * nodes[p, i] + axis[p]]
                    if row >= 0:
                        for j in range(nodes.shape[1]):
                            column = order[3 * nodes[p, j] + axis[p]]
                            if column >= row:
                                dense[f, row, column] += slope[f, p] * weights[p, i] * weights[p, j]
