"""The deformed body as nodes and cells: it moves as the map says, its parts stay together, and rubber keeps its volume."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from support.bodies import COARSE, SMALL, small_body
from support.laws import LAWS

from softtact.errors import InputError
from softtact.models.hyperelastic.deformed_mesh import pressed_body
from softtact.press.sensor import Sensor


@pytest.fixture(scope="module")
def press():
    cylinder = trimesh.creation.cylinder(radius=1.8, height=3, sections=64)
    return Sensor(SMALL, LAWS, mesh=COARSE).press(cylinder, force_n=[0.5, 6.0], model="hyperelastic", keep_body=True)


def region(body, name):
    """Numbers of the points that cells of a region use."""
    return np.unique(np.concatenate([cells.nodes.ravel() for cells in body.cells if cells.region == name]))


def volumes(body, name, share):
    import pyvista

    mesh = body.to_meshio()
    mesh.points = body.points_mm + share * body.displacement_mm
    grid = pyvista.from_meshio(mesh)
    sizes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    return sizes[grid["layer"] == ("frusta", "sheet", "cover").index(name)]


@pytest.mark.parametrize("load_step", [0, 1])
def test_the_body_moves_as_the_map_says_where_a_node_is_at_a_point_of_the_map(press, load_step):
    body = press.pressed_body(load_step)
    for name in ("sheet", "cover"):     # the map's plane lies between them
        nodes = region(body, name)
        nodes = nodes[np.abs(body.points_mm[nodes, 2] + SMALL.cover.thickness_mm) < 1e-9]
        x, y = np.meshgrid(press.x_mm, press.y_mm)
        distance, at = cKDTree(body.points_mm[nodes, :2]).query(np.column_stack([x.ravel(), y.ravel()]))
        known = distance < 1e-6
        assert known.sum() > 50
        ours = -body.displacement_mm[nodes[at[known]], 2]
        np.testing.assert_allclose(ours, press.deformation_map_mm[load_step].ravel()[known], atol=1e-9)
        assert ours.max() > 0.01


def test_the_parts_stay_together_and_the_sides_and_tips_where_they_are_held(press):
    body = press.pressed_body()
    sheet, frusta = region(body, "sheet"), region(body, "frusta")
    bottom, roots = (nodes[np.abs(body.points_mm[nodes, 2] + 2.0) < 1e-9] for nodes in (sheet, frusta))
    distance, at = cKDTree(body.points_mm[bottom]).query(body.points_mm[roots])
    assert distance.max() < 1e-6
    np.testing.assert_allclose(body.displacement_mm[roots], body.displacement_mm[bottom[at]], atol=1e-12)
    on_side = np.isclose(np.abs(body.points_mm[sheet, 0]), 3.0)
    assert on_side.any() and not body.displacement_mm[sheet[on_side]].any()
    tips = frusta[np.abs(body.points_mm[frusta, 2] + 2.5) < 1e-9]
    assert not body.displacement_mm[tips, :2].any()
    assert np.abs(body.displacement_mm[tips, 2]).max() < 0.01       # but for the contact's penalty


def test_pressed_frusta_change_their_shape_and_hardly_their_volume(press):
    body = press.pressed_body()
    before, after = (volumes(body, "frusta", share) for share in (0.0, 1.0))
    assert press.frustum_compression_mm[-1] > 0.1
    assert after.min() > 0
    assert 0.95 < after.sum() / before.sum() < 1.0      # bulk modulus 20 times the shear modulus, and less than 1 MPa


def test_without_a_force_the_body_is_at_rest():
    body = pressed_body(small_body())
    assert not body.displacement_mm.any()
    assert body.points_mm[:, 2].max() == 0.0 and body.points_mm[:, 2].min() == pytest.approx(-2.5)


def test_a_body_is_kept_only_if_asked_for():
    press = Sensor(SMALL, LAWS, mesh=COARSE).press(trimesh.creation.icosphere(radius=3.0), force_n=0.5, model="hyperelastic")
    with pytest.raises(InputError, match="keep_body=True"):
        press.pressed_body()
