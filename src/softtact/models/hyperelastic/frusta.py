"""The array of frusta between the sheet and the PCB: every frustum a separate finite-strain body, tied to the sheet.

A frustum is connected to the rest of the sensor only through its root. So its inner unknowns are eliminated frustum by frustum,
layer by layer from the tip upwards (static condensation, exact within Newton's method), and the global matrix contains only the
roots. All contact is unilateral:
tip and folding side on the PCB; the side on the symmetry plane towards each neighbour, which moves with the root's outermost
node, shared by both neighbours if their roots touch. Contact of the sheet's lower side with the frusta's sides is left out if roots
are wider than tips: in the unit cell their distance is at least 0.01 mm up to 1 MPa. If tips are wider, the sides fold onto the
sheet, which is then a horizontal plane that moves with the root's outermost node.

The compiled loops run over the contact points of many bodies with the same local nodes.
"""

from dataclasses import dataclass, replace

import numpy as np

from softtact.compiled import compiled
from softtact.contact.friction import Coulomb, FrictionState
from softtact.contact.height_field import NO_CONTACT_MM
from softtact.contact.penalty import Contact
from softtact.fem.elements import HEX27, QUAD9, dofs_of
from softtact.fem.extruded_mesh import disc_mesh_2d, extrude
from softtact.fem.kernels import add_forces
from softtact.fem.quadrature import gauss
from softtact.fem.solid_block import HexBlock
from softtact.fem.static_condensation import Springs, TangentCache
from softtact.fem.substructuring import LayerwiseElimination
from softtact.linalg.workers import SERIAL, Workers
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.states import ContactHistory, SupportState
from softtact.models.hyperelastic.support import Support

BOARD, SHEET = -1, -2                                     # contact partners of a point other than a neighbour in DIRECTIONS
DIRECTIONS = ((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))   # axis and sign of the four neighbours: +x, +y, -x, -y


@compiled
def weighted_component(field: np.ndarray, nodes: np.ndarray, weights: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Weighted components (f, p) of nodal fields (f, nodes, 3) at points of nodes (p, k), weights (p, k), axis (p,)."""
    out = np.zeros((field.shape[0], nodes.shape[0]))
    for f in range(field.shape[0]):
        for p in range(nodes.shape[0]):
            for k in range(nodes.shape[1]):
                out[f, p] += weights[p, k] * field[f, nodes[p, k], axis[p]]
    return out


@compiled
def scatter_contact(force: np.ndarray, magnitude: np.ndarray, nodes: np.ndarray, weights: np.ndarray, axis: np.ndarray) -> None:
    """Add forces of magnitudes (f, p) at points, given as in `weighted_component`, to nodal forces (f, nodes, 3)."""
    for f in range(force.shape[0]):
        for p in range(nodes.shape[0]):
            if magnitude[f, p] != 0.0:
                for k in range(nodes.shape[1]):
                    force[f, nodes[p, k], axis[p]] += magnitude[f, p] * weights[p, k]


@dataclass(frozen=True)
class FrustumGeometry:
    """Frusta by their centres (n, 2), heights (n,), tip diameters (n,) in mm, and `neighbours` (n, 4) in DIRECTIONS.

    wall_mm: from the roots' outermost nodes to the planes towards the neighbours, at rest
    """

    centres: np.ndarray
    heights: np.ndarray
    tip_diameters: np.ndarray
    root_diameter: float
    neighbours: np.ndarray
    wall_mm: float = 0.0


class FrustumArray(Support):
    """All frusta of a sensor with one law. Local node numbers are those of `self.mesh`; roots are `self.root`."""

    def __init__(self, geometry: FrustumGeometry, law: Law, mesh: MeshSettings, *, height_mm: float, root_z_mm: float,
                 tips_bonded: bool, contact: Contact, friction: Coulomb | None = None) -> None:
        """height_mm: nominal height; the element layers scale with each frustum's height;  root_z_mm: height of the roots

        The board touches the longest frustum. friction: `Coulomb` of the frusta on the board, or None
        """
        self.geometry, self.contact, self.friction = geometry, contact, friction
        heights = np.asarray(mesh.frustum_heights) * height_mm
        mesh_2d = disc_mesh_2d(mesh.refinement, mesh.frustum_rings, mesh.core)
        self.mesh = extrude(mesh_2d, heights)
        self.outer_faces = self._outer_faces(mesh_2d)
        self.count = len(geometry.heights)
        self.nodes = len(self.mesh.points)
        self.root, self.tip = self.mesh.planes[-1], self.mesh.planes[0]
        self.coordinates = self._place(heights, root_z_mm)
        self._element_nodes = (self.nodes * np.arange(self.count)[:, None, None] + self.mesh.hexes).reshape(-1, 27)
        self.block = HexBlock(self.per_element(self.coordinates), law, trilinear=mesh.trilinear_pressure,
                              unprojected_penalty_ratio=mesh.unprojected_penalty_ratio,
                              quartic_penalty_ratio=mesh.quartic_penalty_ratio)
        self._tangents = TangentCache(self.block)
        self._contact_points(root_z_mm - geometry.heights.max())
        self._number_unknowns(tips_bonded)
        self.elimination = self._elimination()

    def _place(self, heights, root_z):
        """Nodal coordinates (n, nodes, 3): the unit disc scaled by the cone's radius, heights by those of the frusta."""
        g = self.geometry
        fraction = self.mesh.points[:, 2] / heights[-1]
        radius = 0.5 * (g.tip_diameters[:, None] * (1 - fraction) + g.root_diameter * fraction)
        mesh_2d = self.mesh.points[None, :, :2] * radius[..., None] + g.centres[:, None, :]
        z = root_z - g.heights[:, None] * (1 - fraction)
        return np.concatenate([mesh_2d, z[..., None]], axis=2)

    def per_element(self, field: np.ndarray) -> np.ndarray:
        """A nodal field (n, nodes, 3) at the elements' nodes (n * elements, 27, 3)."""
        return np.ascontiguousarray(field[:, self.mesh.hexes].reshape(-1, 27, 3))

    @property
    def blocks(self) -> list[HexBlock]:
        """The one block of all frusta."""
        return [self.block]

    @property
    def in_words(self) -> str:
        """How many frusta there are, for messages."""
        return f"{self.count} frusta"

    def _outer_faces(self, mesh_2d):
        """Nodes (layers * sides, 9) of the cone's faces."""
        quads, sides = mesh_2d.outer_sides()
        return np.vstack([self.mesh.layer(k)[quads[:, None], HEX27.sides[sides]] for k in range(self.mesh.layers)])

    def _contact_points(self, pcb_z):
        """Points with their nodes, weights, axis: gap = gap0 + sum(weights * displacement[nodes, axis])."""
        points, weights = gauss(3, 2)
        values, slopes = QUAD9.shape(points)
        on_pcb = np.vstack([self.mesh.layer(0)[:, HEX27.bottom], self.outer_faces])
        records = [(face, value, 2, 1.0, face[0], 0.0, BOARD) for face in on_pcb for value in values]
        root_xy = self.mesh.points[self.root, :2]
        for k, (axis, sign) in enumerate(DIRECTIONS):
            plane_node = self.root[np.argmax(sign * root_xy[:, axis])]
            facing = sign * self.mesh.points[self.outer_faces][..., axis].mean(axis=1) > 1e-6
            records += [(face, -sign * value, axis, sign, plane_node, sign, k)
                        for face in self.outer_faces[facing] for value in values]
            if self.geometry.tip_diameters.min() > self.geometry.root_diameter:
                records += [(face, -value, 2, 1.0, plane_node, 1.0, SHEET)
                            for face in self.outer_faces[self._nearest_direction() == k] for value in values]
        self.point_nodes = np.array([[*r[0], r[4]] for r in records])
        self.point_weights = np.array([[*r[1], r[5]] for r in records])
        self.point_axis = np.array([r[2] for r in records])
        self.point_neighbour = np.array([r[6] for r in records])
        self.board_points = len(on_pcb) * len(values)     # the first ones
        in_layer = [np.isin(self.point_nodes[:, 8], self.mesh.layer(k)) for k in range(self.mesh.layers)]   # by the face's centre
        self.point_layer = np.argmax(in_layer, axis=0)
        offset = np.choose(np.minimum(self.point_neighbour + 2, 2), [0.0, -pcb_z, self.geometry.wall_mm])
        self.gap0 = self._along(self.coordinates) + offset
        self.point_area = self._areas(np.array([r[0] for r in records]).reshape(-1, len(weights), 9)[:, 0], slopes, weights)
        absent = (self.point_neighbour[None] >= 0) & ~self.geometry.neighbours[:, self.point_neighbour]
        self.point_area[absent] = 0.0
        self.gap0[absent] = NO_CONTACT_MM    # a frustum at the lattice's edge has no neighbour to touch

    def _nearest_direction(self):
        """Index (f,) of the one of DIRECTIONS that is closest to each outer face's normal."""
        middle = self.mesh.points[self.outer_faces].mean(axis=1)
        return np.argmax([sign * middle[:, axis] for axis, sign in DIRECTIONS], axis=0)

    def _along(self, field):
        """Weighted component (n, p) of a nodal field along each contact point's axis."""
        return weighted_component(field, self.point_nodes, self.point_weights, self.point_axis)

    def _areas(self, faces, slopes, weights):
        """Reference areas (n, p) of the quadrature points of faces (f, 8)."""
        edges = np.einsum("nfad,gai->nfgdi", self.coordinates[:, faces], slopes, optimize=True)
        normal = np.cross(edges[..., 0], edges[..., 1])
        return (np.linalg.norm(normal, axis=-1) * weights).reshape(self.count, -1)

    def _number_unknowns(self, tips_bonded):
        """Local order of the unknowns: inner ones first, then the root's; fixed ones get -1."""
        number = np.zeros((self.nodes, 3), dtype=np.int64)
        if tips_bonded:
            number[self.tip, :2] = -1
        number[self.root] = -1
        self.inner = np.flatnonzero(number.ravel() == 0)
        self.root_dofs = (3 * self.root[:, None] + np.arange(3)).ravel()

    def _elimination(self):
        """Elimination layer by layer from the tip upwards; root nodes that move the contact planes of a layer remain."""
        eliminated = np.zeros(3 * self.nodes, dtype=bool)
        eliminated[self.inner] = True
        moves = eliminated.copy()
        moves[self.root_dofs] = True
        layers, planes = [], []
        for k in range(self.mesh.layers):
            unknowns = dofs_of(self.mesh.layer(k))
            layers.append([np.where(moves[unknowns], unknowns, -1)])
            moving = (self.point_layer == k) & (self.point_neighbour != BOARD)
            planes.append(3 * self.point_nodes[moving, -1] + self.point_axis[moving])
        return LayerwiseElimination(self.count, eliminated, layers, coupled=planes)

    def evaluate(self, displacement: np.ndarray, history: ContactHistory | None = None, *,
                 workers: Workers = SERIAL) -> SupportState | None:
        """Energy, nodal forces and gaps for displacement (n, nodes, 3); None if an element is inside out.

        history: of the contacts, by default none
        """
        elastic = self.rubber(displacement, workers=workers)
        return None if elastic is None else self.with_contact(displacement, elastic, history or self.fresh_history())

    def rubber(self, displacement: np.ndarray, frusta: np.ndarray | slice = slice(None), *,
               workers: Workers = SERIAL) -> tuple | None:
        """Energies (k,) in mJ and nodal forces (k, nodes, 3) of the rubber of the given frusta, or of all; None if inverted."""
        elements = np.arange(len(self._element_nodes)).reshape(self.count, -1)[frusta].ravel()
        body = self.block.evaluate(self.per_element(displacement), elements, workers=workers)
        if body is None:
            return None
        force = np.zeros((len(displacement), self.nodes, 3))
        add_forces(force.reshape(-1, 3), self._element_nodes[:len(elements)], body.force.reshape(-1, 27, 3))
        return body.energies.reshape(len(displacement), -1).sum(axis=1), force

    def potentials(self, displacement: np.ndarray, elastic: tuple, frusta: np.ndarray, history: ContactHistory) -> np.ndarray:
        """Energies (k,) in mJ of the given frusta with their contacts and friction, from those of `rubber`."""
        energy, _, _ = history.contact.at(frusta).response(self.gap0[frusta] + self._along(displacement))
        total = elastic[0] + (energy * self.point_area[frusta]).sum(axis=1)
        if history.friction is None:
            return total
        response = history.friction.at(frusta).friction_response(self._on_board(displacement, frusta))
        return total + (response.energy * self.point_area[frusta, :self.board_points]).sum(axis=1)

    def reevaluate_contact(self, state: SupportState, history: ContactHistory) -> SupportState:
        """The same displacements with another history of the contacts."""
        return self.with_contact(state.displacement, state.elastic, history)

    def with_contact(self, displacement: np.ndarray, elastic: tuple, history: ContactHistory) -> SupportState:
        """The state at displacement (n, nodes, 3), with the `rubber`'s energies and forces there."""
        gaps, force = self.gap0 + self._along(displacement), elastic[1].copy()
        energy, pressure, _ = history.contact.response(gaps)
        scatter_contact(force, -pressure * self.point_area, self.point_nodes, self.point_weights, self.point_axis)
        state = SupportState(elastic=elastic, energy=float(elastic[0].sum() + (energy * self.point_area).sum()), force=force,
                            gaps=gaps, displacement=displacement, history=history)
        return state if history.friction is None else self._with_friction(state)

    def _with_friction(self, state):
        """The state with friction's energy and forces."""
        response = state.history.friction.friction_response(self._on_board(state.displacement))
        area = self.point_area[:, :self.board_points]
        force = state.force.copy()
        for axis in (0, 1):
            scatter_contact(force, response.traction[..., axis] * area, *self._board_points(axis))
        return replace(state, energy=state.energy + float((response.energy * area).sum()), force=force, friction_response=response)

    def _board_points(self, axis):
        """Nodes, weights and axis of the points on the board for a field's component `axis`."""
        b = self.board_points
        return self.point_nodes[:b], self.point_weights[:b], np.full(b, axis)

    def _on_board(self, displacement, frusta=...):
        """Positions (n, b, 2) of the points in the board's plane, of all frusta or of some."""
        position = self.coordinates[frusta] + displacement
        return np.stack([weighted_component(position, *self._board_points(axis)) for axis in (0, 1)], axis=-1)

    def first_friction_state(self, state: SupportState) -> FrictionState | None:
        """The friction state of a step that starts from a `SupportState`, None without friction."""
        if self.friction is None:
            return None
        gaps = state.gaps[:, :self.board_points]
        if state.friction_response is None:
            return FrictionState.first(self.friction, self._on_board(state.displacement), gaps)
        return state.friction_response.next_step(gaps)

    def renewed_friction_state(self, state: SupportState) -> FrictionState:
        """The friction state with the pressures of a `SupportState`."""
        b, pressure = self.board_points, state.history.contact.response(state.gaps)[1]
        return state.friction_response.next_pass(state.gaps[:, :b], pressure[:, :b])     # type: ignore[union-attr]

    def contact_slope(self, state: SupportState) -> np.ndarray:
        """Stiffness (n, p) of the contact points in N/mm3."""
        return state.history.contact.response(state.gaps)[2]

    def contact_error(self, state: SupportState) -> float:
        """Deepest overlap, or widest gap under pressure, in mm."""
        return state.history.contact.error(state.gaps)

    def augmented(self, state: SupportState) -> ContactHistory:
        """The contacts' history after one augmentation."""
        return replace(state.history, contact=state.history.contact.augmented(state.gaps))

    def condense(self, state: SupportState, frusta: np.ndarray, damping: np.ndarray | None = None, *, kept_mm: float = 0.0) -> None:
        """Recompute the condensed tangents of the given frusta (k,).

        damping: stiffness (k,) in N/mm on their inner unknowns, see `Condensation.set`;  kept_mm: see `TangentCache`
        """
        slope = state.history.contact.at(frusta).response(state.gaps[frusta])[2] * self.point_area[frusta]
        displacement = state.displacement[frusta]
        friction = None if state.friction_response is None else state.friction_response.stiffness(frusta)
        layers = (([self._layer_tangents(k, displacement, frusta, kept_mm)], self._springs(k, frusta, slope, friction))
                  for k in range(self.mesh.layers))
        self.elimination.set(frusta, layers, damping=damping)

    def forget(self) -> None:
        """Discard the cached tangents of all elements, so that the next `condense` recomputes them."""
        self._tangents.forget()

    @property
    def root_stiffness(self) -> np.ndarray:
        """Condensed stiffnesses (n, 3 r, 3 r) in N/mm of the frusta at their roots of r nodes."""
        return self.elimination.matrices

    def _springs(self, k, frusta, slope, friction):
        """`Springs` of the k-th layer's contact points in frusta (b,): `slope` (b, p) in N/mm, and `friction` if there is any."""
        at, place = np.flatnonzero(self.point_layer == k), self.elimination.stages[k].place
        springs = Springs(slope[:, at], place[3 * self.point_nodes[at] + self.point_axis[at, None]], self.point_weights[at])
        if friction is None:
            return springs
        return springs.with_others(self._friction_springs(at[at < self.board_points], place, friction, frusta))

    def _friction_springs(self, at, place, stiffness, frusta):
        """Friction at points on the board, of stiffness (b, all points on the board, 2, 2) in N/mm3.

        Three springs at each point represent its symmetric 2 x 2 matrix: along x, along y, and on the sum of both components.
        """
        K = stiffness[:, at] * self.point_area[frusta][:, at, None, None]
        both = K[..., 0, 1]
        x, y = (place[3 * self.point_nodes[at] + axis] for axis in (0, 1))
        weights, held = self.point_weights[at], np.full(x.shape, -1)
        return Springs(np.hstack([K[..., 0, 0] - both, K[..., 1, 1] - both, both]),
                       np.vstack([np.hstack([x, held]), np.hstack([held, y]), np.hstack([x, y])]), np.tile(weights, (3, 2)))

    def _layer_tangents(self, k, displacement, frusta, kept_mm):
        """Packed tangents (b, h, w) of the k-th layer's h elements in frusta (b,)."""
        hexes = self.mesh.layer(k)
        elements = frusta[:, None] * len(self.mesh.hexes) + k * len(hexes) + np.arange(len(hexes))
        tangents = self._tangents.at(displacement[:, hexes].reshape(-1, 27, 3), elements.ravel(), kept_mm=kept_mm)
        return tangents.reshape(*elements.shape, -1)

    def condensed_residual(self, state: SupportState, *, workers: Workers = SERIAL) -> tuple[np.ndarray, list[np.ndarray]]:
        """Root forces (n, 75) after elimination of the inner residual, and the forward-solved right-hand sides of `inner_step`."""
        force = state.force.reshape(self.count, -1).copy()
        forward_solved = self.elimination.residual(force, workers=workers)
        return force[:, self.root_dofs], forward_solved

    def inner_step(self, forward_solved: list[np.ndarray], root_step: np.ndarray, *, workers: Workers = SERIAL) -> np.ndarray:
        """Newton step (n, nodes, 3) of the frusta for the roots' step (n, 75)."""
        step = np.zeros((self.count, 3 * self.nodes))
        step[:, self.root_dofs] = root_step
        self.elimination.recover(forward_solved, step, workers=workers)
        return step.reshape(self.count, self.nodes, 3)

    def local_step(self, state: SupportState, frusta: np.ndarray, *, workers: Workers = SERIAL) -> np.ndarray:
        """Newton step (k, nodes, 3) of the given frusta with fixed roots, by their last condensed tangents."""
        force, step = state.force[frusta].reshape(len(frusta), -1), np.zeros((len(frusta), 3 * self.nodes))
        forward_solved = self.elimination.residual(force, bodies=frusta, workers=workers)
        self.elimination.recover(forward_solved, step, bodies=frusta, workers=workers)
        return step.reshape(len(frusta), self.nodes, 3)

    def inner_residual(self, state: SupportState) -> np.ndarray:
        """Unbalanced forces (n, inner) of the inner unknowns."""
        return state.force.reshape(self.count, -1)[:, self.inner]

    def compression(self, displacement: np.ndarray) -> np.ndarray:
        """Mean compression (n,) of each frustum in mm: displacement of the root relative to the tip."""
        return displacement[:, self.tip, 2].mean(axis=1) - displacement[:, self.root, 2].mean(axis=1)

    def largest_compression(self, displacement: np.ndarray) -> float:
        """Largest compression (mm) of a frustum."""
        return self.compression(displacement).max()

    def most_compressed(self, state: SupportState) -> tuple[float, str]:
        """Largest compression of a frustum relative to its height, and which frustum in words."""
        share = self.compression(state.displacement) / self.geometry.heights
        worst = int(np.argmax(share))
        x, y = self.geometry.centres[worst]
        return float(share[worst]), f"the frustum at x {x:.1f}, y {y:.1f} mm is compressed by {share[worst]:.0%} of its height"
