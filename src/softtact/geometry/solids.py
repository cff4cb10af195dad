"""Watertight solids with rounded edges, from few ideas: a pad, a path, a ring, a dome, a block. Lengths in mm.

Every solid stands on z = 0 with the face that presses, and grows upwards. Its lower edge is rounded, because a
sharp edge puts an infinite pressure on a soft layer, which no mesh resolves.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold, OpType
from numpy.typing import ArrayLike

EDGE_MM = 0.25  # radius of the rounded lower edge
CHORD_ERROR_MM = 0.02  # how far a polygon may leave its circle
_EDGE_STEPS = 3  # straight pieces of the rounded edge, seen from the side
_DECIMALS = 4  # of a coordinate in mm; unions leave corners that differ by round-off


def circle_segments(radius: float) -> int:
    """Number of sides, a multiple of 4, that keeps a polygon within `CHORD_ERROR_MM` of its circle."""
    half_angle = np.arccos(max(1.0 - CHORD_ERROR_MM / radius, 0.0))
    return max(12, 4 * int(np.ceil(np.pi / half_angle / 4)))


def edge_profile(radius: float, height: float, *, edge: float = EDGE_MM, round_top: bool = False) -> np.ndarray:
    """Outline (points, 2) of a disc seen from the side as (distance from the axis, z), from the bottom upwards."""
    angle = np.linspace(0.0, np.pi / 2, _EDGE_STEPS + 1)
    lower = np.column_stack([radius - edge + edge * np.sin(angle), edge - edge * np.cos(angle)])
    upper = lower[::-1] * [1, -1] + [0, height] if round_top else [[radius, height]]
    return np.vstack([lower, upper])


def disc_points(centre: ArrayLike, radius: float, height: float, **profile: Any) -> np.ndarray:
    """Points (n, 3) of a disc with a rounded edge, whose convex hull is the disc."""
    outline = edge_profile(radius, height, **profile)
    count = circle_segments(radius)
    angle = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy = np.asarray(centre) + outline[:, None, :1] * around
    z = np.broadcast_to(outline[:, None, 1:], (len(outline), count, 1))
    return np.concatenate([xy, z], axis=-1).reshape(-1, 3)


def pad(centres: ArrayLike, *, radius: float, height: float, **profile: Any) -> Manifold:
    """Convex solid: the hull of discs of `radius` about each of `centres` (n, 2); one centre gives a disc."""
    points = [disc_points(centre, radius, height, **profile) for centre in np.atleast_2d(centres)]
    return Manifold.hull_points(np.concatenate(points))


def polygon(corners: Sequence[Sequence[float] | np.ndarray] | np.ndarray, *, height: float, corner_radius: float = 0.5,
            **profile: Any) -> Manifold:
    """Convex polygon through `corners` (n, 2), with rounded corners."""
    return pad(_inset(np.asarray(corners, float), corner_radius), radius=corner_radius, height=height, **profile)


def path(points: Sequence[Sequence[float] | np.ndarray] | np.ndarray, *, width: float, height: float) -> Manifold:
    """Bar of `width` with round ends along the line through `points` (n, 2)."""
    points = np.asarray(points, float)
    return union([pad(ends, radius=width / 2, height=height) for ends in zip(points[:-1], points[1:], strict=True)])


def arc(*, radius: float, width: float, start_deg: float, end_deg: float, height: float) -> Manifold:
    """Bar along an arc about the origin."""
    count = int(np.ceil(circle_segments(radius) * abs(end_deg - start_deg) / 360)) + 1
    angle = np.radians(np.linspace(start_deg, end_deg, count))
    return path(radius * np.column_stack([np.cos(angle), np.sin(angle)]), width=width, height=height)


def ring(*, outer: float, inner: float, height: float, centre: tuple[float, float] = (0.0, 0.0)) -> Manifold:
    """Ring between two diameters; both lower edges are rounded."""
    outside = edge_profile(outer / 2, height)
    width = (outer - inner) / 2
    inside = edge_profile(width, height) * [-1, 1] + [inner / 2 + width, 0]
    section = CrossSection([np.vstack([outside, inside[::-1]])])
    return section.revolve(circle_segments(outer / 2)).translate((*centre, 0.0))


def dome(*, radius: float, base_diameter: float, height: float) -> Manifold:
    """Spherical cap of `radius` under a cylinder of `base_diameter`; `height` counts from the lowest point."""
    polar = np.linspace(0.0, np.arcsin(base_diameter / 2 / radius), 16)[1:]
    outline = np.column_stack([radius * np.sin(polar), radius - radius * np.cos(polar)])
    outline = np.vstack([[0.0, 0.0], outline, [base_diameter / 2, height], [0.0, height]])
    return CrossSection([outline]).revolve(circle_segments(base_diameter / 2))


def block(size_x: float, size_y: float, height: float, *, corner_radius: float = 0.5, **profile: Any) -> Manifold:
    """Rectangular block about the z axis."""
    x, y = size_x / 2, size_y / 2
    return polygon([(-x, -y), (x, -y), (x, y), (-x, y)], height=height, corner_radius=corner_radius, **profile)


def ball(*, radius: float, subdivisions: int = 4) -> Manifold:
    """Sphere that rests on z = 0."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Manifold.hull_points(sphere.vertices + [0, 0, radius])


def hull(points: np.ndarray) -> Manifold:
    """Convex solid around points (n, 3)."""
    return Manifold.hull_points(points)


def union(solids: Iterable[Manifold]) -> Manifold:
    """One solid of several."""
    return Manifold.batch_boolean(list(solids), OpType.Add)


def raised(solid: Manifold, z: float) -> Manifold:
    """The solid, moved up by `z`."""
    return solid.translate((0.0, 0.0, z))


def to_mesh(solid: Manifold) -> trimesh.Trimesh:
    """Triangle mesh in single precision, as an STL holds it, with its facets in one fixed order.

    The order that the boolean operations leave depends on threads; sorted facets give the same file every time.
    """
    raw = solid.to_mesh64()
    corners = np.float32(np.round(raw.vert_properties[:, :3], _DECIMALS)).astype(float) + 0.0  # no negative zeros
    facets = _sorted_facets(_without_collapsed(corners[raw.tri_verts]))
    return trimesh.Trimesh(**trimesh.triangles.to_kwargs(facets), process=False)


def _without_collapsed(triangles):
    """Facets (n, 3, 3) without those that have two equal corners."""
    equal = [np.all(triangles[:, i] == triangles[:, (i + 1) % 3], axis=1) for i in range(3)]
    return triangles[~np.any(equal, axis=0)]


def _sorted_facets(triangles):
    """Facets (n, 3, 3) turned to begin at their smallest corner, then sorted."""
    first = np.array([np.lexsort(facet.T[::-1])[0] for facet in triangles])
    turn = (first[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(triangles, turn[..., None], axis=1)
    return turned[np.lexsort(turned.reshape(-1, 9).T[::-1])]


def _inset(corners, distance):
    """Corners (n, 2) of a convex polygon, counter-clockwise, after its sides moved inwards by `distance`."""
    before = _unit(corners - np.roll(corners, 1, axis=0))
    after = _unit(np.roll(corners, -1, axis=0) - corners)
    half_turn = np.sum(before * after, axis=1, keepdims=True)
    inwards = np.column_stack([-before[:, 1], before[:, 0]]) + np.column_stack([-after[:, 1], after[:, 0]])
    return corners + distance * inwards / (1.0 + half_turn)


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
