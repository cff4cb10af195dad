"""Contacts that nobody tuned for, on coro with the hyperelastic model: how many reach 20 N, or the force that crushes frusta?

    python benchmarks/hard_contacts.py [--presses 100] [--set judged] [--workers 1]     one press: --one NUMBER

Plugs, walls, boxes and rods, hollow and thin, one to three of them at two heights, tilted by up to 45 degrees, anywhere over the
sensor, its sides and corners included; draft mesh, load steps 5, 10 and 20 N. Where frusta may be crushed from a smaller force on,
load steps from there rise by a quarter, and the press ends with the first that is flagged for crushed frusta alone: it reached the
force that crushes. It counts as reached if each load step to 20 N is valid; both within 360 seconds of the processor, three minutes
of two cores. One that is neither has been told if it ended within 60 seconds, was foretold, or warned within them that increments
find no balance (since 30 November; rows before have no `warned_s`). (Sets up to seed 20261204 ended at
the force from which frusta may be crushed, and counted those as reached.) Work on
the solver with the set `trial` alone: after its last change take a new SEED, so that nobody has seen the contacts on which it is
judged. The run goes on from where the record ends; record: benchmarks/results/hard_contacts.json.
"""

import argparse
import json
import multiprocessing
import signal
import time
import warnings
from functools import partial

import numpy as np
import record
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import HardPressWarning, InputError, SofttactError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.models.hyperelastic.mesh_settings import MeshSettings, NewtonSettings
from softtact.press.foretelling import foretell
from softtact.press.sensor import load_sensor
from softtact.press.validity import BETWEEN

SEED = {"trial": 1, "judged": 20261205}
FORCES_N = np.array([5.0, 10.0, 20.0])
LARGEST_TILT = 45.0
GROWTH = 1.25      # of load steps beyond the force from which frusta may be crushed
LIMIT_S, TOLD_S = 360.0, 60.0      # of the processor
OUTCOMES = ("reached", "crushed", "flagged", "stopped", "late", "refused", "crashed")


def part(rng):
    """One body in mm, tilted, its lowest point at the origin; its name, and its tilt in degrees."""
    size, wall, height = rng.uniform(2.0, 8.0), rng.uniform(0.3, 1.0), 6.0
    name = ("plug", "wall", "box", "rod")[rng.integers(4)]
    body = {"plug": lambda: trimesh.creation.annulus(r_min=0.5 * size, r_max=0.5 * size + wall, height=height, sections=64),
            "wall": lambda: trimesh.creation.box((wall, size, height)),
            "box": lambda: trimesh.creation.box((size, rng.uniform(2.0, 8.0), height)),
            "rod": lambda: trimesh.creation.cylinder(radius=0.25 * size, height=height, sections=64)}[name]()
    tilt, about = rng.uniform(0, LARGEST_TILT), rng.uniform(0, 2 * np.pi)
    turn = Rotation.from_rotvec(np.radians(tilt) * np.array([np.cos(about), np.sin(about), 0.0]))
    body.vertices = turn.apply(body.vertices)
    return body.apply_translation(-body.vertices[body.vertices[:, 2].argmin()]), name, round(float(tilt), 1)


def contact(seed, number, spec):
    """The mesh of a contact, its pose, and names and tilts of its bodies: beside each other, every second one higher."""
    rng = np.random.default_rng([seed, number])
    parts = [part(rng) for _ in range(rng.integers(1, 4))]
    for k, (body, _, _) in enumerate(parts):
        body.apply_translation([10.0 * k, 0.0, rng.uniform(0.05, 0.4) * (k % 2)])
    turn = Rotation.from_euler("z", rng.uniform(0, 360), degrees=True)
    target = rng.uniform(-0.5, 0.5, 2) * spec.footprint_mm      # of the first body's lowest point
    pose = Pose(np.append(target, 0.0), turn)
    return trimesh.util.concatenate([body for body, _, _ in parts]), pose, [f"{name} {tilt:g}" for _, name, tilt in parts]


def outcome(sensor, mesh, pose):
    """What became of a press: a row of numbers and words for the record."""
    start = time.process_time()
    row = {"reached_n": 0.0, "least_volume_ratio": None, "warned_s": None, "why": ""}

    def noting(*_, **__):
        row["warned_s"] = row["warned_s"] or round(time.process_time() - start, 1)

    warnings.showwarning = noting
    try:
        told = foretell(sensor, place(mesh, pose=pose), FORCES_N[-1])
        row["crushed_from_n"] = round(told.may_crush_n, 2) if np.isfinite(told.may_crush_n) else None
        row["grazed_frusta"] = told.grazed_frusta and round(told.grazed_frusta, 1)
        signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
        try:
            result = sensor.press(mesh, pose=pose, force_n=load_steps(told.may_crush_n), model="hyperelastic", threads=1, label="",
                                  on_step=end_crushed)
        except _Crushed as crushed:
            result = crushed.result
        row["outcome"] = "reached" if result.within_validity.all() else "crushed" if crushed_last(result) else "flagged"
        row["why"] = next(filter(None, result.validity_reason), "")
    except _TooLong:
        row |= {"outcome": "late", "why": f"{LIMIT_S:g} s of the processor"}
        result = None
    except SofttactError as error:
        row |= {"outcome": "refused" if isinstance(error, InputError) else "stopped", "why": str(error)}
        result = getattr(error, "result", None)
    except Exception as error:      # whatever it is, it is what is looked for
        row |= {"outcome": "crashed", "why": f"{type(error).__name__}: {error}"}
        result = None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    if result is not None and result.steps:
        row |= {"reached_n": round(float(result.normal_force_n[-1]), 2),
                "least_volume_ratio": round(float(result.least_volume_ratio.min()), 3)}
    row["processor_s"] = round(time.process_time() - start, 1)
    foretold = any(row.get(name) is not None for name in ("crushed_from_n", "grazed_frusta"))
    soon = min(row["processor_s"], row["warned_s"] or np.inf) <= TOLD_S
    row["told"] = row["outcome"] not in ("reached", "crushed") and (foretold or soon)
    return row


def load_steps(may_crush_n):
    """Forces in N: as stated, and ever nearer to the one that crushes frusta from where they may be crushed."""
    if may_crush_n >= FORCES_N[-1]:
        return FORCES_N
    count = int(np.ceil(np.log(FORCES_N[-1] / may_crush_n) / np.log(GROWTH)))
    return np.unique(np.minimum([*FORCES_N[FORCES_N < may_crush_n], *may_crush_n * GROWTH ** np.arange(count + 1)], FORCES_N[-1]))


def end_crushed(result):
    """End a press whose last load step is flagged for crushed frusta."""
    if not result.within_validity[-1] and crushed_last(result):
        raise _Crushed(result)


def crushed_last(result):
    """Whether load steps are flagged from the one on at which frusta are crushed, and for nothing else."""
    first = int(np.argmin(result.within_validity))
    return all("when its pocket is full" in why and all("when its pocket is full" in reason or reason.startswith("frusta fold on")
                                                        for reason in why.split(BETWEEN)) for why in result.validity_reason[first:])


class _Crushed(Exception):
    """Raised within a press by its first load step that crushes frusta."""

    def __init__(self, result):
        super().__init__("crushed")
        self.result = result


class _TooLong(BaseException):
    """Raised by the processor's timer; no handler of errors in between may take it for one."""


def _too_long(*_):
    raise _TooLong


def interval(good, count):
    """Wilson's 95 % interval of a share."""
    z, share = 1.959964, good / count
    middle, half = share + z**2 / (2 * count), z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return [round(float((middle + sign * half) / (1 + z**2 / count)), 3) for sign in (-1, 1)]


def summary(rows):
    """Counts of the outcomes, and the share that reached its force or the one that crushes frusta, with its interval."""
    counts = {name: sum(row["outcome"] == name for row in rows) for name in OUTCOMES}
    reached = counts["reached"] + counts["crushed"]
    return {"presses": len(rows), **counts, "told_of_the_rest": sum(row["told"] for row in rows),
            "share": round(reached / len(rows), 3), "share_95_percent": interval(reached, len(rows))}


def rows_of(name):
    """Rows of a set in the record, if they were drawn with its seed."""
    path = record.RESULTS / "hard_contacts.json"
    sets = json.loads(path.read_text(encoding="utf-8"))["sets"] if path.exists() else {}
    here = sets.get(name, {})
    return sets, here.get("rows", []) if here.get("seed") == SEED[name] else []


def prepare():
    """Load the sensor of this process, and listen to its processor's timer."""
    global _sensor
    warnings.simplefilter("ignore")
    warnings.simplefilter("always", HardPressWarning)
    signal.signal(signal.SIGPROF, _too_long)
    _sensor = load_sensor("coro")
    _sensor.mesh, _sensor.solver = MeshSettings.draft(), NewtonSettings.draft()
    _sensor.prepared("foundation")


def pressed(name, number):
    """The row of one contact of a set."""
    mesh, pose, bodies = contact(SEED[name], number, _sensor.spec)
    return {"number": number, "bodies_and_tilts": bodies, **outcome(_sensor, mesh, pose)}


def main():
    """Press on from the end of the record, and keep it after each press; or one press again."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presses", type=int, default=100)
    parser.add_argument("--set", choices=SEED, default="judged", dest="name")
    parser.add_argument("--workers", type=int, default=1, help="presses side by side, one thread each")
    parser.add_argument("--one", type=int, metavar="NUMBER")
    options = parser.parse_args()
    prepare()      # here, too, so that workers find what it caches
    if options.one is not None:
        print(pressed(options.name, options.one))
        return
    sets, rows = rows_of(options.name)
    with multiprocessing.get_context("spawn").Pool(options.workers, prepare) as workers:
        for row in workers.imap(partial(pressed, options.name), range(len(rows), options.presses)):
            print(row, flush=True)
            rows.append(row | {"why": row["why"][:200]})
            sets[options.name] = {"seed": SEED[options.name], **summary(rows), "rows": rows}
            record.write("hard_contacts", sets=sets)


if __name__ == "__main__":
    main()
