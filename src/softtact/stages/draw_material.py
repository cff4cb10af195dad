"""The picture of a material's card: data, fits, residuals, stable ranges.

inputs: card, curves (CSV, one per mode);  outputs: png, svg
"""

from softtact.materials.cards import load_card
from softtact.materials.readers import read_curves
from softtact.reporting.material_plot import plot_material


def run(*, inputs, outputs, settings, threads=1):
    """Draw."""
    plot_material(load_card(inputs["card"]), read_curves(inputs["curves"]), outputs["png"], outputs["svg"])
