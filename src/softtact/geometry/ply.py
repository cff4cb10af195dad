"""PLY files, text and binary: vertices and polygonal faces, or a refusal in one sentence.

The header declares elements with properties, and their number; the body must hold as many, and nothing else. Elements and
properties besides the vertices' `x`, `y`, `z` and the faces' `vertex_indices` are ignored. Refused: triangle strips.
Layout: Turk, The PLY Polygon File Format (1994).
"""

import re
import struct
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.mesh_text import line_at, plain_text, shown
from softtact.geometry.polygons import Polygons, facets_of
from softtact.inputs import check_limit

_CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
          "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}     # of the bytes; none in a text
_COUNT = re.compile(r"[0-9]{1,18}")
_INDICES = ("vertex_indices", "vertex_index")
_AGAIN = "export the mesh again."


@dataclass(frozen=True)
class Property:
    """A property of an element: the code of its type in `struct`, and that of a list's length ('' of a single value)."""

    name: str
    code: str
    length_code: str = ""


@dataclass(frozen=True)
class Element:
    """An element of the header with the number of its rows."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass
class _Header:
    """The order of bytes ('' of a text; None: not declared yet) and the elements."""

    order: str | None = None
    elements: list[Element] = field(default_factory=list)


@dataclass(frozen=True)
class Rows:
    """Contents of the rows of an element.

    values : {property: its values of all rows, concatenated}
    counts : {list: number of its values in each row}
    places : the number of each row: its line in a text, its number from 0 in a binary file
    """

    values: Mapping[str, np.ndarray]
    counts: Mapping[str, np.ndarray]
    places: np.ndarray


def read_ply(path: Path, data: bytes) -> np.ndarray:
    """Triangles (n, 3, 3) of a PLY file in its unit; InputError where it does not hold what its header declares."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if first is None:
        raise InputError(f"{path}: its first line is not 'ply'; {_AGAIN}")
    last = re.search(rb"[\r\n]end_header[ \t]*" + first.group(1), data)
    if last is None:
        raise InputError(f"{path}: its header does not end with 'end_header', so it was cut off; {_AGAIN}")
    lines = plain_text(path, data[first.end():last.start()]).split(b"\n")
    header = _read_header(path, lines)
    indices = _indices_of(path, header)
    check_limit(path, "facets", sum(element.count for element in header.elements if element.name == "face"))
    body: _Text | _Binary = _Binary(path, data, last.end(), header.order) if header.order else _Text(
        path, plain_text(path, data[last.end():]), len(lines) + 3)
    wanted = {"vertex": ("x", "y", "z"), "face": (indices,)}
    rows = {element.name: body.rows(element, wanted.get(element.name, ())) for element in header.elements}
    body.refuse_more()
    return facets_of(path, _polygons(path, rows["vertex"], rows["face"], indices, body.place))


def _read_header(path, lines):
    header = _Header()
    for number, line in enumerate(lines, 2):
        words = line.decode("utf-8", errors="replace").split()
        if words and words[0] not in ("comment", "obj_info") and not _read_line(header, words):
            raise InputError(f"{path}: line {number}: {shown(line)} is no line of a PLY header; {_AGAIN}")
    if header.order is None:
        raise InputError(f"{path}: its header declares no format; {_AGAIN}")
    header.elements = [element for element in header.elements if element.properties]     # others have no rows
    return header


def _read_line(header, words):
    """Read a line of the header; return whether it is valid."""
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
    """Add a property to the last element; return whether its name is new there."""
    element = header.elements[-1]
    header.elements[-1] = replace(element, properties=(*element.properties, item))
    return item.name not in (other.name for other in element.properties)


def _indices_of(path, header):
    """The name of the faces' list of vertices, after a check that the header declares vertices and faces."""
    elements = {element.name: element for element in header.elements}
    if "tristrips" in elements:
        raise InputError(f"{path}: it holds strips of triangles ('tristrips'), which are not read; export the mesh with faces.")
    if "vertex" not in elements or "face" not in elements:
        raise InputError(f"{path}: the file holds no triangles; export a surface mesh, not points or curves.")
    coordinates = [item.name for item in elements["vertex"].properties if item.name in ("x", "y", "z") and not item.length_code]
    if len(coordinates) != 3:
        raise InputError(f"{path}: its header does not declare x, y and z of each vertex; {_AGAIN}")
    for item in elements["face"].properties:
        if item.name in _INDICES and item.length_code and item.code not in "fd":
            return item.name
    raise InputError(f"{path}: its header declares no list 'vertex_indices' of whole numbers for the faces; {_AGAIN}")


class _Body:
    """The rows of the elements, one after the other; a subclass finds the numbers of the next row."""

    def rows(self, element: Element, wanted: tuple[str, ...]) -> Rows:
        """The wanted properties of all rows of the next element."""
        kept = {item.name: array("d" if item.code in "fd" else "q") for item in element.properties if item.name in wanted}
        counts = {item.name: array("q") for item in element.properties if item.name in kept and item.length_code}
        places = array("q")
        for number in range(element.count):
            places.append(self._row(element, number, kept, counts))
        return Rows({name: np.array(column) for name, column in kept.items()},
                    {name: np.array(column) for name, column in counts.items()}, np.array(places))

    def _row(self, element, number, kept, counts):
        """Append the wanted numbers of a row to their columns; return its place."""
        raise NotImplementedError

    def _cut_off(self, element, number):
        return InputError(f"{self.path}: its header declares {element.count} rows of '{element.name}', and the file ends or is "
                          f"damaged after {number} of them; {_AGAIN}")


class _Text(_Body):
    """Rows that are lines of words, the first of them `first_line` of the file."""

    place = "line"

    def __init__(self, path: Path, data: bytes, first_line: int) -> None:
        if b"_" in data:     # Python reads 1_0 as a number
            line = first_line - 1 + line_at(data, data.index(b"_"))
            raise InputError(f"{path}: line {line}: a number contains '_'; {_AGAIN}")
        self.path = path
        self.lines = ((number, words) for number, text in enumerate(data.split(b"\n"), first_line) if (words := text.split()))

    def _row(self, element, number, kept, counts):
        line, words = next(self.lines, (0, []))
        if not words:
            raise self._cut_off(element, number)
        try:
            end = _read_words(element, words, kept, counts)
        except (ValueError, OverflowError, IndexError):
            end = -1
        if end != len(words):
            raise InputError(f"{self.path}: line {line}: {shown(b' '.join(words))} is no row of '{element.name}' as the header "
                             f"declares it; {_AGAIN}")
        return line

    def refuse_more(self) -> None:
        """Refuse lines after the last row."""
        for line, words in self.lines:
            raise InputError(f"{self.path}: line {line}: {shown(b' '.join(words))} follows the last row that the header declares; "
                             f"{_AGAIN}")


def _read_words(element, words, kept, counts):
    """Append the wanted numbers of a row's words; return the number of words of the row."""
    at = 0
    for item in element.properties:
        length = 1
        if item.length_code:
            length = int(words[at])
            at += 1
            if length < 0:
                raise ValueError
        if item.name in kept:
            column = kept[item.name]
            column.extend(map(float if column.typecode == "d" else int, words[at:at + length]))
            if item.length_code:
                counts[item.name].append(length)
        at += length
    return at


class _Binary(_Body):
    """Rows of bytes from `at` on, in the order '<' or '>'."""

    place = "face"

    def __init__(self, path: Path, data: bytes, at: int, order: str) -> None:
        self.path, self.data, self.at, self.order = path, data, at, order

    def rows(self, element: Element, wanted: tuple[str, ...]) -> Rows:
        """The wanted properties of all rows of the next element; read at once where each row has the layout of the first."""
        start = self.at
        layout = self._first_layout(element)
        end = start + element.count * layout.itemsize
        self.at = start
        if element.count == 0 or layout.itemsize == 0 or end > len(self.data):
            return super().rows(element, wanted)
        table = np.frombuffer(self.data, layout, count=element.count, offset=start)
        lengths = {item.name: table[f"length of {item.name}"] for item in element.properties if item.length_code}
        if any((length != length[0]).any() for length in lengths.values()):
            return super().rows(element, wanted)
        self.at = end
        return Rows({name: table[name].ravel() for name in wanted}, {name: lengths[name] for name in wanted if name in lengths},
                    np.arange(element.count))

    def _first_layout(self, element):
        """Data type of the element's first row; without fields where the file ends within it."""
        fields = []
        try:
            for item in element.properties:
                length = 1
                if item.length_code:
                    length, = self._numbers(item.length_code, 1)
                    fields.append((f"length of {item.name}", f"{self.order}{item.length_code}"))
                self._numbers(item.code, length)
                fields.append((item.name, f"{self.order}{item.code}", (length,)))
        except struct.error:
            return np.dtype([])
        return np.dtype(fields)

    def _row(self, element, number, kept, counts):
        for item in element.properties:
            try:
                length = self._numbers(item.length_code, 1)[0] if item.length_code else 1
                values = self._numbers(item.code, length)
            except struct.error:     # fewer bytes are left, or the length is negative
                raise self._cut_off(element, number) from None
            if item.name in kept:
                kept[item.name].extend(values)
                if item.length_code:
                    counts[item.name].append(length)
        return number

    def _numbers(self, code, count):
        """The next `count` numbers of a type."""
        if count > len(self.data) - self.at:     # before struct allocates memory for them
            raise struct.error
        layout, at = f"{self.order}{count}{code}", self.at
        self.at += struct.calcsize(layout)
        return struct.unpack_from(layout, self.data, at)

    def refuse_more(self) -> None:
        """Refuse bytes after the last row."""
        if self.data[self.at:].strip(b" \t\r\n"):
            raise InputError(f"{self.path}: the rows that its header declares end at byte {self.at}, but the file has "
                             f"{len(self.data)}; {_AGAIN}")


def _polygons(path: Path, vertices: Rows, faces: Rows, indices: str, place: str) -> Polygons:
    """The faces as polygons, after a check that vertices are finite and faces have three corners."""
    points = np.column_stack([np.asarray(vertices.values[name], dtype=float) for name in "xyz"])
    wrong = ~np.isfinite(points).all(axis=1)
    if wrong.any():
        at = vertices.places[wrong.argmax()]
        raise InputError(f"{path}: {'vertex' if place == 'face' else place} {at}: the vertex has a coordinate that is no finite "
                         f"number; {_AGAIN}")
    counts = faces.counts[indices].astype(int)
    if (counts < 3).any():
        at = (counts < 3).argmax()
        raise InputError(f"{path}: {place} {faces.places[at]}: the face has {counts[at]} corners, and needs three; {_AGAIN}")
    return Polygons(points, faces.values[indices].astype(int), counts, faces.places, place)
