"""Where a rigid object can touch a grid of nodes, sharper than the grid: nodes, and how far the object covers their surroundings.

A node beside an edge of the object is neither held nor free. How far it is held follows from the share of its surroundings that
the object covers, weighted by the node's hat function: from nothing, where the edge has come as far as the node before, to a half,
where it is at the node, which is then held. The surroundings are kept as samples, so that the share can be asked for anew where
the node has moved sideways (`ObjectPoints.covered_at`). `models/foundation/dof_maps` makes of it how soft a point is.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

SAMPLES = 8          # a step, around nodes near an edge
REACH = 2            # steps on each side of a node that are sampled: a hat's, and a movement of one step
LOWEST = 0.15        # height in steps over a node's plane up to which a sample can belong to it
_TOUCHED = 0.7       # of the object's depth: what lies higher is not touched, an edge below it may be


@dataclass(frozen=True)
class ObjectPoints:
    """Nodes (c,) of a grid where an object can touch.

    gap (c,): the object's height over the undeformed surface in mm;  slope (c, 2): how it grows in x and y
    edge (e,): places in `nodes` of those with an edge near them;  window (e, s, s): by how much their surroundings, sampled from 2
    steps below to 2 steps above in y and x, lie higher than the plane of gap and slope, in mm
    step (2,): of the grid in mm
    beneath: where nodes near an edge have a lower part of the object beside that over them: `Beneath`, else None
    """

    nodes: np.ndarray
    gap: np.ndarray
    slope: np.ndarray
    edge: np.ndarray
    window: np.ndarray
    step: np.ndarray
    beneath: "Beneath | None" = None

    @property
    def count(self) -> int:
        return len(self.nodes)

    @property
    def covered(self) -> np.ndarray:
        """Share (c,) of each node's surroundings under the object, weighted by its hat function: of area step_x step_y in all."""
        return self.covered_at(np.zeros((2, self.count)), rounding_mm=LOWEST * self.step.min())

    def covered_at(self, moved: np.ndarray, *, rounding_mm: float) -> np.ndarray:
        """The same where the nodes have moved sideways by `moved` (2, c) in mm, up to a step.

        rounding_mm: by how much what counts may lie higher than the plane of a node's gap and slope
        """
        share = np.ones(self.count)
        share[self.edge] = hat_shares(self.window, moved[:, self.edge].T / self.step, rounding_mm)
        return share

    def as_deep(self, depth: float) -> "ObjectPoints":
        """The points where the object has come down by `depth` (mm) since its first touch.

        What lies higher over a node than that is not touched; the edge of what is lower beside it may be.
        """
        if self.beneath is None:
            return self
        lower = self.beneath
        here = self.gap[self.edge[lower.place]] - self.gap.min() > _TOUCHED * depth
        if not here.any():
            return self
        gap, slope, window = self.gap.copy(), self.slope.copy(), self.window.copy()
        place = lower.place[here]
        gap[self.edge[place]], slope[self.edge[place]], window[place] = lower.gap[here], lower.slope[here], lower.window[here]
        return replace(self, gap=gap, slope=slope, window=window, beneath=None)

    def outwards(self) -> np.ndarray:
        """Squares (e, 2) of the x and y components of the direction in which an edge lies from the points near one."""
        places = window_places()
        weights = np.maximum(1 - np.abs(places), 0.0)
        share = (self.window <= LOWEST * self.step.min()) * (weights[:, None] * weights)
        away = np.stack([share.sum(axis=1) @ places, share.sum(axis=2) @ places], axis=1) ** 2
        total = away.sum(axis=1, keepdims=True)
        return np.where(total > 1e-12, away / np.maximum(total, 1e-12), 0.5)


@dataclass(frozen=True)
class Beneath:
    """For some of the nodes near edges, by their place (k,) among these: gap, slope and window over the plane of what is lower."""

    place: np.ndarray
    gap: np.ndarray
    slope: np.ndarray
    window: np.ndarray


def window_places() -> np.ndarray:
    """Samples' places (s,) along a side of a window, in steps from the node."""
    return (np.arange(2 * REACH * SAMPLES) + 0.5) / SAMPLES - REACH


@njit(cache=True, nogil=True)
def hat_shares(window: np.ndarray, moved: np.ndarray, highest: float) -> np.ndarray:
    """Shares (e,), no higher than `highest`, under hats that have moved by (e, 2) steps."""
    size = window.shape[1]
    share = np.zeros(len(window))
    x, y = np.empty(size), np.empty(size)
    for e in range(len(window)):
        for k in range(size):
            place = (k + 0.5) / SAMPLES - REACH
            x[k] = max(1 - abs(place - moved[e, 0]), 0.0) / SAMPLES
            y[k] = max(1 - abs(place - moved[e, 1]), 0.0) / SAMPLES
        for j in range(size):
            if y[j] > 0:
                row = 0.0
                for i in range(size):
                    if window[e, j, i] <= highest:
                        row += x[i]
                share[e] += y[j] * row
    return share
