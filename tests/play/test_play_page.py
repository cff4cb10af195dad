"""The page's widgets without a browser: stand-ins keep what is shown, and change as a user changes them."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser")

from softtact.errors import InputError
from softtact.play.files import Folder
from softtact.play.page import Page
from softtact.play.recorded import Recorded
from softtact.play.state import Object, free_name
from softtact.play.tab import Tab


class Handle(SimpleNamespace):
    """A widget or a part of the scene."""

    def on_update(self, handler):
        self.handler = handler
        return handler

    on_click = on_upload = on_trigger = on_update

    def change(self, **fields):
        """What a user does."""
        vars(self).update(fields)
        self.handler(SimpleNamespace(client=object()))


class Gui:
    """Makes handles; the last of the positional arguments is a widget's first value."""

    def add_dropdown(self, _, options, initial_value=None, **__):
        return Handle(options=options, value=initial_value or options[0])

    def add_slider(self, _, least, most, step, value, **__):
        assert least <= value <= most
        return Handle(min=least, max=most, value=value)

    def add_button_group(self, _, options):
        return Handle(value=options[0])

    def add_folder(self, *_, **__):
        return nullcontext()

    def __getattr__(self, _):
        return lambda *arguments, **fields: Handle(**fields | {"value": arguments[-1] if arguments else None})


@pytest.fixture
def page_of(folder, tmp_path, solver, monkeypatch):
    """A page of a state, whose thread does not run."""
    monkeypatch.setattr(Tab, "start", lambda self: None)
    monkeypatch.setattr("softtact.play.tab.Solver", lambda: solver)

    def page_of(state):
        client = SimpleNamespace(gui=Gui(), scene=Gui(), atomic=nullcontext, camera=SimpleNamespace(aspect=1.5))
        return Page(client, state, {"ball": state.object}, [state.sensor, str(folder / "gel.yaml"), "nowhere"],
                    Folder(tmp_path / "out"))

    return page_of


@pytest.fixture
def page(page_of, state):
    return page_of(state)


def test_a_sensor_that_cannot_be_loaded_leaves_the_panel_on_the_one_that_is_pressed(page, state):
    page._sensor.change(value="nowhere")
    assert page._sensor.value == state.sensor == page.tab.state.sensor and page._panel_of == state.sensor
    assert "no sensor" in page._numbers.content


def test_a_skin_of_small_forces_gets_a_panel_and_its_keys_stay_within_its_forces(page_of, on_skin, solver, monkeypatch):
    state, _ = on_skin
    bench = solver.bench(state.sensor)
    monkeypatch.setattr(bench, "force_range_n", (0.0, 2.0))
    monkeypatch.setattr(bench, "first_force_n", 0.08)
    page = page_of(replace(state, force_n=10.0))
    assert page.tab.state.force_n == 0.08 == page._force.min and page._force.max == 2.0
    assert page._loaded(page.tab.state, 1 / 1.1) == {"force_n": 0.08}
    page._sensor.change(value=page._sensor.options[1])
    assert page._force.min == 0.1 == page.tab.state.force_n


def test_a_press_that_ends_late_resets_no_widget_that_changed_since(page, state, solver, folder):
    late = solver.solve(state, draft=True)
    page._slide_y.change(value=2.0)
    page.show(late)
    assert page._slide_y.value == 2.0
    page._slide_x.change(value=1.0)
    assert page.tab.state.slide_mm == (1.0, 2.0)
    page._sensor.change(value=str(folder / "gel.yaml"))
    page.show(late)
    assert page._panel_of == page._sensor.value == str(folder / "gel.yaml")


def test_a_long_model_that_is_refused_is_told(page):
    page._long.value = "none"
    page._run_long()
    assert "The model 'none' is unknown" in page._told.content


def test_words_and_picture_of_an_older_long_press_are_marked_and_hidden(page, state, solver):
    shown, page.tab.long_state = solver.solve(state, draft=True), state
    page.show_long("elastic, 3 s", shown.result, shown)
    assert page._difference.visible and page._long_words.content.startswith("**elastic, 3 s**")
    page.tab.change(x_mm=1.0)
    page.show(solver.solve(page.tab.state, draft=True))
    assert page._long_words.content.startswith("Of an earlier press: **elastic, 3 s**")
    page.tab.long_state = page.tab.state
    page.show_long("elastic: starting", None, None)
    assert page._long_words.content == "elastic: starting" and not page._difference.visible


def test_a_file_that_is_taken_again_in_another_unit_is_another_object(page, state, solver):
    content = state.object.path.read_bytes()
    for unit in ("mm", "inch", "mm"):
        page._unit.value = unit
        page._upload.value = SimpleNamespace(name="part.stl", content=content)
        page._take_upload()
        if unit == "mm":
            first = solver.solve(page.tab.state, draft=True)
    page.show(first)
    assert page._object.options == ("ball", "part.stl", "part.stl (inch)") and page._object.value == "part.stl"


def test_names_of_objects_are_free():
    old, other = Object(Path("a/part.stl"), "mm"), Object(Path("b/part.stl"), "mm")
    names = {"part.stl": old}
    assert free_name(names, old) == "part.stl" and free_name(names, replace(old, unit="inch")) == "part.stl (inch)"
    names["part.stl (mm)"] = replace(other, unit=None)
    assert free_name(names, other) == "part.stl, 2" and free_name(names, replace(old, unit=None)) == "part.stl, 2"


def test_a_recording_that_is_taken_in_the_page_is_of_the_same_finger(page, monkeypatch):
    read, kept = [], Recorded("real.csv", np.array([0.0, 1.0]), np.zeros((2, 7, 4)), None, 1)

    def fake(path, *, finger):
        read.append((path.name, finger))
        raise InputError("not read.")

    page.tab.take_recorded(kept)
    monkeypatch.setattr(Recorded, "read", fake)
    page._take_recording(SimpleNamespace(name="other.csv", content=b"0"))
    assert read == [("other.csv", 1)]
