"""Faults in the frames of a recording: each function yields a `Finding` for each place."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softtact.readout.checks.finding import CABLE, Finding, and_more, readings, taxel, taxels_of, where
from softtact.readout.frames import Runs, deviations, longest_run, noise
from softtact.readout.recording import COLUMNS, LARGEST_RAW, MOVES, NOISY, ROWS, clipped, dead, row_of, taxel_in_words

if TYPE_CHECKING:
    import xarray

_FROZEN, _FROZEN_S = 8, 0.25          # a frame stands still: rows over its usual number, and s
_FORCE_MOVES = 0.1                    # of the range of forces: a change that frames must show
_AROUND = 60                          # frames before and after, which show the noise of a frame
_FEWEST = 7                           # frames in which a wrong reading can be told from a press
_SPIKE, _SPIKE_COUNTS = 15.0, 40.0    # least distance of a wrong reading from those around it: over the noise, and counts
_SPREAD = 0.1                         # of a taxel's jump that its neighbours share when it is touched, through cover and filler
_TOGETHER = 0.25                      # share of a finger's taxels above which they jump as a frame
_BEYOND = 10_000.0                    # counts: a jump of many taxels that no press makes
_TIMES, _LARGE = 3.0, 1000.0          # a wrong reading of any duration: least size over the largest of other taxels, and counts
_FEW_TAXELS = 3                       # that may read wrong values at once
_HANGS = 10                           # fewest frames of a taxel that hangs
_DRIFTS_COUNTS, _ALIKE = 20.0, 0.02   # drift without forces: least counts, and scatter over all taxels, less than that of gains
_CHANCE = 1e-9                        # probability below which a run of equal values is no chance


def wrong_readings(recording: "xarray.Dataset") -> Iterator[Finding]:
    """Values of a taxel, or of a whole frame, that stand for up to three frames far from those before and after."""
    for finger in range(recording.sizes["finger"]):
        counts = taxels_of(recording, finger)
        runs = Runs.of(counts)
        if len(runs.first) < _FEWEST:
            continue
        brief = runs.length <= 2 * runs.usual      # what stands for longer is a rest or a hold
        frames, raw = counts[runs.first], _raw(recording, finger)[runs.first]
        single, whole = _wrong(frames, raw, brief, baseline=recording.baseline.values.any())
        single |= _beyond_all(frames) & (raw < LARGEST_RAW) & ~whole[:, None]
        for number in np.flatnonzero(single.any(axis=0)):
            yield _wrong_taxel(recording, finger, number, runs, np.flatnonzero(single[:, number]))
        if whole.any():
            yield _wrong_frame(recording, finger, runs, np.flatnonzero(whole))


def _raw(recording, finger):
    """Raw counts (time, taxel) of a finger."""
    return taxels_of(recording, finger) + recording.baseline.values[finger].ravel()


def _beyond_all(frames):
    """Readings (n, taxel) far larger than those of other taxels, which no neighbour shares: no press, however long they last.

    Those of a taxel that hangs are not among them.
    """
    size = np.abs(frames)
    usual = np.sort(size.max(axis=0))[-1 - _FEW_TAXELS]
    found = (size > max(_TIMES * usual, _LARGE)) & _alone(frames)
    for number in np.flatnonzero(found.any(axis=0)):
        length = Runs.of(frames[:, number]).length
        found[:, number] &= np.repeat(length, length) < _HANGS
    return found


def _wrong(frames, raw, brief, *, baseline):
    """Wrong readings (n, taxel), and wrong frames (n,), of distinct frames (n, taxel), among those that are `brief` (n,).

    raw (n, taxel): the raw counts;  baseline: whether they are known, so that 16 bits must hold them
    """
    impossible = ((raw < 0) | (raw > LARGEST_RAW)) & baseline
    off, usual = deviations(frames)
    noises = noise(frames)
    far = np.abs(off) > np.maximum(_SPIKE * np.maximum(usual, noises), _SPIKE_COUNTS)
    odd = (far & brief[:, None]) | impossible
    count = odd.sum(axis=1)
    upwards = (odd & (off > 0)).sum(axis=1) / np.maximum(count, 1)
    beyond = np.median(np.abs(off), axis=1) > _BEYOND
    blank = ((frames == 0).all(axis=1) | (raw == 0).all(axis=1)) & (np.median(noises) >= NOISY) & (count > 0)
    together = count > _TOGETHER * frames.shape[1]
    whole = blank | (together & (((upwards > 0.25) & (upwards < 0.75)) | beyond))
    return odd & (impossible | (_alone(off) & ~together[:, None])) & ~whole[:, None], whole


def _alone(off):
    """Where the neighbours of a taxel share less than `_SPREAD` of its jump: off (n, taxel)."""
    grid = np.pad(np.abs(off).reshape(-1, ROWS, COLUMNS), ((0, 0), (1, 1), (1, 1)))
    around = [grid[:, 1 + y:1 + y + ROWS, 1 + x:1 + x + COLUMNS] for y in (-1, 0, 1) for x in (-1, 0, 1) if x or y]
    return np.max(around, axis=0).reshape(off.shape) < _SPREAD * np.abs(off)


def _rows(runs, at):
    """Rows of the runs `at`."""
    return np.concatenate([runs.first[k] + np.arange(runs.length[k]) for k in at])


def _wrong_taxel(recording, finger, number, runs, at):
    values = taxels_of(recording, finger)[runs.first, number]
    around = np.median(np.delete(values, at)[max(0, at[0] - 3):at[0] + 3])
    return Finding("wrong reading", f"{where(recording, runs.first[at[0]])}: {taxel(finger, number)} reads {values[at[0]]:g} "
                   f"counts between readings of about {around:g}{and_more(len(at), 'such reading')}; left out as wrong: {CABLE}.",
                   (finger,), left_out=readings(recording, finger, _rows(runs, at), number))


def _wrong_frame(recording, finger, runs, at):
    return Finding("wrong reading", f"{where(recording, runs.first[at[0]])}: the whole frame of finger {finger} lies far from "
                   f"those before and after it{and_more(len(at), 'such frame')}; left out as wrong: {CABLE}.",
                   (finger,), left_out=readings(recording, finger, _rows(runs, at)))


def clipped_taxels(recording: "xarray.Dataset", spoiled: np.ndarray, largest: float | None) -> Iterator[Finding]:
    """Readings at the end of the range that are not `spoiled` (time, finger, row, column)."""
    at_end = clipped(recording, largest=largest) & ~spoiled
    for finger, row, column in np.argwhere(at_end.any(axis=0)):
        here = at_end[:, finger, row, column]
        first = int(np.argmax(here))
        yield Finding("clipped", f"{where(recording, first)}: {taxel_in_words(finger, row, column)} reads "
                      f"{recording.counts.values[first, finger, row, column]:g} counts, the end of its range; {here.sum()} "
                      "readings of it are clipped.", (int(finger),),
                      left_out=readings(recording, finger, here, row * COLUMNS + column))


def dead_taxels(recording: "xarray.Dataset") -> Iterator[Finding]:
    """Taxels that never change while others of their finger do."""
    for finger, row, column in np.argwhere(dead(recording)):
        values = recording.counts.values[:, finger, row, column]
        reads = f"reads {values[0]:g} counts" if np.ptp(values) == 0 else f"changes by {np.ptp(values):g} counts, its noise,"
        yield Finding("dead", f"{where(recording, 0)}: {taxel_in_words(finger, row, column)} {reads} in all "
                      f"{len(recording.time)} readings while others of its finger move; it may be dead.", (int(finger),),
                      left_out=readings(recording, finger, slice(None), row * COLUMNS + column))


def frozen_frames(recording: "xarray.Dataset") -> Iterator[Finding]:
    """Frames that stand far longer than others do, while the force changes, or in noise that should change them."""
    found: dict[tuple[int, int], list[int]] = {}
    for finger in range(recording.sizes["finger"]):
        for run in _still(recording, finger):
            found.setdefault(run, []).append(finger)
    for (first, last), fingers in found.items():
        rows, time = np.arange(first, last + 1), recording.time.values
        whom = "both fingers" if len(fingers) > 1 else f"finger {fingers[0]}"
        reason = "which their noise does not allow"
        if "force_n" in recording:
            begin, end = recording.force_n.values[[first, last], fingers[0]]
            reason = f"while the force goes from {begin:.3g} to {end:.3g} N"
        yield Finding("frozen", f"{where(recording, first, last)}: {len(rows)} readings, from {time[first]:.2f} to "
                      f"{time[last]:.2f} s, are equal in all taxels of {whom}, {reason}; a calibration uses the first only: "
                      f"{CABLE} and the program that records.", tuple(fingers),
                      left_out=np.any([readings(recording, finger, rows[1:]) for finger in fingers], axis=0))


def _still(recording, finger):
    """(first, last) row of each run of equal frames of a finger that is no natural one."""
    counts, time = taxels_of(recording, finger), recording.time.values
    runs, at_end = Runs.of(counts), clipped(recording)[:, finger].any(axis=(1, 2))
    force = recording.force_n.values[:, finger] if "force_n" in recording and np.ptp(counts) >= MOVES else np.zeros(len(time))
    for first, count in zip(runs.first, runs.length, strict=True):
        last = first + count - 1
        if count <= _FROZEN * runs.usual or time[last] - time[first] < _FROZEN_S or at_end[first]:
            continue
        reach = _AROUND * runs.usual
        around = np.concatenate([counts[max(0, first - reach):first + 1], counts[last + 1:last + 1 + reach]])
        noises = noise(around)
        jumps = last + 1 < len(counts) and (np.abs(counts[last + 1] - counts[last]) > 10 * noises + MOVES).any()
        sides = counts[[first - 1, last + 1]] if 0 < first and last + 1 < len(counts) else counts[[first, first]]
        pressed = np.abs(counts[first]).max() > MOVES or np.abs(sides).max(axis=1).min() > MOVES     # zeros amid a press
        moved = np.ptp(force[first:last + 2 - runs.usual]) > _FORCE_MOVES * np.ptp(force)
        if (jumps and pressed and moved) or (counts[first].any() and np.median(noises) >= NOISY):
            yield int(first), int(last)


def common_drift(recording: "xarray.Dataset") -> Iterator[Finding]:
    """Counts that have moved in all taxels alike, as by no press, from the beginning to the end. Needs no forces."""
    counts = recording.counts.values.reshape(len(recording.time), -1).astype(float)
    rows = Runs.of(counts).first
    some = max(_HANGS, len(rows) // 50)
    if len(rows) < 4 * some:
        return
    frames = counts[rows]
    moved = np.median(frames[-some:], axis=0) - np.median(frames[:some], axis=0)
    mean, by_noise = abs(float(np.mean(moved))), 1.25 * float(np.median(noise(counts))) * np.sqrt(2 / some)
    alike = np.var(moved) - by_noise**2 < (_ALIKE * mean) ** 2
    if mean > _DRIFTS_COUNTS and by_noise < 1.5 * _ALIKE * mean and alike:
        yield Finding("drift", f"{where(recording, rows[-some], len(counts) - 1)}: at the end all taxels have moved alike, "
                      f"by {np.mean(moved):.0f} counts from the beginning; let the sensor warm up, take its baseline anew, and "
                      "record again.", tuple(range(recording.sizes["finger"])), safe=False)


def hanging_taxels(recording: "xarray.Dataset", spoiled: np.ndarray) -> Iterator[Finding]:
    """Taxels that read one value for longer than chance allows, besides readings that are `spoiled` (time, finger, row, column)."""
    counts = recording.counts.values.reshape(len(recording.time), -1).astype(float)
    spoiled, still = spoiled.reshape(counts.shape), dead(recording).ravel()
    frames = [Runs.of(taxels_of(recording, finger)).first for finger in range(recording.sizes["finger"])]
    for number in np.flatnonzero(~still):
        finger, in_finger = divmod(int(number), ROWS * COLUMNS)
        own = frames[finger][~spoiled[frames[finger], number]]
        others = ~still & (np.arange(len(still)) != number)
        run = _hangs(counts, number, own, others)
        if run is None:
            continue
        first, end = run
        until = "to the end" if end == len(counts) else f"to row {row_of(recording, end - 1)}"
        yield Finding("hanging", f"{where(recording, first)}: {taxel(finger, in_finger)} reads {counts[first, number]:g} counts "
                      f"from there {until} while others change; a calibration leaves these {end - first} readings out: check the "
                      "taxel.",
                      (finger,), left_out=readings(recording, finger, np.arange(first, end), in_finger))


def _hangs(counts, number, own, others):
    """First row, and the one after the last, of a run in which a taxel hangs among `others`; None if it does not.

    counts (time, taxel);  own (n,): rows of its sound frames
    """
    if len(own) < 2 * _HANGS:
        return None
    first, count = longest_run(counts[own, number])
    if count < _HANGS:
        return None
    run, rest = own[first:first + count], np.delete(own, np.arange(first, first + count))
    among = counts[:, others]
    if not (_unlikely(among[run], counts[run[0], number]) or _left_behind(among.mean(axis=1), counts[:, number], run, rest)):
        return None
    return int(run[0]), int(own[first + count]) if first + count < len(own) else len(counts)


def _unlikely(others, value):
    """Whether `others` (n, taxel) change so often that n equal readings of a value are no chance.

    They count where they lie below that value or near it: noise may grow with the counts, but does not fall.
    """
    near = (np.abs(others) < 20 + 1.2 * abs(value))[:-1]
    equal = ((np.diff(others, axis=0) == 0) & near).sum(axis=0)
    seen = near.sum(axis=0)
    known = seen >= max(2 * _HANGS, 0.2 * len(others))
    if known.sum() < 3 or np.median(noise(others[:, known])) < NOISY:
        return False
    likely = np.quantile((equal[known] + 1) / (seen[known] + 2), 0.9)      # of a taxel among the least noisy
    return bool(len(others) * np.log(likely) < np.log(_CHANCE))


def _left_behind(level, values, run, rest):
    """Whether a pressed taxel stands in `run` while the mean of the others, which it follows in the `rest`, changes a lot."""
    least = 10 * float(noise(values[rest, None])[0]) + MOVES
    if len(rest) < 2 * _HANGS or abs(values[run[0]]) < least or np.ptp(level[rest]) == 0:
        return False
    slope, offset = np.polyfit(level[rest], values[rest], 1)
    unexplained = np.var(values[rest] - slope * level[rest] - offset) / max(float(np.var(values[rest])), 1e-30)
    return bool(unexplained < 0.1 and abs(slope) * np.ptp(level[run]) > 2 * least)
