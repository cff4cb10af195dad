"""Where an object that is wider than a sensor comes to rest: on the rigid shell around it (`sensors/fields`).

The object moves straight down and does not turn, so a single number is enough: how far it can come down until its underside meets
the shell's top. From there on the pad keeps the force that it has, and the shell carries what is added.
Left out: that a cover which bulges over the shell's top may touch it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.errors import ConvergenceError

_BESIDE_MM = 1e-3      # an object that ends at the pad's side does not lie on the shell
_TOUCHING_MM = 1e-6    # from where it first touches: an object that rests so near to it presses nothing
_FAR_MM = 10.0         # in place of a depth that is not found
_EXACT = 1e-8          # of the largest force, to which that at rest is found


@dataclass(frozen=True)
class Shell:
    """A rigid frame around a pad."""

    footprint_mm: tuple[float, float]
    """Sides of the pad along x and y, which the shell surrounds."""
    below_mm: float
    """Depth of its top below the pad's free surface; infinite where there is no shell."""
    width_mm: float
    """How wide it is."""

    def stop_mm(self, surface: HeightField, offset_mm: Sequence[float] | np.ndarray = (0.0, 0.0)) -> float:
        """How far (mm) an object can come down from where its `surface` is; infinite where it does not reach over the shell.

        offset_mm: its displacement along x and y from there
        """
        if not np.isfinite(self.below_mm):
            return np.inf
        inner = 0.5 * np.asarray(self.footprint_mm) + _BESIDE_MM
        outer, way = inner + self.width_mm, np.asarray(offset_mm)
        boxes = [(-outer, [-inner[0], outer[1]]), ([inner[0], -outer[1]], outer),
                 ([-inner[0], -outer[1]], [inner[0], -inner[1]]), ([-inner[0], inner[1]], [inner[0], outer[1]])]
        lowest = min(surface.lowest_over(low - way, high - way) for low, high in boxes)
        return lowest + self.below_mm if lowest < NO_CONTACT_MM else np.inf

    @property
    def exists(self) -> bool:
        """Whether there is one."""
        return bool(np.isfinite(self.below_mm))

    def top_mm(self, height_mm: float = 0.0) -> np.ndarray:
        """Its top as triangles (8, 3, 3), counter-clockwise from above, where the pad's free surface is at `height_mm`."""
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        inner, z = 0.5 * np.asarray(self.footprint_mm) + _BESIDE_MM, np.full(4, height_mm - self.below_mm)
        low, high = (np.column_stack([signs * side, z]) for side in (inner, inner + self.width_mm))
        low_next, high_next = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        return np.concatenate([np.stack([high, high_next, low_next], axis=1), np.stack([high, low_next, low], axis=1)])

    def beneath(self, points_mm: np.ndarray) -> np.ndarray:
        """Which of points (n, 2 or more) lie over it, by x and y (n,)."""
        inner = 0.5 * np.asarray(self.footprint_mm) + _BESIDE_MM
        x = np.abs(points_mm[:, :2])
        return self.exists & (x > inner).any(axis=1) & (x <= inner + self.width_mm).all(axis=1)

    def refuse_motion(self, surface: HeightField, offset_mm: np.ndarray, indentation_mm: float, touch_mm: float, *,
                      step: int) -> None:
        """Raise ConvergenceError where an object is lower than the shell lets it, after a motion's step of that number.

        offset_mm (2,): displacement aside;  indentation_mm: how far it has come down from its pose, touch_mm: did at first touch
        """
        depth, stop = indentation_mm - touch_mm, self.stop_mm(surface, offset_mm) - touch_mm
        if depth > stop + _BESIDE_MM:
            raise ConvergenceError(f"Step {step} of the motion was not reached: the object would be {depth:.3g} mm deep, but rests "
                                   f"on the shell beside the pad after {stop:.3g} mm; press less deep or with less force, or give "
                                   "the sensor's 'edge' a lower shell.")


def pad_forces(forces_n: np.ndarray, *, stop_mm: float, touch_mm: float, depth_of: Callable[[float], float]) -> np.ndarray:
    """Forces (l,) in N that the pad carries of rising ones (l,): all of them, or as much as it does where the object rests.

    stop_mm, touch_mm: how far the object can come down, and does until first touch;  depth_of: how far it does under a force (N)
    """
    if np.isinf(stop_mm):
        return forces_n
    largest = float(forces_n[-1])
    if stop_mm - touch_mm < _TOUCHING_MM:
        return np.zeros(len(forces_n))

    def below(force):
        """How far (mm) the object would be below where it rests; without force it just touches."""
        try:
            return (depth_of(force) if force > _EXACT * largest else touch_mm) - stop_mm
        except ConvergenceError:      # of a force that the pad would not bear alone
            return _FAR_MM

    if below(largest) <= 0:
        return forces_n
    return np.minimum(forces_n, brentq(below, 0.0, largest, xtol=_EXACT * largest))
