"""The picture of a material's card: data, fits, residuals, stable ranges.

inputs: card, curves (CSV, one per mode);  outputs: png, svg
"""

from typing import Any

from softtact.materials.cards import load_card
from softtact.materials.readers import read_curves
from softtact.studies.hybrid.figures.material_plot import plot_material


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    plot_material(load_card(inputs["card"]), read_curves(inputs["curves"]), outputs["png"], outputs["svg"])
