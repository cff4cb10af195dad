"""Contact of a rigid object with the slab's top: quadrature points of the top faces, each projected on a plane of the object.

The planes are those of the facets over the points, with the shares that edges cover of the points' areas (`contact.edges`). Where
the cover would fold under an edge, they touch the object with rounded edges at the places nearest to the points
(`contact.rounded_object`). The points, four times as many, then count with their whole areas, and the contact is a continuous
function of their places.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from softtact.contact.edges import OVERRUN_MM, ROWS, contact_compliance, continues, covered, face_walls, point_areas
from softtact.contact.friction import Coulomb, FrictionResponse, FrictionState
from softtact.contact.height_field import NO_CONTACT_MM
from softtact.contact.penalty import Contact
from softtact.fem.elements import QUAD8
from softtact.fem.graded_mesh import CoverMesh
from softtact.fem.quadrature import gauss, midpoints
from softtact.models.hyperelastic.states import ContactHistory, ContactProjection, ObjectSurface, SlabState

_ROUNDED_ROWS = 6     # points across a face under an object with rounded edges: 0.1 mm apart on the draft mesh
# ... and the factor of their penalty. A face cannot follow an edge sharper than itself: under augmentations single points overlap,
# others gape, without end. With this factor the pressures of some 20 MPa at edges overlap by less than is allowed, without any.
_ROUNDED_STIFFNESS = 10.0
_NEAR_MM, _LARGEST_SHIFT_MM = 0.2, 0.02   # gaps of points that `balanced` considers; its largest step of the object


@dataclass(frozen=True)
class Touch:
    """Contact at one displacement: energy (mJ), forces (t, w, 3) in N on the faces' nodes, gaps (p,) in mm of the points.

    indentation_force: the object's force, N downwards;  friction_response: at the points, None without friction
    """

    energy: float
    force: np.ndarray
    gaps: np.ndarray
    indentation_force: float
    friction_response: FrictionResponse | None = None


class TopContact:
    """The contact points of a `CoverMesh`'s top faces (p = t * points): areas (p,) in mm2, reference positions (p, 3) in mm.

    faces (t, w): the free nodes that determine a face, values (t, points, w): their shape values at its points.
    """

    def __init__(self, mesh: CoverMesh, contact: Contact, *, plane_modulus: float, friction: Coulomb | None = None) -> None:
        """contact: `Contact`, the law of the points;  friction: `Coulomb` of the object on them, or None.

        plane_modulus: E / (1 - nu^2) in MPa of the material under the object
        """
        self.contact, self.friction = contact, friction
        self._mesh, self._plane_modulus = mesh, plane_modulus
        self._sets: dict[bool, tuple[np.ndarray, ...]] = {}
        self.round_edges(False)

    def round_edges(self, rounds: bool) -> None:
        """Project the points on the object with rounded edges from now on, or not. A new set of points has no history."""
        self.rounds_edges = rounds
        if rounds not in self._sets:
            self._sets[rounds] = _points_of(self._mesh, midpoints(_ROUNDED_ROWS, 2) if rounds else gauss(ROWS, 2))
        self.faces, self.values, self.area = self._sets[rounds]
        self.reference = self.at_points(self._mesh.points)
        if not rounds:
            half = 0.5 * np.ptp(self._mesh.points[self._mesh.top[:, :4]][..., :2], axis=1)
            self._rectangles = point_areas(half, gauss(ROWS, 2)[0]).reshape(-1, 4, 2)
            self._give = 2.0 * np.sqrt(half.prod(axis=1)) / self._plane_modulus

    def at_points(self, field: np.ndarray) -> np.ndarray:
        """A nodal field (n, 3) at the points (p, 3)."""
        return np.matmul(self.values, field[self.faces]).reshape(-1, 3)

    def project(self, displacement: np.ndarray, surface: ObjectSurface, indentation: float | None = None) -> ContactProjection:
        """The `ContactProjection` of the points; a `MovedSurface` has the object's displacement along x and y.

        indentation: of the object in mm, if points far under an edge are to be projected on the nearby wall
        """
        if self.rounds_edges:
            return self._on_rounded(displacement, surface, indentation)
        position = self.reference + self.at_points(displacement)
        height, normals = surface(position[:, 0], position[:, 1])
        anchors = np.column_stack([position[:, :2], height])
        share, foot = covered(position[:, None, :2] + self._rectangles, surface)     # type: ignore[arg-type]
        # A point beside the object whose area is partly covered is projected on the plane of its lowest corner.
        base, foot_normals = surface(*foot.T)
        beside = ~continues(height, position[:, :2], base, foot)
        anchors[beside] = np.column_stack([foot, base])[beside]
        normals[beside] = foot_normals[beside]
        share[anchors[:, 2] >= NO_CONTACT_MM] = 0.0
        overrun = np.zeros(len(share), dtype=bool)
        if indentation is not None:
            overlap = -normals[:, 2] * (position[:, 2] + indentation - height)
            overrun = ~beside & (overlap > OVERRUN_MM)
            face_walls(anchors, normals, np.flatnonzero(overrun), position + [0.0, 0.0, indentation], overlap, surface)
        return ContactProjection(anchors=anchors, normals=normals, covered=share, beside=beside,
                                 contact_compliance=contact_compliance(share, self._give),
                                 offset_mm=np.asarray(getattr(surface, "offset_mm", (0.0, 0.0))), overrun=overrun)

    def _on_rounded(self, displacement, surface, indentation):
        """The projection on the nearest places of the object with rounded edges; of points deep inside, on the facets over them."""
        rounded = surface.rounded
        place = self.reference + self.at_points(displacement) + [0.0, 0.0, indentation]
        distance, normals = rounded.averaged(place)
        height, over = surface(place[:, 0], place[:, 1])
        deep = (distance >= NO_CONTACT_MM) & (place[:, 2] > height)
        distance[deep], normals[deep] = (over[deep, 2] * (place[deep, 2] - height[deep])), over[deep]
        near = distance < NO_CONTACT_MM
        along = normals.T / np.einsum("pi,pi->p", normals, normals)      # means of directions are shorter than 1
        anchors = np.where(near, place.T - distance * along, np.array([[0.0], [0.0], [NO_CONTACT_MM]])).T
        return ContactProjection(anchors=anchors, normals=normals, covered=near.astype(float), beside=~near,
                                 contact_compliance=np.zeros(len(near)), overrun=np.zeros(len(near), dtype=bool),
                                 offset_mm=np.asarray(getattr(surface, "offset_mm", (0.0, 0.0))), edge_radius_mm=rounded.radius_mm)

    def fresh_history(self) -> ContactHistory:
        """The contact's history before the first touch."""
        stiffer = _ROUNDED_STIFFNESS if self.rounds_edges else 1.0
        return ContactHistory(replace(self.contact, stiffness=stiffer * self.contact.stiffness))

    def contact_on(self, projection: ContactProjection, history: ContactHistory) -> Contact:
        """The points' `Contact` with the covered areas and compliances of a projection."""
        return replace(history.contact, contact_compliance=projection.contact_compliance)

    def contact_of(self, state: SlabState) -> Contact:
        """The points' `Contact` in a `SlabState`."""
        return self.contact_on(state.projection, state.history)

    def gaps(self, displacement: np.ndarray, projection: ContactProjection, indentation: float) -> np.ndarray:
        """Normal gaps (p,) in mm between the points and their planes."""
        offset = self.reference + self.at_points(displacement) - projection.anchors
        return np.einsum("pd,pd->p", projection.normals, offset) + indentation * projection.normals[:, 2]

    def surface_gaps(self, state: SlabState) -> np.ndarray:
        """Gaps (p,) of the points under the object without the springs at edges; NO_CONTACT_MM for points beside it."""
        return np.where(state.projection.beside, NO_CONTACT_MM, self.contact_of(state).surface_gaps(state.gaps))

    def error(self, state: SlabState) -> float:
        """Deepest overlap, or widest gap under pressure, in mm of points under the object."""
        return self.contact_of(state).error(np.where(state.projection.beside, NO_CONTACT_MM, state.gaps))

    def augmented(self, state: SlabState) -> ContactHistory:
        """The contact's history after one augmentation."""
        return replace(state.history, contact=self.contact_of(state).augmented(state.gaps))

    def touch(self, displacement: np.ndarray, projection: ContactProjection, indentation: float, history: ContactHistory) -> Touch:
        """The contact with the object `indentation` mm below its pose."""
        gaps, normals = self.gaps(displacement, projection, indentation), projection.normals
        density, pressure, _ = self.contact_on(projection, history).response(gaps)
        area = self.area * projection.covered
        push = (pressure * area)[:, None] * normals      # on the slab: along the object's outward normal
        touch = Touch(energy=float(density @ area), force=-self._on_nodes(push), gaps=gaps,
                      indentation_force=float(-push[:, 2].sum()))
        if history.friction is None:
            return touch
        return self._with_friction(touch, history.friction, displacement, projection, indentation)

    def _with_friction(self, touch, friction_state, displacement, projection, indentation):
        """The contact with friction's energy and forces, which act on the covered area like the pressure."""
        area = self.area * projection.covered
        place = self._in_object(displacement, projection, indentation)
        # Means of directions are shorter than 1; what slides is what is across them.
        across = projection.normals / np.linalg.norm(projection.normals, axis=1, keepdims=True)
        friction_response = friction_state.friction_response(place, across)
        pull = friction_response.traction * area[:, None]
        # The indentation moves the points upwards in the object's frame, so vertical slip components resist it.
        return replace(touch, energy=touch.energy + float(friction_response.energy @ area),
                       force=touch.force + self._on_nodes(pull),
                       indentation_force=touch.indentation_force + float(pull[:, 2].sum()), friction_response=friction_response)

    def _on_nodes(self, forces):
        """Forces (p, 3) in N at the points as forces (t, w, 3) on the faces' nodes."""
        return np.matmul(self.values.transpose(0, 2, 1), forces.reshape(len(self.faces), -1, 3))

    def _in_object(self, displacement, projection, indentation):
        """Positions (p, 3) of the points in the object's frame, for its indentation and the projection's displacement."""
        return self.reference + self.at_points(displacement) + [*-projection.offset_mm, indentation]

    def first_friction_state(self, state: SlabState, indentation: float) -> FrictionState | None:
        """The friction state of a step that starts from a `SlabState`, None without friction."""
        if self.friction is None:
            return None
        if state.friction_response is None:
            place = self._in_object(state.displacement, state.projection, indentation)
            return FrictionState.first(self.friction, place, state.gaps)
        return state.friction_response.next_step(state.gaps)

    def renewed_friction_state(self, state: SlabState) -> FrictionState:
        """The friction state with the pressures of a `SlabState`."""
        response: Any = state.friction_response
        return response.next_pass(state.gaps, self._pressure(state))

    def _pressure(self, state):
        """Pressure (p,) in MPa on the covered part of the points' areas."""
        return self.contact_of(state).response(state.gaps)[1]

    def balanced(self, state: SlabState, indentation: float, force_n: float) -> float:
        """The indentation (mm) at which the object's force without friction is `force_n`, at fixed nodes.

        Newton's method with bounded steps; the force increases monotonically with the depth.
        """
        near = np.flatnonzero(state.gaps < _NEAR_MM)
        down, area = -state.projection.normals[near, 2], (self.area * state.projection.covered)[near]
        contact, gaps, shift = self.contact_of(state).at(near), state.gaps[near], 0.0
        for _ in range(50):
            _, pressure, slope = contact.response(gaps - shift * down)
            excess = pressure @ (down * area) - force_n
            if abs(excess) <= 1e-9 * force_n:
                break
            stiffness = slope @ (down**2 * area)
            shift -= np.clip(excess / max(stiffness, 1e-12), -_LARGEST_SHIFT_MM, _LARGEST_SHIFT_MM)
        return indentation + shift

    def stiffness(self, state: SlabState) -> np.ndarray:
        """Stiffness (p,) in N/mm of the points along their normals."""
        return self.contact_of(state).response(state.gaps)[2] * self.area * state.projection.covered

    def area_under_pressure(self, state: SlabState) -> float:
        """Covered area in mm2 of the points under pressure.

        The criterion is the pressure, not the gap: after augmentations, gaps in contact are near zero with either sign.
        """
        return float((self.area * state.projection.covered)[self.under_pressure(state)].sum())

    def under_pressure(self, state: SlabState) -> np.ndarray:
        """Which points (p,) carry pressure."""
        return self._pressure(state) * state.projection.covered > 0

    def resultant(self, state: SlabState) -> tuple[np.ndarray, np.ndarray]:
        """Force (3,) in N of the object on the surface, and its torque (3,) in N mm about the sensor frame's origin."""
        area = (self.area * state.projection.covered)[:, None]
        force = self._pressure(state)[:, None] * state.projection.normals * area
        if state.friction_response is not None:
            force = force - state.friction_response.traction * area
        return force.sum(axis=0), np.cross(self.reference + self.at_points(state.displacement), force).sum(axis=0)

    def slip_at(self, state: SlabState, places: np.ndarray) -> np.ndarray:
        """Sliding path (n,) in mm of the surface on the object at places (n, 2); nan where there is no pressure.

        Taken from the nearest contact point within the extent of its area; nan everywhere without friction.
        """
        slip, touching = np.full(len(places), np.nan), self.under_pressure(state)
        if state.friction_response is None or not touching.any():
            return slip
        points = (self.reference + self.at_points(state.displacement))[:, :2]
        distance, nearest = cKDTree(points).query(places)
        here = touching[nearest] & (distance <= np.sqrt(self.area[nearest]))
        slip[here] = state.friction_response.slid[nearest[here]]
        return slip

    def pressure_of_faces(self, state: SlabState) -> np.ndarray:
        """Mean pressure (t,) in MPa on each face."""
        area = self.area.reshape(len(self.faces), -1)
        force = self._pressure(state) * self.area * state.projection.covered
        return force.reshape(area.shape).sum(axis=1) / area.sum(axis=1)

    def normal_shapes(self, projection: ContactProjection) -> np.ndarray:
        """Derivatives (t, points, 3 w) of the points' gaps by the faces' unknowns."""
        normal = projection.normals.reshape(*self.values.shape[:2], 3)
        return np.einsum("tga,tgd->tgad", self.values, normal).reshape(*normal.shape[:2], -1)

    def projected_nodes(self, gaps: np.ndarray, projection: ContactProjection, within_mm: float) -> tuple[np.ndarray, np.ndarray]:
        """Free nodes (k,) of faces with points under the object and gaps of less than `within_mm`, and their normals' moments.

        The latter are sums (k, 3, 3) of n n' over the points' normals n, weighted by their areas in mm2.
        """
        near = (gaps < within_mm) & (projection.covered > 0)
        weight = (self.area * projection.covered * near).reshape(len(self.faces), -1)
        normals = projection.normals.reshape(*weight.shape, 3)
        of_faces = np.einsum("tg,tga,tgi,tgj->taij", weight, np.abs(self.values), normals, normals, optimize=True)
        total = np.zeros((self.faces.max() + 1, 3, 3))
        np.add.at(total, self.faces, of_faces)
        nodes = np.flatnonzero(np.trace(total, axis1=1, axis2=2) > 0)
        return nodes, total[nodes]

    def friction_tangent(self, state: SlabState) -> tuple[np.ndarray, np.ndarray, float]:
        """Friction's tangent blocks (t, 3 w, 3 w) of the faces, border (t, 3 w) and corner.

        The border is the derivative of the nodal forces by the indentation, the corner the energy's second derivative by it.
        """
        area = (self.area * state.projection.covered)[:, None, None]
        response: Any = state.friction_response
        slope = (response.stiffness() * area).reshape(*self.values.shape[:2], 3, 3)
        along = np.einsum("tga,tgij->tgaij", self.values, slope)
        blocks = np.einsum("tgaij,tgb->taibj", along, self.values, optimize=True)
        size = 3 * self.values.shape[2]
        return blocks.reshape(-1, size, size), along[..., 2].sum(axis=1).reshape(-1, size), float(slope[..., 2, 2].sum())


def _points_of(mesh, rule):
    """`faces`, `values` and `area` of `TopContact` with a rule's points on each face."""
    points, weights = rule
    values, slopes = QUAD8.shape(points)
    edges = np.einsum("tad,gai->tgdi", mesh.points[mesh.top][..., :2], slopes)
    faces, values = _of_free_nodes(mesh.follow, mesh.top, np.broadcast_to(values, (len(mesh.top), *values.shape)))
    return faces, values, (np.linalg.det(edges) * weights).ravel()


def _of_free_nodes(follow, faces, values):
    """Free nodes (t, w) that determine faces (t, 8), and the shape values (t, g, 8) in terms of these (t, g, w)."""
    if (faces < follow.shape[1]).all():
        return faces, values
    rows = [follow[face] for face in faces]
    needed = [np.unique(row.indices) for row in rows]
    width = max(map(len, needed))
    nodes = np.stack([np.pad(n, (0, width - len(n)), mode="edge") for n in needed])
    out = np.zeros((*values.shape[:2], width))
    for t, (row, used) in enumerate(zip(rows, needed, strict=True)):
        out[t, :, :len(used)] = values[t] @ row[:, used].toarray()
    return nodes, out
