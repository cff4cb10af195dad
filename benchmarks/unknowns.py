"""How a press changes with what the paper does not print: `python benchmarks/unknowns.py [OBJECT.stl]` from the project's folder.

The default sensor on the default mesh is pressed with the default assumptions and then with one of them changed at a time:
compressibility of the two materials, thickness of the sheet and of the cover, hold of the tips, friction, and which face of a
frustum is the tip. About a minute a press on one thread, several where the dielectric is very compressible. Each row is written to
benchmarks/results/unknowns.json as soon as it is there: `--resume` presses only what that record lacks, `--cases NAME ...` only
these, `--write-docs` puts the record's tables into docs/explanation/unknowns.md without a press. `--mesh draft`
takes half of the time, and keeps its own record, unknowns_draft.json: the difference is the mesh's effect on these tables.
"""

import argparse
import json
import signal
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import record
import trimesh

import softtact
from softtact.errors import ConvergenceError
from softtact.geometry.meshes import read_mesh
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.press.sensor import Sensor
from softtact.sensors.specification import SensorSpec

OBJECTS = ["config/objects/indenters/circle_m.stl"]
PAGE = Path(__file__).parents[1] / "docs/explanation/unknowns.md"
FORCES_N = [5.0, 10.0, 20.0, 35.0, 50.0]
TOLD_N = (20.0, 50.0)
# How a sensor is meshed and pressed; on the draft mesh, as in the studies, only deeper overlaps are pressed apart.
MESHES = {"default": (MeshSettings(), NewtonSettings()),
          "draft": (MeshSettings.draft(), NewtonSettings(largest_penetration_mm=0.02))}
DEFAULT = "default"
LAYERS = {"dielectric": "polyurethane", "cover": "neoprene"}


@dataclass(frozen=True)
class Case:
    """A change of the default sensor.

    assumption: what is changed;  value: to what;  spec: {dotted field of the sensor's file: value}
    bulk_over_shear: {layer: K / mu0}
    """

    name: str
    assumption: str
    value: str
    spec: dict = field(default_factory=dict)
    bulk_over_shear: dict = field(default_factory=dict)

    def sensor(self, mesh):
        """The default sensor with this change, on a mesh of MESHES."""
        default = softtact.load_sensor("coro")
        spec = SensorSpec.from_dict(_with(default.spec.model_dump(), self.spec), where=self.name)
        laws = {layer: self._law(layer, law) for layer, law in default.laws.items()}
        settings, solver = MESHES[mesh]
        return Sensor(spec, laws, mesh=settings, solver=solver)

    def _law(self, layer, law):
        if layer not in self.bulk_over_shear:
            return law
        return make_law(law.name, law.parameters, bulk_over_shear=self.bulk_over_shear[layer])


def _with(values, changes):
    """A sensor's values with those at dotted paths replaced."""
    for path, value in changes.items():
        *sections, last = path.split(".")
        place = values
        for section in sections:
            place = place[section]
        place[last] = value
    return values


def compressible(ratio, *layers):
    """K / mu0 of one layer's material, or of both."""
    materials = " and ".join(LAYERS[layer] for layer in layers)
    return Case(f"bulk_{'_'.join(layers)}_{ratio:g}", f"K/mu0 of {materials}, 20 by default", f"{ratio:g}",
                bulk_over_shear=dict.fromkeys(layers, ratio))


def thickness(layer, key, value, usual):
    """Thickness in mm of the sheet or the cover."""
    return Case(f"{layer}_{value:g}", f"thickness of the {layer}, {usual:g} mm by default", f"{value:g} mm", spec={key: value})


def loose(board):
    """Tips that may slide on the board."""
    spec = {"tips_bonded": False, "friction.board": board}
    return Case(f"free_{board:g}", "tips on the board, bonded by default",
                f"free, friction {board:g}" if board else "free, no friction", spec)


def cases():
    """All of them, the default first."""
    both, ratios = tuple(LAYERS), (1.0, 2.0, 5.0, 10.0)
    swapped = {"dielectric.frusta.tip_diameter_mm": 1.2, "dielectric.frusta.root_diameter_mm": 0.6}
    return [Case(DEFAULT, "", "all assumptions as in the file of the sensor coro"),
            *(compressible(ratio, *layers) for layers in (both, both[:1], both[1:]) for ratio in ratios),
            *(thickness("sheet", "dielectric.sheet_thickness_mm", value, 0.5) for value in (0.25, 1.0)),
            *(thickness("cover", "cover.thickness_mm", value, 1.5) for value in (1.0, 2.0)),
            Case("swapped", "frusta, tip 0.6 and root 1.2 mm by default", "tip 1.2, root 0.6 mm, as printed", swapped),
            *(loose(board) for board in (0.0, 0.1, 0.3)),
            Case("object_0.3", "friction of the object, none by default", "0.3", {"friction.object": 0.3})]


# Presses ----------------------------------------------------------------------------------------------------------------------


@contextmanager
def limited(seconds):
    """Give a `with` block so many processor seconds; then a press in it ends as if it did not converge, with what it reached."""
    start = time.process_time()

    def stop(*_):
        raise ConvergenceError(f"The next load step was given up after {time.process_time() - start:.0f} processor seconds in all.")

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


@dataclass(frozen=True)
class Conditions:
    """What all cases of an object share: its name, its mesh file's content, the sensor's mesh, and processor seconds of a press."""

    name: str
    object: trimesh.Trimesh
    mesh: str
    limit_s: float


def press(case, conditions):
    """The `PressResult` of a case as far as it came, None where no load step did, and the reason why it stopped, None if it did
    not.
    """
    try:
        with limited(conditions.limit_s):
            sensor = case.sensor(conditions.mesh)
            return sensor.press(conditions.object, force_n=FORCES_N, model="hyperelastic", label=case.name, threads=1), None
    except ConvergenceError as fault:
        return fault.result, str(fault)


def measure(case, conditions, default_maps=None):
    """One row, and the maps (load steps, y, x) in mm that it is of; without `default_maps` it is the default itself."""
    start = time.process_time()
    result, fault = press(case, conditions)
    row = {"object": conditions.name, "case": case.name, "assumption": case.assumption, "value": case.value, "failed": fault,
           "cpu_seconds": round(time.process_time() - start, 1)}
    if result is None:
        return row | {"force_n": []}, None
    maps = result.deformation_map_mm
    difference = np.abs(maps - (maps if default_maps is None else default_maps[:len(maps)]))
    numbers = {"indentation_mm": result.indentation_mm, "map_maximum_mm": maps.max(axis=(1, 2)),
               "largest_difference_mm": difference.max(axis=(1, 2)), "mean_difference_mm": difference.mean(axis=(1, 2)),
               "map_minimum_mm": maps.min(axis=(1, 2)),
               "frustum_compression_mm": result.frustum_compression_mm, "overlap_mm": result.penetration_mm}
    whole = {"force_n": result.normal_force_n.tolist(), "iterations": result.iterations.tolist(),
             "within_validity": result.within_validity.tolist()}
    return row | whole | {key: np.round(values, 6).tolist() for key, values in numbers.items()}, maps


def measured(conditions, wanted, rows):
    """Add an object's default and the rows of the `wanted` cases to `rows`, and write the record after each."""
    found = {case.name: case for case in cases()}
    default, default_maps = measure(found.pop(DEFAULT), conditions)
    _replace(rows, default)
    for case in (found[key] for key in wanted if key in found):
        row, _ = measure(case, conditions, default_maps)
        _replace(rows, row)
        print(said(row, default), flush=True)
        record.write(record_name(conditions.mesh), mesh=conditions.mesh, threads=1, rows=rows)


def record_name(mesh):
    """The record of the cases on a mesh."""
    return "unknowns" if mesh == "default" else f"unknowns_{mesh}"


def _replace(rows, row):
    """Put a row where the record has that of the same object and case, else at its end."""
    keys = [(old["object"], old["case"]) for old in rows]
    key = row["object"], row["case"]
    if key in keys:
        rows[keys.index(key)] = row
    else:
        rows.append(row)


def said(row, default):
    """A row for the screen."""
    return f"{row['object']:10}{row['case']:28}{row['cpu_seconds']:7.0f} s  " + "  |  ".join(cells(row, default)[1:])


# Page -------------------------------------------------------------------------------------------------------------------------

HEAD = ("| assumption | value | indentation, mm | change, % | map's maximum, mm | change, % | largest difference of the map, % "
        "| mean difference, % |\n|---|---|---|---|---|---|---|---|")


def at_told(row, key):
    """Values of a row at the forces that are told; nan where it did not come so far."""
    there = dict(zip(row["force_n"], row.get(key, []), strict=True))
    return np.array([there.get(force, np.nan) for force in TOLD_N])


def shares(row, default):
    """{number: % at the told forces}: changes of indentation and of the map's maximum, differences of the map over its maximum."""
    deepest = at_told(default, "map_maximum_mm")
    return {"indentation": 100 * (at_told(row, "indentation_mm") / at_told(default, "indentation_mm") - 1),
            "maximum": 100 * (at_told(row, "map_maximum_mm") / deepest - 1),
            "largest": 100 * at_told(row, "largest_difference_mm") / deepest,
            "mean": 100 * at_told(row, "mean_difference_mm") / deepest}


def cells(row, default):
    """The cells of a row: value, then pairs at the told forces."""
    share = shares(row, default)
    return [row["value"], _pair(at_told(row, "indentation_mm"), ".3f"), _pair(share["indentation"], "+.1f"),
            _pair(at_told(row, "map_maximum_mm"), ".3f"), _pair(share["maximum"], "+.1f"),
            _pair(share["largest"], ".1f"), _pair(share["mean"], ".1f")]


def _pair(values, form):
    return " / ".join("-" if np.isnan(value) else f"{value:{form}}" for value in values)


def table(rows):
    """An object's table in Markdown."""
    default, *changed = rows
    _, indentation, _, maximum, *_ = cells(default, default)
    lines = [HEAD, f"| default | | {indentation} | | {maximum} | | | |"]
    for before, row in zip(rows, changed, strict=False):
        name = "" if row["assumption"] == before["assumption"] else row["assumption"]
        lines.append(f"| {name} | " + " | ".join(cells(row, default)) + " |")
    return "\n".join(lines)


def ranking(rows):
    """The assumptions of an object, that with the widest range of indentation first, as a list in Markdown."""
    default, ranges = rows[0], {}
    for row in rows[1:]:
        share = shares(row, default)
        ranges.setdefault(row["assumption"], []).append([_last(share[key]) for key in ("indentation", "maximum", "largest")])
    spans = {name: np.array(values) for name, values in ranges.items() if not np.isnan(values).all()}
    order = sorted(spans, key=lambda name: -np.nanmax(np.abs(spans[name][:, 0])))
    return "\n".join(f"{place}. {name}: indentation {_range(spans[name][:, 0])} %, map's maximum {_range(spans[name][:, 1])} %, "
                     f"map up to {np.nanmax(spans[name][:, 2]):.0f} %" for place, name in enumerate(order, start=1))


def _last(values):
    """The value at the largest of the told forces that was reached."""
    there = values[~np.isnan(values)]
    return there[-1] if len(there) else np.nan


def _range(values):
    low, high = np.nanmin(values), np.nanmax(values)
    return f"{low:+.1f}" if high - low < 0.05 else f"{low:+.1f} to {high:+.1f}"


def troubles(rows):
    """What did not converge, or left the model's validity, as a list in Markdown."""
    lines = []
    for row in rows:
        name = f"{row['assumption']}: {row['value']}" if row["assumption"] else "default"
        if row["failed"]:
            reached = f"{row['force_n'][-1]:g} N" if row["force_n"] else "no load step"
            lines.append(f"* {name} reached {reached}. {row['failed']}")
        outside = [force for force, valid in zip(row["force_n"], row.get("within_validity", []), strict=True) if not valid]
        if outside:
            lost, overlap = max(row["frustum_compression_mm"]), 1e3 * max(row["overlap_mm"])
            lines.append(f"* {name}: outside the model's validity ([list](../reference/command_line.md#what-is-flagged)) from "
                         f"{outside[0]:g} N on; the most compressed frustum has lost {lost:.2f} mm, "
                         f"the deepest overlap is {overlap:.1f} um.")
    return "\n".join(lines) or "Every press reached 50 N, within the model's validity."


def in_order(rows):
    """{object: its rows in the order of `cases`}."""
    order = [case.name for case in cases()]
    whole = sorted(rows, key=lambda row: order.index(row["case"]))
    return {name: [row for row in whole if row["object"] == name] for name in dict.fromkeys(row["object"] for row in rows)}


def section(name, rows):
    """What the page holds of an object."""
    forces = f"{TOLD_N[-1]:g} N (at {TOLD_N[0]:g} N where the press stopped earlier)"
    missing = [case.name for case in cases() if case.name not in {row["case"] for row in rows}]
    absent = [f"Not pressed yet (`--resume` does): {', '.join(missing)}."] if missing else []
    return "\n\n".join([f"## {name}", table(rows), f"By the largest change of the indentation at {forces}:", ranking(rows),
                        troubles(rows), *absent])


def write_page(rows):
    """Put the tables between the page's marks."""
    parts = [section(name, own) for name, own in in_order(rows).items()]
    before, _, after = PAGE.read_text(encoding="utf-8").partition("<!-- tables -->")
    after = after.partition("<!-- end of tables -->")[2]
    PAGE.write_text(f"{before}<!-- tables -->\n" + "\n\n".join(parts) + f"\n<!-- end of tables -->{after}", encoding="utf-8")


def main():
    """Press, record and write."""
    names = [case.name for case in cases()]
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("objects", nargs="*", default=OBJECTS, metavar="OBJECT.stl")
    options.add_argument("--cases", nargs="+", choices=names, default=names, metavar="CASE",
                         help=f"press only these, in this order; the record keeps the others. Cases: {', '.join(names)}")
    options.add_argument("--mesh", choices=MESHES, default="default")
    options.add_argument("--limit-s", type=float, default=1800.0, help="processor seconds of a press, 1800 by default")
    options.add_argument("--resume", action="store_true", help="press only what the last record lacks")
    options.add_argument("--write-docs", action="store_true",
                         help="put the last record on the default mesh into docs/explanation/unknowns.md, without a press")
    given = options.parse_args()
    path = record.RESULTS / f"{record_name('default' if given.write_docs else given.mesh)}.json"
    kept = given.resume or given.write_docs or given.cases != names
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"] if kept and path.exists() else []
    if given.write_docs:
        return write_page(rows)
    for file in given.objects:
        there = {row["case"] for row in rows if given.resume and row["object"] == Path(file).stem}
        conditions = Conditions(Path(file).stem, read_mesh(file, unit="mm"), given.mesh, given.limit_s)
        measured(conditions, [name for name in given.cases if name not in there], rows)
    print(path)


if __name__ == "__main__":
    main()
