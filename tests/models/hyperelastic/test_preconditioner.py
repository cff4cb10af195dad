"""Two ways to factor a contact: what a dissected solver leaves for last, against a new factor in double precision."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation
from support.plates import plate
from support.sensors import CORO
from support.six_frusta import six_frusta

from softtact.linalg.direct import make_solver
from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.nodal_frames import NodeFrames
from softtact.linalg.workers import Workers
from softtact.models.hyperelastic import newton_step
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.newton_step import ContactFactor, DissectedContact, StepContact
from softtact.models.hyperelastic.path import press_load_steps

WIDTH, LENGTH = 14, 9
UNKNOWNS = 3 * 2 * WIDTH * LENGTH - 2     # the last node is held along y and z


class Pressed:
    """A plate of two layers of nodes, a patch of whose upper ones meets an object along normals of their own."""

    def __init__(self, seed=0, *, friction=False, others=False):
        rng = np.random.default_rng(seed)
        whole, _, places = plate(WIDTH, LENGTH)
        self.rubber = sp.triu(sp.kron(whole, np.diag([1.0, 1.5, 2.0]) + 0.3).tocsr()[:UNKNOWNS, :UNKNOWNS], format="csr")
        self.rubber.sort_indices()
        self.places = np.repeat(places, 3, axis=0)[:UNKNOWNS]
        x, y = places.T
        top = np.flatnonzero((np.arange(len(places)) % 2 == 1) & (x > 3) & (x < 10) & (y > 2) & (y < 7))
        turns = Rotation.random(len(top), rng=rng).as_matrix()
        also = np.array([UNKNOWNS - 1]) if others else np.zeros(0, dtype=np.int64)
        frames = NodeFrames(first=3 * top, turns=turns, wanted=np.ones(len(top), dtype=np.int64), others=also)
        self.contact = SimpleNamespace(frames=lambda kept, change=0.0: frames)
        # A point lies between two nodes, and sees each along the direction that the node keeps for it.
        size = (len(frames.last),) * 2
        share = rng.uniform(0.2, 0.8, size) * (rng.random(size) < 0.1)
        rows = sp.csr_matrix(np.eye(len(share)) + share) @ frames.movements(UNKNOWNS).T
        self.points = SimpleNamespace(rows=rows.tocsr(), indentation_increment=-rng.uniform(0.7, 1.0, len(share)))
        self.friction_border = (0.05 * rng.normal(size=UNKNOWNS), 40.0) if friction else (0.0, 0.0)
        self.slopes = [rng.choice([0.0, 30.0, 300.0], len(share)) for _ in range(3)]
        self.free = True

    def factors(self, workers):
        return ContactFactor(make_solver()), DissectedContact(DissectedSolver(self.places, workers=workers), workers=workers)


@pytest.fixture
def workers():
    pool = Workers(2)
    yield pool
    pool.close()


def difference(one, other):
    return np.abs(one - other).max() / np.abs(one).max()


@pytest.mark.parametrize(("friction", "others"), [(False, False), (True, False), (False, True)])
@pytest.mark.parametrize("held", [False, True])
def test_one_contact_after_the_other_is_solved_as_with_a_new_factor(friction, others, held, workers):
    problem = Pressed(friction=friction, others=others)
    new, left = problem.factors(workers)
    right = np.random.default_rng(1).normal(size=UNKNOWNS + 1)
    assert left.renew(problem, np.zeros(len(problem.slopes[0])))
    for slope in problem.slopes:
        assert new.renew(problem, slope) and left.follow(problem, slope)
        expected, found = (factor.solve(right, held=held) for factor in (new, left))
        assert found.shape == (UNKNOWNS + 1,) and bool(found[-1] == 0.0) is held
        # 16 bits leave some 1e-4 of a well conditioned solution (test_dissected_solver).
        assert difference(expected, found) < 1e-3


def test_an_object_without_an_unknown_of_its_own_is_none(workers):
    problem = Pressed()
    new, left = problem.factors(workers)
    right = np.random.default_rng(1).normal(size=UNKNOWNS)
    assert new.renew(problem, problem.slopes[0]) and left.renew(problem, problem.slopes[0])
    expected, found = (factor.solve(right, held=False) for factor in (new, left))
    assert found.shape == (UNKNOWNS,) and difference(expected, found) < 1e-3


def test_what_the_dissected_factor_solves_is_the_matrix_with_the_contact_and_its_border(workers):
    problem, slope = Pressed(friction=True), Pressed().slopes[0]
    _, left = problem.factors(workers)
    assert left.renew(problem, slope)
    rows, indentation_increment = problem.points.rows.toarray(), problem.points.indentation_increment
    border, corner = problem.friction_border
    rubber = problem.rubber.toarray()
    matrix = rubber + np.triu(rubber, 1).T + rows.T @ (slope[:, None] * rows)
    column = rows.T @ (slope * indentation_increment) + border
    whole = np.block([[matrix, column[:, None]], [column[None], np.array([[corner + slope @ indentation_increment**2]])]])
    right = np.random.default_rng(1).normal(size=UNKNOWNS + 1)
    np.testing.assert_allclose(whole @ left.solve(right, held=False), right, atol=2e-3)


def test_a_contact_that_hardly_changed_keeps_its_factor_and_one_that_did_does_not(workers, monkeypatch):
    problem = Pressed()
    _, left = problem.factors(workers)
    slope, calls, plain = problem.slopes[1], [], newton_step.factor_in_place
    monkeypatch.setattr(newton_step, "factor_in_place", lambda *a, **k: calls.append(1) or plain(*a, **k))
    assert left.renew(problem, slope) and len(calls) == 1
    assert left.follow(problem, slope * 1.0005) and len(calls) == 1
    assert left.follow(problem, slope * 1.01) and len(calls) == 2
    problem.rubber = 1.1 * problem.rubber
    assert left.renew(problem, slope * 1.01) and len(calls) == 3     # the rubber's part has changed


@pytest.mark.parametrize("place", ["far from the object", "on it"])
def test_rubber_that_is_not_positive_definite_is_reported(place, workers):
    problem = Pressed()
    row = 0 if place == "far from the object" else problem.contact.frames(None).first[4]
    problem.rubber.data[problem.rubber.indptr[row:row + 3]] -= 1e4
    assert not any(factor.renew(problem, problem.slopes[0]) for factor in problem.factors(workers))


def test_a_contact_may_hold_what_the_rubber_alone_does_not(workers):
    """Soft along the direction that is left for last: only with the contact's stiffness is the whole positive definite."""
    problem = Pressed()
    frames = problem.contact.frames(None)
    direction = frames.movements(UNKNOWNS)[:, [4]]
    soft = sp.triu(problem.rubber - 8.0 * direction @ direction.T, format="csr")
    soft.sort_indices()
    problem.rubber = soft
    new, left = problem.factors(workers)
    none, all_hard = np.zeros(len(problem.slopes[0])), np.full(len(problem.slopes[0]), 300.0)
    assert not new.renew(problem, none) and not left.renew(problem, none)
    assert new.renew(problem, all_hard) and left.renew(problem, all_hard)
    right = np.random.default_rng(1).normal(size=UNKNOWNS + 1)
    assert difference(*(factor.solve(right, held=False) for factor in (new, left))) < 1e-3


def ball(x, y):
    """A sphere of R 2.6 mm with its lowest point beside the middle, and its normals: nodes turn and touch as it sinks."""
    x, y = x - 0.1, y + 0.07
    height = 2.6 - np.sqrt(2.6**2 - x**2 - y**2)
    return height, np.column_stack([x, y, height - 2.6]) / 2.6


def test_a_sinking_ball_finds_nodes_of_its_own_and_ends_where_a_general_solver_does(monkeypatch):
    ends, frames = [], []
    for general in (False, True):
        body = six_frusta()
        if general:
            body.stepper.factor = ContactFactor(make_solver())
        else:
            monkeypatch.setattr(StepContact, "frames",
                                lambda *a, find=StepContact.frames, **k: frames.append(find(*a, **k)) or frames[-1])
        settings = NewtonSettings(relative_tolerance=1e-8)
        ends.append([load_step.state for load_step in press_load_steps(body, ball, [0.3, 1.0, 2.0], settings=settings)])
        body.close()
    assert len(frames[-1].first) > len(frames[0].first) > 0
    for one, other in zip(*ends, strict=True):
        # Forces of 1e-8 of 2 N are left, on modes of 0.03 N/mm and more.
        assert one.indentation == pytest.approx(other.indentation, abs=1e-6)
        np.testing.assert_allclose(one.slab.displacement, other.slab.displacement, atol=3e-6)


def test_nodes_that_a_step_brings_to_the_object_are_left_to_the_last_as_well():
    """Chosen at the step's start alone, they would stand outside: each change of their contact would need a new factor."""
    body = six_frusta()
    rest, _ = body.rest()
    planes = body.slab.project(rest, ball)
    above, touching = (StepContact(body.slab, body.slab.evaluate(rest, planes, depth), depth) for depth in (-0.3, 0.02))
    lowered = 0.32 * above.points.indentation_increment
    found, expected = above.frames(None, change=lowered), touching.frames(None)
    body.close()
    assert not len(above.frames(None).last) and len(expected.last)
    np.testing.assert_array_equal(found.last, expected.last)


def tilted_plate(x, y):
    """A plate over everything, 3 degrees from level: its contact grows across the sensor, beyond the nodes near it at first."""
    return 0.05 * (x + 8.0), np.tile(np.array([0.05, 0.0, -1.0]) / np.hypot(0.05, 1.0), (len(x), 1))


def test_a_contact_that_grows_far_within_a_step_takes_few_factors():
    """Two load steps of five iterations: 4 factors (25 where nodes are chosen by their gaps at a step's start)."""
    body = six_frusta(footprint_mm=(12.0, 7.2), edge=CORO.edge)
    load_steps = list(press_load_steps(body, tilted_plate, [5.0, 20.0], settings=NewtonSettings()))
    factors = body.stepper.factors
    body.close()
    assert factors <= sum(load_step.iterations for load_step in load_steps)


def test_nodes_that_are_enough_stay_and_are_turned_to_the_normals_of_now():
    body = six_frusta()
    rest, _ = body.rest()
    planes, turn = body.slab.project(rest, ball), Rotation.from_rotvec([0.03, 0.0, 0.0])
    before, turned = (StepContact(body.slab, body.slab.evaluate(rest, facing, 0.02), 0.02)
                      for facing in (planes, replace(planes, normals=turn.apply(planes.normals))))
    kept = before.frames(None)
    now = turned.frames(kept)
    soon = turned._frames_within(turned.points.gaps, newton_step._SOON_MM, newton_step._BENT)
    body.close()
    np.testing.assert_array_equal(now.last, kept.last)
    touched = np.isin(now.first, soon.first)
    assert 0 < touched.sum() < len(touched)
    np.testing.assert_array_equal(now.turns[touched], soon.turns)
    np.testing.assert_array_equal(now.turns[~touched], kept.turns[~touched])
    assert (now.turns[touched] != kept.turns[touched]).any()
