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


def capacitance_per_area(spec: "AnySpec", displacement_mm: float | np.ndarray) -> np.ndarray:
    """Capacitance in pF/mm2 where the electrode plane moved towards the PCB by `displacement_mm` (any shape)."""
    return EPSILON_0_PF_PER_MM / equivalent_air_gap(spec, displacement_mm)


def felt_displacement(spec: "AnySpec", displacement_mm: np.ndarray) -> np.ndarray:
    """Displacement (..., ny, nx) in mm at the map's points that reads as the surface around them does.

    displacement_mm (..., 2 ny - 1, 2 nx - 1): at half the map's steps, of quadratic elements with corners at the map's points
    Its capacitance is the surroundings' mean, weighted by the point's hat function: Simpson's rule, a third of it and each
    neighbour. The surface over a thin wall is steep; at the map's points alone it would read what happens to be there.
    """
    felt = 1 / equivalent_air_gap(spec, displacement_mm)
    for axis in (-2, -1):
        line = np.moveaxis(felt, axis, 0)
        inner = (line[1:-2:2] + line[2:-1:2] + line[3::2]) / 3
        ends = [(line[:1] + 2 * line[1:2]) / 3, (line[-1:] + 2 * line[-2:-1]) / 3]
        felt = np.moveaxis(np.concatenate([ends[0], inner, ends[1]]), 0, axis)
    table = np.linspace(min(0.0, displacement_mm.min()), (1 - _LEAST_GAP) * spec.dielectric_thickness_mm, _DISPLACEMENTS)
    return np.interp(felt, 1 / equivalent_air_gap(spec, table), table)


def ideal_counts(spec: "AnySpec", deformation_map_mm: np.ndarray, *, counts_per_relative_change: float = 1000.0) -> np.ndarray:
    """Counts (..., rows, columns) of an ideal readout: proportional to dC / C0, limited to the converter's range."""
    rest = capacitance_per_area(spec, 0.0)
    change = taxel_means(spec, capacitance_per_area(spec, deformation_map_mm)) / rest - 1
    return np.clip(counts_per_relative_change * change, 0.0, spec.largest_counts)
