"""Maps of one object at rising forces, to interpolate at any force."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline


@dataclass(frozen=True)
class Ladder:
    """force_n (l,), rising;  maps_mm (l, y, x) at them."""

    force_n: np.ndarray
    maps_mm: np.ndarray

    def weights(self, force_n: np.ndarray) -> np.ndarray:
        """Weights (n, l) of the maps at forces (n,) from 0 to the highest; larger forces take the last map.

        A cubic spline over the square root of the force, in which the depths of a ball and a flat punch are both nearly linear.
        """
        return self._spline(np.sqrt(np.minimum(force_n, self.force_n[-1])))[:, 1:]

    @cached_property
    def _spline(self):
        at = np.sqrt(np.concatenate([[0.0], self.force_n]))
        return CubicSpline(at, np.eye(len(at)))


def even_in_root(largest_n: float, count: int) -> np.ndarray:
    """Forces (count,) in N up to the largest, in even steps of their root: for a `Ladder`."""
    return largest_n * (np.arange(1, count + 1) / count) ** 2
