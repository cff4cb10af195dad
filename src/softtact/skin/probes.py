"""Capacitance of a taxel against pressure under cylindrical probes, for a modulus that is off: figure 6 of Le et al. 2011."""

import warnings
from collections.abc import Sequence

import numpy as np
import pandas as pd

from softtact.errors import ExtrapolationWarning
from softtact.skin.analysis import Skin
from softtact.skin.elastomers import Elastomer
from softtact.skin.layout import Layout
from softtact.skin.loads import disc, refuse_beside

_PLACES = 6  # ratios of pressure to modulus that are solved, at the extremes of a Chebyshev polynomial


def alone(layout: Layout, taxel: int) -> Layout:
    """The same elastomer with one taxel (counted from 0); the others become a part of the guard, which is driven alike."""
    return Layout(
        layout.outline_mm,
        layout.centres_mm[[taxel]],
        layout.module[[taxel]],
        layout.corners_mm,
        layout.radius_mm,
        layout.guard_radius_mm,
    )


def probe_curves(
    skin: Skin,
    elastomer: Elastomer,
    *,
    diameters_mm: Sequence[float],
    pressures_kpa: Sequence[float],
    modulus_shares: Sequence[float],
) -> pd.DataFrame:
    """A row for each diameter, share and pressure: capacitance of the first taxel of a skin, and what it rises by.

    modulus_shares: by how much Young's modulus is off, 0 for the curve as it is. Deformations are proportional to pressure over
    modulus, and the capacitance is a smooth function of that ratio, which is solved at a few places and interpolated.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtrapolationWarning)
        moduli = np.array([elastomer.young_mpa(1e-3 * pressure) for pressure in pressures_kpa])
    pressures = 1e-3 * np.asarray(pressures_kpa)
    ratio = {share: pressures / ((1 + share) * moduli) for share in modulus_shares}
    largest = max(values.max() for values in ratio.values())
    places = largest * 0.5 * (1 - np.cos(np.pi * np.arange(1, _PLACES + 1) / _PLACES))
    rows = []
    for diameter in diameters_mm:
        x, y = skin.layout.centres_mm[0]
        load = disc((float(x), float(y)), diameter_mm=diameter, pressure_mpa=1.0)
        refuse_beside(load, skin.layout, where=f"probes, diameter {diameter:g} mm")
        unit = skin.layer.displacement(load, young_mpa=1.0)
        rise = [skin.field(place * unit).capacitance_ff[0] - skin.at_rest_ff[0] for place in places]
        polynomial = np.polynomial.Polynomial.fit([0.0, *places], [0.0, *rise], _PLACES)
        rows += [
            {
                "diameter_mm": diameter,
                "modulus_share": share,
                "pressure_kpa": pressure,
                "young_mpa": (1 + share) * modulus,
                "capacitance_ff": skin.at_rest_ff[0] + polynomial(value),
                "delta_ff": polynomial(value),
                "within_test": bool(elastomer.tested_mpa[0] <= 1e-3 * pressure <= elastomer.tested_mpa[1]),
            }
            for share, values in ratio.items()
            for pressure, modulus, value in zip(pressures_kpa, moduli, values, strict=True)
        ]
    return pd.DataFrame(rows)
