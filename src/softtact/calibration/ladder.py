"""Presses for a calibration: maps at rising forces of an object at a place, and at slightly changed places and sensors.

The map at any force is interpolated with a spline through these. Dividing all moduli by s divides all forces by s, because
equilibrium is linear in the stresses and nothing else has the dimension of a stress. So a softer sensor at a force is the same
sensor at a larger force.

Friction changes a map by some per cent of its maximum, because the object keeps the cover from sliding outwards. The hyperelastic
model computes this change; the fast models have no friction. From a coefficient of 0.2 on most points stick, so that presses
straight down hardly distinguish larger coefficients. A press with friction depends on its path, so it has as many load steps as
the calibration's presses.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import trimesh

from softtact.errors import ConvergenceError, InputError, ShellWarning
from softtact.press.ladder import Ladder, even_in_root
from softtact.press.result import PressResult
from softtact.press.sensor import Sensor, load_sensor
from softtact.press.validity import touches_lightly
from softtact.progress import announce
from softtact.sensors.fields import SidesBelow
from softtact.sensors.frusta import SensorSpec

LEVELS = 9
SOFTEST = 0.5            # least modulus scale for which the presses reach the forces
REACH_LEVELS = 8         # load steps of the first press, which only finds the largest valid force
COVERS = (0.8, 1.0, 1.25)     # factors of the cover's thickness between which its effect is interpolated
FRICTIONS = (0.0, 0.05, 0.1, 0.2, 0.6)     # coefficients of the object between which its effect is interpolated


class _BeyondError(Exception):
    """Ends a press at the first load step outside the model's validity; `result` holds the load steps."""

    def __init__(self, result):
        super().__init__()
        self.result = result


@dataclass
class Presses:
    """The presses of a calibration, each computed once. `model`: of `Sensor.press`; `variants`: sensors by factor of the cover."""

    sensor: Sensor
    model: str = "foundation"
    levels: int = LEVELS
    known: dict[Any, tuple[trimesh.Trimesh, Ladder]] = field(default_factory=dict)     # a mesh that is gone leaves its id to others
    variants: dict[float, Sensor] = field(default_factory=dict)

    def ladder(self, mesh: trimesh.Trimesh, place: Sequence[float], *, largest_n: float, cover: float = 1.0) -> Ladder:
        """The `Ladder` of an object at a place (x, y in mm, degrees) up to a force in N.

        cover: factor of the sensor's cover thickness. Forces that the model does not reach are left out.
        """
        key = (id(mesh), hash(mesh), *np.round(place, 6), round(largest_n, 6), cover)
        if key not in self.known:
            result = self._press(mesh, place, even_in_root(largest_n, self.levels), cover, None)
            self.known[key] = mesh, Ladder(result.normal_force_n, result.deformation_map_mm)
        return self.known[key][1]

    def reach(self, mesh: trimesh.Trimesh, place: Sequence[float], *, largest_n: float) -> tuple[float, float]:
        """The largest of some coarse load steps (N) for which the model is valid for an object at a place, and the next load step.

        Both are `largest_n` if it is valid. The press ends at the first invalid load step, because later ones can take minutes, but
        not at those that are too light for the model's points, which come first.
        """
        def stop(result: PressResult) -> None:
            if not (result.within_validity[-1] or touches_lightly(result.validity_reason[-1])):
                raise _BeyondError(result)

        forces = even_in_root(largest_n, REACH_LEVELS)
        result = self._press(mesh, place, forces, 1.0, stop)
        valid = np.flatnonzero(result.within_validity)
        last = int(valid[-1]) if len(valid) else -1
        return float(forces[last]) if len(valid) else 0.0, float(forces[min(last + 1, len(forces) - 1)])

    def _press(self, mesh, place, forces, cover, on_step):
        with warnings.catch_warnings(action="ignore", category=ShellWarning):
            try:
                return self._sensor(cover, forces[-1]).press(placed_at(mesh, place), pose=np.zeros(6), force_n=forces, label="",
                                                             model=self.model, threads=1, on_step=on_step)
            except _BeyondError as stopped:
                return stopped.result
            except ConvergenceError as error:
                if error.result is None or len(error.result.normal_force_n) < 3:
                    raise
                return error.result

    def _sensor(self, cover, largest_n):
        """The sensor with `cover` times its cover thickness, and a permitted force of at least `largest_n` (N) for soft sensors."""
        if cover not in self.variants:
            self.variants[cover] = self.sensor if cover == 1.0 else replace(
                self.sensor, spec=with_cover(self.sensor.spec, cover), prepared_models={})
        presses = self.variants[cover]
        low, high = presses.spec.force_range_n
        return replace(presses, spec=presses.spec.model_copy(update={"force_range_n": (low, max(high, largest_n))}))


def placed_at(mesh: trimesh.Trimesh, place: Sequence[float]) -> trimesh.Trimesh:
    """A copy of the mesh, turned about z (degrees), with the middle of its bounding box at x, y (mm) and its lowest point at 0."""
    x, y, angle = place
    low, high = mesh.bounds
    placed = mesh.copy()
    placed.apply_translation([*(-0.5 * (low + high)[:2]), -low[2]])
    placed.apply_transform(trimesh.transformations.rotation_matrix(np.radians(angle), [0, 0, 1]))
    placed.apply_translation([x, y, 0])
    return placed


def with_cover(spec: SensorSpec, times: float) -> SensorSpec:
    """A sensor whose cover has `times` its thickness, in the same shell: a thicker cover protrudes further.

    Raises InputError if the shell would protrude above a thinner cover.
    """
    thickness = times * spec.cover.thickness_mm
    if isinstance(spec.edge.held, SidesBelow):
        below = spec.edge.held.sides_below_mm + thickness - spec.cover.thickness_mm
        if below <= 0:
            raise InputError(f"{spec.name}: with a cover of {thickness:.3g} mm, which a fit of 'cover' needs, its shell would "
                             f"be {-below:.3g} mm higher than the cover (edge.held.sides_below_mm); leave 'cover' out of --fit.")
    return spec.with_upper_layer(thickness)


def uncalibrated(name_or_sensor: "str | Sensor") -> Sensor:
    """A sensor that was not calibrated before; raises InputError for a calibrated one."""
    sensor = name_or_sensor if isinstance(name_or_sensor, Sensor) else load_sensor(name_or_sensor)
    if sensor.spec.calibration is not None:
        raise InputError(f"The sensor {sensor.spec.name} is already calibrated; calibrate the file that it was made from.")
    sensor.spec.need_frusta("a calibration", "give a sensor of kind frusta")
    return sensor


def parabola(nodes: Sequence[float], at: float) -> Mapping[float, float]:
    """{node: weight} of the values at three nodes in the parabola through them, at a position between them."""
    x = np.array(nodes)
    return {float(node): float(np.prod((at - np.delete(x, k)) / (node - np.delete(x, k)))) for k, node in enumerate(x)}


def friction_ladders(sensor: Sensor, mesh: trimesh.Trimesh, place: Sequence[float], *, largest_n: float,
            name: str = "") -> dict[float, Ladder]:
    """{coefficient: `Ladder` of the maps' changes in mm against a press without friction} of an object at a place.

    place: x, y in mm, degrees;  largest_n: largest force; forces that one of the presses does not reach are left out
    """
    announce(f"{name or 'friction'}: pressing with the hyperelastic model at {len(FRICTIONS)} coefficients of friction")
    with warnings.catch_warnings(action="ignore", category=ShellWarning):
        ladders = [_ladder(sensor, friction, mesh, place, largest_n) for friction in FRICTIONS]
    reached = min(len(ladder.force_n) for ladder in ladders)
    without = ladders[0].maps_mm[:reached]
    return {friction: Ladder(ladder.force_n[:reached], ladder.maps_mm[:reached] - without)
            for friction, ladder in zip(FRICTIONS[1:], ladders[1:], strict=True)}


def _ladder(sensor, friction, mesh, place, largest_n):
    rough = replace(sensor.with_friction(friction), prepared_models={})
    return Presses(rough, model="hyperelastic", levels=LEVELS).ladder(mesh, np.asarray(place, dtype=float), largest_n=largest_n)


def friction_weights(friction: float) -> Mapping[float, float]:
    """{coefficient: weight} of the changes at the nearest coefficients, for linear interpolation."""
    return {one: float(np.interp(friction, FRICTIONS, np.eye(len(FRICTIONS))[k])) for k, one in enumerate(FRICTIONS)}
