"""Figure 7: for each object a view, deformation maps, and tactile maps of both models and the sensor at the largest force."""


from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

from softtact.reporting.render import View, add_view, note_fallback, part_of, rendered
from softtact.reporting.style import draw_map, pyplot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BELOW = {"seen_from": (0.55, -0.9, -0.9), "up": (0.0, 0.0, -1.0)}     # the side that touches


def draw(objects: Sequence[dict[str, Any]], *, largest_counts: float) -> "Figure":
    """Figure from a list of objects.

    Each {name, mesh, chosen, deformation {model: (y, x)} in mm, tactile {model: (row, column)} in counts, sensor (row, column),
    source (of its readings), trials (in their mean), extent, force}.
    largest_counts: upper end of the colour scale of tactile maps
    """
    plt = pyplot()
    models = list(objects[0]["deformation"])
    rows = 1 + 2 * len(models) + 1
    figure = plt.figure(figsize=(2.5 * len(objects) + 1.2, 1.75 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, len(objects))
    views = [View([part_of(item["mesh"], colour="#aeb6c2")], **_BELOW) for item in objects]
    images: Any = rendered(views)
    for k, item in enumerate(objects):
        axes = add_view(figure, grid[0, k], views[k], images and images[k])
        axes.set_title(f"{item['name'].replace('_', ' ')}\nchosen: {item['chosen']}", fontsize=9)
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
        _label(axis, k, f"{fill(item['source'], 12)}\nx (mm)")
        axis.set_xlabel("y (mm)")
    figure.colorbar(counts, ax=figure.axes[-1], label="counts", shrink=0.8)
    figure.suptitle(f"{objects[0]['force']:g} N; maps turned 90 degrees counter-clockwise; red: the model that the complexity "
                    f"rule chose; sensor: mean of {_trials(objects)} trials")
    note_fallback(figure, images)
    return figure


def _trials(objects):
    least, most = (pick(item["trials"] for item in objects) for pick in (min, max))
    return most if least == most else f"{least} to {most}"


def _label(axis, column, text):
    axis.tick_params(labelsize=7)
    if column == 0:
        axis.set_ylabel(text)


def _outline(axis):
    for spine in axis.spines.values():
        spine.set(visible=True, color="red", linewidth=3)
