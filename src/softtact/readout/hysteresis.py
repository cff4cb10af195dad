"""Viscoelastic lag of the deformation behind the force, over the history of loading.

Quasi-linear viscoelasticity (Y. C. Fung, Biomechanics, 1993, ch. 7.6) in its creep form, since the press prescribes the force: the
map u_e(F) of a press is the deformation after a long time under F, and the deformation at time t is

    u(t) = integral of J(t - s) du_e/ds ds,   J(t) = 1 - sum_i g_i exp(-t / tau_i),

where J grows from 1 - sum g_i to 1. After a step of force u creeps upwards. (At a constant deformation the force would relax;
the same material then has other shares and shorter time constants.)
Each term stores the delayed part q_i. For u_e linear in time its update is exact (Simo and Hughes,
Computational Inelasticity, 1998, sec. 10.3; Taylor, Pister and Goudreau, 1970):

    q_i(t + dt) = exp(-dt / tau_i) q_i(t) + g_i (u_e(t + dt) - u_e(t)) (1 - exp(-dt / tau_i)) tau_i / dt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LoadHistory:
    """Corners of a history of force that is piecewise linear in time.

    times_s (n,): not falling; two equal times are a jump;  load_step (n,): number of the load step, 0 without force
    loading, unloading (load steps,): index of the corner that is read at each load step
    """

    times_s: np.ndarray
    load_step: np.ndarray
    loading: np.ndarray
    unloading: np.ndarray


def staircase(force_n: np.ndarray, *, rate_n_per_s: float, hold_s: float, cycles_before: int = 0,
              rest_s: float = 0.0) -> LoadHistory:
    """The `LoadHistory` of a press: up the load steps (N, rising) and down, each held and read at the end of its hold.

    cycles_before: number of cycles to the highest load step and back without holds, each followed by `rest_s` without force;
    rate_n_per_s: inf for jumps
    """
    count = len(force_n)
    cycle = [*range(1, count + 1), *range(count - 1, -1, -1), 0]
    stairs = np.repeat([*range(1, count + 1), *range(count, 0, -1)], 2)
    load_step = np.concatenate([[0], np.tile(cycle, cycles_before), stairs]).astype(int)
    force = np.concatenate([[0.0], force_n])[load_step]
    duration = np.abs(np.diff(force)) / rate_n_per_s
    first = 1 + cycles_before * len(cycle)
    duration[len(cycle) - 1:first - 1:len(cycle)] = rest_s
    duration[first::2] = hold_s
    read = first + 1 + 2 * np.arange(2 * count)
    return LoadHistory(np.concatenate([[0.0], np.cumsum(duration)]), load_step, read[:count], read[count:][::-1])


def lagged(values: np.ndarray, times_s: np.ndarray, *, shares: Sequence[float], time_constants_s: Sequence[float]) -> np.ndarray:
    """Delayed values (n, ...) at `times_s` (n,) of elastic values (n, ...), linear between these times; in equilibrium at the
    first.

    shares, time_constants_s (terms,): g_i and tau_i in s; without terms the values themselves
    """
    values = np.asarray(values, dtype=float)
    out = values.copy()
    for share, tau in zip(shares, time_constants_s, strict=True):
        out -= _delayed_part(values, np.diff(times_s) / tau, share)
    return out


def _delayed_part(values, steps, share):
    """Delayed part q (n, ...) of one term; steps (n - 1,): durations over its time constant."""
    delayed = np.zeros_like(values)
    for k, step in enumerate(steps):
        mean_decay = -np.expm1(-step) / step if step > 0 else 1.0     # mean of exp(-s) over the step
        delayed[k + 1] = np.exp(-step) * delayed[k] + share * mean_decay * (values[k + 1] - values[k])
    return delayed


def delayed_branches(maps: np.ndarray, history: LoadHistory, *, shares: Sequence[float],
                  time_constants_s: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Delayed maps (load steps, ...) during loading and unloading, from elastic maps (load steps, ...) of the same load steps."""
    elastic = np.concatenate([np.zeros((1, *maps.shape[1:])), maps])[history.load_step]
    delayed = lagged(elastic, history.times_s, shares=shares, time_constants_s=time_constants_s)
    return delayed[history.loading], delayed[history.unloading]
