"""Motions: what they say, read from one line, and refuse."""

import numpy as np
import pytest

from softtact.contact.motion import Motion, MotionStep
from softtact.errors import InputError


def test_a_line_says_what_the_calls_do():
    by_calls = Motion().press(depth_mm=1.0).slide(x_mm=1.0, steps=2)
    assert Motion.parse("z -1.0; x 1.0 in 2") == by_calls
    assert Motion.parse("fz -20") == Motion().press(force_n=20)
    assert Motion.parse("z -0.5 x 0.2; rz 5") == Motion().step(ways={"z": -0.5, "x": 0.2}).step(ways={"rz": 5.0})


def test_a_line_says_how_long_steps_take_and_what_is_held():
    assert Motion.parse("fz -20 over 0.5; hold 60 in 3") == Motion().press(force_n=20, over_s=0.5).hold(60, steps=3)
    assert Motion.parse("z -1 over 2 s in 4") == Motion.parse("z -1 in 4 over 2s")
    timed = Motion.parse("z -1.0 in 4 over 2s; hold 1e1 s")
    np.testing.assert_allclose(timed.times_s, [0.5, 1.0, 1.5, 2.0, 12.0])
    assert Motion.parse("z -1").times_s is None


def test_depths_count_from_first_touch_and_ways_from_where_a_step_begins():
    motion = Motion().press(depth_mm=[0.2, 0.5]).press(depth_mm=0.3)
    assert [step.ways["z"] for step in motion.steps] == pytest.approx([-0.2, -0.3, 0.2]) and motion.depth_mm == pytest.approx(0.3)


def test_a_motion_stays_as_it_is_when_a_longer_one_is_made_of_it():
    start = Motion().press(force_n=5)
    start.slide(x_mm=1.0)
    assert start.steps == (MotionStep(loads={"z": -5.0}),)


def test_only_straight_presses_by_force_have_forces():
    assert Motion().press(force_n=[5, 20]).forces_n == [5, 20]
    assert Motion().press(force_n=5).slide(x_mm=1).forces_n is None and Motion().forces_n is None
    assert Motion().press(depth_mm=1).straight and not Motion().slide(y_mm=1).straight


def test_the_places_of_a_motion_are_no_farther_apart_than_asked():
    places = Motion().press(depth_mm=0.1).slide(x_mm=1.0).slide(y_mm=-0.4).offsets_mm(at_most_mm=0.3)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= 0.3 + 1e-12
    np.testing.assert_allclose(places[-1], [1.0, -0.4])


def test_steps_that_are_no_motion_are_refused_in_one_sentence():
    for make, sentence in [
        (lambda: Motion().press(), "either force_n or depth_mm"),
        (lambda: Motion().press(force_n=-5), "force_n=-5 does not press"),
        (lambda: Motion().press(depth_mm=float("nan")), "depth_mm=nan is no number"),
        (lambda: Motion().slide(x_mm=1.0, steps=0), "steps=0 is not possible"),
        (lambda: Motion().step(ways={"w": 1.0}), "the freedom 'w' is unknown"),
        (lambda: Motion().step(ways={"z": 1.0}, loads={"z": 1.0}), "'z' is prescribed and loaded in one step"),
        (lambda: Motion().press(force_n=5).press(depth_mm=1.0), "a depth after a press by force is not known"),
        (lambda: Motion.parse("z -1; aside 2"), "the step 'aside 2' is not understood"),
        (lambda: Motion.parse("q 1"), "'q' in the step 'q 1' is no freedom"),
        (lambda: Motion.parse(" ; "), "there is no step in"),
        (lambda: Motion.parse("z -1 over 0"), "a duration of 0 s is not possible"),
        (lambda: Motion.parse("hold -2"), "a duration of -2 s is not possible"),
        (lambda: Motion.parse("hold"), "the step 'hold' is not understood"),
        (lambda: Motion.parse("z -0.1, z -0.2"), "the step 'z -0.1, z -0.2' names 'z' twice; keep one, or put a semicolon"),
        (lambda: Motion.parse("z -1; fz -1 fz -2"), "names 'fz' twice"),
        (lambda: Motion.parse("z -1; rz 1e400"), "rz=inf is no number; give a finite one"),
        (lambda: Motion().step(loads={"z": float("nan")}), "z=nan is no number; give a finite one"),
        (lambda: Motion().slide(x_mm=1.0, steps=2.5), "steps=2.5 is not possible; give a whole number from 1 on"),
        (lambda: Motion.parse("z -1 over 1; x 1").times_s, "step 2 of 2 has no duration and others have")]:
        with pytest.raises(InputError, match=sentence) as caught:
            make()
        assert "\n" not in str(caught.value), make


@pytest.mark.parametrize(("make", "sentence"), [
    (lambda: Motion.parse("x 1 in 00"), "the step 'x 1 in 00' is not understood"),
    (lambda: Motion.parse(5), "5 is no text; write steps like"),
    (lambda: Motion().press(force_n=[]), "Motion.press: force_n is empty; give at least one number"),
    (lambda: Motion().press(depth_mm=[], over_s=1.0), "depth_mm is empty; give at least one number"),
    (lambda: Motion().press(force_n="5 N"), "force_n='5 N' is no number; give a finite one"),
    (lambda: Motion().press(force_n=[[5, 20]]), r"force_n=\[5, 20\] is no number"),
    (lambda: Motion().press(force_n=[[5], [5, 20]]), r"force_n=\[5\] is no number"),
    (lambda: Motion().slide(x_mm="1"), "x_mm='1' is no number"),
    (lambda: Motion().slide(x_mm=1, steps=float("nan")), "steps=nan is not possible; give a whole number from 1 on"),
    (lambda: Motion().slide(x_mm=1, steps="2"), "steps=2 is not possible"),
    (lambda: Motion().hold("long"), "over_s='long' is no number"),
    (lambda: Motion().step(ways={"x": None}), "x=None is no number"),
    (lambda: Motion().step(ways={"x": "1"}), "x='1' is no number"),
    (lambda: MotionStep(ways=None), "ways=None names no freedoms; give a dictionary"),
    (lambda: MotionStep(ways={"z": float("nan")}), "z=nan is no number; give a finite one"),
    (lambda: MotionStep(loads={"w": 1.0}), "the freedom 'w' is unknown"),
    (lambda: MotionStep(seconds=0.0), "a duration of 0 s is not possible"),
])
def test_what_is_no_number_no_count_and_no_freedom_is_refused_in_one_sentence(make, sentence):
    with pytest.raises(InputError, match=sentence):
        make()


def test_numbers_of_any_library_are_numbers():
    for force in (np.float32(5), np.array(5), np.array([5]), [np.int64(5)], (5,), iter([5])):
        assert Motion().press(force_n=force).forces_n == [5.0]
