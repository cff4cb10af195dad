"""What a `State` shows: its press on the sensor's bench, one at a time, with the remarks and the time that it took."""

import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache

import trimesh
from threadpoolctl import ThreadpoolController

from softtact.geometry.repair import Mended, read_mended
from softtact.play.bench import Bench, Pressed
from softtact.play.on_layers import OnGel, OnLayers
from softtact.play.on_solid import OnSolid
from softtact.play.state import Object, State
from softtact.press.sensor import Sensor, load_sensor

_ALONE = threading.Lock()     # filters of warnings, and numbers of threads, are those of the whole process


def _on_layers(sensor: Sensor) -> OnLayers:
    return OnGel(sensor) if sensor.spec.edge.far else OnLayers(sensor)


def _on_skin(sensor: Sensor) -> Bench:
    from softtact.play.on_skin import OnSkin  # scikit-fem, of the extra `skin`

    return OnSkin(sensor)


BENCHES: dict[str, Callable[[Sensor], Bench]] = {"frusta": _on_layers, "layers": _on_layers, "solid": OnSolid, "skin": _on_skin}
"""By the kind of a sensor."""


@dataclass(frozen=True, kw_only=True)
class Shown(Pressed):
    """A press that is shown."""

    state: State
    seconds: float
    """Wall time of the computation."""
    remarks: tuple[str, ...]
    """Warnings, one sentence each."""


class Solver:
    """Presses states, one at a time; each tab has one."""

    def __init__(self) -> None:
        self._benches: dict[str, Bench] = {}
        self._threads = cache(ThreadpoolController)     # looks for libraries, which takes a fifth of a map's time

    def bench(self, name: str) -> Bench:
        """The bench of a sensor by its name. Raises InputError for one that is unknown."""
        if name not in self._benches:
            sensor = load_sensor(name)
            self._benches[name] = BENCHES[sensor.spec.kind](sensor)
        return self._benches[name]

    def mesh(self, of: Object) -> trimesh.Trimesh:
        """The object's mesh in mm, repaired where that is needed and not ambiguous, else InputError."""
        return _mended(of).mesh

    def solve(self, state: State, *, draft: bool = False) -> Shown:
        """The press of a state by the sensor's fast model. Raises SofttactError in one sentence where there is none.

        draft: coarse, where the bench has that
        """
        start = time.perf_counter()
        bench, mended = self.bench(state.sensor), _mended(state.object)
        with _ALONE, warnings.catch_warnings(record=True) as caught, self._threads().limit(limits=1):
            warnings.simplefilter("always")
            pressed = bench.press(state, mended, draft=draft)
        remarks = tuple(dict.fromkeys(str(one.message) for one in caught if one.category.__module__.startswith("softtact.")))
        seconds = max(time.perf_counter() - start, float(pressed.result.wall_time_s.sum()))     # the press may be an earlier one
        return Shown(**vars(pressed), state=state, seconds=seconds, remarks=remarks)


@lru_cache(maxsize=8)
def _mended(of: Object) -> Mended:
    return read_mended(of.path, unit=of.unit)
