"""A soft object on a sensor: sensor and object as solids that meet; a stiff one agrees with the rigid models."""

import numpy as np
import pytest

import softtact
from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.fem.structured_meshes import box, cylinder
from softtact.materials.laws.registry import make_law
from softtact.press.soft_object import SoftObject
from softtact.press.solid_pad import SolidPad

SOFT = make_law("neo_hooke", {"c10": 0.035}, bulk_over_shear=20)
STIFF = make_law("neo_hooke", {"c10": 200.0}, bulk_over_shear=5)


def plug(law, **options):
    """A cylinder of radius 3 mm and height 3 mm."""
    return SoftObject(cylinder(3.0, 3.0, (6, 2)), law, **options)


@pytest.fixture(scope="module")
def presses():
    """The plug on `pad4x4`, pressed by 0.15 mm: stiff and soft."""
    sensor = softtact.load_sensor("pad4x4")
    motion = Motion().press(depth_mm=0.15)
    return {name: sensor.press(plug(law), motion=motion, label="") for name, law in (("stiff", STIFF), ("soft", SOFT))}


@pytest.mark.slow
def test_a_stiff_object_is_felt_as_the_hyperelastic_model_feels_a_rigid_one(presses):
    import trimesh

    rigid = trimesh.creation.cylinder(radius=3.0, height=3.0, sections=96)
    expected = softtact.load_sensor("pad4x4").press(rigid, motion=Motion().press(depth_mm=0.15), model="hyperelastic", label="")
    found = presses["stiff"]
    # The solid model's elements are 0.5 mm wide, those of the hyperelastic one 0.45 mm: some percent at a punch's sharp edge.
    assert found.normal_force_n[0] == pytest.approx(expected.normal_force_n[0], rel=0.05)
    difference = found.deformation_map_mm - expected.deformation_map_mm
    assert np.sqrt((difference**2).mean()) < 0.03 * expected.deformation_map_mm.max()


@pytest.mark.slow
def test_a_soft_object_yields_and_is_felt_less_than_a_stiff_one_as_far_down(presses):
    stiff, soft = presses["stiff"], presses["soft"]
    assert soft.normal_force_n[0] < 0.5 * stiff.normal_force_n[0]
    assert 0 < soft.deformation_map_mm.max() < 0.6 * stiff.deformation_map_mm.max()
    assert soft.model == "solid" and soft.penetration_mm[0] < 5e-3
    middle = soft.displacement_mm[0, ..., 2]
    np.testing.assert_allclose(middle, middle[::-1, ::-1], atol=2e-3 * np.abs(middle).max())      # it lies in the middle


@pytest.mark.slow
def test_the_force_on_the_pad_is_that_of_the_holder_and_a_result_is_read_back(presses, tmp_path):
    soft = presses["soft"]
    assert soft.force_n[0, 2] == pytest.approx(-soft.normal_force_n[0])
    assert np.abs(soft.force_n[0, :2]).max() < 2e-3 * soft.normal_force_n[0]
    soft.write(tmp_path / "press.nc")
    np.testing.assert_array_equal(softtact.read_press(tmp_path / "press.nc").deformation_map_mm, soft.deformation_map_mm)


def test_frusta_stand_below_the_sheet_one_to_an_element_with_weights_that_make_a_mean():
    sensor = softtact.load_sensor("coro")
    pad = SolidPad(sensor)
    springs = pad._springs()
    assert len(springs.nodes) == 18 * 30
    np.testing.assert_allclose(springs.weights.sum(axis=1), 1.0)
    down = np.zeros_like(pad.mesh.points)
    down[:, 2] = -0.1 - 0.01 * pad.mesh.points[:, 0]
    expected = 0.1 + 0.01 * pad.mesh.points[springs.nodes].mean(axis=1)[:, 0]
    np.testing.assert_allclose(springs.compressions(down), expected, atol=1e-12)
    force, even = np.zeros_like(down), np.zeros_like(down)
    springs.add_force(down, force)
    even[:, 2] = -0.1
    law, pushed = sensor.prepared("foundation").law, np.zeros_like(down)
    springs.add_force(even, pushed)
    one = np.interp(0.1, law.compression_mm, law.force_n)      # of a frustum's unit cell
    assert -pushed[:, 2].sum() == pytest.approx(540 * one, rel=0.01)
    h, v = 1e-6, np.random.default_rng(0).standard_normal(down.shape)
    ahead, behind = np.zeros_like(down), np.zeros_like(down)
    springs.add_force(down + h * v, ahead)
    springs.add_force(down - h * v, behind)
    nodes, matrices = springs.tangents(down)
    product = np.zeros_like(down)
    np.add.at(product, nodes, np.einsum("kij,kj->ki", matrices, v[nodes].reshape(len(nodes), -1)).reshape(*nodes.shape, 3))
    np.testing.assert_allclose(product, (ahead - behind) / (2 * h), atol=1e-6 * np.abs(product).max())


@pytest.mark.parametrize("height", [-3.0, 0.0, 40.0])
def test_the_height_of_a_pose_does_not_count_and_a_tilted_object_touches_where_it_is_over_the_pad(height):
    long = SoftObject(box((-15, -1, 0), (15, 1, 3), (10, 1, 2)), SOFT)
    placed = long.placed(softtact.Pose.from_values([0.0, 0.0, height, 0.0, 5.0, 0.0]), 2.0, (10.0, 16.0))
    over = np.abs(placed.points[:, 0]) <= 5.0
    assert placed.points[over, 2].min() == pytest.approx(2.0)
    assert placed.points[:, 2].min() < 1.5, "its end hangs beside the pad"


def test_what_cannot_be_is_refused_in_one_sentence():
    sensor = softtact.load_sensor("pad4x4")
    with pytest.raises(InputError, match="misses the sensor"):
        sensor.press(plug(SOFT), force_n=1.0, pose=softtact.Pose((40.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="solid model alone"):
        sensor.press(plug(SOFT), force_n=1.0, model="foundation")
    with pytest.raises(InputError, match="held_share"):
        plug(SOFT, held_share=1.5)
    two = box((0, 0, 0), (1, 1, 1), (1, 1, 1)).joined(box((2, 0, 0), (3, 1, 1), (1, 1, 1)), prefix="second ")
    with pytest.raises(InputError, match="one region"):
        SoftObject(two, SOFT)
