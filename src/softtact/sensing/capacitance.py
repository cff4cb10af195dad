"""From the electrode's displacement to counts of the taxels: plate capacitors in columns over the electrodes.

Per unit area, the air and the solid of the dielectric are capacitors in series: C = eps0 / (gap_air + solid / eps_r).
The frusta's volume is spread evenly over their height: the compression takes air first, and solid only when no air is left.
"""

import numpy as np

EPSILON_0_PF_PER_MM = 8.8541878128e-3


def layer_heights(spec):
    """Heights (mm) of air and solid in the dielectric at rest, the frusta's volume spread evenly over their cell."""
    f = spec.dielectric.frusta
    r, R = 0.5 * f.tip_diameter_mm, 0.5 * f.root_diameter_mm
    solid = np.pi * f.height_mm / 3 * (r * r + r * R + R * R) / f.pitch_mm**2
    return f.height_mm - solid, solid + spec.dielectric.sheet_thickness_mm


def capacitance_per_area(spec, displacement_mm):
    """Capacitance in pF/mm2 where the electrode moved towards the PCB by `displacement_mm` (any shape)."""
    air, solid = layer_heights(spec)
    moved = np.clip(displacement_mm, None, 0.98 * (air + solid))   # the plates cannot meet
    left_air = np.maximum(air - moved, 0.0)
    left_solid = solid - np.maximum(moved - air, 0.0)
    return EPSILON_0_PF_PER_MM / (left_air + left_solid / spec.dielectric.relative_permittivity)


def taxel_means(spec, field):
    """Means (..., rows, columns) over the taxels of a field (..., y, x) on the deformation map's grid (trapezoidal rule)."""
    rows = _averaging(spec.map_y_mm, spec.taxels.rows)
    columns = _averaging(spec.map_x_mm, spec.taxels.columns)
    return np.einsum("ry,...yx,cx->...rc", rows, field, columns, optimize=True)


def _averaging(grid, count):
    """Weights (count, grid): the mean of the piecewise linear interpolant over equal parts of the side."""
    edges = np.linspace(grid[0], grid[-1], count + 1)
    weights = np.zeros((count, len(grid)))
    for part, (low, high) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        inner = grid[(grid > low) & (grid < high)]
        nodes = np.concatenate([[low], inner, [high]])
        share = np.zeros(len(nodes))
        share[:-1] += 0.5 * np.diff(nodes)
        share[1:] += 0.5 * np.diff(nodes)
        for node, weight in zip(nodes, share / (high - low), strict=True):
            k = min(int(np.searchsorted(grid, node, side="right")) - 1, len(grid) - 2)
            t = (node - grid[k]) / (grid[k + 1] - grid[k])
            weights[part, k] += weight * (1 - t)
            weights[part, k + 1] += weight * t
    return weights


def ideal_counts(spec, deformation_map_mm, *, counts_per_relative_change=1000.0, largest=2400.0):
    """Counts (..., rows, columns) of a faultless readout: proportional to dC / C0, limited to the converter's range."""
    rest = capacitance_per_area(spec, 0.0)
    change = taxel_means(spec, capacitance_per_area(spec, deformation_map_mm)) / rest - 1
    return np.clip(counts_per_relative_change * change, 0.0, largest)
