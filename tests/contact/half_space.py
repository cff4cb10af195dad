"""An elastic half-space under point forces: what contact solvers are tested on without any mesh."""

import numpy as np


def half_space(points, spacing, *, shear, poisson):
    """Compliance (n, 3, n, 3) in mm/N among points (n, 2) of a square grid; directions x, y and down.

    Boussinesq and Cerruti (Johnson, Contact Mechanics, sec. 3.2 and 3.6): point forces, and on the diagonal the mean of 1/r over a
    square from its centre.
    """
    away = points[:, None] - points[None]
    (x, y), r, each = np.moveaxis(away, -1, 0), np.linalg.norm(away, axis=-1), np.arange(len(points))
    r[each, each] = 1.0
    out = np.zeros((len(points), 3, len(points), 3))
    out[:, 0, :, 0], out[:, 1, :, 1] = (((1 - poisson) / r + poisson * side**2 / r**3) for side in (x, y))
    out[:, 0, :, 1] = out[:, 1, :, 0] = poisson * x * y / r**3
    out[:, 2, :, 2] = (1 - poisson) / r
    for axis, side in enumerate((x, y)):
        out[:, 2, :, axis] = 0.5 * (1 - 2 * poisson) * side / r**2
        out[:, axis, :, 2] = -out[:, 2, :, axis]
    own = np.diag([1 - poisson / 2, 1 - poisson / 2, 1 - poisson]) * 4 * np.log(1 + np.sqrt(2)) / spacing
    out[each, :, each, :] = own
    return out / (2 * np.pi * shear)


def disc_of_points(radius, spacing):
    """Points (n, 2) of a square grid, one in the middle, within a radius."""
    side = np.arange(-np.ceil(radius / spacing), np.ceil(radius / spacing) + 1) * spacing
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    return points[np.hypot(*points.T) < radius]
