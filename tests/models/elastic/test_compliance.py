"""The elastic model on a small sensor: the press of its quarters against the whole layer; tests/verification has Hertz."""

import numpy as np
import pytest
import trimesh
from support.sensors import CORO
from whole_layer import WholeLayer

from softtact.contact.height_field import HeightField
from softtact.contact.object_points import ObjectPoints
from softtact.contact.underside import Underside
from softtact.errors import InputError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.models.elastic.compliance import (
    Compliance,
    draft_cells,
    draft_of,
    elastic_compliance,
    elastic_slab,
    electrode_plane_compliance,
    map_cells,
    press_layer,
)
from softtact.press.cache import cached_compliance
from softtact.press.sensor import Sensor
from softtact.sensors.fields import Edge

SMALL = CORO.model_copy(update={"footprint_mm": (9.6, 9.6), "map_shape": (13, 13)})      # elements of 0.8 mm
FORCES = np.array([0.5, 3.0])
OBJECTS = {
    "sphere": (trimesh.creation.icosphere(subdivisions=4, radius=5.0), (0, 0, 0, 0, 0, 0)),
    "punch off the nodes": (trimesh.creation.cylinder(radius=2.1, height=3.0, sections=96), (0.13, -0.29, 0, 0, 0, 0)),
    "tilted box": (trimesh.creation.box((4.0, 2.7, 3.0)), (0.4, 0.3, 0, 7.0, -4.0, 25.0)),
    "tilted ring": (trimesh.creation.annulus(r_min=1.3, r_max=3.0, height=2.0, sections=96), (-0.5, 0.2, 0, 2.0, 3.0, 0)),
    "lying rod over a side": (trimesh.creation.cylinder(radius=2.0, height=8.0, sections=96), (1.5, -2.0, 0, 90, 3.0, 40.0)),
}


@pytest.fixture(scope="module")
def compliance():
    return elastic_compliance(SMALL)


@pytest.fixture(scope="module")
def whole():
    return WholeLayer(SMALL)


def placed(name):
    """One of the objects in its pose, its lowest point at z = 0."""
    mesh, values = OBJECTS[name]
    mesh = place(mesh, pose=Pose.from_values(values))
    mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
    return mesh


def points_of(name, compliance):
    return Underside(HeightField(placed(name)), compliance.grid).nodes(SMALL.thickness_mm)


@pytest.mark.slow
def test_a_press_is_that_of_the_whole_layer_on_the_same_mesh(compliance, whole):
    for name in OBJECTS:
        points = points_of(name, compliance)
        press = press_layer(compliance, points, FORCES)
        depth, descent = whole.press(points, FORCES[-1])
        expected = whole.map_of(descent)
        # single precision, and the penalty: 0.1 N at a point over 1e5 N/mm is 1e-6 mm
        assert np.abs(press.maps[-1] - expected).max() < 2e-5 * expected.max()
        assert press.contact.depth[-1] == pytest.approx(depth, rel=2e-5)


def test_the_layers_bulk_and_shear_moduli_are_those_of_its_youngs_modulus_and_poissons_ratio():
    layer = elastic_slab(SMALL).layers[0][0]
    bulk, shear = layer.bulk_modulus, layer.shear_modulus
    assert 9 * bulk * shear / (3 * bulk + shear) == pytest.approx(SMALL.elastic_layer.young_mpa, rel=1e-12)
    assert (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)) == pytest.approx(SMALL.elastic_layer.poisson, rel=1e-12)


def test_no_place_is_deeper_than_a_flat_punch(compliance):
    mesh = place(trimesh.creation.cylinder(radius=2.1, height=3.0, sections=96), pose=None)
    press = press_layer(compliance, Underside(HeightField(mesh), compliance.grid).nodes(SMALL.thickness_mm), FORCES)
    assert (press.maps.max(axis=(1, 2)) < (1 + 1e-5) * press.contact.depth).all()      # maps are in single precision


def test_the_map_has_the_sensors_shape_and_rests_where_its_sides_are_held_up_to_the_surface(compliance):
    held = elastic_compliance(SMALL.model_copy(update={"edge": Edge(held="sides")}))
    for layer, still in ((compliance, False), (held, True)):
        maps = press_layer(layer, points_of("tilted box", layer), FORCES).maps
        assert maps.shape == (2, *SMALL.map_shape)
        for edge in (maps[:, 0], maps[:, -1], maps[:, :, 0], maps[:, :, -1]):
            assert (edge == 0.0).all() == still


def test_turning_the_object_by_half_a_turn_turns_the_map(compliance):
    mesh = placed("tilted box")
    maps = []
    for angle in (0.0, np.pi):
        turned = mesh.copy()
        turned.apply_transform(trimesh.transformations.rotation_matrix(angle, [0, 0, 1]))
        points = Underside(HeightField(turned), compliance.grid).nodes(SMALL.thickness_mm)
        maps.append(press_layer(compliance, points, FORCES).maps[-1])
    # samples of edges lie alike on both sides; what is left is single precision
    np.testing.assert_allclose(maps[1], maps[0][::-1, ::-1], atol=1e-5 * maps[0].max())


def test_saved_and_loaded_it_presses_the_same(compliance, tmp_path):
    compliance.save(tmp_path / "compliance.npz")
    loaded = Compliance.load(tmp_path / "compliance.npz")
    assert loaded.foundation_modulus == compliance.foundation_modulus
    points = points_of("punch off the nodes", compliance)
    np.testing.assert_array_equal(press_layer(loaded, points, FORCES).maps, press_layer(compliance, points, FORCES).maps)


def test_a_map_without_a_middle_is_refused():
    with pytest.raises(InputError, match="has no middle row and column"):
        map_cells(SMALL.model_copy(update={"map_shape": (13, 12)}))


@pytest.mark.parametrize("shape", [(3, 3), (5, 5), (3, 41)])
def test_a_map_too_small_for_sides_that_are_held_is_refused(shape):
    few = SMALL.model_copy(update={"map_shape": shape, "edge": Edge(held="sides")})
    with pytest.raises(InputError, match="at 'map_shape': .* has fewer than 7 points along a side"):
        elastic_compliance(few)


@pytest.mark.parametrize("count", [7, 9, 11])
def test_a_draft_of_a_small_map_whose_sides_are_held_has_the_maps_shape(count):
    small = SMALL.model_copy(update={"map_shape": (count, count), "edge": Edge(held="sides")})
    draft = draft_of(small, elastic_compliance(small, cells=draft_cells(small)))
    fields = draft.fields(ObjectPoints.level(np.array([draft.grid.count // 2]), np.zeros(1), draft.grid.step), np.ones((1, 1)))
    assert fields.shape == (1, 2 * count - 1, 2 * count - 1) and fields.max() == fields[0, count - 1, count - 1] > 0


def test_the_foundation_modulus_is_the_confined_modulus_over_the_thickness(compliance):
    """E (1 - nu) / ((1 + nu) (1 - 2 nu)) = 1.289 * 0.8271 / (1.1729 * 0.6542) = 1.3895 MPa, over 2.5 mm."""
    assert compliance.foundation_modulus == pytest.approx(1.3895 / 2.5, rel=1e-4)


def test_the_sensors_press_is_the_layers(compliance):
    mesh, values = OBJECTS["punch off the nodes"]
    sensor, pose = Sensor(SMALL, {}, prepared_models={"elastic": compliance}), Pose.from_values((*values[:2], 1.5, 0, 0, 0))
    result = sensor.press(mesh, pose=pose, force_n=list(FORCES), model="elastic")
    nodes = Underside(HeightField(placed("punch off the nodes")), compliance.grid).nodes(SMALL.thickness_mm)
    expected = press_layer(compliance, nodes, FORCES)
    # the sensor asks for points as deep as the object may come; those left out never touch
    np.testing.assert_allclose(result.deformation_map_mm, expected.maps, atol=1e-5 * expected.maps.max())
    # the nodes under a flat punch all touch: an area in steps of 0.1 mm2, some of 46 nodes at the edge more or less
    np.testing.assert_allclose(result.contact_area_mm2, np.pi * 2.1**2, rtol=0.1)
    assert (result.within_validity == 1).all() and (result.penetration_mm <= 1e-6).all()


def test_a_press_deeper_than_half_the_layer_is_out_of_its_validity(compliance):
    needle = trimesh.creation.cylinder(radius=0.9, height=3.0, sections=64)
    result = Sensor(SMALL, {}, prepared_models={"elastic": compliance}).press(needle, force_n=[0.5, 8.0], model="elastic")
    assert result.indentation_mm[1] > 0.5 * SMALL.thickness_mm > result.indentation_mm[0]
    assert result.within_validity.tolist() == [1, 0]


def test_a_compliance_is_computed_once_and_then_read_from_the_users_cache(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    coarse = SMALL.model_copy(update={"map_shape": (9, 9)})
    first = cached_compliance(coarse)
    assert "once for this sensor" in capsys.readouterr().err
    again = cached_compliance(coarse)
    assert capsys.readouterr().err == ""
    np.testing.assert_array_equal(again.blocks.blocks, first.blocks.blocks)
    cached_compliance(coarse.model_copy(update={"footprint_mm": (9.6, 9.0)}))      # another sensor, another file
    assert len(list(tmp_path.glob("softtact/compliance-*.npz"))) == 2


def test_points_inside_a_large_contact_may_share_their_pressure():
    """Four level points each, but for two rows along the edge, where pressure is steep: maps within 1 % (0.6 %), the same force."""
    compliance, wide = cached_compliance(CORO), trimesh.creation.cylinder(radius=8.0, height=5.0, sections=64)
    points = Underside(HeightField(place(wide, pose=Pose.from_values([1.3, 0.7, 2.5, 0, 0, 17.0]))), compliance.grid).nodes(1.0)
    each, shared = (press_layer(compliance, points, FORCES, patches=patches) for patches in (False, True))
    assert np.abs(shared.maps - each.maps).max() < 0.01 * each.maps.max()
    assert shared.contact.force.sum(axis=0) == pytest.approx(FORCES) and shared.contact.force.shape == each.contact.force.shape
    assert shared.contact.depth == pytest.approx(each.contact.depth, rel=1e-3)


def test_under_a_plate_over_all_the_electrodes_plane_moves_by_its_share_of_the_thickness(compliance):
    """A layer whose sides hardly matter is compressed evenly: at 1 of 2.5 mm it moves by 0.4 of the top.

    At the middle of a pad four times as wide as thick, with sides held below the plane alone: within 2 %.
    """
    plate = Underside(HeightField(place(trimesh.creation.box((12.0, 12.0, 2.0)))), compliance.grid)
    inner = electrode_plane_compliance(SMALL)
    maps = {name: press_layer(one, plate.nodes(1.0), FORCES).maps[-1] for name, one in (("top", compliance), ("plane", inner))}
    assert maps["plane"][6, 6] / maps["top"][6, 6] == pytest.approx(0.4, rel=0.02)


def test_twice_the_modulus_halves_the_map_of_a_plate(compliance):
    """A plate touches everywhere at any force, so the map is proportional to force over modulus: single precision."""
    plate = Underside(HeightField(place(trimesh.creation.box((12.0, 12.0, 2.0)))), compliance.grid).nodes(1.0)
    stiff, soft = (press_layer(one, plate, FORCES).maps for one in (compliance.stiffened(2.0), compliance))
    assert stiff == pytest.approx(0.5 * soft, abs=1e-5 * soft.max())
