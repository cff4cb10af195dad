"""What the deformation maps of the grasped objects show of their features.

inputs: objects (list of meshes), presses (list: every model of every object);  outputs: features (CSV)
settings: objects [{name, unit, pose}, ...], frustum_height_mm
"""

from typing import Any

import numpy as np

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.evaluation.curve_shape import feature_table
from softtact.files import read_dataset, write_csv
from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import Pose


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Measure every press at its largest force."""
    presses = [read_dataset(path) for path in inputs["presses"]]
    grid = np.meshgrid(presses[0].x.values, presses[0].y.values)
    heights = {entry["name"]: _heights(path, entry, grid)
               for path, entry in zip(inputs["objects"], settings["objects"], strict=True)}
    write_csv(outputs["features"], feature_table(presses, heights, frustum_height_mm=settings["frustum_height_mm"]))


def _heights(path, entry, grid):
    """Heights (y, x) of the object's underside over the map's points, nan beside it."""
    pose = None if entry["pose"] is None else Pose.from_values(entry["pose"])
    field = HeightField(place(read_mesh(path, unit=entry["unit"]), pose=pose))
    x, y = grid
    heights = np.asarray(field(x.ravel(), y.ravel())[0], dtype=float).reshape(x.shape)
    return np.where(heights < NO_CONTACT_MM, heights, np.nan)
