"""Where on the sensor an object is pressed: turns and shifts drawn with a seed, in which what presses stays over the sensor.

The object turns about z by any angle at which its pressing part fits the sensor as well as unturned, and lies anywhere in the
room that is left. It is not tilted.
"""

from collections.abc import Sequence

import numpy as np

PRESSING_MM = 1.0    # above the lowest point: the part that carries the force
RIM_MM = 1.0         # along the sensor's border, where the layers' sides are held, that a pressing part leaves free
_LEAST_TURN_DEG = 1.0


def draw_poses(triangles: np.ndarray, *, count: int, footprint_mm: tuple[float, float],
               seed: Sequence[int]) -> list[list[float]]:
    """`count` poses, each [x, y, z in mm, rx, ry, rz in degrees] of the object's origin, of facets (n, 3, 3) in mm.

    seed: a list of whole numbers; the k-th pose depends on it and k only
    """
    points = triangles.reshape(-1, 3)
    lowest = points[:, 2].min()
    pressing = np.unique(points[points[:, 2] < lowest + PRESSING_MM, :2], axis=0)
    return [_draw_pose(pressing, lowest, np.asarray(footprint_mm, float), np.random.default_rng([*seed, k])) for k in range(count)]


def _draw_pose(pressing, lowest, footprint, rng):
    turn, along = rng.uniform(-180, 180), rng.uniform(-1, 1, 2)
    needed = np.minimum(_room(pressing, 0.0, footprint)[0], 0.0)      # what is wider than the sensor is so in any place
    room, middle = _room(pressing, turn, footprint)
    while (room < needed).any():
        turn = rng.uniform(-abs(turn), abs(turn)) if abs(turn) > _LEAST_TURN_DEG else 0.0     # a smaller one, until it fits
        room, middle = _room(pressing, turn, footprint)
    x, y = np.round(along * np.maximum(room, 0.0) - middle, 2)
    pose = [x, y, -lowest, 0.0, 0.0, np.round(turn, 1)]
    return [float(value) + 0.0 for value in pose]     # no negative zeros


def _room(points, turn_deg, footprint):
    """How far (2,) the turned points (n, 2) may move to either side, in mm, and the middle (2,) of their bounding box."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turned = points @ np.array([[c, s], [-s, c]])
    low, high = turned.min(axis=0), turned.max(axis=0)
    return 0.5 * (footprint - (high - low)) - RIM_MM, 0.5 * (low + high)
