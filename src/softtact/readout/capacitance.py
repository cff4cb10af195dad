"""Capacitance per area between the PCB and the electrode plane where that plane moved towards the PCB.

Symbols: h, t height of the frusta and thickness of the sheet above them (mm);  u displacement (mm);  stretch = (h - u) / h
phi(z) area share of the solid at height z;  eps relative permittivity of the solid (air: 1).

Within the height z solid and air lie side by side, so their permittivities add by area: eps(z) = 1 + (eps - 1) phi(z). Slices over
one another are capacitors in series: C = eps0 / (integral dz / eps(z) + t / eps).
That every height is an equipotential makes this an upper bound; straight field lines (columns of air and solid in series, side by
side) make a lower one (J. W. Strutt, Phil. Trans. 161, 1871; J. C. Maxwell, Treatise, 1873, art. 306 to 308). Reasons for the upper
one, and its difference from the field of a cell: docs/explanation/virtual_sensor.md.

The solid keeps its volume. The sheet is confined, so only the frusta deform: each slice spreads as its height shrinks,
phi = min(1, k phi at rest), until the pocket between the frusta is full. Further movement compresses the solid.
"""

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.readout.electrodes import taxel_means

if TYPE_CHECKING:
    from softtact.sensors.frusta import Frusta
    from softtact.sensors.specification import AnySpec

EPSILON_0_PF_PER_MM = 8.8541878128e-3
COUNTS_PER_RELATIVE_CHANGE = 1000.0     # of an ideal readout
_LEAST_GAP = 0.02         # of the dielectric's thickness, so that the plates never meet
_SLICES, _STATES = 400, 2001
_DISPLACEMENTS = 4001     # among which one of a given capacitance is interpolated: it is within 1e-7 mm


def solid_share(frusta: "Frusta") -> np.ndarray:
    """Area share phi (slices,) of the solid at the middles of equally thick slices of the frusta at rest, tip first."""
    height = (np.arange(_SLICES) + 0.5) / _SLICES
    diameter = frusta.tip_diameter_mm + height * (frusta.root_diameter_mm - frusta.tip_diameter_mm)
    return np.minimum(0.25 * np.pi * diameter**2 / frusta.pitch_mm**2, 1.0)


@functools.lru_cache(maxsize=32)
def _pocket(frusta, permittivity):
    """(stretch (states,) rising, mean of 1 / eps(z) (states,)) of the frusta from pulled to twice their height to a full pocket."""
    phi = solid_share(frusta)
    k = np.geomspace(0.5, 1 / phi.min(), _STATES)[::-1]
    spread = np.minimum(1.0, k[:, None] * phi)
    return phi.mean() / spread.mean(axis=1), (1 / (1 + (permittivity - 1) * spread)).mean(axis=1)


def equivalent_air_gap(spec: "AnySpec", displacement_mm: float | np.ndarray) -> np.ndarray:
    """Thickness (mm) of air with the same capacitance per area, where the electrode plane moved by `displacement_mm`.

    For a plain layer that is the decrease of its thickness. The layer keeps its volume and spreads. The electrodes do not, so their
    area is constant, and the dielectric beyond their edges belongs to the fringe field.
    """
    d: Any = spec.dielectric
    moved = np.minimum(displacement_mm, (1 - _LEAST_GAP) * spec.dielectric_thickness_mm)
    if np.isnan(spec.frustum_height_mm):
        return (d.thickness_mm - moved) / d.relative_permittivity
    h = d.frusta.height_mm
    share = np.interp(1 - moved / h, *_pocket(d.frusta, d.relative_permittivity))     # 1 / eps once no air is left
    return (h - moved) * share + d.sheet_thickness_mm / d.relative_permittivity


def air_gap_rate(spec: "AnySpec", displacement_mm: np.ndarray) -> np.ndarray:
    """Derivative (mm per mm, any shape) of `equivalent_air_gap` by the displacement; 0 where the plates are as near as they get."""
    d: Any = spec.dielectric
    most = (1 - _LEAST_GAP) * spec.dielectric_thickness_mm
    moved = np.minimum(displacement_mm, most)
    if np.isnan(spec.frustum_height_mm):
        rate = np.full_like(moved, -1 / d.relative_permittivity)
    else:
        h, (stretch, share) = d.frusta.height_mm, _pocket(d.frusta, d.relative_permittivity)
        at = 1 - moved / h
        rate = -np.interp(at, stretch, share) - (1 - moved / h) * table_slope(at, stretch, share)
    return np.where(displacement_mm < most, rate, 0.0)


def table_slope(at: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Derivative (any shape) of `numpy.interp(at, x, y)` by `at`: that of the piece, and 0 beyond the ends."""
    piece = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    return np.where((at >= x[0]) & (at <= x[-1]), (np.diff(y) / np.diff(x))[piece], 0.0)


def capacitance_per_area(spec: "AnySpec", displacement_mm: float | np.ndarray) -> np.ndarray:
    """Capacitance in pF/mm2 where the electrode plane moved towards the PCB by `displacement_mm` (any shape)."""
    return EPSILON_0_PF_PER_MM / equivalent_air_gap(spec, displacement_mm)


def felt_displacement(spec: "AnySpec", displacement_mm: np.ndarray) -> np.ndarray:
    """Displacement (..., ny, nx) in mm at the map's points that reads as the surface around them does.

    displacement_mm (..., 2 ny - 1, 2 nx - 1): at half the map's steps, of quadratic elements with corners at the map's points
    Its capacitance is the surroundings' mean, weighted by the point's hat function: Simpson's rule, a third of it and each
    neighbour. The surface over a thin wall is steep; at the map's points alone it would read what happens to be there.
    """
    table = felt_table(spec, displacement_mm)
    return np.interp(around(1 / equivalent_air_gap(spec, displacement_mm)), *table)


def around(values: np.ndarray) -> np.ndarray:
    """Means (..., ny, nx) around the map's points of values (..., 2 ny - 1, 2 nx - 1) at half its steps, by Simpson's rule."""
    for axis in (-2, -1):
        line = np.moveaxis(values, axis, 0)
        inner = (line[1:-2:2] + line[2:-1:2] + line[3::2]) / 3
        ends = [(line[:1] + 2 * line[1:2]) / 3, (line[-1:] + 2 * line[-2:-1]) / 3]
        values = np.moveaxis(np.concatenate([ends[0], inner, ends[1]]), 0, axis)
    return values


def felt_table(spec: "AnySpec", displacement_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverses of equivalent air gaps (t,), rising, and the displacements (t,) in mm that have them, for `felt_displacement`."""
    table = np.linspace(min(0.0, displacement_mm.min()), (1 - _LEAST_GAP) * spec.dielectric_thickness_mm, _DISPLACEMENTS)
    return 1 / equivalent_air_gap(spec, table), table


def ideal_counts(spec: "AnySpec", deformation_map_mm: np.ndarray, *,
                 counts_per_relative_change: float = COUNTS_PER_RELATIVE_CHANGE) -> np.ndarray:
    """Counts (..., rows, columns) of an ideal readout: proportional to dC / C0, limited to the converter's range."""
    rest = capacitance_per_area(spec, 0.0)
    change = taxel_means(spec, capacitance_per_area(spec, deformation_map_mm)) / rest - 1
    return np.clip(counts_per_relative_change * change, 0.0, spec.largest_counts)
