"""What a grasp did in time, without MuJoCo: phases, events, poses and forces of both fingers."""

from dataclasses import dataclass

import numpy as np

FINGERS = ("left", "right")
PHASES = ("approach", "close", "grip", "lift")
EVENTS = ("contact", "grip", "lift")


@dataclass(frozen=True)
class GraspRecord:
    """What a grasp did, row by row in time; a finger is 0 (left) or 1 (right)."""

    time_s: np.ndarray
    """(t,) in s."""
    phase: np.ndarray
    """(t,) numbers in `PHASES`."""
    joint_rad: np.ndarray
    """(t, 6) in rad."""
    opening_mm: np.ndarray
    """(t,) between the pads' faces."""
    sensor_pose_world: np.ndarray
    """(t, finger, 7): x, y, z in mm and the quaternion w, x, y, z of each sensor in the robot's base frame."""
    object_pose_sensor: np.ndarray
    """(t, finger, 7): the same of the object's mesh in each sensor's frame."""
    force_n: np.ndarray
    """(t, finger, 3) in N: the object's force on each sensor, in its frame; z is negative where it presses."""
    contact: np.ndarray
    """(t, finger) of bool: whether the object touches the pad."""
    event_row: np.ndarray
    """(event,) rows of the events, in the order of `EVENTS`; without a lift there are two."""
