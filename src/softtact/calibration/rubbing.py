"""What the friction of an object changes of its press: by the hyperelastic model, for the fast models have none.

Where they touch the object keeps the cover from slipping outwards, which changes a map by some per cent of its maximum. Most
points stick from a coefficient of 0.2 on, so that presses straight down hardly tell larger ones apart. A press with friction
depends on its way, so that as many load steps are taken as of the calibration's own presses.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import trimesh

from softtact.calibration.ladder import LEVELS, Presses
from softtact.errors import ShellWarning
from softtact.press.ladder import Ladder
from softtact.press.sensor import Sensor
from softtact.progress import announce
from softtact.sensors.frusta import SensorSpec

FRICTIONS = (0.0, 0.05, 0.1, 0.2, 0.6)     # coefficients of the object, between which its effect is interpolated


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
