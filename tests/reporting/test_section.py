"""A section through the body: its layers' areas at rest, and the same material where the press takes it."""

from dataclasses import replace

import numpy as np
import pytest
from support.sensors import CORO

from softtact.errors import InputError
from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.deformed_mesh import REGIONS, pressed_body
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.vtu import of_bodies, of_map, read_vtu
from softtact.studies.hybrid.figures.section import row_under_load, section, top_surface

SMALL = CORO.model_copy(update={"footprint_mm": (6.0, 8.4)})   # 5 x 7 frusta
SQUEEZE = 0.1


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    """A small sensor shortened by a tenth, and most in the row at y = 2.4 mm."""
    mesh = MeshSettings(cover_heights=(0.0, 1.0), cover_splits=(0,), frustum_heights=(0.0, 0.35, 1.0))
    rest = pressed_body(build_sensor_body(SMALL, dielectric_law=None, cover_law=None, mesh=mesh))
    above = rest.points_mm[:, 2] + 2.5
    bump = 0.01 * np.exp(-((rest.points_mm[:, 1] - 2.4) ** 2)) * above
    down = np.column_stack([np.zeros((len(bump), 2)), -SQUEEZE * above - bump])
    path = tmp_path_factory.mktemp("body") / "body.vtu"
    of_bodies([rest, replace(rest, displacement_mm=down)], [1.0, 5.0]).write(path)
    return read_vtu(path)


def area(polygons):
    total = 0.0
    for polygon in polygons:
        x, z = polygon.T
        total += 0.5 * abs(np.dot(x, np.roll(z, -1)) - np.dot(z, np.roll(x, -1)))
    return total


def test_the_layers_of_a_section_at_rest_have_their_areas(body):
    cut = section(body, 0.0)
    areas = {name: area([p for p, r in zip(cut.rest_mm, cut.region, strict=True) if r == k]) for k, name in enumerate(REGIONS)}
    assert areas["cover"] == pytest.approx(6.0 * 1.5, rel=1e-6)
    assert areas["sheet"] == pytest.approx(6.0 * 0.5, rel=1e-6)
    assert areas["frusta"] == pytest.approx(5 * 0.5 * 0.5 * (0.6 + 1.2), rel=0.01)     # 0.01 mm beside the axes


def test_cells_that_cannot_be_cut_are_refused_and_not_left_out(body):
    kind, nodes, layer = body.cells[0]
    with pytest.raises(InputError, match="Cells of the kind 'tetra10' cannot be cut"):
        section(replace(body, cells=[*body.cells[1:], ("tetra10", nodes[:, :10], layer)]), 0.0)


def test_points_of_a_missing_layer_are_refused():
    flat = of_map(np.zeros((1, 3, 3)), np.arange(3.0), np.arange(3.0), [1.0], thickness_mm=2.5)
    assert len(flat.points_of("pressed face")) == 9
    with pytest.raises(InputError, match="no cells of the layer 'sheet'"):
        flat.points_of("sheet")


def test_pressed_material_lies_where_its_displacement_takes_it(body):
    cut = section(body, -2.4)       # the bump does not reach here
    for rest, pressed in zip(cut.rest_mm, cut.pressed_mm, strict=True):
        np.testing.assert_allclose(pressed[:, 1] + 2.5, (1 - SQUEEZE) * (rest[:, 1] + 2.5), atol=2e-5)
        np.testing.assert_allclose(pressed[:, 0], rest[:, 0], atol=1e-9)


def test_the_row_under_the_load_is_found(body):
    assert row_under_load(body, SMALL) == pytest.approx(2.4)


def test_the_top_surface_covers_the_footprint_and_goes_down_with_it(body):
    points, moved, triangles = top_surface(body)
    corners = points[triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.sum() == pytest.approx(6.0 * 8.4)
    assert (points[:, 2] == 0).all() and moved[:, 2].max() < -SQUEEZE * 2.4
