"""Frusta find their own balance between the steps of the whole sensor: the same as a step of all finds, and nothing else moves."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support import six_frusta
from support.sensors import CORO
from support.six_frusta import LAW

from softtact.linalg.workers import Workers
from softtact.models.hyperelastic.body import LayeredBody, balanced
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.sensor import Sensor
from softtact.sensors.frusta import Friction

TOLERANCE_N = 1e-5
FIRST, THIRD = 0, 2


@pytest.fixture
def body():
    return six_frusta.six_frusta()


def bent(body, *, by_mm):
    """The body at rest, the plate a millimetre above it, but for some frusta bent sideways, {frustum: mm}."""
    return six_frusta.bent(body, by_mm=by_mm, depth_mm=-1.0)


def unbalanced(support, state):
    """Largest unbalanced force (n,) in N inside each frustum."""
    return np.abs(support.inner_residual(state)).max(axis=1)


def newton_of_all(support, state):
    """The naive way: Newton's method on all frusta at once, whole steps, all roots held."""
    for _ in range(12):
        support.condense(state, np.arange(support.count))
        _, forward_solved = support.condensed_residual(state)
        state = support.evaluate(state.displacement + support.inner_step(forward_solved,
                                                                         np.zeros((support.count, 3 * len(support.root)))))
    return state


@pytest.mark.parametrize("threads", [1, 2])
def test_bent_frusta_go_back_to_balance_and_the_others_stay_where_they_are(body, threads):
    state = bent(body, by_mm={FIRST: 0.01, THIRD: -0.02}).support
    now, moved = balanced(body.support, state, TOLERANCE_N, workers=Workers(threads))
    np.testing.assert_array_equal(moved, [FIRST, THIRD])
    assert unbalanced(body.support, state)[moved].min() > 100 * TOLERANCE_N
    assert unbalanced(body.support, now).max() <= TOLERANCE_N and now.energy < state.energy
    others = np.setdiff1d(np.arange(body.support.count), moved)
    np.testing.assert_array_equal(now.displacement[others], state.displacement[others])
    np.testing.assert_array_equal(now.displacement[:, body.support.root], state.displacement[:, body.support.root])


def test_their_balance_is_that_of_newtons_method_on_all(body):
    state = bent(body, by_mm={FIRST: 0.01, THIRD: -0.02}).support
    one_by_one, _ = balanced(body.support, state, TOLERANCE_N)
    together = newton_of_all(body.support, state)
    # Forces of the tolerance on the softest mode, 0.03 N/mm, move by 3e-4 mm; these modes are stiffer by ten.
    np.testing.assert_allclose(one_by_one.displacement, together.displacement, atol=3e-5)
    assert one_by_one.energy == pytest.approx(together.energy, rel=1e-6, abs=1e-9)


def test_a_state_is_the_same_as_one_evaluated_there(body):
    """Some frusta are evaluated alone, with their own elements and contacts: as all are together."""
    state = bent(body, by_mm={THIRD: 0.03}).support
    now, _ = balanced(body.support, state, TOLERANCE_N)
    anew = body.support.evaluate(now.displacement)
    assert now.energy == pytest.approx(anew.energy, rel=1e-12)
    np.testing.assert_allclose(now.force, anew.force, atol=1e-12)
    np.testing.assert_array_equal(now.gaps, anew.gaps)


def rubbing(body, *, pressure_mpa):
    """The support's state with a frustum bent sideways, its tip free to slide against a friction of this pressure."""
    state = bent(body, by_mm={THIRD: 0.03})
    touched = body.friction.begin_step(state).support
    board = replace(touched.friction, pressure=np.full_like(touched.friction.pressure, pressure_mpa),
                    touching=np.ones_like(touched.friction.touching))
    return body.support.reevaluate_contact(state.support, touched.held_by(board))


@pytest.mark.parametrize("pressure_mpa", [0.0, 0.01, 1.0])
def test_a_frustum_that_may_slide_finds_its_balance_against_friction(pressure_mpa):
    """Friction of a constant pressure has a potential, which falls with the others; a state evaluated there is the same.

    Where the tip slides, steps cross the slip tolerance: six leave some thousandths of the force, for the next step of all.
    """
    body = six_frusta.six_frusta(tips_bonded=False, friction=Friction(board=0.3))
    state = rubbing(body, pressure_mpa=pressure_mpa)
    now, moved = balanced(body.support, state, TOLERANCE_N)
    of_frusta = body.support.potentials(now.displacement, now.elastic, np.arange(body.support.count), now.history)
    anew = body.support.evaluate(now.displacement, state.history)
    body.close()
    np.testing.assert_array_equal(moved, [THIRD])
    assert unbalanced(body.support, now).max() <= 0.01 * unbalanced(body.support, state).max() and now.energy < state.energy
    assert [now.energy, of_frusta.sum()] == pytest.approx([anew.energy] * 2, rel=1e-12)
    np.testing.assert_allclose(now.force, anew.force, atol=1e-12)


def test_steps_too_long_are_halved_until_the_energy_of_each_frustum_falls(body, monkeypatch):
    whole, state = body.support.local_step, bent(body, by_mm={FIRST: 0.01, THIRD: -0.02}).support
    factors = np.ones(body.support.count)
    factors[THIRD] = 8.0      # on a parabola a step eight times too long raises the energy, and so do its half and its quarter
    monkeypatch.setattr(body.support, "local_step", lambda state, frusta, **options: (
        factors[frusta, None, None] * whole(state, frusta, **options)))
    monkeypatch.setattr("softtact.models.hyperelastic.body._FARTHEST_MM", 1.0)
    now, _ = balanced(body.support, state, TOLERANCE_N)
    left = unbalanced(body.support, now)
    assert left[FIRST] <= TOLERANCE_N and now.energy < state.energy and (left[THIRD] < unbalanced(body.support, state)[THIRD])


def with_slab_in_balance(body, state, *, but_for_n=0.0):
    """The same state with the slab's own forces against those of the frusta on their roots, but for one of so many N."""
    state.slab.force[:] = 0.0
    np.add.at(state.slab.force, body.cells.roots.ravel(), -state.support.force[:, body.support.root].reshape(-1, 3))
    state.slab.force.reshape(-1)[body.slab.free[0]] += but_for_n
    return state


def test_frusta_wait_for_the_step_of_all_while_the_slab_is_farther_from_balance(body):
    state = with_slab_in_balance(body, bent(body, by_mm={FIRST: 0.01}))
    assert body.balanced(state, TOLERANCE_N).energy < state.energy
    worst = unbalanced(body.support, state.support).max()
    state = with_slab_in_balance(body, state, but_for_n=2 * worst)
    assert body.balanced(state, TOLERANCE_N) is state


def test_frusta_that_may_slide_need_not_wait_for_the_step_of_all():
    body = six_frusta.six_frusta(tips_bonded=False, friction=Friction(board=0.3))
    state = with_slab_in_balance(body, replace(bent(body, by_mm={}), support=rubbing(body, pressure_mpa=1.0)))
    now = body.balanced(state, TOLERANCE_N)
    body.close()
    assert unbalanced(body.support, now.support).max() <= 0.01 * unbalanced(body.support, state.support).max()


def test_a_cell_whose_frustum_moved_alone_gets_a_new_tangent(body):
    state = with_slab_in_balance(body, bent(body, by_mm={FIRST: 0.01}))
    assert body.cells.refresh(state, kept_mm=1.0) == body.cells.count
    assert body.cells.refresh(body.balanced(state, TOLERANCE_N), kept_mm=1.0) == 1


@pytest.mark.slow
def test_a_press_takes_fewer_steps_of_the_whole_sensor_and_gives_the_same_map(monkeypatch):
    """Frusta of two rings beside a punch rock on their tips."""
    sensor = Sensor(CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)}), {"dielectric": LAW, "cover": LAW},
                    mesh=MeshSettings(frustum_rings=2))
    punch = trimesh.creation.cylinder(radius=2.0, height=2.0, sections=96)
    with_balance = sensor.press(punch, force_n=[2.0], model="hyperelastic")
    monkeypatch.setattr(LayeredBody, "balanced", lambda body, state, tolerance_n: state)
    without = sensor.press(punch, force_n=[2.0], model="hyperelastic")
    assert with_balance.iterations.sum() < without.iterations.sum()
    # The tolerance of forces, 3e-4 of 10 N, is worth 0.1 % of a map at 2 N.
    np.testing.assert_allclose(with_balance.deformation_map_mm, without.deformation_map_mm,
                               atol=2e-3 * without.deformation_map_mm.max())
