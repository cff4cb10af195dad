"""Figure 7: objects x (view, deformation maps, tactile maps of both models and of the sensor) at the largest force."""

import numpy as np

from softtact.reporting.style import draw_map, pyplot

ROWS = ("object", "deformation", "tactile map")


def draw(objects, *, largest_counts):
    """Figure from [{name, mesh, chosen, deformation {model: (y, x)}, tactile {model: (row, column)}, sensor, extent, force}].

    largest_counts: where the colours of tactile maps end
    """
    plt = pyplot()
    models = list(objects[0]["deformation"])
    rows = 1 + 2 * len(models) + 1
    figure = plt.figure(figsize=(2.5 * len(objects) + 1.2, 1.75 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, len(objects))
    for k, item in enumerate(objects):
        _draw_object(figure.add_subplot(grid[0, k], projection="3d"), item)
        top = max(float(values.max()) for values in item["deformation"].values())
        for m, model in enumerate(models):
            axis = figure.add_subplot(grid[1 + m, k])
            image = draw_map(axis, item["deformation"][model], extent=item["extent"], limits=(0, top))
            _label(axis, k, f"{model}\ndeformation\nx (mm)")
            figure.colorbar(image, ax=axis, label="mm", shrink=0.8)
            axis = figure.add_subplot(grid[1 + len(models) + m, k])
            counts = draw_map(axis, item["tactile"][model], extent=item["extent"], limits=(0, largest_counts))
            _label(axis, k, f"{model}\nCNN\nx (mm)")
            if model == item["chosen"]:
                _outline(axis)
        axis = figure.add_subplot(grid[-1, k])
        counts = draw_map(axis, item["sensor"], extent=item["extent"], limits=(0, largest_counts))
        _label(axis, k, "virtual\nsensor\nx (mm)")
        axis.set_xlabel("y (mm)")
    figure.colorbar(counts, ax=figure.axes[-1], label="counts", shrink=0.8)
    figure.suptitle(f"{objects[0]['force']:g} N; maps turned 90 degrees; red: the model that the complexity rule chose")
    return figure


def _label(axis, column, text):
    axis.tick_params(labelsize=7)
    if column == 0:
        axis.set_ylabel(text)


def _outline(axis):
    for spine in axis.spines.values():
        spine.set(visible=True, color="red", linewidth=3)


def _draw_object(axes, item):
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    mesh = item["mesh"]
    light = 0.3 + 0.65 * np.abs(mesh.face_normals @ np.array([0.4, 0.3, -0.86]))
    axes.add_collection3d(Poly3DCollection(mesh.triangles, facecolors=np.column_stack([light] * 3), edgecolors="none"))
    low, high = mesh.bounds
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), box_aspect=high - low)
    axes.view_init(elev=-40, azim=-60)   # from below: the side that touches
    axes.set_axis_off()
    axes.set_title(f"{item['name'].replace('_', ' ')}\n{item['chosen']}", fontsize=9)
