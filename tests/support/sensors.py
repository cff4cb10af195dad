"""The sensors that ship with the package, as the tests take them: only described, nothing computed."""

from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

CORO = SensorSpec.from_yaml(sensor_file("coro"))
PAD = SensorSpec.from_yaml(sensor_file("pad"))
