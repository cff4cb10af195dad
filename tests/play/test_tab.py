"""A tab without a page: the newest state is pressed, errors are sentences, recordings and long presses."""

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.play.files import Folder
from softtact.play.long_press import LongPress
from softtact.play.recorded import Recorded
from softtact.play.solver import Solver
from softtact.play.tab import Tab
from softtact.press.result import read_press


class Seen:
    """A view that keeps what it is shown."""

    def __init__(self):
        self.shown, self.refused, self.told, self.long, self.looked = [], [], [], [], 0

    def show(self, shown):
        self.shown.append(shown)

    def refuse(self, sentence):
        self.refused.append(sentence)

    def tell(self, sentence):
        self.told.append(sentence)

    def show_long(self, words, result, elastic):
        self.long.append((words, result, elastic))

    def show_recorded(self):
        self.looked += 1


def wait_for(condition):
    """Until a condition holds, for at most as long as a loaded machine may take."""
    for _ in range(600):
        if condition():
            return
        time.sleep(0.05)
    pytest.fail("it did not come")


@pytest.fixture
def seen():
    return Seen()


@pytest.fixture
def tab(state, solver, seen, tmp_path):
    """A tab whose thread runs."""
    one = Tab(state, seen, Folder(tmp_path / "out"), solver=solver)
    one.start()
    yield one
    one.close()
    one._thread.join(30)     # it shares the solver with the next test


def test_a_coarse_map_comes_first_and_the_whole_one_where_the_object_rests(tab, seen):
    wait_for(lambda: len(seen.shown) >= 2)
    assert [shown.draft for shown in seen.shown[:2]] == [True, False]


def test_states_that_came_in_during_a_press_are_passed_over_all_but_the_newest(state, seen, tmp_path):
    started, goes_on = threading.Event(), threading.Event()

    class Slow(Solver):
        def solve(self, state, *, draft=False):
            started.set()
            assert goes_on.wait(30)
            return super().solve(state, draft=True)

    tab = Tab(state, seen, Folder(tmp_path), solver=Slow())
    tab.start()
    assert started.wait(30)
    for x in (0.5, 1.0, 1.5):
        tab.change(x_mm=x)
    goes_on.set()
    wait_for(lambda: len(seen.shown) >= 2)
    tab.close()
    assert [shown.state.x_mm for shown in seen.shown[:2]] == [0.0, 1.5]


def test_a_press_that_fails_is_told_once_and_the_next_one_is_shown(tab, seen, monkeypatch):
    wait_for(lambda: seen.shown)
    tab.change(x_mm=90.0)
    wait_for(lambda: seen.refused)
    tab.change(x_mm=1.0)
    wait_for(lambda: seen.shown[-1].state.x_mm == 1.0)
    assert len(seen.refused) == 1 and "misses the sensor" in seen.refused[0]

    def fault(*_, **__):
        raise ZeroDivisionError("a fault")

    monkeypatch.setattr(tab.solver, "solve", fault)
    tab.change(x_mm=2.0)
    wait_for(lambda: len(seen.refused) == 2)
    assert "unexpected ZeroDivisionError" in seen.refused[1]


def test_the_press_that_is_shown_is_told_again_where_the_object_returns_to_it(tab, seen):
    wait_for(lambda: seen.shown and not seen.shown[-1].draft)
    tab.change(x_mm=90.0)
    wait_for(lambda: seen.refused)
    count = len(seen.shown)
    tab.change(x_mm=0.0)
    wait_for(lambda: len(seen.shown) > count)
    assert seen.shown[-1] is seen.shown[count - 1] and len(seen.refused) == 1


def test_a_recording_is_played_again_and_becomes_a_movie(tab, seen, tmp_path):
    pytest.importorskip("av")
    wait_for(lambda: seen.shown)
    assert tab.record() and tab.recording
    tab.change(force_n=20.0)
    tab.change(force_n=30.0)
    assert not tab.record()
    tab.change(force_n=1.0)
    tab.replay()
    wait_for(lambda: tab.state.force_n == 30.0)
    tab.save_movie()
    wait_for(lambda: any("Saved" in one for one in seen.told))
    assert (tmp_path / "out/recording_1.mp4").stat().st_size > 1000


def test_moments_without_a_map_show_the_frame_before_or_else_the_first(tab, state):
    beside, there = replace(state, x_mm=90.0), replace(state, x_mm=0.5)
    first, *others = tab._frames([(0.0, beside), (0.15, state), (0.35, beside), (0.55, there)])
    same = [np.array_equal(first, frame) for frame in others]
    assert same == [True] * 5 + [False] * (len(same) - 5) and len(same) >= 6
    with pytest.raises(InputError, match="misses the sensor"):
        list(tab._frames([(0.0, beside), (0.2, beside)]))


def test_a_recording_with_a_refused_moment_becomes_a_movie(tab, seen, state, tmp_path):
    pytest.importorskip("av")
    assert tab.record()
    for x in (90.0, 0.5):
        time.sleep(0.15)
        tab.change(x_mm=x)
    tab.record()
    tab.save_movie()
    wait_for(lambda: any("Saved" in one or "misses" in one for one in seen.told))
    assert "Saved" in seen.told[-1] and (tmp_path / "out/recording_1.mp4").stat().st_size > 1000


def test_a_recording_that_has_its_longest_time_says_so(tab, seen, monkeypatch):
    tab.record()
    monkeypatch.setattr("softtact.play.tab.LONGEST_S", -1.0)
    tab.change(force_n=20.0)
    assert "what you change now is not kept" in seen.told[-1]


def test_a_recording_of_a_real_sensor_plays_and_presses_with_its_force(tab, seen):
    recorded = Recorded("real.csv", np.array([0.0, 0.05, 0.3]), np.zeros((3, 7, 4)), np.array([5.0, 7.5, 12.5]))
    tab.take_recorded(recorded)
    assert tab.state.force_n == 5.0
    assert tab.play_recorded()
    wait_for(lambda: not tab.plays_recorded)
    assert tab.recorded_s == 0.3 and tab.state.force_n == 12.5 and seen.looked > 2
    tab.look_at(0.1)
    assert tab.state.force_n == 7.5
    wait_for(lambda: seen.shown and seen.shown[-1].result.normal_force_n[-1] == 7.5)


def test_without_a_recording_replay_says_what_to_do(tab, seen):
    tab.replay()
    wait_for(lambda: seen.told)
    assert "press Record" in seen.told[0]


def test_saved_files_hold_the_press_that_is_shown(tab, seen, tmp_path):
    wait_for(lambda: seen.shown and not seen.shown[-1].draft)
    tab.save()
    wait_for(lambda: seen.told)
    tab.save()
    wait_for(lambda: len(seen.told) == 2)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {f"press_{k}{end}" for k in (1, 2) for end in (".txt", "_elastic.nc", "_elastic.png")}
    kept = read_press(tmp_path / "out/press_2_elastic.nc")
    np.testing.assert_array_equal(kept.deformation_map_mm, seen.shown[-1].result.deformation_map_mm)
    assert seen.shown[-1].press.command in (tmp_path / "out/press_1.txt").read_text()


def test_a_long_result_is_saved_with_the_command_that_made_it_and_over_no_other_file(tab, seen, tmp_path):
    wait_for(lambda: seen.shown and not seen.shown[-1].draft)
    shown = tab.shown
    for number, model in ((1, "foundation"), (2, "elastic")):     # auto may choose the elastic one
        tab._long_of = tab.state, replace(shown.press, model="auto"), replace(shown.result, model=model)
        tab.save()
        wait_for(lambda number=number: len(seen.told) == number)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {f"press_{end}" for end in ("1.txt", "1_elastic.nc", "1_elastic.png", "1_foundation.nc", "1_foundation.png",
                                                "2.txt", "2_elastic.nc", "2_elastic.png", "2_elastic_long.nc",
                                                "2_elastic_long.png")}
    for name, model in (("1_foundation", "auto"), ("2_elastic_long", "auto"), ("2_elastic", "elastic")):
        assert f"--model {model} " in read_press(tmp_path / f"out/press_{name}.nc").attributes["command"]
        assert f"--model {model} " in (tmp_path / f"out/press_{name[0]}.txt").read_text()


def test_a_long_press_is_started_compared_and_leaves_no_files(tab, seen, tmp_path, monkeypatch):
    """The elastic model stands for a long one: the difference to itself is nothing."""
    monkeypatch.setattr(tab.solver.bench(tab.state.sensor), "models", ("elastic",))
    tab.run_long("elastic")
    wait_for(lambda: any(result is not None for _, result, _ in seen.long))
    words, result, elastic = next(one for one in seen.long if one[1] is not None)
    assert words.startswith("elastic, ") and seen.long[0][0] == "elastic: starting"
    np.testing.assert_allclose(result.deformation_map_mm, elastic.result.deformation_map_mm, atol=1e-9)
    wait_for(lambda: not list((tmp_path / "out").iterdir()))


def test_a_long_press_that_stopped_is_shown_as_that_and_not_taken_for_the_press(tab, seen, state, solver, monkeypatch):
    taken, bench = [], tab.solver.bench(state.sensor)
    reached = solver.solve(state, draft=True).result
    stopped = SimpleNamespace(running=False, seconds=1.0, stopped="the last step was not reached.", result=lambda: reached,
                              press=SimpleNamespace(model="elastic"), close=lambda: None)
    monkeypatch.setattr("softtact.play.tab.LongPress", lambda *_: stopped)
    monkeypatch.setattr(bench, "models", ("elastic",))
    monkeypatch.setattr(bench, "take", lambda *pressed: taken.append(pressed))
    tab.run_long("elastic")
    wait_for(lambda: any(result is not None for _, result, _ in seen.long))
    assert seen.long[-1][0] == "elastic, stopped after load step 1: the last step was not reached." and seen.long[-1][2] is None
    assert not taken and tab._long_of is None


def test_the_command_of_a_long_press_says_why_it_stopped(solver, state, tmp_path):
    long = LongPress(replace(solver.solve(state, draft=True).press, load=-1.0), tmp_path)
    try:
        assert "force" in long.stopped and not long.running
    finally:
        long.close()


def test_a_closed_tab_ends_its_long_press(tab, seen, tmp_path, monkeypatch):
    monkeypatch.setattr(tab.solver.bench(tab.state.sensor), "models", ("elastic",))
    tab.run_long("elastic")
    wait_for(lambda: tab._long is not None)
    process = tab._long._process
    tab.close()
    wait_for(lambda: process.poll() is not None and not list((tmp_path / "out").iterdir()))


def test_a_long_press_that_is_refused_has_the_commands_sentence(solver, state, tmp_path):
    press = replace(solver.solve(state, draft=True).press, model="foundation", load="fz -5; x 1")
    long = LongPress(press, tmp_path)
    try:
        with pytest.raises(Exception, match="^model='foundation': the foundation model presses straight down by force only"):
            long.result()
    finally:
        long.close()
    assert not list(tmp_path.iterdir())


def test_a_long_model_gets_slide_and_twist_as_a_motion(tab, state):
    moved = replace(state, slide_mm=(1.0, 0.0), twist_deg=10.0)
    tab.long_model = "solid"
    press = tab.long_press(moved)
    assert press.load == "fz -10; x 1 in 5; rz 10 in 3" and press.pose[:2] == pytest.approx((-3.0, 2.0))
    tab.long_model = "foundation"
    assert tab.long_press(moved).load == 10.0


def test_a_long_press_by_depth_has_the_force_of_the_whole_map(tab, seen, state, solver):
    by_depth = replace(state, load_by="depth", depth_mm=0.5)
    tab.close()
    tab._thread.join(30)
    tab.shown = solver.solve(by_depth, draft=True)
    tab.long_model = "foundation"
    press = tab.long_press(by_depth)
    assert press.load == solver.solve(by_depth).press.load and press.load != tab.shown.press.load


def test_a_twist_is_not_given_to_the_hyperelastic_model(tab, state):
    tab.long_model = "hyperelastic"
    assert tab.long_press(replace(state, slide_mm=(1.0, 0.0))).load == "fz -10; x 1 in 5"
    with pytest.raises(InputError, match="does not twist an object; set the twist to 0, or run the solid model"):
        tab.long_press(replace(state, twist_deg=10.0))
