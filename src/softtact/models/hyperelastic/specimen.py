"""One specimen of a sensor: frusta, sheet and cover whose sizes scatter about the drawing's."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from softtact.sensors.frusta import SensorSpec

SCATTER_KEYS = ("height_scatter", "tip_scatter", "thickness_scatter", "specimen")
_LARGEST_DEVIATION = 2.5     # standard deviations: a specimen beyond would not have passed inspection


def frustum_scatter(spec: SensorSpec, values: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray] | None:
    """Factors (heights, tip diameters) of a specimen's frusta, each near 1; None where no scatter is asked for."""
    if not any(key in values for key in SCATTER_KEYS):
        return None
    count = int(np.prod(spec.frusta_counts))
    rng = np.random.default_rng(int(values.get("specimen", 0)))
    heights, tips = rng.standard_normal((2, count)).clip(-_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    return 1 + values.get("height_scatter", 0.0) * heights, 1 + values.get("tip_scatter", 0.0) * tips


def specimen_of(spec: SensorSpec, values: Mapping[str, Any]) -> SensorSpec:
    """The sensor with the thickness of sheet and cover of one specimen; the frusta's scatter is `frustum_scatter`'s."""
    scatter = values.get("thickness_scatter", 0.0)
    if not scatter:
        return spec
    sheet, cover = 1 + scatter * np.random.default_rng([int(values.get("specimen", 0)), 1]).standard_normal(2).clip(
        -_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    dielectric = spec.dielectric.model_copy(update={"sheet_thickness_mm": spec.dielectric.sheet_thickness_mm * sheet})
    return spec.model_copy(update={
        "dielectric": dielectric, "cover": spec.cover.model_copy(update={"thickness_mm": spec.cover.thickness_mm * cover})})
