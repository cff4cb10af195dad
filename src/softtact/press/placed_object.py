"""The pressed object where it stands at each load step, for views and for what follows a press."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

_VARIABLES = {"object_points_mm": ("points_mm", ("object_point", "axis"), "mm"),
              "object_triangles": ("triangles", ("object_triangle", "corner"), "1"),
              "object_way_mm": ("way_mm", ("step", "axis"), "mm")}


@dataclass(frozen=True)
class PlacedObject:
    """A rigid object in the sensor frame: at load step l its points are points_mm + way_mm[l]."""

    points_mm: np.ndarray
    """(n, 3) in mm: in its pose, before the press."""
    triangles: np.ndarray
    """(m, 3) numbers of points."""
    way_mm: np.ndarray
    """(step, 3) in mm: how far it has moved along x, y, z from its pose."""

    def variables(self) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
        """Variables of an xarray dataset; `of` reads them back."""
        return {name: (dimensions, getattr(self, own), {"units": units}) for name, (own, dimensions, units) in _VARIABLES.items()}

    @classmethod
    def of(cls, dataset: Mapping[Any, Any]) -> "PlacedObject | None":
        """The object of a press' dataset; None where it was not kept."""
        if not all(name in dataset for name in _VARIABLES):
            return None
        return cls(**{own: np.asarray(dataset[name]) for name, (own, _, _) in _VARIABLES.items()})


def placed_object(placed: trimesh.Trimesh, *, touch_mm: float, indentation_mm: np.ndarray, aside_mm: np.ndarray) -> PlacedObject:
    """The `PlacedObject` of a mesh in its pose, of the depths (step,) from first touch and the ways (step, 2) aside.

    touch_mm: how far it comes down from its pose until it touches
    """
    down = -(touch_mm + np.asarray(indentation_mm))
    return PlacedObject(points_mm=np.asarray(placed.vertices, dtype=float), triangles=np.asarray(placed.faces, dtype=np.int64),
                        way_mm=np.column_stack([aside_mm[:len(down)], down]))
