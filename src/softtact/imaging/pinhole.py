"""The camera behind a gel: a pinhole with Brown's distortion, between places of the sensing surface (mm) and pixels.

The camera looks along +z of the sensor frame at the inner side of the surface. A point (x, y, z) of the surface, z = 0 at rest and
z < 0 where it is pressed, lies `distance + z` in front of the pinhole, so a pressed point is nearer and moves outwards:

    (u, v) = (x, y) / (distance + z)                                         along the image's columns and rows, see `axes`
    r2 = u^2 + v^2,   radial = 1 + k1 r2 + k2 r2^2 + k3 r2^3
    (u', v') = radial (u, v) + (2 p1 u v + p2 (r2 + 2 u^2),  p1 (r2 + 2 v^2) + 2 p2 u v)
    px = centre + f (u', v'),   f = distance / mm_per_px

D. C. Brown, Close-range camera calibration, Photogrammetric Engineering 37 (1971) 855-866; order of the constants as in OpenCV. A
pixel's centre has whole numbers as coordinates: (0, 0) is the middle of the first one. Light is not refracted at the gel's lower
side: `distance` is that of the pinhole that sees the surface as the camera does.
"""

from dataclasses import dataclass

import numpy as np

_PASSES = 30          # of the inverse of the distortion; it converges like |k1| r2, 0.3 in the corner of a wide lens
_CLOSE = 1e-12        # change of a direction at which the inverse has converged


@dataclass(frozen=True)
class Pinhole:
    """A camera's geometry."""

    rows: int
    """Pixels along the image's height."""
    columns: int
    """Pixels along its width."""
    mm_per_px: float
    """Side in mm of a pixel on the surface at rest, in the middle of the image."""
    distance_mm: float
    """From the pinhole to the surface at rest, in mm."""
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """Brown's k1, k2, p1, p2, k3."""
    axes: tuple[str, str] = ("x", "y")
    """Directions of the sensor frame along the image's columns (to the right) and rows (down): x, y, -x or -y."""

    @property
    def focal_px(self) -> float:
        """Focal length in px."""
        return self.distance_mm / self.mm_per_px

    @property
    def centre_px(self) -> np.ndarray:
        """(2,) the image's middle, where the sensor frame's origin is seen."""
        return 0.5 * np.array([self.columns - 1, self.rows - 1])

    @property
    def turn(self) -> np.ndarray:
        """(2, 2) from x, y of the sensor frame to directions along columns and rows."""
        return np.array([[(-1.0 if axis.startswith("-") else 1.0) * (axis[-1] == name) for name in "xy"] for axis in self.axes])

    def project(self, points_mm: np.ndarray) -> np.ndarray:
        """Pixels (..., 2), column and row, of points (..., 3) in mm of the sensor frame, z from the surface at rest."""
        flat = points_mm[..., :2] @ self.turn.T
        return self.centre_px + self.focal_px * self.distorted(flat / (self.distance_mm + points_mm[..., 2:]))

    def on_surface(self, px: np.ndarray, z_mm: np.ndarray | float = 0.0) -> np.ndarray:
        """Points (..., 3) in mm at the height z_mm (a number or (...)) that pixels (..., 2) see: the inverse of `project`."""
        z = np.broadcast_to(np.asarray(z_mm, dtype=float), np.shape(px)[:-1])
        flat = self.directions(px) * (self.distance_mm + z)[..., None]
        return np.concatenate([flat, z[..., None]], axis=-1)

    def directions(self, px: np.ndarray) -> np.ndarray:
        """(..., 2): x and y of the sensor frame that pixels (..., 2) see, for each mm in front of the pinhole."""
        seen = (np.asarray(px, dtype=float) - self.centre_px) / self.focal_px
        return self.undistorted(seen) @ self.turn

    def distorted(self, ideal: np.ndarray) -> np.ndarray:
        """Directions (..., 2) behind the lens of ideal ones (..., 2), along columns and rows."""
        k1, k2, p1, p2, k3 = self.distortion
        u, v = ideal[..., 0], ideal[..., 1]
        r2 = u**2 + v**2
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack([radial * u + 2 * p1 * u * v + p2 * (r2 + 2 * u**2),
                         radial * v + p1 * (r2 + 2 * v**2) + 2 * p2 * u * v], axis=-1)

    def undistorted(self, seen: np.ndarray) -> np.ndarray:
        """Ideal directions (..., 2) of those behind the lens (..., 2), by fixed-point iteration; nan where it finds none."""
        if not any(self.distortion):
            return seen
        ideal = seen.copy()
        with np.errstate(over="ignore", invalid="ignore"):      # of directions that have no inverse
            for _ in range(_PASSES):
                change = seen - self.distorted(ideal)
                ideal = ideal + change
                if not (np.abs(change) > _CLOSE).any():
                    break
        return np.where(np.abs(change).max(axis=-1, keepdims=True) < 1e-3 / self.focal_px, ideal, np.nan)

    def pixels(self) -> np.ndarray:
        """(rows, columns, 2) all pixels' centres, column and row."""
        return np.stack(np.meshgrid(np.arange(self.columns, dtype=float), np.arange(self.rows, dtype=float)), axis=-1)

    def sees(self, px: np.ndarray) -> np.ndarray:
        """(...) whether pixels (..., 2) lie in the image."""
        inside: np.ndarray = np.all((px >= -0.5) & (px <= np.array([self.columns, self.rows]) - 0.5), axis=-1)
        return inside
