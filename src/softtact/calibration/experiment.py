"""One recording of a known press, prepared for the fit: readings averaged over time, the forces, the object's place."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from softtact.errors import InputError
from softtact.readout.frames import new_frames, noise
from softtact.readout.recording import MOVES, clipped, dead, name_of

if TYPE_CHECKING:
    import xarray

_SAMPLES, _BINS = 400, 100      # most samples of a recording for its creep, most intervals for the comparison of counts
_ONSET = 0.5                     # of the largest sum of counts, above which a held weight lies on the sensor


@dataclass(frozen=True)
class Experiment:
    """A recording of one press on one finger; `bins` (b, n) averages n samples over b intervals of time."""

    name: str
    """Name of the recording's file."""
    mesh: trimesh.Trimesh
    """The object in mm; it is pressed with its lowest side down, the middle of its bounding box over `place`."""
    place: tuple[float, float, float]
    """Where the object was put: x, y in mm, angle about z in degrees."""
    time_s: np.ndarray
    """(n,) times of the samples, in s."""
    force_n: np.ndarray
    """(n,) forces at the samples, in N."""
    bins: np.ndarray
    """(b, n) weights of the means over intervals of time."""
    counts: np.ndarray
    """(b, row, column) means of the counts over the baseline."""
    usable: np.ndarray
    """(b, row, column): False where a taxel is dead, or clipped or left out within the interval."""
    noise_counts: float
    """Standard deviation of one reading, from the differences of distinct readings that follow each other."""
    readings_a_bin: float
    """Number of readings in a mean."""
    other_counts: np.ndarray | None = None
    """(b, row, column) means of the other finger, to detect swapped fingers; None without one."""

    @property
    def force_of_bins(self) -> np.ndarray:
        """(b,) mean forces in N."""
        return self.bins @ self.force_n

    @property
    def deviation_counts(self) -> float:
        """Standard deviation of a mean, including the rounding to whole counts."""
        return float(np.hypot(self.noise_counts, np.sqrt(1 / 12)) / np.sqrt(self.readings_a_bin))


def experiment(recording: "xarray.Dataset", mesh: trimesh.Trimesh, *, finger: int = 0, force_n: float | None = None,
               place: tuple[float, float, float] = (0.0, 0.0, 0.0), largest_counts: float | None = None,
               left_out: np.ndarray | None = None) -> Experiment:
    """The `Experiment` of a recording in which an object (mm) was pressed on one finger.

    force_n: force of a weight that was put on and held; it acts while the sum of the finger's counts is above half its maximum.
    By default the recording's `force_n` is used (`recording.with_force`).  largest_counts: at which the readout saturates
    left_out (time, finger, row, column): readings that are not used (`softtact.readout.checks`). Frames that are repeated in rows
    written more often than frames are renewed count once.
    Raises InputError if the finger is not pressed in what is used, or its force is not known.
    """
    name = name_of(recording)
    if finger not in range(recording.sizes["finger"]):
        raise InputError(f"{name}: it has no finger {finger}; give one of 0 to {recording.sizes['finger'] - 1}.")
    bad = clipped(recording, largest=largest_counts) | dead(recording)
    bad = bad if left_out is None else bad | left_out
    rows = new_frames(recording.counts.values[:, finger])
    recording, bad = recording.isel(time=rows), bad[rows]
    counts = recording.counts.values[:, finger].astype(float)
    noise_counts = _noise(counts, bad[:, finger])
    _check_pressed(name, recording, finger, noise_counts, bad)
    force = _held(counts, force_n) if force_n is not None else _known_force(name, recording, finger)
    if not (force.max() > 0 and np.isfinite(force).all()):
        raise InputError(f"{name}: its largest force is {force.max():g} N; a calibration needs presses with known forces above 0.")
    coarse = _means(len(counts), _SAMPLES)
    bins = _means(len(coarse), _BINS)
    both = bins @ coarse
    usable = np.einsum("bn,nrc->brc", both > 0, bad[:, finger]) == 0
    others = [one for one in range(recording.sizes["finger"]) if one != finger]
    other = np.einsum("bn,nrc->brc", both, recording.counts.values[:, others[0]].astype(float)) if others else None
    return Experiment(name=name, mesh=mesh, place=place, time_s=coarse @ recording.time.values,
                      force_n=coarse @ np.maximum(force, 0), bins=bins,
                      counts=np.einsum("bn,nrc->brc", both, counts), usable=usable, noise_counts=noise_counts,
                      readings_a_bin=float((both > 0).sum(axis=1).mean()), other_counts=other)


def _means(count, most):
    """Weights (m, count), m at most `most`, of means over equal numbers of neighbours; the last mean may have fewer."""
    each = -(-count // most)
    part = np.arange(count) // each
    weights = (part == np.arange(part[-1] + 1)[:, None]).astype(float)
    return weights / weights.sum(axis=1, keepdims=True)


def _noise(counts, bad):
    """Standard deviation of a reading of the median taxel, from frames (n, row, column) in which no taxel is `bad`."""
    taxels = ~bad.all(axis=0)
    sound = counts[~bad[:, taxels].any(axis=1)][:, taxels]
    return float(np.median(noise(sound))) if sound.size else 0.0


def _check_pressed(name, recording, finger, noise_counts, bad):
    """Refuse a finger whose counts hardly change in the readings that are not `bad` (time, finger, row, column)."""
    sound = np.ma.masked_array(recording.counts.values, bad)
    moved = np.ma.filled((sound.max(axis=0) - sound.min(axis=0)).max(axis=(1, 2)), 0)
    least = MOVES + 10 * noise_counts
    if moved[finger] >= least:
        return
    pressed = [str(one) for one, distance in enumerate(moved) if distance >= least]
    raise InputError(f"{name}: finger {finger} changes by {moved[finger]:.0f} counts only"
                     + (f", and finger {pressed[0]} by {moved[int(pressed[0])]:.0f}: are the fingers swapped? Calibrate finger "
                        f"{pressed[0]} (--finger {pressed[0]})." if pressed else "; record a stronger press."))


def _held(counts, force_n):
    """Force (n,) of a held weight, which acts while the counts are high."""
    total = counts.sum(axis=(1, 2))
    rest = np.quantile(total, 0.02)
    return np.where(total - rest > _ONSET * (np.quantile(total, 0.98) - rest), force_n, 0.0)


def _known_force(name, recording, finger):
    if "force_n" not in recording:
        raise InputError(f"{name}: its force is not known; state the force of a held weight (force_n, --force N), or give a log of "
                         "forces (--force FILE.csv).")
    return recording.force_n.values[:, finger]
