"""A thousand random presses of each model: does one crash, hang, or return nonsense that it does not flag?

    python benchmarks/random_presses.py [--models elastic foundation hyperelastic] [--presses 1000] [--jobs 1]

Objects of config/objects, from a third of the sensor's side to all of it, in any turn, tilted by up to 25 degrees, anywhere over
it; forces up to the sensor's pressure at full range; laws and constants anew every 25 presses. The sensor is a piece of the
default one, 8 x 8 frusta, 4 x 4 for the hyperelastic model on the draft mesh. The seed is the press' number: `--one MODEL NUMBER`
presses it again, and an ended run goes on. Counts: benchmarks/results/random_presses.json, from there
docs/reference/verification.md.
"""

import argparse
import json
import multiprocessing
import signal
import time
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import record
from scipy.spatial.transform import Rotation

from softtact.errors import ConvergenceError, InputError
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import Pose
from softtact.materials.laws.registry import make_law
from softtact.models.elastic.compliance import elastic_compliance
from softtact.models.foundation.compliance import foundation_compliance
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.press.sensor import Sensor
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

CONFIG = Path(__file__).resolve().parents[1] / "config"
OBJECTS = sorted(CONFIG.glob("objects/*/*.stl"))
MODELS = ("elastic", "foundation", "hyperelastic")
FRUSTA = {"elastic": 8, "foundation": 8, "hyperelastic": 4}     # on a side of the sensor
PITCH_MM = 1.2
LARGEST_MPA = 6 / 9.6**2   # 50 N on the default sensor, 22 x 37 mm, and somewhat more
A_SENSOR = 25              # presses
ALLOWED_MM = 0.02          # of overlap, as the studies have it; less depth than this is none
HANGS_S = 300              # for a press of a few seconds
# outside: without a fault, but with load steps that are told to be outside validity;  flagged: with faults, at such load steps only
OUTCOMES = ("reached", "outside", "flagged", "stopped", "refused", "nonsense", "hung", "crashed")


def random_sensor(number, model):
    """The sensor of a block of presses: a law of its own in each layer, and an elastic layer of its own."""
    rng, side = np.random.default_rng([1, number]), PITCH_MM * FRUSTA[model]
    spec = SensorSpec.from_yaml(sensor_file("coro")).model_copy(
        update={"footprint_mm": (side, side), "map_shape": (2 * FRUSTA[model] + 1,) * 2,
                "force_range_n": (0.0, LARGEST_MPA * side**2)})
    layer = spec.elastic_layer.model_copy(update={"young_mpa": rng.uniform(0.5, 3.0), "poisson": rng.uniform(0.1, 0.45)})
    spec = spec.model_copy(update={"elastic_layer": layer})
    sensor = Sensor(spec, {name: random_law(rng) for name in ("dielectric", "cover")}, mesh=MeshSettings.draft(),
                    solver=NewtonSettings(largest_penetration_mm=ALLOWED_MM))
    if model == "elastic":
        sensor.prepared_models["elastic"] = elastic_compliance(spec)
    if model == "foundation":
        sensor.prepared_models["foundation"] = foundation_compliance(spec, dielectric_law=sensor.laws["dielectric"],
                                                            cover_law=sensor.laws["cover"])
    return sensor


def random_law(rng):
    """Neo-Hooke, Mooney-Rivlin or Yeoh of shear modulus 0.15 to 0.6 MPa and K / mu 5 to 25."""
    mu, ratio, share = np.exp(rng.uniform(np.log(0.15), np.log(0.6))), rng.uniform(5, 25), rng.uniform(0, 0.3)
    name, constants = [("neo_hooke", {"c10": 0.5 * mu}),
                       ("mooney_rivlin", {"c10": 0.5 * mu * (1 - share), "c01": 0.5 * mu * share}),
                       ("yeoh", {"c10": 0.5 * mu, "c20": 0.02 * mu * share, "c30": 0.01 * mu * share})][rng.integers(3)]
    return make_law(name, constants, bulk_over_shear=ratio)


def random_press(number, model):
    """Mesh, pose and forces (N) of a press on the model's sensor."""
    rng, side = np.random.default_rng([2, number]), PITCH_MM * FRUSTA[model]
    mesh = read_mesh(OBJECTS[rng.integers(len(OBJECTS))], unit="mm")
    mesh.apply_scale(side * rng.uniform(0.33, 1.0) / max(mesh.extents[:2]))
    turn = Rotation.from_euler("xyz", [*rng.uniform(-25, 25, 2), rng.uniform(0, 360)], degrees=True)
    low = turn.apply(mesh.vertices)
    middle = 0.5 * (low.min(axis=0) + low.max(axis=0))
    place = rng.uniform(-0.5, 0.5, 2) * side
    pose = Pose(np.array([*(place - middle[:2]), -low[:, 2].min()]), turn)
    return mesh, pose, np.sort(rng.uniform(0.02, LARGEST_MPA * side**2, rng.integers(1, 4)))


def outcome(sensor, model, number):
    """What became of a press, one of OUTCOMES, and the reason if it is not `reached`."""
    mesh, pose, forces = random_press(number, model)
    try:
        result = sensor.press(mesh, pose=pose, force_n=forces, model=model, threads=1)
    except InputError as error:
        return "refused", str(error)
    except ConvergenceError as error:
        return "stopped", str(error)
    except TimeoutError:
        return "hung", f"{HANGS_S} s"
    except Exception as error:      # whatever it is, it is what is looked for
        return "crashed", f"{type(error).__name__}: {error}"
    return judged(result, sensor)


def judged(result, sensor):
    """The outcome of a press that has a result: all its load steps with a fault must be flagged."""
    faults, told = nonsense(result, sensor), result.within_validity == 0
    if faults:
        which = ", ".join(faults)
        return ("flagged", which) if told[np.any(list(faults.values()), axis=0)].all() else ("nonsense", which)
    return ("outside", f"{np.count_nonzero(told)} of {len(told)} load steps") if told.any() else ("reached", "")


def nonsense(result, sensor):
    """What cannot be of a result: {what: at which load steps (l,)}; empty where all can."""
    maps, depth = result.deformation_map_mm, result.indentation_mm
    falls = np.diff(depth) < -ALLOWED_MM
    finite = np.isfinite(maps).all(axis=(1, 2)) & np.isfinite(depth) & np.isfinite(result.tactile_map).all(axis=(1, 2))
    found = {"numbers that are not finite": ~finite,
             "a map deeper than the object": maps.max(axis=(1, 2)) > depth + ALLOWED_MM,
             "a map beyond the layer": maps.max(axis=(1, 2)) > sensor.spec.thickness_mm,
             "less depth at more force": np.append(falls, False) | np.append(False, falls),
             "overlap": result.penetration_mm > 2 * ALLOWED_MM,
             "no contact": result.contact_area_mm2 <= 0,
             "a balance that is none": result.residual_n > 1e-2 * np.maximum(result.normal_force_n, 1)}
    return {name: where for name, where in found.items() if where.any()}


def told():
    """The counts of each model in the record."""
    path = record.RESULTS / "random_presses.json"
    return json.loads(path.read_text(encoding="utf-8"))["models"] if path.exists() else {}


def press_block(model, block):
    """Rows [number, outcome, reason] of the presses of a sensor, and processor time in s."""
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, _too_long)
    start, rows = time.process_time(), []
    sensor = random_sensor(block, model)
    for number in range(block * A_SENSOR, (block + 1) * A_SENSOR):
        signal.alarm(HANGS_S)
        rows.append([number, *outcome(sensor, model, number)])
        signal.alarm(0)
    return rows, time.process_time() - start


def measure(model, presses, jobs):
    """Press from where the record ends, and keep the record after each sensor's presses."""
    row = told().get(model, {"presses": 0, **dict.fromkeys(OUTCOMES, 0), "processor_s": 0.0, "notes": []})
    blocks = range(row["presses"] // A_SENSOR, -(-presses // A_SENSOR))     # whole blocks
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        for rows, seconds in pool.imap(partial(press_block, model), blocks):
            row["presses"] += len(rows)
            row["processor_s"] = round(row["processor_s"] + seconds, 1)
            for number, what, selection_reason in rows:
                row[what] += 1
                if what not in ("reached", "outside"):
                    row["notes"].append([number, what, selection_reason[:300]])
            record.write("random_presses", models=told() | {model: row})     # another process may count another model
            print(model, {name: row[name] for name in ("presses", *OUTCOMES)}, flush=True)


def _too_long(*_):
    raise TimeoutError


def main():
    """Run the models one after the other, or one press again."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", choices=MODELS, default=MODELS)
    parser.add_argument("--presses", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--one", nargs=2, metavar=("MODEL", "NUMBER"))
    options = parser.parse_args()
    if options.one:
        warnings.simplefilter("ignore")
        model, number = options.one[0], int(options.one[1])
        print(": ".join(outcome(random_sensor(number // A_SENSOR, model), model, number)))
        return
    for model in options.models:
        measure(model, options.presses, options.jobs)


if __name__ == "__main__":
    main()
