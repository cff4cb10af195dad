"""The readout `depth`: how deep the object's underside lies below the surface at rest, as an image of the camera.

    readouts:
      camera: {kind: camera, ...}
      depth: {kind: depth, max_mm: 3.0}
"""

from typing import TYPE_CHECKING

import numpy as np

from softtact.imaging import gel_image
from softtact.imaging.gel_image import Relief
from softtact.readout.camera import camera_of
from softtact.readout.registry import SurfaceMotion, labelled, register
from softtact.readout.relief import object_depths, reliefs
from softtact.sensors.fields import FiniteSection, Length

if TYPE_CHECKING:
    import xarray


@register("depth")
class Depth(FiniteSection):
    """(step, y, x) in mm: depth of the object that each pixel of a camera sees, 0 to max_mm, as if the gel were not there.

    By a z-buffer of the object where its mesh is known; else at the points of the surface, from their gaps to it: these fold where
    the object drags them far. 0 beside the object; nan where a model gives neither. `grey` makes an image of it.
    """

    max_mm: Length
    camera: str = "camera"

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """See `Depth`. Raises InputError where the sensor has no such camera."""
        pinhole = camera_of(surface.spec, self.camera).pinhole
        if surface.object is not None:
            return labelled(surface.object.depths_mm(pinhole, deepest_mm=self.max_mm), ("step", "y", "x"), units="mm")
        images = []
        for relief, depth in zip(reliefs(surface), object_depths(surface), strict=True):
            depth = np.clip(depth, 0.0, self.max_mm)
            underside = Relief(relief.x_mm, relief.y_mm, np.dstack([relief.moved_mm[..., :2], -np.nan_to_num(depth)]))
            images.append(gel_image.seen(underside, pinhole, depth[..., None], steep=True)[..., 0])
        return labelled(np.stack(images), ("step", "y", "x"), units="mm")


def grey(depth_mm: np.ndarray, *, max_mm: float) -> np.ndarray:
    """Grey levels (...) uint8 of depths (...) in mm: 0 for none, 255 for max_mm and more."""
    return np.round(255 * np.clip(np.nan_to_num(depth_mm) / max_mm, 0.0, 1.0)).astype(np.uint8)
