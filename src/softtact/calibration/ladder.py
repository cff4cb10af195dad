"""Presses that the fit starts from: maps at rising forces of an object in a place, and in places and sensors a little off.

A press at any force is taken from a spline through these. Scaling all moduli by s divides all forces by s (equilibrium is linear in
the stresses, and nothing else has the dimension of a stress), so that a softer sensor is the same one at a larger force.

Friction changes a map by some per cent of its maximum, for where they touch the object keeps the cover from slipping outwards. It
is computed by the hyperelastic model, because the fast models have none. Most points stick from a coefficient of 0.2 on, so that
presses straight down hardly distinguish larger ones. A press with friction depends on its path, so that it takes as many load
steps as the calibration's presses.
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
from softtact.progress import announce
from softtact.sensors.fields import SidesBelow
from softtact.sensors.frusta import SensorSpec

LEVELS = 9
SOFTEST = 0.5            # modulus scale down to which forces are pressed
REACH_LEVELS = 8         # of the first press, which only shows up to which force the model is valid
COVERS = (0.8, 1.0, 1.25)     # of the cover's thickness, through which its effect is interpolated
FRICTIONS = (0.0, 0.05, 0.1, 0.2, 0.6)     # coefficients of the object, between which its effect is interpolated


class _BeyondError(Exception):
    """Ends a press beyond its model's validity; `result` holds it so far."""

    def __init__(self, result):
        super().__init__()
        self.result = result


@dataclass
class Presses:
    """The presses of a calibration, each made once. `model` is that of `Sensor.press`; `variants` of the sensor by its cover."""

    sensor: Sensor
    model: str = "foundation"
    levels: int = LEVELS
    known: dict[Any, Ladder] = field(default_factory=dict)
    variants: dict[float, Sensor] = field(default_factory=dict)

    def ladder(self, mesh: trimesh.Trimesh, place: Sequence[float], *, largest_n: float, cover: float = 1.0) -> Ladder:
        """The `Ladder` of an object at a place (x, y in mm, degrees) up to a force in N.

        cover: thickness of the cover over that of the sensor. Forces that the model does not reach are left out.
        """
        key = (id(mesh), *np.round(place, 6), round(largest_n, 6), cover)
        if key not in self.known:
            result = self._press(mesh, place, even_in_root(largest_n, self.levels), cover, None)
            self.known[key] = Ladder(result.normal_force_n, result.deformation_map_mm)
        return self.known[key]

    def reach(self, mesh: trimesh.Trimesh, place: Sequence[float], *, largest_n: float) -> tuple[float, float]:
        """Up to which force (N) the model is valid for an object at a place, in coarse steps, and the step after that.

        Both are `largest_n` where it is valid so far. Beyond validity a press may take minutes, so it ends there.
        """
        def stop(result: PressResult) -> None:
            if not result.within_validity[-1]:
                raise _BeyondError(result)

        forces = even_in_root(largest_n, REACH_LEVELS)
        result = self._press(mesh, place, forces, 1.0, stop)
        valid = int(np.cumprod(result.within_validity).sum())
        return float(forces[valid - 1]) if valid else 0.0, float(forces[min(valid, len(forces) - 1)])

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
        """The sensor with a cover of `cover` times its thickness, which bears so large a force (N): a softer one is asked for."""
        if cover not in self.variants:
            self.variants[cover] = self.sensor if cover == 1.0 else replace(
                self.sensor, spec=with_cover(self.sensor.spec, cover), prepared_models={})
        presses = self.variants[cover]
        low, high = presses.spec.force_range_n
        return replace(presses, spec=presses.spec.model_copy(update={"force_range_n": (low, max(high, largest_n))}))


def placed_at(mesh: trimesh.Trimesh, place: Sequence[float]) -> trimesh.Trimesh:
    """A copy of the mesh: the middle of its bounding box at x, y (mm), turned about z (degrees), its lowest point at 0."""
    x, y, angle = place
    low, high = mesh.bounds
    placed = mesh.copy()
    placed.apply_translation([*(-0.5 * (low + high)[:2]), -low[2]])
    placed.apply_transform(trimesh.transformations.rotation_matrix(np.radians(angle), [0, 0, 1]))
    placed.apply_translation([x, y, 0])
    return placed


def with_cover(spec: SensorSpec, times: float) -> SensorSpec:
    """A sensor with a cover of so many times its thickness, in the same shell: a thicker cover rises further out of it.

    Raises InputError where the shell would rise above a thinner one.
    """
    thickness = times * spec.cover.thickness_mm
    update: dict[str, Any] = {"cover": spec.cover.model_copy(update={"thickness_mm": thickness})}
    if isinstance(spec.edge.held, SidesBelow):
        below = spec.edge.held.sides_below_mm + thickness - spec.cover.thickness_mm
        if below <= 0:
            raise InputError(f"{spec.name}: under a cover of {thickness:.3g} mm, which 'cover' is fitted from, its shell would "
                             f"stand {-below:.3g} mm out of it (edge.held.sides_below_mm); leave 'cover' out of --fit.")
        update["edge"] = spec.edge.model_copy(update={"held": SidesBelow(sides_below_mm=below)})
    return spec.model_copy(update=update)


def uncalibrated(name_or_sensor: "str | Sensor") -> Sensor:
    """A sensor without what an earlier calibration found of it."""
    sensor = name_or_sensor if isinstance(name_or_sensor, Sensor) else load_sensor(name_or_sensor)
    if sensor.spec.calibration is not None:
        raise InputError(f"The sensor {sensor.spec.name} is calibrated already; calibrate the file that it was made from.")
    sensor.spec.need_frusta("a calibration", "give a sensor of kind frusta")
    return sensor


def parabola(nodes: Sequence[float], at: float) -> Mapping[float, float]:
    """{node: weight} of the parabola through values at three nodes, at a place between them."""
    x = np.array(nodes)
    return {float(node): float(np.prod((at - np.delete(x, k)) / (node - np.delete(x, k)))) for k, node in enumerate(x)}


def rubbing(sensor: Sensor, mesh: trimesh.Trimesh, place: Sequence[float], *, largest_n: float,
            name: str = "") -> dict[float, Ladder]:
    """{coefficient: `Ladder` of the maps' changes in mm against a press without friction} of an object at a place.

    place: x, y in mm, degrees;  largest_n: up to which force; what one of the presses does not reach is left out
    """
    announce(f"{name or 'friction'}: pressing by the hyperelastic model with {len(FRICTIONS)} coefficients of friction")
    with warnings.catch_warnings(action="ignore", category=ShellWarning):
        ladders = [_ladder(sensor, friction, mesh, place, largest_n) for friction in FRICTIONS]
    reached = min(len(ladder.force_n) for ladder in ladders)
    without = ladders[0].maps_mm[:reached]
    return {friction: Ladder(ladder.force_n[:reached], ladder.maps_mm[:reached] - without)
            for friction, ladder in zip(FRICTIONS[1:], ladders[1:], strict=True)}


def with_friction(spec: SensorSpec, friction: float) -> SensorSpec:
    """A sensor on whose cover the object has this coefficient of friction."""
    return spec.model_copy(update={"friction": spec.friction.model_copy(update={"object": friction})})


def _ladder(sensor, friction, mesh, place, largest_n):
    rubbed = replace(sensor, spec=with_friction(sensor.spec, friction), prepared_models={})
    return Presses(rubbed, model="hyperelastic", levels=LEVELS).ladder(mesh, np.asarray(place, dtype=float), largest_n=largest_n)


def friction_weights(friction: float) -> Mapping[float, float]:
    """{coefficient: weight} of what each changes, at a coefficient between them."""
    return {one: float(np.interp(friction, FRICTIONS, np.eye(len(FRICTIONS))[k])) for k, one in enumerate(FRICTIONS)}
