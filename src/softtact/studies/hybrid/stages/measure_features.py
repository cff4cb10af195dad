"""Measure the features of the grasped objects in their deformation maps.

inputs: objects (list of meshes), presses (list: of every object with the tested models, and that which the virtual sensor reads)
outputs: features (CSV)
settings: objects [{name, unit, pose}, ...], frustum_height_mm
"""

from typing import Any

from softtact.contact.height_field import HeightField
from softtact.evaluation.curve_shape import feature_table
from softtact.files import read_dataset, write_csv
from softtact.geometry.meshes import read_placed


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Measure every press at its largest force."""
    presses = [read_dataset(path) for path in inputs["presses"]]
    grid = presses[0].x.values, presses[0].y.values
    heights = {entry["name"]: HeightField(read_placed(path, unit=entry["unit"], pose=entry["pose"])).on_grid(*grid)
               for path, entry in zip(inputs["objects"], settings["objects"], strict=True)}
    write_csv(outputs["features"], feature_table(presses, heights, frustum_height_mm=settings["frustum_height_mm"]))
