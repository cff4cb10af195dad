"""The virtual sensor: simulated readings of a real sensor for a reference press. It replaces measurements, and is named as such.

Reference deformation, moved and scaled as trials differ -> lag over the history of force -> capacitance of each electrode with its
edges and neighbours -> gain, zero and drift of each taxel -> the converter. One seed is one specimen; trials differ in placement,
force, drift and noise. Each effect, the reason for its default and its switch: docs/explanation/virtual_sensor.md.
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from softtact.errors import InputError
from softtact.readout.capacitance import EPSILON_0_PF_PER_MM, equivalent_air_gap
from softtact.readout.electrodes import coupled, electrode_sides, electrode_weights, fringe_factor, taxel_means
from softtact.readout.hysteresis import delayed_branches, staircase

if TYPE_CHECKING:
    from softtact.sensors.frusta import SensorSpec

_LISTS = ("relaxation", "relaxation_s", "dead_taxels")
_LARGEST_DEVIATION = 2.5          # standard deviations of a sheet's thickness, as of the frusta's heights
_MAY_BE_INFINITE = ("rate_n_per_s", "largest_counts")


@dataclass(frozen=True)
class VirtualSensorSettings:
    """Sizes of the effects; 0, or no entry in a list, switches one off. Reasons: docs/explanation/virtual_sensor.md.

    electrode_spacing_mm: between neighbours;  outer_fringe, inner_fringe: share of a free edge's field at the sensor's border, and
    between neighbours;  coupling: share of their difference that neighbours exchange;  sheet_scatter: standard deviation of the
    sheet's thickness over the taxels, as a share, in the electric field
    relaxation, relaxation_s: numbers or lists, delayed shares of the deformation (creep) and their time constants
    rate_n_per_s: of ramps between load steps (.inf: steps);  load_step_s: hold at a load step, read at its end;  cycles_before,
    rest_s: number of cycles to the highest load step and back before the press, and the rest after each
    placement_mm, force_scatter: standard deviations of a trial's position (x, y) and of its forces, as a share
    counts_per_relative_change: counts at dC/C0 = 1;  gain_scatter, offset_counts: standard deviations over taxels
    drift, drift_counts: standard deviations of each taxel's change of gain and zero from trial to trial
    dead_taxels: their numbers, row by row from 0;  dead_share: chance that a taxel is dead
    noise_counts, step_counts, largest_counts (None: the sensor's; .inf: no limit): of the converter
    """

    electrode_spacing_mm: float = 0.3
    outer_fringe: float = 1.0
    inner_fringe: float = 0.1
    coupling: float = 0.01
    sheet_scatter: float = 0.02
    relaxation: tuple = (0.08, 0.06)
    relaxation_s: tuple = (1.0, 10.0)
    rate_n_per_s: float = 10.0
    load_step_s: float = 1.0
    cycles_before: int = 1
    rest_s: float = 10.0
    placement_mm: float = 0.1
    force_scatter: float = 0.01
    counts_per_relative_change: float = 1000.0
    gain_scatter: float = 0.03
    offset_counts: float = 5.0
    drift: float = 0.01
    drift_counts: float = 2.0
    dead_taxels: tuple = ()
    dead_share: float = 0.0
    noise_counts: float = 6.0
    step_counts: float = 1.0
    largest_counts: float | None = None

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Settings from a mapping; an unknown key or an unusable value is refused."""
        unknown = sorted(set(values) - set(cls.__dataclass_fields__))
        if unknown:
            raise InputError(f"virtual_sensor: key {unknown[0]!r} is unknown; use one of "
                             f"{', '.join(cls.__dataclass_fields__)}.")
        return cls(**values)

    @classmethod
    def ideal(cls, **changes: Any) -> Self:
        """All effects off except `changes`: the ideal counts, without an upper limit."""
        off = {field.name: () if field.name in _LISTS else 0.0 for field in dataclasses.fields(cls)}
        kept = {name: getattr(cls, name) for name in ("rate_n_per_s", "load_step_s", "counts_per_relative_change")}
        return cls(**off | kept | {"largest_counts": np.inf} | changes)

    def of_calibrated(self, spec: "SensorSpec") -> Self:
        """These settings with the scale and the creep of a sensor's `calibration`, where it has one."""
        known = spec.calibration
        return self if known is None else dataclasses.replace(
            self, counts_per_relative_change=known.counts_per_relative_change, relaxation=known.relaxation,
            relaxation_s=known.relaxation_s)

    def __post_init__(self):
        for name in _LISTS:
            given = getattr(self, name)
            object.__setattr__(self, name, tuple(given) if isinstance(given, (list, tuple)) else (given,))
        if not any(self.relaxation):
            object.__setattr__(self, "relaxation", ())
            object.__setattr__(self, "relaxation_s", ())
        self._check_sizes()
        object.__setattr__(self, "cycles_before", int(self.cycles_before))
        self._check_lists()

    def _check_sizes(self):
        for name in set(self.__dataclass_fields__) - set(_LISTS):
            value = getattr(self, name)
            if name == "largest_counts" and value is None:
                continue
            if not (np.isscalar(value) and value >= 0 and (np.isfinite(value) or name in _MAY_BE_INFINITE)):
                raise InputError(f"virtual_sensor: {name} is {value}; give one number of 0 or more.")
        if self.cycles_before != int(self.cycles_before):
            raise InputError(f"virtual_sensor: cycles_before is {self.cycles_before:g}; give a whole number.")
        if not (self.rate_n_per_s > 0 and (self.largest_counts is None or self.largest_counts > 0)):
            raise InputError("virtual_sensor: rate_n_per_s and largest_counts must be above 0; .inf switches their effect off.")
        if self.coupling > 0.25:
            raise InputError(f"virtual_sensor: coupling is {self.coupling:g}; with four neighbours it is 0.25 at most.")

        if self.sheet_scatter * _LARGEST_DEVIATION >= 1:
            raise InputError(f"virtual_sensor: sheet_scatter is {self.sheet_scatter:g}; from 0.4 on a sheet could vanish.")

    def _check_lists(self):
        shares, times = self.relaxation, self.relaxation_s
        if len(shares) != len(times):
            raise InputError(f"virtual_sensor: relaxation has {len(shares)} terms and relaxation_s {len(times)}; give as many.")
        if not (all(share >= 0 for share in shares) and sum(shares) < 1 and all(time > 0 for time in times)):
            raise InputError("virtual_sensor: relaxation needs shares of 0 or more that sum to less than 1, and relaxation_s times "
                             "above 0 s.")


@dataclass(frozen=True)
class Specimen:
    """One specimen of the sensor: gain, offset_counts, sheet_excess_mm, dead, each (rows, columns)."""

    gain: np.ndarray
    offset_counts: np.ndarray
    sheet_excess_mm: np.ndarray
    dead: np.ndarray


@dataclass(frozen=True)
class Branches:
    """Counts (trial, force, row, column) during loading and during unloading."""

    loading: np.ndarray
    unloading: np.ndarray


def read_virtual_sensor(spec: "SensorSpec", deformation_map_mm: np.ndarray, *, force_n: Sequence[float] | np.ndarray, trials: int,
                        seed: int, item: str, settings: VirtualSensorSettings = VirtualSensorSettings()) -> np.ndarray:
    """Counts (trial, force, row, column) during loading; arguments as for `read_branches`."""
    return read_branches(spec, deformation_map_mm, force_n=force_n, trials=trials, seed=seed, item=item,
                         settings=settings).loading


def read_branches(spec: "SensorSpec", deformation_map_mm: np.ndarray, *, force_n: Sequence[float] | np.ndarray, trials: int,
                  seed: int, item: str, settings: VirtualSensorSettings = VirtualSensorSettings()) -> Branches:
    """`Branches` of counts for maps (force, y, x) in mm at rising forces (force,) in N; `item` varies the random numbers."""
    settings = settings.of_calibrated(spec)
    specimen = make_specimen(spec, seed=seed, settings=settings)
    history = staircase(np.asarray(force_n, dtype=float), rate_n_per_s=settings.rate_n_per_s, hold_s=settings.load_step_s,
                        cycles_before=settings.cycles_before, rest_s=settings.rest_s)
    draws = [np.random.default_rng([seed, 1, trial, *item.encode()]) for trial in range(trials)]
    true = np.stack([_true_counts(spec, specimen, deformation_map_mm, force_n, history, rng, settings) for rng in draws])
    largest = spec.largest_counts if settings.largest_counts is None else settings.largest_counts
    counts = _read_out(true, specimen, draws, settings, largest=largest)
    return Branches(*np.split(counts, 2, axis=1))


def make_specimen(spec: "SensorSpec", *, seed: int, settings: VirtualSensorSettings = VirtualSensorSettings()) -> Specimen:
    """The `Specimen` of a seed. All numbers are always drawn, so that switching one effect off does not change the others.

    For a sensor with a `calibration` it has the gains and zeros found there, which include the effect of the sheet's thickness.
    """
    spec.need_frusta("the virtual sensor", "take the ideal readout, `PressResult.tactile_map`")
    if not settings.electrode_spacing_mm < min(electrode_sides(spec)):
        raise InputError(f"virtual_sensor: electrode_spacing_mm is {settings.electrode_spacing_mm:g}, and a taxel "
                         f"{min(electrode_sides(spec)):g} mm wide; leave something of the electrode.")
    rng, shape = np.random.default_rng([seed, 0]), _grid_of(spec)
    gain, offset, sheet = rng.standard_normal((3, *shape))
    dead = rng.random(shape) < settings.dead_share
    for number in settings.dead_taxels:
        if number not in range(dead.size):
            raise InputError(f"virtual_sensor: dead_taxels has {number:g}; the taxels are numbered 0 to {dead.size - 1}.")
        dead.flat[int(number)] = True
    if spec.calibration is not None:
        return Specimen(np.array(spec.calibration.gain), np.array(spec.calibration.zero_counts), np.zeros(shape), dead)
    sheet_excess = spec.dielectric.sheet_thickness_mm * settings.sheet_scatter * sheet.clip(-_LARGEST_DEVIATION, _LARGEST_DEVIATION)
    return Specimen(1 + settings.gain_scatter * gain, settings.offset_counts * offset, sheet_excess, dead)


def taxel_capacitance(spec: "SensorSpec", displacement_mm: np.ndarray, *, sheet_excess_mm: float | np.ndarray = 0.0,
                      shift_mm: tuple[float, float] = (0.0, 0.0),
                      settings: VirtualSensorSettings = VirtualSensorSettings()) -> np.ndarray:
    """Capacitance (..., rows, columns) in pF of the electrodes under a displacement (..., y, x) in mm of the electrode plane.

    sheet_excess_mm: number or (rows, columns), excess thickness of the sheet over a taxel;  shift_mm: (x, y) of the object
    """
    spacing = settings.electrode_spacing_mm
    extra = np.broadcast_to(sheet_excess_mm, _grid_of(spec))
    air = equivalent_air_gap(spec, displacement_mm)
    if np.any(extra):
        inverse = 1 / (air + extra[:, :, *[None] * air.ndim] / spec.dielectric.relative_permittivity)  # (row, column, ..., y, x)
        weights = electrode_weights(spec, spacing_mm=spacing, shift_mm=shift_mm)
        means = np.einsum("ry,cx,rc...yx->...rc", *weights, inverse, optimize=True)
    else:
        means = taxel_means(spec, 1 / air, spacing_mm=spacing, shift_mm=shift_mm)
    moved = taxel_means(spec, displacement_mm, spacing_mm=spacing, shift_mm=shift_mm)
    thickness = spec.dielectric_thickness_mm + extra
    gap = np.maximum(thickness - moved, 0.02 * thickness)
    fringe = fringe_factor(spec, gap, spacing_mm=spacing, outer=settings.outer_fringe, inner=settings.inner_fringe)
    plates = EPSILON_0_PF_PER_MM * np.prod(electrode_sides(spec, spacing_mm=spacing)) * means
    return coupled(plates * fringe, settings.coupling)


def _true_counts(spec, specimen, maps, force_n, history, rng, s):
    """Counts (2 load steps, row, column) of one trial before the readout's errors: loading, then unloading, by rising force."""
    shift, force_error = s.placement_mm * rng.standard_normal(2), s.force_scatter * rng.standard_normal()
    maps = _at_force(np.asarray(maps), np.asarray(force_n, dtype=float), 1 + force_error)
    delayed = np.concatenate(delayed_branches(maps, history, shares=s.relaxation, time_constants_s=s.relaxation_s))
    sheet = {"sheet_excess_mm": specimen.sheet_excess_mm, "settings": s}
    rest = taxel_capacitance(spec, np.zeros(delayed.shape[1:]), **sheet)
    return s.counts_per_relative_change * (taxel_capacitance(spec, delayed, shift_mm=shift, **sheet) / rest - 1)


def _at_force(maps, force_n, factor):
    """Maps (force, y, x) at `factor` times their forces (N): linear between load steps and from rest, extrapolated beyond."""
    if factor == 1:
        return maps
    force, maps = np.concatenate([[0.0], force_n]), np.concatenate([np.zeros((1, *maps.shape[1:])), maps])
    wanted = factor * force[1:]
    low = np.clip(np.searchsorted(force, wanted) - 1, 0, len(force) - 2)
    share = ((wanted - force[low]) / np.diff(force)[low])[:, None, None]
    return (1 - share) * maps[low] + share * maps[low + 1]


def _read_out(true, specimen, draws, s, *, largest):
    """Counts of the converter from true counts (trial, load step, row, column)."""
    taxels = true.shape[2:]
    steps = np.stack([rng.standard_normal((2, *taxels)) for rng in draws])[:, :, None]                # (trial, 2, 1, row, column)
    noise = s.noise_counts * np.stack([rng.standard_normal((true.shape[1], *taxels)) for rng in draws])
    counts = amplified(true, gain=specimen.gain, offset=specimen.offset_counts, gain_drift=random_walk(steps[:, 0], s.drift),
                       offset_drift=random_walk(steps[:, 1], s.drift_counts))
    return converted(counts, noise=noise, step=s.step_counts, largest=largest, dead=specimen.dead)


# --- from relative change of capacitance to counts: gain, zero and drift of the taxels, dead taxels, the converter ---


def random_walk(steps: np.ndarray, size: float) -> np.ndarray:
    """Sum (trials, ...) of normal steps (trials, ...) of standard deviation `size`; no step before the first trial."""
    walk = size * np.cumsum(steps, axis=0)
    return walk - walk[:1]


def amplified(counts: np.ndarray, *, gain: float | np.ndarray, offset: float | np.ndarray, gain_drift: float | np.ndarray = 0.0,
              offset_drift: float | np.ndarray = 0.0) -> np.ndarray:
    """Counts (..., rows, columns) of taxels with a gain and a zero each; argument a number or (rows, columns)."""
    return gain * (1 + gain_drift) * counts + offset + offset_drift


def converted(counts: np.ndarray, *, noise: float | np.ndarray = 0.0, step: float = 1.0, largest: float = 2400.0,
              dead: bool | np.ndarray = False) -> np.ndarray:
    """Counts of the converter for counts (...): noise (...) added, rounded to `step` (0: not), within 0 and `largest`.

    dead: (rows, columns) of bool, taxels that always read zero
    """
    noisy = counts + noise
    rounded = step * np.round(noisy / step) if step > 0 else noisy
    return np.where(dead, 0.0, np.clip(rounded, 0.0, largest))


def _grid_of(spec):
    """(rows, columns) of the taxels."""
    taxels = spec.need_taxels("the virtual sensor")
    return taxels.rows, taxels.columns
