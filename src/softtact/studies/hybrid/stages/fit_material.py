"""Fit the family of laws to a material's curves and write its card."""

from typing import Any

from softtact.materials.card_making import make_card, misfit_warnings
from softtact.materials.cards import write_card
from softtact.materials.config import FitStage, validated
from softtact.materials.readers import read_curves
from softtact.progress import announce


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """inputs: curves (CSV, one per mode); outputs: card (JSON)."""
    options = validated(FitStage, settings, where="settings of fit_material").model_dump(exclude_none=True)
    card = make_card(read_curves(inputs["curves"]), **options)
    write_card(outputs["card"], card)
    for warning in misfit_warnings(card):
        announce(f"material {card['material']}: WARNING: {warning}")
