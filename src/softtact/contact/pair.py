"""Two surfaces that meet: unilateral contact with Coulomb friction, between deformable bodies or with a rigid one.

Normal: penalty with offsets (augmented Lagrange in terms of lengths): p = k max(0, offset - g), and an augmentation makes a point's
last overlap its offset, so that the same pressure leaves none. Friction: the traction on the points' surface is that of the step's
beginning minus k times the slip on the other surface since, held to mu p. A point that comes to touch within a step slips from
where it met the other surface on: that is known once the other side has moved, so it rubs from then on (`anchored`).
Of friction's tangent, the part by which the bound changes with the pressure is not symmetric; it is kept apart (`add_coupling`), so
that the matrix is symmetric.
References: Wriggers, Computational Contact Mechanics, 2nd ed. (2006), ch. 4 to 6; Simo and Laursen, Comput. Struct. 42 (1992) 97.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from softtact.contact import surface_kernels as kernels
from softtact.contact.facet_shapes import QUAD8
from softtact.contact.facet_tree import refit
from softtact.contact.pair_state import PairHistory, PairState, Totals
from softtact.contact.segments import segment_points
from softtact.contact.surface_places import frames_on, places, places_on
from softtact.contact.surfaces import Surface, SurfacePoints, quadrature_points

_ROUNDING_MM = 1e-7  # surfaces that lie on each other from the start touch, whatever the sign of their rounding
_RIM = 0.02  # of a facet's size: how far a point beside the other surface's rim still meets it
_BESIDE = 0.1  # of a facet's width: how far beside the facet that it meets a point may stand in a balanced state
_YIELD = 1e-6  # a step begins with what slid before at its bound: it may stick as well
_LEAST_COSINE = 0.1  # of the angle between opposite normals: walls across a surface do not meet it


@dataclass
class ContactPair:
    """Points of a `surface` against the facets of an `other` one.

    stiffness: penalty in N/mm3;  reach_mm: farthest distance of points that meet;  friction: Coulomb's coefficient
    segments: cut the facets along those of the other surface: for two meshes that do not match;  rigid: the other surface has no
    unknowns;  axisymmetric, thickness_mm: what a plane's points stand for
    """

    surface: Surface
    other: Surface
    stiffness: float
    reach_mm: float
    friction: float = 0.0
    segments: bool = False
    rigid: bool = False
    axisymmetric: bool = False
    thickness_mm: float = 1.0
    name: str = "contact"
    _tree: object = field(default=None, repr=False)

    @property
    def itself(self) -> bool:
        """Whether a surface meets itself."""
        return self.surface is self.other

    def supported_nodes(self) -> np.ndarray:
        """None: contact holds nothing before it begins."""
        return np.zeros(0, dtype=np.int64)

    def first(self, at_rest: np.ndarray) -> PairHistory:
        """The history before any load, nodes at rest (n, 3)."""
        self._tree, self._rims = self.other.tree(at_rest), self.other.rims(at_rest)
        self._rim_mm = _RIM * self.surface.size_mm(at_rest)
        return self._fresh(self._points(at_rest, at_rest), at_rest)

    def _points(self, x, at_rest):
        options = {"axisymmetric": self.axisymmetric, "thickness_mm": self.thickness_mm}
        if self.segments and not self.itself:
            return segment_points(self.surface, self.other, x, at_rest, reach=self.reach_mm, **options)
        return quadrature_points(self.surface, at_rest, **options)

    def _fresh(self, points, x):
        count = len(points.facet)
        anchor = self._project(points, x, None)
        return PairHistory(
            points,
            np.zeros(count),
            np.zeros((count, 2)),
            anchor,
            self._slip(points, anchor, anchor, x),
            np.zeros(count),
            self.stiffness,
            anchor.gap < _ROUNDING_MM,
            self._begun(points, anchor, x),
        )

    def _begun(self, points, anchor, x):
        """Places (2, p, 3) in mm of the points and of their anchors."""
        return np.array([places(points, x), places_on(anchor.facet, anchor.coordinates, self.other.nodes, self.other.kinds, x)])

    def _slip(self, points, anchor, projection, x):
        """Vectors (p, 3) in mm from the anchors to the points' feet on the other surface."""
        slip = places(points, x) - places_on(anchor.facet, anchor.coordinates, self.other.nodes, self.other.kinds, x)
        slip -= np.einsum("pi,pj,pj->pi", projection.normal, projection.normal, slip)
        return np.where((anchor.facet >= 0)[:, None], slip, 0.0)

    def _frames(self, anchor, x):
        """Directions (p, 2, 3) at the anchors, which turn with the other surface."""
        return frames_on(anchor.facet, anchor.coordinates, self.other.nodes, self.other.kinds, x)

    def _project(self, points, x, hint):
        refit(self._tree, x)
        count = len(points.facet)
        known = hint is not None and len(hint.facet) == count
        before, near = (hint.facet, hint.coordinates) if known else (np.full(count, -1), np.zeros((count, 2)))
        return kernels.project(
            points,
            self.other.nodes,
            self.other.kinds,
            self._rims,
            self._tree,
            x,
            self.reach_mm,
            self._rim_mm,
            _LEAST_COSINE,
            self.itself,
            before,
            near,
        )

    def begin_step(self, history: PairHistory, state: PairState, x: np.ndarray, at_rest: np.ndarray) -> PairHistory:
        """The history as a step begins, from a balanced state with nodes at x (n, 3): new anchors and, of segments, new points."""
        slid = np.where(state.pressure > 0, history.slid + state.slid_mm, 0.0)
        traction = np.where((state.pressure > 0)[:, None], state.friction, 0.0)
        if not self.segments or self.itself:
            start = self._slip(history.points, state.projection, state.projection, x)
            kept = np.einsum("pki,pi->pk", self._frames(state.projection, x), traction)
            return replace(history, traction=kept, anchor=state.projection, start=start, slid=slid, rubs=state.slope > 0,
                           begun=self._begun(history.points, state.projection, x), overlap_mm=np.inf)
        fresh = self._fresh(self._points(x, at_rest), x)
        if not len(fresh.points.facet) or not len(history.points.facet):
            return fresh
        _, near = cKDTree(places(history.points, at_rest)).query(places(fresh.points, at_rest))
        return replace(
            fresh,
            offset=state.pressure[near] / history.stiffness,
            traction=np.einsum("pki,pi->pk", self._frames(fresh.anchor, x), traction[near]),
            slid=slid[near],
            stiffness=history.stiffness,
            rubs=state.slope[near] > 0,
        )

    def evaluate(self, history: PairHistory, x: np.ndarray, before: PairState | None = None, *, nearby: bool = False) -> PairState:
        """`PairState` with nodes at x (n, 3) in mm.

        before: the state that this one follows on: its points keep their facets where they stand over them
        nearby: friction continues that state's along its tangent, for a derivative that agrees with it where points begin to slide
        """
        projection = self._project(history.points, x, None if before is None else before.projection)
        overlap = np.where(projection.facet >= 0, history.offset - projection.gap, -1.0)
        touches, deep = overlap > -_ROUNDING_MM, np.maximum(overlap, 0.0)
        pressure, slope = history.stiffness * deep, np.where(touches, history.stiffness, 0.0)
        energy = 0.5 * float((history.points.weight * pressure * deep).sum())
        if nearby and before is not None and self.friction:
            return self._continued(history, before, projection, pressure, slope, x)
        friction, stiffness, slip, slides, stored = self._friction(history, projection, x, pressure, touches)
        return PairState(projection, pressure, slope, friction, stiffness, slip, slides, energy + stored)

    def _continued(self, history, before, projection, pressure, slope, x):
        """The state with friction along the tangent of the one before."""
        tangential = np.eye(3) - projection.normal[:, :, None] * projection.normal[:, None]
        slip = self._slip(history.points, history.anchor, projection, x) - np.einsum("pij,pj->pi", tangential, history.start)
        slip = np.where((before.slope > 0)[:, None], slip, before.slip)
        grown = before.slides * (pressure - before.pressure) / np.maximum(before.pressure, 1e-300) * (before.pressure > 0)
        friction = before.friction * (1 + grown)[:, None] - np.einsum("pij,pj->pi", before.stiffness, slip - before.slip)
        return PairState(projection, pressure, slope, friction, before.stiffness, slip, before.slides, before.energy)

    def _friction(self, history, projection, x, pressure, touches):
        count = len(touches)
        if not self.friction:
            return np.zeros((count, 3)), np.zeros((0, 3, 3)), np.zeros((count, 3)), np.ones(count, bool), 0.0
        anchor, bound = history.anchor, self.friction * pressure
        acts = touches & (anchor.facet >= 0) & history.rubs
        tangential = np.eye(3) - projection.normal[:, :, None] * projection.normal[:, None]
        slip = self._slip(history.points, anchor, projection, x) - np.einsum("pij,pj->pi", tangential, history.start)
        slip = np.where(acts[:, None], slip, 0.0)
        before = np.einsum("pki,pk->pi", self._frames(anchor, x), history.traction)
        trial = np.einsum("pij,pj->pi", tangential, before) - self.stiffness * slip
        size = np.linalg.norm(trial, axis=1)
        slides = acts & (size > bound * (1 + _YIELD))
        share = np.where(slides, bound / np.maximum(size, 1e-300), 1.0)
        direction = trial / np.maximum(size, 1e-300)[:, None]
        stiffness = self.stiffness * tangential * (share * acts)[:, None, None]
        stiffness -= (self.stiffness * share * slides)[:, None, None] * direction[:, :, None] * direction[:, None]
        energy = np.where(slides, bound * size - 0.5 * bound**2, 0.5 * size**2) / self.stiffness
        return (trial * (share * acts)[:, None], stiffness, slip, slides, float((history.points.weight * energy * acts).sum()))

    def add_forces(self, history: PairHistory, state: PairState, force: np.ndarray) -> None:
        """Add the derivative of the contact's potential to nodal forces (n, 3) in N."""
        points, projection, other = history.points, state.projection, self.other
        kernels.add_forces_of(
            force,
            points,
            projection.facet,
            projection.coordinates,
            other.nodes,
            other.kinds,
            state.pressure[:, None] * projection.normal,
        )
        if self.friction:
            anchor = history.anchor
            kernels.add_forces_of(force, points, anchor.facet, anchor.coordinates, other.nodes, other.kinds, state.friction)

    def totals(self, history: PairHistory, state: PairState) -> Totals:
        """The penalties' energy, and the sum of the contact forces' magnitudes."""
        return Totals(penalty=state.energy, size=float(history.points.weight @ state.pressure))

    def slides(self, history: PairHistory, state: PairState) -> bool:
        """Whether points slide under pressure: the tangent then has the part of `add_coupling`."""
        return bool(self.friction) and bool((state.slides & (state.pressure > 0)).any())

    def dissipated_mj(self, history: PairHistory, state: PairState) -> float:
        """What friction took since the step began."""
        return float(history.points.weight @ (-(state.slip * state.friction).sum(axis=1) * state.slides))

    def conservative(self, history: PairHistory) -> bool:
        """Penalties have a potential."""
        return True

    def penetration_mm(self, state: PairState) -> float:
        """Deepest overlap of single points."""
        return state.penetration_mm()

    def unresolved_n(self, history: PairHistory, state: PairState, penetration_mm: float) -> float:
        """Force in N at an overlap of so much of all points that touch."""
        return penetration_mm * float(history.points.weight @ state.slope)

    def gap_mm(self, state: PairState) -> float:
        """Least gap of the points; infinite where none is within reach of the other surface."""
        return float(np.min(state.projection.gap, initial=np.inf))

    def add_coupling(self, history: PairHistory, state: PairState, change: np.ndarray, force: np.ndarray) -> None:
        """Add to nodal forces (n, 3) what sliding friction changes by the pressure that changes with the nodes' places (n, 3).

        This part of the tangent is not symmetric and not in the matrix.
        """
        here = state.slides & (state.slope > 0) & (state.pressure > 0)
        if not self.friction or not here.any():
            return
        points, projection, other, anchor = history.points, state.projection, self.other, history.anchor
        apart = places(points, change) - places_on(projection.facet, projection.coordinates, other.nodes, other.kinds, change)
        pressure = -state.slope * (apart * projection.normal).sum(axis=1) * here
        direction = state.friction / np.maximum(self.friction * state.pressure, 1e-300)[:, None]
        kernels.add_forces_of(
            force,
            points,
            anchor.facet,
            anchor.coordinates,
            other.nodes,
            other.kinds,
            (self.friction * pressure)[:, None] * direction * here[:, None],
        )

    def tangents(
        self, history: PairHistory, state: PairState, x: np.ndarray, *, turning: bool = True
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Nodes (q, k) of pairs of facets and their matrices (q, 3 k, 3 k) in N/mm, of which the upper triangle counts.

        turning: with what the pressure does as the surfaces turn and bend
        """
        points, other, width = history.points, self.other, self.surface.width
        touching = state.slope > 0
        nodes, pair = self._pairs(points, np.where(touching, state.projection.facet, -1))
        out = np.zeros((len(nodes), 3 * nodes.shape[1], 3 * nodes.shape[1]))
        kernels.add_pair_tangents(
            out,
            pair,
            points,
            state.projection,
            other.nodes,
            other.kinds,
            x,
            state.pressure if turning else np.zeros_like(state.pressure),
            state.slope,
            width,
            not self.rigid,
        )
        if not self.friction:
            return [(nodes, out)]
        anchor = history.anchor
        nodes2, pair = self._pairs(points, np.where(touching, anchor.facet, -1))
        rubbed = np.zeros((len(nodes2), 3 * nodes2.shape[1], 3 * nodes2.shape[1]))
        kernels.add_friction_tangents(
            rubbed, pair, points, anchor.facet, anchor.coordinates, other.kinds, state.stiffness, width, not self.rigid
        )
        return [(nodes, out), (nodes2, rubbed)]

    def _pairs(self, points: SurfacePoints, facet: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (q, k) of the pairs of facets that meet, and the pair (p,) of each point, -1 where `facet` is.

        A node of no facet is the pair's first one: its entries are zero.
        """
        meets = np.flatnonzero(facet >= 0)
        key = points.facet[meets] * (1 if self.rigid else len(self.other.kinds)) + (0 if self.rigid else facet[meets])
        _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
        pair = np.full(len(facet), -1)
        pair[meets] = inverse.ravel()
        nodes = points.nodes[meets[first], : self.surface.width]
        if not self.rigid:
            nodes = np.hstack([nodes, self.other.nodes[facet[meets[first]], : self.other.width]])
        return np.ascontiguousarray(np.where(nodes < 0, nodes[:, :1], nodes)), pair

    def anchored(self, history: PairHistory, state: PairState, x: np.ndarray) -> PairHistory:
        """The history with an anchor for points that came to touch since the step began: where they met the other surface.

        They met as their gap closed by the motion of the side that came nearer; the other one gave way from then on.
        """
        new = self._new(history, state)
        if not new.any():
            return history
        normal, apart = state.projection.normal, history.begun[0] - history.begun[1]
        point, anchor = self._begun(history.points, history.anchor, x) - history.begun
        nearer = np.einsum("kpi,pi->kp", np.array([-point, anchor]), normal)
        gap, fastest = (apart * normal).sum(axis=1), np.maximum(nearer.max(axis=0), 1e-300)
        share = np.clip(gap / fastest, 0.0, 1.0)[:, None]
        met = apart + share * np.where((nearer[1] >= nearer[0])[:, None], -anchor, point)
        return replace(history, start=np.where(new[:, None], met, history.start), rubs=history.rubs | new)

    def _new(self, history, state):
        """Points (p,) under pressure that did not touch as the step began and have no anchor of their own yet."""
        return ~history.rubs & (state.pressure > 0) & (history.anchor.facet >= 0) & (self.friction > 0)

    def augmented(self, history: PairHistory, state: PairState) -> PairHistory:
        """The history with offsets that hold the surfaces where they just touch, in the mean and the slope over each facet.

        There are more points than displacements that could follow them: offsets of single points would leave few of them in touch,
        and their pressures without order. Where an augmentation hardly lowers the overlap, the penalty is doubled.
        """
        overlap, factor = self.overlap_mm(history, state), 1.0
        if overlap > 0.5 * history.overlap_mm:
            factor = 2.0
        return replace(
            history,
            offset=np.maximum(0.0, self._linear(history, state.pressure / history.stiffness)) / factor,
            stiffness=factor * history.stiffness,
            overlap_mm=overlap,
        )

    def overlap_mm(self, history: PairHistory, state: PairState) -> float:
        """Largest overlap (mm), or gap under pressure, of the surfaces, in the mean and the slope over each facet.

        What single points of a rough surface overlap beyond that, no facet could follow: `PairState.penetration_mm` has it.
        """
        off = self._linear(history, np.where(state.pressure > 0, state.pressure / history.stiffness - history.offset, 0.0))
        return float(np.abs(off).max(initial=0.0))

    def _linear(self, history: PairHistory, values: np.ndarray) -> np.ndarray:
        """The linear functions on each facet that are nearest to values (p,), at the points."""
        points = history.points
        basis = np.column_stack([np.ones(len(values)), points.coordinates[:, : 1 if self.surface.is_line else 2]])
        count, k = len(self.surface.kinds), basis.shape[1]
        gram, right = np.zeros((count, k, k)), np.zeros((count, k))
        weighted = basis * points.weight[:, None]
        np.add.at(gram, points.facet, weighted[:, :, None] * basis[:, None])
        np.add.at(right, points.facet, weighted * values[:, None])
        gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(k) + 1e-300 * np.eye(k)
        return (basis * np.linalg.solve(gram, right[..., None])[points.facet, :, 0]).sum(axis=1)

    def settled(self, history: PairHistory, state: PairState, tolerance_mm: float) -> bool:
        """Whether surfaces overlap by no more than the tolerance, pressed points lie over the facets that they meet, and rub."""
        if np.isinf(history.overlap_mm) and self._new(history, state).any():      # once, for a few may touch and leave in turns
            return False
        here = np.flatnonzero(state.pressure > 0)
        facets, (xi, eta) = state.projection.facet[here], state.projection.coordinates[here].T
        kinds = self.other.kinds[facets]
        beyond = np.where(kinds >= QUAD8, np.maximum(np.abs(xi), np.abs(eta)) - 1, np.maximum(-np.minimum(xi, eta), xi + eta - 1))
        return self.overlap_mm(history, state) <= tolerance_mm and float(np.max(beyond, initial=0.0)) <= _BESIDE
