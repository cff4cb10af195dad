"""The electrodes on the PCB: means over them, the fringe field at their edges, and crosstalk of neighbours."""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from softtact.sensors.base import BaseSpec


def taxel_means(spec: "BaseSpec", field: np.ndarray, *, spacing_mm: float = 0.0,
                shift_mm: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Means (..., rows, columns) over the electrodes of a field (..., y, x) on the deformation map's grid.

    Exact for the field's piecewise linear interpolant, which is constant beyond the map's edge.
    spacing_mm: between neighbouring electrodes, each in the middle of its taxel;  shift_mm: (x, y) of the object over the sensor
    """
    rows, columns = electrode_weights(spec, spacing_mm=spacing_mm, shift_mm=shift_mm)
    return np.einsum("ry,...yx,cx->...rc", rows, field, columns, optimize=True)


def electrode_weights(spec: "BaseSpec", *, spacing_mm: float = 0.0,
                      shift_mm: tuple[float, float] = (0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """Weights (rows, y) and (columns, x) whose products give the means over electrodes; arguments as for `taxel_means`."""
    taxels = spec.need_taxels("a mean over electrodes")
    return (_averaging(tuple(spec.map_y_mm), taxels.rows, spacing=spacing_mm, shift=shift_mm[1]),
            _averaging(tuple(spec.map_x_mm), taxels.columns, spacing=spacing_mm, shift=shift_mm[0]))


@lru_cache(maxsize=32)     # the same for all presses of a sensor, and a tenth of a press with the elastic model
def _averaging(grid, count, *, spacing=0.0, shift=0.0):
    """Weights (count, grid): means over equal parts of the side, each shorter by `spacing`, of a field moved by `shift`."""
    grid = np.array(grid)
    edges = np.linspace(grid[0], grid[-1], count + 1)
    weights = np.zeros((count, len(grid)))
    for part, (low, high) in enumerate(zip(edges[:-1] + 0.5 * spacing - shift, edges[1:] - 0.5 * spacing - shift, strict=True)):
        inner = grid[(grid > low) & (grid < high)]
        nodes = np.concatenate([[low], inner, [high]])
        share = np.zeros(len(nodes))
        share[:-1] += 0.5 * np.diff(nodes)
        share[1:] += 0.5 * np.diff(nodes)
        for node, weight in zip(nodes, share / (high - low), strict=True):
            k = int(np.clip(np.searchsorted(grid, node, side="right") - 1, 0, len(grid) - 2))
            t = np.clip((node - grid[k]) / (grid[k + 1] - grid[k]), 0.0, 1.0)
            weights[part, k] += weight * (1 - t)
            weights[part, k + 1] += weight * t
    weights.flags.writeable = False
    return weights


def electrode_sides(spec: "BaseSpec", *, spacing_mm: float = 0.0) -> tuple[float, float]:
    """Sides (x, y) of an electrode in mm."""
    taxels = spec.need_taxels("an electrode's size")
    return (spec.footprint_mm[0] / taxels.columns - spacing_mm, spec.footprint_mm[1] / taxels.rows - spacing_mm)


def edge_excess(side_mm: float, gap_mm: np.ndarray) -> np.ndarray:
    """Relative increase of a plate's capacitance by the fringe field at two opposite edges; side and gap in mm, any shape.

    gap / (pi side) (1 + ln(2 pi side / gap)): a strip of two equal plates, side > gap; H. B. Palmer, Trans. AIEE 56 (1937) 363-366
    """
    return gap_mm / (np.pi * side_mm) * (1 + np.log(2 * np.pi * side_mm / gap_mm))


def edge_excess_rate(side_mm: float, gap_mm: np.ndarray) -> np.ndarray:
    """Derivative of `edge_excess` by the gap, in 1/mm."""
    return np.log(2 * np.pi * side_mm / gap_mm) / (np.pi * side_mm)


def fringe_factor(spec: "BaseSpec", gap_mm: np.ndarray, *, spacing_mm: float = 0.0, outer: float = 1.0,
                  inner: float = 0.0) -> np.ndarray:
    """Factors (..., rows, columns) of the taxels' capacitance for gaps (..., rows, columns) in mm.

    The two pairs of edges add up. Palmer multiplies them, which is 3 to 6 % above the field of square plates, the sum 1.5 %.
    outer, inner: share of `edge_excess` for an edge on the sensor's border, and for one with a neighbour (1: as without neighbour)
    """
    return 1 + _over_edges(edge_excess, spec, gap_mm, spacing_mm, outer, inner)


def fringe_rate(spec: "BaseSpec", gap_mm: np.ndarray, *, spacing_mm: float = 0.0, outer: float = 1.0,
                inner: float = 0.0) -> np.ndarray:
    """Derivatives (..., rows, columns) of `fringe_factor` by the gaps, in 1/mm."""
    return _over_edges(edge_excess_rate, spec, gap_mm, spacing_mm, outer, inner)


def _over_edges(excess, spec, gap_mm, spacing_mm, outer, inner):
    """The sum over an electrode's two pairs of edges of an excess, weighted by the edges' shares."""
    sides = electrode_sides(spec, spacing_mm=spacing_mm)
    taxels = spec.need_taxels("the field at electrodes' edges")
    along_x = _edge_share(taxels.columns, outer, inner)[None, :]
    along_y = _edge_share(taxels.rows, outer, inner)[:, None]
    return along_x * excess(sides[0], gap_mm) + along_y * excess(sides[1], gap_mm)


def _edge_share(count, outer, inner):
    """Mean share (count,) of the two edges of each electrode in a line."""
    low, high = np.full(count, float(inner)), np.full(count, float(inner))
    low[0] = high[-1] = outer
    return 0.5 * (low + high)


def coupled(values: np.ndarray, share: float) -> np.ndarray:
    """Values (..., rows, columns) after each pair of neighbours in a row or column exchanged `share` of their difference.

    The sum and a uniform map are preserved, and the coupling is symmetric.
    """
    out = np.array(values, dtype=float)
    for axis in (-1, -2):
        flow = share * np.diff(values, axis=axis)
        first, last = (_at(axis, slice(None, -1)), _at(axis, slice(1, None)))
        out[first] += flow
        out[last] -= flow
    return out


def _at(axis, part):
    """Index of `part` along one of the last two axes."""
    return (..., part, slice(None)) if axis == -2 else (..., part)
