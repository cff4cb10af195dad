"""Construction of a `PressResult` from a press on layers: maps, readings, and flags of the load steps (`press.validity`)."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError, ShellWarning
from softtact.press.result import PressResult
from softtact.press.validity import reasons
from softtact.readout.registry import Samples, SurfaceMotion, readings_of

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor
    from softtact.sensors.specification import AnySpec

RESTS = 1e-6     # of a force: share on the shell from which on an object rests on it


def make_result(sensor: "Sensor", model: str, solver: str, maps: np.ndarray, forces: np.ndarray, times: np.ndarray,
                **numbers: Any) -> PressResult:
    """A `PressResult` of maps (l, points) or (l, ny, nx) and numbers by the result's names.

    flags among these: `Flags`, why which load steps are not valid
    lower_maps among these: maps of a lower side that moves; readings follow from the change of thickness
    felt_mm among these: the change of thickness that readings follow from, where it is known between the maps' points
    pressure among these: `Samples` of the contact pressure at each load step, where the model gives it
    plane, seen_object among these: the `PlaneMotion` of the map's points and the rigid object, where the model gives them
    """
    spec, maps = sensor.spec, maps.reshape(len(forces), *sensor.spec.map_shape)
    lower_maps, pressure, plane, seen = (numbers.pop(name, None) for name in ("lower_maps", "pressure", "plane", "seen_object"))
    if plane is not None:
        numbers["traction_mpa"] = plane.traction_mpa
    thinning = numbers.pop("felt_mm", maps if lower_maps is None else maps - lower_maps.reshape(maps.shape))
    why = reasons(numbers.pop("flags"), len(forces))
    flags: dict[str, Any] = {"converged": np.ones(len(forces), dtype=np.int8), "within_validity": (why == "").astype(np.int8),
                             "validity_reason": why}
    arrays: dict[str, Any] = {name: np.asarray(values) for name, values in numbers.items()}
    warn_of_shell(spec, forces, arrays.get("pad_force_n", forces))
    surface = layered_surface(spec, thinning, arrays.get("displacement_mm", -maps[..., None] * [np.nan, np.nan, 1.0]), pressure)
    surface = replace(surface, plane=plane, object=seen)
    return PressResult(deformation_map_mm=maps, thinning_map_mm=thinning, readings=readings_of(sensor.readouts, surface),
                       normal_force_n=forces, wall_time_s=times, x_mm=spec.map_x_mm, y_mm=spec.map_y_mm, model=model,
                       sensor=spec.name, solver=solver, largest_counts=spec.largest_counts,
                       attributes={"thickness_mm": spec.thickness_mm, "edge": spec.edge.in_words, **_friction(spec, model),
                                   **_calibration(spec), **sensor.attributes}, **flags, **arrays)


def layered_surface(spec: "AnySpec", thinning_mm: np.ndarray, displacement_mm: np.ndarray | None = None,
                    pressure: list[Samples] | None = None) -> SurfaceMotion:
    """The `SurfaceMotion` of layers, from their thinning (l, ny, nx) in mm and the displacement (l, ny, nx, 3) of the map's
    plane."""
    if displacement_mm is None:
        displacement_mm = -thinning_mm[..., None] * [np.nan, np.nan, 1.0]
    return SurfaceMotion(spec=spec, steps=len(thinning_mm), thinning_mm=thinning_mm,
                         displacement=_of_one_face(lambda: _on_map(spec, displacement_mm)),
                         pressure=_of_one_face(lambda: pressure))


def _of_one_face(samples: Callable[[], Any]) -> Callable[[str | None], Any]:
    """Samples by the name of a face, for a surface without named faces."""
    def of(face: str | None) -> Any:
        if face is not None:
            raise InputError(f"there is no face {face!r}: a sensor of layers has its sensing surface alone; leave 'face' out.")
        return samples()

    return of


def _on_map(spec: "AnySpec", fields: np.ndarray) -> list[Samples]:
    """Samples of fields (l, ny, nx, 3) at the points of the map, each with its share of the area."""
    x, y = np.meshgrid(spec.map_x_mm, spec.map_y_mm)
    sides = [np.convolve(np.pad(np.diff(line), 1), [0.5, 0.5], mode="valid") for line in (spec.map_y_mm, spec.map_x_mm)]
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return [Samples(points, np.outer(*sides).ravel(), one.reshape(-1, 3)) for one in fields]


def _calibration(spec):
    """Attribute that states the calibration of a sensor's readings."""
    return {} if spec.calibration is None else {"calibration": spec.calibration.source}


def warn_of_shell(spec: "AnySpec", forces: np.ndarray, on_pad: np.ndarray) -> None:
    """Warn of the first load step at which the shell carries a part of the forces (l,) in N, the pad the rest."""
    resting = np.flatnonzero(forces - on_pad > RESTS * forces)
    if len(resting):
        first = resting[0]
        warnings.warn(f"At {forces[first]:g} N the object rests on the shell beside the pad, which carries "
                      f"{max(on_pad[first], 0.0):.3g} N of it (`result.pad_force_n`; {spec.edge.in_words}); if your sensor's "
                      "shell ends lower, state 'edge' in its file.", ShellWarning, stacklevel=5)


def _friction(spec, model):
    """Attributes that state the friction of a result."""
    if model not in ("hyperelastic", "solid"):
        return {"friction": f"none: the {model} model knows no friction"}
    return spec.support_facts
