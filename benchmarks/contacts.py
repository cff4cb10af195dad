"""Random contacts of a fixed seed, as people have them: `python benchmarks/contacts.py press --set hard --out FOLDER`.

Three sets of objects, none in two of them; each contact is one object in one pose:
  easy   balls, boxes, bars, cylinders, rings, pins inside the pad, straight, on several sensors: what expected errors are fitted to
  unseen the same kinds and others, in other sizes, for testing what was fitted
  hard   tilted, edged, or over the pad's rim: does a press end, and how soon
Each press leaves FOLDER/NAME.npz with its maps as they are reached; what is there is not pressed again, but what stopped early is
with `--again`, which may have more threads. `report` says how many
ended in time and writes benchmarks/results/contacts.json.
"""

import argparse
import json
import multiprocessing
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import record
import trimesh

import softtact
from softtact.errors import SofttactError
from softtact.geometry.pose import Pose
from softtact.models.hyperelastic.mesh_settings import PRESETS

COUNTS = {"easy": 70, "unseen": 35, "hard": 100}
FORCES = {"easy": [2.0, 5.0, 10.0, 20.0, 35.0, 50.0], "unseen": [3.0, 8.0, 15.0, 30.0, 45.0], "hard": [2.0, 5.0, 10.0, 20.0]}
SEEDS = {"easy": 11, "unseen": 12, "hard": 13}
IN_TIME_S = 180.0


@dataclass(frozen=True)
class Contact:
    """One object in one pose on one sensor."""

    name: str
    sensor: str
    kind: str
    sizes_mm: tuple
    pose: tuple
    forces_n: tuple

    @property
    def mesh(self):
        return KINDS[self.kind](*self.sizes_mm)


def _turned(mesh):
    """An upright solid lying along x."""
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return mesh


def _pins(diameter, apart):
    parts = [trimesh.creation.cylinder(radius=diameter / 2, height=6.0, sections=48) for _ in range(2)]
    parts[0].apply_translation([-apart / 2, 0, -3])
    parts[1].apply_translation([apart / 2, 0, -3])
    plate = trimesh.creation.box((apart + 2 * diameter, 2 * diameter, 2.0))
    plate.apply_translation([0, 0, 0.9])
    return trimesh.boolean.union([*parts, plate])


def _ridges(width, gap, length):
    parts = []
    for k in (-1, 0, 1):
        part = trimesh.creation.box((width, length, 4.0))
        part.apply_translation([k * (width + gap), 0, -2])
        parts.append(part)
    plate = trimesh.creation.box((3 * width + 2 * gap, length, 2.0))
    plate.apply_translation([0, 0, 0.9])
    return trimesh.boolean.union([*parts, plate])


KINDS = {
    "ball": lambda r: trimesh.creation.icosphere(subdivisions=4, radius=r),
    "box": lambda x, y: trimesh.creation.box((x, y, 8.0)),
    "punch": lambda d: trimesh.creation.cylinder(radius=d / 2, height=10.0, sections=96),
    "roller": lambda r, length: _turned(trimesh.creation.cylinder(radius=r, height=length, sections=256)),
    "ring": lambda inner, outer: trimesh.creation.annulus(r_min=inner / 2, r_max=outer / 2, height=6.0, sections=96),
    "cone": lambda d: trimesh.creation.icosphere(subdivisions=4, radius=d),
    "egg": lambda a, b: trimesh.creation.icosphere(subdivisions=4).apply_scale([a, b, min(a, b)]),
    "pins": _pins,
    "ridges": _ridges,
    "wedge": lambda angle, length: _wedge(angle, length),
}
del KINDS["cone"]


def _wedge(angle, length):
    """A roof of which the blunt ridge, 2 mm wide, looks down."""
    half = 6.0 * np.tan(np.radians(angle / 2)) + 1.0
    profile = np.array([[-1, -3], [1, -3], [half, 3], [-half, 3]], dtype=float)
    points = np.array([[x, y, z] for y in (-length / 2, length / 2) for x, z in profile])
    return trimesh.convex.convex_hull(points)


SIZES = {"ball": [(4, 40)], "box": [(5, 30), (5, 42)], "punch": [(6, 24)], "roller": [(4, 40), (6, 44)],
         "ring": [(4, 9), (12, 22)], "egg": [(6, 20), (8, 30)], "pins": [(4, 7), (9, 14)], "ridges": [(2, 4), (2, 4), (10, 40)],
         "wedge": [(90, 160), (8, 40)]}


def contacts(which):
    """The `Contact`s of a set, the same ones always."""
    rng, kinds, out = np.random.default_rng(SEEDS[which]), list(SIZES), []
    for number in range(COUNTS[which]):
        kind = kinds[number % len(kinds)]
        sensor = "pad" if which != "hard" and number % 6 == 5 else "coro"
        spec = softtact.load_sensor(sensor).spec
        sizes = tuple(round(float(rng.uniform(*bounds)), 2) for bounds in SIZES[kind])
        half = 0.5 * np.asarray(spec.footprint_mm)
        tilt, reach = (rng.uniform(-12, 12, 2), 0.9) if which == "hard" else (np.zeros(2), 0.25)
        if which != "hard" and number % 5 == 4:
            tilt, reach = rng.uniform(-4, 4, 2), 0.9
        at, turn = rng.uniform(-reach, reach, 2) * half, rng.uniform(0, 180)
        pose = tuple(round(float(value), 3) for value in (*at, 0.0, *tilt, turn))
        forces = tuple(force for force in FORCES[which] if force <= spec.force_range_n[1])
        out.append(Contact(f"{which}_{number:03d}_{kind}", sensor, kind, sizes, pose, forces))
    return out


def placed_pose(contact):
    """The contact's pose with the object's lowest point on the sensing surface."""
    x, y, _, *angles = contact.pose
    at_origin = Pose.from_values([0, 0, 0, *angles])
    return Pose.from_values([x, y, -float(at_origin.apply(contact.mesh.vertices)[:, 2].min()), *angles])


def _stopped_early(file):
    """Whether a contact that was pressed did not reach all its forces."""
    with np.load(file) as data:
        return bool(str(data["reason"]))


def press_one(job):
    """Press a contact with the hyperelastic model; write what was reached, and the reason where not all was."""
    contact, out, limit_s, quality, threads, again = job
    file = out / f"{contact.name}.npz"
    if file.exists() and not (again and _stopped_early(file)):
        return contact.name, "there"
    warnings.simplefilter("ignore")
    clock = time.process_time if threads == 1 else time.perf_counter     # one thread's own time, whatever else the machine does
    softtact.progress.time = SimpleNamespace(monotonic=clock)            # what a time limit is counted by
    sensor = softtact.load_sensor(contact.sensor)
    sensor.mesh, sensor.solver = (make() for make in PRESETS[quality])
    start, reason, result = clock(), "", None
    try:
        result = sensor.press(contact.mesh, pose=placed_pose(contact), force_n=list(contact.forces_n), model="hyperelastic",
                              threads=threads, label="", time_limit_s=limit_s)
    except SofttactError as error:
        reason, result = str(error), getattr(error, "result", None)
    seconds = clock() - start
    kept = {} if result is None else {
        "force_n": result.normal_force_n, "map_mm": result.deformation_map_mm.astype(np.float32), "pad_force_n": result.pad_force_n,
        "indentation_mm": result.indentation_mm, "valid": result.within_validity, "compression_mm": result.frustum_compression_mm,
        "iterations": result.iterations, "wall_time_s": result.wall_time_s}
    np.savez_compressed(file, seconds=seconds, threads=threads, reason=reason, contact=json.dumps(asdict(contact)), **kept)
    return contact.name, f"{seconds:.0f} s {len(kept.get('force_n', ()))}/{len(contact.forces_n)} {reason[:90]}"


def press(arguments):
    """Press the contacts of some sets over processes."""
    arguments.out.mkdir(parents=True, exist_ok=True)
    jobs = [(contact, arguments.out, arguments.limit, arguments.mesh_quality, arguments.threads, arguments.again)
            for which in arguments.set for contact in contacts(which)]
    first_ones = set(arguments.first.read_text().split()) if arguments.first else set()
    jobs.sort(key=lambda job: job[0].name not in first_ones)
    first = softtact.load_sensor("coro")     # compiles, once for all processes
    first.press(trimesh.creation.icosphere(subdivisions=3, radius=4.0), force_n=1.0, model="hyperelastic", threads=1, label="")
    with multiprocessing.get_context("fork").Pool(arguments.workers) as pool:
        for name, said in pool.imap_unordered(press_one, jobs, chunksize=1):
            print(name, said, flush=True)


def report(arguments):
    """How many contacts of each set ended in time, and which did not."""
    rows = []
    for which in COUNTS:
        for contact in contacts(which):
            file = arguments.out / f"{contact.name}.npz"
            if file.exists():
                with np.load(file) as data:
                    rows.append({"name": contact.name, "set": which, "sensor": contact.sensor,
                                 "seconds": float(data["seconds"]), "threads": int(data["threads"]),
                                 "reached_n": float(data["force_n"][-1]) if "force_n" in data else 0.0,
                                 "steps": len(data["force_n"]) if "force_n" in data else 0, "asked": len(contact.forces_n),
                                 "flagged": int((data["valid"] == 0).sum()) if "valid" in data else 0,
                                 "reason": str(data["reason"])})
    for which in COUNTS:
        own = [row for row in rows if row["set"] == which]
        done = [row for row in own if row["steps"] == row["asked"]]
        soon = [row for row in own if row["seconds"] <= IN_TIME_S]
        print(f"{which}: {len(own)} pressed, {len(soon)} ended within {IN_TIME_S:g} s, {len(done)} reached all forces, median "
              f"{np.median([row['seconds'] for row in own]) if own else np.nan:.0f} s")
        for row in own:
            if row["reason"]:
                print(f"   {row['name']}: {row['seconds']:.0f} s, {row['steps']} of {row['asked']} steps: {row['reason'][:150]}")
    print(record.write("contacts", rows=rows))


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("press")
    one.add_argument("--set", nargs="+", choices=COUNTS, required=True)
    one.add_argument("--workers", type=int, default=2)
    one.add_argument("--threads", type=int, default=1, help="of each press")
    one.add_argument("--again", action="store_true", help="press again what did not reach all its forces")
    one.add_argument("--first", type=Path, help="file with names of contacts that are pressed before the others")
    one.add_argument("--limit", type=float, default=IN_TIME_S, help="seconds of one press; of the processor, with one thread")
    one.add_argument("--mesh-quality", default="default", choices=PRESETS)
    one.set_defaults(act=press)
    two = commands.add_parser("report")
    two.set_defaults(act=report)
    for each in (one, two):
        each.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.act(arguments)


if __name__ == "__main__":
    main()
