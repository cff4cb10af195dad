"""The readout `markers`: where a gel's markers are, in the camera's image and on the surface.

    readouts:
      camera: {kind: camera, ...}                 # its markers, and its pinhole
      markers: {kind: markers}                    # (step, marker, 2) in px
      marker_mm: {kind: markers, unit: mm}        # (step, marker, 3) in mm
"""

from typing import TYPE_CHECKING, Literal

import numpy as np

from softtact.errors import InputError
from softtact.readout.camera import camera_of
from softtact.readout.registry import SurfaceMotion, labelled, register
from softtact.readout.relief import reliefs
from softtact.sensors.fields import FiniteSection

if TYPE_CHECKING:
    import xarray


@register("markers")
class Markers(FiniteSection):
    """Places of the markers of a camera, row by row of its grid.

    unit px: (step, marker, 2) column and row in the image, 0 in the middle of the first pixel, with coordinates x_mm, y_mm, z_mm
    (step, marker) on the surface and rest_x_px, rest_y_px (marker,) of the untouched gel
    unit mm: (step, marker, 3) in the sensor frame
    """

    camera: str = "camera"
    unit: Literal["px", "mm"] = "px"

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """See `Markers`. Raises InputError where the sensor has no such camera, or the camera no markers."""
        camera = camera_of(surface.spec, self.camera)
        if camera.markers == "none":
            raise InputError(f"{surface.spec.name}, at 'readouts': the camera {self.camera!r} has no markers to read; add "
                             "'markers' to it, or leave this readout out.")
        rest = camera.markers.rest_px(camera.pinhole)
        places = np.stack([relief.places(camera.markers_mm()) for relief in reliefs(surface)])
        if self.unit == "mm":
            return labelled(places, ("step", "marker", "axis"), units="mm", coordinates={"axis": ["x", "y", "z"]})
        on_surface = {f"{axis}_mm": (("step", "marker"), places[..., k], {"units": "mm"}) for k, axis in enumerate("xyz")}
        untouched = {f"rest_{axis}_px": ("marker", rest[:, k], {"units": "px"}) for k, axis in enumerate("xy")}
        return labelled(camera.pinhole.project(places), ("step", "marker", "axis"), units="px",
                        coordinates={"axis": ["x", "y"]} | on_surface | untouched)
