"""Pictures of a press: the right way up, with the numbers on their taxels."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from softtact.play import pictures
from softtact.play.pictures import board, comparison, light_mesh, surface_mesh, taxel_mesh


@pytest.fixture(scope="module")
def corner(state, solver):
    """A press near the corner at positive x and y."""
    return solver.solve(replace(state, x_mm=6.0, y_mm=12.0), draft=True)


def test_a_press_at_positive_x_and_y_is_up_and_to_the_right_in_map_and_taxels(corner):
    image = board(corner.result).astype(int).sum(axis=2)
    rows, columns = image[40:360].shape[0], 200
    for left in (10, image.shape[1] - 200):      # map and taxels
        part = image[40:360, left:left + columns - 20]
        dark = np.median(part)
        y, x = np.nonzero(part > dark + 150)
        assert np.median(y) < rows / 2 and np.median(x) > columns / 3


def test_surface_and_tiles_lie_where_they_are_pressed(corner):
    surface, tiles = surface_mesh(corner.result), taxel_mesh(corner.result)
    lowest = surface.vertices[:corner.result.deformation_map_mm[0].size]
    assert np.sign(lowest[lowest[:, 2].argmin(), :2]).tolist() == [1, 1]
    bright = tiles.vertices[tiles.visual.vertex_colors[:, :3].sum(axis=1).argmax()]
    assert bright[1] > 0 and bright[0] > tiles.vertices[:, 0].mean() and len(tiles.faces) == 2 * 28


def test_a_comparison_is_wider_by_its_difference_which_has_the_middle_colour_where_there_is_none(corner):
    alone, equal = board(corner.result), replace(corner.result)
    np.testing.assert_array_equal(comparison(corner.result, corner.result), alone)
    beside = comparison(corner.result, equal)
    middle = beside[200, (alone.shape[1] + beside.shape[1]) // 2].astype(int)
    assert beside.shape[1] > alone.shape[1] and np.abs(middle - pictures.colours("coolwarm")[128]).max() <= 2


def test_a_mesh_of_very_many_facets_is_shown_with_fewer_of_the_same_size(monkeypatch):
    ball = trimesh.creation.icosphere(subdivisions=5, radius=10)
    assert light_mesh(ball) is ball
    monkeypatch.setattr(pictures, "_MOST_SHOWN", 1000)
    monkeypatch.setattr(pictures, "_COARSE", 20)
    light = light_mesh(ball)
    assert len(light.faces) < len(ball.faces) / 3 and np.allclose(light.extents, ball.extents, rtol=0.1)
