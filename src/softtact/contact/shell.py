"""The rigid shell around a sensor (`sensors/fields`), on which an object wider than the sensor comes to rest.

The object moves straight down without rotation, so one number is enough: the descent at which its underside meets the shell's top.
From there on the force on the pad is constant, and the shell carries the rest.
Not modelled: contact of a cover that bulges over the shell's top.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.errors import ConvergenceError

_BESIDE_MM = 1e-3      # gap to the pad's side: an object that ends at the side does not lie on the shell
_TOUCHING_MM = 1e-6    # from first touch: an object that rests on the shell within this descent exerts no force on the pad
_FAR_MM = 10.0         # replaces a depth that was not found
_RESTS_MM = 0.02       # over the shell's top: height from which on an object does not rest on it yet
_EXACT = 1e-8          # tolerance of the pad's force where the object rests, relative to the largest force


@dataclass(frozen=True)
class Shell:
    """A rigid frame around a pad."""

    footprint_mm: tuple[float, float]
    """Sides of the pad along x and y, which the shell surrounds."""
    below_mm: float
    """Depth of its top below the pad's free surface; infinite where there is no shell."""
    width_mm: float
    """Width of its top."""

    def stop_mm(self, surface: HeightField, offset_mm: Sequence[float] | np.ndarray = (0.0, 0.0)) -> float:
        """Descent (mm) of an object from the pose of `surface` to the shell; infinite where it does not reach over the shell.

        offset_mm: the object's displacement along x and y from that pose
        """
        if not np.isfinite(self.below_mm):
            return np.inf
        offset = np.tile(np.asarray(offset_mm)[:, None], 2)
        lowest = min(surface.lowest_over(*(box.reshape(2, 2) - offset).T) for box in self.boxes)
        return lowest + self.below_mm if lowest < NO_CONTACT_MM else np.inf

    @property
    def boxes(self) -> np.ndarray:
        """Rectangles (4, 4) of its top: low and high x, low and high y in mm; none (0, 4) where there is no shell."""
        if not self.exists:
            return np.zeros((0, 4))
        inner = 0.5 * np.asarray(self.footprint_mm) + _BESIDE_MM
        (x, y), (far_x, far_y) = inner, inner + self.width_mm
        return np.array([[-far_x, -x, -far_y, far_y], [x, far_x, -far_y, far_y], [-x, x, -far_y, -y], [-x, x, y, far_y]])

    @property
    def exists(self) -> bool:
        """Whether the sensor has a shell."""
        return bool(np.isfinite(self.below_mm))

    def top_mm(self, height_mm: float = 0.0) -> np.ndarray:
        """Triangles (8, 3, 3) of its top, counter-clockwise from above, for the pad's free surface at `height_mm`."""
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        inner, z = 0.5 * np.asarray(self.footprint_mm) + _BESIDE_MM, np.full(4, height_mm - self.below_mm)
        low, high = (np.column_stack([signs * side, z]) for side in (inner, inner + self.width_mm))
        low_next, high_next = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        return np.concatenate([np.stack([high, high_next, low_next], axis=1), np.stack([high, low_next, low], axis=1)])

    def beneath(self, points_mm: np.ndarray) -> np.ndarray:
        """Which (n,) of points (n, 2 or more) lie over the shell's top, by x and y."""
        inner = 0.5 * np.asarray(self.footprint_mm) + _BESIDE_MM
        x = np.abs(points_mm[:, :2])
        return self.exists & (x > inner).any(axis=1) & (x <= inner + self.width_mm).all(axis=1)

    def refuse_motion(self, surface: HeightField, offset_mm: np.ndarray, indentation_mm: float, touch_mm: float, *,
                      step: int) -> None:
        """Raise ConvergenceError where an object is below the depth that the shell allows, after the given step of a motion.

        offset_mm (2,): displacement along x and y;  indentation_mm, touch_mm: descent from the pose, now and at first touch
        """
        depth, stop = indentation_mm - touch_mm, self.stop_mm(surface, offset_mm) - touch_mm
        if depth > stop + _BESIDE_MM:
            raise ConvergenceError(f"Step {step} of the motion was not reached: the object would be {depth:.3g} mm deep, but rests "
                                   f"on the shell beside the pad after {stop:.3g} mm; press less deep or with less force, or give "
                                   "the sensor's 'edge' a lower shell.")


def pad_forces(forces_n: np.ndarray, *, stop_mm: float, touch_mm: float, depth_of: Callable[[float], float]) -> np.ndarray:
    """Forces (l,) in N that the pad carries of rising forces (l,): at most the force at which the object rests on the shell.

    stop_mm, touch_mm: descent to the shell and to first touch;  depth_of: descent (mm) under a force (N)
    Raises ConvergenceError where the object is still above the shell at the largest force whose descent is found.
    """
    if np.isinf(stop_mm):
        return forces_n
    largest = float(forces_n[-1])
    if stop_mm - touch_mm < _TOUCHING_MM:
        return np.zeros(len(forces_n))

    def below(force):
        """Distance (mm) of the object below the shell's top under a force; without a force it just touches the pad."""
        try:
            return (depth_of(force) if force > _EXACT * largest else touch_mm) - stop_mm
        except ConvergenceError:      # the pad alone cannot carry the force
            return _FAR_MM

    if below(largest) <= 0:
        return forces_n
    from scipy.optimize import brentq

    found, beside = brentq(below, 0.0, largest, xtol=_EXACT * largest), 2 * _EXACT * largest
    if below(found + beside) == _FAR_MM and below(found - beside) < -_RESTS_MM:
        raise ConvergenceError(f"The force at which the object rests on the shell was not found: the model does not settle beyond "
                               f"{found:.3g} N, where the object is still above the shell; use smaller forces, or another model.")
    return np.minimum(forces_n, found)
