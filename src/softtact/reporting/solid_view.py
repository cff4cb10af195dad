"""A press of solids to look at: the bodies' outside at each load step, and the rigid objects beside them."""

import re
from pathlib import Path

import meshio
import numpy as np

from softtact.errors import InputError
from softtact.fem.mesh_files import read_mesh_file
from softtact.fem.solid_mesh import outer_triangles
from softtact.files import read_dataset
from softtact.models.solid.result import read_solid_result
from softtact.models.solid.result_files import KIND
from softtact.reporting import press_view
from softtact.reporting.press_view import PressView

UNIT = "displacement (mm)"
_STEP = re.compile(r"displacement_mm_step(\d+)")


def read_view(path: str | Path) -> PressView:
    """The `PressView` of a file of `SolidResult` (NetCDF, .npz or VTU), or of `softtact press`."""
    path = Path(path)
    ending = path.suffix.lower()
    if ending == ".npz" or ending == ".nc" and read_dataset(path).attrs.get("kind") == KIND:
        return view_of_result(path)
    if ending == ".vtu" and path.is_file() and b'"region:' in path.read_bytes():
        return view_of_vtu(path)
    return press_view.read_view(path)


def view_of_result(path: Path) -> PressView:
    """The `PressView` of a file that `SolidResult.write` wrote."""
    result = read_solid_result(path)
    moved, solid = result.displacement_mm, result.object_displacement_mm
    return _view(path, result.mesh, moved, result.object_points_mm + solid, result.object_triangles)


def view_of_vtu(path: Path) -> PressView:
    """The `PressView` of a file that `SolidResult.write_vtu` wrote."""
    mesh, point_data = read_mesh_file(path), meshio.vtu.read(path).point_data
    steps = sorted((int(match[1]), name) for name in point_data if (match := _STEP.fullmatch(name)))
    if not steps:
        raise InputError(f"{path}: it holds a mesh and no displacements of it; give a file of SolidResult.write_vtu.")
    moved = np.stack([point_data[name] for _, name in steps]).astype(float)
    return _view(path, mesh, moved, np.zeros((len(moved), 0, 3)), np.zeros((0, 3), int))


def _view(path, mesh, moved, object_points, object_triangles):
    used, triangles = np.unique(outer_triangles(mesh), return_inverse=True)
    points = np.concatenate([mesh.points[used] + moved[:, used], object_points], axis=1)
    values = np.full(points.shape[:2], np.nan)
    values[:, :len(used)] = np.linalg.norm(moved[:, used], axis=2)
    if not np.isfinite(points).all():
        raise InputError(f"{path}: some displacements are not finite numbers; press again.")
    return PressView(points_mm=points, triangles=triangles.reshape(-1, 3), values=values, title=path.name, unit=UNIT,
                     labels=[f"step {number}" for number in range(1, len(moved) + 1)],
                     object_triangles=object_triangles + len(used))
