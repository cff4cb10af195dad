"""Places of a skin's taxels: the triangular module of the papers, and a hexagonal patch of six modules.

Le, Maiolino, Mastrogiovanni, Cannata and Schmitz, Humanoids 2011, sec. II; the centres are those of the authors' published toolbox.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import pdist, squareform

from softtact.errors import InputError

SIDE_MM, PITCH_MM = 30.0, 5.0  # of the module that the centres are given for
CENTRES_MM = np.array([(15, 20.32), (12.5, 15.99), (17.5, 15.99), (12.5, 9.99), (17.5, 9.99), (7.5, 7.33), (15, 5.66), (22.5, 7.33),
                       (5, 3), (10, 3), (20, 3), (25, 3)], dtype=float)
_ROUNDING_MM = 1e-9


@dataclass(frozen=True)
class Layout:
    """Taxels under one flat piece of elastomer, which covers one module or several."""

    outline_mm: np.ndarray
    """(corner, 2): of the elastomer, convex, counter-clockwise."""
    centres_mm: np.ndarray
    """(taxel, 2): of the taxels."""
    module: np.ndarray
    """(taxel,): number of the module that a taxel belongs to."""
    corners_mm: np.ndarray
    """(module, 3, 2): corners of the modules."""
    radius_mm: float
    """Of a taxel."""
    guard_radius_mm: float
    """Where the guard around a taxel begins; there is no electrode between both."""

    @property
    def area_mm2(self) -> float:
        """Area of the elastomer."""
        return float(abs(polygon_area(self.outline_mm)))

    def inside(self, points_mm: np.ndarray, *, margin_mm: float = 0.0) -> np.ndarray:
        """Whether points (n, 2) lie on the elastomer, at least `margin_mm` away from its sides."""
        return _depth(points_mm, self.outline_mm) >= margin_mm - _ROUNDING_MM


def module_layout(*, side_mm: float = SIDE_MM, pitch_mm: float = PITCH_MM, radius_mm: float = 2.0, guard_radius_mm: float = 2.2,
                  centres_mm: Sequence[Sequence[float]] | np.ndarray | None = None) -> Layout:
    """One triangular module with a side along x and its left corner in the origin.

    centres_mm: (taxel, 2), or None for the published ones, scaled about the module's centre by the ratio of the pitches
    Raises InputError where taxels overlap or leave the module.
    """
    corners = side_mm * np.array([(0.0, 0.0), (1.0, 0.0), (0.5, np.sqrt(0.75))])
    if centres_mm is None:
        middle = SIDE_MM * np.array([0.5, np.sqrt(1 / 12)])
        centres = corners.mean(axis=0) + (CENTRES_MM - middle) * (pitch_mm / PITCH_MM)
    else:
        centres = np.asarray(centres_mm, dtype=float)
    layout = Layout(corners, centres, np.zeros(len(centres), dtype=int), corners[None], radius_mm, guard_radius_mm)
    _refuse_misplaced(layout)
    return layout


def hexagon_layout(module: Layout) -> Layout:
    """Six modules around one corner, each the mirror image of the one before; the elastomer covers all of them.

    Le, Maiolino, Mastrogiovanni and Cannata, fig. 1. Taxels are counted module by module.
    """
    centres, corners = [module.centres_mm], [module.corners_mm[0]]
    for turn in range(1, 6):
        mirror = _mirror(np.pi / 3 * turn)
        centres.append(centres[-1] @ mirror)
        corners.append(corners[-1] @ mirror)
    side = np.linalg.norm(module.corners_mm[0, 1] - module.corners_mm[0, 0])
    angles = np.pi / 3 * np.arange(6)
    return Layout(side * np.column_stack([np.cos(angles), np.sin(angles)]), np.concatenate(centres),
                  np.repeat(np.arange(6), len(module.centres_mm)), np.stack(corners), module.radius_mm, module.guard_radius_mm)


def polygon_area(corners: np.ndarray) -> float:
    """Signed area of a polygon (n, 2), positive where it runs counter-clockwise."""
    x, y = corners.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _mirror(angle):
    """The reflection (2, 2) at a line through the origin at an angle."""
    cos, sin = np.cos(2 * angle), np.sin(2 * angle)
    return np.array([[cos, sin], [sin, -cos]])


def _depth(points, outline):
    """Distance (n,) of points from the line of the nearest side, negative outside of a convex polygon."""
    along = np.roll(outline, -1, axis=0) - outline
    inwards = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return ((np.asarray(points, dtype=float)[:, None] - outline) * inwards).sum(axis=2).min(axis=1)


def _refuse_misplaced(layout):
    """Refuse a guard within a taxel, and guards that leave the module or overlap."""
    if layout.guard_radius_mm <= layout.radius_mm:
        raise InputError(
            f"module.guard_radius_mm: {layout.guard_radius_mm:g} mm is not above the taxels' radius of "
            f"{layout.radius_mm:g} mm, so that guard and taxel touch; make it larger."
        )
    depth = _depth(layout.centres_mm, layout.outline_mm) - layout.guard_radius_mm
    if depth.min() <= 0:
        worst = int(depth.argmin())
        raise InputError(
            f"module: taxel {worst + 1} at ({_pair(layout.centres_mm[worst])}) mm leaves the module by {-depth[worst]:.3g} "
            "mm (guard gap included); choose a smaller pitch or radius, or a longer side."
        )
    if len(layout.centres_mm) < 2:
        return
    apart = squareform(pdist(layout.centres_mm))
    np.fill_diagonal(apart, np.inf)
    one, other = np.unravel_index(apart.argmin(), apart.shape)
    if apart.min() <= 2 * layout.guard_radius_mm:
        raise InputError(
            f"module: taxels {one + 1} and {other + 1} are {apart.min():.3g} mm apart and need more than "
            f"{2 * layout.guard_radius_mm:g} mm (guard gaps included); choose a larger pitch or a smaller radius."
        )


def _pair(point):
    return ", ".join(f"{value:g}" for value in point)
