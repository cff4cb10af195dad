"""Layers on the page: maps of the elastic model, coarse while an object moves and whole where it rests.

What does not change between two states is kept: the draft's compliance, and the object's underside where it does not turn.
"""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.errors import ShellWarning
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose
from softtact.geometry.repair import Mended
from softtact.play.bench import Pressed
from softtact.play.state import Press, State
from softtact.press.cache import cached_draft
from softtact.press.choice import with_expected_error
from softtact.press.fast import first_touch_mm, force_at_depth, press_underside
from softtact.press.result import PressResult
from softtact.press.sensor import Sensor
from softtact.press.task import checked_forces
from softtact.press.validity import flag_buried, flagged

_TOUCHES, _ALWAYS_MM = 0.02, 1e-3     # share of the depth, and mm, that object and surface may be apart where they touch
_REACHED = 0.99         # share of a depth, or of the largest force, from which it counts as reached: their search ends within 0.2 %


class OnLayers:
    """Layers with held sides: without friction only the last place counts."""

    refines = True
    middle_mm = np.zeros(3)

    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor
        self.size_mm = np.array([*sensor.spec.footprint_mm, sensor.spec.thickness_mm])
        self.force_range_n: tuple[float, float] = sensor.spec.force_range_n
        self.first_force_n = self.force_range_n[1]
        self.long_on_release = bool(np.isfinite(sensor.spec.frustum_height_mm))     # the foundation model takes seconds
        self.models = (*(["foundation"] if self.long_on_release else []), "hyperelastic", "auto", "solid")
        self._draft: Sensor | None = None
        self._underside: tuple[tuple, HeightField, Pose] | None = None
        self._guess_n = 1.0

    @property
    def is_ready(self) -> bool:
        """See `Bench`."""
        return "elastic" in self.sensor.prepared_models

    def prepare(self) -> None:
        """See `Bench`."""
        self.sensor.prepared("elastic")

    def press(self, state: State, mended: Mended, *, draft: bool) -> Pressed:
        """See `Bench`."""
        draft = draft and self.refines
        press, result = self._press(state, mended, draft)
        at_end = Pose.from_values(state.pose(mended.mesh, moved=True))
        surface = self._surface(state, mended, at_end)
        down = first_touch_mm(self.sensor, surface) + float(result.indentation_mm[-1])
        end = at_end.translation_mm - [0.0, 0.0, down], at_end.rotation.as_quat(scalar_first=True)
        return Pressed(press, result, end, _clearance(surface, result, down), "coarse" if draft else "whole")

    def take(self, press: Press, result: PressResult) -> None:
        """See `Bench`."""

    def follows(self, model: str) -> bool:
        """See `Bench`."""
        return model != "foundation"

    def _press(self, state, mended, draft):
        if draft and self._draft is None:
            self._draft = replace(self.sensor, prepared_models={"elastic": cached_draft(self.sensor.spec)})
        sensor = self._draft if draft else self.sensor
        values = state.pose(mended.mesh, moved=True)
        pose = Pose.from_values(values)
        placed = place(mended.mesh, pose=pose)
        check_over_sensor(placed, sensor.spec.footprint_mm, name="The object")
        surface = self._surface(state, mended, pose)
        force = self._force(state, sensor, surface)
        result = with_expected_error(sensor, press_underside(sensor, surface, checked_forces(force, sensor.spec.force_range_n,
                                                                                            sensor.spec.name)))
        result = flag_buried(result, float(placed.bounds[1, 2]) - first_touch_mm(sensor, surface))
        if state.load_by == "depth" and force > _REACHED * (largest := sensor.spec.force_range_n[1]):
            result = flagged(result, f"{largest:g} N, the sensor's largest force, is too little for the depth of "
                             f"{state.depth_mm:g} mm", result.indentation_mm < _REACHED * state.depth_mm)
        return Press(state.sensor, state.object, values, force, "elastic", bool(mended.repairs)), result

    def _force(self, state, sensor, surface):
        """The force of a state, as its command line writes it."""
        if state.load_by == "force":
            return float(f"{state.force_n:g}")
        with warnings.catch_warnings():     # the press itself warns
            warnings.simplefilter("ignore", ShellWarning)
            self._guess_n = force_at_depth(sensor, surface, state.depth_mm, guess_n=self._guess_n)
        return float(f"{self._guess_n:g}")

    def _surface(self, state, mended, pose):
        """The object's underside, moved from the last one where it has not turned."""
        key = state.object, tuple(pose.rotation.as_quat())
        if self._underside is None or self._underside[0] != key:
            self._underside = key, HeightField(place(mended.mesh, pose=pose)), pose
        _, surface, before = self._underside
        return surface.moved(pose.translation_mm - before.translation_mm)


class OnGel(OnLayers):
    """A gel, whose sides are far: one grid, with friction along the slide and the twist."""

    refines = False

    def _press(self, state, mended, draft):
        pose, load = state.pose(mended.mesh, moved=False), state.load
        given: dict[str, Any] = {"motion": Motion.parse(load)} if isinstance(load, str) else {"force_n": load}
        result = self.sensor.press(mended.mesh, pose=pose, model="elastic", label="", threads=1, **given)
        return Press(state.sensor, state.object, pose, load, "elastic", bool(mended.repairs)), result


def _clearance(surface, result, down_mm):
    """Distance (y, x) in mm, less a tolerance, of the object, `down_mm` below its pose, from the surface at the map's points.

    Where the result knows the pressure, it alone says where they touch.
    """
    surface_mm = -result.deformation_map_mm[-1]
    tolerance = _TOUCHES * np.abs(surface_mm).max() + _ALWAYS_MM
    if np.isfinite(pressure := -result.traction_mpa[-1][..., 2]).all():
        return np.where(pressure > 0, -tolerance, tolerance)
    heights, _ = surface(*(line.ravel() for line in np.meshgrid(result.x_mm, result.y_mm)))
    return np.clip(heights.reshape(surface_mm.shape) - down_mm - surface_mm - tolerance, -tolerance, tolerance)
