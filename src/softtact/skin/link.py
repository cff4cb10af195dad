"""Modules laid on a robot's link: side by side from a start, straight along the surface, with what does not fit told.

On a cylinder or a cone the flat tiling closes without gaps; on a surface that bends both ways it cannot, and gaps or overlaps
appear between modules that were reached on different ways.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
import pandas as pd
import trimesh

from softtact.errors import InputError
from softtact.skin.layout import Layout
from softtact.skin.surface import Place, Surface

_NEAR = 0.9  # of the distance between neighbours' middles: nearer to any other module there is no place
_NO_BEND = 1e-9
_WAYS = (1.0, 0.4)  # of the ways to the corners: the longer are smooth over facets, the shorter see sharp bends


@dataclass(frozen=True)
class Laid:
    """Modules on a surface."""

    positions_mm: np.ndarray
    """(taxel, 3): of all modules that fit, on the surface."""
    normals: np.ndarray
    """(taxel, 3): outward unit vectors."""
    corners_mm: np.ndarray
    """(module, 3, 3): of all modules."""
    fits: np.ndarray
    """(module,): whether it bends no more than allowed."""
    modules: pd.DataFrame
    """A row a module: bend_radius_mm, fits."""
    seams: pd.DataFrame
    """A row for each two neighbours: gap_mm, negative where they overlap."""
    left_out: int
    """Modules of the tiling without place beside those that lie already."""


def lay_modules(
    mesh: trimesh.Trimesh,
    module: Layout,
    *,
    start_mm: np.ndarray | None,
    direction: np.ndarray,
    rings: int,
    least_radius_mm: float = 10.0,
) -> Laid:
    """`Laid` modules around a start, out to `rings` neighbours of neighbours.

    start_mm: (3,) near where the first module's middle lies, or None for the side towards +x at the mesh's middle
    direction: (3,) of the module's side, made tangential;  least_radius_mm: that the boards bear
    Raises InputError where the first module does not fit already.
    """
    surface = Surface(mesh)
    start = np.array([mesh.bounds[1, 0], *mesh.bounds.mean(axis=0)[1:]]) if start_mm is None else np.asarray(start_mm, dtype=float)
    tiles, left_out = _tiles(surface, surface.at(start, np.asarray(direction, dtype=float)), module, rings)
    radii = np.array([_bend_radius(surface, place, module) for place in tiles.values()])
    fits = radii >= least_radius_mm
    if not fits[0]:
        raise InputError(
            f"link: at the start the surface bends with a radius of {radii[0]:.3g} mm, and the boards bear "
            f"{least_radius_mm:g} mm; choose another start_mm or a smaller module."
        )
    corners = np.array([_points(surface, place, module, module.corners_mm[0])[0] for place in tiles.values()])
    taxels = [_points(surface, place, module, module.centres_mm) for place, fit in zip(tiles.values(), fits, strict=True) if fit]
    modules = pd.DataFrame({"module": np.arange(1, len(tiles) + 1), "bend_radius_mm": radii, "fits": fits})
    return Laid(
        np.concatenate([points for points, _ in taxels]),
        np.concatenate([normals for _, normals in taxels]),
        corners,
        fits,
        modules,
        _seams(tiles, corners),
        left_out,
    )


def _tiles(surface, first, module, rings):
    """Places {(x, y) of the flat tiling: Place} in the order in which they were reached, and how many had none."""
    apart = np.linalg.norm(module.corners_mm[0, 1] - module.corners_mm[0, 0]) / np.sqrt(3)
    tiles, left_out = {_key(np.zeros(2)): first}, 0
    queue = deque([(np.zeros(2), 0.0, first, 0)])  # flat middle, flat angle, place, ring
    seen = set(tiles)
    while queue:
        flat, angle, place, ring = queue.popleft()
        if ring == rings:
            continue
        for side in range(3):
            towards = np.pi / 6 * (4 * side - 3)  # middle of a side seen from the module's middle: -90, 30, 150 degrees
            step = angle + towards
            there = flat + apart * np.array([np.cos(step), np.sin(step)])
            if _key(there) in seen:
                continue
            seen.add(_key(there))
            end = surface.walk(place, angle=towards, length_mm=apart)
            # Seen from the neighbour, the same side lies behind: its frame is turned by half a turn.
            turned = Place(end.face, end.point, surface.turned(end, np.pi - towards))
            if min(np.linalg.norm(end.point - other.point) for other in tiles.values()) < _NEAR * apart:
                left_out += 1
                continue
            tiles[_key(there)] = turned
            queue.append((there, angle + np.pi, turned, ring + 1))
    return tiles, left_out


def _key(flat):
    return tuple(np.round(flat, 3) + 0.0)


def _points(surface, place, module, flat):
    """Points (n, 3) and normals (n, 3) on the surface of flat ones (n, 2) of a module, each by a straight way from its middle."""
    arms = np.asarray(flat) - module.corners_mm[0].mean(axis=0)
    ends = [surface.walk(place, angle=np.arctan2(y, x), length_mm=np.hypot(x, y)) for x, y in arms]
    return np.array([end.point for end in ends]), np.array([surface.normal(end) for end in ends])


def _bend_radius(surface, place, module):
    """Smallest radius of curvature below a module: how the normal turns on the way to its corners and its sides."""
    corners = module.corners_mm[0]
    around = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=0))]) - corners.mean(axis=0)
    axes, upright = np.stack([surface.turned(place, angle) for angle in (0.0, np.pi / 2)]), surface.normal(place)
    largest = _NO_BEND
    for share in _WAYS:
        _, normals = _points(surface, place, module, corners.mean(axis=0) + share * around)
        aside = normals @ axes.T
        angle = np.arctan2(np.linalg.norm(aside, axis=1), normals @ upright)
        turns = aside * (angle / np.maximum(np.linalg.norm(aside, axis=1), 1e-300))[:, None]
        shape, *_ = np.linalg.lstsq(share * around, turns, rcond=None)
        largest = max(largest, np.abs(np.linalg.eigvalsh(0.5 * (shape + shape.T))).max())
    return 1 / largest


def _seams(tiles, corners):
    """Gap along the line between the middles of each two neighbours of the flat tiling."""
    places, flats = list(tiles.values()), np.array(list(tiles))
    side = np.linalg.norm(corners[0, 1] - corners[0, 0])
    apart = np.linalg.norm(flats[:, None] - flats, axis=2)
    nearest = apart[apart > 0].min(initial=side)
    rows = []
    for one, other in zip(*np.nonzero(np.triu(np.abs(apart - nearest) < 1e-2, 1)), strict=True):
        between = places[other].point - places[one].point
        edges = [_edge_towards(corners[k], sign * between) for k, sign in ((one, 1.0), (other, -1.0))]
        rows.append(
            {"module": one + 1, "neighbour": other + 1, "gap_mm": float((edges[1] - edges[0]) @ between / np.linalg.norm(between))}
        )
    return pd.DataFrame(rows, columns=["module", "neighbour", "gap_mm"])


def _edge_towards(corners, direction):
    """Middle of the side of a triangle that lies furthest along a direction."""
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    return middles[(middles @ direction).argmax()]
