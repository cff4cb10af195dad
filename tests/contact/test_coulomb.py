"""Contact with Coulomb's exact law on a half-space: the fast method against the plain one, and the law itself."""

import numpy as np
import pytest
from half_space import disc_of_points, half_space

from softtact.contact.coulomb import (
    ContactCompliance,
    CoulombSettings,
    Increment,
    into_discs,
    solve_block_by_block,
    solve_in_discs,
    solve_increment,
)
from softtact.errors import ConvergenceError

RADIUS, SPACING, DEPTH = 100.0, 0.25, 0.01       # mm: a contact 4 points in radius
POINTS = disc_of_points(1.4, SPACING)
BALL = (POINTS**2).sum(axis=1) / (2 * RADIUS)
SETTINGS = CoulombSettings(tolerance_mm=1e-10)
WAYS = {"pressed only": 0.0, "partial slip": 2e-3, "sliding": 2e-2}


def increment(friction, way, **motion):
    """A ball that comes down and aside by `way` (mm) along x and 0.3 of it along y in one increment."""
    return Increment(BALL, np.tile([way, 0.3 * way], (len(POINTS), 1)), friction, **motion)


def compliance(poisson):
    matrix = half_space(POINTS, SPACING, shear=1.0, poisson=poisson)
    return matrix, ContactCompliance.dense(matrix)


def test_the_fast_method_finds_what_the_plain_one_does():
    for way in WAYS.values():
        for poisson, friction in [(0.0, 0.3), (0.3, 0.3), (0.3, 2.0), (0.5, 1.0)]:
            matrix, fast = compliance(poisson)
            wanted = increment(friction, way, depth=DEPTH)
            found = solve_increment(fast, wanted, settings=SETTINGS)
            plain = solve_block_by_block(matrix, wanted, tolerance_mm=1e-12)
            largest = plain.normal.max()
            # both stop at about 1e-10 mm, over a point's own compliance of 1 to 2 mm/N, and the largest force is 3e-3 N
            np.testing.assert_allclose(found.normal, plain.normal, rtol=0, atol=1e-6 * largest)
            np.testing.assert_allclose(found.tangential, plain.tangential, rtol=0, atol=1e-6 * largest)
            np.testing.assert_array_equal(found.sticks, plain.sticks)


def test_a_load_gives_the_depth_that_gives_the_load():
    for friction in [0.0, 0.3, np.inf]:
        _, fast = compliance(0.3)
        deep = solve_increment(fast, increment(friction, 2e-3, depth=DEPTH), settings=SETTINGS)
        loaded = solve_increment(fast, increment(friction, 2e-3, load=deep.normal.sum()), settings=SETTINGS)
        assert loaded.depth == pytest.approx(DEPTH, rel=1e-7)      # the tolerance over the depth is 1e-8
        np.testing.assert_allclose(loaded.tangential, deep.tangential, rtol=0, atol=1e-6 * deep.normal.max())


def test_the_law_holds_at_every_point():
    _, fast = compliance(0.3)
    found = solve_increment(fast, increment(0.3, 2e-3, depth=DEPTH), settings=SETTINGS)
    pull, bound, touching = np.linalg.norm(found.tangential, axis=1), 0.3 * found.normal, found.normal > 0
    assert (found.gap > -1e-9).all() and np.abs(found.gap[touching]).max() < 1e-9 and not pull[~touching].any()
    assert (pull <= bound * (1 + 1e-12)).all()
    slides = touching & ~found.sticks
    assert 10 < slides.sum() < touching.sum() - 10             # partial slip: a part of both
    np.testing.assert_allclose(pull[slides], bound[slides], rtol=1e-6)
    along = (found.tangential * found.slip).sum(axis=1)[slides] / (pull * np.linalg.norm(found.slip, axis=1))[slides]
    # friction is against the slip, which is known to 1e-10 mm and is 1e-6 mm at the border of the sticking part
    np.testing.assert_allclose(along, -1.0, atol=1e-3)
    assert not found.slip[found.sticks].any()


def test_without_friction_nothing_moves_sideways():
    matrix, fast = compliance(0.3)
    found = solve_increment(fast, increment(0.0, 2e-2, depth=DEPTH), settings=SETTINGS)
    assert not found.tangential.any() and not found.sticks.any()
    np.testing.assert_allclose(found.normal, solve_block_by_block(matrix, increment(0.0, 0.0, depth=DEPTH)).normal, atol=1e-9)


def test_infinite_friction_holds_every_touching_point():
    """Then the contact is a linear system: displacements of the touching points are those of the object."""
    matrix, fast = compliance(0.3)
    found = solve_increment(fast, increment(np.inf, 2e-3, depth=DEPTH), settings=SETTINGS)
    touching = np.flatnonzero(found.normal > 0)
    inner = matrix[touching][:, :, touching].reshape(3 * len(touching), -1)
    wanted = np.column_stack([np.tile([2e-3, 0.6e-3], (len(touching), 1)), DEPTH - BALL[touching]])
    force = np.linalg.solve(inner, wanted.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(found.tangential[touching], force[:, :2], atol=1e-7 * np.abs(force).max())
    assert found.sticks[touching].all() and not found.slip[touching].any()


def test_an_object_above_the_surface_carries_nothing():
    _, fast = compliance(0.3)
    found = solve_increment(fast, increment(0.3, 2e-3, depth=-0.001), settings=SETTINGS)
    assert not found.normal.any() and not found.tangential.any()


def test_an_iteration_that_does_not_converge_is_refused_with_a_remedy():
    _, fast = compliance(0.0)
    with pytest.raises(ConvergenceError, match="did not settle pressure and friction in 2 turns; move the object in more steps"):
        solve_increment(fast, increment(2.0, 2e-2, depth=DEPTH), settings=CoulombSettings(tolerance_mm=1e-12, max_turns=2))


def test_discs_hold_each_force_and_the_energy_is_least_there():
    """No small change of any force within its disc lowers the energy."""
    _, fast = compliance(0.3)
    random = np.random.default_rng(0)
    linear, bound = random.standard_normal((len(POINTS), 2)), random.uniform(0.0, 0.3, len(POINTS))
    q, moved, _ = solve_in_discs(fast.tangential, linear, bound, np.zeros_like(linear), settings=SETTINGS)
    assert (np.linalg.norm(q, axis=1) <= bound * (1 + 1e-12)).all()
    for _ in range(50):
        change = into_discs(q + 1e-3 * random.standard_normal(q.shape), bound) - q
        assert (change * (moved + linear)).sum() > -1e-9 * np.abs(change).sum()
