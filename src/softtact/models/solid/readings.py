"""Readings of a solid: means over parts of a face around given points, as a taxel or a marker under a skin has them."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from softtact.contact.pair import ContactPair
from softtact.contact.pair_state import PairHistory, PairState
from softtact.contact.surface_places import places
from softtact.contact.surfaces import Surface, SurfacePoints, quadrature_points
from softtact.errors import InputError


@dataclass
class ReadingPoints:
    """Points at which readings are taken, each a mean over the points of a face's rule within a radius, by their areas at rest.

    face: the surface;  points_mm (k, 3);  radius_mm: of the part that a reading is taken over;  at_rest (n, 3): nodes in mm
    """

    face: Surface
    points_mm: np.ndarray
    radius_mm: float
    at_rest: np.ndarray
    _over: SurfacePoints = field(init=False, repr=False)
    _near: list = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._over = quadrature_points(self.face, self.at_rest)
        self._near = cKDTree(places(self._over, self.at_rest)).query_ball_point(self.points_mm, self.radius_mm)
        for point, near in zip(self.points_mm, self._near, strict=True):
            if not near:
                raise InputError(f"readings: the face has nothing within {self.radius_mm:g} mm of the point "
                                 f"{', '.join(f'{value:g}' for value in point)} mm; correct the point, or give a larger radius_mm.")

    @property
    def area_mm2(self) -> np.ndarray:
        """Area (k,) at rest that each reading is taken over."""
        return np.array([self._over.weight[near].sum() for near in self._near])

    def displacement_mm(self, displacement: np.ndarray) -> np.ndarray:
        """Mean displacement (k, 3) of nodes that moved by (n, 3) in mm."""
        moved = places(self._over, displacement)
        return np.array([self._over.weight[near] @ moved[near] / self._over.weight[near].sum() for near in self._near])

    def pressure_mpa(self, pair: ContactPair, history: PairHistory, state: PairState) -> np.ndarray:
        """Mean contact pressure (k,) in MPa per area at rest, of the contact's points within the radius; nan off its face.

        The pair's points are those that its pressure acts at, so that the force over parts that fill the face is the whole force.
        """
        at = cKDTree(places(history.points, self.at_rest))
        out = np.full(len(self.points_mm), np.nan)
        if not np.isin(self.face.used, pair.surface.used).all():
            return out
        for k, (near, area) in enumerate(zip(at.query_ball_point(self.points_mm, self.radius_mm), self.area_mm2, strict=True)):
            out[k] = history.points.weight[near] @ state.pressure[near] / area
        return out
