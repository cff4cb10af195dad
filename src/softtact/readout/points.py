"""The readout `points`: mean contact pressure and displacement around points, such as taxels or markers under a skin.

    readouts: {tips: {kind: points, points_mm: [[0, 0, 5], [2, 0, 4.5]], radius_mm: 1.0}}
"""

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field
from scipy.spatial import cKDTree

from softtact.errors import InputError
from softtact.readout.registry import Samples, SurfaceMotion, labelled, register
from softtact.sensors.fields import FiniteSection, Length

if TYPE_CHECKING:
    import xarray

QUANTITIES, UNITS = ("pressure", "x", "y", "z"), ("MPa", "mm", "mm", "mm")


@register("points")
class Points(FiniteSection):
    """Means over the parts of a face that lie within a radius of points at rest, weighted by area.

    Readings (step, point, quantity): contact pressure in MPa, then displacement along x, y, z in mm; nan where they are not known,
    and for pressures off the contact surface.
    """

    points_mm: Annotated[tuple[tuple[float, float, float], ...], Field(min_length=1)]
    radius_mm: Length
    face: str | None = Field(None, description="by default the sensing surface")

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """See `Points`. Raises InputError where the face has nothing within the radius of a point."""
        moved, pressed = surface.displacement(self.face), surface.pressure(self.face)
        near = self._near(moved[0])
        values = np.full((len(moved), len(self.points_mm), len(QUANTITIES)), np.nan)
        for step, samples in enumerate(moved):
            values[step, :, 1:] = [samples.area_mm2[part] @ samples.values[part] / samples.area_mm2[part].sum() for part in near]
        if pressed is not None:
            areas = [moved[0].area_mm2[part].sum() for part in near]
            for step, samples in enumerate(pressed):      # so the forces on parts that fill the face sum up to the whole force
                within = cKDTree(samples.points_mm).query_ball_point(self.points_mm, self.radius_mm)
                values[step, :, 0] = [samples.area_mm2[part] @ samples.values[part] / area
                                      for part, area in zip(within, areas, strict=True)]
        return labelled_points(values, np.array(self.points_mm))

    def _near(self, samples: Samples) -> list[list[int]]:
        """Numbers of the samples within the radius of each point."""
        near = cKDTree(samples.points_mm).query_ball_point(self.points_mm, self.radius_mm)
        for point, part in zip(self.points_mm, near, strict=True):
            if not part:
                raise InputError(f"readings: the face has nothing within {self.radius_mm:g} mm of the point "
                                 f"{', '.join(f'{value:g}' for value in point)} mm; correct the point, or give a larger radius_mm.")
        return list(near)


def labelled_points(values: np.ndarray, points_mm: np.ndarray) -> "xarray.DataArray":
    """Readings (step, point, quantity) of points (k, 3) with their labels."""
    places = {f"{axis}_mm": ("point", column, {"units": "mm"}) for axis, column in zip("xyz", points_mm.T, strict=True)}
    return labelled(values, ("step", "point", "quantity"),
                    coordinates={"quantity": list(QUANTITIES), "units": ("quantity", list(UNITS)), **places})
