"""Figure 4: two objects' meshes with their hulls, and the ratios that choose the model."""

import numpy as np

from softtact.reporting.style import colour, pyplot


def draw(complexity, meshes, *, thresholds):
    """Figure from the complexity table and {object: trimesh} (drawn: the first of each chosen model that has a mesh)."""
    plt = pyplot()
    shown = list(complexity[complexity.object.isin(list(meshes))].drop_duplicates("model").object)
    figure = plt.figure(figsize=(3.3 * len(shown) + 5.2, 3.8), layout="constrained")
    grid = figure.add_gridspec(1, len(shown) + 1, width_ratios=[1] * len(shown) + [1.5])
    for k, name in enumerate(shown):
        row = complexity.set_index("object").loc[name]
        _draw_mesh(figure.add_subplot(grid[k], projection="3d"), meshes[name], row, name)
    _draw_ratios(figure.add_subplot(grid[-1]), complexity, thresholds)
    return figure


def _draw_mesh(axes, mesh, row, name):
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    light = 0.35 + 0.6 * np.abs(mesh.face_normals @ np.array([0.4, 0.3, 0.86]))
    axes.add_collection3d(Poly3DCollection(mesh.triangles, facecolors=np.column_stack([light] * 3), edgecolors="none"))
    hull = mesh.convex_hull
    axes.add_collection3d(Line3DCollection(hull.vertices[hull.edges_unique], colors=colour(row.model), linewidths=0.3))
    low, high = mesh.bounds
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), box_aspect=high - low)
    axes.view_init(elev=-35, azim=-60)   # from below: the side that touches
    axes.set_axis_off()
    axes.set_title(f"{name}: {row.model}\nNPt {row.NPt:.0f}, CHt {row.CHt:.0f}, NPo {row.NPo:.0f}, CHo {row.CHo:.0f}")


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
    """Number the objects of figure 7 in their first pose; those at the same place share one label."""
    places = {}
    for name, a, b in zip(names, x, y, strict=True):
        if name.startswith("object_") and "-" not in name:
            places.setdefault((round(np.log10(a), 1), round(np.log10(b), 1)), []).append((name.removeprefix("object_"), a, b))
    for here in places.values():
        _, a, b = here[0]
        axes.annotate(", ".join(label for label, _, _ in here), (a, b), textcoords="offset points", xytext=(4, 3))
