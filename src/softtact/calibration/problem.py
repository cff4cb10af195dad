"""The unknowns of a calibration, and the readings that follow from them.

    counts = G (1 + e) dC/C0(map) + z               G common scale; e, z: each taxel's gain and zero
    map = creep of the press' map at the force over the modulus scale, moved to the object's place

Gain and zero are linear and solved for within each step (variable projection; Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973)
413). The other unknowns are found with the Gauss-Newton method. The effect of moving and turning an object is the difference
between presses at nearby places, because the sensor's edges do not move with the object; `Problem.at` makes new presses at the
fitted places.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softtact.calibration.experiment import Experiment
from softtact.calibration.ladder import COVERS, FRICTIONS, SOFTEST, Presses, friction_ladders, friction_weights, parabola
from softtact.errors import InputError
from softtact.press.ladder import Ladder
from softtact.readout.capacitance_rates import relative_change_rates
from softtact.readout.hysteresis import lagged
from softtact.readout.taxels import relative_change
from softtact.readout.virtual_sensor import taxel_capacitance

FITTED = ("placement", "relaxation", "modulus", "cover", "friction")
HARDEST = 1 / SOFTEST


@dataclass(frozen=True)
class Priors:
    """Standard deviations of the unknowns before a fit, all assumed and so wide that a press that depends on one outweighs it."""

    gain: float = 0.15
    """Of a taxel's gain over the common one: several times the scatter after the maker's adjustment."""
    zero_counts: float = 30.0
    """Of the zero over the recorder's baseline: five times the virtual sensor's noise."""
    log_scale: float = 3.0
    """Of the logarithm of the common scale, of which only the order of magnitude is known."""
    shares: tuple[float, ...] = (0.08, 0.06)
    """Means of the shares of creep: the virtual sensor's."""
    share: float = 0.1
    """Of these shares."""
    times_s: tuple[float, ...] = (1.0, 10.0)
    """Medians of the time constants of creep: the virtual sensor's, from the duration of a hold to that of a press."""
    log_time: float = 0.7
    """Of the logarithm of a time constant: a factor of two."""
    log_modulus: float = 0.3
    """Of the logarithm of the modulus scale: batches of soft rubber differ by a third."""
    cover: float = 0.15
    """Of the cover's thickness, relative."""
    friction: tuple[float, float] = (0.2, 0.2)
    """Mean and standard deviation of the coefficient of friction between object and cover."""
    place_mm: float = 1.0
    """Of the object's place along x and y, put by hand."""
    angle_deg: float = 3.0
    """Of its angle about z."""


_OFF = (0.5, 0.5, 2.0)     # mm, mm and degrees: differences of the place for the change of the maps, less than a step of the map

# Kind: (step of the finite difference, lowest, highest); the last two about the prior's mean.
_STEPS = {"share": (2e-3, -1.0, 0.4), "ln time": (0.02, -3.0, 3.0),
          "ln modulus": (0.01, float(np.log(SOFTEST)), float(np.log(HARDEST))),
          "cover": (0.01, COVERS[0] - 1, COVERS[-1] - 1),
          "friction": (0.01, FRICTIONS[0] - 0.2, FRICTIONS[-1] - 0.2),
          "x": (0.02, -5.0, 5.0), "y": (0.02, -5.0, 5.0), "angle": (0.2, -15.0, 15.0)}


@dataclass(frozen=True)
class Linear:
    """Gains and zeros of a set of unknowns: scale G;  gain (row, column) G (1 + e);  zero (row, column)."""

    scale: float
    gain: np.ndarray
    zero: np.ndarray


@dataclass
class Problem:
    """Experiments on one sensor, and the unknowns to fit (some of FITTED, besides gain and zero)."""

    presses: Presses
    experiments: Sequence[Experiment]
    fitted: Sequence[str] = ("placement", "relaxation")
    priors: Priors = Priors()
    names: list[str] = field(init=False)
    mean: np.ndarray = field(init=False)
    deviation: np.ndarray = field(init=False)
    valid_n: list[float] = field(init=False)
    used_up_to_n: list[float] = field(init=False)

    def __post_init__(self) -> None:
        self._check_fitted()
        unknowns = list(self._unknowns())
        self.names = [name for name, _, _ in unknowns]
        self.mean, self.deviation = (np.array([row[k] for row in unknowns]) for k in (1, 2))
        softest = SOFTEST if "modulus" in self.fitted else 1.0
        reach = [self.presses.reach(one.mesh, one.place, largest_n=one.force_n.max() / softest) for one in self.experiments]
        self.valid_n, self._top = [valid for valid, _ in reach], [top for _, top in reach]
        self._known: list[dict] = [{} for _ in self.experiments]
        # At the stated places, since the effect of friction hardly depends on a millimetre.
        self._friction = [friction_ladders(self.presses.sensor, one.mesh, one.place, largest_n=top, name=one.name)
                         for one, top in zip(self.experiments, self._top, strict=True)] if "friction" in self.fitted else []
        self.at(self.mean)

    def _check_fitted(self):
        unknown = [name for name in self.fitted if name not in FITTED]
        if unknown:
            raise InputError(f"There is no unknown {unknown[0]!r} to calibrate; write some of {', '.join(FITTED)}.")
        reasons = {"cover": "knows no cover, so its thickness", "friction": "errs by more than friction changes, so that"}
        if "relaxation" in self.fitted and self.presses.sensor.spec.relaxation is not None:
            raise InputError(f"The file of {self.presses.sensor.spec.name} states the creep of its layers ('relaxation'), and a "
                             "calibration would hold it, too; leave it out of the file, or 'relaxation' out of --fit.")
        for name, reason in reasons.items():
            if name in self.fitted and self.presses.model == "elastic":
                raise InputError(f"The elastic model is one layer and {reason} cannot be fitted; leave {name!r} out of --fit, or "
                                 "give --model foundation.")

    def _unknowns(self):
        """(name, mean, standard deviation) before the fit of each unknown besides gains and zeros."""
        p = self.priors
        if "relaxation" in self.fitted:
            for k, (share, time) in enumerate(zip(p.shares, p.times_s, strict=True), 1):
                yield f"share {k}", share, p.share
                yield f"ln time {k}", np.log(time), p.log_time
        if "modulus" in self.fitted:
            yield "ln modulus", 0.0, p.log_modulus
        if "cover" in self.fitted:
            yield "cover", 1.0, p.cover
        if "friction" in self.fitted:
            yield "friction", *p.friction
        if "placement" in self.fitted:
            for k, one in enumerate(self.experiments, 1):
                for axis, value, width in zip(("x", "y", "angle"), one.place, (p.place_mm, p.place_mm, p.angle_deg), strict=True):
                    yield f"{axis} {k}", value, width

    @property
    def steps(self) -> np.ndarray:
        """(p,) steps of finite differences."""
        return np.array([_STEPS[_kind(name)][0] for name in self.names])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest (p,) values; shares are not negative."""
        low, high = (self.mean + [_STEPS[_kind(name)][k] for name in self.names] for k in (1, 2))
        return np.where([_kind(name) == "share" for name in self.names], 0.0, low), high

    def value(self, vector: np.ndarray, name: str, default: float) -> float:
        """The value of an unknown by its name, or the default if it is not fitted."""
        return float(vector[self.names.index(name)]) if name in self.names else default

    def place(self, vector: np.ndarray, k: int) -> tuple[float, float, float]:
        """Place (x, y in mm, degrees) of the object of experiment k, from 0."""
        x, y, angle = (self.value(vector, f"{axis} {k + 1}", at)
                       for axis, at in zip(("x", "y", "angle"), self.experiments[k].place, strict=True))
        return x, y, angle

    def creep(self, vector: np.ndarray) -> tuple[list[float], list[float]]:
        """Shares of creep and their time constants in s; empty if they are not fitted."""
        terms = range(1, 1 + sum(_kind(name) == "share" for name in self.names))
        return ([self.value(vector, f"share {k}", 0.0) for k in terms],
                [float(np.exp(self.value(vector, f"ln time {k}", 0.0))) for k in terms])

    def at(self, vector: np.ndarray) -> None:
        """Compute the presses of all objects at their places in `vector`, and which readings are within the model's validity there.

        A sensor of other moduli is as deep at another force, so with them the forces change up to which the model holds.
        """
        scale = float(np.exp(self.value(vector, "ln modulus", 0.0)))
        self.used_up_to_n = [scale * valid for valid in self.valid_n]
        self._usable = [one.usable & (one.force_of_bins <= most)[:, None, None]
                        for one, most in zip(self.experiments, self.used_up_to_n, strict=True)]
        covers = COVERS if "cover" in self.fitted else (1.0,)
        self._places = [self.place(vector, k) for k in range(len(self.experiments))]
        self._ladders: list[dict[float, tuple[Ladder, np.ndarray | None]]] = []
        for k, (one, place) in enumerate(zip(self.experiments, self._places, strict=True)):
            self._known[k].clear()
            ladders = {}
            for cover in covers:
                ladder = self.presses.ladder(one.mesh, place, largest_n=self._top[k], cover=cover)
                ladders[cover] = ladder, self._moving(one, place, k, ladder, cover)
            self._ladders.append(ladders)

    def _moving(self, one, place, k, ladder, cover):
        """Change of the maps (3, l, y, x) per mm along x and y and per degree; None if the place is not fitted."""
        if "placement" not in self.fitted:
            return None
        changes = np.zeros((3, *ladder.maps_mm.shape))
        for axis, step in enumerate(_OFF):
            moved = self.presses.ladder(one.mesh, place + step * np.eye(3)[axis], largest_n=self._top[k], cover=cover)
            count = min(len(moved.maps_mm), len(ladder.maps_mm))
            changes[axis, :count] = (moved.maps_mm[:count] - ladder.maps_mm[:count]) / step
        return changes

    def friction_changes(self, k: int, friction: float) -> list[tuple[float, Ladder]]:
        """(weight, `Ladder` of changes of the maps) for friction in experiment k, from 0; empty if it is not fitted."""
        weights = friction_weights(friction)
        return [(weights[one], ladder) for one, ladder in self._friction[k].items()] if self._friction else []

    def at_place(self, k: int) -> tuple[Ladder, np.ndarray | None]:
        """The presses of experiment k, from 0, at its last computed place, and their change with the place (see `at`)."""
        return self._ladders[k][1.0]

    def changes(self, vector: np.ndarray) -> list[np.ndarray]:
        """dC/C0 (b, row, column) of each experiment."""
        return [self._change(k, *self._arguments(vector, k)) for k in range(len(self.experiments))]

    def _arguments(self, vector, k):
        """The unknowns on which the maps of experiment k depend, for `_maps`."""
        return (*map(tuple, self.creep(vector)), np.exp(self.value(vector, "ln modulus", 0.0)), self.value(vector, "cover", 1.0),
                self.value(vector, "friction", 0.0), tuple(self.place(vector, k)))

    def changes_of(self, vector: np.ndarray, *, amplitude: float = 1.0, sheet_excess_mm: float = 0.0) -> list[np.ndarray]:
        """`changes` with the maps times `amplitude`, and a sheet thicker by `sheet_excess_mm` over all taxels."""
        return [self.change_of(amplitude * self._maps(k, *self._arguments(vector, k)), sheet_excess_mm=sheet_excess_mm)
                for k in range(len(self.experiments))]

    def change_of(self, maps_mm: np.ndarray, *, sheet_excess_mm: float = 0.0) -> np.ndarray:
        """dC/C0 (..., row, column) under maps (..., y, x) in mm, with a sheet thicker by `sheet_excess_mm` over all taxels."""
        spec = self.presses.sensor.spec
        rest, pressed = (taxel_capacitance(spec, maps, sheet_excess_mm=sheet_excess_mm)
                         for maps in (np.zeros(maps_mm.shape[-2:]), maps_mm))
        return pressed / rest - 1

    def _change(self, k, *arguments):
        """dC/C0 of one experiment, cached while its unknowns stay the same."""
        if arguments not in self._known[k]:
            if len(self._known[k]) > 2 * len(self.names) + 4:
                self._known[k].clear()
            self._known[k][arguments] = relative_change(self.presses.sensor.spec, self._maps(k, *arguments))
        return self._known[k][arguments]

    def _maps(self, k, shares, times, scale, cover, friction, place):
        """Maps (b, y, x) in mm of one experiment."""
        one, off = self.experiments[k], np.subtract(place, self._places[k])

        def binned(ladder, maps):     # in the recording's bins
            weights = one.bins @ lagged(ladder.weights(one.force_n / scale), one.time_s, shares=shares, time_constants_s=times)
            return np.tensordot(weights, maps, 1)

        maps = 0.0
        for variant, share in (parabola(COVERS, cover) if "cover" in self.fitted else {1.0: 1.0}).items():
            ladder, moving = self._ladders[k][variant]
            pressed = ladder.maps_mm if moving is None else ladder.maps_mm + np.tensordot(off, moving, 1)
            maps = maps + share * binned(ladder, pressed)
        for share, ladder in self.friction_changes(k, friction):
            maps = maps + share * binned(ladder, ladder.maps_mm)
        return maps

    def stacked(self) -> tuple[np.ndarray, np.ndarray]:
        """Counts (n, row, column) of all experiments, and the inverse of their standard deviations, which is 0 for dead and
        clipped taxels and at forces above the model's validity (`used_up_to_n`).
        """
        counts = np.concatenate([one.counts for one in self.experiments])
        inverse = np.concatenate([usable / one.deviation_counts
                                  for one, usable in zip(self.experiments, self._usable, strict=True)])
        return counts, inverse

    def linear(self, change: np.ndarray) -> Linear:
        """The best `Linear` for dC/C0 (n, row, column): G from all taxels together, then each gain and zero with its prior."""
        counts, inverse = self.stacked()
        w = inverse**2
        total = np.maximum(w.sum(axis=0), 1e-30)
        m = change - (w * change).sum(axis=0) / total
        scale = float((w * m * counts).sum() / max((w * m * m).sum(), 1e-30))
        gain_prior, zero_prior = 1 / max(abs(self.priors.gain * scale), 1e-30) ** 2, self.priors.zero_counts**-2
        a11, a12, a22 = (w * change**2).sum(axis=0) + gain_prior, (w * change).sum(axis=0), w.sum(axis=0) + zero_prior
        b1, b2 = (w * change * counts).sum(axis=0) + gain_prior * scale, (w * counts).sum(axis=0)
        det = a11 * a22 - a12**2
        return Linear(scale, (a22 * b1 - a12 * b2) / det, (a11 * b2 - a12 * b1) / det)

    def residuals(self, vector: np.ndarray) -> np.ndarray:
        """All misfits over their standard deviations, with those to the priors."""
        return self._residuals(np.concatenate(self.changes(vector)), vector)

    def jacobian(self, vector: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Derivatives (n, p) of `residuals` by the unknowns, with steps (p,): of differences of maps and of gains and zeros.

        In between is the readout, which costs most and is differentiated by its formulas.
        """
        here, change = self.residuals(vector), np.concatenate(self.changes(vector))
        rates, columns = self._change_rates(vector, steps), []
        for rate, step, moved in zip(rates, steps, vector + np.diag(steps), strict=True):
            columns.append((self._residuals(change + step * rate, moved) - here) / step)
        return np.stack(columns, axis=1)

    def _change_rates(self, vector, steps):
        """Rates (p, n, row, column) of dC/C0 of all experiments."""
        spec, found = self.presses.sensor.spec, []
        for k in range(len(self.experiments)):
            here = self._arguments(vector, k)
            maps = self._maps(k, *here)
            moved = [self._arguments(one, k) for one in vector + np.diag(steps)]
            depends = [number for number, one in enumerate(moved) if one != here]
            by_maps = [(self._maps(k, *moved[number]) - maps) / steps[number] for number in depends]
            rates = np.zeros((len(steps), len(maps), *self.experiments[k].counts.shape[1:]))
            if depends:
                rates[depends] = relative_change_rates(spec, maps, np.stack(by_maps))
            found.append(rates)
        return np.concatenate(found, axis=1)

    def _residuals(self, change, vector):
        counts, inverse = self.stacked()
        best = self.linear(change)
        misfit = inverse * (counts - best.gain * change - best.zero)
        taxels = [(best.gain / best.scale - 1) / self.priors.gain, best.zero / self.priors.zero_counts]
        return np.concatenate([misfit.ravel(), *(one.ravel() for one in taxels), (vector - self.mean) / self.deviation])


def _kind(name):
    return name.rpartition(" ")[0] if name[-1].isdigit() else name
