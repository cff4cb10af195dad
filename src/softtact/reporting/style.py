"""Style of every figure: legible sizes, model colours that also differ in grey, files without dates."""

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from softtact.files import atomic_path

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

# Dark blue, light orange and a green between them, which are distinct in grey, too.
MODEL_COLOURS = {"hyperelastic": "#1f4e79", "elastic": "#e08214", "foundation": "#3f9c6d"}
ARCHITECTURE_LINES = {"printed": "-", "searched": "-.", "compact": "--"}


def pyplot() -> ModuleType:
    """matplotlib's pyplot without a screen, with the project's settings."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams.update({"svg.hashsalt": "softtact", "font.size": 9, "axes.spines.top": False,
                                "axes.spines.right": False, "figure.dpi": 100, "savefig.dpi": 160})
    import matplotlib.pyplot as plt

    return plt


def colour(model: str) -> str:
    """A model's colour; grey for an unlisted model."""
    return MODEL_COLOURS.get(model, "0.4")


def ssim_label(ssim: dict[str, Any] | None) -> str:
    """Axis label of structural similarity with its settings {window, data_range}, if they are known."""
    return "SSIM" if ssim is None else f"SSIM (window {ssim['window']}, range {ssim['data_range']:g} counts)"


def save(figure: "Figure", *paths: str | Path) -> None:
    """Write a figure as PNG and SVG files, completely or not at all; equal figures give equal bytes."""
    plt = pyplot()
    for path in map(Path, paths):
        kind = path.suffix[1:]
        metadata = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format=kind, metadata=metadata, bbox_inches="tight")
    plt.close(figure)


def draw_map(axes: "Axes", values: "np.ndarray", *, extent: Sequence[float], limits: tuple[float, float],
             cmap: str = "jet") -> "AxesImage":
    """An image of a map (y, x), turned 90 degrees counter-clockwise as the paper prints it: y runs to the left."""
    x0, x1, y0, y1 = extent
    return axes.imshow(values.T[:, ::-1], origin="lower", extent=(y1, y0, x0, x1), vmin=limits[0], vmax=limits[1], cmap=cmap,
                       interpolation="nearest", aspect="equal")
