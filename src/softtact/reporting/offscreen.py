"""Render the views that `render` wrote into a folder: `python -m softtact.reporting.offscreen FOLDER` (no display needed)."""

import json
import sys
from pathlib import Path

import numpy as np


def main(folder: str | Path) -> None:
    """Read views.json and arrays.npz, write images.npz."""
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
    for p, look in enumerate(view["parts"]):
        triangles = arrays[f"triangles_{number}_{p}"]
        faces = np.hstack([np.full((len(triangles), 1), 3), triangles]).astype(np.int64)
        surface = pyvista.PolyData(arrays[f"points_{number}_{p}"], faces.ravel())
        if look["as_lines"]:
            plotter.add_mesh(surface.extract_all_edges(), color=look["colour"], line_width=1.8, opacity=look["opacity"])
        else:
            plotter.add_mesh(surface, color=look["colour"], opacity=look["opacity"], smooth_shading=look["edges"] is None,
                             split_sharp_edges=look["edges"] is None, show_edges=look["edges"] is not None,
                             edge_color=look["edges"] or "black", line_width=0.6, specular=0.25, specular_power=12, ambient=0.12)
    plotter.enable_anti_aliasing("ssaa")
    plotter.camera_position = [view["seen_from"], (0.0, 0.0, 0.0), view["up"]]
    plotter.reset_camera()
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return image


if __name__ == "__main__":
    main(sys.argv[1])
