"""The sensor as one callable in a robot-learning loop: contact poses in, tactile maps out, a batch at a time.

    python examples/robot_loop.py --steps 5 --batch 16

There is no robot and no learning here. A random policy moves an indenter sideways over the sensor; the loop shows where simulator,
policy and reward belong. Presses are independent of each other: no sliding, no history, no friction. Expect a few contacts a second
on a core with the elastic model. `--network` reads the taxels by a network that a study trained, in place of the ideal readout.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

import softtact
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import Pose

INDENTER = Path(__file__).parents[1] / "config/objects/indenters/circle_s.stl"


@dataclass
class TactileSensor:
    """Call it with poses (n, 6) of the object (x, y, z mm; rx, ry, rz degrees) and a normal force in N.

    It gives tactile maps (n, row, column) in counts.
    sensor: a `softtact` sensor;  mesh: the object, in mm;  network: or None for the ideal readout
    """

    sensor: object
    mesh: trimesh.Trimesh
    model: str = "elastic"
    network: object = None
    workers: int = 1

    def __call__(self, poses, *, force_n):
        poses = [Pose.from_values(pose) for pose in poses]
        results = self.sensor.press_many(self.mesh, poses, force_n=[force_n], model=self.model, workers=self.workers, label="")
        if self.network is None:
            return np.stack([result.tactile_map[0] for result in results])
        from softtact.learning.network import predict

        return predict(self.network, np.stack([result.deformation_map_mm[0] for result in results]))


class RandomPolicy:
    """Random steps (n, 2) in mm, whatever the maps. A trained policy would use the tactile maps."""

    def __init__(self, *, seed):
        self._rng = np.random.default_rng(seed)

    def __call__(self, tactile):
        return self._rng.normal(0.0, 1.0, (len(tactile), 2))


def centre_of_touch(tactile):
    """Centroid (n, 2) of each map's counts, row and column from 0 to 1; a reward could use it."""
    rows, columns = (np.linspace(0, 1, count) for count in tactile.shape[1:])
    total = np.maximum(tactile.sum(axis=(1, 2)), 1e-9)
    return np.column_stack([(tactile.sum(axis=2) @ rows) / total, (tactile.sum(axis=1) @ columns) / total])


def main(arguments=None):
    options = parse(arguments)
    sensor = softtact.load_sensor("coro")
    read = TactileSensor(sensor, read_mesh(INDENTER, unit="mm"), network=trained(options.network), workers=options.workers)
    policy, poses = RandomPolicy(seed=options.seed), np.zeros((options.batch, 6))
    reach, start = 0.25 * np.array(sensor.spec.footprint_mm), time.perf_counter()
    for step in range(options.steps):
        tactile = read(poses, force_n=options.force)                                       # (n, 7, 4) counts
        poses[:, :2] = np.clip(poses[:, :2] + policy(tactile), -reach, reach)
        row, column = centre_of_touch(tactile).mean(axis=0)
        print(f"step {step}: {tactile.shape} counts up to {tactile.max():.0f}, mean centre of touch ({row:.2f}, {column:.2f})")
    contacts = options.steps * options.batch
    print(f"{contacts / (time.perf_counter() - start):.0f} contacts a second; a random policy, no robot")
    return tactile


def trained(path):
    """The network of a study's model.pt, or None."""
    if path is None:
        return None
    from softtact.learning.network import load_network

    return load_network(path)[0]


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=5)
    parser.add_argument("--batch", type=int, default=16, help="contacts at once")
    parser.add_argument("--force", type=float, default=15.0, help="normal force of each contact, in N")
    parser.add_argument("--network", type=Path, help="model.pt of a study, trained on the elastic model's maps")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
