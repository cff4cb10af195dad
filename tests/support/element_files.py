"""Small files of elements as other programs write them: a block of 4 x 4 x 4 mm, whole or in parts."""

from itertools import pairwise

import numpy as np

BLOCK_MM3 = 64.0
TETRAHEDRA = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]     # of a hexahedron's corners
WEDGES = [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]
_EDGES = {"tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))}


def hexahedra(count=2, size=4.0, at=(0.0, 0.0, 0.0)):
    """Nodes (n, 3) and hexahedra (e, 8) of a cube of `count` elements along each edge."""
    line = np.linspace(0, size, count + 1)
    z, y, x = np.meshgrid(line, line, line, indexing="ij")
    number = np.arange((count + 1) ** 3).reshape(x.shape)
    low, high = np.s_[:-1], np.s_[1:]
    corners = [number[k, j, i].ravel() for k in (low, high) for j, i in ((low, low), (low, high), (high, high), (high, low))]
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]) + at, np.column_stack(corners)


def cut(hexes, pattern=TETRAHEDRA):
    """Tetrahedra, or wedges, in place of hexahedra."""
    return np.concatenate([hexes[:, corners][:, None] for corners in pattern], axis=1).reshape(-1, len(pattern[0]))


def block():
    """Nodes and tetrahedra of the block."""
    nodes, hexes = hexahedra()
    return nodes, cut(hexes)


def quadratic(nodes, tetrahedra):
    """Nodes and tetrahedra with nodes in the middles of their edges."""
    edges = np.sort(tetrahedra[:, _EDGES["tetra"]], axis=2)
    found, place = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    return np.vstack([nodes, nodes[found].mean(axis=1)]), np.hstack([tetrahedra, len(nodes) + place.reshape(-1, 6)])


def skin(nodes, tetrahedra):
    """Facets of the block on its top, its bottom, and its sides."""
    facets = tetrahedra[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]].reshape(-1, 3)
    _, first, uses = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    outer = facets[first[uses == 1]]
    z = nodes[outer].mean(axis=1)[:, 2]
    return outer[z > 3.99], outer[z < 0.01], outer[(z > 0.01) & (z < 3.99)]


def inp_nodes(nodes, first=1, head="*NODE"):
    """The nodes as a block of an Abaqus deck."""
    return f"{head}\n" + "".join(f"{k + first}, {x:g}, {y:g}, {z:g}\n" for k, (x, y, z) in enumerate(nodes))


def inp_elements(kind, cells, elset="", first=1):
    """Elements as a block of an Abaqus deck, numbered from `first`."""
    head = f"*ELEMENT, TYPE={kind}" + (f", ELSET={elset}" if elset else "")
    return f"{head}\n" + "".join(f"{k + first}, {', '.join(str(n + 1) for n in cell)}\n" for k, cell in enumerate(cells))


def inp_part(name, nodes, hexes, kind="C3D8", elset=None):
    """A part of hexahedra, in one set, by default called E and the part's name."""
    return f"*PART, NAME={name}\n{inp_nodes(nodes)}{inp_elements(kind, hexes, elset or f'E{name}')}*END PART\n"


def inp_assembly(instances, rest=""):
    """The assembly of instances {name: (part, rows of its place)}, and further keywords in it."""
    body = "".join(f"*INSTANCE, NAME={name}, PART={part}\n{place}*END INSTANCE\n" for name, (part, place) in instances.items())
    return f"*ASSEMBLY, NAME=WHOLE\n{body}{rest}*END ASSEMBLY\n"


def msh22(nodes, blocks, names=(), binary=False):
    """msh 2.2 of blocks [(Gmsh's type, group, entity, cells)] and names [(dimension, group, name)]."""
    parts = [b"$MeshFormat\n2.2 %d 8\n" % binary + (np.int32(1).tobytes() + b"\n" if binary else b"") + b"$EndMeshFormat\n"]
    parts.append(_names(names))
    table = np.zeros(len(nodes), dtype=[("number", "<i4"), ("place", "<f8", 3)])
    table["number"], table["place"] = np.arange(1, len(nodes) + 1), nodes
    rows = [[kind, 2, group, entity, *(n + 1 for n in cell)] for kind, group, entity, cells in blocks for cell in cells]
    if binary:
        table_rows = [[kind, 1, 2, k, *rest] for k, (kind, _, *rest) in enumerate(rows, start=1)]
        cells = b"".join(np.array(row, "<i4").tobytes() for row in table_rows)
        body = table.tobytes() + b"\n"
    else:
        cells = "".join(f"{k} {' '.join(map(str, row))}\n" for k, row in enumerate(rows, start=1)).encode()
        body = "".join(f"{k + 1} {x:g} {y:g} {z:g}\n" for k, (x, y, z) in enumerate(nodes)).encode()
    return b"".join([*parts, b"$Nodes\n%d\n" % len(nodes), body, b"$EndNodes\n$Elements\n%d\n" % len(rows), cells,
                     b"$EndElements\n"])


def _names(names):
    if not names:
        return b""
    rows = "".join(f'{dimension} {group} "{name}"\n' for dimension, group, name in names)
    return f"$PhysicalNames\n{len(names)}\n{rows}$EndPhysicalNames\n".encode()


def msh41(nodes, entities, names=(), binary=False):
    """msh 4.1 of entities [(dimension, number, groups, Gmsh's type, cells)]; all nodes are on the last one."""
    out = _Stream(binary)
    head = b"$MeshFormat\n4.1 %d 8\n" % binary + (np.int32(1).tobytes() + b"\n" if binary else b"") + b"$EndMeshFormat\n"
    out.sizes(*(sum(entity[0] == d for entity in entities) for d in range(4)))
    for _, number, groups, _, _ in sorted(entities, key=lambda entity: entity[0]):
        out.ints(number).reals(0, 0, 0, 4, 4, 4).sizes(len(groups)).ints(*groups).sizes(0)
    of_entities = out.section("Entities")
    total = len(nodes)
    out.sizes(1, total, 1, total).ints(*entities[-1][:2], 0).sizes(total, *range(1, total + 1)).reals(*np.ravel(nodes))
    of_nodes = out.section("Nodes")
    starts = np.cumsum([0, *(len(entity[4]) for entity in entities)])
    out.sizes(len(entities), starts[-1], 1, starts[-1])
    for (dimension, number, _, kind, cells), (first, last) in zip(entities, pairwise(starts), strict=True):
        out.ints(dimension, number, kind).sizes(last - first)
        out.sizes(*np.column_stack([np.arange(first, last) + 1, np.asarray(cells) + 1]).ravel())
    return b"".join([head, _names(names), of_entities, of_nodes, out.section("Elements")])


class _Stream:
    """Numbers of a section, as text or binary."""

    def __init__(self, binary):
        self.binary, self.content = binary, []

    def _add(self, values, kind):
        words = [f"{value:g}" if kind == "<f8" else str(int(value)) for value in values]
        self.content.append(np.array(values, kind).tobytes() if self.binary else " ".join(words).encode() + b"\n")
        return self

    def ints(self, *values):
        return self._add(values, "<i4")

    def sizes(self, *values):
        return self._add(values, "<u8")

    def reals(self, *values):
        return self._add(values, "<f8")

    def section(self, name):
        body, self.content = b"".join(self.content), []
        return f"${name}\n".encode() + body + (b"\n" if self.binary else b"") + f"$End{name}\n".encode()
