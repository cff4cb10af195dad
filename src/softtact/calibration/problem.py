"""The unknowns of a calibration, and what the sensor would read for them.

    counts = G (1 + e) dC/C0(map) + z               G common scale; e, z: each taxel's gain and zero
    map = creep of the press' map at the force over the modulus scale, moved to where the object lies

Gain and zero are linear and solved for within each step (variable projection; Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973)
413). The others are followed by Gauss and Newton's method. Moving and turning an object changes its maps by the differences to
presses a little off, for what is bound to the sensor's edges does not move with it; `Problem.at` presses anew where the object has
come to lie.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softtact.calibration.experiment import Experiment
from softtact.calibration.ladder import COVERS, FRICTIONS, SOFTEST, Presses, friction_weights, parabola, rubbing
from softtact.errors import InputError
from softtact.press.ladder import Ladder
from softtact.readout.hysteresis import lagged
from softtact.readout.taxels import relative_change

FITTED = ("placement", "relaxation", "modulus", "cover", "friction")
HARDEST = 1 / SOFTEST


@dataclass(frozen=True)
class Priors:
    """What is known before: standard deviations, so wide that a press which feels a number at all outweighs them. All assumed."""

    gain: float = 0.15
    """Of a taxel over the common one: some times what is left after the maker's adjustment."""
    zero_counts: float = 30.0
    """Of the zero over the recorder's baseline: five times the virtual sensor's noise."""
    log_scale: float = 3.0
    """Of the common scale, whose order of magnitude alone is known."""
    shares: tuple[float, ...] = (0.08, 0.06)
    """Means of the shares that creep in late: the virtual sensor's."""
    share: float = 0.1
    """Of these shares."""
    times_s: tuple[float, ...] = (1.0, 10.0)
    """Medians of the time constants: the virtual sensor's, from one hold to one press."""
    log_time: float = 0.7
    """Of the logarithm of a time constant: a factor of two."""
    log_modulus: float = 0.3
    """Of the logarithm of the modulus scale: batches of soft rubber differ by a third."""
    cover: float = 0.15
    """Of the cover's thickness, as a share."""
    friction: tuple[float, float] = (0.2, 0.2)
    """Mean and standard deviation of the object's coefficient on the cover."""
    place_mm: float = 1.0
    """Of where the object was put by hand."""
    angle_deg: float = 3.0
    """Of how it was turned."""


_OFF = (0.5, 0.5, 2.0)     # mm, mm and degrees, over which the maps' change with the place is taken: less than a step of the map

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
    """Experiments on one sensor, and which of its numbers are unknown (some of FITTED, besides gain and zero)."""

    presses: Presses
    experiments: Sequence[Experiment]
    fitted: Sequence[str] = ("placement", "relaxation")
    priors: Priors = Priors()
    names: list[str] = field(init=False)
    mean: np.ndarray = field(init=False)
    deviation: np.ndarray = field(init=False)
    valid_n: list[float] = field(init=False)

    def __post_init__(self) -> None:
        self._check_fitted()
        unknowns = list(self._unknowns())
        self.names = [name for name, _, _ in unknowns]
        self.mean, self.deviation = (np.array([row[k] for row in unknowns]) for k in (1, 2))
        softest = SOFTEST if "modulus" in self.fitted else 1.0
        reach = [self.presses.reach(one.mesh, one.place, largest_n=one.force_n.max() / softest) for one in self.experiments]
        self.valid_n, self._top = [valid for valid, _ in reach], [top for _, top in reach]
        self._usable = [one.usable & (one.force_of_bins <= valid)[:, None, None]
                        for one, valid in zip(self.experiments, self.valid_n, strict=True)]
        self._known: list[dict] = [{} for _ in self.experiments]
        # Where the objects were put: what friction changes hardly depends on a millimetre.
        self._rubbing = [rubbing(self.presses.sensor, one.mesh, one.place, largest_n=top, name=one.name)
                         for one, top in zip(self.experiments, self._top, strict=True)] if "friction" in self.fitted else []
        self.at(self.mean)

    def _check_fitted(self):
        unknown = [name for name in self.fitted if name not in FITTED]
        if unknown:
            raise InputError(f"There is no unknown {unknown[0]!r} to calibrate; write some of {', '.join(FITTED)}.")
        reasons = {"cover": "knows no cover, so its thickness", "friction": "errs by more than friction changes, so that"}
        for name, reason in reasons.items():
            if name in self.fitted and self.presses.model == "elastic":
                raise InputError(f"The elastic model is one layer and {reason} cannot be fitted; leave {name!r} out of --fit, or "
                                 "give --model foundation.")

    def _unknowns(self):
        """(name, mean, standard deviation) of each number that is fitted besides gains and zeros."""
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
        """An unknown by its name, or the default where it is none."""
        return float(vector[self.names.index(name)]) if name in self.names else default

    def place(self, vector: np.ndarray, k: int) -> tuple[float, float, float]:
        """Where (x, y in mm, degrees) the object of experiment k, from 0, lies."""
        x, y, angle = (self.value(vector, f"{axis} {k + 1}", at)
                       for axis, at in zip(("x", "y", "angle"), self.experiments[k].place, strict=True))
        return x, y, angle

    def creep(self, vector: np.ndarray) -> tuple[list[float], list[float]]:
        """Shares that creep in late, and their time constants in s; none where they are not fitted."""
        terms = range(1, 1 + sum(_kind(name) == "share" for name in self.names))
        return ([self.value(vector, f"share {k}", 0.0) for k in terms],
                [float(np.exp(self.value(vector, f"ln time {k}", 0.0))) for k in terms])

    def at(self, vector: np.ndarray) -> None:
        """Press all objects where they lie now."""
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
        """Change of the maps (3, l, y, x) by mm along x and y and by degree; None where the place is not fitted."""
        if "placement" not in self.fitted:
            return None
        changes = np.zeros((3, *ladder.maps_mm.shape))
        for axis, step in enumerate(_OFF):
            moved = self.presses.ladder(one.mesh, place + step * np.eye(3)[axis], largest_n=self._top[k], cover=cover)
            count = min(len(moved.maps_mm), len(ladder.maps_mm))
            changes[axis, :count] = (moved.maps_mm[:count] - ladder.maps_mm[:count]) / step
        return changes

    def rubbed(self, k: int, friction: float) -> list[tuple[float, Ladder]]:
        """What friction of the object changes in experiment k, from 0: weights of ladders of maps; none where it is not fitted."""
        weights = friction_weights(friction)
        return [(weights[one], ladder) for one, ladder in self._rubbing[k].items()] if self._rubbing else []

    def at_place(self, k: int) -> tuple[Ladder, np.ndarray | None]:
        """The presses of experiment k, from 0, where it was last pressed, and their change with the place (see `at`)."""
        return self._ladders[k][1.0]

    def changes(self, vector: np.ndarray) -> list[np.ndarray]:
        """dC/C0 (b, row, column) of each experiment."""
        shares, times = self.creep(vector)
        scale, cover = np.exp(self.value(vector, "ln modulus", 0.0)), self.value(vector, "cover", 1.0)
        friction = self.value(vector, "friction", 0.0)
        return [self._change(k, (*shares, *times, scale, cover, friction, *self.place(vector, k)), shares, times)
                for k in range(len(self.experiments))]

    def _change(self, k, key, shares, times):
        """dC/C0 of one experiment, from what is known where its unknowns are the same."""
        if key not in self._known[k]:
            if len(self._known[k]) > 2 * len(self.names) + 4:
                self._known[k].clear()
            scale, cover, friction, *place = key[len(shares) + len(times):]
            self._known[k][key] = self._read(k, shares, times, scale, cover, friction, place)
        return self._known[k][key]

    def _read(self, k, shares, times, scale, cover, friction, place):
        one, off = self.experiments[k], np.subtract(place, self._places[k])

        def binned(ladder, maps):     # in the recording's bins
            weights = one.bins @ lagged(ladder.weights(one.force_n / scale), one.time_s, shares=shares, time_constants_s=times)
            return np.tensordot(weights, maps, 1)

        maps = 0.0
        for variant, share in (parabola(COVERS, cover) if "cover" in self.fitted else {1.0: 1.0}).items():
            ladder, moving = self._ladders[k][variant]
            pressed = ladder.maps_mm if moving is None else ladder.maps_mm + np.tensordot(off, moving, 1)
            maps = maps + share * binned(ladder, pressed)
        for share, ladder in self.rubbed(k, friction):
            maps = maps + share * binned(ladder, ladder.maps_mm)
        return relative_change(self.presses.sensor.spec, maps)

    def stacked(self) -> tuple[np.ndarray, np.ndarray]:
        """Counts (n, row, column) of all experiments, and the inverse of their standard deviations, 0 where they are not usable:
        of dead and clipped taxels, and at forces for which the model is not valid (`valid_n`).
        """
        counts = np.concatenate([one.counts for one in self.experiments])
        inverse = np.concatenate([usable / one.deviation_counts
                                  for one, usable in zip(self.experiments, self._usable, strict=True)])
        return counts, inverse

    def linear(self, change: np.ndarray) -> Linear:
        """The best `Linear` for dC/C0 (n, row, column): G by all taxels together, then each gain and zero with its prior."""
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
        counts, inverse = self.stacked()
        change = np.concatenate(self.changes(vector))
        best = self.linear(change)
        misfit = inverse * (counts - best.gain * change - best.zero)
        own = [(best.gain / best.scale - 1) / self.priors.gain, best.zero / self.priors.zero_counts]
        return np.concatenate([misfit.ravel(), *(one.ravel() for one in own), (vector - self.mean) / self.deviation])


def _kind(name):
    return name.rpartition(" ")[0] if name[-1].isdigit() else name
