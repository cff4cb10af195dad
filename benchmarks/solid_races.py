"""The same press of two bodies by CalculiX, by NGSolve and by us: `python benchmarks/solid_races.py --unknowns 1e4 1e5`.

A block of rubber with a rounded foot (Mooney-Rivlin, K = 5 mu, so that no program projects J) is pressed by 0.2 mm on a
wider block in four equal increments, without friction, on the same mesh of quadratic tetrahedra for all. Penalty 200 N/mm3 for all;
we also bring the overlap below 1 um.
  CalculiX   C3D10, contact surface to surface, its direct solver and its criteria; timed is its whole process
  NGSolve    order 2, `ContactBoundary` with the penalty's energy, Newton's method to 1e-6 of the force, PARDISO (UMFPACK
             needs more than 22 GB for 400,000 unknowns)
  we         timed from the mesh's arrays to the forces, in a fresh process with compiled kernels in the cache (imports do not
             count); Newton's method to 1e-6 of the force, its systems by `linalg.refined`
The programs run in turns; the shortest of the runs counts. Void is a row whose forces differ by more than 2 %.
Where others take hours: `--increments 1` presses the first increment only, and `--limit calculix=12` stops CalculiX at 12 times our
time by the clock. Its row then says `stopped`, as it does where memory ends; its ratio is a lower bound, and its forces are not
compared.
Also told: what a press of ours spends (assembly, solution with its factors, contact and forces), the memory's peak, the growth from
10,000 unknowns on. Writes benchmarks/results/solid_races.json.
"""

import argparse
import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import record

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.solid_decks import calculix_lines

LAW = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=5)
PENALTY, WAY_MM, INCREMENTS = 200.0, 0.2, 4


def motion(increments):
    """The first of the increments."""
    whole = Motion()
    for _ in range(increments):
        whole = whole.step(ways={"z": -WAY_MM / INCREMENTS})
    return whole


def make_mesh(unknowns):
    """Two blocks with about so many unknowns: 2 x 2 x 1 mm below, 1.4 x 1.4 x 0.8 mm with a foot of 4 mm radius above."""
    n = max(2, round((unknowns / 17) ** (1 / 3)))
    lower = box((-1, -1, 0), (1, 1, 1), (n, n, max(1, n // 2)), region="lower")
    m = max(2, round(0.7 * n))
    upper = box((-0.7, -0.7, 0), (0.7, 0.7, 0.8), (m, m, max(1, round(0.4 * n)))).moved(
        lambda x: x + np.column_stack([0 * x[:, :2], 1 + (x[:, 0] ** 2 + x[:, 1] ** 2) / 8 * (1 - x[:, 2] / 0.8)]))
    return in_tetrahedra(lower).joined(in_tetrahedra(upper), prefix="upper ")


def make_body(mesh, threads):
    body = SolidBody(mesh, {"lower": LAW, "upper body": LAW}, held={"z0": "xyz"}, carried={"top": ((0, 0, 0), ["upper z1"])},
                     threads=threads)
    body.add(ContactPair(Surface.of(mesh.face("upper z0")), Surface.of(mesh.face("z1")), stiffness=PENALTY, reach_mm=0.3,
                              segments=True))
    return body


# Ours -----------------------------------------------------------------------------------------------------------------------


class Clock:
    """Wall seconds spent in methods of objects, by name."""

    def __init__(self):
        self.seconds = {}

    def watch(self, thing, method, name):
        inner = getattr(thing, method)

        def timed(*arguments, **options):
            began = time.perf_counter()
            try:
                return inner(*arguments, **options)
            finally:
                self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began

        setattr(thing, method, timed)


def ours(unknowns, threads, increments):
    press(make_mesh(2000), threads, 1)     # compiles, and starts the solver's library
    print(json.dumps(press(make_mesh(unknowns), threads, increments)))


def press(mesh, threads, increments):
    began, busy, clock = time.perf_counter(), time.process_time(), Clock()
    body = make_body(mesh, threads)
    clock.watch(body, "tangent", "assembly")
    clock.watch(body.solver, "solve", "solution")
    clock.watch(body, "evaluate", "forces and contact")
    steps = list(SolidPath(body, {"top": motion(increments)}).run())
    seconds = time.perf_counter() - began
    iterations = sum(step.iterations for step in steps)
    body.solver.close()
    return {"unknowns": len(body.free), "force_n": [-float(step.loads[0, 2]) for step in steps], "seconds": seconds,
            "cpu_seconds": time.process_time() - busy, "iterations": iterations,
            "increments": sum(step.increments for step in steps),
            "penetration_mm": max(step.penetration_mm for step in steps), "shares": clock.seconds,
            "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6}


# Others ---------------------------------------------------------------------------------------------------------------------


def calculix(unknowns, threads, increments, limit_s):
    """Forces, seconds and iterations of ccx."""
    body = make_body(make_mesh(unknowns), 1)
    lines = calculix_lines(body, {"top": motion(increments)}, increments=1, fixed=True)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "race.inp").write_text("\n".join(lines) + "\n", encoding="utf-8")
        found, said = timed(["ccx", "race"], threads, limit_s, folder)
        table = (Path(folder) / "race.dat").read_text(encoding="utf-8").split("\n") if not found["stopped"] else []
    forces = [-float(line.split()[2]) for line in table if len(line.split()) == 3]
    return found | {"force_n": forces, "iterations": said.count(" iteration ")}


def timed(command, threads, limit_s, folder=None):
    """Seconds of a program, by the clock and of the processor, why it was stopped ("" where it ended); and what it said."""
    before, began, stopped = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter(), ""
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=record.threads_of(threads), check=False,
                              timeout=limit_s)
        said = done.stdout
        if done.returncode == -signal.SIGKILL:
            stopped = "out of memory"
        elif done.returncode:
            raise RuntimeError(f"{command[0]}: {done.stderr[-2000:] or said[-2000:]}")
    except subprocess.TimeoutExpired as late:
        stopped, said = "out of time", (late.stdout or b"").decode()
    seconds, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return {"seconds": seconds, "cpu_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
            "stopped": stopped}, said


def ngsolve_child(unknowns, threads, increments):
    """The press by NGSolve; its mesh is made from ours."""
    import ngsolve as ng
    from netgen.meshing import Element2D, Element3D, FaceDescriptor, MeshPoint, Pnt
    from netgen.meshing import Mesh as NetgenMesh

    ours_mesh = make_mesh(unknowns)
    ng.SetNumThreads(threads)
    mesh = NetgenMesh(dim=3)
    used = np.unique(np.concatenate([nodes[:, :4] for _, _, nodes in ours_mesh.cells]))
    number = dict(zip(used.tolist(), (mesh.Add(MeshPoint(Pnt(*map(float, ours_mesh.points[k])))) for k in used), strict=True))
    for k, (_, _, nodes) in enumerate(ours_mesh.cells, 1):
        for own in nodes[:, [0, 1, 3, 2]].tolist():
            mesh.Add(Element3D(k, [number[n] for n in own]))
    names = {"z0": "held", "upper z1": "top", "upper z0": "foot", "z1": "face"}
    for k, (face, name) in enumerate(names.items(), 1):
        mesh.Add(FaceDescriptor(surfnr=k, domin=1 if face[0] == "z" else 2, domout=0, bc=k))
        mesh.SetBCName(k - 1, name)
        for own in ours_mesh.faces[face]["triangle6"][:, :3].tolist():
            mesh.Add(Element2D(k, [number[n] for n in own]))
    mesh = ng.Mesh(mesh)
    began = time.perf_counter()
    with ng.TaskManager():
        forces, iterations, free = _ngsolve_press(ng, mesh, increments)
    print(json.dumps({"force_n": forces, "seconds": time.perf_counter() - began, "iterations": iterations, "unknowns": free,
                      "cpu_seconds": time.process_time()}))


def _ngsolve_press(ng, mesh, increments):
    space = ng.VectorH1(mesh, order=2, dirichlet="held|top")
    u, moved = space.TrialFunction(), ng.GridFunction(space)
    F = ng.Id(3) + ng.Grad(u)
    J, C = ng.Det(F), F.trans * F
    I1, I2 = ng.Trace(C), 0.5 * (ng.Trace(C) ** 2 - ng.Trace(C * C))
    c10, c01 = LAW.parameters["c10"], LAW.parameters["c01"]
    energy = c10 * (J ** (-2 / 3) * I1 - 3) + c01 * (J ** (-4 / 3) * I2 - 3) + 0.5 * LAW.bulk_modulus * (J - 1) ** 2
    form = ng.BilinearForm(space, symmetric=False)
    form += ng.Variation(energy.Compile() * ng.dx)
    X, normal = ng.CF((ng.x, ng.y, ng.z)), ng.specialcf.normal(3)
    contact = ng.ContactBoundary(mesh.Boundaries("foot"), mesh.Boundaries("face"))
    overlap = (X + u - (X.Other() + u.Other())) * normal
    contact.AddEnergy(ng.IfPos(overlap, 0.5 * PENALTY * overlap * overlap, ng.CF(0)))
    inner = ng.BilinearForm(space)
    inner += ng.Variation(energy.Compile() * ng.dx)
    top = ng.GridFunction(space)
    top.Set(ng.CF((0, 0, 1)), definedon=mesh.Boundaries("top"))
    residual, step = moved.vec.CreateVector(), moved.vec.CreateVector()
    forces, iterations = [], 0
    for _ in range(increments):
        moved.vec.data -= WAY_MM / INCREMENTS * top.vec
        for _ in range(40):
            contact.Update(moved, form, 5, 0.3)
            form.Apply(moved.vec, residual)
            force = -ng.InnerProduct(residual, top.vec)
            off = np.abs(np.asarray(residual)[np.array(list(space.FreeDofs()), bool)]).max()
            if off < 1e-6 * max(abs(force), 1e-9):
                break
            form.AssembleLinearization(moved.vec)
            step.data = form.mat.Inverse(space.FreeDofs(), inverse="pardiso") * residual
            share, before = 1.0, form.Energy(moved.vec)
            while share > 1e-3:
                moved.vec.data -= share * step
                after = form.Energy(moved.vec)
                if np.isfinite(after) and after <= before + 1e-12:
                    break
                moved.vec.data += share * step
                share *= 0.5
            iterations += 1
        inner.Apply(moved.vec, residual)
        forces.append(float(-ng.InnerProduct(residual, top.vec)))
    return forces, iterations, sum(space.FreeDofs())


def child(kind, unknowns, threads, increments, limit_s=None):
    """A run of us or of NGSolve in a fresh process."""
    command = [sys.executable, __file__, "--child", kind, str(unknowns), str(threads), str(increments)]
    found, said = timed(command, threads, limit_s)
    return found | {"force_n": [], "iterations": None} if found["stopped"] else json.loads(said.strip().split("\n")[-1])


# The race -------------------------------------------------------------------------------------------------------------------


def race(unknowns, threads, repeats, rivals, increments, limits):
    """One row: all in turns `repeats` times; others are stopped at `limits[name]` times our seconds."""
    runs = {"calculix": calculix, "ngsolve": lambda *given: child("ngsolve", *given)}
    found = {name: [] for name in ("ours", *rivals)}
    for _ in range(repeats):
        found["ours"].append(child("ours", unknowns, threads, increments))
        if found["ours"][-1].get("stopped"):
            raise MemoryError(f"Our own press of {unknowns:g} unknowns was killed; free memory, or ask for fewer unknowns.")
        for name in rivals:
            limit_s = limits[name] * found["ours"][-1]["seconds"] if name in limits else None
            found[name].append(runs[name](unknowns, threads, increments, limit_s))
    row = {"threads": threads, "increments": increments}
    row |= {name: min(results, key=lambda run: run["seconds"]) for name, results in found.items()}
    own = row["ours"]
    print(f"{own['unknowns']:9,} unknowns, {threads} threads: ours {own['seconds']:.1f} s, {own['iterations']} iterations, "
          f"{own['peak_gb']:.1f} GB; " + ", ".join(f"{k} {v:.1f} s" for k, v in own["shares"].items()), flush=True)
    for name in rivals:
        compare(name, own, row[name], increments)
    return row


def compare(name, own, other, increments):
    """Add the ratio of times and the difference of forces to the other program's run, and tell them."""
    other["ratio"] = other["seconds"] / own["seconds"]
    if other.get("stopped"):
        print(f"   {name}: {other['stopped']} after {other['seconds']:.1f} s, {other['ratio']:.1f} times ours", flush=True)
        return
    if len(other["force_n"]) != increments:
        raise RuntimeError(f"{name} gives {len(other['force_n'])} forces, not {increments}.")
    difference = float(np.abs(np.subtract(own["force_n"], other["force_n"])).max() / max(other["force_n"]))
    other |= {"difference": difference, "void": difference > 0.02}
    print(f"   {name}: {other['seconds']:.1f} s, {other['iterations']} iterations, ratio {other['ratio']:.1f}, "
          f"forces differ by {100 * difference:.2f} %{'  void' if other['void'] else ''}", flush=True)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--unknowns", type=float, nargs="+", default=[1e4, 3e4, 1e5, 4e5])
    options.add_argument("--threads", type=int, nargs="+", default=[2])
    options.add_argument("--repeats", type=int, default=2)
    options.add_argument("--rivals", nargs="*", default=["calculix", "ngsolve"], choices=["calculix", "ngsolve"])
    options.add_argument("--try", dest="trial", action="store_true", help="print only, leave the record as it is")
    options.add_argument("--keep", action="store_true", help="leave rows of the record at other sizes as they are")
    options.add_argument("--increments", type=int, default=INCREMENTS, help=f"press so many of the {INCREMENTS} increments")
    options.add_argument("--limit", nargs="+", default=[], metavar="NAME=TIMES", help="stop a rival at so many times our seconds")
    options.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.child:
        kind, unknowns, threads, increments = given.child
        return {"ours": ours, "ngsolve": ngsolve_child}[kind](float(unknowns), int(threads), int(increments))
    limits = {name: float(times) for name, times in (text.split("=") for text in given.limit)}
    rows = [race(unknowns, threads, given.repeats, given.rivals, given.increments, limits)
            for threads in given.threads for unknowns in given.unknowns]
    if given.keep:
        done = {(row["ours"]["unknowns"], row["increments"]) for row in rows}
        kept = [row for row in record.read("solid_races")["rows"] if (row["ours"]["unknowns"], row["increments"]) not in done]
        rows = sorted(rows + kept, key=lambda row: (-row["increments"], row["ours"]["unknowns"]))
    if not given.trial:
        print(record.write("solid_races", rows=rows))


if __name__ == "__main__":
    main()
