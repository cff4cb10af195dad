"""Where an object first touches a surface on its way: both as flat triangles, seen along the way.

By corners of either on the other's facets. Two edges that cross are missed between their corners: fine facets tell them.
"""

import numpy as np
import trimesh

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.motion import FREEDOMS, Motion

_MIRROR = np.diag([1.0, 1.0, -1.0])


def first_direction(motion: Motion) -> np.ndarray:
    """Unit vector (3,) along which a motion's first step loads the object or, without a force, moves it; else down."""
    for given in (motion.steps[0].loads, motion.steps[0].ways):
        way = np.array([given.get(name, 0.0) for name in FREEDOMS[:3]])
        if way.any():
            return np.asarray(way / np.linalg.norm(way))
    return np.array([0.0, 0.0, -1.0])


def way_to_touch(coming: np.ndarray, surface: np.ndarray, direction: np.ndarray) -> float:
    """Way (mm) along a unit vector (3,) after which triangles (t, 3, 3) first touch those of a surface (u, 3, 3), all in mm.

    Facets are seen counter-clockwise from outside. It is negative where they overlap already; inf where they miss each other.
    """
    turned = _turn_down(direction)
    coming, surface = coming @ turned.T, surface @ turned.T
    from_above = _gap(coming, surface)
    from_below = _gap(surface[:, ::-1] @ _MIRROR, coming[:, ::-1] @ _MIRROR)     # turned upside down, the surface comes down
    return min(from_above, from_below)


def _gap(coming, surface):
    """Least height (mm) of the underside of triangles over the corners of others."""
    base = np.array([0.0, 0.0, coming[..., 2].min()])
    field = HeightField(trimesh.Trimesh(*_corners(coming - base), process=False))
    points = np.unique((surface - base).reshape(-1, 3), axis=0)
    height, _ = field(points[:, 0], points[:, 1])
    return float(np.min((height - points[:, 2])[height < NO_CONTACT_MM], initial=np.inf))


def _corners(triangles):
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


def _turn_down(direction):
    """Rotation (3, 3) that takes a unit vector to -z."""
    down = -np.asarray(direction, dtype=float)
    aside = np.eye(3)[np.argmin(np.abs(down))]
    x = np.cross(aside, down)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(down, x), down])
