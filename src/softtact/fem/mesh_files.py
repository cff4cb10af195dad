"""Meshes of solids in files: VTU with regions and faces by name, and any mesh format that meshio reads.

In softtact's VTU files each region is a cell array `region:NAME`, each face a cell array `face:NAME`: 1 on the cells that belong to
it, 0 on the others. The facets of faces are additional cells. `geometry:KIND` holds the thickness in mm.
In other formats regions and faces are the named cell sets (Abaqus) or the physical groups (Gmsh). Cells of the highest dimension
are elements, those of one dimension less name faces. Linear elements are converted to quadratic ones.
Faces can also be defined by rules such as `z<0.1` or `x>-3 & x<3 & z>2` for the centres of the outer facets in mm.
"""

import base64
import contextlib
import io
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.checksums import check
from softtact.errors import InputError
from softtact.fem.quadratic_nodes import QUADRATIC, raised
from softtact.fem.solid_mesh import ELEMENTS, FACETS, SolidMesh
from softtact.files import atomic_path
from softtact.geometry.meshes import UNIT_MM
from softtact.inputs import check_input, check_limit

if TYPE_CHECKING:
    import meshio

_REGION, _FACE, _GEOMETRY = "region:", "face:", "geometry:"
_FACET_CORNERS = {"line": 2, "triangle": 3, "quad": 4} | {kind: element.corners for kind, element in FACETS.items()}
_DIMENSION = {"line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3}
_PACKED = re.compile(rb"<VTKFile[^>]* compressor=[^>]*>")
_INLINE = re.compile(rb'<DataArray[^>]* format="binary"[^>]*>\s*([\w+/]{16,32})')
_APPENDED = re.compile(rb'<DataArray[^>]* offset="(\d{1,15})"')
_TURNED_WEDGE = [3, 4, 5, 0, 1, 2]
_EMPTY = ("meshio", "gmsh:", "medit", "avsucd")     # beginnings of names that programs give by themselves
_TERM = re.compile(r"\s*([xyz])\s*([<>])\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


def write_mesh(mesh: SolidMesh, path: str | Path, point_data: Mapping[str, np.ndarray] | None = None) -> None:
    """Write a mesh as VTU with its named regions and faces; `read_mesh_file` reads it.

    point_data {name: (n,) or (n, k)}: nodal fields
    """
    import meshio

    facets, of_face = _all_facets(mesh)
    blocks = [(kind, nodes[:, ELEMENTS[kind].vtk_order]) for _, kind, nodes in mesh.cells] + list(facets.items())
    elements = len(mesh.cells)
    flags = {_REGION + name: [np.full(len(nodes), int(k < elements and mesh.cells[k][0] == name), np.int8)
                              for k, (_, nodes) in enumerate(blocks)] for name in mesh.regions}
    flags |= {_FACE + name: [of_face[name][kind] if k >= elements and kind in of_face[name] else np.zeros(len(nodes), np.int8)
                             for k, (kind, nodes) in enumerate(blocks)] for name in mesh.faces}
    flags[_GEOMETRY + mesh.geometry] = [np.full(len(nodes), mesh.thickness_mm) for _, nodes in blocks]
    with atomic_path(path) as temporary:
        meshio.Mesh(mesh.points, blocks, point_data=dict(point_data or {}), cell_data=flags).write(temporary, file_format="vtu")


def _all_facets(mesh):
    """{kind: facets (f, k)} of all faces, each once, and which {face: {kind: (f,)}} belong to a face."""
    kinds = dict.fromkeys(kind for face in mesh.faces.values() for kind in face)
    facets, place = {}, {}
    for kind in kinds:
        repeated = np.concatenate([face[kind] for face in mesh.faces.values() if kind in face])
        facets[kind] = np.unique(repeated, axis=0)
        place[kind] = {tuple(row): k for k, row in enumerate(facets[kind].tolist())}
    flags = {}
    for name, face in mesh.faces.items():
        flags[name] = {}
        for kind, nodes in face.items():
            flags[name][kind] = np.zeros(len(facets[kind]), np.int8)
            flags[name][kind][[place[kind][tuple(row)] for row in nodes.tolist()]] = 1
    return facets, flags


def read_mesh_file(path: str | Path, *, unit: str | None = None, geometry: str | None = None, thickness_mm: float = 1.0,
                   faces: Mapping[str, str] | None = None, regions: Sequence[str] | None = None) -> SolidMesh:
    """The `SolidMesh` of a file: VTU written by `write_mesh`, or any format that meshio reads (Gmsh, Abaqus, VTK, MED, ...).

    unit: mm, cm, m, inch or in; required except for files of softtact, which are in mm
    geometry, thickness_mm: plane_strain or axisymmetric, for a mesh in the plane z = 0 whose file does not state it
    faces {name: rule}: further faces, see `face_rule`;  regions: the file's element sets or groups that are regions, if it has
        other sets too

    Raises InputError that names the file and the problem: unreadable file, unsupported element type, mixed linear and
    quadratic elements, inverted elements, an element in no region or in two, a facet of a face inside the body.
    """
    path = Path(path)
    read = _read(path)
    of_softtact = any(name.startswith(_REGION) for name in read.cell_data)
    if unit is not None and unit not in UNIT_MM or unit is None and not of_softtact:
        stated = "no unit is stated, and the file has none" if unit is None else f"the unit {unit!r} is not known"
        raise InputError(f"{path}: {stated}; state one of {', '.join(UNIT_MM)}.")
    dimensions = [_dimension(block.type) for block in read.cells]
    d = max(dimensions, default=0)
    if d < 2:
        raise InputError(f"{path}: it holds no elements such as tetrahedra, hexahedra or triangles; mesh the body.")
    points = np.zeros((len(read.points), 3))
    points[:, :read.points.shape[1]] = read.points * UNIT_MM[unit or "mm"]
    sets = _sets(read)
    elements = [k for k, dimension in enumerate(dimensions) if dimension == d]
    cells = [(read.cells[k].type, np.asarray(read.cells[k].data, dtype=np.int64)) for k in elements]
    named = _region_names(path, sets, elements, regions)
    of_elements = [_regions_of(path, {name: sets[name][k] for name in named}, len(nodes))
                   for k, (_, nodes) in zip(elements, cells, strict=True)]
    points, cells, number = _quadratic(path, points, cells)
    kind, thickness = _geometry(path, read, geometry, thickness_mm, d, points)
    parts = tuple((name, type_, nodes[region == name]) for (type_, nodes), region in zip(cells, of_elements, strict=True)
                  for name in dict.fromkeys(region))
    mesh = SolidMesh(points, parts, geometry=kind, thickness_mm=thickness)
    _refuse_inverted(path, mesh)
    facets = [(k, np.asarray(read.cells[k].data)) for k, dimension in enumerate(dimensions) if dimension == d - 1]
    corners_of = {name: [number[nodes[flags[k]][:, :_FACET_CORNERS[read.cells[k].type]]] for k, nodes in facets if flags[k].any()]
                  for name, flags in sets.items()}
    named_faces = {name: _face(path, mesh, name, corners) for name, corners in corners_of.items() if corners}
    mesh = SolidMesh(points, parts, named_faces, kind, thickness)
    return with_named_faces(mesh, faces or {})


def _read(path: Path) -> "meshio.Mesh":
    import meshio

    check_mesh_file(path)
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):     # meshio prints errors itself
            return meshio.read(path)
    except (Exception, SystemExit) as error:     # meshio's readers fail in many ways, and end the program for an unknown format
        known = "give VTU, or another volume mesh that meshio reads, such as Gmsh or Abaqus"
        problem = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: not readable as a mesh of elements ({problem}); {known}.") from None


def check_mesh_file(path: str | Path) -> None:
    """Refuse a file of elements that is missing, too large (packed arrays as large as they unpack) or damaged since it was written.

    A file without a checksum passes without a word: other programs write such files, too.
    """
    check_input(path, "mesh", missing="there is no such mesh file.")
    check(path)
    if Path(path).suffix.lower() == ".vtu":
        check_limit(path, "mesh", _unpacked_bytes(Path(path).read_bytes()))


def _unpacked_bytes(content):
    """Bytes of all packed arrays of a VTU file as their headers state them: number, size and last size of their blocks."""
    kind = _PACKED.search(content)
    if kind is None:
        return len(content)
    form = "<" if b'"LittleEndian"' in kind[0] else ">"
    form += "3Q" if b'"UInt64"' in kind[0] else "3I"
    size, first = struct.calcsize(form), content.find(b"_", content.find(b"<AppendedData")) + 1
    heads = [base64.b64decode(found[1][:size * 4 // 3]) for found in _INLINE.finditer(content)]
    heads += [content[first + int(found[1]):][:size] for found in _APPENDED.finditer(content)]
    blocks = (struct.unpack(form, head) for head in heads if len(head) == size)
    return sum(number * full if last == 0 else (number - 1) * full + last for number, full, last in blocks)


def _dimension(kind):
    return _DIMENSION.get(kind.rstrip("0123456789"), 0)


def _sets(read) -> dict[str, list[np.ndarray]]:
    """{name: flags (e,) of each block's cells that belong to it} for regions and faces."""
    lengths = [len(block.data) for block in read.cells]
    found: dict[str, list[np.ndarray]] = {}
    for name, arrays in read.cell_data.items():
        if name.startswith((_REGION, _FACE)):
            found[name.partition(":")[2]] = [np.asarray(values).ravel() > 0 for values in arrays]
    for name, members in read.cell_sets.items():
        if not name.startswith(_EMPTY):
            found[name] = [_flags(numbers, count) for numbers, count in zip(members, lengths, strict=True)]
    tags = read.cell_data.get("gmsh:physical")
    for name, (tag, dimension) in (read.field_data.items() if tags else ()):
        found[name] = [(np.asarray(values) == tag) & (_dimension(block.type) == dimension)
                       for values, block in zip(tags, read.cells, strict=True)]
    return found


def _flags(members, count):
    out = np.zeros(count, dtype=bool)
    if members is not None and len(members):
        out[np.asarray(members, dtype=np.int64)] = True
    return out


def _region_names(path, sets, elements, wanted):
    """The sets that are regions: those in `wanted`, or else all sets with elements."""
    known = [name for name, flags in sets.items() if any(flags[k].any() for k in elements)]
    if unknown := [name for name in wanted or () if name not in known]:
        raise InputError(f"{path}: it has no set or group of elements {unknown[0]!r}; it has {', '.join(known) or 'none'}.")
    return list(wanted or known)


def _regions_of(path, sets, count):
    """Names (e,) of a block's elements; `body` where the file names no region."""
    if not sets:
        return np.full(count, "body", dtype=object)
    out, uses = np.full(count, "", dtype=object), np.zeros(count, dtype=int)
    for name, flags in sets.items():
        out[flags], uses = name, uses + flags
    if (uses != 1).any():
        first = int((uses != 1).argmax())
        found = "in no region" if uses[first] == 0 else f"in {uses[first]} regions"
        raise InputError(f"{path}: element {first} is {found}, of the sets {', '.join(sets)}; name those sets that are the "
                         "regions, each element in one of them.")
    return out


def _quadratic(path, points, cells):
    """Points, [(kind, nodes in softtact's order)] of quadratic elements, and the new number (n,) of each point of the file."""
    kinds = {kind for kind, _ in cells}
    if kinds <= ELEMENTS.keys():
        back = {kind: np.argsort(ELEMENTS[kind].vtk_order) for kind in kinds}
        return points, [(kind, nodes[:, back[kind]]) for kind, nodes in cells], np.arange(len(points))
    if not kinds <= QUADRATIC.keys():
        odd = sorted(kinds - ELEMENTS.keys() - QUADRATIC.keys()) or sorted(kinds)
        refusal = "does not take" if kinds - ELEMENTS.keys() - QUADRATIC.keys() else "does not mix"
        raise InputError(f"{path}: it has elements {', '.join(odd)}, which softtact {refusal}; mesh the body with all linear or "
                         f"all quadratic ones of {', '.join([*QUADRATIC, *ELEMENTS])}.")
    turned = [(kind, _upright(points, nodes) if kind == "wedge" else nodes) for kind, nodes in cells]
    new, nodes, number = raised(points, turned)
    return new, [(QUADRATIC[kind].meshio_name, one) for (kind, _), one in zip(turned, nodes, strict=True)], number


def _upright(points, wedges):
    """Wedges (e, 6) whose first triangle has its normal towards the second one; the order differs between file formats."""
    a, b, c, top = (points[wedges[:, k]] for k in range(4))
    below = np.einsum("ei,ei->e", np.cross(b - a, c - a), top - a) < 0
    return np.where(below[:, None], wedges[:, _TURNED_WEDGE], wedges)


def _geometry(path, read, geometry, thickness_mm, d, points) -> tuple[str, float]:
    stated: dict[str, Any] = {name.removeprefix(_GEOMETRY): arrays for name, arrays in read.cell_data.items()
                            if name.startswith(_GEOMETRY)}
    if stated:
        kind, arrays = next(iter(stated.items()))
        return kind, float(np.concatenate([np.ravel(values) for values in arrays])[0])
    if d == 3:
        return "solid", 1.0
    if np.ptp(points[:, 2]) > 0:
        raise InputError(f"{path}: it holds a surface in space and no solid elements; mesh the body inside it, for example with "
                         "`softtact mesh`.")
    if geometry not in ("plane_strain", "axisymmetric"):
        raise InputError(f"{path}: it is a plane mesh; state its geometry, plane_strain or axisymmetric.")
    return geometry, thickness_mm


def _refuse_inverted(path, mesh):
    """Refuse elements whose Jacobian is not positive at all points of quadrature."""
    for region, element, nodes in mesh.parts():
        d = element.nodes.shape[1]
        slopes = element.shape(element.quadrature.points)[1]
        jacobian = np.einsum("emi,gmj->egij", mesh.points[nodes][..., :d], slopes, optimize=True)
        inverted = np.flatnonzero(np.linalg.det(jacobian).min(axis=1) <= 0)
        if len(inverted):
            x, y, z = mesh.points[nodes[inverted[0]]].mean(axis=0)
            raise InputError(f"{path}: {len(inverted)} of {len(nodes)} elements of the region {region!r} are inverted (the first "
                             f"is number {inverted[0]}, at {x:.4g}, {y:.4g}, {z:.4g} mm); reverse the order of their nodes, "
                             "or mesh the body again.")


def _face(path, mesh, name, corners):
    """The facets of the mesh's boundary that have these corners [(f, k)]."""
    wanted = {tuple(sorted(row)) for block in corners for row in block.tolist()}
    found, known = {}, set()
    for kind, nodes in mesh.boundary.items():
        keys = [tuple(sorted(row)) for row in nodes[:, :_FACET_CORNERS[kind]].tolist()]
        if (here := np.array([key in wanted for key in keys])).any():
            found[kind] = nodes[here]
        known.update(keys)
    if missing := wanted - known:
        x, y, z = mesh.points[list(next(iter(missing)))].mean(axis=0) if min(next(iter(missing))) >= 0 else (np.nan,) * 3
        raise InputError(f"{path}: {len(missing)} facets of the face {name!r} are not on the outside of the body (one at {x:.4g}, "
                         f"{y:.4g}, {z:.4g} mm); name outer facets only.")
    return found


def face_rule(text: str) -> Callable[[np.ndarray], np.ndarray]:
    """A function of facet centres (f, 3) in mm that returns which (f,) satisfy a rule: comparisons of x, y or z with numbers in mm.

    Raises InputError that shows the form of a rule.
    """
    terms = [_TERM.fullmatch(part) for part in text.split("&")]
    if not all(terms):
        raise InputError(f"The rule {text!r} of a face is not understood; write comparisons in mm such as 'z<0.1' or 'x>-3 & x<3'.")
    limits = [("xyz".index(term[1]), -1.0 if term[2] == "<" else 1.0, float(term[3])) for term in terms if term]
    return lambda middles: np.all([sign * (middles[:, axis] - value) > 0 for axis, sign, value in limits], axis=0)


def with_named_faces(mesh: SolidMesh, rules: Mapping[str, str]) -> SolidMesh:
    """The mesh with faces {name: rule}. Raises InputError where a rule is not understood or a face would be empty."""
    return mesh.with_faces(**{name: face_rule(text) for name, text in rules.items()})
