"""Prisms over polygons, whose volume and area follow from the polygon, written as mesh files in many dialects."""

import struct
from dataclasses import dataclass

import numpy as np
from manifold3d import CrossSection

U_SHAPE = [(0, 0), (30, 0), (30, 20), (20, 20), (20, 6), (10, 6), (10, 20), (0, 20)]
SQUARE = [(0, 0), (20, 0), (20, 20), (0, 20)]
_CODES = {"uchar": "B", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d"}


@dataclass(frozen=True)
class Body:
    """Points (n, 3) in mm, polygons as lists of their numbers, triangles (k, 3, 3) of the same surface, volume and area."""

    points: np.ndarray
    polygons: list
    triangles: np.ndarray
    volume: float
    area: float


def prism(polygon, height, *, start=0, turn=None, at=(0.0, 0.0, 0.0)):
    """Prism over a simple polygon, counter-clockwise: two n-gons that begin with the corner `start`, and a quadrilateral a side."""
    turn = np.eye(3) if turn is None else turn
    corners, n = np.asarray(polygon, float), len(polygon)
    ring = [(start + k) % n for k in range(n)]
    points = np.concatenate([np.column_stack([corners, np.full(n, z)]) for z in (0.0, height)]) @ turn.T + at
    sides = [[k, (k + 1) % n, (k + 1) % n + n, k + n] for k in range(n)]
    solid = CrossSection([corners]).extrude(height).to_mesh64()
    triangles = (solid.vert_properties[:, :3] @ turn.T + at)[solid.tri_verts]
    following = np.roll(corners, -1, axis=0)
    base = 0.5 * np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
    around = np.linalg.norm(following - corners, axis=1).sum()
    return Body(points, [ring[::-1], [k + n for k in ring], *sides], triangles, base * height, 2 * base + around * height)


def obj_file(bodies, *, indices="absolute", corner="{}", gap=" ", indent="", end="\n", number="%.9g", upper=False, continued=False,
             comments=False, extras=False, tail=""):
    """OBJ; indices: 'absolute', 'relative' (each body behind its vertices) or 'interleaved' (each polygon behind its own)."""
    lines, known = ["vt 0 0", "vn 0 0 1"], 0
    for body_number, body in enumerate(bodies):
        lines += [f"o body {body_number}", "g left right", "s off", "usemtl a/b"] if extras else []
        groups = [(body.points[face], [list(range(len(face)))]) for face in body.polygons]
        for points, faces in groups if indices == "interleaved" else [(body.points, body.polygons)]:
            lines += ["v " + " ".join(number % c for c in point) + tail for point in points]
            first = known + 1 if indices == "absolute" else -len(points)
            lines += ["f " + " ".join(corner.format(first + k) for k in face) for face in faces]
            known += len(points)
    lines += ["l 1 2 3", "p 1"] if extras else []
    lines = [f"{line} # as made" for line in ["", *lines]] if comments else lines
    lines = [line.upper() if upper and line[:2] in ("v ", "f ") else line for line in lines]
    lines = [line.replace(" ", " \\\n", 2) if continued and line.startswith("f ") and "#" not in line else line for line in lines]
    return "".join(f"{indent}{line}\n" for line in lines).replace(" ", gap).replace("\n", end).encode()


def ply_file(bodies, *, form="ascii", coordinate="float", length="uchar", index="int", extras=False, edges="none", end="\n"):
    """PLY in one of the three forms; edges: an element of that name 'before' or 'after' the faces."""
    points = np.concatenate([body.points for body in bodies])
    firsts = np.cumsum([0, *(len(body.points) for body in bodies)])
    faces = [[first + k for k in face] for first, body in zip(firsts, bodies, strict=False) for face in body.polygons]
    vertex = [("extra", "uchar", None)] * extras + [(name, coordinate, None) for name in "xyz"] + [("nx", "float", None)] * extras
    face = [("flags", "uchar", None)] * extras + [("vertex_indices", index, length)] + [("texcoord", "float", "uchar")] * extras
    rows = {"vertex": (vertex, [[[7]] * extras + [[c] for c in point] + [[0.5]] * extras for point in points.tolist()]),
            "face": (face, [[[1]] * extras + [row] + [[0.0, 0.5]] * extras for row in faces]),
            "edge": ([("vertex1", "int", None), ("vertex2", "int", None)], [[[0], [1]]])}
    order = {"none": ("vertex", "face"), "before": ("edge", "vertex", "face"), "after": ("vertex", "face", "edge")}[edges]
    head = ["ply", f"format {form} 1.0", "comment made for a test, element face 3", "obj_info none"]
    for name in order:
        head += [f"element {name} {len(rows[name][1])}"]
        head += [f"property list {n} {kind} {item}" if n else f"property {kind} {item}" for item, kind, n in rows[name][0]]
    body = b"".join(_ply_row(rows[name][0], row, form, end) for name in order for row in rows[name][1])
    return "".join(f"{line}{end}" for line in [*head, "end_header"]).encode() + body


def _ply_row(items, row, form, end):
    if form == "ascii":
        return (" ".join(f"{len(values)} " * bool(n) + " ".join(f"{value:.9g}" for value in values)
                         for (_, _, n), values in zip(items, row, strict=True)) + end).encode()
    order = "<" if "little" in form else ">"
    parts = [(struct.pack(order + _CODES[n], len(values)) if n else b"") +
             struct.pack(f"{order}{len(values)}{_CODES[kind]}", *values)
             for (_, kind, n), values in zip(items, row, strict=True)]
    return b"".join(parts)


def text_stl(bodies, *, name="part", normal="0 0 0", indent="  ", gap=" ", end="\n", number="%.9g", case=str, tail=""):
    """Text STL with one solid a body; case: a function of the whole text, as `str.upper`."""
    lines = []
    for body in bodies:
        lines += [f"solid {name}"]
        for facet in body.triangles:
            lines += [f"facet normal {normal}", f"{indent}outer loop"]
            lines += [indent + "vertex " + " ".join(number % c for c in point) for point in facet] + ["endloop", "endfacet"]
        lines += [f"endsolid {name}"]
    return case("".join(f"{line}\n" for line in lines) + tail).replace(" ", gap).replace("\n", end).encode()


def binary_stl(bodies, *, header=b"", count=None, tail=b""):
    """Binary STL of all bodies; count: what the header declares, where that is not their number."""
    facets = np.concatenate([body.triangles for body in bodies])
    rows = b"".join(struct.pack("<12fH", *np.zeros(3), *facet.ravel(), 0) for facet in facets)
    return header.ljust(80)[:80] + struct.pack("<I", len(facets) if count is None else count) + rows + tail
