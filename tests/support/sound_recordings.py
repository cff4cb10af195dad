"""Sound recordings of presses with the log of a load cell, drawn from a seed: what no check may find fault with."""

from dataclasses import dataclass

import numpy as np

from softtact.readout.hysteresis import lagged
from softtact.readout.recording import make_recording, with_forces_at

_CORNERS = {"triangle": ([0, 0.5, 1], [0, 1, 0]), "hold": ([0, 0.15, 0.85, 1], [0, 1, 1, 0]),
            "stairs": ([0, 0.1, 0.3, 0.4, 0.6, 0.65, 0.8, 1], [0, 0.4, 0.4, 1, 1, 0.4, 0.4, 0])}


@dataclass
class Bench:
    """What a recording is made of: times (n,) in s, forces (n,) in N, counts (n, 2, 7, 4), and the log's own times and forces."""

    time_s: np.ndarray
    force_n: np.ndarray
    counts: np.ndarray
    log_s: np.ndarray
    log_n: np.ndarray

    def recording(self):
        """The recording with its log."""
        return with_forces_at(self.alone(), self.log_s, np.stack([self.log_n] * 2, axis=1), log="log.csv")

    def alone(self):
        """The recording without its log."""
        return make_recording(self.time_s, self.counts, source="a test's", baseline=np.full((2, 7, 4), 9000), file="press.csv")

    def add(self, counts):
        """Add counts (n,) to all taxels."""
        self.counts = self.counts + np.round(counts).astype(int)[:, None, None, None]


def drawn(seed, *, presses=None, noise=None, wide=None, rates=(30, 60, 100, 250, 1000)):
    """A sound bench: its rate, how often frames are renewed, noise, presses, places, creep and its log are drawn."""
    rng = np.random.default_rng(seed)
    rate = float(rng.choice(rates))
    repeats = int(rng.choice([1, 2, 4, 16])) if rate >= 250 else 1
    corners, forces, places = _presses(rng, presses or int(rng.integers(1, 6)))
    time = np.arange(0, corners[-1], 1 / rate)
    force = np.interp(time, corners, forces)
    felt = lagged(force[:, None], time, shares=[0.08 * rng.random(), 0.06 * rng.random()], time_constants_s=[1.0, 10.0])[:, 0]
    number = np.clip(np.searchsorted(places[0], time, side="right") - 1, 0, len(places[1]) - 1)
    shape = np.array([_footprint(rng, rng.random() < 0.5 if wide is None else wide) for _ in places[1]])[number]
    true = (rng.uniform(10, 40) * felt ** rng.uniform(0.8, 1.2))[:, None, None, None] * shape
    size = rng.choice([0.0, 0.4, 1.0, 3.0, 6.0, 15.0]) if noise is None else noise
    scatter = size * rng.uniform(0.7, 1.3, true.shape[1:]) * (1 + (rng.random() < 0.3) * 0.003 * true)
    counts = np.round(true + scatter * rng.standard_normal(true.shape)).astype(int)
    counts = counts[np.arange(len(time)) // repeats * repeats]
    return Bench(time, force, counts, *_log(rng, corners, forces))


def _presses(rng, count):
    """Times and forces at the corners of all presses, and (time at which each begins, its number)."""
    corners, forces, begins = [0.0], [0.0], []
    top = rng.uniform(3, 40)
    for _ in range(count):
        begin = corners[-1] + rng.uniform(0.3, 1.5)
        lasts = rng.choice([0.2, 1.0, 3.0, 8.0]) * rng.uniform(0.8, 1.2)
        at, height = _CORNERS[rng.choice(list(_CORNERS))]
        corners += [begin, *(begin + lasts * np.array(at[1:]))]
        forces += [0.0, *(top * rng.uniform(0.3, 1) * np.array(height[1:]))]
        begins.append(begin)
    return np.array([*corners, corners[-1] + rng.uniform(0.3, 1.5)]), np.array([*forces, 0.0]), (begins, range(count))


def _footprint(rng, wide):
    """Share (finger, row, column) of a press in each taxel: a plate, or a ball anywhere; on finger 0, sometimes on both."""
    y, x = np.mgrid[:7, :4]
    one = rng.uniform(0.9, 1.1, (7, 4)) if wide else np.exp(-((y - rng.uniform(0, 6)) ** 2 + (x - rng.uniform(0, 3)) ** 2)
                                                            / (2 * rng.uniform(0.8, 2.0) ** 2))
    return np.stack([one, one[:, ::-1] * (rng.random() < 0.3)])


def _log(rng, corners, forces):
    """Times and forces of a load cell with its own rate, noise, jitter and a delay of at most 15 ms."""
    rate = rng.choice([50, 100, 500, 1000])
    at = np.arange(-0.04, corners[-1] + 0.04, 1 / rate)
    at = np.sort(at + rng.uniform(-0.3, 0.3, len(at)) / rate)
    read = np.interp(at - rng.uniform(0, 0.015), corners, forces) + rng.choice([0.0, 0.005, 0.05]) * rng.standard_normal(len(at))
    return at, read


def ramp(*, rate=100, noise=3.0):
    """A plate on finger 0: 0.5 s at rest, up to 20 N in 1.5 s, down in 1.5 s, 0.5 s at rest."""
    time = np.arange(4 * rate) / rate
    force = np.interp(time, [0.5, 2.0, 3.5], [0, 20, 0])
    counts = np.zeros((len(time), 2, 7, 4))
    counts[:, 0] = 20 * force[:, None, None] * np.linspace(0.9, 1.1, 28).reshape(7, 4)
    counts = np.round(counts + noise * np.random.default_rng(3).standard_normal(counts.shape)).astype(int)
    return Bench(time, force, counts, time.copy(), force.copy())
