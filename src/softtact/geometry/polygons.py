"""Polygons of mesh files as triangles that cover each polygon once, whatever its shape.

A quadrilateral is split along the diagonal that divides it more evenly; both halves must face the polygon's side, so that concave
ones are split inside. Polygons with more corners are triangulated in the plane of their vector area: convex ones from one corner,
others by manifold3d (ear clipping). The result does not depend on the corner at which a polygon begins, unless several splits are
equally good.
Refused: polygons that cross themselves, and those whose corners are so far from one plane that their surface is ambiguous.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from manifold3d import CrossSection, FillRule, triangulate

from softtact.errors import InputError

_ROUND_OFF = 1e-6      # of a polygon's area: a smaller error comes from coordinates in single precision
_BENT_QUAD = 0.2       # of the size: largest distance of four corners from their mean plane; a square folded by 90 degrees
_BENT_POLYGON = 0.01   # the same for more corners
_ROUNDED = 1e-4        # of the mesh's size: lower heights and widths come from coordinates with few digits
_SPLITS = np.array([[[0, 1, 2], [0, 2, 3]], [[1, 2, 3], [1, 3, 0]]])     # of a quadrilateral


@dataclass(frozen=True)
class Polygons:
    """Polygons as a file declares them.

    points : coordinates (n, 3) in the file's unit
    corners : numbers (m,) of points from 0, of one polygon after the other
    counts : corners (k,) of each polygon
    places : number of the `place` of each polygon (k,)
    place : 'line' of a text, 'face' of a binary file
    first : the number that the file gives its first point
    """

    points: np.ndarray
    corners: np.ndarray
    counts: np.ndarray
    places: np.ndarray
    place: str = "line"
    first: int = 0


def facets_of(path: Path, polygons: Polygons) -> np.ndarray:
    """Triangles (n, 3, 3) of the polygons of a file; InputError names the polygon that has none."""
    _refuse_out_of_range(path, polygons)
    polygons = _without_repeated(polygons)
    starts = np.cumsum(polygons.counts) - polygons.counts
    rounded = _ROUNDED * float(np.ptp(polygons.points, axis=0).max()) if len(polygons.points) else 0.0
    facets = [np.empty((0, 3, 3))]
    for count in np.unique(polygons.counts):
        which = np.flatnonzero(polygons.counts == count)
        corners = polygons.corners[starts[which][:, None] + np.arange(count)]
        facets.append(_triangles(path, polygons, which, corners, rounded).reshape(-1, 3, 3))
    return np.concatenate(facets)


def triangulated(points: np.ndarray, *, width: float = 0.0) -> np.ndarray:
    """Numbers (k, count - 2, 3) of the corners of the triangles of nearly flat polygons (k, count, 3).

    width : of strips, in the unit of the points, that may be covered twice or from behind

    A polygon that covers more in this way has no triangulation; its triangles then face the opposite side.
    """
    sides = _sides(points)
    sizes = np.abs(points - points[:, :1]).max(axis=(1, 2))
    plane = _in_plane(points, sides) / np.where(sizes > 0, sizes, 1.0)[:, None, None]
    fan = np.array([[0, k, k + 1] for k in range(1, points.shape[1] - 1)])
    triangles = np.repeat(fan[None], len(points), axis=0)
    # Polygons without a side lie on one line, or cross themselves so that the fan's triangles face both sides.
    for number in np.flatnonzero(~_is_convex(plane) & sides.any(axis=1)):
        clipped = _ear_clipped(plane[number], max(_ROUND_OFF, width / sizes[number]))
        triangles[number] = fan[:, ::-1] if clipped is None else clipped
    return triangles


def _in_plane(points, sides):
    """Points (k, count, 2) in the planes normal to `sides` (k, 3), seen from their tips."""
    spokes = points - points[:, :1]
    longest = np.linalg.norm(spokes, axis=2).argmax(axis=1)
    x = spokes[np.arange(len(points)), longest]
    x = x - np.sum(x * sides, axis=1, keepdims=True) * sides
    length = np.linalg.norm(x, axis=1, keepdims=True)
    x = np.divide(x, length, out=np.zeros_like(x), where=length > 0)
    return spokes @ np.stack([x, np.cross(sides, x)], axis=2)


def _is_convex(plane):
    """Whether polygons (k, count, 2) turn left at each corner, and once around in total (k,)."""
    along = np.roll(plane, -1, axis=1) - plane
    x, y = np.moveaxis(along, 2, 0)
    following_x, following_y = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    turn = np.arctan2(x * following_y - y * following_x, x * following_x + y * following_y)
    return (turn.min(axis=1) > _ROUND_OFF) & (turn.sum(axis=1) < 3 * np.pi)


def _ear_clipped(plane, tolerance):
    """Triangles (count - 2, 3) of one polygon (count, 2), or None where it covers more than a small area twice or reversed."""
    x, y = plane.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    if abs(CrossSection([plane], FillRule.NonZero).area() - area) > tolerance:
        return None
    triangles = np.asarray(triangulate([plane], allow_convex=False))     # allow_convex makes triangles without area
    return triangles if len(triangles) == len(plane) - 2 else None


def _triangles(path, polygons, which, corners, rounded):
    """Triangles (k, count - 2, 3, 3) of polygons with equal numbers of corners (k, count); heights below `rounded` are ignored."""
    points = polygons.points[corners]
    if points.shape[1] == 3:
        return points
    sides = _sides(points)
    sizes = 2 * np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    bend = _BENT_QUAD if points.shape[1] == 4 else _BENT_POLYGON
    _refuse(path, polygons, which, _heights(points, sides) > np.maximum(bend * sizes, rounded),
            "is so far from a plane that its surface is ambiguous; triangulate the mesh before its export")
    if points.shape[1] == 4:
        triangles = _split_quads(points, sides, corners)
    else:
        triangles = points[np.arange(len(points))[:, None, None], triangulated(points, width=rounded)]
    _refuse(path, polygons, which, _folded(triangles, sides, rounded * sizes), "crosses itself; repair it in its modelling program")
    return triangles


def _without_repeated(polygons):
    """The polygons without corners that repeat the one before, and without polygons that then have less than three corners."""
    owner = np.repeat(np.arange(len(polygons.counts)), polygons.counts)
    ends = np.cumsum(polygons.counts)
    following = np.arange(1, len(owner) + 1)
    following[ends - 1] = ends - polygons.counts
    points = polygons.points[polygons.corners]
    keep = (points != points[following]).any(axis=1)
    if keep.all():
        return polygons
    counts = np.bincount(owner[keep], minlength=len(ends))
    keep &= (counts >= 3)[owner]
    return replace(polygons, corners=polygons.corners[keep], counts=counts[counts >= 3], places=polygons.places[counts >= 3])


def _areas(triangles):
    """Vector areas (..., 3) of triangles (..., 3, 3)."""
    return 0.5 * np.cross(triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :])


def _sides(points):
    """Unit vectors (k, 3) along the vector areas of polygons (k, count, 3), their facing side; 0 where there is none."""
    spokes = points - points[:, :1]
    area = 0.5 * np.cross(spokes[:, 1:-1], spokes[:, 2:]).sum(axis=1)
    length = np.linalg.norm(area, axis=1, keepdims=True)
    whole = length > 1e-12 * (spokes**2).sum(axis=2).max(axis=1, keepdims=True)
    return np.divide(area, length, out=np.zeros_like(area), where=whole)


def _heights(points, sides):
    """Largest distance (k,) of corners from the polygons' mean planes."""
    return np.abs(np.einsum("knd,kd->kn", points - points.mean(axis=1, keepdims=True), sides)).max(axis=1)


def _split_quads(points, sides, corners):
    """Quadrilaterals (k, 4, 3) as two triangles each (k, 2, 3, 3)."""
    options = points[:, _SPLITS]                                                       # (k, split, half, 3, 3)
    smaller = np.einsum("kshd,kd->ksh", _areas(options), sides).min(axis=2)            # (k, split)
    alike = np.abs(smaller[:, 0] - smaller[:, 1]) <= _ROUND_OFF * np.abs(smaller).max(axis=1)
    at_lowest = corners.argmin(axis=1) % 2      # equally good: from the corner with the lowest number, whatever the first corner
    return options[np.arange(len(points)), np.where(alike, at_lowest, smaller.argmax(axis=1))]


def _folded(triangles, sides, negligible):
    """Whether the triangles (k, t, 3, 3) of polygons lie on each other (k,) by more than areas (k,) that are negligible."""
    areas = _areas(triangles)
    along = np.einsum("ktd,kd->kt", areas, sides)
    whole = np.linalg.norm(areas, axis=2).sum(axis=1)
    return (-along.min(axis=1) > _ROUND_OFF * whole + negligible) | (0.5 * whole - along.sum(axis=1) > negligible)


def _refuse(path, polygons, which, wrong, fault):
    """Refuse the first of the polygons `which` that is wrong."""
    if wrong.any():
        number = which[wrong.argmax()]
        raise InputError(f"{path}: {polygons.place} {polygons.places[number]}: the polygon of {polygons.counts[number]} corners "
                         f"{fault}.")


def _refuse_out_of_range(path, polygons):
    """Refuse a corner whose number is not a point of the file."""
    known = len(polygons.points)
    wrong = (polygons.corners < 0) | (polygons.corners >= known)
    if wrong.any():
        at = wrong.argmax()
        number = np.searchsorted(np.cumsum(polygons.counts), at, side="right")
        first = polygons.first
        raise InputError(f"{path}: {polygons.place} {polygons.places[number]}: a corner is vertex {polygons.corners[at] + first}, "
                         f"but the file's {known} vertices are {first} to {known - 1 + first}; export the mesh again.")
