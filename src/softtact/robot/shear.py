"""Presses with the shear that a held or lifted object exerts: a `Motion` down by the normal force, then aside.

The models move an object aside by ways, so the way at which friction carries a shear force is searched for: Broyden's method
from a first stiffness.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError, InputError
from softtact.geometry.pose import Pose

if TYPE_CHECKING:
    from softtact.press.result import PressResult
    from softtact.press.sensor import Sensor

MODELS = ("elastic", "hyperelastic")     # those that move an object aside
_FIRST_MM = 0.01        # of a way: short against any pad, so that next to nothing slides
_CLOSE = 0.01           # of the shear, and
_LEAST_N = 1e-3         # what the record tells forces to
_MOST = 8               # presses


@dataclass(frozen=True)
class ShearPress:
    """A press with shear."""

    result: "PressResult"
    """Its two load steps: straight down, then aside."""
    way_mm: np.ndarray
    """(2,) along x and y, by which the object had to move aside."""

    @property
    def shear_n(self) -> np.ndarray:
        """Force (2,) in N of the object on the sensor along x and y."""
        return np.asarray(self.result.force_n)[-1, :2]


def with_friction(sensor: "Sensor", coefficient: float) -> "Sensor":
    """The sensor with Coulomb's coefficient of an object on its surface."""
    friction = sensor.spec.friction.model_copy(update={"object": coefficient})
    return replace(sensor, spec=sensor.spec.model_copy(update={"friction": friction}))


def press_with_shear(sensor: "Sensor", mesh: trimesh.Trimesh, pose: Pose | None, *, force_n: float, shear_n: np.ndarray,
                     model: str = "elastic", threads: int | None = None) -> ShearPress:
    """Press a mesh (mm) in a pose by a normal force and a shear force (2,), both in N, of the object on the sensor.

    model: elastic or hyperelastic;  the sensor's `friction.object` carries the shear
    Raises InputError for another model and for a shear that friction does not carry, ConvergenceError where the way is not found.
    """
    shear, bound = np.asarray(shear_n, dtype=float), sensor.spec.friction.object * force_n
    if model not in MODELS:
        raise InputError(f"model={model!r}: shear is pressed with {' or '.join(MODELS)}; name one of them.")
    size = float(np.linalg.norm(shear))
    if size >= bound:
        raise InputError(f"A shear of {size:.3g} N slips under {force_n:g} N: friction carries less than {bound:.3g} N; state a "
                         "larger friction, or less shear.")

    def pressed(way: np.ndarray) -> ShearPress:
        motion = Motion().press(force_n=force_n).slide(x_mm=float(way[0]), y_mm=float(way[1]))
        return ShearPress(sensor.press(mesh, pose=pose, motion=motion, model=model, label="", threads=threads), way)

    way = _FIRST_MM * shear / max(size, 1e-300)
    found = pressed(way)
    stiffness = float(found.shear_n @ shear) / max(size, 1e-300) / _FIRST_MM
    inverse = np.eye(2) / stiffness
    for _ in range(_MOST):
        off = shear - found.shear_n
        if np.linalg.norm(off) <= _CLOSE * size + _LEAST_N:
            return found
        step = inverse @ off
        trial = pressed(found.way_mm + step)
        change = trial.shear_n - found.shear_n
        along = step @ inverse
        if abs(along @ change) > 1e-12:      # Broyden's good update of the inverse (Nocedal and Wright, section 11.1)
            inverse = inverse + np.outer(step - inverse @ change, along) / (along @ change)
        found = trial
    missing = np.linalg.norm(shear - found.shear_n)
    raise ConvergenceError(f"A shear of {size:.3g} N was not reached in {_MOST} presses, {missing:.3g} N are missing; it is near "
                           "what friction carries: state a larger friction.")
