"""Tabulate the complexity of objects (STL files) and the model chosen for each."""

from typing import Any

from softtact.files import write_csv
from softtact.geometry.complexity import score_objects


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """meshes (one or more) -> table (complexity.csv).

    settings: objects (list of {name, unit, pose}, in the order of the meshes), footprint_mm, and optionally rule,
    thresholds {total, overlap}, reach_mm
    """
    meshes = inputs["meshes"] if isinstance(inputs["meshes"], list) else [inputs["meshes"]]
    write_csv(outputs["table"], score_objects(meshes, **settings))
