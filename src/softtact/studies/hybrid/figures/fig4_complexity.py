"""Figure 4: meshes and hulls of two objects, whole and in reach of the sensor, and the ratios that choose the model."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.geometry.complexity import overlap_points
from softtact.reporting.render import Part, View, add_view, note_fallback, part_of, rendered
from softtact.reporting.style import colour, pyplot

if TYPE_CHECKING:
    import pandas as pd
    import trimesh
    from matplotlib.figure import Figure

PRINTED = ("object_3", "object_6")     # those of the paper's figure: a flat cylinder and a detailed object
_OUTSIDE = 1.015                       # times the hull's size
_BELOW = {"seen_from": (0.55, -0.9, -0.9), "up": (0.0, 0.0, -1.0)}     # the side that touches


@dataclass(frozen=True)
class Placed:
    """A mesh (trimesh) in the sensor's frame, and the limits of its overlap with the sensor."""

    mesh: "trimesh.Trimesh"
    footprint_mm: tuple[float, float]
    reach_mm: float


def draw(complexity: "pd.DataFrame", placed: dict[str, Placed], *, thresholds: dict[str, float]) -> "Figure":
    """Figure from the complexity table and {object: Placed}."""
    plt = pyplot()
    shown = chosen_objects(complexity, placed)
    figure = plt.figure(figsize=(2.9 * len(shown) + 5.0, 5.6), layout="constrained")
    grid = figure.add_gridspec(2, len(shown) + 1, width_ratios=[1] * len(shown) + [1.6])
    rows = complexity.set_index("object").loc[shown]
    views = [view for name in shown for view in (_whole(placed[name], rows.model[name]), _overlap(placed[name], rows.model[name]))]
    images: Any = rendered(views)
    for k, (name, row) in enumerate(rows.iterrows()):
        titles = (f"{name.replace('_', ' ')}: {row.model}\nmesh NPt {row.NPt:.0f}, hull CHt {row.CHt:.0f}",
                  f"over the sensor: NPo {row.NPo:.0f}, CHo {row.CHo:.0f}")
        for r, title in enumerate(titles):
            axes = add_view(figure, grid[r, k], views[2 * k + r], images and images[2 * k + r])
            axes.set_title(title, fontsize=9)
    _draw_ratios(figure.add_subplot(grid[:, -1]), complexity, thresholds)
    note_fallback(figure, images)
    return figure


def chosen_objects(complexity: "pd.DataFrame", placed: dict[str, Placed]) -> list[str]:
    """The paper's two objects if both exist, else the first object of each chosen model."""
    if all(name in placed and (complexity.object == name).any() for name in PRINTED):
        return list(PRINTED)
    return list(complexity[complexity.object.isin(list(placed))].drop_duplicates("model").object)


def _whole(placed, model):
    """The mesh with its facets, and the edges of its convex hull."""
    return View([part_of(placed.mesh, colour="#d5d8dc", edges="#8a8f96"), _hull(placed.mesh.vertices, model)], **_BELOW)


def _overlap(placed, model):
    """The part in reach of the sensor, the pale remainder, and the hull's edges of the mesh's points in reach."""
    points = overlap_points(placed.mesh.triangles, footprint_mm=placed.footprint_mm, reach_mm=placed.reach_mm)
    parts = [part_of(placed.mesh, colour="#d5d8dc", opacity=0.25)]
    if len(points):
        parts += [_within(placed, points[:, 2].min()), _hull(points, model)]
    return View([part for part in parts if part is not None], **_BELOW)


def _within(placed, lowest):
    """`Part` of the mesh inside the footprint and at most the reach above its lowest point there."""
    import pyvista

    x, y = (0.5 * side for side in placed.footprint_mm)
    surface = pyvista.wrap(placed.mesh)
    for axis, side in ((0, x), (0, -x), (1, y), (1, -y), (2, lowest + placed.reach_mm)):
        inwards = -np.sign(side) if axis < 2 else -1.0
        surface = surface.clip(normal=inwards * np.eye(3)[axis], origin=side * np.eye(3)[axis], invert=False)
    surface = surface.triangulate()
    return Part(np.asarray(surface.points), surface.faces.reshape(-1, 4)[:, 1:], colour="#9aa3ad", edges="#565b61")


def _hull(points, model):
    """The edges of the points' convex hull, slightly enlarged to be visible; None if the points lie in a plane."""
    import trimesh
    from scipy.spatial import QhullError

    try:
        hull = trimesh.convex.convex_hull(points)
    except (QhullError, ValueError, IndexError):
        return None
    middle = hull.bounds.mean(axis=0)
    return Part(middle + _OUTSIDE * (hull.vertices - middle), hull.faces, colour=colour(model), as_lines=True)


def _draw_ratios(axes, complexity, thresholds):
    from matplotlib.ticker import NullFormatter

    for model, rows in complexity.groupby("model"):
        x, y = rows.NPt / rows.CHt, rows.NPo / rows.CHo.clip(lower=1)
        axes.scatter(x, y.clip(lower=1e-2), color=colour(model), marker="o" if model == "elastic" else "s", s=18,
                     label=f"{model} (n = {len(rows)})")
        _label_objects(axes, rows.object, x, y.clip(lower=1e-2))
    axes.axvline(thresholds["total"], color="0.5", linestyle="--")
    axes.axhline(thresholds["overlap"], color="0.5", linestyle=":")
    axes.set(xscale="log", yscale="log", xlabel="NPt / CHt, whole object", ylabel="NPo / CHo, over the sensor")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.set(xlim=(1, None), ylim=(None, 1.3 * max(20, axes.get_ylim()[1])))
    axes.annotate("thresholds", (thresholds["total"], 0), xycoords=("data", "axes fraction"), xytext=(3, 4),
                  textcoords="offset points", color="0.4")
    axes.legend(title="chosen model", frameon=False, loc="upper left")


def _label_objects(axes, names, x, y):
    """Number the objects of figure 7 in their first pose; objects at the same point share a label."""
    places = {}
    for name, a, b in zip(names, x, y, strict=True):
        if name.startswith("object_") and "-" not in name:
            places.setdefault((round(np.log10(a), 1), round(np.log10(b), 1)), []).append((name.removeprefix("object_"), a, b))
    for here in places.values():
        _, a, b = here[0]
        axes.annotate(", ".join(label for label, _, _ in here), (a, b), textcoords="offset points", xytext=(4, 3))
