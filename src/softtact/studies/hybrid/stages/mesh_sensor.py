"""Mesh of a model's sensor, for ParaView.

outputs: mesh;  settings: sensor, model, kind, mesh (its resolution, if the kind has one)
"""

from typing import Any

from softtact.files import atomic_path
from softtact.models.meshes import MESHES
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the mesh as VTU."""
    mesh = MESHES[settings["kind"]](SensorSpec.from_dict(settings["sensor"]), settings["mesh"])
    with atomic_path(outputs["mesh"]) as temporary:
        mesh.write(temporary, file_format="vtu")
