"""Maps of a `State` with the elastic model, coarse while an object moves and whole where it rests.

What does not change between two states is kept: the sensor, the mesh, and the object's underside where it does not turn.
"""

import threading
import time
import warnings
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
import trimesh
from threadpoolctl import ThreadpoolController

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.errors import InputError, ShellWarning
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose
from softtact.geometry.repair import Mended, read_mended
from softtact.play.state import Object, Press, State
from softtact.press.cache import cached_draft
from softtact.press.choice import with_expected_error
from softtact.press.fast import first_touch_mm, force_at_depth, press_underside
from softtact.press.result import PressResult
from softtact.press.sensor import Sensor, load_sensor
from softtact.press.task import checked_forces
from softtact.press.validity import flag_buried

_ALONE = threading.Lock()     # filters of warnings, and numbers of threads, are those of the whole process
_TOUCHES, _ALWAYS_MM = 0.02, 1e-3     # share of the depth, and mm, that object and surface may be apart where they touch


@dataclass(frozen=True)
class Shown:
    """A press that is shown."""

    state: State
    press: Press
    result: PressResult
    draft: bool
    """Whether the map is the coarse one."""
    seconds: float
    """Wall time of the computation."""
    clearance_mm: np.ndarray
    """(y, x) in mm at the map's points: negative where object and surface touch, cut off a little beside them."""
    end: tuple[np.ndarray, np.ndarray]
    """Where the mesh is at the end: translation (3,) in mm with its depth, and quaternion (4,) w, x, y, z."""
    remarks: tuple[str, ...]
    """Warnings, one sentence each."""


class Solver:
    """Computes maps of states, one at a time; each tab has one."""

    def __init__(self) -> None:
        self._sensors: dict[str, Sensor] = {}
        self._underside: tuple[tuple, HeightField, Pose] | None = None
        self._guess_n = 1.0
        self._threads = cache(ThreadpoolController)     # looks for libraries, which takes a fifth of a map's time

    def sensor(self, name: str) -> Sensor:
        """The sensor of a name. Raises InputError for one that is unknown or not of layers."""
        if name not in self._sensors:
            sensor = load_sensor(name)
            if not sensor.spec.has_layers:
                raise InputError(f"{name}: the page shows sensors of layers, and this one is of kind {sensor.spec.kind}; press on "
                                 "it with softtact press.")
            self._sensors[name] = sensor
        return self._sensors[name]

    def mesh(self, of: Object) -> trimesh.Trimesh:
        """The object's mesh in mm, repaired where that is needed and not ambiguous, else InputError."""
        return _mended(of).mesh

    def has_draft(self, name: str) -> bool:
        """Whether there is a coarse map of a sensor: not of a gel, whose layer is wide."""
        return not self.sensor(name).spec.edge.far

    def solve(self, state: State, *, draft: bool = False) -> Shown:
        """The map of a state by the elastic model. Raises SofttactError in one sentence where there is none.

        draft: with half as many nodes along each side
        """
        start = time.perf_counter()
        sensor, mended = self.sensor(state.sensor), _mended(state.object)
        with _ALONE, warnings.catch_warnings(record=True) as caught, self._threads().limit(limits=1):
            warnings.simplefilter("always")
            press, result = (self._on_gel if sensor.spec.edge.far else self._on_layers)(state, sensor, mended, draft)
        remarks = tuple(dict.fromkeys(str(one.message) for one in caught if one.category.__module__.startswith("softtact.")))
        at_end = Pose.from_values(state.pose(mended.mesh, moved=True))
        surface = self._surface(state, mended, at_end)
        touch = first_touch_mm(sensor, surface)
        depth = float(result.indentation_mm[-1])
        end = at_end.translation_mm - [0.0, 0.0, touch + depth], at_end.rotation.as_quat(scalar_first=True)
        return Shown(state, press, result, draft and self.has_draft(state.sensor), time.perf_counter() - start,
                     _clearance(surface, result, touch + depth), end, remarks)

    def _on_layers(self, state, sensor, mended, draft):
        """`Press` and result on layers with held sides: without friction only the last place counts."""
        if draft:
            sensor = replace(sensor, prepared_models={"elastic": self._draft(state.sensor)})
        values = state.pose(mended.mesh, moved=True)
        pose = Pose.from_values(values)
        placed = place(mended.mesh, pose=pose)
        check_over_sensor(placed, sensor.spec.footprint_mm, name="The object")
        surface = self._surface(state, mended, pose)
        force = self._force(state, sensor, surface)
        result = with_expected_error(sensor, press_underside(sensor, surface, checked_forces(force, sensor.spec.force_range_n,
                                                                                            sensor.spec.name)))
        result = flag_buried(result, float(placed.bounds[1, 2]) - first_touch_mm(sensor, surface))
        return Press(state.sensor, state.object, values, force, "elastic", bool(mended.repairs)), result

    def _on_gel(self, state, sensor, mended, draft):
        """`Press` and result on a gel, with friction along the slide and the twist."""
        del draft     # a gel's layer has one grid
        pose = state.pose(mended.mesh, moved=False)
        load: float | str = float(f"{state.force_n:g}")
        if state.load_by == "depth":
            load = f"z -{state.depth_mm:g}" + state.motion(state.force_n).removeprefix(f"fz -{state.force_n:g}")
        elif state.moves:
            load = state.motion(state.force_n)
        given: dict[str, Any] = {"force_n": load} if isinstance(load, float) else {"motion": Motion.parse(load)}
        result = sensor.press(mended.mesh, pose=pose, model="elastic", label="", threads=1, **given)
        return Press(state.sensor, state.object, pose, load, "elastic", bool(mended.repairs)), result

    def _force(self, state, sensor, surface):
        """The force of a state, as its command line writes it."""
        if state.load_by == "force":
            return float(f"{state.force_n:g}")
        with warnings.catch_warnings():     # the press itself warns
            warnings.simplefilter("ignore", ShellWarning)
            self._guess_n = force_at_depth(sensor, surface, state.depth_mm, guess_n=self._guess_n)
        return float(f"{self._guess_n:g}")

    def _draft(self, name):
        models = self.sensor(name).prepared_models
        if "draft" not in models:
            models["draft"] = cached_draft(self.sensor(name).spec)
        return models["draft"]

    def _surface(self, state, mended, pose):
        """The object's underside, moved from the last one where it has not turned."""
        key = state.object, tuple(pose.rotation.as_quat())
        if self._underside is None or self._underside[0] != key:
            self._underside = key, HeightField(place(mended.mesh, pose=pose)), pose
        _, surface, before = self._underside
        return surface.moved(pose.translation_mm - before.translation_mm)


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


@lru_cache(maxsize=8)
def _mended(of: Object) -> Mended:
    return read_mended(of.path, unit=of.unit)
