"""Presses of gels: `python benchmarks/gels.py` writes benchmarks/results/gels.json.

sequences   26 frames (rest, 15 steps of 0.1 mm down, 10 of 0.1 mm aside) on the paper's gel, points 0.125 mm apart: seconds of the
            processor on one core, the kernels made, the least and the middle of some runs
twin        the same motion on a small sheet by the wide layer and by the dense compliance of its finite elements
"""

import argparse
import os
import time

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))

import numpy as np
import record
import trimesh

import softtact
from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.models.elastic.sliding import move_on_layer
from softtact.models.elastic.tangential import surface_compliance
from softtact.models.elastic.wide_layer import WideLayer
from softtact.models.elastic.wide_motion import follow_motion
from softtact.models.elastic.wide_sliding import WideObject
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

MOTION = "z -1.5 in 15; x 1.0 in 10"
OBJECTS = {"ball, radius 4 mm": trimesh.creation.icosphere(subdivisions=5, radius=4.0),
           "ball, radius 2.5 mm": trimesh.creation.icosphere(subdivisions=5, radius=2.5),
           "box, 6 x 6 mm": trimesh.creation.box((6.0, 6.0, 4.0)),
           "torus, radii 4 and 1.5 mm": trimesh.creation.torus(4.0, 1.5)}


def seconds(act, runs):
    """Seconds of the processor of each run, and what the last one returned."""
    found, times = None, []
    for _ in range(runs):
        start = time.process_time()
        found = act()
        times.append(time.process_time() - start)
    return times, found


def sequences(runs):
    """A row for each object."""
    sensor, rows = softtact.load_sensor("gelsight_wonkdim"), []
    start = time.process_time()
    sensor.prepared("elastic")
    preparation = time.process_time() - start
    for name, mesh in OBJECTS.items():
        sensor.press(mesh, motion="z -0.1; x 0.1", label="")
        times, result = seconds(lambda mesh=mesh: sensor.press(mesh, motion=MOTION, label=""), runs)
        rows.append({"object": name, "least_s": round(min(times), 3), "median_s": round(float(np.median(times)), 3),
                     "points_in_contact": int((result.traction_mpa[-1, ..., 2] < 0).sum()),
                     "force_n": np.round(result.force_n[-1], 3).tolist(),
                     "penetration_mm": round(float(result.penetration_mm.max()), 4)})
        print(rows[-1], flush=True)
    return {"frames": 26, "spacing_mm": 0.125, "prepared_once_s": round(preparation, 2), "rows": rows}


def twin(runs):
    """Seconds of both on a sheet of 8 x 8 x 1 mm with nodes 0.2 mm apart."""
    coro = SensorSpec.from_yaml(sensor_file("coro"))
    cover = coro.cover.model_copy(update={"thickness_mm": 1.5 - coro.dielectric_thickness_mm})
    spec = coro.model_copy(update={"footprint_mm": (8.0, 8.0), "map_shape": (21, 21), "cover": cover})
    surface = HeightField(trimesh.creation.icosphere(subdivisions=4, radius=4.0).apply_translation([0.03, -0.02, 4.0]))
    motion, line = Motion.parse("z -0.3 in 3; x 0.5 in 5"), np.linspace(-4.0, 4.0, 41)
    dense = surface_compliance(spec)
    wide = WideLayer.of(spec.elastic_layer, spec.thickness_mm, (0.2, 0.2), (41, 41))
    how = {"first_touch_mm": 0.0, "friction": 0.4}
    acts = {"dense": lambda: move_on_layer(dense, surface, motion, deepest_mm=1.0, **how).force_n,
            "wide": lambda: np.array([step.force_n.sum(axis=(0, 1)) for step in follow_motion(
                WideObject(wide, surface, (line, line), **how), motion, deepest_mm=1.0)])}
    found = {}
    for name, act in acts.items():
        act()
        times, force = seconds(act, runs)
        found |= {f"{name}_s": round(min(times), 3), f"{name}_force_n": np.round(force[-1], 4).tolist()}
    return found | {"ratio": round(found["dense_s"] / found["wide_s"], 1)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    numbers = {"sequences": sequences(runs), "twin": twin(runs)}
    print(numbers["twin"])
    record.write("gels", **numbers)


if __name__ == "__main__":
    main()
