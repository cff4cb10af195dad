"""A small training set: one indenter in random places, pressed with some forces, read by the virtual sensor.

    python examples/make_training_set.py --presses 40 --out training_set.nc

It writes pairs of a deformation map (mm, from the simulation) and a tactile map (counts, as a sensor would read), with the force
and pose of each. The elastic model presses, in some tenths of a second each. The virtual sensor reads, with creep, scatter and
noise (docs/explanation/virtual_sensor.md); `--ideal` takes an ideal readout of the same map. Neither is a measurement. A network
that learns from readings of its input maps learns only the readout. The studies therefore read a press of another law and mesh.
"""

import argparse
from pathlib import Path

import numpy as np
import xarray

import softtact
from softtact.files import write_dataset
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import Pose
from softtact.readout.virtual_sensor import read_virtual_sensor

INDENTER = Path(__file__).parents[1] / "config/objects/indenters/circle_s.stl"
FORCES_N = [5.0, 10.0, 20.0, 30.0]


def main(arguments=None):
    options = parse(arguments)
    sensor = softtact.load_sensor(options.sensor)
    poses = random_poses(sensor.spec, options.presses, seed=options.seed)
    results = sensor.press_many(read_mesh(INDENTER, unit="mm"), [Pose.from_values(pose) for pose in poses], force_n=FORCES_N,
                                model=options.model, workers=options.workers)
    data = pairs(sensor, results, poses, ideal=options.ideal, seed=options.seed)
    write_dataset(options.out, data, seed=options.seed, settings=vars(options) | {"out": None})
    print(f"{data.sizes['sample']} pairs of maps {data.deformation_map_mm.shape[1:]} in mm and {data.tactile_map.shape[1:]} in "
          f"counts ({data.attrs['source']}): {options.out}")
    return data


def random_poses(spec, count, *, seed):
    """Poses (count, 6) in mm and degrees: within a quarter of the sides from the middle, rotated about z, touching."""
    rng, sides = np.random.default_rng(seed), np.array(spec.footprint_mm)
    poses = np.zeros((count, 6))
    poses[:, :2] = rng.uniform(-0.25, 0.25, (count, 2)) * sides
    poses[:, 5] = rng.uniform(-180, 180, count)
    return poses


def pairs(sensor, results, poses, *, ideal, seed):
    """Data set with dimensions sample (press by press, force by force), y, x, row, column."""
    counts = [result.tactile_map if ideal else read_virtual_sensor(sensor.spec, result.deformation_map_mm,
                                                                   force_n=result.normal_force_n,
                                                                   trials=1, seed=seed, item=f"press {k}")[0]
              for k, result in enumerate(results)]
    load_steps = len(FORCES_N)
    return xarray.Dataset({
        "deformation_map_mm": (("sample", "y", "x"), np.concatenate([r.deformation_map_mm for r in results]), {"units": "mm"}),
        "tactile_map": (("sample", "row", "column"), np.concatenate(counts), {"units": "counts"}),
        "force_n": ("sample", np.concatenate([r.normal_force_n for r in results]), {"units": "N"}),
        "pose": (("sample", "six"), np.repeat(poses, load_steps, axis=0), {"units": "mm, degrees"}),
    }, coords={"x": results[0].x_mm, "y": results[0].y_mm},
        attrs={"model": results[0].model, "sensor": results[0].sensor, "source": "ideal readout" if ideal else "virtual sensor"})


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--presses", type=int, default=40)
    parser.add_argument("--sensor", default="coro")
    parser.add_argument("--model", default="elastic", choices=("elastic", "foundation"))
    parser.add_argument("--ideal", action="store_true", help="an ideal readout in place of the virtual sensor")
    parser.add_argument("--workers", type=int, help="processes; by default one for each core")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("training_set.nc"))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
