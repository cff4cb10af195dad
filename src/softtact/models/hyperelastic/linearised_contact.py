"""The object's contact with a slab as a step of Newton's method sees it."""

import numpy as np
import scipy.sparse as sp

from softtact.linalg.nodal_frames import NodeFrames
from softtact.linalg.workers import SERIAL, Workers
from softtact.models.hyperelastic.rigid_contact import Surface
from softtact.models.hyperelastic.slab import Slab, SlabState

_SOON_MM, _NEAR_MM = 0.01, 0.1     # gaps of points that may touch within a step or two, and within some load steps
# Share of the squared normals that a node's own directions may leave out, when asked whether they are enough and when chosen.
_BENT, _SLIGHTLY_BENT = 0.02, 0.005


class StepContact:
    """The object's contact in the course of a step from a `SlabState`; `planes` and `points` are what it is at present.

    surface: looked up anew where the step leads; None: the points keep the planes that they face
    largest_mm: to which a step is cut: where a longer one leads far under an edge, points face what they do where it is cut
    """

    def __init__(self, slab: Slab, state: SlabState, indentation: float, surface: Surface | None = None, *,
                 largest_mm: float = np.inf, workers: Workers = SERIAL) -> None:
        self._slab, self._state, self._indentation, self._surface, self._workers = slab, state, indentation, surface, workers
        self._largest_mm = largest_mm
        self._face(state.projection)

    def _face(self, projection):
        self.projection, self.points = projection, self._slab.linear_gaps(self._state.displacement, projection,
                                                                             self._indentation, self._state.history)

    def frames(self, kept: NodeFrames | None) -> NodeFrames:
        """`NodeFrames` of the nodes whose contact with the object may change, along the normals that they face.

        kept: frames of before, whose nodes and numbers of vectors stay if they are enough for the nodes that may touch soon
        """
        now = self._frames_within(_SOON_MM, _BENT)
        if kept is not None and kept.covers(now):
            return kept.turned_as(now)
        return self._frames_within(_NEAR_MM, _SLIGHTLY_BENT)

    def _frames_within(self, within_mm, bent):
        """Of nodes with gaps of less; wanted are vectors along which the normals' squares exceed a share `bent` of the most."""
        nodes, normals = self._slab.top.projected_nodes(self.points.gaps, self.projection, within_mm)
        unknowns = self._slab.unknowns_of(nodes)
        free = (unknowns >= 0).all(axis=1)
        size, turns = np.linalg.eigh(normals[free])
        upright = (size[:, 1] < 1e-9 * size[:, 2]) & (np.abs(turns[:, 2, 2]) > 1 - 1e-9)
        turns[upright] = np.eye(3)     # to the last digit, which spares the turning
        return NodeFrames(first=unknowns[free, 0], turns=turns, wanted=(size > bent * size[:, 2:]).sum(axis=1),
                          others=unknowns[~free][unknowns[~free] >= 0])

    def rubber_forces(self, rubber: sp.csr_matrix, step: np.ndarray) -> np.ndarray:
        """Forces (unknowns,) of the rubber's tangent against a step (unknowns,) in mm."""
        return self._slab.product(rubber.data, step, workers=self._workers)

    def follow(self, step: np.ndarray, indentation_increment: float) -> bool:
        """Look up what the points face after a step (unknowns,) in mm of the slab; True if there is a surface to ask."""
        if self._surface is None:
            return False
        share = min(1.0, self._largest_mm / max(np.abs(step).max(), abs(indentation_increment), 1e-30))
        projection = self._projected(step, indentation_increment)
        if share < 1.0 and projection.overrun.any():
            projection = self._projected(share * step, share * indentation_increment)
        self._face(projection)
        return True

    def _projected(self, step, indentation_increment):
        """What the points face after a step."""
        displacement = self._state.displacement.copy()
        displacement.ravel()[self._slab.unknowns] += step
        return self._slab.project(displacement, self._surface, self._indentation + indentation_increment)
