"""A section through the pressed sensor: the material in a plane y = const at rest, and its displaced position.

The curved elements are divided into small straight ones with their shape functions and displacements, which VTK then cuts with a
plane. Nothing is rendered here.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.fem.elements import HEX20, HEX27, WEDGE18
from softtact.press.vtu import LAYERS, PressedMesh

if TYPE_CHECKING:
    from softtact.sensors.specification import SensorSpec

_FACE_TRIANGLES = np.array([[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]])     # of corners, then mid-sides
_BESIDE_MM = 0.01     # a plane exactly through the frusta's axes would run along faces of elements


@dataclass(frozen=True)
class CutBody:
    """Polygons in a plane: rest_mm, pressed_mm lists of (k, 2), x and z; region (n,): numbers of their layers by `LAYERS`."""

    rest_mm: list
    pressed_mm: list
    region: np.ndarray


def top_surface(mesh: PressedMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3) at rest, displacements (n, 3) in mm at the largest force and triangles (m, 3) of the cover's upper side."""
    faces = np.vstack([nodes for _, nodes, layer in mesh.cells if layer == LAYERS["pressed face"]])
    used, numbers = np.unique(faces, return_inverse=True)
    triangles = numbers.reshape(-1, 8)[:, _FACE_TRIANGLES].reshape(-1, 3)
    return mesh.points[used], mesh.displacement_mm[-1, used], triangles


def row_under_load(mesh: PressedMesh, spec: "SensorSpec") -> float:
    """y (mm) of the row of frusta under the largest displacement at the largest force."""
    nodes = mesh.points_of("sheet")
    deepest = mesh.points[nodes[np.argmin(mesh.displacement_mm[-1, nodes, 2])], 1]
    pitch, count = spec.dielectric.frusta.pitch_mm, spec.frusta_counts[1]
    rows = pitch * (np.arange(count) - 0.5 * (count - 1))
    return float(rows[np.argmin(np.abs(rows - deepest))])


def section(mesh: PressedMesh, y_mm: float, *, parts: int = 3) -> CutBody:
    """The `CutBody` at y_mm of a `PressedMesh` at its largest force; each element is divided into `parts` along each direction."""
    import pyvista

    plane = y_mm + _BESIDE_MM
    rest, pressed, regions = [], [], []
    for kind, nodes, region in mesh.cells:
        y = mesh.points[nodes, 1]
        nodes = nodes[(y.min(axis=1) < plane) & (y.max(axis=1) > plane)]
        if region == LAYERS["pressed face"] or not len(nodes):     # a surface of the cover, which is cut as a solid
            continue
        if kind not in _LATTICES:
            raise InputError(f"Cells of the kind {kind!r} cannot be cut; give a body of `Sensor.press(keep_body=True)`.")
        points, moved, linear, cell_type = _refined(kind, mesh.points[nodes], mesh.displacement_mm[-1, nodes], parts)
        grid = pyvista.UnstructuredGrid({cell_type: linear}, points)
        grid["displacement"] = moved
        cut: Any = grid.slice(normal="y", origin=(0.0, plane, 0.0))
        for face in cut.regular_faces if cut.is_all_triangles else cut.irregular_faces:
            at, to = cut.points[face], cut["displacement"][face]
            rest.append(at[:, [0, 2]])
            pressed.append((at + to)[:, [0, 2]])
            regions.append(region)
    return CutBody(rest, pressed, np.array(regions))


def _refined(kind, points, displacement, parts):
    """Points (n, 3), displacements (n, 3) and linear cells of elements (e, w, 3), and the VTK type of these cells."""
    at, cells, values, cell_type = _LATTICES[kind](parts)
    numbers = cells[None] + (np.arange(len(points)) * len(at))[:, None, None]
    return (*(np.einsum("pw,ewd->epd", values, field).reshape(-1, 3) for field in (points, displacement)),
            numbers.reshape(-1, cells.shape[1]), cell_type)


def _hexes(element):
    def lattice(parts):
        line = np.linspace(-1, 1, parts + 1)
        z, y, x = np.meshgrid(line, line, line, indexing="ij")
        at = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        n = parts + 1
        k, j, i = (grid.ravel() for grid in np.meshgrid(*[np.arange(parts)] * 3, indexing="ij"))
        corners = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
        cells = np.column_stack([(i + a) + n * (j + b) + n * n * (k + c) for a, b, c in corners])
        return at, cells, element.shape(at)[0][:, element.vtk_order], 12
    return lattice


def _wedges(parts):
    steps = [(i, j) for j in range(parts + 1) for i in range(parts + 1 - j)]
    number = {step: k for k, step in enumerate(steps)}
    up = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in steps if i + j < parts]
    down = [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in steps if i + j < parts - 1]
    plan, triangles = np.array(steps) / parts, np.array(up + down)
    at = np.vstack([np.column_stack([plan, np.full(len(plan), z)]) for z in np.linspace(-1, 1, parts + 1)])
    cells = np.vstack([np.hstack([triangles + k * len(plan), triangles + (k + 1) * len(plan)]) for k in range(parts)])
    return at, cells, WEDGE18.shape(at)[0][:, WEDGE18.vtk_order], 13


_LATTICES = {HEX27.meshio_name: _hexes(HEX27), HEX20.meshio_name: _hexes(HEX20), WEDGE18.meshio_name: _wedges}
