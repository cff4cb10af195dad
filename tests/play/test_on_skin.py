"""Robot skins on the page: coarse while the object moves, whole after the long model, taxels coloured by their counts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.play import pictures
from softtact.play.bench import force_span_n


@pytest.fixture(scope="module")
def whole(on_skin):
    """The result by the Python lines that the page shows."""
    state, solver = on_skin
    names = {}
    exec(solver.solve(state).press.python, names)
    return names["result"]


def test_a_coarse_press_reads_nearly_what_the_whole_one_does(on_skin, whole):
    state, solver = on_skin
    shown = solver.solve(state)
    coarse, fine = (next(pictures.places_of(result)).values for result in (shown.result, whole))
    assert shown.stage == "coarse" and fine.max() > 10
    assert np.abs(coarse - fine).max() < 0.3 * fine.max()


def test_a_long_model_makes_the_press_whole(on_skin, whole):
    state, solver = on_skin
    there = replace(state, x_mm=0.1)
    solver.bench(state.sensor).take(solver.solve(there).press, whole)
    assert solver.solve(there).stage == "whole" and solver.solve(there).result is whole


def test_the_command_of_a_whole_press_names_the_model_that_made_it(on_skin, whole):
    state, solver = on_skin
    there = replace(state, x_mm=0.2)
    first = solver.solve(there)
    assert "--model elastic" in first.press.command
    solver.bench(state.sensor).take(replace(first.press, model="solid"), replace(whole, model="solid"))
    assert "--model solid" in solver.solve(there).press.command


def test_the_force_that_the_page_begins_with_is_within_the_forces_that_it_offers(on_skin, solver, state):
    skin = on_skin[1].bench(on_skin[0].sensor)
    small = SimpleNamespace(first_force_n=0.08, force_range_n=[0, 2])
    for bench in (skin, small, solver.bench(state.sensor)):
        least, most = force_span_n(bench)
        assert 0 < least <= bench.first_force_n <= most == bench.force_range_n[1]


def test_a_skin_is_pressed_to_a_depth_by_the_force_that_it_needs(on_skin):
    state, solver = on_skin
    shown = solver.solve(replace(state, load_by="depth", depth_mm=0.4))
    assert shown.result.indentation_mm[-1] == pytest.approx(0.4, rel=5e-3)
    assert shown.press.load == pytest.approx(shown.result.normal_force_n[-1])


def test_an_object_is_shown_where_it_presses_the_skin(on_skin):
    state, solver = on_skin
    shown = solver.solve(replace(state, x_mm=3.0))
    points = Pose(shown.end[0], Rotation.from_quat(shown.end[1], scalar_first=True)).apply(solver.mesh(state.object).vertices)
    lowest, (x, y, top) = points[points[:, 2].argmin()], solver.bench(state.sensor).middle_mm
    assert lowest == pytest.approx([x + 3.0, y, top - shown.result.indentation_mm[-1]], abs=2e-2)


def test_the_taxel_below_the_object_is_the_brightest_in_scene_and_picture(on_skin):
    state, solver = on_skin
    result = solver.solve(replace(state, x_mm=10.0, y_mm=-5.66)).result     # over the last taxel, below to the right
    (places,) = pictures.places_of(result)
    assert places.values.argmax() == len(places.values) - 1 and places.triangles_mm.shape == (1, 3, 2)
    tiles, sensor = pictures.taxel_mesh(result), pictures.surface_mesh(result)
    bright = tiles.visual.vertex_colors[:, :3].astype(int).sum(axis=1)
    on_taxels = tiles.vertices[:, 2] == 0
    lit = tiles.vertices[on_taxels & (bright == bright[on_taxels].max())].mean(axis=0)
    assert lit[:2] - [sensor.bounds[0, 0] + 1.15 * 30, 0] == pytest.approx(places.xy_mm[-1], abs=1e-6)
    lit = np.abs(pictures.board(result).astype(int) - pictures.colours("inferno")[-1]).sum(axis=2) < 9
    y, x = np.nonzero(lit[:, 336:])      # of the second panel, 277 px high
    assert len(x) > 100 and (np.median(x), np.median(y)) == pytest.approx((8 + 320 * 25 / 30, 34 + 277 * (1 - 3 / 26)), abs=12)


def test_modules_are_seen_from_above_whichever_way_their_corners_run():
    for corners in (np.array([[0, 0], [1, 0], [0, 1]]), np.array([[0, 0], [0, 1], [1, 0]])):
        assert pictures._polygon(np.zeros((1, 2)), corners, 0.0, np.zeros(1), 1.0).face_normals[0, 2] == 1


def test_an_object_beside_the_elastomer_or_too_hard_a_press_is_refused(on_skin):
    state, solver = on_skin
    for wrong, words in ((replace(state, x_mm=60.0), "misses the skin small_skin"),
                         (replace(state, force_n=4.0), "small_skin at 4 N: .*curve"),
                         (replace(state, force_n=40.0), "out of the range")):
        with pytest.raises(InputError, match=words):
            solver.solve(wrong)
