"""`PressResult.gradient` and `PressBatch.gradient`: how maps and depth change with pose, force, stiffness and thickness.

The settled contact is differentiated with its points under pressure held (`models.elastic.gradient`, `models.foundation.gradient`),
the heights of the object by the facets over the points (`contact.height_rates`), and the readout by its formulas
(`readout.capacitance_rates`). Results keep no matrices: contact and compliance are found again from sensor and object. Presses of a
batch are differentiated one after the other: one product with the compliance for all takes longer than one for each, which reads
the part about its contact alone. The rates by thickness come from the compliances of two sensors, 1 % thinner and thicker, which
are kept in the user's cache.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.contact.height_rates import gap_rates, touch_rates
from softtact.contact.object_points import ObjectPoints
from softtact.contact.underside import Underside
from softtact.contact.undersides import underside_of
from softtact.contact.unilateral import LEAST_REACH_MM, REACH, RISE
from softtact.errors import ConvergenceError, InputError, SofttactError
from softtact.geometry.pose import Pose
from softtact.linalg.workers import on_one_thread
from softtact.models.elastic.compliance import touch_object
from softtact.models.elastic.gradient import LayerPressRates, PressedLayer
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import Places
from softtact.models.foundation.edge_rates import EdgeRates, MovedPoints, moved_points
from softtact.models.foundation.gradient import Balance, Tangent
from softtact.models.foundation.solve import FoundationMaps, settled_contacts
from softtact.press.cache import cached_compliance, cached_foundation
from softtact.press.objects import target_of
from softtact.readout.capacitance import felt_displacement
from softtact.readout.capacitance_rates import counts_rates, felt_with_rates
from softtact.readout.taxels import Capacitance, counts_of
from softtact.unknown_names import unknown

if TYPE_CHECKING:
    from softtact.press.batch import PressBatch
    from softtact.press.result import PressResult
    from softtact.press.sensor import Sensor

_POSE = {"x": "mm", "y": "mm", "rx": "degree", "ry": "degree", "rz": "degree"}
_UNITS = _POSE | {"force": "N", "young": "MPa", "thickness": "mm"}
_OF_POSE = [0, 1, 3, 4, 5]     # of the pose's six numbers: the height of an object that is pressed by force has no effect
_OF = {"tactile_map": "counts", "deformation_map": "mm", "depth": "mm"}
_THICKER = 0.01     # of the upper layer: maps are within 5e-5 of the derivative, counts within 2e-3; errors grow with its square
_RESTING = 1e-6     # of a force: largest share on the shell


@dataclass(frozen=True)
class Gradient:
    """Derivatives by parameters of a press at each load step, or of each press of a batch, the points under pressure held.

    Where shapes say step, a batch has its presses.
    """

    of: str
    """What is differentiated: tactile_map, deformation_map or depth."""
    values: np.ndarray
    """(step, row, column, parameter) of a map, (step, parameter) of the depth, in `units`; nan for a press without a gradient."""
    parameters: tuple[str, ...]
    """Names: x, y, rx, ry, rz, force, young, thickness."""
    units: tuple[str, ...]
    """Units of each parameter's derivative, such as counts/mm."""
    active_set_margin: np.ndarray
    """(step, parameter) in the parameter's unit: by how much it can change alone, to either side, until a point of the surface
    gains or loses contact. Within it the contact is linear; beyond it the derivative changes by the share of single points."""
    errors: Mapping[int, SofttactError] = field(default_factory=dict)
    """By the number of each press of a batch that has no gradient: it failed, rests on the shell, or did not settle."""

    def __getitem__(self, parameter: str) -> np.ndarray:
        """The derivative (step, ...) by one parameter. Raises InputError for an unknown one."""
        if parameter not in self.parameters:
            raise InputError(f"This gradient: {unknown(parameter, self.parameters, kind='parameter')}")
        return self.values[..., self.parameters.index(parameter)]

    def vjp(self, cotangent: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product (step, parameter): derivatives of the sum of cotangent times what is differentiated.

        cotangent: of the shape of the map (step, row, column), or (step,) of the depth
        """
        if np.shape(cotangent) != self.values.shape[:-1]:
            raise InputError(f"vjp: the cotangent has the shape {np.shape(cotangent)}; give {self.values.shape[:-1]}, that of "
                             f"{self.of}.")
        product: np.ndarray = np.asarray(cotangent)[..., None] * self.values
        return product.sum(axis=tuple(range(1, product.ndim - 1)))


@dataclass(frozen=True)
class SettledPress:
    """What a gradient needs of a press by l forces, or of one of a batch: its results, and what its contact is found again from."""

    sensor: "Sensor"
    model: str
    surface: Callable[[], HeightField]
    """The object's underside in its pose; found again, as it takes more memory than a result."""
    pose: Pose
    normal_force_n: np.ndarray
    pad_force_n: np.ndarray
    shell_force_n: np.ndarray
    indentation_mm: np.ndarray
    """These (l,)."""
    thinning_map_mm: np.ndarray
    """(l, ny, nx)."""

    def velocities(self, points: np.ndarray) -> np.ndarray:
        """Velocities (5, n, 3) of the object's points (n, 3) by the numbers of its pose that count."""
        return self.pose.rates(points)[_OF_POSE]


def gradient(result: "PressResult", of: str, by: str | Sequence[str]) -> Gradient:
    """See `PressResult.gradient`."""
    names = _parameters(of, by)
    press = _settled(result)
    _check_taxels(press.sensor, of)
    _check_contact(press)
    return _gradient(press.model, of, names, *_differentiated(press.model, press, of, names))


def gradient_of_batch(batch: "PressBatch", of: str, by: str | Sequence[str]) -> Gradient:
    """See `PressBatch.gradient`."""
    names, origin = _parameters(of, by), batch.origin
    if origin is None:
        raise InputError("This batch does not know its sensor and objects, which a gradient needs: it comes from another process, "
                         "or was pressed on a gel, whose presses have none; press a pad with press_batch in this process.")
    _check_taxels(origin.sensor, of)
    rows: Any = {"tactile_map": batch.tactile_map, "deformation_map": batch.deformation_map_mm, "depth": batch.indentation_mm}[of]
    values, margin = np.full((len(names), *rows.shape), np.nan), np.full((len(names), len(rows)), np.nan)
    errors = dict(batch.errors)
    for number in map(int, np.flatnonzero(batch.converged)):
        try:
            press = _row(batch, number)
            _check_contact(press)
            values[:, [number]], margin[:, [number]] = _differentiated(origin.model, press, of, names)
        except (ConvergenceError, InputError) as error:
            errors[number] = error.with_traceback(None)
    return _gradient(origin.model, of, names, values, margin, dict(sorted(errors.items())))


def _gradient(model, of, names, values, margin, errors=None):
    """The `Gradient` of values (k, step, ...) and margins (k, step) by the parameters of k names."""
    units = _UNITS | ({"young": "1"} if model == "foundation" else {})
    return Gradient(of, np.moveaxis(values, 0, -1), tuple(names), tuple(f"{_OF[of]}/{units[name]}" for name in names), margin.T,
                    errors or {})


@on_one_thread
def _differentiated(model, press, of, names):
    """Values and margins of a press."""
    return _DIFFERENTIATED[model](press, of, names)


def _parameters(of, by):
    """Names of the single parameters in `by`; refuses unknown names and those that have no gradient."""
    if of not in list(_OF):
        raise InputError(f"gradient(of={of!r}): {unknown(of, list(_OF), kind='quantity with a gradient')}")
    by = [by] if isinstance(by, str) else by
    if isinstance(by, int | float | None) or not len(by := list(by)):
        raise InputError(f"gradient(by={by!r}): name at least one parameter of: {', '.join(['pose', *_UNITS])}.")
    for name in by:
        if name == "friction":
            raise InputError("gradient(by='friction'): a press with friction depends on its whole path, not on the settled contact "
                             "alone; take the difference of two presses with Sensor.with_friction.")
        if name not in ("pose", *_UNITS):
            raise InputError(f"gradient(by={name!r}): {unknown(name, ['pose', *_UNITS], kind='parameter with a gradient')}")
    return list(dict.fromkeys(single for name in by for single in (_POSE if name == "pose" else [name])))


def _settled(result):
    """The `SettledPress` of a result; refuses one of another model or of unknown origin."""
    origin = result.origin
    if result.model not in _DIFFERENTIATED:
        raise InputError(f"The {result.model} model has no gradients; press with model='elastic' or 'foundation'.")
    if origin is None:
        raise InputError("This result does not know its sensor and object, which a gradient needs: it was read from a file, "
                         "pressed by press_many, along a motion, over time or on a gel; press again with Sensor.press and force_n, "
                         "or with press_batch.")
    if hash(origin.mesh) != origin.mesh_hash:
        raise InputError("The object's mesh was changed after the press, so its contact is not that of this result any more; press "
                         "again, and change copies of a mesh.")
    return SettledPress(origin.sensor, result.model, lambda: origin.underside, origin.pose, result.normal_force_n,
                        result.pad_force_n, result.shell_force_n, result.indentation_mm, result.thinning_map_mm)


def _row(batch, number):
    """The `SettledPress` of one of a batch."""
    origin, row = batch.origin, slice(number, number + 1)
    surface, pose = origin.surfaces[number], Pose.of(origin.poses[number])
    force_n, pad_force_n = batch.normal_force_n[row], batch.pad_force_n[row]
    return SettledPress(origin.sensor, origin.model, lambda: surface.height_field(pose), pose or surface.centred, force_n,
                        pad_force_n, force_n - pad_force_n, batch.indentation_mm[row], batch.thinning_map_mm[row])


def _check_contact(press):
    """Refuse a press without a gradient, with the reason and a remedy."""
    if (untouched := np.flatnonzero(press.pad_force_n <= 0)).size:
        raise InputError(f"At {press.normal_force_n[untouched[0]]:g} N the object rests on the shell and touches nothing of the "
                         "pad, so there is no gradient; give a narrower object, or another pose.")
    if (resting := np.flatnonzero(press.shell_force_n > _RESTING * press.normal_force_n)).size:
        raise InputError(f"At {press.normal_force_n[resting[0]]:g} N the object rests on the shell beside the pad, where the "
                         "pad's force no longer follows; ask for gradients of smaller forces.")


def _check_taxels(sensor, of):
    """Refuse counts of a sensor whose taxels are none, or not read by capacitance."""
    if of == "tactile_map" and not isinstance(sensor.readouts.get("taxels"), Capacitance):
        raise InputError(f"{sensor.spec.name} has no readout 'taxels' of kind capacitance, whose gradient this is; take "
                         "of='deformation_map'.")


def _less_touch(depth, surface, spec, names, velocities):
    """Rates (k, l) of the indentation from those of the depth, as first touch changes with the pose, too."""
    touch = touch_rates(surface, spec.map_x_mm, spec.map_y_mm, velocities)
    return depth - np.array([touch[list(_POSE).index(name)] if name in _POSE else 0.0 for name in names])[:, None]


def _thinner_and_thicker(spec):
    """The sensor with a thinner and with a thicker upper layer."""
    return [spec.with_upper_layer((1 + share) * spec.upper_layer_mm) for share in (-_THICKER, _THICKER)]


# --- the elastic model ---


def _of_elastic(press, of, names):
    """Rates (k, l, ...) of a press by each name, and how far (k, l) the active set stays."""
    compliance, spec, surface = press.sensor.prepared("elastic"), press.sensor.spec, press.surface()
    others = [cached_compliance(other) for other in _thinner_and_thicker(spec)] if "thickness" in names else []
    target = target_of(press.sensor, compliance.grid)
    points, contact = touch_object(compliance, underside_of(surface.triangles, target), press.normal_force_n)
    gaps = gap_rates(surface, compliance.grid, points, press.velocities) if set(names) & set(_POSE) else np.zeros((0, points.count))
    rates = _rates_on_layer(PressedLayer(compliance, points, contact), spec, names, gaps, others)
    if of == "depth":
        return _less_touch(rates.depth, surface, spec, names, press.velocities), rates.margin

    def sunk(one, forces):
        """Fields (p, l, 2 ny - 1, 2 nx - 1) of forces (p, c, l)."""
        columns = forces.transpose(1, 0, 2).reshape(points.count, -1)
        found = (one.fields if of == "deformation_map" else one.thinning)(points, columns)
        return found.reshape(len(forces), -1, *found.shape[1:])

    now, *moved = sunk(compliance, np.concatenate([contact.force[None], rates.load]))
    if others:
        thinner, thicker = (sunk(one, contact.force[None])[0] for one in others)
        moved[names.index("thickness")] += (thicker - thinner) / _apart_mm(spec)
    if of == "deformation_map":
        return np.stack(moved)[..., ::2, ::2], rates.margin
    felt, felt_moved = felt_with_rates(spec, now, np.stack(moved))
    counts = counts_rates(spec, felt, felt_moved)
    if others:      # under a displacement that is held, readings change with the gap between the electrodes
        thinner, thicker = (counts_of(other, felt_displacement(other, now)) for other in _thinner_and_thicker(spec))
        counts[names.index("thickness")] += (thicker - thinner) / _apart_mm(spec)
    return counts, rates.margin


def _rates_on_layer(layer, spec, names, gaps, others):
    """`LayerPressRates` by each name; gaps (5, c): rates of the points' gaps by the pose, empty if none of its numbers is named."""
    found, order = [layer.by_gaps(gaps)], list(_POSE)[:len(gaps)]
    if {"force", "young"} & set(names):
        by_force = layer.by_force()
        found, order = [*found, by_force, layer.by_young(spec.elastic_layer.young_mpa, by_force)], [*order, "force", "young"]
    if others:
        found, order = [*found, layer.by_compliance(*others, _apart_mm(spec))], [*order, "thickness"]
    return LayerPressRates.joined(found, [order.index(name) for name in names])


def _apart_mm(spec):
    """By how much the thinner and the thicker upper layer differ."""
    return 2 * _THICKER * spec.upper_layer_mm


# --- the foundation model ---


def _of_foundation(press, of, names):
    """Rates (k, l, ...) of a press by each name, and how far (k, l) the active sets stay."""
    sensor, spec = press.sensor, press.sensor.spec
    compliance, in_pose = sensor.prepared("foundation"), press.surface()
    surface = in_pose.near_touch(spec.map_x_mm, spec.map_y_mm)
    underside = Underside(surface, compliance.grid)
    reach_mm = _reach(press, underside, compliance)
    points = underside.points(reach_mm)
    lift = [0.0, 0.0, in_pose.lowest_mm - surface.lowest_mm]
    others = [cached_foundation(other, sensor.laws) for other in _thinner_and_thicker(spec)] if "thickness" in names else []

    def moving(places):
        return press.velocities(places + lift)

    numbers = [number for number, name in enumerate(_POSE) if name in names]
    aside = moved_points(compliance, surface, points, reach_mm, moving, numbers)
    near = _Near(press, surface, points, aside, moving, others)
    steps = list(settled_contacts(compliance, points, press.normal_force_n))
    balance = Balance(compliance, points, steps[0])
    found = [near.rates(balance.of(contact), names) for contact in steps]
    margin = np.array([[one.margin for one in of_step] for of_step in found]).T
    if of == "depth":
        depth = np.array([[one.depth for one in of_step] for of_step in found]).T
        return _less_touch(depth, surface, spec, names, near.moving), margin
    maps = near.maps(found, [contact.load_step for contact in steps], names)
    return maps if of == "deformation_map" else counts_rates(spec, press.thinning_map_mm, maps), margin


def _reach(press, underside, compliance):
    """Height over first touch up to which points are taken: at least as many as the press had (`press.fast`)."""
    reach = REACH * underside.depth_on_springs(press.normal_force_n[-1], compliance.foundation_modulus) + LEAST_REACH_MM
    deepest_mm = press.sensor.spec.thickness_mm
    while reach < deepest_mm and RISE * press.indentation_mm[-1] > reach:
        reach *= REACH
    return min(reach, deepest_mm)


@dataclass(frozen=True)
class _Near:
    """The underside near the sensing surface, with what is needed to differentiate the foundation model's load steps."""

    press: SettledPress
    surface: HeightField
    points: ObjectPoints
    aside: Mapping[int, MovedPoints]
    """By the numbers of the pose that are asked for."""
    moving: Callable[[np.ndarray], np.ndarray]
    others: list[FoundationCompliance]

    def rates(self, balance, names):
        """`Rates` of a load step by each name."""
        contact, wanted = balance.contact, {*names} | ({"force"} if "young" in names else set())
        tangent, still = Tangent.settled(balance, contact.points.gap, contact.load_step.force_n), np.zeros(self.points.count)
        by_name = dict(zip(_POSE, self._gap_rates(tangent), strict=True)) if wanted & set(_POSE) else {}
        solved, found = [name for name in (*_POSE, "force") if name in wanted], {}
        if solved:
            gaps, forces = zip(*((by_name.get(name, still), float(name == "force")) for name in solved), strict=True)
            found |= zip(solved, tangent.by_gaps(np.stack(gaps), np.array(forces)).each(), strict=True)
        if "young" in names:
            found["young"] = tangent.by_moduli(found["force"])
        if self.others:
            pair = [Balance(other, self.points, contact) for other in self.others]
            found["thickness"] = tangent.by_compliance(*pair, _apart_mm(self.press.sensor.spec), contact.points.gap)
        return [found[name] for name in names]

    def _gap_rates(self, tangent):
        """Rates (5, n) of the points' gaps by the pose."""
        contact, grid = tangent.balance.contact, tangent.balance.places.compliance.grid
        rates = gap_rates(self.surface, grid, contact.points, self.moving)
        if not self.aside:
            return rates
        return EdgeRates(tangent.balance, tangent.at, self.points.gap.min()).replaced(rates, self.aside)

    def maps(self, found, load_steps, names):
        """Rates (k, l, ny, nx) of the maps of all load steps; found[step][name]."""
        places = Places(self.press.sensor.prepared("foundation"), self.points)
        maps = np.stack([places.maps(*(np.stack([getattr(one, part) for one in of_step], axis=1) for part in ("load", "lateral")))
                         for of_step in found], axis=1)
        if self.others:
            thinner, thicker = (FoundationMaps(other, self.points)(load_steps) for other in self.others)
            maps[names.index("thickness")] += (thicker - thinner) / _apart_mm(self.press.sensor.spec)
        return maps


_DIFFERENTIATED: dict[str, Callable[[SettledPress, str, list[str]], tuple[np.ndarray, np.ndarray]]] = {
    "elastic": _of_elastic, "foundation": _of_foundation}
