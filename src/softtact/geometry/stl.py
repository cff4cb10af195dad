"""STL files, binary and text: all facets that the file declares, or a refusal in one sentence.

Text: any number of solids, each from `solid` to `endsolid`, words in any case, separated by blanks or line ends. The facets'
normals are not read: the order of the corners defines the side. Layout: Burns, Automated Fabrication (1993), section 6.5.
"""

import re
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.mesh_text import is_finite, is_text, line_at, no_number, plain_text, shown
from softtact.inputs import check_limit

_HEADER = 84     # bytes: 80 of any text, 4 of the number of facets
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_BLANK = b" \t\r\n"     # may follow the last facet; zero bytes there mean that something was inserted before
_WORDS = [b"facet", b"normal", None, None, None, b"outer", b"loop", *3 * [b"vertex", float, float, float], b"endloop", b"endfacet"]
_NUMBERS = [k for k, expected in enumerate(_WORDS) if expected is float]
_PIECE = 1_000_000     # bytes of a text that are split into words at once
_SOLID = re.compile(rb"\s*solid(?!\S)[^\n]*")
_AGAIN = "export the mesh again."


def read_stl(path: Path, data: bytes) -> np.ndarray:
    """Facets (n, 3, 3) of an STL file in its unit; InputError where the file does not hold what it declares."""
    declared = int.from_bytes(data[80:_HEADER], "little")
    if len(data) != _HEADER + _FACET.itemsize * declared and is_text(data):
        return _read_text(path, plain_text(path, data).lower().rstrip())
    return _read_binary(path, data, declared)


def _read_binary(path, data, declared):
    end = _HEADER + _FACET.itemsize * declared
    if len(data) < end or data[end:].strip(_BLANK):
        fault = "was cut off" if len(data) < end else "holds more than it declares"
        raise InputError(f"{path}: as a binary STL it declares {declared} facets, which take {end} bytes, but has {len(data)}, "
                         f"so it {fault}; {_AGAIN}")
    check_limit(path, "facets", declared)
    return np.frombuffer(data, _FACET, count=declared, offset=_HEADER)["corners"].astype(float)


def _read_text(path, data):
    facets = [np.empty((0, 3, 3))]
    at = 0
    while at < len(data):
        solid = _SOLID.match(data, at)
        if solid is None:
            raise _unexpected(path, data, at, "solid")
        end = data.find(b"endsolid", solid.end())
        facets += _facets(path, data, solid.end(), len(data) if end < 0 else end)
        if end < 0:
            raise InputError(f"{path}: it ends without 'endsolid', so it was cut off; {_AGAIN}")
        at = data.find(b"\n", end) + 1 or len(data)
    return np.concatenate(facets)


def _facets(path, data, at, end):
    """Facets (k, 3, 3) between two bytes of a text, piece by piece."""
    while at < end:
        last = data.find(b"endfacet", min(at + _PIECE, end), end)
        piece_end = end if last < 0 else last + len(b"endfacet")
        words = data[at:piece_end].split()
        whole = len(words) % len(_WORDS) == 0 and all(
            set(words[k::len(_WORDS)]) <= {due} for k, due in enumerate(_WORDS) if isinstance(due, bytes))
        numbers = _numbers(words) if whole else None
        if numbers is None:
            raise _fault(path, data, at)
        yield numbers
        at = piece_end


def _numbers(words):
    """Corners (k, 3, 3) of facets in words; None where one is not a finite number."""
    columns = [words[k::len(_WORDS)] for k in _NUMBERS]
    try:
        corners = np.array([list(map(float, column)) for column in columns]).T.reshape(-1, 3, 3)
    except ValueError:
        return None
    strange = any(b"_" in b"".join(column) for column in columns)     # Python reads 1_0 as a number
    return None if strange or not np.isfinite(corners).all() else corners


def _fault(path, data, at):
    """The refusal of the first unexpected word of the facets from a byte on."""
    for number, word in enumerate(re.compile(rb"\S+").finditer(data, at)):
        due = _WORDS[number % len(_WORDS)]
        if word.end() == len(data) and word.group() != b"endsolid":
            break
        if due is float and not is_finite(word.group()):
            return no_number(path, line_at(data, word.start()), word.group())
        if isinstance(due, bytes) and word.group() != due:
            return _unexpected(path, data, word.start(), "facet' or 'endsolid" if due == b"facet" else due.decode())
    return InputError(f"{path}: it ends without 'endsolid', so it was cut off; {_AGAIN}")


def _unexpected(path, data, at, due):
    word = re.compile(rb"\S+").search(data, at)
    if word is None:
        return InputError(f"{path}: it holds no '{due}'; {_AGAIN}")
    return InputError(f"{path}: line {line_at(data, word.start())}: {shown(word.group())} stands where '{due}' is due; {_AGAIN}")
