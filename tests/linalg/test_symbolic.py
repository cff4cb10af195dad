"""Where fronts stand: what is needed at the same time has places of its own."""

import numpy as np
from support.plates import plate

from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.symbolic import _Room


def times_of(fronts, parts, levels):
    """From when to when each piece's panel (p, 2) and update (p, 2) are needed; parts run at the same time, in any order."""
    own = np.empty((len(fronts.own_at) - 1, 2))
    for part in parts:
        own[part] = (0, 1)
    for k, level in enumerate(levels):
        own[level] = (1 + k, 2 + k)
    update = own.copy()
    for p in range(len(own)):
        for child in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
            update[child, 1] = own[p, 1]
    return own, update


def test_what_is_needed_at_the_same_time_does_not_overlap():
    for size in [(60, 40), (120, 30)]:
        _, upper, places = plate(*size)
        solver = DissectedSolver(places)
        assert solver.factor(upper)
        fronts, levels = solver._fronts, [np.array(level) for level, _ in solver._large]
        own, bound = np.diff(fronts.own_at), np.diff(fronts.bound_at)
        ranges = [(fronts.panel_at, own * (own + bound)), (fronts.update_at, bound**2)]
        needed = np.vstack(times_of(fronts, solver._parts, levels))
        start, end = (np.concatenate([f(*r) for r in ranges]) for f in (lambda at, _: at, lambda at, size: at + size))
        part_of = np.full(len(own), -1)
        for k, part in enumerate(solver._parts):
            part_of[part] = k
        part_of = np.tile(part_of, 2)
        assert len(solver._parts) > 2 and len(levels) > 2
        for a in range(len(start)):
            # Within a part pieces come one after the other and share room, so that is left to the next test.
            others = (needed[:, 0] < needed[a, 1]) & (needed[a, 0] < needed[:, 1]) & ((part_of != part_of[a]) | (part_of < 0))
            others[a] = False
            overlap = others & (start < end[a]) & (start[a] < end)
            assert not overlap.any()


def test_pieces_one_after_the_other_share_room_and_keep_what_is_not_yet_taken_over():
    _, upper, places = plate(60, 40)
    solver = DissectedSolver(places)
    assert solver.factor(upper)
    fronts = solver._fronts
    own, bound = np.diff(fronts.own_at), np.diff(fronts.bound_at)
    for part in solver._parts:
        live = {}     # updates that wait for the piece that takes them over
        for p in part:
            panel = (fronts.panel_at[p], fronts.panel_at[p] + own[p] * (own[p] + bound[p]))
            update = (fronts.update_at[p], fronts.update_at[p] + bound[p]**2)
            for some in (*live.values(), panel):
                for other in (panel, update):
                    assert some is other or min(some[1], other[1]) <= max(some[0], other[0])
            for child in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
                del live[child]
            live[p] = update
    assert solver._store.work.size < 0.8 * np.sum(own * (own + bound) + bound**2)


def test_room_that_was_given_back_is_taken_first():
    room = _Room(10)
    first, second, third = room.take(5), room.take(3), room.take(4)
    assert (first, second, third) == (10, 15, 18)
    room.give_back(second, 3)
    assert room.take(4) == 22 and room.take(3) == 15 and room.take(0) == 10
    assert room.most == 26
