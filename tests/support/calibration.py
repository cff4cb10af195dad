"""A small sensor with hidden constants and recordings of it, by the elastic model: seconds in place of minutes."""

from dataclasses import dataclass, replace

import numpy as np
import trimesh
import yaml
from simulated_recordings import HiddenConstants, simulate_recording, staircase_force

from softtact.calibration.experiment import experiment
from softtact.calibration.ladder import Presses
from softtact.press.sensor import load_sensor
from softtact.sensors.base import read_mapping
from softtact.sensors.library import sensor_file

PLATE = trimesh.creation.box((11, 11, 3))                       # wider than the sensor: all taxels feel it
BALL = trimesh.creation.icosphere(subdivisions=3, radius=8.0)
BAR = trimesh.creation.box((2.4, 4.5, 3))
BLOCK = trimesh.creation.box((4.5, 2.4, 3))
LEVELS_N = (1.0, 2.5, 5.0)


def small_sensor_file(folder):
    """The file of a piece of the paper's sensor, 7.2 x 7.2 mm, with its 7 x 4 taxels."""
    values = read_mapping(sensor_file("coro")) | {"name": "small", "footprint_mm": [7.2, 7.2], "map_shape": [13, 13],
                                                 "force_range_n": [0.0, 10.0]}
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


@dataclass(frozen=True)
class Bench:
    """A sensor, its presses and the specimen that is recorded."""

    presses: Presses
    hidden: HiddenConstants

    @classmethod
    def made(cls, folder, *, seed=1):
        sensor = load_sensor(small_sensor_file(folder))
        return cls(Presses(sensor, model="elastic"), replace(HiddenConstants.drawn(sensor, seed=seed), modulus_scale=1.15))

    def recording(self, mesh, place, *, levels=LEVELS_N, finger=0, seed=0, file="press.csv"):
        """A recording of an object that really lies at `place`."""
        time, force = staircase_force(levels, hold_s=1.0, rate_n_per_s=10.0)
        return simulate_recording(self.presses, mesh, self.hidden, time, force, place=place, finger=finger, seed=seed, file=file)

    def experiment(self, mesh, place, *, off=(0.0, 0.0, 0.0), **options):
        """An experiment whose object lies `off` beside where it is said to lie."""
        return experiment(self.recording(mesh, np.add(place, off), **options), mesh, place=place)
