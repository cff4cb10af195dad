"""Views of solids for figures: rendered off screen by VTK, or drawn by matplotlib if that fails.

VTK needs OpenGL (its wheels include a software renderer). A driver that fails may crash the process or hang, so VTK runs in a
separate process, `python -m softtact.reporting.render FOLDER`, with a time limit. Log and figure name the renderer.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.drawing import drawn_apart
from softtact.outputs import temporary_folder

if TYPE_CHECKING:
    import trimesh
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec


FALLBACK = "3-D views drawn by matplotlib: no off-screen renderer here"
TIMEOUT_S = 120.0
_COMMAND = (sys.executable, "-m", "softtact.reporting.render")


@dataclass(frozen=True)
class Part:
    """Triangles (m, 3) of points_mm (n, 3) in one colour; as_lines: only their edges;  edges: their colour, or None."""

    points_mm: np.ndarray
    triangles: np.ndarray
    colour: str = "#b8bcc4"
    opacity: float = 1.0
    as_lines: bool = False
    edges: str | None = None


@dataclass(frozen=True)
class View:
    """Parts seen from a direction: `seen_from` (3,) points from the middle to the eye, `up` (3,) is up in the picture."""

    parts: list = field(default_factory=list)
    seen_from: tuple = (0.6, -1.0, 0.8)
    up: tuple = (0.0, 0.0, 1.0)


def part_of(mesh: "trimesh.Trimesh", **look: Any) -> Part:
    """A `Part` of a trimesh."""
    return Part(points_mm=np.asarray(mesh.vertices), triangles=np.asarray(mesh.faces), **look)


def rendered(views: Sequence[View], *, size: tuple[int, int] = (900, 675), timeout_s: float = TIMEOUT_S) -> list[np.ndarray] | None:
    """Images (h, w, 3) of the views, 0 to 255, or None if rendering failed, with a sentence on stderr."""
    with temporary_folder() as folder:
        _write(views, size, folder)
        images = drawn_apart(_COMMAND, folder, sentence=FALLBACK, timeout_s=timeout_s)
    return None if images is None else [images[f"view{k}"] for k in range(len(views))]


def _write(views, size, folder):
    """Write views.json and arrays.npz, which `main` reads."""
    arrays, listed = {}, []
    for v, view in enumerate(views):
        for p, part in enumerate(view.parts):
            arrays[f"points_{v}_{p}"], arrays[f"triangles_{v}_{p}"] = part.points_mm, part.triangles
        looks = [{"colour": part.colour, "opacity": part.opacity, "as_lines": part.as_lines, "edges": part.edges}
                 for part in view.parts]
        listed.append({"parts": looks, "seen_from": list(map(float, view.seen_from)), "up": list(map(float, view.up))})
    np.savez(folder / "arrays.npz", **arrays)
    (folder / "views.json").write_text(json.dumps({"size": size, "views": listed}), encoding="utf-8")


def add_view(figure: "Figure", place: "SubplotSpec", view: View, image: np.ndarray | None) -> "Axes":
    """Axes in a grid cell with the image, or with the view drawn by matplotlib if there is no image."""
    if image is None:
        axes = figure.add_subplot(place, projection="3d")
        _draw(axes, view)
    else:
        axes = figure.add_subplot(place)
        axes.imshow(_cropped(image))
    axes.set_axis_off()
    return axes


def note_fallback(figure: "Figure", images: list[np.ndarray] | None) -> None:
    """Add a line under the figure if its views were drawn by matplotlib."""
    if images is None:
        figure.text(0.005, 0.002, FALLBACK, fontsize=6, color="0.4", ha="left", va="bottom")


def _cropped(image, margin=8):
    """The image with its white border cropped to a margin."""
    rows, columns = (np.flatnonzero((image < 250).any(axis=(1 - axis, 2))) for axis in (0, 1))
    if not len(rows):
        return image
    return image[max(0, rows[0] - margin):rows[-1] + margin, max(0, columns[0] - margin):columns[-1] + margin]


def _draw(axes, view):
    """Draw the view in matplotlib's 3-D axes: flat facets, farther ones first."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    points = np.vstack([part.points_mm for part in view.parts])
    for part in view.parts:
        corners = part.points_mm[part.triangles]
        if part.as_lines:
            axes.add_collection3d(Line3DCollection(corners[:, [0, 1, 2, 0]], colors=part.colour, linewidths=0.3))
            continue
        axes.add_collection3d(Poly3DCollection(corners, facecolors=_shaded(corners, part), edgecolors=part.edges or "none",
                                               linewidths=0.1))
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]), box_aspect=np.maximum(high - low, 1e-3))
    x, y, z = view.seen_from
    axes.view_init(elev=np.degrees(np.arctan2(z, np.hypot(x, y))), azim=np.degrees(np.arctan2(y, x)))


def _shaded(corners, part):
    """Colours (m, 4) of facets (m, 3, 3), lighter towards a light source above."""
    from matplotlib.colors import to_rgb

    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    light = 0.45 + 0.55 * np.abs(normal @ np.array([0.4, 0.3, 0.86]))
    return np.column_stack([light[:, None] * np.array(to_rgb(part.colour)), np.full(len(corners), part.opacity)])


def main(folder: str | Path) -> None:
    """Render views.json and arrays.npz into images.npz, without a display."""
    import pyvista

    pyvista.OFF_SCREEN = True
    folder = Path(folder)
    spec = json.loads((folder / "views.json").read_text(encoding="utf-8"))
    with np.load(folder / "arrays.npz", allow_pickle=False) as arrays:
        images = {f"view{v}": _image(pyvista, v, view, spec["size"], arrays) for v, view in enumerate(spec["views"])}
    np.savez_compressed(folder / "images.npz", **images)


def _image(pyvista, number, view, size, arrays):
    """One view as an image (h, w, 3)."""
    plotter = pyvista.Plotter(off_screen=True, window_size=size)
    plotter.set_background("white")
    for p, style in enumerate(view["parts"]):
        triangles = arrays[f"triangles_{number}_{p}"]
        faces = np.hstack([np.full((len(triangles), 1), 3), triangles]).astype(np.int64)
        surface = pyvista.PolyData(arrays[f"points_{number}_{p}"], faces.ravel())
        if style["as_lines"]:
            plotter.add_mesh(surface.extract_all_edges(), color=style["colour"], line_width=1.8, opacity=style["opacity"])
        else:
            plotter.add_mesh(surface, color=style["colour"], opacity=style["opacity"], smooth_shading=style["edges"] is None,
                             split_sharp_edges=style["edges"] is None, show_edges=style["edges"] is not None,
                             edge_color=style["edges"] or "black", line_width=0.6, specular=0.25, specular_power=12, ambient=0.12)
    plotter.enable_anti_aliasing("ssaa")
    plotter.camera_position = [view["seen_from"], (0.0, 0.0, 0.0), view["up"]]
    plotter.reset_camera()
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return image


if __name__ == "__main__":
    main(sys.argv[1])
