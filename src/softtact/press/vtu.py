"""The pressed sensor as a mesh with displacements, for ParaView and `softtact view`.

bodies kept by the hyperelastic model, or by the solid one on layers: the solver's whole mesh, and the object's pressure on
the faces of the sensing surface; frusta of the solid model are springs, and are not drawn
solids: their mesh with its regions and faces, and at the nodes of each step displacement, J, von Mises stress and contact pressure
else the deformation map as a surface, with the sensor's walls and bottom at rest; only the map's vertical displacement is known
there, and no pressure
The object is added where it was kept (`Sensor.press(keep_object=True)`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.checksums import checked
from softtact.errors import InputError
from softtact.fem.files.solids import check_mesh_file, write_mesh
from softtact.files import atomic_path
from softtact.inputs import in_one_sentence
from softtact.models.solid.result import SolidFields
from softtact.press.objects import PlacedObject

if TYPE_CHECKING:
    from softtact.models.hyperelastic.deformed_mesh import PressedBody
    from softtact.press.result import PressResult

LAYERS = {"frusta": 0, "sheet": 1, "cover": 2, "pressed face": 3, "wall at rest": 4, "object": 5}
_DISPLACEMENT, _PRESSURE = "displacement_mm_", "contact_pressure_mpa_"     # followed by `PressedMesh._ends`
_LOAD_STEP = re.compile(r"displacement_mm_(.+?)N(?:_step(\d+))?")
# Faces of VTK's cells by their corners, for the cells that `surface` draws.
_FACES = {"hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
          "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)), "quad": ((0, 1, 2, 3),),
          "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)), "triangle": ((0, 1, 2),)}


def write(result: "PressResult", path: str | Path) -> None:
    """Write the sensor of a press' result: its bodies, else its solids, else its map."""
    if not result.bodies and result.solid is not None:
        return _write_solid(result.solid, path)
    mesh = of_bodies(result.bodies, result.normal_force_n) if result.bodies else of_map(
        result.deformation_map_mm, result.x_mm, result.y_mm, result.normal_force_n, thickness_mm=result.attributes["thickness_mm"])
    (mesh if result.placed_object is None else mesh.with_object(result.placed_object)).write(path)


def _write_solid(solid: SolidFields, path: str | Path) -> None:
    """Write a mesh of solids, with the fields of step K as arrays `..._stepK`."""
    at_nodes = {"displacement_mm": solid.displacement_mm, "volume_ratio": solid.volume_ratio, "von_mises_mpa": solid.von_mises_mpa,
                "contact_pressure_mpa": solid.pressed_mpa}
    write_mesh(solid.mesh, path, {f"{name}_step{step}": one.astype(np.float32) for name, values in at_nodes.items()
                                  for step, one in enumerate(values, start=1)})


@dataclass(frozen=True)
class PressedMesh:
    """points (n, 3) in mm at rest, z = 0 at the sensing surface;  cells: [(VTK's kind, nodes (e, w), layer's number)]

    force_n (l,);  displacement_mm (l, n, 3)
    pressure_mpa (l, e): on the cells of the layer `pressed face`, positive in compression, or None where it is not known
    """

    points: np.ndarray
    cells: list
    force_n: np.ndarray
    displacement_mm: np.ndarray
    pressure_mpa: np.ndarray | None = None

    def points_of(self, layer: str) -> np.ndarray:
        """Numbers of the points that the cells of a layer use, by its name in `LAYERS`. Raises InputError where it has none."""
        used = [nodes.ravel() for _, nodes, number in self.cells if number == LAYERS[layer]]
        if not used:
            raise InputError(f"The pressed sensor has no cells of the layer {layer!r}; keep the body of a hyperelastic press.")
        return np.unique(np.concatenate(used))

    def write(self, path: str | Path) -> None:
        """Write as VTU: for each force an array of displacements and, where known, of pressures (nan off the pressed face)."""
        import meshio

        kinds = [(kind, nodes) for kind, nodes, _ in self.cells]
        layers = {"layer": [np.full(len(nodes), layer, dtype=np.int32) for _, nodes, layer in self.cells]}
        ends = self._ends()
        moved = {_DISPLACEMENT + end: values.astype(np.float32) for end, values in zip(ends, self.displacement_mm, strict=True)}
        pressed = {} if self.pressure_mpa is None else {
            _PRESSURE + end: [values.astype(np.float32) if layer == LAYERS["pressed face"]
                                      else np.full(len(nodes), np.nan, np.float32) for _, nodes, layer in self.cells]
            for end, values in zip(ends, self.pressure_mpa, strict=True)}
        mesh = meshio.Mesh(self.points, kinds, point_data=moved, cell_data=layers | pressed)
        with atomic_path(path) as temporary:
            mesh.write(temporary, file_format="vtu")

    def _ends(self) -> list[str]:
        """Ends of the arrays' names: the force, and the step's number where forces repeat or fall, as in a motion."""
        ends = [f"{force:g}N" for force in self.force_n]
        rising = len(set(ends)) == len(ends) and (np.diff(self.force_n) > 0).all()
        return ends if rising else [f"{end}_step{number}" for number, end in enumerate(ends, start=1)]

    def with_object(self, placed: PlacedObject) -> "PressedMesh":
        """The same with the object, as triangles of the layer `object` that move as one."""
        moved = placed.displacement_mm
        return replace(self, points=np.vstack([self.points, placed.points_mm]),
                       cells=[*self.cells, ("triangle", placed.triangles + len(self.points), LAYERS["object"])],
                       displacement_mm=np.concatenate([self.displacement_mm, moved], axis=1))

    def surface(self, *, of_object: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points (n', 3) on the sensor's outside, triangles (m, 3) of them, and their numbers (n',) in `points`.

        of_object: the object's in place of the sensor's; no points where the mesh has no object
        """
        faces = [corners for kind, nodes, layer in self.cells if (layer == LAYERS["object"]) == of_object
                 for corners in _outer_faces(kind, nodes)]
        if not faces:
            return np.zeros((0, 3)), np.zeros((0, 3), dtype=int), np.zeros(0, dtype=int)
        triangles = np.concatenate([quads[:, [0, k, k + 1]] for quads in faces for k in range(1, quads.shape[1] - 1)])
        used, triangles = np.unique(triangles, return_inverse=True)
        return self.points[used], triangles.reshape(-1, 3), used


def read_vtu(path: str | Path) -> PressedMesh:
    """The `PressedMesh` of a file that `PressedMesh.write` wrote; its pressures are left out."""
    from meshio import vtu

    check_mesh_file(path)
    with checked(path), in_one_sentence(path, "not readable as VTU", "write it again"):
        mesh = vtu.read(path)
    load_steps = sorted((int(match[2] or 0), float(match[1]), name)
                        for name in mesh.point_data if (match := _LOAD_STEP.fullmatch(name)))
    if not load_steps:
        raise InputError(f"{path}: it holds no pressed sensor (no displacements); give a file of softtact press --vtu.")
    layers = mesh.cell_data.get("layer", [np.zeros(len(block.data)) for block in mesh.cells])
    cells = [(block.type, block.data[layer == number], int(number))     # a file has one block for all neighbouring cells of a kind
             for block, layer in zip(mesh.cells, layers, strict=True) for number in np.unique(layer)]
    return PressedMesh(points=mesh.points, cells=cells, force_n=np.array([force for _, force, _ in load_steps]),
                       displacement_mm=np.stack([mesh.point_data[name] for _, _, name in load_steps]))


def of_map(maps_mm: np.ndarray, x_mm: np.ndarray, y_mm: np.ndarray, force_n: np.ndarray, *, thickness_mm: float) -> PressedMesh:
    """The `PressedMesh` of deformation maps (l, ny, nx): a pressed face, with walls and a bottom at rest."""
    number = np.arange(len(y_mm) * len(x_mm)).reshape(len(y_mm), len(x_mm))
    top = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    x, y = np.meshgrid(x_mm, y_mm)
    face = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    rim = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    following = np.roll(rim, -1)
    walls = np.column_stack([rim, rim + x.size, following + x.size, following])
    points = np.vstack([face, face - [0.0, 0.0, thickness_mm]])
    moved = np.zeros((len(maps_mm), len(points), 3))
    moved[:, :len(face), 2] = -np.asarray(maps_mm).reshape(len(maps_mm), -1)
    cells = [("quad", top, LAYERS["pressed face"]), ("quad", np.vstack([walls, top[:, ::-1] + x.size]), LAYERS["wall at rest"])]
    return PressedMesh(points=points, cells=cells, force_n=np.asarray(force_n), displacement_mm=moved)


def of_bodies(bodies: "Sequence[PressedBody]", force_n: np.ndarray) -> PressedMesh:
    """The `PressedMesh` of a hyperelastic press' `PressedBody`s, one for each force."""
    first = bodies[0]
    cells = [(cells.kind, cells.nodes, LAYERS[cells.region]) for cells in first.cells]
    return PressedMesh(points=first.points_mm, cells=[*cells, ("quad8", first.top, LAYERS["pressed face"])],
                       force_n=np.asarray(force_n), displacement_mm=np.stack([body.displacement_mm for body in bodies]),
                       pressure_mpa=np.stack([body.pressure_mpa for body in bodies]))


def _outer_faces(kind: str, nodes: np.ndarray) -> list[np.ndarray]:
    """Faces [(f, corners)] of cells of one kind that no other of them shares."""
    shape = kind.rstrip("0123456789")
    if shape not in _FACES:
        raise InputError(f"Cells of the kind {kind!r} are not drawn; give a file of softtact press --vtu.")
    if shape in ("quad", "triangle"):
        return [nodes[:, :len(_FACES[shape][0])]]
    out = []
    for size in {len(face) for face in _FACES[shape]}:
        faces = np.concatenate([nodes[:, face] for face in _FACES[shape] if len(face) == size])
        _, first, uses = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        out.append(faces[np.sort(first[uses == 1])])
    return out
