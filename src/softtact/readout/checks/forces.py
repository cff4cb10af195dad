"""Faults in the log of forces beside a recording, and those that only the forces show: each function yields `Finding`s."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from softtact.readout.checks.finding import Finding, taxels_of, where
from softtact.readout.frames import Runs, new_frames, noise
from softtact.readout.recording import MOVES, name_of, row_of

if TYPE_CHECKING:
    import xarray

_REST_S, _FEWEST = 0.1, 5     # least duration and number of readings of a rest
_ZERO = 0.01                  # of the range: forces and counts that count as zero
_STANDS_S = 0.25              # least duration for which a log stands at one force
_CHANGES, _RETURNS = 0.2, 0.05     # of the counts' range: change while the log stands, and back again, that is no creep
_CELL_DRIFTS = 0.02           # of the range of forces: change of a load cell's zero
_DRIFTS, _DRIFTS_COUNTS = 0.02, 3.0    # least drift: of the counts of a press, and counts
_GRIPPER_N = 235.0            # largest force of the maker's gripper 2F-85
_RECOVERS_S = 60.0            # longest time constant with which creep goes back at rest
_UNPRESSED = 0.4              # of a taxel's largest counts, in the median taxel: no creep leaves so much
_LAG_S, _LONGEST_LAG_S = 0.05, 2.0
_LAG_STEPS = 4000             # most times at which counts and forces are compared
_LESS = 0.5                   # ratio of what two delays leave unexplained that decides
_MATTERS = 0.003              # share of the counts' variance that a delay leaves unexplained, below which it changes no gain
_AS_EXPECTED = 0.3            # of the share that such a delay would leave unexplained, which must be left at least
_EXPLAINED = 0.97             # of the counts' variance at the best delay


@dataclass(frozen=True)
class _Press:
    """Means over the sound taxels of a finger at its sound readings, and the forces on it."""

    rows: np.ndarray
    """(n,) sound readings, of new frames."""
    time_s: np.ndarray
    """(n,) their times."""
    level: np.ndarray
    """(n,) means of the counts."""
    force_n: np.ndarray
    """(n,) forces."""
    noise: float
    """Standard deviation of a mean, in counts."""

    @classmethod
    def of(cls, recording, finger, spoiled):
        """The press of a finger without its readings that are `spoiled`; None if nothing moves it, or little of it is sound."""
        sound = ~spoiled[:, finger].reshape(len(recording.time), -1)
        steady = sound.mean(axis=0) > 0.98 * sound.any(axis=1).mean()
        if steady.sum() < 3:
            return None
        counts = taxels_of(recording, finger)
        new = new_frames(counts)
        rows = new[sound[new][:, steady].all(axis=1)]
        counts, force = counts[rows][:, steady], recording.force_n.values[rows, finger]
        if len(rows) < 4 * _FEWEST or np.ptp(counts, axis=0).max() < MOVES or np.ptp(force) == 0:
            return None
        mean_noise = float(np.sqrt((noise(counts) ** 2).sum())) / counts.shape[1]
        return cls(rows, recording.time.values[rows], counts.mean(axis=1), force, mean_noise)

    def at_rest(self, *, end: bool = False):
        """Readings (m,) of the rest before the press, or after it, by the counts; none if it is short or begins pressed.

        Only the half of it that is farther from the press, as a light touch is lost in the noise.
        """
        level, few = _smooth(self.level), self.level[:_FEWEST]
        near = np.abs(level - np.median(few)) < max(4 * self.noise, _ZERO * np.ptp(level))
        at = _stretch(near, end=end)
        at = at[len(at) // 2:] if end else at[:-(len(at) // 2)]
        enough = len(at) >= _FEWEST and np.ptp(self.time_s[at]) >= _REST_S and abs(np.median(few)) < 0.05 * np.ptp(level)
        return at if enough else at[:0]


def _smooth(values):
    return median_filter(values, size=_FEWEST, mode="nearest")


def _stretch(true, *, end):
    """Indices of the values at the beginning, or at the end, that are true without a break."""
    order = true[::-1] if end else true
    count = len(true) if order.all() else int(np.argmin(order))
    return np.arange(len(true))[len(true) - count:] if end else np.arange(count)


def gaps(recording: "xarray.Dataset") -> Iterator[Finding]:
    """Times between rows of the log that are far longer than others."""
    time, log = recording.time.values, recording.attrs["force_log"]
    for begin, end in recording.attrs["force_gaps_s"]:
        inside = np.flatnonzero((time > begin) & (time < end))
        if len(inside):
            spoiled = np.zeros(recording.counts.shape, dtype=bool)
            spoiled[inside] = True
            rows = f"{row_of(recording, inside[0])} to {row_of(recording, inside[-1])}"
            yield Finding("gap in the log", f"{log}: it has no row from {begin:.4g} to {end:.4g} s (its rows are "
                          f"{recording.attrs['force_spacing_s']:.3g} s apart); a calibration leaves out what "
                          f"{name_of(recording)} has in between, rows {rows}: give the whole log.",
                          tuple(range(recording.sizes["finger"])), left_out=spoiled)


def standing_log(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """Times for which the log stands at one force while the counts change by more than creep: it is frozen, or at its end."""
    for finger in range(recording.sizes["finger"]):
        press = _Press.of(recording, finger, spoiled)
        if press is None:
            continue
        level, span = _smooth(press.level), np.ptp(press.level)
        runs = Runs.of(press.force_n)
        for first, count in zip(runs.first, runs.length, strict=True):
            time = press.time_s[first:first + count]
            run = first + np.flatnonzero((time > time[0] + _LAG_S) & (time < time[-1] - _LAG_S))     # without a log's small delay
            if len(run) < _FEWEST or np.ptp(time[run - first]) < _STANDS_S:
                continue
            change, kept = np.ptp(level[run]), abs(level[run[0]] - level[run[-1]])
            changes = change > max(_CHANGES * span, 10 * press.noise) or change - kept > max(_RETURNS * span, 10 * press.noise)
            if not changes:
                continue
            begin, end = press.rows[first], press.rows[first + count - 1]
            left_out = np.zeros(recording.counts.shape, dtype=bool)
            left_out[begin:end + 1, finger] = True
            yield Finding("standing log", f"{recording.attrs['force_log']}: it reads {press.force_n[first]:.4g} N from "
                          f"{recording.time.values[begin]:.4g} to {recording.time.values[end]:.4g} s while the counts of finger "
                          f"{finger} change by {change / span:.0%} of the press; a calibration leaves these readings out: check "
                          "the load cell's program and its range.", (finger,), left_out=left_out)


def load_cell_zero(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """A load cell that reads a force while the taxels are at rest, before the press; or another one after it."""
    for finger in range(recording.sizes["finger"]):
        press = _Press.of(recording, finger, spoiled)
        zeros = [] if press is None else [_steady(press, press.at_rest(end=end)) for end in (False, True)]
        if not zeros or zeros[0] is None:
            continue
        zero, end, span = zeros[0], zeros[1], np.ptp(press.force_n)
        least = max(_ZERO * span, 4 * float(noise(press.force_n[:, None])[0]) / np.sqrt(_FEWEST))
        at_rest = f"{recording.attrs['force_log']}: at rest, while no taxel of finger {finger} is pressed, it reads {zero:.3g} N"
        if end is not None and abs(end - zero) > max(_CELL_DRIFTS * span, least):
            yield Finding("zero of the load cell", f"{at_rest} before the press and {end:.3g} N after it; let the load cell "
                          "settle, tare it, and record again.", (finger,), safe=False)
        elif abs(zero) > least:
            yield Finding("zero of the load cell", f"{at_rest}; this is taken off its forces: tare the load cell.", (finger,),
                          zero_n=zero)


def _steady(press, at):
    """Median of the forces at readings (m,), or None if these are none or the force changes."""
    if not len(at):
        return None
    force = press.force_n[at]
    steady = np.ptp(_smooth(force)) <= 2 * _ZERO * np.ptp(press.force_n) + 6 * float(noise(force[:, None])[0])
    return float(np.median(force)) if steady else None


def unit(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """Forces beyond those of the gripper that the sensor is made for."""
    largest = float(np.abs(recording.force_n.values).max())
    if largest > _GRIPPER_N:
        yield Finding("unit of the forces", f"{recording.attrs['force_log']}: its largest force is {largest:.4g} N, and the "
                      f"gripper of a TSF-85 gives {_GRIPPER_N:g} N; is it in grams or another unit? Give it in newtons.",
                      tuple(range(recording.sizes["finger"])), safe=False)


def sign(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """Forces that fall while the counts rise. The forces are `zeroed`."""
    for finger in range(recording.sizes["finger"]):
        press = _Press.of(recording, finger, spoiled)
        if press is None or press.force_n.min() > -0.5 * np.ptp(press.force_n):
            continue
        if np.corrcoef(press.level, press.force_n)[0, 1] < -0.5:
            yield Finding("sign of the forces", f"{recording.attrs['force_log']}: its forces are negative, down to "
                          f"{press.force_n.min():.3g} N, while taxels of finger {finger} are pressed; turn their sign.", (finger,),
                          safe=False)


def delay(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """A log whose clock runs behind that of the recording, or before it."""
    for finger in range(recording.sizes["finger"]):
        press = _Press.of(recording, finger, spoiled)
        found = _best_delay(press) if press is not None else None
        if found is None:
            continue
        lag, share, share_now = found
        size, (when, remedy) = f"{abs(lag):.2g} s", ("earlier", "subtract {} from") if lag > 0 else ("later", "add {} to")
        yield Finding("delay of the log", f"{recording.attrs['force_log']}: the counts of finger {finger} follow its forces best "
                      f"when the log is taken {size} {when} ({share_now:.1%} of their variance are not explained as it is, "
                      f"{share:.1%} so); {remedy.format(size)} its times.", (finger,), safe=False)


def _best_delay(press):
    """(delay in s, unexplained share of the counts' variance with it, and without); None if there is none to speak of."""
    begin, end = press.time_s[[0, -1]]
    longest = min(_LONGEST_LAG_S, 0.4 * (end - begin))
    grid = np.linspace(begin, end, min(_LAG_STEPS, len(press.time_s)))
    step = grid[1] - grid[0]
    if longest < max(_LAG_S, 3 * step):
        return None
    known = np.interp(grid, press.time_s, np.gradient(press.time_s)) < 5 * np.median(np.diff(press.time_s))
    level = np.interp(grid, press.time_s, press.level)
    lags = step * np.arange(-int(longest / step), int(longest / step) + 1)
    shares = np.array([_unexplained(grid, level, known, press, lag) for lag in lags])
    best, now = int(np.argmin(shares)), shares[len(lags) // 2]
    floor = press.noise**2 / max(float(np.var(level)), 1e-30)
    if abs(lags[best]) < max(_LAG_S, 3 * step) or shares[best] > min(_LESS * now, 1 - _EXPLAINED) or now < max(3 * floor, _MATTERS):
        return None
    as_if_late = np.interp(grid + lags[best], press.time_s, press.force_n)
    if now < _AS_EXPECTED * _unexplained(grid, as_if_late, known, press, 0.0):
        return None
    return lags[best], shares[best], now


def _unexplained(grid, level, known, press, lag):
    """Share of the variance of the counts that a cubic of the force at later times (by `lag`) leaves."""
    force = np.interp(grid + lag, press.time_s, press.force_n) / np.ptp(press.force_n)
    use = known & np.interp(grid + lag, grid, known.astype(float)).astype(bool)
    if use.sum() < 4 * _FEWEST:
        return 1.0
    powers = force[use, None] ** np.arange(4)
    left = level[use] - powers @ np.linalg.lstsq(powers, level[use], rcond=None)[0]
    return float(np.var(left) / max(float(np.var(level[use])), 1e-30))


def drift(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """Counts that have moved from the rest before the press to that after it by what is no creep. The forces are `zeroed`."""
    force = np.abs(recording.force_n.values).max(axis=1)
    if not np.ptp(force):
        return
    still = _smooth(force) <= _ZERO * np.ptp(force) + 3 * float(noise(force[:, None])[0])
    rests = [_stretch(still, end=end) for end in (False, True)]
    time, largest = recording.time.values, float(np.ptp(recording.counts.values.mean(axis=(2, 3)), axis=0).max())
    if any(len(rest) < _FEWEST or np.ptp(time[rest]) < _REST_S for rest in rests) or still.all():
        return
    for finger in range(recording.sizes["finger"]):
        counts = np.where(spoiled[:, finger], np.nan, recording.counts.values[:, finger]).reshape(len(time), -1)
        counts = counts[:, ~np.isnan(counts[np.concatenate(rests)]).any(axis=0)]
        if counts.shape[1] < 3:
            continue
        before, after = (np.median(counts[rest], axis=0) for rest in rests)
        moved = float(np.mean(after - before))
        scatter = float(np.mean(noise(counts[rests[1]]))) / np.sqrt(counts.shape[1])
        if abs(moved) < max(5 * scatter, _DRIFTS * largest, _DRIFTS_COUNTS) or _creeps(time, counts, rests[1], after - before):
            continue
        low, high = np.quantile(after, [0.05, 0.95])
        yield Finding("drift", f"{where(recording, rests[1][0], rests[1][-1])}: at the end at rest the taxels of finger {finger} "
                      f"read {low:.0f} to {high:.0f} counts, and {np.mean(before):.0f} before the press; let the sensor warm up, "
                      "take its baseline anew, and record again.", (finger,), safe=False)


def _creeps(time, counts, rest, moved):
    """Whether counts that are left at rest may be creep: above zero, less than the press left, and going back."""
    if moved.mean() < 0:
        return False
    largest = np.nanmax(np.abs(counts), axis=0)
    if np.median(moved / np.maximum(largest, 1.0)) > _UNPRESSED:
        return False
    level, at = counts[rest].mean(axis=1), time[rest] - time[rest].mean()
    slope = float((at * level).sum() / (at**2).sum())
    left = level - level.mean() - slope * at
    error = np.sqrt((left**2).sum() / max(len(at) - 2, 1) / (at**2).sum())
    return slope - 2 * error < -moved.mean() / _RECOVERS_S
