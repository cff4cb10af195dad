"""Derivatives of the taxels' counts by numbers on which the deformation depends: those of `capacitance` and `virtual_sensor`.

A rate has the shape of what it is the rate of, after a first axis for the k numbers. They are derivatives of the formulas as they
are computed, tables included; a taxel at an end of the converter's range has none.
"""

from typing import TYPE_CHECKING

import numpy as np

from softtact.readout.capacitance import (
    COUNTS_PER_RELATIVE_CHANGE,
    EPSILON_0_PF_PER_MM,
    air_gap_rate,
    around,
    capacitance_per_area,
    equivalent_air_gap,
    felt_table,
    table_slope,
)
from softtact.readout.electrodes import coupled, electrode_sides, fringe_factor, fringe_rate, taxel_means
from softtact.readout.taxels import counts_of
from softtact.readout.virtual_sensor import VirtualSensorSettings, taxel_capacitance

if TYPE_CHECKING:
    from softtact.sensors.specification import AnySpec


def felt_with_rates(spec: "AnySpec", displacement_mm: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`felt_displacement` (..., ny, nx), and its rates (k, ..., ny, nx) from those (k, ..., 2 ny - 1, 2 nx - 1) of the
    displacement.
    """
    inverse = 1 / equivalent_air_gap(spec, displacement_mm)
    around_points, inverse_rates = around(inverse), around(-air_gap_rate(spec, displacement_mm) * inverse**2 * rates)
    x, table = felt_table(spec, displacement_mm)
    slope = table_slope(around_points, x, table)
    first = rates.reshape(len(rates), -1)[:, displacement_mm.argmin()] if table[0] < 0 else np.zeros(len(rates))
    # The table begins at the highest point of a bulge, and follows it: by 1e-5 of the rates.
    by_table, by_x = np.linspace(1, 0, len(table)), -air_gap_rate(spec, table) * x**2
    along = np.interp(around_points, x, by_table) - slope * np.interp(around_points, x, by_table * by_x)
    return np.interp(around_points, x, table), slope * inverse_rates + along * first.reshape(-1, *[1] * slope.ndim)


def counts_rates(spec: "AnySpec", displacement_mm: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Rates (k, ..., rows, columns) of `counts_of` from those (k, ..., y, x) of the displacement in mm."""
    counts = counts_of(spec, displacement_mm)
    known = spec.calibration
    if known is None:
        gap = equivalent_air_gap(spec, displacement_mm)
        per_mm = -EPSILON_0_PF_PER_MM * air_gap_rate(spec, displacement_mm) / gap**2 / capacitance_per_area(spec, 0.0)
        found, low = COUNTS_PER_RELATIVE_CHANGE * taxel_means(spec, per_mm * rates), 0.0
    else:
        factor = known.counts_per_relative_change * np.array(known.gain)
        found, low = factor * relative_change_rates(spec, displacement_mm, rates), -np.inf
    return np.where((counts > low) & (counts < spec.largest_counts), found, 0.0)


def relative_change_rates(spec: "AnySpec", displacement_mm: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Rates (k, ..., rows, columns) of `readout.taxels.relative_change` from those (k, ..., y, x) of the displacement in mm."""
    settings = VirtualSensorSettings()
    spacing = settings.electrode_spacing_mm
    fringe = {"spacing_mm": spacing, "outer": settings.outer_fringe, "inner": settings.inner_fringe}
    air = equivalent_air_gap(spec, displacement_mm)
    means, moved = (taxel_means(spec, values, spacing_mm=spacing) for values in (1 / air, displacement_mm))
    means_rate = taxel_means(spec, -air_gap_rate(spec, displacement_mm) / air**2 * rates, spacing_mm=spacing)
    moved_rate = taxel_means(spec, rates, spacing_mm=spacing)
    thickness = spec.dielectric_thickness_mm
    gap = np.maximum(thickness - moved, 0.02 * thickness)
    gap_rate = np.where(thickness - moved > 0.02 * thickness, -moved_rate, 0.0)
    area = EPSILON_0_PF_PER_MM * np.prod(electrode_sides(spec, spacing_mm=spacing))
    found = area * (means_rate * fringe_factor(spec, gap, **fringe) + means * fringe_rate(spec, gap, **fringe) * gap_rate)
    rest = taxel_capacitance(spec, np.zeros(displacement_mm.shape[-2:]))      # type: ignore[arg-type]
    return coupled(found, settings.coupling) / rest
