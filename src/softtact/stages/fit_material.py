"""Fit the family of laws to a material's curves and write its card."""

from softtact.files import write_json
from softtact.materials.cards import make_card
from softtact.materials.config import FitSettings, validated
from softtact.materials.readers import read_curves


def run(*, inputs, outputs, settings, threads=1):
    """inputs: curves (CSV, one per mode); outputs: card (JSON)."""
    options = dict(settings)
    material, printed = options.pop("material"), options.pop("printed", None)
    options = validated(FitSettings, options, where=f"material {material}, fit").model_dump()
    write_json(outputs["card"], make_card(read_curves(inputs["curves"]), material=material, printed=printed, **options))
