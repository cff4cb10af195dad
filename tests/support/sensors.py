"""The sensors that ship with the package, as the tests take them: only described, nothing computed."""

from softtact.sensors.fields import CalibrationBlock
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

CORO = SensorSpec.from_yaml(sensor_file("coro"))
PAD = SensorSpec.from_yaml(sensor_file("pad"))


def zeroed_at(spec: SensorSpec, zero_counts: float) -> SensorSpec:
    """The sensor with a calibration whose taxels all read `zero_counts` at rest."""
    rows, columns = spec.taxels.rows, spec.taxels.columns
    block = CalibrationBlock(gain=((1.0,) * columns,) * rows, zero_counts=((zero_counts,) * columns,) * rows,
                             counts_per_relative_change=1000.0, source="a test")
    return spec.model_copy(update={"calibration": block})
