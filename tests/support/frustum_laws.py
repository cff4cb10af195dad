"""Laws of a frustum that need no unit cell."""

import numpy as np

from softtact.models.foundation.frustum_spring import FrustumLaw


def made_up():
    """A law with a cell's couplings, made up: a root of 9 nodes whose tip is held, stiffer and stiffer as it is pressed."""
    line = np.array([-0.6, 0.0, 0.6])
    xy = np.array([(x, y) for x in line for y in line])
    weight = np.outer([1, 4, 1], [1, 4, 1]).ravel() / 36
    up, along, tilt = np.kron(weight, [0, 0, 1.0]), [], []
    for axis in range(2):
        along.append(np.kron(weight, np.eye(3)[axis]))
        tilt.append(np.kron(weight * xy[:, axis] / (weight @ xy[:, axis]**2), [0, 0, 1.0]))
    rest = sum(0.33 * np.outer(a, a) + 0.1 * np.outer(t, t) + 0.13 * (np.outer(a, t) + np.outer(t, a))
               for a, t in zip(along, tilt, strict=True))
    compression = np.linspace(0, 0.3, 13)
    stiffness = np.array([0.31, 0.15, 0.09]) * (1 + (compression[:, None] / 0.2)**2)
    return FrustumLaw(force_n=1.2 * compression + 40 * compression**3, compression_mm=compression, root_xy=xy, spread=np.eye(9),
                      rest=rest, descent=up, lateral=np.array([along[0], tilt[0], along[1], tilt[1]]),
                      lateral_at_mm=compression, stiffness=stiffness, lean=0.6, upright=0.05, tip_radius_mm=0.3)
