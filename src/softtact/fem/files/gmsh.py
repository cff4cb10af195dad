"""Files of Gmsh, msh 2.2 and 4.1, as text or binary: every physical group of every entity.

The layout is that of Gmsh's manual, "MSH file format". In msh 2.2 an element of two groups stands twice, once for each; here it is
one element of both. Where the file has no names, groups are called by their numbers.
"""

import re
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.fem.files.raw_mesh import Flags, RawMesh, dimension_of

# Number of Gmsh's element type: meshio's name, number of nodes, and where nodes differ in order, Gmsh's in that of VTK.
_HEX20 = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]
_WEDGE15 = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]
_KINDS: dict[int, tuple[str, int, list[int] | None]] = {
    15: ("vertex", 1, None), 1: ("line", 2, None), 8: ("line3", 3, None), 2: ("triangle", 3, None), 9: ("triangle6", 6, None),
    3: ("quad", 4, None), 16: ("quad8", 8, None), 10: ("quad9", 9, None), 4: ("tetra", 4, None),
    11: ("tetra10", 10, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]), 5: ("hexahedron", 8, None), 17: ("hexahedron20", 20, _HEX20),
    12: ("hexahedron27", 27, [*_HEX20, 22, 23, 21, 24, 20, 25, 26]), 6: ("wedge", 6, None), 18: ("wedge15", 15, _WEDGE15),
    13: ("wedge18", 18, [*_WEDGE15, 15, 17, 16]), 7: ("pyramid", 5, None), 19: ("pyramid13", 13, None), 14: ("pyramid14", 14, None)}
_Groups = dict[tuple[int, int], frozenset[int]]     # {(dimension, entity): numbers of its physical groups}


class _Content:
    """The sections of a file; numbers are taken one after the other from the section that is open."""

    def __init__(self, path: Path) -> None:
        self.path, self._data = path, path.read_bytes()
        self.binary = True
        if not self.open("MeshFormat"):
            raise self.refusal("it is no file of Gmsh (it has no $MeshFormat); give one in the format 4.1 or 2.2")
        line, _, rest = self._data[self._at:self._end].partition(b"\n")
        words = [word.decode("ascii", "replace") for word in line.split()]
        if len(words) != 3 or words[0] not in ("2.2", "4.1") or words[2] != "8":
            raise self.refusal(f"it is of the format {' '.join(words)[:30]!r}; save it as 4.1 or 2.2 (in Gmsh, "
                               "Mesh.MshFileVersion)")
        self.version, self.binary = words[0], words[1] != "0"
        self._order = ">" if rest[:4] == b"\x00\x00\x00\x01" else "<"

    def refusal(self, problem: str) -> InputError:
        """An error of this file."""
        return InputError(f"{self.path}: {problem}.")

    def open(self, section: str) -> bool:
        """Go to the beginning of a section; False where the file has none."""
        found = re.search(rb"(?:^|\n)\$" + section.encode() + rb"[ \t\r]*\n", self._data)
        if found is None:
            return False
        self._at, self._end = found.end(), self._data.find(f"$End{section}".encode(), found.end())
        if self._end < 0:
            raise self.refusal(f"its section ${section} does not end; is it cut off?")
        self.text = self._data[self._at:self._end]
        if not self.binary:
            self._words = self.text.split()
            self._at, self._end = 0, len(self._words)
        return True

    def ints(self, count: int) -> np.ndarray:
        """The next whole numbers of 4 bytes."""
        return self._take(count, "i4")

    def sizes(self, count: int) -> np.ndarray:
        """The next whole numbers of 8 bytes."""
        return self._take(count, "i8")

    def reals(self, count: int) -> np.ndarray:
        """The next numbers."""
        return self._take(count, "f8")

    def entries(self) -> int:
        """The number of entries on the first line of a section of msh 2.2."""
        line, _, _ = self.text.partition(b"\n")
        if not line.strip().isdigit():
            raise self.refusal("a section does not state its number of entries; save it again")
        self._at += len(line) + 1 if self.binary else 1
        return int(line)

    def rest(self) -> np.ndarray:
        """All whole numbers up to the end of a section of text."""
        return self.sizes(self._end - self._at)

    def _take(self, count, kind):
        width = np.dtype(kind).itemsize if self.binary else 1
        if not 0 <= int(count) * width <= self._end - self._at:
            raise self.refusal("it holds fewer numbers than it states; is it cut off?")
        start, self._at = self._at, self._at + int(count) * width
        if self.binary:
            return np.frombuffer(self._data, np.dtype(kind).newbyteorder(self._order), int(count), start).astype(kind)
        try:
            return np.array(self._words[start:self._at], dtype=kind)
        except (ValueError, OverflowError):
            raise self.refusal("words stand where numbers belong; save it again") from None

    def nodes(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The next numbers (n,) and places (n, 3) of nodes of msh 2.2."""
        if not self.binary:
            table = self.reals(4 * count).reshape(-1, 4)
            if not (np.abs(table[:, 0]) < 2**53).all():
                raise self.refusal("a node has no whole number; save it again")
            return table[:, 0].astype(np.int64), table[:, 1:]
        row = [("number", self._order + "i4"), ("place", self._order + "f8", 3)]
        table = np.frombuffer(self._take(28 * count, "u1").tobytes(), row)
        return table["number"].astype(np.int64), table["place"].astype(float)


def read_gmsh(path: Path) -> RawMesh:
    """The `RawMesh` of a file. Raises InputError for another version, a file that is cut off, and unknown kinds of elements."""
    content = _Content(path)
    if content.open("PartitionedEntities"):
        raise content.refusal("it is divided for several processors; save it without partitions")
    names = _names(content)
    numbers, points, found = _read_2(content) if content.version == "2.2" else _read_4(content)
    tables, copies = _joined(found)
    order = np.argsort(numbers, kind="stable")
    numbers = numbers[order]
    if (np.diff(numbers) == 0).any():
        raise content.refusal("two nodes have the same number; save it again")
    for kind, (nodes, of) in tables.items():
        at = np.searchsorted(numbers, nodes).clip(0, max(len(numbers) - 1, 0))
        missing = numbers[at] != nodes if len(numbers) else np.ones(nodes.shape, dtype=bool)
        if missing.any():
            raise content.refusal(f"an element has the node {nodes[missing][0]}, which is not in the file; save it again")
        tables[kind] = (order[at], of)
    raw = _with_groups(points, tables, names)
    used = {(dimension_of(kind), tag) for kind, (_, of) in tables.items() for tag in frozenset().union(*set(of))}
    if empty := [name for group, name in names.items() if group not in used]:
        raw.remarks.append(f"groups without elements: {', '.join(empty)} (in msh 2.2, Mesh.SaveAll writes elements without their "
                           "groups)")
    if copies:
        raw.remarks.append(f"{copies} elements or facets stand there again, without another group, and count once")
    return raw


def _names(content) -> dict[tuple[int, int], str]:
    """{(dimension, number): name} of the physical groups."""
    if not content.open("PhysicalNames"):
        return {}
    parts = content.text.decode("utf-8", "replace").split('"')
    found = {}
    for head, name in zip(parts[::2], parts[1::2], strict=False):
        words = head.split()[-2:]
        if len(words) < 2 or not all(word.lstrip("-").isdigit() for word in words):
            raise content.refusal("its names of physical groups are not readable; save it again")
        found[int(words[0]), int(words[1])] = name
    return found


def _kind(content, type_):
    if int(type_) not in _KINDS:
        raise content.refusal(f"it has elements of Gmsh's type {type_}, which are not taken; mesh with elements of the first or "
                              "second order")
    return _KINDS[int(type_)]


def _joined(found):
    """{kind: (nodes (e, m) in VTK's order, groups of each)} of pieces [(type, nodes, groups)], and the number of mere copies.

    Equal elements become one of all their groups.
    """
    tables: dict[int, tuple[list, list]] = {}
    for type_, nodes, of in found:
        table = tables.setdefault(int(type_), ([], []))
        table[0].append(np.asarray(nodes, dtype=np.int64))
        table[1].extend(of)
    out, copies = {}, 0
    for type_, (pieces, of) in tables.items():
        (kind, width, order), nodes = _KINDS[type_], np.concatenate(pieces)
        _, first, which = np.unique(np.sort(nodes, axis=1), axis=0, return_index=True, return_inverse=True)
        joined: dict[int, frozenset] = {}
        for at, groups in zip(first[which.ravel()].tolist(), of, strict=True):
            copies += at in joined and groups <= joined[at]
            joined[at] = joined.get(at, frozenset()) | groups
        out[kind] = (nodes[sorted(joined)][:, order or np.arange(width)], [joined[at] for at in sorted(joined)])
    return out, copies


def _read_2(content):
    """Node numbers, points and elements of msh 2.2."""
    if not content.open("Nodes"):
        raise content.refusal("it has no nodes")
    numbers, points = content.nodes(content.entries())
    if not content.open("Elements"):
        raise content.refusal("it has no elements")
    return numbers, points, (_binary_elements if content.binary else _elements)(content, content.entries())


def _elements(content, count):
    values, at, tables = content.rest().tolist(), 0, {}
    for _ in range(count):
        if at + 3 > len(values):
            raise content.refusal("it holds fewer numbers than it states; is it cut off?")
        type_, tags = values[at + 1:at + 3]
        start = at + 3 + tags
        at = start + _kind(content, type_)[1]
        if tags < 0 or at > len(values):
            raise content.refusal("it holds fewer numbers than it states; is it cut off?")
        nodes, of = tables.setdefault(type_, ([], []))
        nodes.append(values[start:at])
        of.append(_groups_of(values[start - tags:start]))
    return [(type_, nodes, of) for type_, (nodes, of) in tables.items()]


def _binary_elements(content, count):
    found = []
    while count > 0:
        type_, here, tags = content.ints(3).tolist()
        if here < 1 or tags < 0:
            raise content.refusal("its elements are not readable; save it again")
        rows = content.ints(here * (1 + tags + _kind(content, type_)[1])).reshape(here, -1)
        found.append((type_, rows[:, 1 + tags:], [_groups_of(row) for row in rows[:, 1:1 + tags].tolist()]))
        count -= here
    return found


def _groups_of(tags):
    """The physical group of an element of msh 2.2: its first tag, 0 where it has none."""
    return frozenset(tags[:1]) - {0}


def _read_4(content):
    """Node numbers, points and elements of msh 4.1."""
    groups = _entities(content)
    if not content.open("Nodes"):
        raise content.refusal("it has no nodes")
    numbers, points = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for _ in range(int(content.sizes(4)[0])):
        dimension, _, parametric = content.ints(3).tolist()
        count = int(content.sizes(1)[0])
        numbers.append(content.sizes(count))
        width = 3 + (dimension if parametric else 0)
        points.append(content.reals(count * width).reshape(-1, width)[:, :3])
    if not content.open("Elements"):
        raise content.refusal("it has no elements")
    found = []
    for _ in range(int(content.sizes(4)[0])):
        dimension, entity, type_ = content.ints(3).tolist()
        count, width = int(content.sizes(1)[0]), _kind(content, type_)[1]
        nodes = content.sizes(count * (1 + width)).reshape(-1, 1 + width)[:, 1:]
        found.append((type_, nodes, [groups.get((dimension, entity), frozenset())] * count))
    return np.concatenate(numbers), np.concatenate(points), found


def _entities(content) -> _Groups:
    if not content.open("Entities"):
        return {}
    found = {}
    for dimension, count in enumerate(content.sizes(4).tolist()):
        for _ in range(count):
            entity = int(content.ints(1)[0])
            content.reals(6 if dimension else 3)
            found[dimension, entity] = frozenset(np.abs(content.ints(content.sizes(1)[0])).tolist())
            if dimension:
                content.ints(content.sizes(1)[0])
    return found


def _with_groups(points, tables, names) -> RawMesh:
    """The mesh with its groups as regions and faces. Where some elements have a group and others none, the others are left out."""
    d = max((dimension_of(kind) for kind in tables), default=0)
    of_body, remarks = [of for kind, (_, of) in tables.items() if dimension_of(kind) == d], []
    without = sum(not groups for of in of_body for groups in of)
    if 0 < without < sum(map(len, of_body)):
        remarks.append(f"{without} elements that are in no physical group are left out")
        for kind, (nodes, of) in tables.items():
            if dimension_of(kind) == d:
                tables[kind] = (nodes[[bool(groups) for groups in of]], [groups for groups in of if groups])
    blocks = [(kind, nodes) for kind, (nodes, _) in tables.items()]
    return RawMesh(points, blocks, _sets(tables, d, names), _sets(tables, d - 1, names), numbered=not names, remarks=remarks)


def _sets(tables, dimension, names) -> dict[str, Flags]:
    """{name: flags of each kind's cells} of the groups of one dimension."""
    found: dict[str, Flags] = {}
    for k, (kind, (_, of)) in enumerate(tables.items()):
        if dimension_of(kind) != dimension:
            continue
        combinations = {groups: number for number, groups in enumerate(dict.fromkeys(of))}
        which = np.array([combinations[groups] for groups in of], dtype=np.int64)
        for tag in sorted(frozenset().union(*combinations)):
            none = [np.zeros(len(one), dtype=bool) for _, one in tables.values()]
            flags = found.setdefault(names.get((dimension, tag), str(tag)), none)
            flags[k] |= np.isin(which, [number for groups, number in combinations.items() if tag in groups])
    return found
