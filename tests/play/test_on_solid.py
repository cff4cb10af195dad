"""Solids on the page: the object only touches until the solid model has run, which is told; then its press is shown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.play import pictures
from softtact.play.files import Folder
from softtact.play.tab import Tab


def points_at_end(solver, shown):
    """Corners of the object's mesh where the page draws it."""
    return Pose(shown.end[0], Rotation.from_quat(shown.end[1], scalar_first=True)).apply(solver.mesh(shown.state.object).vertices)


def test_an_object_over_the_middle_of_a_solid_touches_it_before_the_model_has_run(on_block):
    state, solver = on_block
    shown = solver.solve(state)
    lowest = points_at_end(solver, shown)[np.argmin(points_at_end(solver, shown)[:, 2])]
    assert lowest == pytest.approx([26.0, 28.0, 6.0], abs=0.01) and not shown.done and not shown.draft
    assert pictures.caption(shown.result) == "at first touch, not pressed yet"
    assert (shown.result.displacement_mm == 0).all() and (next(pictures.places_of(shown.result)).values == 0).all()


def test_the_press_of_a_long_model_is_shown_with_the_object_where_it_pressed(on_block, pressed_block):
    state, solver = on_block
    solver.bench(state.sensor).take(solver.solve(state).press, pressed_block)
    shown = solver.solve(state)
    assert shown.stage == "whole" and shown.result is pressed_block and shown.press.load == "z -0.5"
    solid = pressed_block.solid
    apart, _ = cKDTree(points_at_end(solver, shown)).query(solid.object_points_mm + solid.object_displacement_mm[-1])
    assert apart.max() < 1e-6
    assert not solver.solve(replace(state, x_mm=0.5)).done


def test_a_solid_that_was_pressed_at_positive_x_is_deepest_there_in_scene_and_picture(pressed_block):
    surface = pictures.surface_mesh(pressed_block)
    assert len(surface.vertices) < len(pressed_block.solid.mesh.points)      # none inside
    assert surface.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-9) and surface.bounds[1, 2] > 5.9
    bright = surface.vertices[surface.visual.vertex_colors[:, :3].astype(int).sum(axis=1).argmax()]
    assert bright[:2] == pytest.approx([26.0, 28.0], abs=1.0)
    tiles = pictures.taxel_mesh(pressed_block)
    assert tiles.bounds[0, 0] > surface.bounds[1, 0]
    lit = tiles.vertices[tiles.visual.vertex_colors[:, :3].astype(int).sum(axis=1).argmax(), 0]
    assert lit < tiles.vertices[:, 0].mean()      # the point below the ball, not the one beside it


def test_an_object_beside_a_solid_is_refused_in_a_sentence(on_block):
    state, solver = on_block
    with pytest.raises(InputError, match="misses the face 'z1' of block; move it over the sensor"):
        solver.solve(replace(state, x_mm=30.0))


def test_a_press_that_has_not_run_is_not_saved(on_block, tmp_path):
    state, solver = on_block

    class Told(list):
        tell = list.append

    told = Told()
    tab = Tab(state, told, Folder(tmp_path), solver=solver)
    tab._guarded(tab._save, told.tell)
    assert "This press is not whole: the solid model has not run for it; press Run" in told[0] and not list(tmp_path.iterdir())


def test_a_solid_that_rests_is_pressed_once_by_its_long_model(on_block, pressed_block, tmp_path, monkeypatch):
    state, solver = on_block
    tab = Tab(state, None, Folder(tmp_path), solver=solver)
    tab.long_on_release, tab.shown = True, solver.solve(state)
    monkeypatch.setattr("softtact.play.tab._RESTS_S", -1.0)
    for held, wanted in ((True, None), (False, state)):
        tab.held = held
        tab._next_press()
        assert tab._wanted == wanted
    tab._wanted = None      # it started
    tab._next_press()
    assert tab._wanted is None
    assert tab.long_press(state) == tab.shown.press


def test_a_place_that_was_pressed_is_not_pressed_again_where_the_object_comes_back(on_block, pressed_block, tmp_path, monkeypatch):
    state, solver = on_block
    solver.bench(state.sensor).take(solver.solve(state).press, pressed_block)
    tab, started = Tab(state, SimpleNamespace(show_long=lambda *_: None), Folder(tmp_path), solver=solver), []

    class Counted:
        running, seconds, progress, press = True, 0.0, "", SimpleNamespace(model="solid")

        def __init__(self, press, _):
            started.append(press)

        def close(self):
            pass

    monkeypatch.setattr("softtact.play.tab._RESTS_S", -1.0)
    monkeypatch.setattr("softtact.play.tab.LongPress", Counted)
    tab.long_on_release = True
    for there, count in ((state, 0), (replace(state, x_mm=0.5), 1)):
        tab.state = there
        tab.shown = solver.solve(there)
        tab._next_press()
        tab._next_look()
        assert len(started) == count
