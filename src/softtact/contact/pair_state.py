"""What a pair of surfaces in contact has at given places of all nodes, and what it remembers."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softtact.contact.surface_kernels import Projection
from softtact.contact.surfaces import SurfacePoints


class Totals(NamedTuple):
    """What an item adds to the sums of a state."""

    strain_energy: float = 0.0
    """In mJ."""
    penalty: float = 0.0
    """In mJ, of contact and friction."""
    size: float = 0.0
    """In N: what presses, for the scale of the residual."""


@dataclass(frozen=True)
class PairHistory:
    """What a pair remembers at a state: it belongs to the state, so that a body pressed twice gives the same."""

    points: SurfacePoints
    """The points of contact."""
    offset: np.ndarray
    """(p,) in mm, of the augmented penalty."""
    traction: np.ndarray
    """(p, 2) in MPa: friction on the points' surface when the step began, along the other surface's directions at the anchors
    (`surface_places.frames_on`): so it turns with that surface."""
    anchor: Projection
    """Where the points were on the other surface when the step began."""
    start: np.ndarray
    """(p, 3) in mm from the anchors to the points where their slip begins: when the step began, or where they met the surface."""
    slid: np.ndarray
    """(p,) in mm: length of the points' slip on the other surface since they came to touch it, up to the step's beginning."""
    stiffness: float
    """Penalty in N/mm3: the pair's, or larger where augmentations hardly lowered the overlap."""
    rubs: np.ndarray
    """(p,) whether friction acts on points under pressure: of those that touched when the step began, and those anchored since."""
    begun: np.ndarray
    """(2, p, 3) in mm: places of the points and of their anchors when the step began."""
    overlap_mm: float = np.inf
    """Deepest overlap at the step's last augmentation; infinite before its first one."""


@dataclass(frozen=True)
class PairState:
    """A pair's contact at given places of all nodes."""

    projection: Projection
    """The points' closest places."""
    pressure: np.ndarray
    """(p,) in MPa per area at rest, positive in compression."""
    slope: np.ndarray
    """(p,) in N/mm3."""
    friction: np.ndarray
    """(p, 3) in MPa: friction on the points' surface."""
    stiffness: np.ndarray
    """(p, 3, 3) in N/mm3: friction's stiffness against slip."""
    slip: np.ndarray
    """(p, 3) in mm: slip of the points on the other surface within the step."""
    slides: np.ndarray
    """(p,) whether friction is at its bound."""
    energy: float
    """Energy in mJ of the penalties."""

    @property
    def slid_mm(self) -> np.ndarray:
        """(p,) length of the slip within the step of the points that slide; 0 of those that stick, whose slip is the penalty's."""
        length: np.ndarray = np.linalg.norm(self.slip, axis=1) * (self.slides & (self.pressure > 0))
        return length

    @property
    def force_mpa(self) -> np.ndarray:
        """(p, 3) force on the points' surface per area at rest, friction and pressure."""
        return self.friction + self.pressure[:, None] * self.projection.normal

    def penetration_mm(self) -> float:
        """Deepest overlap (mm)."""
        return float(max(0.0, -np.min(self.projection.gap, initial=0.0)))
