"""Storage of fronts: what is needed at the same time has separate places."""

import numpy as np
from support.plates import plate

from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.symbolic import _Memory


def times_of(fronts, parts, levels):
    """From when to when each piece's panel (p, 2) and update (p, 2) are needed; parts run at the same time, in any order."""
    panel = np.empty((len(fronts.pivot_at) - 1, 2))
    for part in parts:
        panel[part] = (0, 1)
    for k, level in enumerate(levels):
        panel[level] = (1 + k, 2 + k)
    update = panel.copy()
    for p in range(len(panel)):
        for child in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
            update[child, 1] = panel[p, 1]
    return panel, update


def test_what_is_needed_at_the_same_time_does_not_overlap():
    for size in [(60, 40), (120, 30)]:
        _, upper, places = plate(*size)
        solver = DissectedSolver(places)
        assert solver.factor(upper)
        fronts, levels = solver._fronts, [np.array(level) for level, _ in solver._large]
        pivots, boundary = np.diff(fronts.pivot_at), np.diff(fronts.boundary_at)
        ranges = [(fronts.panel_at, pivots * (pivots + boundary)), (fronts.update_at, boundary**2)]
        needed = np.vstack(times_of(fronts, solver._parts, levels))
        start, end = (np.concatenate([f(*r) for r in ranges]) for f in (lambda at, _: at, lambda at, size: at + size))
        part_of = np.full(len(pivots), -1)
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
    pivots, boundary = np.diff(fronts.pivot_at), np.diff(fronts.boundary_at)
    for part in solver._parts:
        live = {}     # updates that wait for the piece that takes them over
        for p in part:
            panel = (fronts.panel_at[p], fronts.panel_at[p] + pivots[p] * (pivots[p] + boundary[p]))
            update = (fronts.update_at[p], fronts.update_at[p] + boundary[p]**2)
            for some in (*live.values(), panel):
                for other in (panel, update):
                    assert some is other or min(some[1], other[1]) <= max(some[0], other[0])
            for child in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
                del live[child]
            live[p] = update
    assert solver._store.work.size < 0.8 * np.sum(pivots * (pivots + boundary) + boundary**2)


def test_memory_that_was_freed_is_allocated_first():
    memory = _Memory(10)
    first, second, third = memory.allocate(5), memory.allocate(3), memory.allocate(4)
    assert (first, second, third) == (10, 15, 18)
    memory.free(second, 3)
    assert memory.allocate(4) == 22 and memory.allocate(3) == 15 and memory.allocate(0) == 10
    assert memory.end == 26
