"""The lag against the closed forms of step and ramp, over cycles, and the corners of a history."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softtact.readout.hysteresis import delayed_branches, lagged, staircase

TERMS = {"shares": (0.2, 0.1), "time_constants_s": (0.5, 10.0)}


def late(kernel):
    """sum_i g_i kernel(tau_i)."""
    return sum(g * kernel(tau) for g, tau in zip(*TERMS.values(), strict=True))


def test_a_step_creeps_as_its_prony_series():
    times = np.array([0.0, 0.0, 0.3, 1.0, 5.0, 60.0])
    felt = lagged(np.array([0.0, 1, 1, 1, 1, 1]), times, **TERMS)
    assert felt[1:] == pytest.approx(1 - late(lambda tau: np.exp(-times[1:] / tau)))


def test_a_ramp_of_constant_rate_is_exact_at_any_time_step():
    for count in [2, 7, 300]:
        times, rate = np.linspace(0, 4.0, count), 3.0
        expected = rate * (times - late(lambda tau, times=times: tau * -np.expm1(-times / tau)))
        assert lagged(rate * times, times, **TERMS) == pytest.approx(expected), count


def test_in_the_end_all_has_arrived():
    assert lagged(np.array([0.0, 2.0, 2.0]), [0, 1, 1e4], **TERMS)[-1] == pytest.approx(2.0)


def test_without_terms_the_deformation_is_felt_at_once():
    values = np.random.default_rng(0).random((6, 3))
    assert (lagged(values, np.arange(6), shares=(), time_constants_s=()) == values).all()


@given(st.lists(st.floats(0, 1), min_size=3, max_size=12), st.floats(0.01, 30))
@settings(max_examples=50, deadline=None)
def test_work_is_lost_over_every_cycle_of_a_linear_material(forces, step_s):
    path = np.interp(np.linspace(0, 1, 200), np.linspace(0, 1, len(forces) + 2), [0, *forces, 0])
    path = np.concatenate([path, np.zeros(200)])                               # until the rest has arrived
    felt = lagged(path, np.arange(400) * step_s, **TERMS)
    work = 0.5 * (path[1:] + path[:-1]) @ np.diff(felt)                        # integral of F du
    assert work >= -1e-9


def test_work_is_lost_over_a_cycle_of_a_deformation_that_stiffens_with_force():
    force = np.concatenate([np.linspace(0, 50, 60), np.linspace(50, 0, 60)])
    felt = lagged(np.sqrt(force), np.arange(120) * 0.1, **TERMS)
    assert 0.5 * (force[1:] + force[:-1]) @ np.diff(felt) > 0.01 * 50 * np.sqrt(50)


def test_a_staircase_climbs_and_descends_by_its_rate_and_holds():
    history = staircase([10.0, 30.0], rate_n_per_s=10.0, hold_s=2.0)
    assert history.load_step.tolist() == [0, 1, 1, 2, 2, 2, 2, 1, 1]
    assert history.times_s.tolist() == [0, 1, 3, 5, 7, 7, 9, 11, 13]
    assert history.load_step[history.loading].tolist() == history.load_step[history.unloading].tolist() == [1, 2]
    assert history.times_s[history.loading].tolist() == [3, 7] and history.times_s[history.unloading].tolist() == [13, 9]


def test_cycles_before_a_press_go_to_the_top_and_back_and_rest():
    history = staircase([10.0, 30.0], rate_n_per_s=10.0, hold_s=2.0, cycles_before=2, rest_s=7.0)
    assert history.load_step[:11].tolist() == [0, 1, 2, 1, 0, 0, 1, 2, 1, 0, 0]
    assert history.times_s[:12].tolist() == [0, 1, 3, 5, 6, 13, 14, 16, 18, 19, 26, 27]
    assert history.times_s[history.loading].tolist() == [29, 33]


def test_steps_of_force_take_no_time():
    history = staircase([10.0, 30.0], rate_n_per_s=np.inf, hold_s=2.0)
    assert history.times_s.tolist() == [0, 0, 2, 2, 4, 4, 6, 6, 8]


def branches(**changes):
    """Felt deformation (3,) up and down where the press gives 1, 2 and 3."""
    rules = {"rate_n_per_s": 10.0, "hold_s": 1.0} | changes
    return delayed_branches(np.array([1.0, 2.0, 3.0]), staircase([10.0, 20.0, 30.0], **rules), **TERMS)


def test_more_is_felt_on_the_way_down_than_on_the_way_up():
    up, down = branches()
    assert (down > up).all() and (up < [1, 2, 3]).all()


def test_a_slow_press_has_no_loop():
    up, down = branches(rate_n_per_s=1e-3, hold_s=1e4)
    assert up == pytest.approx([1, 2, 3], abs=1e-3) and down == pytest.approx(up, abs=1e-3)


def test_a_press_after_others_feels_what_they_left():
    assert (branches(cycles_before=3, rest_s=1.0)[0] > branches()[0]).all()
    assert branches(cycles_before=3, rest_s=1e4)[0] == pytest.approx(branches()[0])
