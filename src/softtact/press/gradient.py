"""`PressResult.gradient`: how maps and depth of a press change with pose, force, stiffness and thickness.

The settled contact is differentiated with its points under pressure held (`models.elastic.gradient`, `models.foundation.gradient`),
the heights of the object by the facets over the points (`contact.height_rates`), and the readout by its formulas
(`readout.capacitance_rates`). The result keeps no matrices: contact and compliance are found again from its sensor and object.
The rates by thickness come from the compliances of two sensors, 1 % thinner and thicker, which are kept in the user's cache.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.contact.height_rates import gap_rates, touch_rates
from softtact.contact.object_points import ObjectPoints
from softtact.contact.underside import Underside
from softtact.contact.unilateral import LEAST_REACH_MM, REACH, RISE
from softtact.errors import InputError
from softtact.models.elastic.compliance import press_layer
from softtact.models.elastic.gradient import LayerPressRates, PressedLayer
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import Places
from softtact.models.foundation.gradient import Balance, Tangent
from softtact.models.foundation.solve import FoundationMaps, settled_contacts
from softtact.press.cache import cached_compliance, cached_foundation
from softtact.press.objects import Origin
from softtact.readout.capacitance import felt_displacement
from softtact.readout.capacitance_rates import counts_rates, felt_rates
from softtact.readout.taxels import Capacitance, counts_of
from softtact.unknown_names import unknown

if TYPE_CHECKING:
    from softtact.press.result import PressResult

_POSE = {"x": "mm", "y": "mm", "rx": "degree", "ry": "degree", "rz": "degree"}
_UNITS = _POSE | {"force": "N", "young": "MPa", "thickness": "mm"}
_OF_POSE = [0, 1, 3, 4, 5]     # of the pose's six numbers: the height of an object that is pressed by force has no effect
_OF = {"tactile_map": "counts", "deformation_map": "mm", "depth": "mm"}
_THICKER = 0.01     # of the upper layer: maps are within 5e-5 of the derivative, counts within 2e-3; errors grow with its square
_RESTING = 1e-6     # of a force: largest share on the shell


@dataclass(frozen=True)
class Gradient:
    """Derivatives of a press by its parameters, at each load step, the points under pressure held."""

    of: str
    """What is differentiated: tactile_map, deformation_map or depth."""
    values: np.ndarray
    """(step, row, column, parameter) of a map, (step, parameter) of the depth, in `units`."""
    parameters: tuple[str, ...]
    """Names: x, y, rx, ry, rz, force, young, thickness."""
    units: tuple[str, ...]
    """Units of each parameter's derivative, such as counts/mm."""
    active_set_margin: np.ndarray
    """(step, parameter) in the parameter's unit: by how much it can change alone, to either side, until a point of the surface
    gains or loses contact. Within it the contact is linear; beyond it the derivative changes by the share of single points."""

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


def gradient(result: "PressResult", of: str, by: Sequence[str]) -> Gradient:
    """See `PressResult.gradient`."""
    names = _parameters(of, by)
    _check(result, of)
    rates = _DIFFERENTIATED[result.model](result, names)
    values = {"depth": lambda: rates.depth, "deformation_map": lambda: rates.maps, "tactile_map": lambda: rates.counts}[of]()
    units = _UNITS | ({"young": "1"} if result.model == "foundation" else {})
    return Gradient(of, np.moveaxis(values, 0, -1), tuple(names), tuple(f"{_OF[of]}/{units[name]}" for name in names),
                    rates.margin.T)


def _parameters(of, by):
    """Names of the single parameters in `by`; refuses unknown names and those that have no gradient."""
    if of not in list(_OF):
        raise InputError(f"gradient(of={of!r}): {unknown(of, list(_OF), kind='quantity with a gradient')}")
    if isinstance(by, int | float | None) or not len(by := list(by)):
        raise InputError(f"gradient(by={by!r}): name at least one parameter of: {', '.join(['pose', *_UNITS])}.")
    for name in by:
        if name == "friction":
            raise InputError("gradient(by='friction'): a press with friction depends on its whole path, not on the settled contact "
                             "alone; take the difference of two presses with Sensor.with_friction.")
        if name not in ("pose", *_UNITS):
            raise InputError(f"gradient(by={name!r}): {unknown(name, ['pose', *_UNITS], kind='parameter with a gradient')}")
    return list(dict.fromkeys(single for name in by for single in (_POSE if name == "pose" else [name])))


def _check(result, of):
    """Refuse a press without a gradient, with the reason and a remedy."""
    if result.model not in _DIFFERENTIATED:
        raise InputError(f"The {result.model} model has no gradients; press with model='elastic' or 'foundation'.")
    if result.origin is None:
        raise InputError("This result does not know its sensor and object, which a gradient needs: it was read from a file, "
                         "pressed in a batch, along a motion, over time or on a gel; press again with Sensor.press and force_n.")
    if hash(result.origin.mesh) != result.origin.mesh_hash:
        raise InputError("The object's mesh was changed after the press, so its contact is not that of this result any more; press "
                         "again, and change copies of a mesh.")
    if (untouched := np.flatnonzero(result.pad_force_n <= 0)).size:
        raise InputError(f"At {result.normal_force_n[untouched[0]]:g} N the object rests on the shell and touches nothing of the "
                         "pad, so there is no gradient; give a narrower object, or another pose.")
    if (resting := np.flatnonzero(result.shell_force_n > _RESTING * result.normal_force_n)).size:
        raise InputError(f"At {result.normal_force_n[resting[0]]:g} N the object rests on the shell beside the pad, where the "
                         "pad's force no longer follows; ask for gradients of smaller forces.")
    if of == "tactile_map" and not isinstance(result.origin.sensor.readouts.get("taxels"), Capacitance):
        raise InputError(f"{result.sensor} has no readout 'taxels' of kind capacitance, whose gradient this is; take "
                         "of='deformation_map'.")


@dataclass(frozen=True)
class _Rates:
    """Rates by k parameters: depth (k, l), maps (k, l, y, x) in mm, counts (k, l, rows, columns), margin (k, l)."""

    depth: np.ndarray
    maps: np.ndarray
    margin: np.ndarray
    read: Callable[[], np.ndarray]

    @property
    def counts(self):
        return self.read()


# --- the elastic model ---


def _of_elastic(result, names):
    origin, spec = result.origin, result.origin.sensor.spec
    compliance, surface = origin.sensor.prepared("elastic"), origin.underside
    points, press = _pressed_layer(result, compliance, surface)
    layer = PressedLayer(compliance, points, press)
    found = _by_names(names, layer, origin, points, compliance.grid, surface)
    rates = LayerPressRates(*(np.concatenate([getattr(found[name], one) for name in names])
                              for one in ("force", "depth", "fields", "thinning", "margin")))
    touch = touch_rates(surface, spec.map_x_mm, spec.map_y_mm, _of_pose(origin))
    depth = rates.depth - np.array([touch[list(_POSE).index(name)] if name in _POSE else 0.0 for name in names])[:, None]

    def counts():
        felt = felt_displacement(spec, press.thinning)
        found = counts_rates(spec, felt, felt_rates(spec, press.thinning, rates.thinning))
        if "thickness" in names:
            found[names.index("thickness")] += _by_gap_at_rest(
                spec, lambda other: counts_of(other, felt_displacement(other, press.thinning)))
        return found

    return _Rates(depth, rates.fields[..., ::2, ::2], rates.margin, counts)


def _pressed_layer(result, compliance, surface):
    """The contact of the press once more, with its points."""
    underside = Underside(surface, compliance.grid)
    points = underside.nodes(_reach(result, underside, compliance, result.origin.sensor.spec.deepest_mm))
    return points, press_layer(compliance, points, result.normal_force_n)


def _reach(result, underside, compliance, deepest_mm):
    """Height over first touch up to which points are taken: at least as many as the press had (`press.fast`)."""
    reach = REACH * underside.depth_on_springs(result.normal_force_n[-1], compliance.foundation_modulus) + LEAST_REACH_MM
    while reach < deepest_mm and RISE * result.indentation_mm[-1] > reach:
        reach *= REACH
    return min(reach, deepest_mm)


def _by_names(names, layer, origin, points, grid, surface):
    """`LayerPressRates` of one parameter, by its name."""
    found, spec = {}, origin.sensor.spec
    if moving := [name for name in names if name in _POSE]:
        rows = [list(_POSE).index(name) for name in moving]
        together = layer.by_gaps(gap_rates(surface, grid, points, _of_pose(origin))[rows])
        found |= {name: LayerPressRates(*(values[k:k + 1] for values in vars(together).values())) for k, name in enumerate(moving)}
    if {"force", "young"} & set(names):
        found["force"] = layer.by_force()
        found["young"] = layer.by_young(spec.elastic_layer.young_mpa, found["force"])
    if "thickness" in names:
        thinner, thicker = _thinner_and_thicker(spec)
        found["thickness"] = layer.by_compliance(*map(cached_compliance, (thinner, thicker)), 2 * _THICKER * spec.upper_layer_mm)
    return found


def _of_pose(origin: Origin) -> Callable[[np.ndarray], np.ndarray]:
    """Velocities (5, n, 3) of an object's points (n, 3) by the numbers of its pose that count."""
    return lambda points: origin.pose.rates(points)[_OF_POSE]


def _thinner_and_thicker(spec):
    """The sensor with a thinner and with a thicker upper layer."""
    return [spec.with_upper_layer((1 + share) * spec.upper_layer_mm) for share in (-_THICKER, _THICKER)]


def _by_gap_at_rest(spec, read):
    """The rate of readings by thickness under a displacement that is held, as the gap between the electrodes changes."""
    thinner, thicker = map(read, _thinner_and_thicker(spec))
    return (thicker - thinner) / (2 * _THICKER * spec.upper_layer_mm)


# --- the foundation model ---


def _of_foundation(result, names):
    origin, spec = result.origin, result.origin.sensor.spec
    compliance, in_pose = origin.sensor.prepared("foundation"), origin.underside
    surface = in_pose.near_touch(spec.map_x_mm, spec.map_y_mm)
    underside = Underside(surface, compliance.grid)
    points = underside.points(_reach(result, underside, compliance, spec.thickness_mm))
    lift = [0.0, 0.0, in_pose.lowest_mm - surface.lowest_mm]
    near = _Near(result, surface, points, lambda places: _of_pose(origin)(places + lift), _others(origin, names, points))
    steps = list(settled_contacts(compliance, points, result.normal_force_n))
    balance = Balance(compliance, points, steps[0])
    found = [near.rates(balance.of(contact), names) for contact in steps]
    return near.together(found, [contact.load_step for contact in steps], names)


def _others(origin, names, points):
    """Compliances of the sensor with a thinner and a thicker upper layer, where they are needed."""
    sensor = origin.sensor
    return [cached_foundation(other, sensor.laws) for other in _thinner_and_thicker(sensor.spec)] if "thickness" in names else []


@dataclass(frozen=True)
class _Near:
    """The underside near the sensing surface, with what is needed to differentiate the foundation model's load steps."""

    result: "PressResult"
    surface: HeightField
    points: ObjectPoints
    moving: Callable[[np.ndarray], np.ndarray]
    others: list[FoundationCompliance]

    @property
    def apart_mm(self):
        return 2 * _THICKER * self.result.origin.sensor.spec.upper_layer_mm

    def rates(self, balance, names):
        """`Rates` of a load step by each name."""
        contact, found = balance.contact, {}
        tangent = Tangent.settled(balance, contact.points.gap, contact.load_step.force_n)
        if set(names) & set(_POSE):
            rows = gap_rates(self.surface, balance.places.compliance.grid, contact.points, self.moving)
            found |= {name: tangent.by_gaps(row) for name, row in zip(_POSE, rows, strict=True) if name in names}
        if {"force", "young"} & set(names):
            found["force"] = tangent.by_force()
            found["young"] = tangent.by_moduli(found["force"])
        if "thickness" in names:
            pair = [Balance(other, self.points, contact) for other in self.others]
            found["thickness"] = tangent.by_compliance(*pair, self.apart_mm, contact.points.gap)
        return [found[name] for name in names]

    def together(self, found, load_steps, names):
        """The `_Rates` of all load steps; found[step][name]."""
        origin, spec = self.result.origin, self.result.origin.sensor.spec
        touch = touch_rates(self.surface, spec.map_x_mm, spec.map_y_mm, self.moving)
        depth = np.array([[one.depth for one in of_step] for of_step in found]).T
        depth -= np.array([touch[list(_POSE).index(name)] if name in _POSE else 0.0 for name in names])[:, None]
        places = Places(origin.sensor.prepared("foundation"), self.points)
        maps = np.stack([places.maps(*(np.stack([getattr(one, part) for one in of_step], axis=1) for part in ("load", "lateral")))
                         for of_step in found], axis=1)
        if "thickness" in names:
            thinner, thicker = (FoundationMaps(other, self.points)(load_steps) for other in self.others)
            maps[names.index("thickness")] += (thicker - thinner) / self.apart_mm
        return _Rates(depth, maps, np.array([[one.margin for one in of_step] for of_step in found]).T,
                      lambda: counts_rates(spec, self.result.thinning_map_mm, maps))


_DIFFERENTIATED: dict[str, Callable[["PressResult", list[str]], _Rates]] = {
    "elastic": _of_elastic, "foundation": _of_foundation}
