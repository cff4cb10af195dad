"""A view of a press: its surface, or the outside of its solids, at each step, as an interactive page or as a picture."""

import html
import re
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from softtact.errors import InputError
from softtact.fem.files.solids import check_mesh_file, read_mesh_file
from softtact.fem.solid_mesh import outer_triangles
from softtact.files import atomic_path, read_dataset
from softtact.inputs import in_one_sentence
from softtact.press.objects import PlacedObject
from softtact.press.result import read_press
from softtact.press.vtu import of_map, read_vtu
from softtact.reporting.view3d import html_view

UNIT, UNIT_OF_SOLIDS = "displacement towards the PCB (mm)", "displacement (mm)"
_STEP = re.compile(r"displacement_mm_step(\d+)")
_EYE = (-0.9, -1.35, 1.0)     # direction from the body to the eye in a picture
_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title><style>
body {{font: 16px system-ui, sans-serif; max-width: 1400px; margin: 1em auto; padding: 0 1em}}
figure {{margin: 0}}
</style><body>{body}</body></html>
"""
_SEEN_THROUGH = 0.3           # opacity of the object
_SHEET_MM = 1.0               # height of the walls if a file does not state the sensor's thickness


@dataclass(frozen=True)
class PressView:
    """points_mm (l, n, 3) as pressed, triangles (m, 3) of the sensor, values (l, n): displacement towards the PCB in mm, nan at the
    object's points;  labels: forces;  object_triangles (k, 3): empty if the file does not contain the object;  unit: of the values
    """

    points_mm: np.ndarray
    triangles: np.ndarray
    values: np.ndarray
    labels: list
    title: str
    object_triangles: np.ndarray
    unit: str = UNIT


def read_view(path: str | Path) -> PressView:
    """The `PressView` of a press' NetCDF or VTU file."""
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".nc", ".vtu", ".npz"):
        raise InputError(f"{path}: not a press that can be shown; give the .nc or .vtu file of softtact press, or the .csv of a "
                         "recording.")
    with in_one_sentence(path, "not a press that can be shown", "give what softtact press wrote"):
        return _view_of(path, ending)


def _view_of(path, ending):
    if ending == ".vtu":
        check_mesh_file(path)
        of_solids = b'"region:' in path.read_bytes()
        return _of_solids_vtu(path) if of_solids else _of_mesh(path, read_vtu(path))
    if ending == ".npz" or "node_mm" in (data := read_dataset(path)) and "deformation_map_mm" not in data:
        return _of_result(path)
    return _of_mesh(path, _mesh_of_map(path, data))


def _of_mesh(path, mesh):
    """The view of a `PressedMesh`."""
    _, triangles, used = mesh.surface()
    _, object_triangles, of_object = mesh.surface(of_object=True)
    both = np.concatenate([used, of_object])
    moved = mesh.displacement_mm[:, both]
    values = -moved[..., 2]
    values[:, len(used):] = np.nan
    return _whole(path, PressView(points_mm=mesh.points[both] + moved, triangles=triangles, values=values, title=path.name,
                                  labels=[f"{force:g} N" for force in mesh.force_n],
                                  object_triangles=object_triangles + len(used)))


def _whole(path, view):
    """The view, after a check that all of its points are finite."""
    if not np.isfinite(view.points_mm).all():
        raise InputError(f"{path}: some displacements are not finite numbers; press again.")
    return view


def _of_result(path):
    """The view of a file of solids."""
    solid = read_press(path).solid
    return _of_solids(path, solid.mesh, solid.displacement_mm, solid.object_points_mm + solid.object_displacement_mm,
                      solid.object_triangles)


def _of_solids_vtu(path):
    """The view of a mesh of solids from `PressResult.write_vtu`."""
    mesh, point_data = read_mesh_file(path), meshio.vtu.read(path).point_data
    steps = sorted((int(match[1]), name) for name in point_data if (match := _STEP.fullmatch(name)))
    if not steps:
        raise InputError(f"{path}: it has a mesh but no displacements; give a file of PressResult.write_vtu.")
    moved = np.stack([point_data[name] for _, name in steps]).astype(float)
    return _of_solids(path, mesh, moved, np.zeros((len(moved), 0, 3)), np.zeros((0, 3), int))


def _of_solids(path, mesh, moved, object_points, object_triangles):
    used, triangles = np.unique(outer_triangles(mesh), return_inverse=True)
    points = np.concatenate([mesh.points[used] + moved[:, used], object_points], axis=1)
    values = np.full(points.shape[:2], np.nan)
    values[:, :len(used)] = np.linalg.norm(moved[:, used], axis=2)
    return _whole(path, PressView(points_mm=points, triangles=triangles.reshape(-1, 3), values=values, title=path.name,
                                  unit=UNIT_OF_SOLIDS, labels=[f"step {number}" for number in range(1, len(moved) + 1)],
                                  object_triangles=object_triangles + len(used)))


def _mesh_of_map(path, data):
    """The `PressedMesh` of a file's map."""
    missing = [name for name in ("deformation_map_mm", "normal_force_n", "x", "y") if name not in data.variables]
    if missing:
        raise InputError(f"{path}: it has no {missing[0]!r}, so it is not a press; give the file of softtact press --out.")
    if data["deformation_map_mm"].dims != ("step", "y", "x"):
        raise InputError(f"{path}: the map has the dimensions {data['deformation_map_mm'].dims} and not step, y, x; press again.")
    mesh = of_map(data["deformation_map_mm"].values, data["x"].values, data["y"].values, data["normal_force_n"].values,
                  thickness_mm=float(data.attrs.get("thickness_mm", _SHEET_MM)))
    placed = PlacedObject.of(data)
    return mesh if placed is None else mesh.with_object(placed)


def write_page(view: PressView, path: str | Path) -> None:
    """Write a self-contained page that shows the press."""
    triangles = np.vstack([view.triangles, view.object_triangles])
    body = html_view(view.points_mm, triangles, view.values, title=view.title, unit=view.unit, labels=view.labels,
                     see_through=len(view.object_triangles))
    with atomic_path(path) as temporary:
        temporary.write_text(_PAGE.format(title=html.escape(view.title), body=body), encoding="utf-8")


def save_picture(view: PressView, path: str | Path) -> str:
    """Draw the press at its last load step as PNG; return the renderer's name: pyvista if it is installed, else matplotlib."""
    try:
        import pyvista
    except ImportError:
        _draw_with_matplotlib(view, path)
        return "matplotlib"
    _draw_with_pyvista(pyvista, view, path)
    return "pyvista"


def _draw_with_pyvista(pyvista, view, path):
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)     # without a screen it warns, but draws
    surface, solid = (pyvista.PolyData(view.points_mm[-1], np.column_stack([np.full(len(triangles), 3), triangles]).ravel())
                      for triangles in (view.triangles, view.object_triangles))
    plotter = pyvista.Plotter(off_screen=True, window_size=(1200, 900))
    bar = {"title": f"{view.unit}\n", "color": "black", "vertical": False, "position_x": 0.25, "position_y": 0.04, "width": 0.5,
           "fmt": "%.3g", "title_font_size": 22, "label_font_size": 20, "n_labels": 3}
    plotter.add_mesh(surface, scalars=view.values[-1], cmap="viridis", scalar_bar_args=bar)
    if len(view.object_triangles):
        plotter.add_mesh(solid, color="#999999", opacity=_SEEN_THROUGH)
    size = " x ".join(f"{side:.3g}" for side in np.ptp(view.points_mm[-1], axis=0))
    plotter.add_text(f"{view.title}, {view.labels[-1]}; {size} mm", color="black", font_size=12)
    plotter.add_axes(color="black")
    plotter.set_background("white")
    plotter.enable_parallel_projection()
    plotter.view_vector(_EYE)
    plotter.camera.zoom(0.9)
    plotter.camera.SetWindowCenter(0.0, -0.2)     # leaves space for the colour bar below
    with atomic_path(path) as temporary:
        plotter.screenshot(temporary)
    plotter.close()


def _draw_with_matplotlib(view, path):
    from matplotlib.colors import Normalize

    from softtact.reporting.style import pyplot, save

    plt = pyplot()
    figure, axes = plt.subplots(figsize=(9, 7), subplot_kw={"projection": "3d"}, layout="constrained")
    points = view.points_mm[-1]
    a, b, c = points[view.triangles].transpose(1, 0, 2)
    # Only front sides, because matplotlib would draw back sides over them.
    triangles = view.triangles[np.cross(b - a, c - a) @ _EYE > 0]
    values = view.values[-1][triangles].mean(axis=1)
    drawn = axes.plot_trisurf(*points.T, triangles=triangles, linewidth=0, antialiased=False)
    limits = Normalize(values.min(), values.max())
    drawn.set_facecolor(plt.get_cmap("viridis")(limits(values)))
    axes.set(xlabel="x (mm)", ylabel="y (mm)", zlabel="z (mm)", title=f"{view.title}, {view.labels[-1]}")
    axes.locator_params(axis="z", nbins=3)
    axes.set_box_aspect(np.ptp(points, axis=0))
    axes.view_init(elev=32, azim=-123)
    if len(view.object_triangles):
        axes.plot_trisurf(*points.T, triangles=view.object_triangles, color="#999999", alpha=_SEEN_THROUGH, linewidth=0)
    figure.colorbar(plt.cm.ScalarMappable(limits, "viridis"), ax=axes, label=view.unit, shrink=0.6)
    save(figure, path)
