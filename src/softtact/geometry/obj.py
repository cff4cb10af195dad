r"""OBJ files (Wavefront): vertices and polygonal faces, or a refusal in one sentence.

Numbers of corners count from 1, or back from the last vertex before the face (-1). Texture and normal numbers, colours, groups,
materials, lines and points are ignored, as they do not change a body. Refused: free-form surfaces, calls of other files,
statements that are not part of the format. Appendix B1, Object Files, of Wavefront's Advanced Visualizer manual (1990).
"""

import re
from array import array
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.mesh_text import is_finite, no_number, plain_text, shown
from softtact.geometry.polygons import Polygons, facets_of

_IGNORED = frozenset(b"vt vn vp g o s mg usemtl mtllib usemap maplib shadow_obj trace_obj lod bevel c_interp d_interp".split())
_FREE_FORM = frozenset(b"cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con bzp bsp cdc cdp res ctech "
                       b"stech".split())
_CALLS = frozenset((b"call", b"csh"))
_AGAIN = "export the mesh again."
# Consecutive lines of plain vertices or faces, most of a large file, are read at once, which is ten times as fast.
_VERTICES = re.compile(rb"(?:[ \t]*+v(?:[ \t]++[-+.\deE]++){3}[ \t]*+\n){1,20000}+")
_FACES = re.compile(rb"(?:[ \t]*+f(?:[ \t]++\d{1,18}+(?:/\d*+){0,2}+){3,}+[ \t]*+\n){1,20000}+")


def read_obj(path: Path, data: bytes) -> np.ndarray:
    """Triangles (n, 3, 3) of an OBJ file in its unit; InputError names the line that is refused."""
    data = plain_text(path, data) + b"\n"
    if b"#" in data:
        data = re.sub(rb"#[^\n]*", b"", data)
    if data.rstrip().endswith(b"\\"):
        raise InputError(f"{path}: its last line continues in a next one, so the file was cut off; {_AGAIN}")
    if b"\\" in data:
        data = re.sub(rb"(?:[^\n]*\\\n)+[^\n]*", _joined, data)
    statements = _Statements(path)
    at = 0
    while at < len(data):
        at = statements.read(data, at)
    return facets_of(path, statements.polygons())


def _joined(lines):
    """Lines continued by a backslash as one line, followed by empty lines that keep the line numbers."""
    return lines.group().replace(b"\\\n", b" ") + b"\n" * lines.group().count(b"\\\n")


class _Statements:
    """The declarations of a file's statements."""

    def __init__(self, path):
        self.path, self.line = path, 1
        self.points, self.point_lines = array("d"), array("q")
        self.corners, self.counts, self.face_lines = array("q"), array("q"), array("q")
        self.points_at_last_element = 0

    def read(self, data, at):
        """Read the statements at a byte of the text; return the byte after them."""
        if run := _VERTICES.match(data, at):
            return self._plain_vertices(run)
        if run := _FACES.match(data, at):
            return self._plain_faces(run)
        return self._statement(data, at)

    def _plain_vertices(self, run):
        """Read lines `v x y z`."""
        words = run.group().replace(b"v", b" ").split()
        try:
            values = list(map(float, words))
        except ValueError:
            number = next(k for k, word in enumerate(words) if not is_finite(word))
            raise no_number(self.path, self.line + number // 3, words[number]) from None
        self.points.extend(values)
        self.point_lines.extend(range(self.line, self.line + len(values) // 3))
        self.line += len(values) // 3
        return run.end()

    def _plain_faces(self, run):
        """Read lines `f 1 2 3`, with numbers from 1, which may be followed by those of textures and normals."""
        text = run.group()
        if b"/" in text:
            text = re.sub(rb"/\S*", b"", text)
        numbers = np.array(list(map(int, text.replace(b"f", b"-1").split())))     # -1 begins a face
        begins = np.flatnonzero(numbers == -1)
        self.corners.extend(numbers[numbers != -1].tolist())
        self.counts.extend((np.diff(begins, append=len(numbers)) - 1).tolist())
        self.face_lines.extend(range(self.line, self.line + len(begins)))
        self.line += len(begins)
        self.points_at_last_element = len(self.point_lines)
        return run.end()

    def _statement(self, data, at):
        """Read one line of any kind."""
        end = data.index(b"\n", at)
        words = data[at:end].split()
        kind = words[0].lower() if words else b"g"
        if kind == b"v":
            self._vertex(words[1:])
        elif kind in (b"f", b"fo"):
            self._face(words[1:])
        elif kind in (b"l", b"p"):
            self.points_at_last_element = len(self.point_lines)
        elif kind not in _IGNORED:
            raise self._no_statement(words[0])
        self.line += 1
        return end + 1

    def _vertex(self, words):
        if len(words) not in (3, 4, 6, 7):
            raise self._refusal(f"a vertex has three coordinates, alone or with a weight or a colour of three or four, not "
                                f"{len(words)} numbers; {_AGAIN}")
        numbers = words[:3] if len(words) > 4 else words
        for word in numbers:
            if not is_finite(word):
                raise no_number(self.path, self.line, word)
        x, y, z, *weight = map(float, numbers)
        if weight and weight[0] != 1:
            raise self._refusal(f"the vertex has the weight {weight[0]:g}, which only free-form surfaces have; export the mesh as "
                                "polygons.")
        self.points.extend((x, y, z))
        self.point_lines.append(self.line)

    def _face(self, words):
        if len(words) < 3:
            raise self._refusal(f"the face has {len(words)} corners, and needs three; {_AGAIN}")
        self.corners.extend(map(self._number, words))
        self.counts.append(len(words))
        self.face_lines.append(self.line)
        self.points_at_last_element = len(self.point_lines)

    def _number(self, word):
        """The number from 1 of the vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`."""
        known = len(self.point_lines)
        if not re.fullmatch(rb"[-+]?\d{1,18}(/[-+]?\d*){0,2}", word):
            raise self._refusal(f"{shown(word)} is not the number of a vertex; {_AGAIN}")
        number = int(word.partition(b"/")[0])
        if number == 0 or number < -known:
            begin = "vertices are counted from 1" if number == 0 else f"only {known} vertices come before it"
            raise self._refusal(f"a corner is vertex {number}, but {begin}; {_AGAIN}")
        return number if number > 0 else known + 1 + number

    def _no_statement(self, word):
        if word.lower() in _FREE_FORM:
            return self._refusal(f"{shown(word)} belongs to free-form curves and surfaces, which are not read; export the mesh as "
                                 "polygons.")
        if word.lower() in _CALLS:
            return self._refusal(f"{shown(word)} calls another file or program; put the whole mesh into one file.")
        return self._refusal(f"{shown(word)} is not a statement of OBJ files; {_AGAIN}")

    def _refusal(self, what, line=None):
        return InputError(f"{self.path}: line {line or self.line}: {what}")

    def polygons(self):
        """The faces, after a check of the vertices that they use."""
        points = np.array(self.points).reshape(-1, 3)
        wrong = ~np.isfinite(points).all(axis=1)
        if wrong.any():
            raise self._refusal(f"the vertex has a coordinate that is no finite number; {_AGAIN}",
                                self.point_lines[int(wrong.argmax())])
        polygons = Polygons(points, np.array(self.corners, dtype=int) - 1, np.array(self.counts, dtype=int),
                            np.array(self.face_lines, dtype=int), first=1)
        self._refuse_unused(polygons)
        return polygons

    def _refuse_unused(self, polygons):
        """Refuse vertices without faces where that means that faces were lost."""
        used = np.zeros(len(polygons.points), dtype=bool)
        used[polygons.corners[polygons.corners < len(used)]] = True
        if len(polygons.counts) == 0 or used.all():
            return
        last = self.points_at_last_element
        if last < len(used) and not used[last:].any():
            raise self._refusal(f"no face uses the {len(used) - last} vertices from here on, so the file was cut off; {_AGAIN}",
                                self.point_lines[last])
        faces = [tuple(sorted(face)) for face in np.split(polygons.corners, np.cumsum(polygons.counts)[:-1])]
        twice = len(faces) - len(set(faces))
        if twice:
            raise InputError(f"{self.path}: {twice} faces are repeated, and no face uses {(~used).sum()} of the vertices, so "
                             "each body probably counts its vertices from 1; export the bodies as one mesh.")
