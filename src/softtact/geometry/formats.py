"""Mesh files of all formats that are read: their facets, and the unit that they state.

STL, OBJ, PLY and OFF state no unit. 3MF, AMF, DAE and STEP state it, that of GLB is the metre. A ZIP archive holds one of these
files.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.archives import Archive
from softtact.geometry.cad import CHORD_MM, read_glb, read_step
from softtact.geometry.dae import read_dae
from softtact.geometry.obj import read_obj
from softtact.geometry.off import read_off
from softtact.geometry.ply import read_ply
from softtact.geometry.stl import read_stl
from softtact.geometry.xml_meshes import read_3mf, read_amf
from softtact.inputs import check_input, check_limit, is_hidden, refuse_pointer

UNIT_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4, "in": 25.4}
"""Units that a user can state, in mm."""
STATED_MM = UNIT_MM | {"micron": 0.001, "foot": 304.8}
"""Units that files state, in mm."""


@dataclass(frozen=True)
class Facets:
    """Facets as a file stores them."""

    triangles: np.ndarray
    """(n, 3, 3) in `unit`, or in the unit that the user states."""
    unit: str | None = None
    """Name of the unit of the facets, in `STATED_MM`; None where the file states none."""
    stated: tuple[str, ...] = ()
    """Names of the units that the file states, where they are others than that of the facets."""
    notes: tuple[str, ...] = ()
    """What a user should know of how the file was read, in words."""


def _without_unit(read: Callable[[Path, bytes], np.ndarray]) -> Callable[[Path, bytes], Facets]:
    return lambda path, data: Facets(read(path, data))


def _with_unit(read: Callable[[Path, bytes], tuple[np.ndarray, str]]) -> Callable[[Path, bytes], Facets]:
    def of(path: Path, data: bytes) -> Facets:
        triangles, unit = read(path, data)
        return Facets(triangles, unit, notes=(f"read in {unit}, the unit of the file",))

    return of


def _glb(path: Path, data: bytes) -> Facets:
    return Facets(read_glb(path, data), "m", notes=("read in m, the unit of glTF; its axes stay as they are, although y "
                                                    "points up in glTF: --pose turns the object",))


def _dae(path: Path, data: bytes) -> Facets:
    triangles, unit, up = read_dae(path, data)
    return Facets(triangles, unit, notes=(f"read in {unit}, the unit of the file; its axes stay as they are, and {up} "
                                          "points up: --pose turns the object",))


def _step(path: Path, data: bytes) -> Facets:
    triangles, units = read_step(path, data)
    facets = f"its curved faces are facets within {CHORD_MM:g} mm"
    if not units:     # Open CASCADE then takes the numbers for mm
        return Facets(triangles, notes=(f"{facets[:-2]}of the given unit",))
    return Facets(triangles, "mm", tuple(units), (f"read in {' and '.join(units)}, as the file states; {facets}",))


_READERS: dict[str, Callable[[Path, bytes], Facets]] = {
    ".stl": _without_unit(read_stl), ".obj": _without_unit(read_obj), ".ply": _without_unit(read_ply),
    ".off": _without_unit(read_off), ".3mf": _with_unit(read_3mf), ".amf": _with_unit(read_amf),
    ".dae": _dae, ".glb": _glb, ".step": _step, ".stp": _step}
MESHES = tuple(_READERS)
"""Endings of mesh files."""
SURFACES = (*MESHES, ".zip")
"""Endings of mesh files and of archives of one."""
NAMES = "STL, OBJ, PLY, OFF, 3MF, AMF, DAE, GLB or STEP"
"""The formats, in the words of messages and help."""


def read_facets(path: Path) -> Facets:
    """The facets of a mesh file; InputError where it is missing, too large, of no known format, or not what it should be."""
    check_input(path, "mesh", missing="there is no such mesh file.")
    ending = path.suffix.lower()
    if ending not in SURFACES:
        raise InputError(f"{path}: the format '{path.suffix}' is not read; save the mesh as {NAMES}.")
    name, data = path, path.read_bytes()
    if ending == ".zip":
        name, data = _packed(path, data)
        refuse_pointer(name, data)
    if not data:
        raise InputError(f"{name}: the file is empty; export the mesh again.")
    facets = _READERS[name.suffix.lower()](name, data)
    check_limit(name, "facets", len(facets.triangles))
    if facets.triangles.size == 0:
        raise InputError(f"{name}: the file holds no triangles; export a surface mesh, not points or curves.")
    return facets


def _packed(path, data):
    """(path in messages, bytes) of the only mesh of an archive."""
    archive = Archive(path, data)
    meshes = [name for name in archive.names if Path(name).suffix.lower() in MESHES]
    if len(meshes) > 1:
        raise InputError(f"{path}: it holds {len(meshes)} meshes, {', '.join(meshes[:5])}; unpack it, and give one of them.")
    if not meshes:
        raise InputError(f"{path}: it holds no mesh; pack a file of {NAMES}.")
    return path / meshes[0], archive.read(meshes[0])


def meshes_in(folder: Path) -> list[Path]:
    """The mesh files of a folder by name, without hidden ones; InputError where there is none."""
    found = sorted(file for file in folder.iterdir() if file.suffix.lower() in MESHES and not is_hidden(file))
    if not found:
        raise InputError(f"{folder}: the folder holds no file of {NAMES}; name the folder with the meshes.")
    return found


def in_mm(path: Path, facets: Facets, unit: str | None) -> Facets:
    """The facets in mm, and the unit that they were read in; InputError where the user's is missing, unknown or another one."""
    if unit is not None and unit not in UNIT_MM or unit is None and facets.unit is None:
        fault = "no unit is stated, and the file holds none" if unit is None else f"the unit {unit!r} is not known"
        raise InputError(f"{path}: {fault}; state one of {', '.join(UNIT_MM)} (--unit, unit=).")
    if facets.unit is None:
        return replace(facets, triangles=facets.triangles * UNIT_MM[str(unit)], unit=unit)
    stated = facets.stated or (facets.unit,)
    if unit is not None and {STATED_MM.get(name) for name in stated} != {UNIT_MM[unit]}:
        raise InputError(f"{path}: the unit is given as {unit}, and that of the file is {' and '.join(stated)}; leave the unit "
                         "out, or correct the file.")
    return replace(facets, triangles=facets.triangles * STATED_MM[facets.unit])
