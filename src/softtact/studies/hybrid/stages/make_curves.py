"""Test curves of a material, one CSV per mode: made from a law, or gathered from the user's files."""

from typing import Any

from softtact.materials.making import make_curves


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """inputs: measured (the user's files; none for synthetic curves); outputs: curves ({mode}.csv of each mode)."""
    make_curves(inputs.get("measured", []), outputs["curves"], settings)
