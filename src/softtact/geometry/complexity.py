"""Complexity of an object, and the model chosen by it (the paper, sec. 3.3.1, fig. 4, table 2).

NPt  points of the object's mesh as the file stores it: three per facet, not merged
CHt  unique edges of the triangulated convex hull of those points (3 V - 6 for V corners)
NPo  points of the overlap: the part of the object that the sensor can touch
CHo  unique edges of the overlap's convex hull

Fine details add points but hardly change the hull, so NPt / CHt and NPo / CHo grow with them; for a convex body with
all corners on the hull they are 2.

*The overlap.* The paper does not define it. Its six NPo are only 3 to 9 % of NPt, too few for all that lies over
the footprint, so the overlap is limited in height, too: points over the footprint and at most `reach_mm` above the
object's lowest facet there. The default reach is the thickness of the sensor's soft layers, the deepest that an object
can sink: an evenly meshed sphere of 30 mm has 8.3 % of its points within it, the paper's sphere 8.7 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from softtact.errors import InputError
from softtact.geometry.meshes import default_pose, facets_over, read_mesh, read_triangles
from softtact.geometry.pose import Pose

if TYPE_CHECKING:
    import pandas as pd

REACH_MM = 2.5  # frusta 0.5, sheet 0.5, cover 1.5
TOTAL_THRESHOLD = 10.0
OVERLAP_THRESHOLD = 8.0
RULES = {"any": any, "all": all}


@dataclass(frozen=True)
class Complexity:
    """Counts of one object, named as the paper names them."""

    NPt: int
    CHt: int
    NPo: int
    CHo: int

    @property
    def ratio_total(self) -> float:
        """NPt / CHt."""
        return _ratio(self.NPt, self.CHt)

    @property
    def ratio_overlap(self) -> float:
        """NPo / CHo; 0 where no point of the object is in the overlap."""
        return _ratio(self.NPo, self.CHo)


def score(triangles: np.ndarray, *, footprint_mm: tuple[float, float], reach_mm: float = REACH_MM) -> Complexity:
    """`Complexity` of raw facets (n, 3, 3), in mm, in the sensor frame."""
    points = triangles.reshape(-1, 3)
    near = overlap_points(triangles, footprint_mm=footprint_mm, reach_mm=reach_mm)
    return Complexity(NPt=len(points), CHt=hull_edges(points), NPo=len(near), CHo=hull_edges(near))


def score_file(path: str | Path, *, unit: str | None = None, footprint_mm: tuple[float, float], pose: Pose | None = None,
               reach_mm: float = REACH_MM) -> Complexity:
    """`Complexity` of a mesh file that passes `read_mesh`; without a pose it is centred over the sensor."""
    mesh = read_mesh(path, unit=unit)
    pose = pose if pose is not None else default_pose(mesh)
    triangles = read_triangles(path, unit=unit)
    placed = pose.apply(triangles.reshape(-1, 3)).reshape(-1, 3, 3)
    return score(placed, footprint_mm=footprint_mm, reach_mm=reach_mm)


def overlap_points(triangles: np.ndarray, *, footprint_mm: tuple[float, float], reach_mm: float = REACH_MM) -> np.ndarray:
    """Raw points (m, 3) over the footprint and within `reach_mm` of the lowest facet there."""
    over = facets_over(triangles, footprint_mm)
    if not over.any():
        return np.empty((0, 3))
    points = triangles.reshape(-1, 3)
    inside = np.all(np.abs(points[:, :2]) <= np.asarray(footprint_mm) / 2, axis=1)
    return points[inside & (points[:, 2] <= triangles[over, :, 2].min() + reach_mm)]


def hull_edges(points: np.ndarray) -> int:
    """Number of unique edges of the triangulated convex hull of points (n, 3).

    Points in one plane give a triangulated polygon (2 V - 3), points on one line 1, a single point or none 0.
    """
    points = np.unique(points, axis=0)
    points = points[:, np.ptp(points, axis=0) > 0] if len(points) else points
    if len(points) < 2:
        return 0
    if points.shape[1] == 1:
        return 1
    try:
        facets = ConvexHull(points).simplices
    except QhullError:  # flat, but not along an axis: in coordinates of that plane or line
        return hull_edges(_in_their_plane(points))
    return 2 * len(facets) - 3 if points.shape[1] == 2 else _unique_edges(facets)


def choose_model(NPt: int, CHt: int, NPo: int, CHo: int, *, rule: str = "any", total: float = TOTAL_THRESHOLD,
                 overlap: float = OVERLAP_THRESHOLD) -> str:
    """'hyperelastic' for an object with fine details, else 'elastic'.

    Details mean NPt >= `total` CHt, or NPo >= `overlap` CHo. The paper's text requires both (`rule="all"`), its
    table 2 agrees only with either (`rule="any"`). An object without a point in the overlap has no detail there.
    """
    if rule not in RULES:
        raise InputError(f"The rule {rule!r} for the choice of model is not known; write 'any' or 'all'.")
    detailed = RULES[rule]([_exceeds(NPt, CHt, total), _exceeds(NPo, CHo, overlap)])
    return "hyperelastic" if detailed else "elastic"


def score_objects(paths: Sequence[str | Path], objects: Sequence[dict[str, Any]], *, footprint_mm: tuple[float, float],
                  rule: str = "any", thresholds: dict[str, Any] | None = None, reach_mm: float = REACH_MM) -> "pd.DataFrame":
    """Table of counts and chosen model, a row for each of `paths`.

    objects : list of {name, unit, pose}, in the order of `paths`; pose is six numbers, or missing for centred
    thresholds : {total, overlap}
    """
    import pandas as pd

    rows = []
    for path, entry in zip(paths, objects, strict=True):
        pose = Pose.from_values(entry["pose"]) if entry.get("pose") is not None else None
        counts = score_file(path, unit=entry["unit"], footprint_mm=footprint_mm, pose=pose, reach_mm=reach_mm)
        four: dict[str, Any] = {name: getattr(counts, name) for name in ("NPt", "CHt", "NPo", "CHo")}
        rows.append({"object": entry["name"], **four, "model": choose_model(**four, rule=rule, **(thresholds or {})),
                     "ratio_total": counts.ratio_total, "ratio_overlap": counts.ratio_overlap})
    return pd.DataFrame(rows)


def _exceeds(points, edges, threshold):
    return edges > 0 and points >= threshold * edges


def _ratio(points, edges):
    return points / edges if edges else 0.0


def _unique_edges(facets):
    edges = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return len(np.unique(edges, axis=0))


def _in_their_plane(points):
    """Coordinates (n, d - 1) along the directions in which points (n, d) spread most."""
    centred = points - points.mean(axis=0)
    _, _, directions = np.linalg.svd(centred, full_matrices=False)
    return centred @ directions[: points.shape[1] - 1].T
