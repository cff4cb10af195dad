"""The same press of the same linear tetrahedra by CalculiX and by us: `python benchmarks/against_calculix.py`.

Same mesh (C3D4, plain displacement elements), laws (Mooney-Rivlin, K = 20 mu0), boundary conditions, four equal increments, number
of threads. Two bodies: 6 x 6 frusta with symmetric sides, and the sensor's 540 frusta with held sides. Two loads:
  glued    the cover's nodes under a flat punch are lowered: the discrete problem is the same to the last digit
  sphere   a rigid faceted sphere, frictionless penalty contact; each program puts its own contact points on the cover's faces
CalculiX: default direct solver (SPOOLES) and criteria (residual 0.5 % of the mean force, correction 1 %), only total forces
printed; timed is its whole process. We: the same criteria, timed from the mesh's arrays to the forces, in a fresh process whose
compiled kernels are in the cache; imports (1 to 2 s, once a session) are not counted. Runs alternate; the shortest counts.
A row is void where the forces differ by more than 0.1 % (glued) or 2 % (sphere) of the largest.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import record
import trimesh
from free_bodies.free_body import FreeBody, RigidContact
from free_bodies.free_press import FreeSettings, press_to_indentations
from free_bodies.tetrahedra import LinearTetrahedra
from sensor_meshes import Stack, compressed, layered_mesh, octagon_cell, tetrahedra_of, triangles_of, wedges_of
from threadpoolctl import threadpool_limits

from softtact.contact.height_field import HeightField
from softtact.decks import keywords
from softtact.decks.keywords import law_card
from softtact.fem.elements import TET4
from softtact.linalg.direct import PardisoSingle
from softtact.linalg.workers import Workers
from softtact.materials.laws.registry import make_law
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

LAWS = {"dielectric": {"c10": 0.1706, "c01": 0.0040}, "cover": {"c10": 0.1786, "c01": 0.0022}}
INDENTATION_MM, INCREMENTS = 0.4, 4
CONTACT_STIFFNESS = 500.0      # N/mm3
SHARP_MM = 1e-9                # our smoothing depth: CalculiX has none
TOLERANCE = {"glued": 1e-3, "sphere": 2e-2}


@dataclass(frozen=True)
class Case:
    """Frusta along x and y (None: the whole sensor), how the sides are held, and the radii (mm) of punch, sphere and contact."""

    counts: tuple | None
    sides: str
    punch_mm: float
    sphere_mm: float
    reach_mm: float


CASES = {"patch": Case((6, 6), "symmetric", 3.0, 5.0, 3.4), "layer": Case(None, "held", 6.0, 10.0, 5.0)}


@dataclass(frozen=True)
class Mesh:
    """points (n, 3) in mm, tetrahedra (e, 4) by material, `held` (n, 3), punched nodes, faces (f, 3) near the sphere, and it."""

    points: np.ndarray
    tetrahedra: dict
    held: np.ndarray
    punched: np.ndarray
    near: np.ndarray
    sphere: trimesh.Trimesh


def make_mesh(case):
    """168 tetrahedra a cell: 24 in the cone, 48 in the sheet and in each of two cover layers. Tips are held."""
    spec = SensorSpec.from_yaml(sensor_file("coro"))
    whole = layered_mesh(spec, case.counts or spec.frusta_counts, cell=octagon_cell, stack=Stack((0.0, 1.0), 1, 2))
    cut = [tetrahedra_of(whole.points, wedges_of(whole.hexes[name], whole.wedges[name]))[:, :4] for name in LAWS]
    points, *cut, top, tips = compressed(whole.points, *cut, triangles_of(whole.top)[:, :3], triangles_of(whole.tips)[:, :3])
    held = np.zeros(points.shape, dtype=bool)
    side = np.abs(np.abs(points[:, :2]) - whole.extent) < 1e-9
    if case.sides == "held":
        held[side.any(axis=1)] = True
    held[:, :2] |= side
    held[tips] = True
    punched = np.unique(top)[np.hypot(*points[np.unique(top), :2].T) <= case.punch_mm]
    near = top[np.hypot(*points[top].mean(axis=1)[:, :2].T) <= case.reach_mm]
    return Mesh(points, dict(zip(LAWS, cut, strict=True)), held, punched, near, _cap(case))


def _cap(case):
    """The lower part of a sphere of 20,480 facets that touches the cover's top."""
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=case.sphere_mm)
    sphere.apply_translation([0, 0, case.sphere_mm])
    low = np.hypot(*sphere.triangles.mean(axis=1)[:, :2].T) < case.reach_mm + 0.5
    return sphere.submesh([low & (sphere.triangles_center[:, 2] < case.sphere_mm)], append=True)


def law(name):
    mu0 = 2 * sum(LAWS[name].values())
    return make_law("mooney_rivlin", LAWS[name], bulk_modulus=20 * mu0)


def depths():
    return INDENTATION_MM * np.arange(1, INCREMENTS + 1) / INCREMENTS


# Ours -----------------------------------------------------------------------------------------------------------------------


def press(mesh, load, threads):
    """Forces (4,) in N, with iterations and factorisations."""
    parts = [LinearTetrahedra(mesh.points, tets, law(name), threads=threads) for name, tets in mesh.tetrahedra.items()]
    held, follows, contacts = mesh.held.copy(), np.zeros_like(mesh.points), []
    if load == "glued":
        held[mesh.punched, 2], follows[mesh.punched, 2] = True, 1.0
    else:
        values, areas = _triangle_points(mesh.points[mesh.near])
        contacts = [RigidContact(mesh.points, mesh.near, values, areas, HeightField(mesh.sphere), moves=True,
                                 stiffness=CONTACT_STIFFNESS, smoothing=SHARP_MM)]
    solver = PardisoSingle(threads=threads, quick_analysis=True)
    workers = Workers(threads)
    body = FreeBody(mesh.points, parts, held=held, contacts=contacts, follows=follows, solver=solver, apart=True, workers=workers)
    settings = FreeSettings(relative_residual=5e-3, relative_correction=1e-2)
    load_steps = list(press_to_indentations(body, depths(), settings=settings))
    body.solver.close()
    workers.close()
    return {"unknowns": len(body.free), "force_n": [float(load_step.state.object_force) for load_step in load_steps],
            "iterations": [load_step.iterations for load_step in load_steps],
            "factorisations": [load_step.factorisations for load_step in load_steps],
            "residual": [load_step.residual_n / load_step.state.mean_force for load_step in load_steps]}


def _triangle_points(corners, parts=4):
    """Linear shape values (p^2, 3) at the centres of the p^2 parts of a triangle, and areas (f, p^2) of parts of (f, 3, 3)."""
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(parts), np.arange(parts)))
    up, down = i + j < parts, i + j < parts - 1
    rs = np.vstack([np.column_stack([i[up] + 1 / 3, j[up] + 1 / 3]), np.column_stack([i[down] + 2 / 3, j[down] + 2 / 3])]) / parts
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.column_stack([1 - rs.sum(axis=1), rs]), np.repeat(area[:, None] / parts**2, parts**2, axis=1)


def ours(name, load, threads, repeats):
    """The body of the child process: warm up on the patch, then the shortest of the runs."""
    press(make_mesh(CASES["patch"]), load, threads)
    mesh, best = make_mesh(CASES[name]), None
    for _ in range(repeats):
        start, busy = time.perf_counter(), time.process_time()
        with threadpool_limits(1):     # of NumPy's products, as `Sensor.press` does: their threads would spin in our way
            result = press(mesh, load, threads)
        result |= {"seconds": time.perf_counter() - start, "cpu_seconds": time.process_time() - busy}
        best = result if best is None or result["seconds"] < best["seconds"] else best
    print(json.dumps(best))


def run_ours(name, load, threads, repeats):
    command = [sys.executable, __file__, "--child", name, load, str(threads), str(repeats)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=record.threads_of(threads))
    return json.loads(done.stdout)


# CalculiX -------------------------------------------------------------------------------------------------------------------


def deck(mesh, load, solver):
    """The deck's lines."""
    lines, first = ["*HEADING", "race"] + keywords.nodes(mesh.points, 1, name="RUBBER"), 1
    for name, tets in mesh.tetrahedra.items():
        lines += keywords.elements(TET4.abaqus_name, name.upper(), first + np.arange(len(tets)), tets + 1)
        lines += keywords.material(f"RUBBER_{name.upper()}", law_card(law(name), no_term=1e20, dialect="CalculiX"))
        lines += [f"*SOLID SECTION, ELSET={name.upper()}, MATERIAL=RUBBER_{name.upper()}"]
        first += len(tets)
    fixed = [f"{node + 1}, {axis + 1}, {axis + 1}" for node, axis in np.argwhere(mesh.held)]
    if load == "glued":
        lines += keywords.node_set("PUNCH", mesh.punched + 1)
    else:
        lines += _sphere(mesh, first)
        fixed += ["PUNCH, 1, 2"]
    static = "*STATIC, DIRECT" + (f", SOLVER={solver}" if solver else "")
    return lines + ["*STEP, NLGEOM, INC=100", static, f"{1 / INCREMENTS}, 1.0", "*BOUNDARY", *fixed,
                    f"PUNCH, 3, 3, {-INDENTATION_MM}", "*NODE PRINT, NSET=PUNCH, TOTALS=ONLY", "RF", "*END STEP"]


def _sphere(mesh, first):
    """A tetrahedron behind each facet, all nodes prescribed, and its contact with the cover's near faces."""
    corners = mesh.sphere.triangles
    apex = corners.mean(axis=1) - mesh.sphere.face_normals    # 1 mm behind; the first face, reversed, is the facet
    points = np.vstack([mesh.sphere.vertices, apex])
    tets = np.column_stack([mesh.sphere.faces[:, ::-1], len(mesh.sphere.vertices) + np.arange(len(apex))])
    numbers = first + np.arange(len(tets))
    lines = keywords.nodes(points, len(mesh.points) + 1, name="PUNCH")
    lines += keywords.elements(TET4.abaqus_name, "SPHERE", numbers, tets + len(mesh.points) + 1)
    lines += ["*MATERIAL, NAME=RIGID", "*ELASTIC", "1000, 0.3", "*SOLID SECTION, ELSET=SPHERE, MATERIAL=RIGID"]
    lines += keywords.surface("UNDERSIDE", [(n, 1) for n in numbers]) + keywords.surface("TOP", _faces(mesh))
    return lines + ["*SURFACE INTERACTION, NAME=PRESS", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
                    keywords.number(CONTACT_STIFFNESS), "*CONTACT PAIR, INTERACTION=PRESS, TYPE=SURFACE TO SURFACE",
                    "TOP, UNDERSIDE"]


_C3D4_FACES = np.array([face.nodes for face in TET4.faces])


def _faces(mesh):
    """Element number and face of the near faces, as they stand in the deck."""
    cover, before = mesh.tetrahedra["cover"], len(mesh.tetrahedra["dielectric"])
    place = {tuple(face): k for k, face in enumerate(np.sort(cover[:, _C3D4_FACES], axis=2).reshape(-1, 3).tolist())}
    found = [place[tuple(sorted(face))] for face in mesh.near.tolist()]
    return [(before + 1 + k // 4, 1 + k % 4) for k in found]


def run_calculix(name, load, threads, solver=""):
    """Forces (4,) in N, wall and processor seconds, iterations of one run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "race.inp"
        path.write_text("\n".join(deck(make_mesh(CASES[name]), load, solver)) + "\n", encoding="ascii")
        start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(["ccx", "race"], cwd=folder, capture_output=True, text=True, env=record.threads_of(threads))
        seconds, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        table = path.with_suffix(".dat").read_text().split("\n") if done.returncode == 0 else []
    forces = [-float(line.split()[2]) for line in table if len(line.split()) == 3]
    return {"force_n": forces, "seconds": seconds, "iterations": done.stdout.count(" iteration "),
            "cpu_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime}


# The race -------------------------------------------------------------------------------------------------------------------


def race(name, load, threads, repeats):
    """One row: both in turn `repeats` times."""
    runs = [(run_calculix(name, load, threads), run_ours(name, load, threads, 3)) for _ in range(repeats)]
    theirs, mine = (min((run[k] for run in runs), key=lambda r: r["seconds"]) for k in (0, 1))
    difference = float(np.abs(np.subtract(mine["force_n"], theirs["force_n"])).max() / max(theirs["force_n"]))
    row = {"case": name, "load": load, "threads": threads, "calculix": theirs, "ours": mine, "difference": difference,
           "void": difference > TOLERANCE[load], "ratio": theirs["seconds"] / mine["seconds"],
           "cpu_ratio": theirs["cpu_seconds"] / mine["cpu_seconds"]}
    print(f"{name:8}{load:8}{threads:8}{mine['unknowns']:10}{theirs['seconds']:12.2f}{mine['seconds']:10.3f}{row['ratio']:8.1f}"
          f"{row['cpu_ratio']:10.1f}{100 * difference:12.4f}{'  void' if row['void'] else ''}", flush=True)
    return row


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    options.add_argument("--cases", nargs="+", default=list(CASES), choices=CASES)
    options.add_argument("--loads", nargs="+", default=list(TOLERANCE), choices=TOLERANCE)
    options.add_argument("--repeats", type=int, default=2)
    options.add_argument("--iterative", action="store_true", help="also CalculiX's ITERATIVE CHOLESKY, once, glued")
    options.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.child:
        name, load, threads, repeats = given.child
        return ours(name, load, int(threads), int(repeats))
    print(f"{'case':8}{'load':8}{'threads':>8}{'unknowns':>10}{'CalculiX s':>12}{'ours s':>10}{'ratio':>8}{'cpu ratio':>10}"
          f"{'forces %':>12}")
    rows = [race(name, load, threads, given.repeats)
            for name in given.cases for load in given.loads for threads in given.threads]
    iterative = {}
    if given.iterative:
        iterative = {name: run_calculix(name, "glued", 1, "ITERATIVE CHOLESKY") for name in given.cases}
        for name, run in iterative.items():
            print(f"{name}: CalculiX with ITERATIVE CHOLESKY, glued, 1 thread: {run['seconds']:.1f} s, {run['force_n']}")
    print(record.write("against_calculix", rows=rows, iterative_cholesky=iterative))


if __name__ == "__main__":
    main()
