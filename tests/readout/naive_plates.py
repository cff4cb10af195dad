"""Capacitance of two square plates by the method of moments: the slow, plain way to what `edge_excess` approximates."""

import numpy as np


def edge_factor(gap_over_side, *, count=30):
    """Capacitance over that of plates without edges: `count` x `count` squares on each plate, evenly charged, potential at middles.

    R. F. Harrington, Field Computation by Moment Methods, 1968, ch. 2
    """
    side = 1 / count
    place = (np.arange(count) + 0.5) * side
    x, y = (axis.ravel() for axis in np.meshgrid(place, place))
    within = np.hypot(x[:, None] - x, y[:, None] - y)
    np.fill_diagonal(within, np.inf)
    own = np.eye(len(x)) * 4 * side * np.log(1 + np.sqrt(2))       # of a square at its middle
    across = side**2 / np.hypot(within, gap_over_side)
    np.fill_diagonal(across, side**2 / gap_over_side)
    charge = np.linalg.solve((own + side**2 / within - across) / (4 * np.pi), np.full(len(x), 0.5))     # plates at +-1/2 V
    return charge.sum() * side**2 * gap_over_side
