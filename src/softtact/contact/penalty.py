"""Unilateral contact by a smooth penalty: the energy of a penetration and its derivatives.

phi(s) with s = max(0, -normal_gap): k s^3 / (6 t) up to the smoothing depth t, then k (s^2/2 - s t/2 + t^2/6).
Value, pressure and stiffness are continuous, so Newton's method does not chatter at the contact's edge.
"""

from dataclasses import dataclass, replace

import numpy as np


def penalty(normal_gap: np.ndarray, *, stiffness: float | np.ndarray,
            smoothing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Energy (N/mm), contact pressure (MPa, positive in compression) and its slope (N/mm3) per unit area.

    normal_gap in mm (negative = penetration), stiffness in N/mm3, smoothing in mm.
    """
    s = np.maximum(0.0, -normal_gap)
    deep = s > smoothing
    energy = stiffness * np.where(deep, s * s / 2 - s * smoothing / 2 + smoothing**2 / 6, s**3 / (6 * smoothing))
    pressure = stiffness * np.where(deep, s - smoothing / 2, s * s / (2 * smoothing))
    slope = stiffness * np.where(deep, 1.0, s / smoothing)
    return energy, pressure, slope


@dataclass(frozen=True)
class Contact:
    """Penalty stiffness in N/mm3 and smoothing depth in mm, and for each point the depth at which its pressure begins.

    The offsets (mm, initially zero) are the multipliers of the augmented Lagrangian method as lengths. With a point's last overlap
    as its offset, the same pressure leaves no overlap. So contact is exact without a stiffer penalty, for which Newton's method
    would need smaller steps. Simo and Laursen, Computers & Structures 42 (1992) 97.

    contact_compliance (mm/MPa): of a spring in series with each point; its shortening is no overlap and is not augmented.
    """

    stiffness: float = 3000.0
    smoothing: float = 1.0 / 3000.0
    offset: float | np.ndarray = 0.0
    contact_compliance: float | np.ndarray = 0.0

    def response(self, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`penalty` of the points, with the offset added to their overlap."""
        return penalty(gaps - self.offset, stiffness=1.0 / (1.0 / self.stiffness + self.contact_compliance),
                       smoothing=self.smoothing)

    def surface_gaps(self, gaps: np.ndarray) -> np.ndarray:
        """Gaps in mm without the shortening of the springs in series."""
        return gaps + self.contact_compliance * self.response(gaps)[1] if np.any(self.contact_compliance) else gaps

    def at(self, points: np.ndarray | slice) -> "Contact":
        """The contact of some of the points."""
        fields = ("offset", "contact_compliance")
        return replace(self, **{name: value[points] for name in fields if np.ndim(value := getattr(self, name))})

    def error(self, gaps: np.ndarray) -> float:
        """Deepest overlap, or widest gap under pressure, in mm."""
        return float(np.where(gaps < self.offset, np.abs(self.surface_gaps(gaps)), 0.0).max(initial=0.0))

    def augmented(self, gaps: np.ndarray) -> "Contact":
        """The contact after one augmentation: offsets with which each point under pressure has no overlap."""
        return replace(self, offset=np.maximum(0.0, self.offset - self.surface_gaps(gaps)))
