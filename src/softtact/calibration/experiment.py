"""One recording of a known press, as the fit takes it: readings averaged over time, the forces behind them, the object's place."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from softtact.errors import InputError
from softtact.readout.recording import clipped, dead

if TYPE_CHECKING:
    import xarray

_SAMPLES, _BINS = 400, 100      # of a recording, over which creep is followed, and of which the counts are compared
_ONSET = 0.5                     # of a held weight's largest sum of counts: it lies on the sensor from there on
_OF_MEDIAN = 1.4826              # a normal number's standard deviation over the median of its absolute value
_LEAST_COUNTS = 30.0             # over the noise, that a finger must move by to be pressed at all


@dataclass(frozen=True)
class Experiment:
    """A recording of one press on one finger; `bins` (b, n) averages n samples over b intervals of time."""

    name: str
    """Of the recording's file."""
    mesh: trimesh.Trimesh
    """The object in mm; it is pressed with its lowest side down, the middle of its bounding box over `place`."""
    place: tuple[float, float, float]
    """Where the object was put: x, y in mm, angle about z in degrees."""
    time_s: np.ndarray
    """(n,) of the samples, in s."""
    force_n: np.ndarray
    """(n,) at the samples, in N."""
    bins: np.ndarray
    """(b, n) weights of the means over intervals of time."""
    counts: np.ndarray
    """(b, row, column) means of the counts over the baseline."""
    usable: np.ndarray
    """(b, row, column): False where a taxel is dead, or clipped within the interval."""
    noise_counts: float
    """Standard deviation of one reading, from the differences of readings that follow each other."""
    readings_a_bin: float
    """How many readings a mean is of."""
    other_counts: np.ndarray | None = None
    """(b, row, column) of the other finger, to notice that fingers are swapped; None where there is none."""

    @property
    def force_of_bins(self) -> np.ndarray:
        """(b,) mean forces in N."""
        return self.bins @ self.force_n

    @property
    def deviation_counts(self) -> float:
        """Standard deviation of a mean, which rounding to whole counts limits from below."""
        return float(np.hypot(self.noise_counts, np.sqrt(1 / 12)) / np.sqrt(self.readings_a_bin))


def experiment(recording: "xarray.Dataset", mesh: trimesh.Trimesh, *, finger: int = 0, force_n: float | None = None,
               place: tuple[float, float, float] = (0.0, 0.0, 0.0), largest_counts: float | None = None) -> Experiment:
    """The `Experiment` of a recording and the object (mm) that one of its fingers was pressed with.

    force_n: of a weight that was laid on and held: it acts while the finger's counts are above half of their largest sum. Without
    it the recording's `force_n` is taken (`recording.with_force`).  largest_counts: at which the readout ends
    Raises InputError where the finger is not pressed, its force is not known, or nothing of the recording is at rest.
    """
    name = recording.attrs["file"] or "the recording"
    if finger not in range(recording.sizes["finger"]):
        raise InputError(f"{name}: it has no finger {finger}; give one of 0 to {recording.sizes['finger'] - 1}.")
    counts = recording.counts.values[:, finger].astype(float)
    noise = _noise(counts)
    _check_pressed(name, recording, finger, noise)
    force = _held(counts, force_n) if force_n is not None else _known_force(name, recording, finger)
    if not (force.max() > 0 and np.isfinite(force).all()):
        raise InputError(f"{name}: its largest force is {force.max():g} N; a calibration needs presses of known force above 0.")
    coarse = _means(len(counts), _SAMPLES)
    bins = _means(len(coarse), _BINS)
    both = bins @ coarse
    bad = clipped(recording, largest=largest_counts)[:, finger] | dead(recording)[finger]
    usable = np.einsum("bn,nrc->brc", both > 0, bad) == 0
    others = [one for one in range(recording.sizes["finger"]) if one != finger]
    other = np.einsum("bn,nrc->brc", both, recording.counts.values[:, others[0]].astype(float)) if others else None
    return Experiment(name=name, mesh=mesh, place=place, time_s=coarse @ recording.time.values,
                      force_n=coarse @ np.maximum(force, 0), bins=bins,
                      counts=np.einsum("bn,nrc->brc", both, counts), usable=usable, noise_counts=noise,
                      readings_a_bin=float((both > 0).sum(axis=1).mean()), other_counts=other)


def _means(count, most):
    """Weights (m, count), m at most `most`, of the means over equal numbers of neighbours; the last ones may be fewer."""
    each = -(-count // most)
    part = np.arange(count) // each
    weights = (part == np.arange(part[-1] + 1)[:, None]).astype(float)
    return weights / weights.sum(axis=1, keepdims=True)


def _noise(counts):
    """Standard deviation of a reading: from the median step between readings, so that the steps of a press do not count."""
    if len(counts) < 3:
        return 0.0
    return float(np.median(_OF_MEDIAN * np.median(np.abs(np.diff(counts, axis=0)), axis=0)) / np.sqrt(2))


def _check_pressed(name, recording, finger, noise):
    moved = np.ptp(recording.counts.values, axis=0).max(axis=(1, 2))
    least = _LEAST_COUNTS + 10 * noise
    if moved[finger] >= least:
        return
    pressed = [str(one) for one, distance in enumerate(moved) if distance >= least]
    raise InputError(f"{name}: finger {finger} moves by {moved[finger]:.0f} counts only"
                     + (f", and finger {pressed[0]} by {moved[int(pressed[0])]:.0f}: are the fingers swapped? Calibrate finger "
                        f"{pressed[0]} (--finger {pressed[0]})." if pressed else "; record a press that it feels."))


def _held(counts, force_n):
    """Force (n,) of a weight that lies on the sensor while its counts are high."""
    total = counts.sum(axis=(1, 2))
    rest = np.quantile(total, 0.02)
    return np.where(total - rest > _ONSET * (np.quantile(total, 0.98) - rest), force_n, 0.0)


def _known_force(name, recording, finger):
    if "force_n" not in recording:
        raise InputError(f"{name}: its force is not known; state a held weight's (force_n, --force N), or give a log of forces "
                         "(--force FILE.csv).")
    return recording.force_n.values[:, finger]
