"""Unilateral contact by a smooth penalty: the energy of a penetration and its derivatives.

phi(s) with s = max(0, -normal_gap): k s^3 / (6 t) up to the smoothing depth t, then k (s^2/2 - s t/2 + t^2/6).
Value, pressure and stiffness are continuous, so Newton's method does not chatter at the contact's edge.
"""

import numpy as np


def penalty(normal_gap, *, stiffness, smoothing):
    """Energy (N/mm), contact pressure (MPa, positive in compression) and its slope (N/mm3) per unit area.

    normal_gap in mm (negative = penetration), stiffness in N/mm3, smoothing in mm.
    """
    s = np.maximum(0.0, -normal_gap)
    deep = s > smoothing
    energy = stiffness * np.where(deep, s * s / 2 - s * smoothing / 2 + smoothing**2 / 6, s**3 / (6 * smoothing))
    pressure = stiffness * np.where(deep, s - smoothing / 2, s * s / (2 * smoothing))
    slope = stiffness * np.where(deep, 1.0, s / smoothing)
    return energy, pressure, slope
