"""Test curves of a material, one CSV per mode: made from a law, or gathered from the user's own files."""

from softtact.materials.making import make_curves


def run(*, inputs, outputs, settings, threads=1):
    """inputs: measured (the user's files; none for synthetic curves); outputs: curves ({mode}.csv of each mode)."""
    make_curves(inputs.get("measured", []), outputs["curves"], settings)
