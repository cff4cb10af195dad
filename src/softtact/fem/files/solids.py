"""Meshes of solids in files: VTU with regions and faces by name, and files of elements of other programs.

In softtact's VTU files each region is a cell array `region:NAME`, each face a cell array `face:NAME`: 1 on the cells that belong to
it, 0 on the others. The facets of faces are additional cells. `geometry:KIND` holds the thickness in mm.
In other formats regions and faces are the named sets (Abaqus) or the physical groups (Gmsh), or the numbers of materials. Cells of
the highest dimension are elements, those of one dimension less name faces. Linear elements are converted to quadratic ones.
Faces can also be defined by rules such as `z<0.1` or `x>-3 & x<3 & z>2` for the centres of the outer facets in mm.
"""

import base64
import re
import struct
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from softtact.checksums import check
from softtact.errors import InputError, MeshWarning
from softtact.fem.files.abaqus import read_abaqus
from softtact.fem.files.by_meshio import FACE, GEOMETRY, REGION, read_other
from softtact.fem.files.checks import refuse_faulty, remarks_on_pieces
from softtact.fem.files.gmsh import read_gmsh
from softtact.fem.files.raw_mesh import FACET_CORNERS, RawMesh, corners_of
from softtact.fem.quadratic_nodes import QUADRATIC, raised
from softtact.fem.solid_mesh import ELEMENTS, SolidMesh, thickness_of
from softtact.files import atomic_path
from softtact.geometry.meshes import UNIT_MM
from softtact.inputs import check_input, check_limit

_PACKED = re.compile(rb"<VTKFile[^>]* compressor=[^>]*>")
_INLINE = re.compile(rb'<DataArray[^>]* format="binary"[^>]*>\s*([\w+/]{16,32})')
_APPENDED = re.compile(rb'<DataArray[^>]* offset="(\d{1,15})"')
_SIGNS = {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}     # beside &, < and >
_TURNED_WEDGE = [3, 4, 5, 0, 1, 2]
_FARTHEST_MM = 1e6
_FLAT = 1e-6     # of its size: how far the nodes of a plane mesh may lie apart along z
_TERM = re.compile(r"\s*([xyz])\s*([<>])\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


def write_mesh(mesh: SolidMesh, path: str | Path, point_data: Mapping[str, np.ndarray] | None = None) -> None:
    """Write a mesh as VTU with its named regions and faces; `read_mesh_file` reads it.

    point_data {name: (n,) or (n, k)}: nodal fields
    """
    import meshio

    facets, of_face = _all_facets(mesh)
    blocks = [(kind, nodes[:, ELEMENTS[kind].vtk_order]) for _, kind, nodes in mesh.cells] + list(facets.items())
    elements = len(mesh.cells)
    flags = {REGION + name: [np.full(len(nodes), int(k < elements and mesh.cells[k][0] == name), np.int8)
                              for k, (_, nodes) in enumerate(blocks)] for name in mesh.regions}
    flags |= {FACE + name: [of_face[name][kind] if k >= elements and kind in of_face[name] else np.zeros(len(nodes), np.int8)
                             for k, (kind, nodes) in enumerate(blocks)] for name in mesh.faces}
    flags[GEOMETRY + mesh.geometry] = [np.full(len(nodes), mesh.thickness_mm) for _, nodes in blocks]
    fields, flags = _escaped(point_data or {}), _escaped(flags)
    with atomic_path(path) as temporary:
        meshio.Mesh(mesh.points, blocks, point_data=fields, cell_data=flags).write(temporary, file_format="vtu")


def _escaped(fields):
    """The fields with names that are attributes of XML, which meshio writes as they are."""
    return {escape(name, _SIGNS): values for name, values in fields.items()}


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


def read_mesh_file(path: str | Path, *, unit: str | None = None, geometry: str | None = None,
                   thickness_mm: float | None = None, faces: Mapping[str, str] | None = None,
                   regions: Sequence[str] | None = None) -> SolidMesh:
    """The `SolidMesh` of a file: VTU written by `write_mesh`, or another format (Gmsh, Abaqus, VTK, MED, ...).

    unit: mm, cm, m, inch or in; required except for files of softtact, which are in mm
    geometry, thickness_mm: plane_strain or axisymmetric, for a mesh in a plane z = const. whose file does not state it; 1 mm
    faces {name: rule}: further faces, see `face_rule`;  regions: the file's element sets or groups that are regions, if it has
        other sets too

    Warns (MeshWarning) of what is left out of the file of another program, and of pieces that are not joined.
    Raises InputError that names the file and the problem: unreadable file, unsupported element type, mixed linear and
    quadratic elements, inverted or repeated elements, neighbours whose faces do not match, an element in no region or in two, a
    facet of a face inside the body, a unit, a geometry or a thickness that is not that of the file.
    """
    body = read_body(path, unit=unit, geometry=geometry, thickness_mm=thickness_mm, faces=faces, regions=regions)
    for remark in body.remarks if not body.in_mm else ():
        warnings.warn(f"{path}: {remark}.", MeshWarning, stacklevel=2)
    return body.mesh


@dataclass(frozen=True)
class BodyInFile:
    """What was read of a file of elements."""

    mesh: SolidMesh
    pieces: int
    """Parts that share no node with each other."""
    remarks: list[str]
    """What was left out, and pieces that touch or overlap, in sentences without a full stop."""
    in_mm: bool
    """Whether softtact wrote the file."""


def read_body(path: str | Path, *, unit: str | None = None, geometry: str | None = None,
              thickness_mm: float | None = None, faces: Mapping[str, str] | None = None,
              regions: Sequence[str] | None = None) -> BodyInFile:
    """As `read_mesh_file`, with what there is to say about the file in place of warnings."""
    path = Path(path)
    raw = _read(path)
    if unit is not None and unit not in UNIT_MM or unit is None and not raw.in_mm:
        stated = "no unit is stated, and the file has none" if unit is None else f"the unit {unit!r} is not known"
        raise InputError(f"{path}: {stated}; state one of {', '.join(UNIT_MM)}.")
    if raw.in_mm and unit is not None and UNIT_MM[unit] != 1.0:
        raise InputError(f"{path}: the unit is given as {unit}, and softtact wrote the file in mm; leave the unit out.")
    raw.points = raw.points * UNIT_MM[unit or "mm"]
    d = max(raw.dimensions, default=0)
    if d < 2:
        raise InputError(f"{path}: it holds no elements such as tetrahedra, hexahedra or triangles; mesh the body.")
    elements = [k for k, (_, nodes) in enumerate(raw.blocks) if raw.dimensions[k] == d and len(nodes)]
    _refuse_strange_nodes(path, raw, elements)
    cells = [raw.blocks[k] for k in elements]
    named = _region_names(path, raw, regions)
    of_elements = [_regions_of(path, raw, {name: raw.regions[name][k] for name in named}, k) for k in elements]
    points, cells, number = _quadratic(path, raw.points, cells)
    kind, thickness = _geometry(path, raw, geometry, thickness_mm, d, points[np.concatenate([one.ravel() for _, one in cells])])
    points = points if d == 3 else points * [1.0, 1.0, 0.0]
    parts = tuple((name, type_, nodes[region == name]) for (type_, nodes), region in zip(cells, of_elements, strict=True)
                  for name in dict.fromkeys(region))
    try:
        mesh = SolidMesh(points, parts, geometry=kind, thickness_mm=thickness)
    except InputError as error:     # the message does not name the file
        raise InputError(f"{path}: {error}") from None
    refuse_faulty(path, mesh)
    named_faces, remarks = _faces(path, raw, mesh, number, d)
    mesh = SolidMesh(points, parts, named_faces, kind, thickness)
    pieces, of_pieces = remarks_on_pieces(mesh)
    left_out = _left_out(raw, d, [name for name in raw.regions if named and name not in named])
    return BodyInFile(with_named_faces(mesh, faces or {}), pieces, [*raw.remarks, *left_out, *remarks, *of_pieces], raw.in_mm)


def _read(path: Path) -> RawMesh:
    """A file in the reader of its format."""
    check_mesh_file(path)
    if path.suffix.lower() == ".inp":
        return read_abaqus(path)
    with path.open("rb") as file:
        of_gmsh = re.search(rb"^\$MeshFormat", file.read(4000), re.MULTILINE) is not None     # below comments, too
    return read_gmsh(path) if of_gmsh else read_other(path)


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


def _refuse_strange_nodes(path, raw, elements):
    """Refuse elements with nodes that the file does not have, or at places that are no numbers."""
    for k, (_, nodes) in enumerate(raw.blocks):
        if len(nodes) and (nodes.min() < 0 or nodes.max() >= len(raw.points)):
            raise InputError(f"{path}: an element has a node that is not in the file; save it again.")
        if k in elements and not (np.abs(raw.points[nodes]) < _FARTHEST_MM).all():
            raise InputError(f"{path}: a node of an element has a coordinate that is not a finite number below {_FARTHEST_MM:g} "
                             "mm; correct it, or the unit.")


def _region_names(path, raw, wanted):
    """The sets that are regions: those in `wanted`, those that the file states, or else all sets with elements."""
    known = [name for name, flags in raw.regions.items() if any(one.any() for one in flags)]
    if unknown := [name for name in wanted or () if name not in known]:
        raise InputError(f"{path}: it has no set or group of elements {unknown[0]!r}; it has {', '.join(known) or 'none'}.")
    if wanted or raw.default_regions:
        return list(wanted or raw.default_regions)
    return [] if raw.numbered and len(known) == 1 else known      # one number for all elements distinguishes nothing


def _regions_of(path, raw, sets, k):
    """Names (e,) of a block's elements; `body` where the file names no region."""
    nodes = raw.blocks[k][1]
    if not sets:
        return np.full(len(nodes), "body", dtype=object)
    out, uses = np.full(len(nodes), "", dtype=object), np.zeros(len(nodes), dtype=int)
    for name, flags in sets.items():
        out[flags], uses = name, uses + flags
    if (uses != 1).any():
        first = int((uses != 1).argmax())
        found = "in no region" if uses[first] == 0 else f"in {uses[first]} regions"
        x, y, z = raw.points[nodes[first]].mean(axis=0)
        raise InputError(f"{path}: element {first} is {found}, of the sets {', '.join(sets)} (it is at {x:.4g}, {y:.4g}, {z:.4g} "
                         "mm); name those sets that are the regions (--region), each element in one of them.")
    return out


def _faces(path, raw, mesh, number, d):
    """The named faces, and remarks on those that are not on the body."""
    named, remarks = {}, []
    facets = [k for k, dimension in enumerate(raw.dimensions) if dimension == d - 1]
    outer = {tuple(sorted(row)) for kind, nodes in mesh.boundary.items() for row in nodes[:, :FACET_CORNERS[kind]].tolist()}
    wanted = {name: [raw.blocks[k][1][flags[k]][:, :corners_of(raw.blocks[k][0])] for k in facets if flags[k].any()]
              for name, flags in raw.faces.items()}
    for name in dict.fromkeys([*wanted, *raw.sides]):
        corners = [one for one in [*wanted.get(name, []), *raw.sides.get(name, [])] if len(one)]
        if not corners:
            continue
        known = [number[one] for one in corners]
        if all((one < 0).any(axis=1).all() for one in known):
            remarks.append(f"the face {name} is left out, because it is not on the body")
        elif not (inner := {tuple(sorted(row)) for block in known for row in block.tolist()} - outer):
            named[name] = _face(mesh, known)
        elif raw.numbered or not any(tuple(sorted(row)) in outer for block in known for row in block.tolist()):
            remarks.append(f"the face {name} is left out, because {len(inner)} of its facets are inside the body")
        else:
            at = [row for one, old in zip(known, corners, strict=True) for row, places in zip(old, one, strict=True)
                  if tuple(sorted(places.tolist())) in inner]
            x, y, z = raw.points[at[0]].mean(axis=0)
            raise InputError(f"{path}: {len(inner)} facets of the face {name!r} are not on the outside of the body (one at "
                             f"{x:.4g}, {y:.4g}, {z:.4g} mm); name outer facets only.")
    return named, remarks


def _face(mesh, corners):
    """The facets of the mesh's boundary that have these corners [(f, k)]."""
    wanted = {tuple(sorted(row)) for block in corners for row in block.tolist()}
    found = {}
    for kind, nodes in mesh.boundary.items():
        here = [tuple(sorted(row)) in wanted for row in nodes[:, :FACET_CORNERS[kind]].tolist()]
        if any(here):
            found[kind] = nodes[here]
    return found


def _left_out(raw, d, sets):
    """Remarks on cells that are neither elements nor facets of a face, and on sets that are no regions."""
    counts: dict[str, int] = {}
    for k, (_, nodes) in enumerate(raw.blocks):
        below = d - raw.dimensions[k]
        if below == 0 or raw.in_mm:
            continue
        used = np.any([flags[k] for flags in raw.faces.values() if below == 1] or [np.zeros(len(nodes), bool)], axis=0)
        if count := int(np.count_nonzero(~used)):
            name = "facets" if below == 1 else ("points", "lines")[raw.dimensions[k]]
            counts[name] = counts.get(name, 0) + count
    cells = [f"cells in no face and of no body are left out: {', '.join(f'{count} {name}' for name, count in counts.items())}"]
    return (cells if counts else []) + ([f"sets that are no regions: {', '.join(sets)} (--region names others)"] if sets else [])


def _quadratic(path, points, cells):
    """Points, [(kind, nodes in softtact's order)] of quadratic elements, and the new number (n,) of each point of the file, -1 of
    those that no element has.
    """
    kinds = {kind for kind, _ in cells}
    if kinds <= ELEMENTS.keys():
        back = {kind: np.argsort(ELEMENTS[kind].vtk_order) for kind in kinds}
        used = np.unique(np.concatenate([nodes.ravel() for _, nodes in cells]))
        number = np.full(len(points), -1)
        number[used] = used
        return points, [(kind, nodes[:, back[kind]]) for kind, nodes in cells], number
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


def _geometry(path, raw, geometry, thickness_mm, d, points) -> tuple[str, float]:
    """Geometry and thickness in mm of a mesh with its elements' nodes at points (n, 3), by the file and by the stated ones."""
    stated = "solid" if d == 3 else raw.geometry if raw.thickness_mm is not None else None
    if stated and geometry not in (None, stated):
        raise InputError(f"{path}: the geometry is given as {geometry}, and that of the file is {stated}; leave it out.")
    if stated == "plane_strain" and thickness_mm not in (None, raw.thickness_mm):
        raise InputError(f"{path}: the thickness is given as {thickness_mm:g} mm, and that of the file is {raw.thickness_mm:g} mm; "
                         "leave it out.")
    kind = stated or _plane_geometry(path, raw, geometry, points)
    try:
        thickness = thickness_of(kind, thickness_mm)
    except InputError as error:     # the message does not name the file
        raise InputError(f"{path}: {error}") from None
    return kind, raw.thickness_mm if stated == "plane_strain" else thickness


def _plane_geometry(path, raw, geometry, points):
    """plane_strain or axisymmetric, as stated, or by the names of the elements."""
    if np.ptp(points[:, 2]) > _FLAT * np.ptp(points, axis=0).max():
        raise InputError(f"{path}: it holds a surface in space and no solid elements; mesh the body inside it, for example with "
                         "`softtact mesh`.")
    if geometry not in ("plane_strain", "axisymmetric"):
        if geometry is None and raw.geometry:
            return raw.geometry
        raise InputError(f"{path}: it is a plane mesh; state its geometry, plane_strain or axisymmetric.")
    if raw.geometry not in (None, geometry):
        raw.remarks.append(f"its elements are called {raw.geometry}, and are taken as {geometry}")
    return geometry


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
