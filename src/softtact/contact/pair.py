"""Two surfaces that meet: unilateral contact with Coulomb friction, between deformable bodies or with a rigid one.

Normal: penalty with offsets (augmented Lagrange in terms of lengths): p = k max(0, offset - g), and an augmentation makes a point's
last overlap its offset, so that the same pressure leaves none. Friction: the traction on the points' surface is that of the step's
beginning minus k times the way that the point slid on the other surface since, held to mu p. The bound mu p is that of the
iteration's state, so that every iteration minimises a potential (Tresca's problem), and the tangent is symmetric.
References: Wriggers, Computational Contact Mechanics, 2nd ed. (2006), ch. 4 to 6; Simo and Laursen, Comput. Struct. 42 (1992) 97.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from softtact.contact import surface_kernels as kernels
from softtact.contact.facet_shapes import LINE2, QUAD8
from softtact.contact.facet_tree import refit
from softtact.contact.segments import segment_points
from softtact.contact.surface_kernels import Projection
from softtact.contact.surfaces import Surface, SurfacePoints, quadrature_points

_ROUNDING_MM = 1e-7      # surfaces that lie on each other from the start touch, whatever the sign of their rounding
_RIM = 0.02              # of a facet's size: how far a point beside the other surface's rim still meets it
_BESIDE = 0.1            # of a facet's width: how far beside the facet that it meets a point may stand in a balanced state
_LEAST_COSINE = 0.1      # of the angle between opposite normals: walls that stand across a surface are not what it meets


@dataclass(frozen=True)
class PairHistory:
    """What a pair remembers at a state: it belongs to the state, so that a body pressed twice gives the same."""

    points: SurfacePoints
    """The points of contact."""
    offset: np.ndarray
    """(p,) in mm, of the augmented penalty."""
    traction: np.ndarray
    """(p, 3) in MPa: friction on the points' surface when the step began."""
    anchor: Projection
    """Where the points were on the other surface when the step began."""
    start: np.ndarray
    """(n, 3) in mm: the nodes' places when the step began."""
    slid: np.ndarray
    """(p,) in mm: ways that the points slid on the other surface, up to the step's beginning."""
    stiffness: float
    """Penalty in N/mm3: the pair's, or larger where its augmentations came to a stand."""
    overlap_mm: float = np.inf
    """Deepest overlap at the last augmentation."""


@dataclass(frozen=True)
class PairState:
    """A pair's contact at given places of all nodes."""

    projection: Projection
    """The points' closest places."""
    pressure: np.ndarray
    """(p,) in MPa per area at rest, positive in compression."""
    slope: np.ndarray
    """(p,) in N/mm3."""
    friction: np.ndarray
    """(p, 3) in MPa: friction on the points' surface."""
    stiffness: np.ndarray
    """(p, 3, 3) in N/mm3: how friction stands against slip."""
    slip: np.ndarray
    """(p, 3) in mm: way of the points on the other surface within the step."""
    slides: np.ndarray
    """(p,) whether friction is at its bound."""
    energy: float
    """Energy in mJ of the penalties."""

    def penetration_mm(self) -> float:
        """Deepest overlap (mm)."""
        return float(max(0.0, -np.min(self.projection.gap, initial=0.0)))


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
        return PairHistory(points, np.zeros(count), np.zeros((count, 3)), self._project(points, x, None), x.copy(), np.zeros(count),
                           self.stiffness)

    def _project(self, points, x, hint):
        refit(self._tree, x)
        count = len(points.facet)
        known = hint is not None and len(hint.facet) == count
        before, near = (hint.facet, hint.coordinates) if known else (np.full(count, -1), np.zeros((count, 2)))
        return kernels.project(points, self.other.nodes, self.other.kinds, self._rims, self._tree, x, self.reach_mm, self._rim_mm,
                               _LEAST_COSINE, self.itself, before, near)

    def begin_step(self, history: PairHistory, state: PairState, x: np.ndarray, at_rest: np.ndarray) -> PairHistory:
        """The history at the begin of a step from a balanced state with nodes at x (n, 3): new anchors and, of segments, new points."""
        slid = history.slid + np.linalg.norm(state.slip, axis=1) * (state.pressure > 0)
        traction = np.where((state.pressure > 0)[:, None], state.friction, 0.0)
        if not self.segments or self.itself:
            return replace(history, traction=traction, anchor=state.projection, start=x.copy(), slid=slid)
        fresh = self._fresh(self._points(x, at_rest), x)
        if not len(fresh.points.facet) or not len(history.points.facet):
            return fresh
        _, near = cKDTree(kernels.places(history.points, at_rest)).query(kernels.places(fresh.points, at_rest))
        return replace(fresh, offset=self._smooth(fresh.points, state.pressure[near] / history.stiffness), traction=traction[near],
                       slid=slid[near], stiffness=history.stiffness)

    def evaluate(self, history: PairHistory, x: np.ndarray, before: PairState | None = None, *, bounded: bool = False) -> PairState:
        """`PairState` with nodes at x (n, 3) in mm.

        before: the state that this one follows on: its points keep their facets where they stand over them;  bounded: friction is
        bounded by mu times the pressure of that state
        """
        bound = before.pressure if before is not None and bounded else None
        projection = self._project(history.points, x, None if before is None else before.projection)
        overlap = np.where(projection.facet >= 0, history.offset - projection.gap, -1.0)
        touches, deep = overlap > -_ROUNDING_MM, np.maximum(overlap, 0.0)
        pressure, slope = history.stiffness * deep, np.where(touches, history.stiffness, 0.0)
        energy = 0.5 * float((history.points.weight * pressure * deep).sum())
        friction, stiffness, slip, slides, stored = self._friction(history, projection, x, pressure if bound is None else bound,
                                                                   touches)
        return PairState(projection, pressure, slope, friction, stiffness, slip, slides, energy + stored)

    def _friction(self, history, projection, x, pressure, touches):
        count = len(touches)
        if not self.friction:
            return np.zeros((count, 3)), np.zeros((0, 3, 3)), np.zeros((count, 3)), np.ones(count, bool), 0.0
        anchor, bound = history.anchor, self.friction * pressure
        acts = touches & (anchor.facet >= 0)
        way = kernels.places(history.points, x) - kernels.places(history.points, history.start)
        way -= (kernels.places_on(anchor.facet, anchor.coordinates, self.other.nodes, self.other.kinds, x)
                - kernels.places_on(anchor.facet, anchor.coordinates, self.other.nodes, self.other.kinds, history.start))
        tangential = np.eye(3) - projection.normal[:, :, None] * projection.normal[:, None]
        slip = np.einsum("pij,pj->pi", tangential, way) * acts[:, None]
        trial = np.einsum("pij,pj->pi", tangential, history.traction) - history.stiffness * slip
        size = np.linalg.norm(trial, axis=1)
        slides = acts & (size > bound)
        share = np.where(slides, bound / np.maximum(size, 1e-300), 1.0)
        direction = trial / np.maximum(size, 1e-300)[:, None]
        stiffness = history.stiffness * tangential * (share * acts)[:, None, None]
        stiffness -= (history.stiffness * share * slides)[:, None, None] * direction[:, :, None] * direction[:, None]
        energy = np.where(slides, bound * size - 0.5 * bound**2, 0.5 * size**2) / history.stiffness
        return (trial * (share * acts)[:, None], stiffness, slip, slides,
                float((history.points.weight * energy * acts).sum()))

    def add_forces(self, history: PairHistory, state: PairState, force: np.ndarray) -> None:
        """Add to nodal forces (n, 3) in N what stands against the contact: the derivative of its potential."""
        points, projection, other = history.points, state.projection, self.other
        kernels.add_forces_of(force, points, projection.facet, projection.coordinates, other.nodes, other.kinds,
                              state.pressure[:, None] * projection.normal)
        if self.friction:
            anchor = history.anchor
            kernels.add_forces_of(force, points, anchor.facet, anchor.coordinates, other.nodes, other.kinds, state.friction)

    def tangents(self, history: PairHistory, state: PairState, x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Nodes (q, k) of pairs of facets and their matrices (q, 3 k, 3 k) in N/mm, of which the upper triangle counts."""
        points, other, width = history.points, self.other, self.surface.width
        touching = state.slope > 0
        nodes, pair = self._pairs(points, np.where(touching, state.projection.facet, -1))
        out = np.zeros((len(nodes), 3 * nodes.shape[1], 3 * nodes.shape[1]))
        kernels.add_pair_tangents(out, pair, points, state.projection, other.nodes, other.kinds, x, state.pressure, state.slope, width,
                                  not self.rigid)
        if not self.friction:
            return [(nodes, out)]
        anchor = history.anchor
        nodes2, pair = self._pairs(points, np.where(touching, anchor.facet, -1))
        rubbed = np.zeros((len(nodes2), 3 * nodes2.shape[1], 3 * nodes2.shape[1]))
        kernels.add_friction_tangents(rubbed, pair, points, anchor.facet, anchor.coordinates, other.kinds, state.stiffness, width,
                                      not self.rigid)
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
        nodes = points.nodes[meets[first], :self.surface.width]
        if not self.rigid:
            nodes = np.hstack([nodes, self.other.nodes[facet[meets[first]], :self.other.width]])
        return np.ascontiguousarray(np.where(nodes < 0, nodes[:, :1], nodes)), pair

    def augmented(self, history: PairHistory, state: PairState) -> PairHistory:
        """The history with offsets that hold the points where the surfaces just touch, in the mean around each corner of the facets.

        Offsets of single points would let the pressure oscillate: there are more points than displacements that could follow them.
        Where an augmentation did not halve the overlap, the penalty is doubled.
        """
        gap = np.where(state.projection.facet >= 0, state.projection.gap, np.inf)
        overlap, stiffness = state.penetration_mm(), history.stiffness
        factor = 2.0 if overlap > 0.5 * history.overlap_mm else 1.0
        offset = self._smooth(history.points, np.maximum(0.0, history.offset - gap)) / factor
        return replace(history, offset=offset, stiffness=factor * stiffness, overlap_mm=overlap)

    def _smooth(self, points: SurfacePoints, values: np.ndarray) -> np.ndarray:
        """Values (p,) replaced by those of linear functions on the facets, through means around their corners."""
        shares = _corner_shares(points)
        corners = points.nodes[:, :4]
        size = int(points.nodes.max(initial=0)) + 1
        weights = shares * points.weight[:, None]
        total = np.bincount(corners[corners >= 0], weights[corners >= 0], size)
        sums = np.bincount(corners[corners >= 0], (weights * values[:, None])[corners >= 0], size)
        means = np.where(total > 0, sums / np.where(total > 0, total, 1.0), 0.0)
        return (shares * means[corners]).sum(axis=1)

    def settled(self, state: PairState, tolerance_mm: float) -> bool:
        """Whether no point overlaps by more than the tolerance, and those that bear pressure stand over the facets that they meet."""
        here = np.flatnonzero(state.pressure > 0)
        facets, (xi, eta) = state.projection.facet[here], state.projection.coordinates[here].T
        kinds = self.other.kinds[facets]
        beyond = np.where(kinds >= QUAD8, np.maximum(np.abs(xi), np.abs(eta)) - 1, np.maximum(-np.minimum(xi, eta), xi + eta - 1))
        return state.penetration_mm() <= tolerance_mm and float(np.max(beyond, initial=0.0)) <= _BESIDE


def _corner_shares(points: SurfacePoints) -> np.ndarray:
    """Linear functions (p, 4) of the facets' corners at the points; 0 behind the last corner."""
    xi, eta = points.coordinates.T
    lines, quads, out = points.kind >= LINE2, points.kind >= QUAD8, np.zeros((len(xi), 4))
    out[:, 0], out[:, 1], out[:, 2] = 1 - xi - eta, xi, eta
    for corner, (p, q) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        out[quads, corner] = 0.25 * (1 + p * xi[quads]) * (1 + q * eta[quads])
    out[lines] = 0.0
    out[lines, 0], out[lines, 1] = 0.5 * (1 - xi[lines]), 0.5 * (1 + xi[lines])
    return out
