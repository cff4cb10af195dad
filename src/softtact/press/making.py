"""Construction of a `PressResult` from a press on layers: maps, readings, and validity of the load steps.

The rules of `PressResult.within_validity`: docs/reference/command_line.md, "What is flagged".
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import uniform_filter

from softtact.contact.shell import Shell
from softtact.errors import InputError, ShellWarning
from softtact.models.hyperelastic.newton import FULL_POCKET
from softtact.press.result import PressResult
from softtact.readout.registry import Samples, SurfaceMotion, readings_of

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor
    from softtact.sensors.specification import AnySpec

_NEGLIGIBLE = 1e-6     # of a force: largest share on the shell without a warning
_DEEPEST_LINEAR = 0.5       # of the layer's thickness, beyond which a real layer is stiffer than a linear one
_AROUND = 0.9              # of the deepest node: least mean of three by three nodes where a contact is wider than these
_DEEPEST_NARROW = 0.5      # of the dielectric: a wall of 0.3 mm reads within 2 % wherever it stands up to 0.43, and 30 % at 0.58
_SLIGHT_COMPRESSION = 0.33   # of a frustum's height: the foundation model's error is at most 2 % (docs/explanation/fast_models.md)
_OVERLAP_LEFT = 3.0         # times the allowed overlap, or gap under pressure: above, the augmentations have failed
_FEWEST_POINTS = 9          # contact points under pressure: fewer do not resolve the contact of a spike


def shell_of(sensor: "Sensor") -> Shell:
    """The shell that a sensor's `edge` states."""
    edge = sensor.spec.edge
    return Shell(sensor.spec.footprint_mm, edge.held_below_mm, edge.shell_width_mm)


def make_result(sensor: "Sensor", model: str, solver: str, maps: np.ndarray, forces: np.ndarray, times: np.ndarray,
                **numbers: Any) -> PressResult:
    """A `PressResult` of maps (l, points) or (l, ny, nx) and numbers by the result's names.

    lower_maps among these: maps of a lower side that moves; readings follow from the change of thickness
    felt_mm among these: the change of thickness that readings follow from, where it is known between the maps' points
    pressure among these: `Samples` of the contact pressure at each load step, where the model gives it
    """
    spec, maps = sensor.spec, maps.reshape(len(forces), *sensor.spec.map_shape)
    lower_maps, pressure = numbers.pop("lower_maps", None), numbers.pop("pressure", None)
    thinning = numbers.pop("felt_mm", maps if lower_maps is None else maps - lower_maps.reshape(maps.shape))
    flags: dict[str, Any] = {"converged": np.ones(len(forces), dtype=np.int8),
                             "within_validity": np.asarray(numbers.pop("within_validity"), dtype=np.int8)}
    arrays: dict[str, Any] = {name: np.asarray(values) for name, values in numbers.items()}
    warn_of_shell(spec, forces, arrays.get("pad_force_n", forces))
    surface = layered_surface(spec, thinning, arrays.get("displacement_mm", -maps[..., None] * [np.nan, np.nan, 1.0]), pressure)
    return PressResult(deformation_map_mm=maps, readings=readings_of(sensor.readouts, surface), normal_force_n=forces,
                       wall_time_s=times, x_mm=spec.map_x_mm, y_mm=spec.map_y_mm, model=model, sensor=spec.name, solver=solver,
                       largest_counts=spec.largest_counts,
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
    resting = np.flatnonzero(forces - on_pad > _NEGLIGIBLE * forces)
    if len(resting):
        first = resting[0]
        warnings.warn(f"At {forces[first]:g} N the object rests on the shell beside the pad, which carries {on_pad[first]:.3g} N "
                      f"of it (`result.pad_force_n`; {spec.edge.in_words}); if your sensor's shell ends lower, state 'edge' in "
                      "its file.", ShellWarning, stacklevel=5)


def _friction(spec, model):
    """Attributes that state the friction of a result."""
    if model not in ("hyperelastic", "solid"):
        return {"friction": f"none: the {model} model knows no friction"}
    return spec.support_facts


# --- which load steps can be relied on ---


def valid_elastic(depth_mm: np.ndarray, *, thickness_mm: float) -> np.ndarray:
    """Which load steps (l,) of an elastic press are valid; depth_mm (l,): descent of the object's lowest point."""
    return depth_mm < _DEEPEST_LINEAR * thickness_mm


def resolved_elastic(fields_mm: np.ndarray, *, dielectric_mm: float) -> np.ndarray:
    """Which load steps (l,) of an elastic press the surface's nodes resolve, by its deformation (l, y, x) in mm at all of them.

    Under a wall or a pin the surface is as steep as the nodes are close. Once it is deep in a dielectric, dielectric_mm thick,
    whose capacitance then rises without bound, readings would depend on how the nodes happen to lie.
    """
    deepest, around = fields_mm.max(axis=(1, 2)), uniform_filter(fields_mm, (0, 3, 3)).max(axis=(1, 2))
    return (around >= _AROUND * deepest) | (deepest < _DEEPEST_NARROW * dielectric_mm)


def valid_foundation(compression_mm: np.ndarray, depth_mm: np.ndarray, *, frustum_mm: float, thickness_mm: float,
                     law_limit_mm: float) -> np.ndarray:
    """Which load steps (l,) of a foundation press are valid, by the most compressed frustum (l,), frustum_mm high, and by the
    descent (l,) of the object's lowest point, as the slab is linear too and does not limit the depth of a corner.
    """
    return (compression_mm < min(law_limit_mm, _SLIGHT_COMPRESSION * frustum_mm)) & (depth_mm < _DEEPEST_LINEAR * thickness_mm)


def valid_hyperelastic(*, compression_mm: np.ndarray, contact_error_mm: np.ndarray, points: np.ndarray, depth_mm: np.ndarray,
                       rough: np.ndarray, forces_n: np.ndarray, frustum_mm: float, allowed_mm: float) -> np.ndarray:
    """Which load steps (l,) of a hyperelastic press are valid, by compression, contact error, residual and growth of depth.

    contact_error_mm (l,): deepest overlap, or widest gap under pressure; `allowed_mm` is the tolerance for it
    points (l,): number of the cover's points that carry the object;  compression_mm, frustum_mm: nan without frusta
    rough (l,): whether the residual is above the tolerance;  forces_n (l,): depths must grow where these do
    """
    return (~rough & ~(compression_mm >= FULL_POCKET * frustum_mm) & (contact_error_mm < _OVERLAP_LEFT * allowed_mm)
            & (points >= _FEWEST_POINTS) & ((np.diff(forces_n) <= 0).any() | _grows(depth_mm, slack_mm=allowed_mm)))


def _grows(depth, *, slack_mm):
    """Which depths (l,) increase with the load steps: of two that do not, one belongs to another branch of equilibria."""
    deepest_before, least_after = np.maximum.accumulate(depth), np.minimum.accumulate(depth[::-1])[::-1]
    return (depth >= deepest_before - slack_mm) & (depth <= least_after + slack_mm)


def flag_buried(result: PressResult, top_mm: float) -> PressResult:
    """The result with the load steps flagged at which the object's top is below the surface at rest: no model has contact on
    that side.
    """
    above = result.indentation_mm < top_mm
    return replace(result, within_validity=result.within_validity & above.astype(np.int8))


def flag_overloaded(result: PressResult, largest_n: float) -> PressResult:
    """The result with the steps flagged at which a press by depth needs more force than the sensor's limit."""
    return replace(result, within_validity=result.within_validity & (result.normal_force_n <= largest_n).astype(np.int8))
