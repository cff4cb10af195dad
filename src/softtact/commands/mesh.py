"""Commands on a mesh file: `softtact mesh`, a body for the solid model, and `softtact complexity`, the counts of the paper's rule.

A body consists of tetrahedra in a closed surface, or of the elements of another program.
"""

import argparse
import sys
import time
from pathlib import Path

from softtact.commands.common import (
    MESH_FILE,
    add_command,
    add_mesh,
    add_repair,
    add_unit,
    check_names,
    pairs,
    pose_of,
    read_object,
    report_reading,
    sensor_spec,
    short,
    show,
)
from softtact.errors import InputError
from softtact.outputs import check_outputs, refuse_overwriting

EXAMPLES = """
  softtact mesh finger.stl --unit mm --size 0.8 --out finger.vtu
  softtact mesh finger.stl --unit mm --size 0.8 --face "back=z<0.01" --face "tip=z>12" --out finger.vtu
  softtact mesh finger.msh --unit mm --out finger.vtu     # elements of Gmsh, Abaqus and others, their groups as regions and faces
"""
COMPLEXITY_EXAMPLES = """
  softtact complexity part.stl --unit mm
  softtact complexity part.stl --unit mm --pose=0,0,0,0,0,90 --rule all --json
"""
_UNKNOWNS = 4.5                # for each element: measured 4.4 to 5.2
_SECONDS = (0.5e-3, 2e-3)      # for each element, on one processor of 2023, idle and with other work


def add(commands: argparse._SubParsersAction) -> None:
    """Add both commands to the parser."""
    _add_complexity(commands)
    command = add_command(commands, "mesh", _mesh, "Fill a closed surface with quadratic tetrahedra, or take another program's "
                          "elements, for the solid model.", EXAMPLES)
    command.add_argument("mesh", metavar="BODY", type=Path,
                         help=f"{MESH_FILE}; or a file of elements (VTU, Gmsh, Abaqus, ...)")
    add_unit(command)
    command.add_argument("--size", type=float, metavar="MM", help="edge length in mm that elements in a surface shall have")
    command.add_argument("--envelope", type=float, metavar="MM",
                         help="details smaller than this may be lost (default: a twentieth of the size)")
    command.add_argument("--region", action="append", metavar="NAME",
                         help="name of the region of a filled surface (default: body); of a file of elements, the sets or groups "
                              "that are its regions (default: all); repeat it")
    command.add_argument("--face", action="append", metavar="NAME=RULE",
                         help="a face by name: outer facets where a rule such as 'z<0.1' or 'x>2 & y<1' holds, in mm; repeat it")
    command.add_argument("--geometry", choices=("plane_strain", "axisymmetric"), help="what a plane mesh of elements stands for")
    command.add_argument("--most-elements", type=int, metavar="N", help="refuse a size that would make more (default: 400000)")
    add_repair(command)
    command.add_argument("--out", type=Path, required=True, metavar="BODY.vtu", help="the mesh to write")


def _add_complexity(commands):
    command = add_command(commands, "complexity", _complexity, "Count a mesh's complexity and choose its model.",
                          COMPLEXITY_EXAMPLES)
    add_mesh(command)
    command.add_argument("--rule", choices=("any", "all"), default="any",
                         help="which of the two criteria the hyperelastic model takes (default: any)")


def _complexity(options):
    from softtact.geometry.complexity import choose_model, score_file
    from softtact.geometry.formats import read_facets

    report_reading(options, options.mesh, read_facets(options.mesh).notes)
    spec = sensor_spec(options.sensor)
    counts = score_file(options.mesh, unit=options.unit, footprint_mm=spec.footprint_mm, pose=pose_of(options),
                        reach_mm=spec.thickness_mm)
    four = {"NPt": counts.NPt, "CHt": counts.CHt, "NPo": counts.NPo, "CHo": counts.CHo}
    result = four | {"ratio_total": counts.ratio_total, "ratio_overlap": counts.ratio_overlap}
    result["model"] = choose_model(**four, rule=options.rule)
    show(result, as_json=options.json, lines=[f"{name:14}{short(value)}" for name, value in result.items()])


def _mesh(options):
    from softtact.fem.files.solids import write_mesh
    from softtact.geometry.formats import SURFACES

    check_outputs(options.out)
    check_names({options.out: (".vtu",)})
    refuse_overwriting([options.mesh], {"--out": options.out})
    rules = dict(pairs("--face", options.face))
    mesh, result = _filled(options, rules) if options.mesh.suffix.lower() in SURFACES else _taken(options, rules)
    write_mesh(mesh, options.out)
    for remark in result["remarks"]:
        print(f"softtact mesh: {options.mesh}: {remark}", file=sys.stderr)
    result = {"mesh": str(options.out)} | result | {"regions": mesh.regions, "faces": {name: sum(map(len, facets.values()))
                                                                                      for name, facets in mesh.faces.items()}}
    shown = {name.replace("_", " "): short(value) for name, value in result.items()
             if name not in ("mesh", "remarks") and value not in ([], {}, None)}
    lines = [f"{name}: {value}" for name, value in shown.items()]
    show(result, as_json=options.json, lines=[*lines, f"written: {options.out}"])


def _filled(options, rules):
    """The mesh of a surface, and the values to report."""
    from softtact.fem.body_mesh import MOST_ELEMENTS, meshed_body
    from softtact.fem.files.solids import face_rule, with_named_faces
    from softtact.geometry.tetrahedra import estimated_elements

    if len(options.region or ()) > 1:
        raise InputError("--region: a filled surface has one region; give it once.")
    if options.geometry:
        raise InputError("--geometry: it is of a plane mesh; leave it out for a surface in space.")
    if options.size is None:
        raise InputError(f"--size: {options.mesh} is a surface; give the edge length in mm that its elements shall have.")
    for rule in rules.values():
        face_rule(rule)                 # checks the rule before minutes of meshing
    surface, repairs = read_object(options, options.mesh)
    if options.size > 0:
        count = estimated_elements(surface, options.size)
        low, high = (count * seconds for seconds in _SECONDS)
        print(f"softtact mesh: about {count:,} elements and {int(_UNKNOWNS * count):,} unknowns (right to a factor of two); "
              f"meshing takes about {low:.2g} to {high:.2g} s", file=sys.stderr, flush=True)
    began = time.perf_counter()
    mesh, report = meshed_body(surface, size_mm=options.size, region=(options.region or ["body"])[0], envelope_mm=options.envelope,
                               most_elements=MOST_ELEMENTS if options.most_elements is None else options.most_elements)
    seconds = time.perf_counter() - began
    values = report.as_dict() | {"meshing_s": seconds, "repairs": repairs, "remarks": list(report.remarks)}
    return with_named_faces(mesh, rules), values


def _taken(options, rules):
    """The mesh of a file of elements, and the values to report."""
    from softtact.fem.files.solids import read_body

    for name in ("size", "envelope", "most_elements"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: {options.mesh} has elements already; leave the option out, or give a "
                             "surface (STL, OBJ, STEP, ...).")
    body = read_body(options.mesh, unit=options.unit, geometry=options.geometry, faces=rules, regions=options.region)
    mesh = body.mesh
    axes = 3 if mesh.geometry == "solid" else 2
    return mesh, {"elements": sum(len(nodes) for _, _, nodes in mesh.cells), "nodes": len(mesh.points),
                  "unknowns": axes * len(mesh.points), "geometry": mesh.geometry, "volume_mm3": mesh.volume_mm3(),
                  "pieces": body.pieces, "remarks": body.remarks}
