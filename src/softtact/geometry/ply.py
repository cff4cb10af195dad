"""PLY files (Stanford), text and binary of either byte order: the vertices and polygonal faces, or one sentence why not.

The header declares elements with properties, and their number; the body must hold as many, and nothing else. Elements and
properties besides the vertices' `x`, `y`, `z` and the faces' `vertex_indices` are passed over. Refused: triangle strips.
Layout: Turk, The PLY Polygon File Format (1994).
"""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.mesh_text import plain_text, shown
from softtact.geometry.ply_body import Element, Property, Rows, binary_rows, text_rows
from softtact.geometry.polygons import Polygons, facets_of

_CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
          "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}     # of the bytes; none in a text
_COUNT = re.compile(r"[0-9]{1,18}")
_INDICES = ("vertex_indices", "vertex_index")


@dataclass
class _Header:
    """The order of bytes ('' of a text; None: not declared yet) and the elements."""

    order: str | None = None
    elements: list[Element] = field(default_factory=list)


def read_ply(path: Path) -> np.ndarray:
    """Triangles (n, 3, 3) of a PLY file in its own unit; InputError where the file does not hold what its header declares."""
    data = path.read_bytes()
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if first is None:
        raise InputError(f"{path}: its first line is not 'ply'; export the mesh again.")
    last = re.search(rb"[\r\n]end_header[ \t]*" + first.group(1), data)
    if last is None:
        raise InputError(f"{path}: its header does not end with 'end_header', so it was cut off; export the mesh again.")
    lines = plain_text(path, data[first.end():last.start()]).split(b"\n")
    header = _read_header(path, lines)
    indices = _indices_of(path, header)
    wanted = {"vertex": ("x", "y", "z"), "face": (indices,)}
    if header.order:
        rows = binary_rows(path, data, start=last.end(), order=header.order, elements=header.elements, wanted=wanted)
    else:
        body = plain_text(path, data[last.end():])
        rows = text_rows(path, body, first_line=len(lines) + 3, elements=header.elements, wanted=wanted)
    place = "face" if header.order else "line"
    return facets_of(path, _polygons(path, rows["vertex"], rows["face"], indices, place))


def _read_header(path, lines):
    header = _Header()
    for number, line in enumerate(lines, 2):
        words = line.decode("utf-8", errors="replace").split()
        if words and words[0] not in ("comment", "obj_info"):
            if not _take(header, words):
                raise InputError(f"{path}: line {number}: {shown(line)} is no line of a PLY header; export the mesh again.")
    if header.order is None:
        raise InputError(f"{path}: its header declares no format; export the mesh again.")
    header.elements = [element for element in header.elements if element.properties]     # others have no rows
    return header


def _take(header, words):
    """Take a line of the header; whether it is one."""
    match words:
        case ["format", form, "1.0"] if form in _ORDERS and header.order is None:
            header.order = _ORDERS[form]
        case ["element", name, count] if _COUNT.fullmatch(count) and name not in (e.name for e in header.elements):
            header.elements.append(Element(name, int(count), ()))
        case ["property", "list", length, kind, name] if _CODES.get(length, "f") not in "fd" and kind in _CODES and header.elements:
            return _add(header, Property(name, _CODES[kind], _CODES[length]))
        case ["property", kind, name] if kind in _CODES and header.elements:
            return _add(header, Property(name, _CODES[kind]))
        case _:
            return False
    return True


def _add(header, item):
    """Add a property to the last element; whether its name is new there."""
    element = header.elements[-1]
    header.elements[-1] = replace(element, properties=(*element.properties, item))
    return item.name not in (other.name for other in element.properties)


def _indices_of(path, header):
    """The name of the faces' list of vertices, after the header was found to declare vertices and faces."""
    elements = {element.name: element for element in header.elements}
    if "tristrips" in elements:
        raise InputError(f"{path}: it holds strips of triangles ('tristrips'), which are not read; export the mesh with faces.")
    if "vertex" not in elements or "face" not in elements:
        raise InputError(f"{path}: the file holds no triangles; export a surface mesh, not points or curves.")
    coordinates = [item.name for item in elements["vertex"].properties if item.name in ("x", "y", "z") and not item.length_code]
    if len(coordinates) != 3:
        raise InputError(f"{path}: its header does not declare x, y and z of each vertex; export the mesh again.")
    for item in elements["face"].properties:
        if item.name in _INDICES and item.length_code and item.code not in "fd":
            return item.name
    raise InputError(f"{path}: its header declares no list 'vertex_indices' of whole numbers for the faces; export the mesh again.")


def _polygons(path: Path, vertices: Rows, faces: Rows, indices: str, place: str) -> Polygons:
    """The faces as polygons, after their vertices were found to be finite, and each to have three corners."""
    points = np.column_stack([np.asarray(vertices.values[name], dtype=float) for name in "xyz"])
    wrong = ~np.isfinite(points).all(axis=1)
    if wrong.any():
        at = vertices.places[wrong.argmax()]
        raise InputError(f"{path}: {'vertex' if place == 'face' else place} {at}: the vertex has a coordinate that is no finite "
                         "number; export the mesh again.")
    counts = faces.counts[indices].astype(int)
    if (counts < 3).any():
        at = (counts < 3).argmax()
        raise InputError(f"{path}: {place} {faces.places[at]}: the face has {counts[at]} corners, and needs three; export the mesh "
                         "again.")
    return Polygons(points, faces.values[indices].astype(int), counts, faces.places, place)
