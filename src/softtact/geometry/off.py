"""OFF files (Object File Format of Geomview): points and polygons of text, or a refusal in one sentence.

Read: headers with colours, normals or texture coordinates (`COFF`, `NOFF`, `STOFF`, ...), which are passed over, counts on the
header's line or the next, comments. Refused: points of other than three coordinates, and binary files.
"""

import re
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.mesh_text import is_finite, no_number, plain_text, shown
from softtact.geometry.polygons import Polygons, facets_of
from softtact.inputs import check_limit

_HEADER = re.compile(rb"(?:ST)?C?N?OFF")
_AGAIN = "export the mesh again."


def read_off(path: Path, data: bytes) -> np.ndarray:
    """Triangles (n, 3, 3) of an OFF file in its unit; InputError names the line that is refused."""
    lines = [(number, words) for number, line in enumerate(plain_text(path, data).split(b"\n"), start=1)
             if (words := line.partition(b"#")[0].split())]
    lines = _after_header(path, lines)
    points, faces = _counts(path, *lines[0])
    rows = lines[1:]
    if len(rows) != points + faces:
        raise InputError(f"{path}: it declares {points} points and {faces} faces, and has {len(rows)} lines of them; {_AGAIN}")
    corners = [_face(path, number, words) for number, words in rows[points:]]
    return facets_of(path, Polygons(np.array([_point(path, *row) for row in rows[:points]]).reshape(-1, 3),
                                    np.array([corner for face in corners for corner in face], dtype=int),
                                    np.array([len(face) for face in corners], dtype=int),
                                    np.array([number for number, _ in rows[points:]], dtype=int)))


def _after_header(path, lines):
    """The lines from that of the counts on."""
    number, (word, *rest) = lines[0] if lines else (1, [b""])
    if not _HEADER.fullmatch(word) or rest[:1] == [b"BINARY"]:
        fault = "it is binary" if rest[:1] == [b"BINARY"] else f"line {number}: {shown(word)} stands where 'OFF' is due"
        raise InputError(f"{path}: {fault}; export the mesh as an OFF file of text, or as STL.")
    return ([(number, rest)] if rest else []) + lines[1:] or [(number, rest)]


def _counts(path, number, words):
    if len(words) not in (2, 3) or not all(re.fullmatch(rb"\d{1,12}", word) for word in words):
        raise InputError(f"{path}: line {number}: the numbers of points, faces and edges are due; {_AGAIN}")
    points, faces = int(words[0]), int(words[1])
    check_limit(path, "facets", faces)
    return points, faces


def _point(path, number, words):
    if len(words) < 3:
        raise InputError(f"{path}: line {number}: a point has three coordinates, not {len(words)}; {_AGAIN}")
    for word in words[:3]:
        if not is_finite(word):
            raise no_number(path, number, word)
    return [float(word) for word in words[:3]]


def _face(path, number, words):
    count = int(words[0]) if re.fullmatch(rb"\d{1,6}", words[0]) else 0
    corners = words[1:1 + count]
    if count < 3 or len(corners) < count or not all(re.fullmatch(rb"\d{1,12}", word) for word in corners):
        raise InputError(f"{path}: line {number}: a face is the number of its corners, three or more, and their points; {_AGAIN}")
    return [int(word) for word in corners]
