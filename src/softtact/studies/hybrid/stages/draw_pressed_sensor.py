"""The pressed sensor's surface as a view that turns in a browser.

inputs: body (VTU), summary (JSON), object (mesh);  outputs: html;  settings: unit, pose
"""

from typing import Any

import numpy as np

from softtact.files import atomic_path, read_json
from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import Pose
from softtact.press.vtu import read_vtu
from softtact.reporting.view3d import html_view
from softtact.studies.hybrid.figures.section import top_surface

_LIFTED_MM = 6.0     # of the object above the surface, so that its imprint is seen


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Two states, at rest and pressed, of the surface with the object above it."""
    body, summary = read_vtu(inputs["body"]), read_json(inputs["summary"])
    pose = None if settings["pose"] is None else Pose.from_values(settings["pose"])
    lifted = place(read_mesh(inputs["object"], unit=settings["unit"]), pose=pose)
    at = np.asarray(lifted.vertices) + [0.0, 0.0, _LIFTED_MM]
    rest, moved, triangles = top_surface(body)
    points = np.stack([np.vstack([rest, at]), np.vstack([rest + moved, at - [0.0, 0.0, summary["indentation_mm"]]])])
    grey = np.full(len(at), np.nan)
    values = np.stack([np.append(np.zeros(len(rest)), grey), np.append(-moved[:, 2], grey)])
    view = html_view(points, np.vstack([triangles, np.asarray(lifted.faces) + len(rest)]), values, unit="mm towards the PCB",
                     title=f"{summary['model']} model: {summary['item']} pressed with {summary['force_n']:g} N",
                     labels=["at rest", f"{summary['force_n']:g} N"])
    with atomic_path(outputs["html"]) as temporary:
        temporary.write_text(view, encoding="utf-8")
