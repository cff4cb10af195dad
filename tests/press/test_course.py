"""How a press goes about its work: time limits, interruptions, steps as they are reached, and what auto falls back on."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.bodies import COARSE, SMALL
from support.laws import LAWS

from softtact.errors import ConvergenceError, InputError, TimeLimitError
from softtact.models.hyperelastic.newton import _Press
from softtact.press import choice
from softtact.press.sensor import Sensor
from softtact.words import plain

BALL = trimesh.creation.icosphere(subdivisions=3, radius=3.0)


@pytest.fixture(scope="module")
def sensor():
    return Sensor(SMALL, LAWS, mesh=COARSE)


def test_each_step_is_told_as_it_is_reached_with_those_before(sensor):
    seen = []
    whole = sensor.press(BALL, force_n=[0.5, 1.0, 2.0], model="hyperelastic", label="", on_step=seen.append)
    assert [result.normal_force_n.tolist() for result in seen] == [[0.5], [0.5, 1.0]]
    np.testing.assert_array_equal(seen[1].deformation_map_mm, whole.deformation_map_mm[:2])


def stop_after(monkeypatch, error, newtons):
    """Let an error come up in the iteration of that number."""
    accepted, count = _Press.accepted, iter(range(1, 10_000))

    def counted(self, state, trial):
        accepted(self, state, trial)
        if next(count) == newtons:
            raise error

    monkeypatch.setattr(_Press, "accepted", counted)


def test_an_interruption_of_the_keyboard_takes_the_steps_before_with_it(sensor, monkeypatch):
    iterations = int(sensor.press(BALL, force_n=[0.5], model="hyperelastic", label="").iterations.sum())
    stop_after(monkeypatch, KeyboardInterrupt(), iterations + 6)
    with pytest.raises(KeyboardInterrupt) as caught:
        sensor.press(BALL, force_n=[0.5, 5.0], model="hyperelastic", label="")
    assert caught.value.result.normal_force_n.tolist() == [0.5]


def test_a_press_ends_at_its_time_limit_and_says_how_far_it_was(sensor):
    with pytest.raises(TimeLimitError, match=r"The time limit of 1e-06 s was reached: .*; the steps before are kept") as caught:
        sensor.press(BALL, force_n=[0.5], model="hyperelastic", label="", time_limit_s=1e-6)
    assert caught.value.result is None


def test_a_heartbeat_tells_force_iteration_residual_and_time_on_one_line(sensor, capsys, monkeypatch):
    monkeypatch.setattr("softtact.progress._IN_A_LOG_S", 0.0)
    sensor.press(BALL, force_n=[0.5], model="hyperelastic", label="ball")
    line = next(line for line in capsys.readouterr().err.splitlines() if "iteration" in line)
    assert line.startswith("ball: ") and "N, iteration" in line and "largest unbalanced force" in line and line.endswith(" s")


# --- auto ---


@pytest.fixture
def fakes(monkeypatch):
    """Models that answer at once: what they are set to, and which were asked."""
    base = Sensor(SMALL, LAWS, mesh=COARSE).press(BALL, force_n=[0.5], model="elastic", label="")
    base = replace(base, frustum_compression_mm=np.array([0.01]), expected_error_mm=np.array([np.nan]), attributes={})
    state = {name: replace(base, model=name) for name in ("elastic", "foundation", "hyperelastic")}

    def press(name):
        def made(*_):
            if isinstance(state[name], Exception):
                raise state[name]
            return state[name]
        return made

    monkeypatch.setattr(choice, "PRESSES", {name: press(name) for name in state})
    return state


def chosen(**options):
    return Sensor(SMALL, LAWS, mesh=COARSE).press(BALL, force_n=[0.5], label="", **options)


def test_auto_takes_the_cheapest_model_within_the_tolerance_by_default(fakes):
    result = chosen()
    assert result.model == "elastic" and result.expected_error_mm[0] < 0.01


def test_a_model_is_taken_only_where_nine_of_ten_presses_like_it_are_within_the_tolerance(fakes):
    expected = chosen().expected_error_mm[0]
    times = choice.INTERVALS["elastic"][1]
    assert times > 1.0
    assert chosen(tolerance_mm=1.01 * times * expected).model == "elastic"
    between = chosen(tolerance_mm=0.5 * (1.0 + times) * expected)
    assert between.model != "elastic"
    assert f"elastic {plain(expected)} (90 % below {plain(times * expected)}) mm" in between.selection_reason
    assert f"asked for {plain(0.5 * (1.0 + times) * expected)} mm" in between.selection_reason


def test_a_model_that_does_not_hold_is_not_taken_whatever_error_it_tells(fakes):
    fakes["elastic"] = replace(fakes["elastic"], within_validity=np.zeros(1, dtype=np.int8))
    result = chosen()
    assert result.model == "foundation" and "the elastic model does not hold from 0.5 N on" in result.selection_reason


def test_the_first_force_that_a_model_does_not_hold_for_is_said(fakes):
    valid = np.array([1, 0], dtype=np.int8)
    fakes["elastic"] = replace(fakes["elastic"], normal_force_n=np.array([0.3, 0.5]), within_validity=valid,
                               validity_reason=np.array(["", "too deep"]))
    assert "the elastic model does not hold from 0.5 N on (too deep)" in chosen().selection_reason


def test_a_fast_model_by_itself_states_the_interval_of_its_own(sensor):
    for model, name in (("elastic", "elastic alone"), ("foundation", "foundation")):
        told = choice.with_expected_error(sensor, replace(
            sensor.press(BALL, force_n=[0.5], model="elastic", label=""), model=model, attributes={},
            frustum_compression_mm=np.array([0.01]), expected_error_mm=np.array([np.nan]))).attributes
        assert (told["expected_error_times_low"], told["expected_error_times_high"]) == choice.INTERVALS[name]
        assert told["expected_error_calibrated_on"] == "coro"


def test_a_model_that_fails_falls_through_to_the_next(fakes):
    fakes["foundation"] = ConvergenceError("the corrections diverge")
    result = chosen()
    assert result.model == "hyperelastic" and "the foundation model fails: the corrections diverge" in result.selection_reason


def test_where_no_model_holds_the_answer_says_so(fakes):
    for name, result in fakes.items():
        fakes[name] = replace(result, within_validity=np.zeros(1, dtype=np.int8))
    result = chosen()
    assert result.model == "hyperelastic" and "none serves" in result.selection_reason


def test_the_papers_rule_is_taken_where_it_is_asked_for(fakes):
    assert "the paper's rule" in chosen(policy="paper").selection_reason


def test_a_fast_model_states_the_interval_of_its_error_and_the_hyperelastic_one_none(fakes):
    told = {name for name in chosen().attributes if "expected_error" in name}
    assert told == {"expected_error_times_low", "expected_error_times_high", "expected_error_calibrated_on"}
    fakes["elastic"] = fakes["foundation"] = ConvergenceError("not reached")
    assert not any("expected_error" in name for name in chosen().attributes)


def test_what_the_fast_models_took_is_off_the_time_limit(fakes, monkeypatch):
    left = []
    clock = [100.0]
    monkeypatch.setattr(choice.time, "monotonic", lambda: clock[0])

    def one_second_later(name):
        clock[0] += 1.0
        return fakes[name]

    slow = {name: lambda *_, name=name: one_second_later(name) for name in ("elastic", "foundation")}
    fakes["elastic"] = fakes["foundation"] = replace(fakes["elastic"], within_validity=np.zeros(1, dtype=np.int8))
    monkeypatch.setattr(choice, "PRESSES", slow | {
        "hyperelastic": lambda sensor, placed, forces, course: (left.append(course.time_limit_s), fakes["hyperelastic"])[1]})
    chosen(time_limit_s=5.0)
    assert left == [3.0]


# --- what a press takes ---


def test_a_file_and_a_matrix_press_as_a_mesh_and_a_pose_do(sensor, tmp_path):
    BALL.export(tmp_path / "ball.stl")
    matrix = trimesh.transformations.euler_matrix(0.1, 0.2, 0.3)
    matrix[:3, 3] = [0.4, -0.2, 3.0]
    from_file = sensor.press(tmp_path / "ball.stl", unit="mm", pose=matrix, force_n=0.5, model="elastic", label="")
    six = [0.4, -0.2, 3.0, *np.degrees([0.1, 0.2, 0.3])]
    given = sensor.press(BALL, pose=six, force_n=0.5, model="elastic", label="")
    np.testing.assert_allclose(from_file.deformation_map_mm, given.deformation_map_mm, atol=1e-6)     # a file's single precision


def test_a_file_without_its_unit_and_a_matrix_that_scales_are_refused(sensor, tmp_path):
    BALL.export(tmp_path / "ball.stl")
    with pytest.raises(InputError, match="no unit is stated, and the file holds none; state one of mm"):
        sensor.press(tmp_path / "ball.stl", force_n=0.5)
    with pytest.raises(InputError, match="is no rigid motion"):
        sensor.press(BALL, pose=np.diag([2.0, 2.0, 2.0, 1.0]), force_n=0.5)


@pytest.mark.parametrize("model", ["elastic", "hyperelastic"])
def test_the_indentation_counts_from_first_touch_however_high_the_pose_is(sensor, model):
    low, high = (sensor.press(BALL, pose=[0, 0, z, 0, 0, 0], force_n=0.5, model=model, label="") for z in (3.0, -4.0))
    assert low.indentation_mm[0] == pytest.approx(high.indentation_mm[0], rel=1e-4) and 0 < low.indentation_mm[0] < 1
    assert high.within_validity.all()


def test_many_presses_take_matrices_as_single_ones_do(sensor):
    matrix = np.eye(4)
    matrix[:3, 3] = [0.3, 0.2, 3.0]
    one, = sensor.press_many(BALL, [matrix], force_n=0.5, model="elastic", workers=1, device="cpu")
    single = sensor.press(BALL, pose=matrix, force_n=0.5, model="elastic", label="")
    np.testing.assert_allclose(one.deformation_map_mm, single.deformation_map_mm, rtol=0, atol=2e-6)     # mm
    assert one.expected_error_mm[0] == pytest.approx(single.expected_error_mm[0], abs=2e-6) and one.expected_error_mm[0] > 0
