"""Which element for the sensor? Error against unknowns and time: `python benchmarks/discretisation.py` (an hour on one thread).

Every kind of element on meshes of the same cells, in the same press (`free_bodies.free_press`):
  cell   one frustum of an endless lattice with its sheet and cover, tip held, its side on the PCB, the top lowered to 0.2 mm in
         eight steps: error of the mean pressure, at K = 20 mu0 and at nu = 0.4995
  patch  6 x 6 frusta, sides symmetric, tips held sideways, tips and cone sides on the PCB; a flat punch of 3 mm radius at 8 N:
         error of the plane between sheet and cover at the nodes that the meshes have in common. By symmetry a quarter is solved.
References: 27-node elements, the cell's plan refined twice, the patch's once, a share mu of K at every point (without it meshes as
fine as these do not pass the fold at the tip's rim). Writes benchmarks/results/discretisation.json, the table in
docs/notebook/2026-11-21-which-element.md, and docs/discretisation.png.
"""

import argparse
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import record
from element_kinds import KINDS, discretise, face_points
from free_bodies.free_body import FreeBody, RigidContact, flat_surface, ground
from free_bodies.free_press import FreeSettings, press_to_forces, press_to_indentations
from scipy.spatial import cKDTree
from sensor_meshes import Stack, layered_mesh, octagon_cell

from softtact.errors import ConvergenceError
from softtact.fem.extruded_mesh import cell_mesh_2d
from softtact.materials.laws.registry import make_law
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

PAGE = Path(__file__).parents[1] / "docs/notebook/2026-11-21-which-element.md"
FIGURE = Path(__file__).parents[1] / "docs/discretisation.png"
SPEC = SensorSpec.from_yaml(sensor_file("coro"))
LAWS = {"dielectric": {"c10": 0.1706, "c01": 0.0040}, "cover": {"c10": 0.1786, "c01": 0.0022}}
STIFF = 2 * (1 + 0.4995) / (3 * (1 - 2 * 0.4995))      # K / mu0 at nu = 0.4995
DEPTHS_MM = 0.025 * np.arange(1, 9)
FORCES_N = (0.5, 2.0, 4.0, 6.0, 8.0)
PUNCH_MM = 3.0
TIGHT = FreeSettings(relative_residual=1e-5, relative_correction=1e-3)


@dataclass(frozen=True)
class Mesh:
    """A kind of element, how often its plan is split, and its layers."""

    kind: str
    refinement: int
    stack: Stack

    def build(self, counts, bulk_over_shear):
        kind = KINDS[self.kind]
        octagon = self.kind == "tet4"
        mesh = layered_mesh(SPEC, counts, cell=octagon_cell if octagon else cell_mesh_2d, refinement=self.refinement,
                            stack=self.stack,
                            straight=kind.linear and not octagon)
        laws = {name: make_law("mooney_rivlin", c, bulk_modulus=2 * sum(c.values()) * bulk_over_shear) for name, c in LAWS.items()}
        return mesh, discretise(mesh, kind, laws)


GRADED = Stack((0.0, 0.2, 0.6, 1.0), 1, 2)
MESHES = [
    Mesh("tet4", 0, Stack((0.0, 1.0), 1, 2)), Mesh("tet4", 1, Stack((0.0, 0.5, 1.0), 2, 4)),
    Mesh("tet4", 2, Stack((0.0, 0.25, 0.5, 0.75, 1.0), 4, 8)),
    Mesh("tet10", 0, GRADED), Mesh("tet10", 1, GRADED.halved()),
    Mesh("tet10p0", 0, GRADED), Mesh("tet10p0", 1, GRADED.halved()),
    Mesh("tet10p1", 0, GRADED),
    Mesh("hex8", 1, GRADED), Mesh("hex8", 1, GRADED.halved()), Mesh("hex8", 2, GRADED.halved()),
    Mesh("hex20", 0, GRADED), Mesh("hex20", 1, GRADED.halved()),
    Mesh("hex27", 0, Stack((0.0, 0.4, 1.0), 1, 1)), Mesh("hex27", 0, GRADED), Mesh("hex27", 0, Stack(GRADED.cone, 2, 4)),
    Mesh("hex27", 1, GRADED),
    Mesh("hex27local", 0, Stack((0.0, 0.4, 1.0), 1, 2)), Mesh("hex27local", 0, GRADED),
]
CELL_REFERENCE = Mesh("reference", 2, GRADED.halved())
PATCH_REFERENCE = Mesh("reference", 1, GRADED.halved())


def _held_sides(points, extent):
    held = np.zeros(points.shape, dtype=bool)
    held[:, :2] = np.abs(np.abs(points[:, :2]) - extent) < 1e-9
    return held


def run_cell(mesh, bulk_over_shear):
    """Mean pressure (8,) in MPa under the plate, and the number of unknowns."""
    whole, parts = mesh.build((1, 1), bulk_over_shear)
    held, follows = _held_sides(parts.points, whole.extent), np.zeros_like(parts.points)
    held[_nodes(parts.tips)] = True
    top = _nodes(parts.top)
    held[top, 2], follows[top, 2] = True, 1.0
    board = _on_board(parts, parts.sides, 2**mesh.refinement)
    body = FreeBody(parts.points, parts.parts, held=held, follows=follows, contacts=board)
    forces = [level.state.object_force for level in press_to_indentations(body, DEPTHS_MM, settings=TIGHT)]
    body.solver.close()
    return {"pressure_mpa": (np.array(forces) / SPEC.dielectric.frusta.pitch_mm**2).tolist(), "unknowns": len(body.free)}


def run_patch(mesh):
    """The interface's deflection at its nodes for 8 N on the whole patch, and what a quarter of it cost."""
    whole, parts = mesh.build((3, 3), 20.0)
    corner = -whole.extent          # the punch's centre
    started, busy = time.perf_counter(), time.process_time()
    held = _held_sides(parts.points, whole.extent)
    held[_nodes(parts.tips), :2] = True
    splits = 2**mesh.refinement
    contacts = [*_punched(parts, corner, splits), *_on_board(parts, parts.tips, splits), *_on_board(parts, parts.sides, splits)]
    body = FreeBody(parts.points, parts.parts, held=held, contacts=contacts)
    levels = list(press_to_forces(body, 0.25 * np.array(FORCES_N), settings=TIGHT))
    state = levels[-1].state
    seen = parts.interface
    place, value = parts.points[seen, :2] - corner, -state.displacement[seen, 2]
    body.solver.close()
    return {"place_mm": place.tolist(), "deflection_mm": value.tolist(), "indentation_mm": state.indentation,
            "unknowns": len(body.free), "seconds": time.perf_counter() - started, "cpu_seconds": time.process_time() - busy,
            "iterations": sum(level.iterations for level in levels),
            "factorisations": sum(level.factorisations for level in levels)}


def _nodes(faces):
    return np.unique(np.concatenate([f.ravel() for f in faces.values()]))


def _punched(parts, centre, splits):
    """The punch on the top: about as many contact points a millimetre on every mesh."""
    def punch(x, y):
        return flat_surface(0.0, PUNCH_MM)(x - centre[0], y - centre[1])

    return _contact(parts.points, parts.top, punch, max(2, 8 // splits), moves=True, stiffness=500.0)


def _on_board(parts, faces, splits):
    return _contact(parts.points, faces, ground(parts.points[:, 2].min()), max(2, 4 // splits), moves=False, stiffness=2000.0)


def _contact(points, group, surface, along, **law):
    found = [(faces, *face_points(points, faces, along)) for faces in group.values() if len(faces)]
    return [RigidContact(points, faces, values, areas, surface, smoothing=1e-3, **law) for faces, values, areas in found]


def compared(result, reference):
    """Root mean square and largest difference of two maps at the places both have, in % of the reference's maximum."""
    place, value = np.array(result["place_mm"]), np.array(result["deflection_mm"])
    there, exact = np.array(reference["place_mm"]), np.array(reference["deflection_mm"])
    distance, index = cKDTree(there).query(np.abs(place))
    common = distance < 1e-6
    difference = 100 * (value[common] - exact[index[common]]) / exact.max()
    return {"rms": float(np.sqrt((difference**2).mean())), "largest": float(np.abs(difference).max()), "places": int(common.sum())}


def measure(mesh, references):
    """One row of the table; references: results by name. What does not converge is left out of the row, with the reason."""
    row = {"kind": mesh.kind, "name": KINDS[mesh.kind].name, "mesh": asdict(mesh), "failed": {}}
    for name, ratio in (("cell", 20.0), ("cell_stiff", STIFF)):
        try:
            cell = run_cell(mesh, ratio)
        except ConvergenceError as fault:
            row["failed"][name] = str(fault)
            continue
        error = 100 * np.abs(np.array(cell["pressure_mpa"]) / references[name]["pressure_mpa"] - 1)
        row[name] = {"mean": float(error.mean()), "max": float(error.max())} | cell
    try:
        patch = run_patch(mesh)
        row["patch"] = compared(patch, references["patch"]) | {k: v for k, v in patch.items() if not k.endswith("_mm")}
    except ConvergenceError as fault:
        row["failed"]["patch"] = str(fault)
    print(table_row(row), flush=True)
    return row


# Page and figure --------------------------------------------------------------------------------------------------------------

HEAD = ("| element | plan | layers cone/sheet/cover | unknowns a cell | cell %, mean / max | at nu = 0.4995 | map %, rms / largest "
        "| processor s |\n|---|---|---|---|---|---|---|---|")


def table_row(row):
    """A row in Markdown; a dash where Newton's method failed."""
    stack = row["mesh"]["stack"]
    cell, stiff, patch = row.get("cell"), row.get("cell_stiff"), row.get("patch")

    def errors(part, a, b):
        return f"{_short(part[a])} / {_short(part[b])}" if part else "-"

    unknowns, seconds = (f"{patch['unknowns'] / 9:.0f}", f"{patch['cpu_seconds']:.1f}") if patch else ("-", "-")
    layers = f"{len(stack['cone']) - 1}/{stack['sheet']}/{stack['cover']}"
    return (f"| {row['name']} | {2 ** row['mesh']['refinement']} | {layers} | {unknowns} | {errors(cell, 'mean', 'max')} "
            f"| {errors(stiff, 'mean', 'max')} | {errors(patch, 'rms', 'largest')} | {seconds} |")


def _short(value):
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def write_table(rows):
    """Put the table between the page's marks."""
    before, _, after = PAGE.read_text(encoding="utf-8").partition("<!-- table -->")
    after = after.partition("<!-- end of table -->")[2]
    table = "\n".join([HEAD, *(table_row(row) for row in rows)])
    PAGE.write_text(f"{before}<!-- table -->\n{table}\n<!-- end of table -->{after}", encoding="utf-8")


def draw(rows):
    """Error of the map and of the cell against unknowns and against time."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(13, 5.2), constrained_layout=True)
    drawn = [(kind, [row for row in rows if row["kind"] == kind and "patch" in row]) for kind in KINDS]
    for colour, (kind, own) in enumerate((kind, own) for kind, own in drawn if own):
        style = {"marker": "o", "label": KINDS[kind].name, "color": f"C{colour}"}
        unknowns = [row["patch"]["unknowns"] / 9 for row in own]
        axes[0].loglog(unknowns, [row.get("cell", {}).get("mean", np.nan) for row in own], **style)
        axes[1].loglog(unknowns, [row["patch"]["rms"] for row in own], **style)
        axes[2].loglog([row["patch"]["cpu_seconds"] for row in own], [row["patch"]["rms"] for row in own], **style)
    for axis, x, y in zip(axes, ("unknowns a cell", "unknowns a cell", "processor s, quarter patch"),
                          ("pressure of the cell, mean error, %", "map at 8 N, rms error, % of its maximum",
                           "map at 8 N, rms error, % of its maximum"), strict=True):
        axis.set(xlabel=x, ylabel=y)
        axis.grid(alpha=0.3, which="both")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    figure.savefig(FIGURE, dpi=110)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--only", nargs="+", choices=KINDS, help="measure these kinds anew, the rest is of the last record")
    options.add_argument("--redraw", action="store_true", help="page and figure of the last record, without a run")
    given = options.parse_args()
    old = record.read("discretisation") if given.redraw or given.only else {}
    rows = old["rows"] if given.redraw else measured(old, given.only or KINDS)
    write_table(rows)
    draw(rows)


def measured(old, kinds):
    """Rows of all meshes: those of `kinds` measured now, the others out of an `old` record; written as the new record."""
    references = old.get("references") or {"cell": run_cell(CELL_REFERENCE, 20.0), "cell_stiff": run_cell(CELL_REFERENCE, STIFF),
                                           "patch": run_patch(PATCH_REFERENCE)}
    print(f"reference: {references['cell']['unknowns']} unknowns in the cell, {references['patch']['unknowns']} in a quarter patch")
    print(HEAD)
    kept = iter([row for row in old.get("rows", []) if row["kind"] not in kinds])
    rows = [measure(mesh, references) if mesh.kind in kinds else next(kept) for mesh in MESHES]
    print(record.write("discretisation", threads=1, references=references, rows=rows))
    return rows


if __name__ == "__main__":
    main()
