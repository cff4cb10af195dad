"""A soft object on a sensor: sensor and object as solids that meet; a stiff one agrees with the rigid models."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import softtact
from softtact.contact.motion import Motion
from softtact.contact.shell import Shell
from softtact.errors import InputError, ShellWarning
from softtact.fem.structured_meshes import box, cylinder
from softtact.materials.laws.registry import make_law
from softtact.press.objects import SoftObject
from softtact.press.vtu import LAYERS, of_bodies, read_vtu
from softtact.sensors.fields import Edge

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
    return {name: sensor.press(plug(law), motion=motion, label="", keep_body=True)
            for name, law in (("stiff", STIFF), ("soft", SOFT))}  # fmt: skip


@pytest.mark.slow
def test_a_stiff_object_is_felt_as_the_hyperelastic_model_feels_a_rigid_one(presses):
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


@pytest.mark.slow
def test_layers_and_object_are_written_whole_with_the_pressure_of_the_force(presses, tmp_path):
    """The pad has 10 x 16 x 1.8 mm3, the plug 27 pi, of elements whose sides are curves; the pressure sums to the force."""
    soft = presses["soft"]
    soft.write_vtu(tmp_path / "press.vtu")
    mesh = read_vtu(tmp_path / "press.vtu")
    assert {layer for _, _, layer in mesh.cells} == {LAYERS[name] for name in ("sheet", "cover", "pressed face", "object")}
    bodies = of_bodies(soft.bodies, soft.normal_force_n)
    top = next(nodes for _, nodes, layer in bodies.cells if layer == LAYERS["pressed face"])
    area = np.ptp(bodies.points[top], axis=1)[:, :2].prod(axis=1)
    assert area.sum() == pytest.approx(160.0) and bodies.points[top, 2] == pytest.approx(0.0, abs=1e-9)
    assert bodies.pressure_mpa[0] @ area == pytest.approx(soft.normal_force_n[0], rel=0.01)  # bent faces turn it
    for of_object, low, high in ((False, -1.8, 0.0), (True, 0.0, 3.0)):
        points, _, _ = mesh.surface(of_object=of_object)
        assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((low, high), abs=1e-6)


@pytest.mark.slow
def test_a_bar_wider_than_the_pad_comes_to_rest_on_the_shell_and_a_soft_one_bends_down_to_it():
    """The pad stands 0.05 mm out of its shell: a stiff bar that comes down so far rests, and the pad feels no more than then.

    Expected is its force at that depth, and what the bar itself gives way: 4 N on 12 mm2 squeeze its free 1 mm of 1,100 MPa by
    0.3 um, which is 0.6 % of the depth.
    """
    sensor = softtact.load_sensor("pad4x4")
    low = replace(sensor, spec=sensor.spec.model_copy(update={"edge": Edge(held={"sides_below_mm": 0.05})}), prepared_models={})

    def bar(law):
        return SoftObject(box((-6.5, -2, 0), (6.5, 2, 2), (13, 4, 2)), law, held_share=0.5)

    expected = low.press(bar(STIFF), motion=Motion().press(depth_mm=0.05), label="").pad_force_n[0]
    with pytest.warns(ShellWarning, match="rests on the shell"):
        rests = low.press(bar(STIFF), force_n=[3.0, 10.0], label="")
    assert rests.pad_force_n == pytest.approx([3.0, expected], rel=0.03)
    assert rests.pad_force_n + rests.shell_force_n == pytest.approx([3.0, 10.0], rel=1e-3)
    with pytest.warns(ShellWarning, match="rests on the shell"):
        bends = low.press(bar(SOFT), force_n=2.0, label="")
    assert bends.shell_force_n[0] > 0.02 and bends.pad_force_n[0] + bends.shell_force_n[0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("height", [-3.0, 0.0, 40.0])
def test_the_height_of_a_pose_does_not_count_and_a_tilted_object_touches_where_it_is_over_the_pad(height):
    long, shell = SoftObject(box((-15, -1, 0), (15, 1, 3), (10, 1, 2)), SOFT), Shell((10.0, 16.0), np.inf, 2.0)
    placed = long.placed(softtact.Pose.from_values([0.0, 0.0, height, 0.0, 5.0, 0.0]), 2.0, shell)
    over = np.abs(placed.points[:, 0]) <= 5.0
    assert placed.points[over, 2].min() == pytest.approx(2.0)
    assert placed.points[:, 2].min() < 1.5, "its end hangs beside the pad"


def test_a_tilted_object_touches_the_shell_first_where_that_stands_high():
    """At 5 degrees a bar is tan 5 x 2 mm = 0.17 mm lower over the shell's outer side, x = 7 mm, than over the pad's, x = 5 mm."""
    long = SoftObject(box((-15, -1, 0), (15, 1, 3), (30, 1, 2)), SOFT)
    pose = softtact.Pose.from_values([0.0, 0.0, 0.0, 0.0, 5.0, 0.0])
    for below, lowest_over_pad in ((0.05, 2.0 - 0.05 + 2 * np.tan(np.radians(5))), (0.5, 2.0)):
        placed = long.placed(pose, 2.0, Shell((10.0, 16.0), below, 2.0))
        over = np.abs(placed.points[:, 0]) <= 5.0
        assert placed.points[over, 2].min() == pytest.approx(lowest_over_pad, abs=0.05)  # nodes are 0.5 mm apart


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
