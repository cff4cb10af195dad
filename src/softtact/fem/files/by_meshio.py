"""Files of other formats, read by meshio: VTU with regions and faces of softtact, VTK, MED, Medit, Nastran, TetGen and others.

meshio leaves out some cells with a word on stderr or without one. Cells that it does not know are refused here by name, and so are
files of which it read fewer cells than they state.
"""

import contextlib
import io
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.fem.files.raw_mesh import Flags, RawMesh, dimension_of
from softtact.inputs import in_one_sentence

if TYPE_CHECKING:
    import meshio

REGION, FACE, GEOMETRY = "region:", "face:", "geometry:"     # beginnings of the names of cell arrays in softtact's VTU files
_BY_MESHIO = ("meshio", "gmsh:", "medit", "avsucd")     # beginnings of names of sets that it gives by itself
# Cell arrays with a material's number, by the letters and digits of their names.
_NUMBERS = {"gmshphysical", "meditref", "nastranref", "tetgenref", "avsucdmaterial", "netgenindex", "ugridref", "su2tag",
            "materialids", "materialid", "material", "materials", "matid", "matids", "mat", "region", "regions", "regionid",
            "regionids", "part", "partid", "partids", "elementblockids", "cellentityids", "entityids", "physical", "subdomain",
            "subdomains", "blockid", "block"}
_VTK_NAMES = {2: "poly vertex", 4: "poly line", 6: "triangle strip", 7: "polygon", 11: "voxel", 41: "convex point set",
              42: "polyhedron"}
# Cells of VTK by meshio's name and number of nodes, that are those of another kind.
_SAME = {"VTK_LAGRANGE_CURVE2": "line", "VTK_LAGRANGE_CURVE3": "line3", "VTK_LAGRANGE_TRIANGLE3": "triangle",
         "VTK_LAGRANGE_TRIANGLE6": "triangle6", "VTK_LAGRANGE_QUADRILATERAL4": "quad", "VTK_LAGRANGE_QUADRILATERAL9": "quad9",
         "VTK_LAGRANGE_TETRAHEDRON4": "tetra", "VTK_LAGRANGE_TETRAHEDRON10": "tetra10", "VTK_LAGRANGE_HEXAHEDRON8": "hexahedron",
         "VTK_LAGRANGE_WEDGE6": "wedge"}
_UNHANDLED = {"pixel", "wedge15", *(f"vtk_{order}_{shape}" for order in ("lagrange", "bezier") for shape in (
    "curve", "triangle", "quadrilateral", "tetrahedron", "hexahedron", "wedge", "pyramid"))}
_DROPPED = re.compile(r"cannot handle \(type (\d+)\)|doesn't know \w*(?:Tetra|Hexa|Prism|Pyramid|Triangles|Quadri)\w* type")
_NASTRAN = (".bdf", ".nas", ".fem")
_LONG = re.compile(rb"^(SCALARS \S+ |\w+ \d+ \d+ )long\b", re.MULTILINE)
_NOT_READ = re.compile(r"^[ \t]*(INCLUDE\b.{,60}|GRDSET\b)", re.MULTILINE | re.IGNORECASE)
# Corners of MED's elements in VTK's order; between them the edges have one order in both.
_MED = {"tetra": [0, 2, 1, 3], "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5], "wedge": [0, 2, 1, 3, 5, 4]}
_EDGES = {"tetra": [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)],
          "hexahedron": [(0, 1), (1, 2), (2, 3), (0, 3), (4, 5), (5, 6), (6, 7), (4, 7), (0, 4), (1, 5), (2, 6), (3, 7)]}
_MOST_NUMBERS = 1000     # in an array of cells, which may be names of parts
_COUNT = re.compile(rb"(?:\A|^[ \t]*(?:[A-Za-z]+[ \t]+)?)(\d{3,})(?=[ \t\r]*$|[ \t]+3[ \t])", re.MULTILINE)
_CARD = re.compile(rb"^[ \t]*C(?:TETRA|HEXA|PENTA|PYRAM?|TRIA|TRAX|QUAD|SHEAR)\w*\*?[ \t,]", re.IGNORECASE | re.MULTILINE)


def read_other(path: Path) -> RawMesh:
    """The `RawMesh` of a file. Raises InputError for what meshio cannot read, or does not read whole."""
    read, said = _read(path)
    _refuse_incomplete(path, read, said)
    blocks = [_block(path, block.type, np.asarray(block.data, dtype=object if block.type.startswith("poly") else np.int64))
              for block in read.cells]
    points = np.zeros((len(read.points), 3))
    points[:, :read.points.shape[1]] = read.points
    if path.suffix.lower() == ".med":
        blocks = [(kind, _from_med(points, kind, nodes)) for kind, nodes in blocks]
    raw = RawMesh(points, blocks, remarks=[f"meshio warns: {one}" for one in said])
    _take_sets(read, raw)
    if not raw.regions and not raw.faces:
        _take_numbers(read, raw)
    stated: dict[str, Any] = {name.removeprefix(GEOMETRY): arrays for name, arrays in read.cell_data.items()
                              if name.startswith(GEOMETRY)}
    if stated:
        raw.geometry, arrays = next(iter(stated.items()))
        raw.thickness_mm = float(np.concatenate([np.ravel(values) for values in arrays])[0])
    raw.in_mm = any(name.startswith(REGION) for name in read.cell_data)
    return raw


def _read(path: Path) -> tuple["meshio.Mesh", list[str]]:
    """The mesh as meshio reads it, and its warnings, which it prints."""
    _refuse_impossible_counts(path)
    printed = io.StringIO()
    known = "give VTU, or another volume mesh that is read, such as those of Gmsh or Abaqus"
    with in_one_sentence(path, "not readable as a mesh of elements", known):
        try:
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                read = _by_meshio(path)
        except SystemExit:     # meshio ends the program for an unknown format
            text = " ".join(printed.getvalue().split()).removeprefix("Error: ")
            raise ValueError(text or "unknown format") from None
        except KeyError as error:     # of a kind of cells that it names and does not handle
            if (kind := str(error.args[0]).lower()) in _UNHANDLED:
                raise _not_taken(path, kind) from None
            raise
    warned = " ".join(printed.getvalue().split()).split("Warning: ")[1:]
    return read, list(dict.fromkeys(one.strip().rstrip(".") for one in warned))


def _by_meshio(path):
    import meshio

    if path.suffix.lower() in _NASTRAN:
        return meshio.read(_bulk_data(path), "nastran")
    content = path.read_bytes() if path.suffix.lower() == ".vtk" else b""
    if not _LONG.search(content):
        return meshio.read(path)
    with tempfile.TemporaryDirectory() as folder:      # meshio does not know the type that PyVista gives to whole numbers
        copy = Path(folder) / path.name
        copy.write_bytes(_LONG.sub(rb"\1vtktypeint64", content))
        return meshio.read(copy)


def _bulk_data(path):
    """The text of a file of Nastran from BEGIN BULK on, which many programs leave out, in capitals.

    Raises InputError for cards that meshio passes over.
    """
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    begin = re.search(r"^[ \t]*BEGIN[ \t]+BULK.*\n", text, re.MULTILINE | re.IGNORECASE)
    bulk = text[begin.end():] if begin else text
    if found := _NOT_READ.search(bulk):
        remedy = "put that file in its place" if found[1].upper().startswith("INCLUDE") else "write its fields into each GRID"
        raise InputError(f"{path}: {found[1].strip()} is not read; {remedy}.")
    return io.StringIO("BEGIN BULK\n" + bulk.upper())


def _refuse_impossible_counts(path):
    """Refuse a text of Medit or TetGen that states more entries than it has bytes: meshio would ask for memory for all of them."""
    if path.suffix.lower() in (".mesh", ".ele", ".node"):
        content = path.read_bytes()
        stated = [int(number) for number in _COUNT.findall(content)]
        if max(stated, default=0) > len(content):
            raise InputError(f"{path}: it states {max(stated)} entries and has {len(content)} bytes; save it again.")


def _not_taken(path, name):
    return InputError(f"{path}: it has cells that are not taken ({name}); convert them into tetrahedra, hexahedra or wedges of the "
                      "first or second order, for example with ParaView.")


def _refuse_incomplete(path, read, said):
    for one in said:
        if found := _DROPPED.search(one):
            name = f"{_VTK_NAMES.get(int(found[1]), 'other cells')}, type {found[1]} of VTK" if found[1] else found[0]
            raise _not_taken(path, name)
    of_cards = path.suffix.lower() in _NASTRAN      # those of lines and points have other names
    count = sum(len(block.data) for block in read.cells if not of_cards or dimension_of(block.type) > 1)
    if (stated := _stated_cells(path)) is not None and stated != count:
        pieces = "; save it in one piece" if path.suffix.lower() == ".vtu" else ""
        raise InputError(f"{path}: only {count} of its {stated} cells can be read{pieces or '; save it in another format'}.")
    if path.suffix.lower() in _NASTRAN and np.any(read.point_data.get("nastran:ref", 0)):
        raise InputError(f"{path}: it has nodes in a coordinate system of their own (field CP of GRID), which is not read; write "
                         "them in the basic one.")


def _stated_cells(path):
    """Number of cells that a file says it has, None where it does not."""
    suffix, content = path.suffix.lower(), path.read_bytes()
    if suffix == ".vtu":
        return sum(map(int, re.findall(rb'<Piece[^>]*NumberOfCells="\s*(\d{1,12})', content)))
    if suffix == ".vtk":
        found = re.search(rb"^CELL_TYPES\s+(\d{1,12})", content, re.MULTILINE)
        return int(found[1]) if found else None
    return len(_CARD.findall(content)) if suffix in _NASTRAN else None


def _block(path, kind, nodes):
    if kind.startswith("VTK_"):
        kind = _SAME.get(f"{kind}{nodes.shape[1]}", kind)
    if dimension_of(kind) < 0:
        raise _not_taken(path, kind.lower())
    return kind, nodes


def _from_med(points, kind, nodes):
    """Nodes (e, m) in VTK's order. MED turns elements the other way round; meshio writes such files without turning them."""
    shape = kind.rstrip("0123456789")
    if shape not in _MED or not len(nodes):
        return nodes
    apex = 4 if shape == "hexahedron" else 3
    a, b, c, top = (points[nodes[:, k]] for k in (0, 1, 2, apex))
    if np.median(np.einsum("ei,ei->e", np.cross(b - a, c - a), top - a)) >= 0:
        return nodes
    corners, edges = _MED[shape], _EDGES.get(shape, [])
    middles = [len(corners) + edges.index((min(pair), max(pair))) for a, b in edges for pair in [(corners[a], corners[b])]]
    order = [*corners, *middles]
    return nodes[:, [*order, *range(len(order), nodes.shape[1])][: nodes.shape[1]]]


def _take_sets(read, raw):
    """Regions and faces by name: of softtact, sets of cells, groups of MED."""
    lengths = [len(nodes) for _, nodes in raw.blocks]
    for name, arrays in read.cell_data.items():
        for beginning, into in ((REGION, raw.regions), (FACE, raw.faces)):
            if name.startswith(beginning):
                into[name.removeprefix(beginning)] = [np.asarray(values).ravel() > 0 for values in arrays]
    for name, members in read.cell_sets.items():
        if not name.startswith(_BY_MESHIO):
            _take_set(raw, name, [_flags(numbers, count) for numbers, count in zip(members, lengths, strict=True)])
    families = getattr(read, "cell_tags", None) or {}
    for name in dict.fromkeys(name for names in families.values() for name in names):
        members = [number for number, names in families.items() if name in names]
        _take_set(raw, str(name), [np.isin(np.ravel(values), members) for values in read.cell_data["cell_tags"]])


def _take_numbers(read, raw):
    """Regions and faces by their numbers, where the file has an array of those; 0 is no face."""
    arrays = {name: values for name, values in read.cell_data.items() if re.sub(r"[^a-z0-9]", "", name.lower()) in _NUMBERS}
    if not arrays:
        raw.remarks += [f"the array {name} of whole numbers is left out; call it MaterialIDs if it names the regions"
                        for name, values in read.cell_data.items() if _may_name_parts(name, values)]
    for name, values in arrays.items():
        numbers = [np.ravel(one) for one in values]
        if not all(len(one) == len(nodes) for one, (_, nodes) in zip(numbers, raw.blocks, strict=True)):
            continue
        found = np.concatenate(numbers).astype(float)
        if not (np.abs(found) < 2**31).all() or (found != found.round()).any():
            continue
        for number in np.unique(found).astype(np.int64):
            flags = [one == number for one in numbers]
            _take_set(raw, str(number), flags)
            if number == 0:
                raw.faces.pop("0", None)
        raw.numbered = True
        if others := [other for other in arrays if other != name]:
            raw.remarks.append(f"the regions are those of the array {name}; left out: {', '.join(others)}")
        return


def _may_name_parts(name, values):
    """Whether an array of cells has a few different whole numbers."""
    found = np.concatenate([np.ravel(one) for one in values])
    whole = found.dtype.kind in "iu" and all(np.ndim(one) == 1 for one in values)
    return whole and not name.startswith(("vtk", GEOMETRY)) and 1 < len(np.unique(found)) <= min(_MOST_NUMBERS, len(found) // 2)


def _take_set(raw, name, flags: Flags):
    """A set as a region, of its elements, and as a face, of its facets."""
    d = max(raw.dimensions, default=0)
    for into, dimension in ((raw.regions, d), (raw.faces, d - 1)):
        chosen = [one & (own == dimension) for one, own in zip(flags, raw.dimensions, strict=True)]
        if any(one.any() for one in chosen):
            into[name] = chosen


def _flags(members, count):
    out = np.zeros(count, dtype=bool)
    if members is not None and len(members):
        out[np.asarray(members, dtype=np.int64)] = True
    return out
