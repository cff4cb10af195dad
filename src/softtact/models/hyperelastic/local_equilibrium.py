"""Frusta that find their balance one by one, between the steps of the whole sensor, with their roots held.

Beside the object frusta rock on the rims of their tips, and under it they fold onto the board: a few of them change their contact
within a step, and are then farther from balance than all else. Steps of the whole sensor would cost a thousand times what theirs
do, and one frustum whose energy rises halves such a step for all. What each does here lowers its own energy, and so the whole one.
"""

import numpy as np

from softtact.linalg.workers import SERIAL, Workers, chunks
from softtact.models.hyperelastic.support import Support, SupportState
from softtact.models.newton import line_search_each

_STEPS = 6               # of Newton's method for a frustum; what is not in balance then is left to the next step of all
_HALVINGS = 5
_FARTHEST_MM = 0.05      # of a node in a step
_SHARE = 0.3             # of the tolerance that a frustum keeps at most: what moves its root next must not use up all of it
_AT_ONCE = 8             # frusta that a thread condenses at once


def balanced(support: Support, state: SupportState, tolerance_n: float, *,
             workers: Workers = SERIAL) -> tuple[SupportState, np.ndarray]:
    """The `SupportState` after each frustum beyond the tolerance (N) went to its own balance, and which frusta did (k,).

    These have their condensed tangents anew, on the way and not where they came to.
    """
    loose, moved = _loose(support, state, tolerance_n), np.zeros(support.count, dtype=bool)
    for _ in range(_STEPS):
        if not len(loose):
            break
        moved[loose] = True
        state, lowered = _step(support, state, loose, workers)
        loose = np.intersect1d(loose[lowered], _loose(support, state, _SHARE * tolerance_n))
    return state, np.flatnonzero(moved)


def _loose(support, state, tolerance_n):
    """Numbers (k,) of the frusta with unbalanced forces of more than the tolerance."""
    return np.flatnonzero(np.abs(support.inner_residual(state)).max(axis=1, initial=0.0) > tolerance_n)


def _step(support, state, frusta, workers):
    """The state after a step of the frusta (k,), each halved until its own energy falls, and for which (k,) it did."""
    workers.map(lambda part: support.condense(state, part), chunks(frusta, _AT_ONCE))
    step = support.own_step(state, frusta, workers=workers)
    step *= np.minimum(1.0, _FARTHEST_MM / np.maximum(np.abs(step).max(axis=(1, 2)), 1e-300))[:, None, None]
    displacement, (energies, forces) = state.displacement.copy(), tuple(part.copy() for part in state.elastic)
    before = support.potentials(displacement[frusta], (energies[frusta], None), frusta, state.history)

    def accept(waiting, share):
        here = frusta[waiting]
        trial = state.displacement[here] + share * step[waiting]
        elastic = support.rubber(trial, here, workers=workers)
        if elastic is None:     # one of them is inside out
            return np.zeros(len(waiting), dtype=bool)
        lower = support.potentials(trial, elastic, here, state.history) < before[waiting]
        displacement[here[lower]], energies[here[lower]], forces[here[lower]] = trial[lower], elastic[0][lower], elastic[1][lower]
        return lower

    lowered = line_search_each(accept, len(frusta), halvings=_HALVINGS)
    return support.with_contact(displacement, (energies, forces), state.history), lowered
