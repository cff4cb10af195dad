"""Figure 4.

inputs: complexity, objects (list of meshes);  outputs: png, svg
settings: thresholds, objects [{name, unit, pose}, ...], footprint_mm, reach_mm
"""

from typing import Any

import pandas as pd

from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import Pose
from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig4_complexity import Placed, draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    placed = {entry["name"]: Placed(_placed(path, entry), tuple(settings["footprint_mm"]), settings["reach_mm"])
              for path, entry in zip(inputs["objects"], settings["objects"], strict=True)}
    save(draw(pd.read_csv(inputs["complexity"]), placed, thresholds=settings["thresholds"]), outputs["png"], outputs["svg"])


def _placed(path, entry):
    pose = None if entry["pose"] is None else Pose.from_values(entry["pose"])
    return place(read_mesh(path, unit=entry["unit"]), pose=pose)
