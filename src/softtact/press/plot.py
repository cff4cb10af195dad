"""A picture of one press: at each load step deformation map, taxels, other readings and solids from the side, where present."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from softtact.press.result import PressResult

_MOST_NUMBERS = 200      # taxels beyond which their counts are not written into the cells
_LIGHT = 0.6             # share of the colour range from which on a number is written in black
_HEIGHT = 2.6            # inches of a row that is no map
_WIDTH = 2.0             # inches of a panel, about
_LONGEST = 0.12          # of the image's width: longest arrow of a marker's motion
_OUTLINE = 300           # points along each side of the map from which an object's outline is drawn
_TIMES = (1, 2, 5, 10)   # that arrows are drawn longer, at most


def draw(result: "PressResult", *, full_scale: bool = False, figure: "Figure | None" = None) -> "Figure":
    """A column per load step, a row for each thing: the map in mm, the counts of the taxels with numbers in the cells, each other
    reading, and for solids the displaced nodes of their outside.

    full_scale: the taxels' colours end at the readout's largest count; else at the largest count of the press
    figure: to draw into, by default a new one that no window shows
    """
    from matplotlib.figure import Figure

    rows = list(_rows(result, full_scale))
    figure = figure or Figure()
    plane = result.deformation_map_mm is not None
    ratio = (result.y_mm[-1] - result.y_mm[0]) / (result.x_mm[-1] - result.x_mm[0]) if plane else 0.0
    maps = sum(row in (_draw_map, _draw_taxels) for row, *_ in rows)
    images = [given[-1].shape[1] / given[-1].shape[2] for row, _, _, *given in rows if row in (_draw_image, _draw_depth)]
    others = _HEIGHT * (len(rows) - maps - len(images)) + sum(0.7 + _WIDTH * shape for shape in images)
    figure.set_size_inches(1.2 + 2.3 * result.steps, 2.4 + 1.6 * maps * ratio + others)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(max(len(rows), 1), result.steps, squeeze=False)
    for line, (row, name, label, *given) in zip(axes, rows, strict=False):
        drawn = [row(result, axis, step, *given) for step, axis in enumerate(line)]
        line[0].set_ylabel(name)
        if drawn[-1] is not None:
            figure.colorbar(drawn[-1], ax=line, label=label)
    for step, force in enumerate(result.normal_force_n):
        axes[0, step].set_title(f"{force:.4g} N, depth {result.indentation_mm[step]:.3g} mm", fontsize=9)
    figure.suptitle(f"{result.model} model, sensor {result.sensor}")
    return figure


def _rows(result, full_scale):
    """For each row: its drawing function, its name, the meaning of its colours, and further arguments of the function."""
    if result.deformation_map_mm is not None:
        below = "PCB" if "taxels" in result.readings else "base"
        yield _draw_map, "deformation: y (mm)", f"towards the {below} (mm)"
    taxels = result.readings.get("taxels")
    if taxels is not None and result.deformation_map_mm is not None and taxels.dims == ("step", "row", "column"):
        highest = result.largest_counts if full_scale else max(float(result.tactile_map.max()), 1.0)
        ends = " (some at the end of the range)" if result.taxels_at_range_end.any() else ""
        yield _draw_taxels, "taxels: y (mm)", f"counts, ideal readout{ends}", highest
    if result.solid is not None:
        largest = float(np.linalg.norm(result.solid.displacement_mm, axis=2).max()) or 1.0
        yield _draw_solid, "solids: z (mm)", "displacement (mm)", largest
    cameras = [name for name, reading in result.readings.items() if "channel" in reading.dims]
    markers = next((reading for reading in result.readings.values() if "rest_x_px" in reading.coords), None)
    for name, reading in result.readings.items():
        if name in cameras:
            yield _draw_image, f"{name}: row (px)", "", markers, reading
        elif {"y", "x"} <= set(reading.dims):
            yield _draw_depth, f"{name}: row (px)", f"{name} ({reading.attrs.get('units', '')})", float(np.nanmax(reading)), reading
        elif name != "taxels" and not (cameras and "marker" in reading.dims):
            yield _draw_reading, name, "", reading


def around_points(x: "ArrayLike", y: "ArrayLike") -> tuple[float, float, float, float]:
    """The extent of an image of values at even points x (n,) and y (m,): each cell has its point in the middle."""
    sides = []
    for points in (np.asarray(x, dtype=float), np.asarray(y, dtype=float)):
        half = 0.5 * (points[1] - points[0])
        sides += [float(points[0] - half), float(points[-1] + half)]
    return sides[0], sides[1], sides[2], sides[3]


def _half_sides(result):
    half = [0.5 * (side[-1] - side[0]) for side in (result.x_mm, result.y_mm)]
    return half, (-half[0], half[0], -half[1], half[1])


def _draw_map(result, axis, step):
    axis.set_xlabel("x (mm)")
    deepest = float(result.deformation_map_mm.max()) or 1.0
    _outline(result, axis, step)
    image = axis.imshow(result.deformation_map_mm[step], origin="lower", extent=around_points(result.x_mm, result.y_mm), vmin=0,
                        vmax=deepest, cmap="viridis")
    (x0, x1, y0, y1) = _half_sides(result)[1]
    axis.set(xlim=(x0, x1), ylim=(y0, y1))     # half of the outermost cells lies beside the map
    return image


def _outline(result, axis, step):
    """The outline of a rigid object from above, dashed, and of its part below the surface at rest, in the frame of the map."""
    placed = result.placed_object
    if placed is None:
        return
    at = placed.points_mm + placed.displacement_mm[step]
    (x0, x1, y0, y1), surface = _half_sides(result)[1], HeightField(trimesh.Trimesh(at, placed.triangles, process=False))
    x, y = (np.linspace(low, high, _OUTLINE) for low, high in ((x0, x1), (y0, y1)))
    low = surface.on_grid(x, y)
    axis.contour(x, y, np.isfinite(low), [0.5], colors="white", linewidths=0.8, linestyles="dashed")
    if np.nanmin(low, initial=np.inf) < 0:
        axis.contour(x, y, np.where(np.isfinite(low), low, np.nanmax(low)), [0.0], colors="white", linewidths=0.8)


def _draw_taxels(result, axis, step, highest):
    half, extent = _half_sides(result)
    axis.set_xlabel("x (mm)")
    _outline(result, axis, step)
    image = axis.imshow(result.tactile_map[step], origin="lower", extent=extent, vmin=0, vmax=highest, cmap="viridis")
    _write_counts(axis, result.tactile_map[step], half, highest)
    return image


def _write_counts(axis, counts, half, highest):
    """Each taxel's count in its cell."""
    if counts.size > _MOST_NUMBERS:
        return
    rows, columns = counts.shape
    x, y = ((2 * np.arange(count) + 1 - count) / count * side for count, side in ((columns, half[0]), (rows, half[1])))
    for (j, i), value in np.ndenumerate(counts):
        axis.text(x[i], y[j], f"{value:.0f}", ha="center", va="center", fontsize=6,
                  color="black" if value > _LIGHT * highest else "white")


def _draw_solid(result, axis, step, largest):
    """The nodes of the solids' outside from the side, far ones first."""
    solid = result.solid
    outside = np.unique(np.concatenate([nodes.ravel() for nodes in solid.mesh.boundary.values()]))
    moved = solid.displacement_mm[step, outside]
    x, y, z = (solid.mesh.points[outside] + moved).T
    order = np.argsort(-y)
    axis.set_aspect("equal")
    axis.set_xlabel("x (mm)")
    rigid = solid.object_points_mm + solid.object_displacement_mm[step]
    axis.plot(rigid[:, 0], rigid[:, 2], ".", color="0.7", markersize=2)
    return axis.scatter(x[order], z[order], c=np.linalg.norm(moved, axis=1)[order], s=6, vmin=0, vmax=largest, cmap="viridis")


def _draw_image(result, axis, step, markers, reading):
    """A camera's image at a load step, with arrows from where its markers were at rest, of one scale at all steps."""
    axis.imshow(reading.values[step])
    axis.set_xlabel("column (px)")
    if markers is None:
        return
    rest = np.column_stack([markers["rest_x_px"].values, markers["rest_y_px"].values])
    moved = markers.values - rest
    most, room = np.linalg.norm(moved, axis=2).max(axis=1), _LONGEST * reading.shape[2]
    times = max((times for times in _TIMES if times * most.max() <= room), default=1)
    axis.quiver(*rest.T, *times * moved[step].T, angles="xy", scale_units="xy", scale=1, color="yellow", width=0.007)
    axis.set_title(f"moved {most[step]:.2g} px" + (f", drawn x {times}" if times > 1 else ""), fontsize=8)


def _draw_depth(result, axis, step, largest, reading):
    axis.set_xlabel("column (px)")
    return axis.imshow(reading.values[step], vmin=0, vmax=largest or 1.0, cmap="gray")


def _draw_reading(result, axis, step, reading):
    """Values of a reading at a load step: an image of two or three dimensions, else lines."""
    values = np.atleast_1d(reading.values[step])
    if values.ndim > 1 and "quantity" not in reading.dims:
        axis.imshow(values if values.ndim == 2 or values.shape[-1] in (3, 4) else values.mean(axis=-1), cmap="viridis")
        return None
    labels = reading["quantity"].values if "quantity" in reading.coords else [reading.attrs.get("units", "")]
    for column, label in zip(values.reshape(-1, len(labels)).T, labels, strict=True):
        axis.plot(column, "o-", markersize=3, label=label)
    axis.set_xlabel(str(reading.dims[1]) if reading.ndim > 1 else "")
    axis.legend(fontsize=6)
    return None


def save(figure: "Figure", path: str | Path) -> None:
    """Write a figure as PNG or SVG by the path's ending, whole or not at all, the same bytes for the same figure."""
    import matplotlib

    path = Path(path)
    kind = path.suffix[1:]
    metadata = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
    with matplotlib.rc_context({"svg.hashsalt": "softtact"}), atomic_path(path) as temporary:
        figure.savefig(temporary, format=kind, metadata=metadata, bbox_inches="tight", dpi=160)
