"""Nodes of a grid that a rigid object can touch, with the covered share of their surroundings: a sub-grid resolution of edges.

A node beside an edge of the object is in partial contact. The degree follows from the share of its surroundings that the object
covers, weighted by the node's hat function: zero where the edge is at the previous node, a half where it is at the node, which is
then in full contact. The surroundings are stored as samples, so that the share can be evaluated after a lateral displacement of the
node (`ObjectPoints.covered_at`). `models/foundation/dof_maps` derives the contact compliance from it.
"""

from dataclasses import dataclass, replace

import numpy as np

from softtact.compiled import compiled

SAMPLES = 8          # samples per grid step around nodes near an edge
REACH = 2            # grid steps sampled on each side of a node: the hat function's width and a displacement of one step
LOWEST = 0.15        # height in steps over a node's plane up to which a sample belongs to the plane
_TOUCHED = 0.7       # of the object's depth: higher facets are not touched, but a lower edge beside them may be


@dataclass(frozen=True)
class ObjectPoints:
    """Nodes (c,) of a grid that an object can touch.

    gap (c,): the object's height over the undeformed surface in mm;  slope (c, 2): its derivatives by x and y
    edge (e,): indices in `nodes` of those near an edge;  window (e, s, s): height in mm of their surroundings over the plane of gap
    and slope, sampled from 2 steps below to 2 steps above in y and x
    step (2,): of the grid in mm
    beneath: `Beneath` of the nodes near an edge with a lower part of the object beside them; None without such nodes
    """

    nodes: np.ndarray
    gap: np.ndarray
    slope: np.ndarray
    edge: np.ndarray
    window: np.ndarray
    step: np.ndarray
    beneath: "Beneath | None" = None

    @classmethod
    def level(cls, nodes: np.ndarray, gap: np.ndarray, step: np.ndarray) -> "ObjectPoints":
        """Points away from edges, as if the object were level over each."""
        side = len(window_places())
        return cls(nodes=nodes, gap=gap, slope=np.zeros((len(nodes), 2)), edge=np.zeros(0, dtype=np.int64),
                   window=np.zeros((0, side, side), dtype=np.float32), step=step)

    @property
    def count(self) -> int:
        return len(self.nodes)

    @property
    def covered(self) -> np.ndarray:
        """Share (c,) of each node's surroundings under the object, weighted by its hat function of area step_x step_y."""
        return self.covered_at(np.zeros((2, self.count)), rounding_mm=LOWEST * self.step.min())

    def covered_at(self, moved: np.ndarray, *, rounding_mm: float) -> np.ndarray:
        """`covered` after lateral displacements `moved` (2, c) in mm of the nodes, up to a grid step.

        rounding_mm: height over the plane of a node's gap and slope up to which a sample counts
        """
        share = np.ones(self.count)
        share[self.edge] = hat_shares(self.window, moved[:, self.edge].T / self.step, rounding_mm)
        return share

    def as_deep(self, depth: float) -> "ObjectPoints":
        """The points for an object at `depth` (mm) below its first touch.

        Higher facets over a node are not touched; the edge of a lower part beside the node may be.
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

    def with_nodes(self, nodes: np.ndarray, gap: np.ndarray) -> "ObjectPoints":
        """The points with others (k,), level and away from edges, of these gaps (k,) in place of those of the same nodes."""
        stays, kept = ~np.isin(self.nodes, nodes), ~np.isin(self.nodes[self.edge], nodes)
        order = np.argsort(np.concatenate([self.nodes[stays], nodes]))
        place = np.argsort(order)[np.cumsum(stays) - 1]      # of those that stay
        return replace(self, nodes=np.concatenate([self.nodes[stays], nodes])[order],
                       gap=np.concatenate([self.gap[stays], gap])[order],
                       slope=np.vstack([self.slope[stays], np.zeros((len(nodes), 2))])[order],
                       edge=place[self.edge[kept]], window=self.window[kept],
                       beneath=None if self.beneath is None else self.beneath.among(kept))

    def outwards(self) -> np.ndarray:
        """Squares (e, 2) of the x and y components of the direction from the nodes near an edge to that edge."""
        places = window_places()
        weights = np.maximum(1 - np.abs(places), 0.0)
        share = (self.window <= LOWEST * self.step.min()) * (weights[:, None] * weights)
        away = np.stack([share.sum(axis=1) @ places, share.sum(axis=2) @ places], axis=1) ** 2
        total = away.sum(axis=1, keepdims=True)
        return np.where(total > 1e-12, away / np.maximum(total, 1e-12), 0.5)


@dataclass(frozen=True)
class Beneath:
    """Gap, slope and window over the plane of a lower part of the object, for nodes near edges with indices `place` (k,)."""

    place: np.ndarray
    gap: np.ndarray
    slope: np.ndarray
    window: np.ndarray

    def among(self, kept: np.ndarray) -> "Beneath | None":
        """Those of the nodes near an edge that are kept (e,), with their places among these."""
        stays = kept[self.place]
        if not stays.any():
            return None
        place = (np.cumsum(kept) - 1)[self.place[stays]]
        return Beneath(place, self.gap[stays], self.slope[stays], self.window[stays])


def window_places() -> np.ndarray:
    """Coordinates (s,) of the samples along a side of a window, in steps from the node."""
    return (np.arange(2 * REACH * SAMPLES) + 0.5) / SAMPLES - REACH


@compiled
def hat_shares(window: np.ndarray, moved: np.ndarray, highest: float) -> np.ndarray:
    """Covered shares (e,) under hat functions moved by (e, 2) steps; samples higher than `highest` do not count."""
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
