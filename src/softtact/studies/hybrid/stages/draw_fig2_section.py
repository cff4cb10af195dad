"""Figure 2.

inputs: body (VTU), summary (JSON), object (mesh);  outputs: png, svg;  settings: sensor, unit, pose
"""

from typing import Any

import numpy as np

from softtact.files import read_json
from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import Pose
from softtact.press.vtu import read_vtu
from softtact.reporting.style import save
from softtact.sensors.specification import SensorSpec
from softtact.studies.hybrid.figures.fig2_section import draw
from softtact.studies.hybrid.figures.section import row_under_load, section


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Cut the pressed body through the row of frusta under the load, and draw."""
    spec, summary, body = SensorSpec.from_dict(settings["sensor"]), read_json(inputs["summary"]), read_vtu(inputs["body"])
    y = row_under_load(body, spec)
    pose = None if settings["pose"] is None else Pose.from_values(settings["pose"])
    placed = place(read_mesh(inputs["object"], unit=settings["unit"]), pose=pose)
    figure = draw(section(body, y), _outline(placed, y, summary["indentation_mm"]), spec=spec, summary=summary, y_mm=y)
    save(figure, outputs["png"], outputs["svg"])


def _outline(mesh, y, depth):
    """Polygons (k, 2), x and z, of the object in the plane y, lowered by `depth` mm."""
    cut = mesh.section(plane_origin=(0.0, y, 0.0), plane_normal=(0.0, 1.0, 0.0))
    return [] if cut is None else [loop[:, [0, 2]] - np.array([0.0, depth]) for loop in cut.discrete]
