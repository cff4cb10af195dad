"""GLB files, scenes of glTF in metres, and STEP files, curved bodies of CAD, as facets; Open CASCADE (`cascadio`) reads STEP."""

import contextlib
import faulthandler
import io
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh

from softtact.errors import InputError, WorkerError
from softtact.inputs import in_one_sentence
from softtact.processes import call_apart

CHORD_MM = 0.01
"""Largest distance in mm of a STEP file's surface from its facets; the mean over a ball is a fifth of it."""
_INSIDE = 0.4    # of that: the tolerance of Open CASCADE, of which facets of balls of 0.5 to 60 mm miss up to 2.1 times
_ANGLE = 0.5     # largest angle in radians between facets of one curve, for radii below some hundredths of a mm
_PASSED_OVER = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp")     # of glTF: they move no point
_TO_MM = 1000.0
_SI_PREFIX = {b"$": "m", b".MILLI.": "mm", b".CENTI.": "cm", b".MICRO.": "micron"}
_AGAIN = "export it again"
_ASSIGNED = re.compile(rb"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")
_SI_UNIT = re.compile(rb"SI_UNIT\s*\(\s*([^,\s]+)\s*,\s*\.METRE\.\s*\)")
_CONVERTED = re.compile(rb"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'")


def read_glb(path: Path, data: bytes) -> np.ndarray:
    """Triangles (n, 3, 3) in metres of all nodes of a GLB file's scene, in their places; InputError says what is wrong."""
    with in_one_sentence(path, "not a readable GLB file", _AGAIN):
        _refuse_extensions(path, data)
        scene = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False, skip_materials=True)
        parts = [_placed(*scene.graph[node], scene) for node in scene.graph.nodes_geometry]
    return np.concatenate([np.empty((0, 3, 3)), *parts])


def _placed(matrix, name, scene):
    """The triangles of a node's body; none of lines and points."""
    body = scene.geometry[name]
    if not isinstance(body, trimesh.Trimesh):
        return np.empty((0, 3, 3))
    triangles = np.asarray(body.triangles, dtype=float) @ matrix[:3, :3].T + matrix[:3, 3]
    return triangles[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else triangles     # a mirrored body keeps its outside


def _refuse_extensions(path, data):
    """Refuse a file whose points stand in an extension, such as a compression."""
    length = int.from_bytes(data[12:16], "little")
    if data[:4] != b"glTF" or data[16:20] != b"JSON":
        raise InputError(f"{path}: it does not begin as a GLB file does; {_AGAIN} as binary glTF 2.0.")
    needed = [name for name in json.loads(data[20:20 + length]).get("extensionsRequired", ()) if not name.startswith(_PASSED_OVER)]
    if needed:
        raise InputError(f"{path}: it needs the extension {needed[0]}, which is not read; {_AGAIN} without compression.")


def read_step(path: Path, data: bytes) -> tuple[np.ndarray, list[str]]:
    """Triangles (n, 3, 3) in mm of a STEP file's bodies, and the names of its units of length, which Open CASCADE converts."""
    import cascadio  # noqa: F401     of an extra: where it is missing, the command says which

    if not data.lstrip().startswith(b"ISO-10303-21"):
        raise InputError(f"{path}: it does not begin with ISO-10303-21 as a STEP file does; {_AGAIN}.")
    if b"END-ISO-10303-21" not in data[-1000:]:
        raise InputError(f"{path}: it ends without END-ISO-10303-21, so it was cut off; {_AGAIN}.")
    try:
        glb = call_apart(_tessellated, data)     # damaged files crash it
    except WorkerError:
        raise InputError(f"{path}: Open CASCADE crashed as it read the file, which is damaged or too large; {_AGAIN}.") from None
    if not glb:
        raise InputError(f"{path}: Open CASCADE finds no body in it; {_AGAIN} as a solid body, in AP203, AP214 or AP242.")
    return read_glb(path, glb) * _TO_MM, _lengths(data)


def _tessellated(data):
    """GLB of the bytes of a STEP file; empty where Open CASCADE finds nothing in it."""
    import cascadio

    faulthandler.disable()     # a crash is one sentence of the caller
    with _quiet():
        return cascadio.load(data, tol_linear=_INSIDE * CHORD_MM, tol_angular=_ANGLE)


def _lengths(data):
    """Names of the units of length of a STEP file's representations, each once."""
    numbers = {number for context in _ASSIGNED.findall(data) for number in re.findall(rb"#(\d+)", context)}
    statements = dict(re.findall(rb"#(\d+)\s*=\s*([^;]*LENGTH_UNIT[^;]*);", data))
    return sorted({_length(statements[number]) for number in numbers if number in statements})


def _length(statement):
    if named := _CONVERTED.search(statement):
        return named[1].decode("utf-8", errors="replace").lower()
    metre = _SI_UNIT.search(statement)
    return _SI_PREFIX.get(metre[1], metre[1].decode().strip(".").lower() + "metre") if metre else "unknown"


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """A block in which Open CASCADE, which prints its own errors, writes nothing to the process' streams."""
    kept, nowhere = [os.dup(1), os.dup(2)], os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        for stream, target in zip(kept, (1, 2), strict=True):
            os.dup2(stream, target)
        for stream in (*kept, nowhere):
            os.close(stream)
