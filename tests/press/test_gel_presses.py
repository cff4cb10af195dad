"""Presses on gels: the elastic model with friction by motion and by force, its files, and what is refused."""

import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact.errors import InputError, TimeLimitError
from softtact.press.vtu import read_vtu
from softtact.readout.registry import labelled, register
from softtact.sensors.library import sensor_file

BALL = trimesh.creation.icosphere(subdivisions=4, radius=3.0)
CORNERS = {"plate": trimesh.creation.box((30.0, 30.0, 2.0)), "needle": trimesh.creation.cone(radius=0.4, height=2.0)}


@register("middle_of_the_plane")
class MiddleOfThePlane:
    """Displacement, traction and gap at the middle of the surface, as a readout that needs the plane finds them."""

    def read(self, surface):
        """(step, quantity)."""
        plane = surface.plane
        row, column = (count // 2 for count in plane.gap_mm.shape[1:])
        at = np.concatenate([plane.displacement_mm, plane.traction_mpa, plane.gap_mm[..., None], plane.slip[..., None]], axis=-1)
        return labelled(at[:, row, column], ("step", "quantity"), units="mm, MPa")


@pytest.fixture(scope="module")
def gel(tmp_path_factory):
    """The paper's gel with points 0.25 mm apart and a readout of the plane."""
    values = yaml.safe_load(sensor_file("gelsight_wonkdim").read_text())
    values |= {"footprint_mm": [16.0, 16.0], "map_shape": [65, 65]}
    values["readouts"] = {"middle": {"kind": "middle_of_the_plane"}, "camera": values["readouts"]["camera"],
                          "depth": values["readouts"]["depth"]}
    path = tmp_path_factory.mktemp("gel") / "gel.yaml"
    path.write_text(yaml.safe_dump(values))
    return softtact.load_sensor(path)


@pytest.fixture(scope="module")
def sheared(gel):
    return gel.press(BALL, motion="z -0.6 in 3; x 0.4 in 2; rz 5", label="", keep_object=True)


def test_a_motion_gives_displacement_traction_slip_and_force(sheared):
    assert sheared.model == "elastic" and "sides are far" in sheared.selection_reason
    assert sheared.displacement_mm.shape == sheared.traction_mpa.shape == (6, 65, 65, 3) and sheared.slip.shape == (6, 65, 65)
    area = sheared.attributes["point_area_mm2"]
    np.testing.assert_allclose(area * sheared.traction_mpa.sum(axis=(1, 2)), sheared.force_n, rtol=1e-6, atol=1e-9)
    assert (sheared.force_n[:, 2] < 0).all() and sheared.force_n[4, 0] > 0.1 and sheared.torque_nmm[5, 2] > sheared.torque_nmm[4, 2]
    assert (np.diff(sheared.contact_area_mm2[:3]) > 0).all() and (sheared.within_validity == 1).all()
    np.testing.assert_allclose(sheared.indentation_mm, [0.2, 0.4, 0.6, 0.6, 0.6, 0.6])
    np.testing.assert_array_equal(sheared.deformation_map_mm, -sheared.displacement_mm[..., 2])


def test_the_depth_image_moves_with_the_object_and_does_not_fold_where_it_drags_the_surface(sheared):
    """The cap of the ball, 0.6 mm deep, seen 0.4 mm aside, nearer by 35 / 34.4; the surface's points are dragged from under it."""
    depth, still, moved = sheared.readings["depth"].values, *sheared.readings["depth"].values[[2, 4]]
    assert depth.shape == (6, 256, 256) and moved.max() == pytest.approx(0.6, abs=0.01)
    assert (moved > 0).sum() == pytest.approx((still > 0).sum(), rel=0.02)
    columns = np.arange(256)
    shift = np.diff([(one.sum(axis=0) * columns).sum() / one.sum() for one in (still, moved)])[0]
    assert shift * 0.0625 == pytest.approx(0.4 * 35 / (35 - 0.3), abs=0.02)      # 0.3 mm: the cap's mean depth
    above = (moved > 0.05)[int((moved.sum(axis=1) * columns).sum() / moved.sum())]
    assert np.abs(np.diff(above.astype(int))).sum() == 2                           # one piece


def test_the_depth_image_turns_as_the_contact_does(gel):
    """A bar along x that turns by 30 degrees lies along y = x tan 30 in the image and under the pressure on the moved points."""
    turned = gel.press(trimesh.creation.box((6.0, 2.0, 2.0)), motion="z -0.3; rz 30", label="")
    moved = np.meshgrid(turned.x_mm, turned.y_mm) + np.moveaxis(turned.displacement_mm[-1, ..., :2], -1, 0)
    pixels = np.meshgrid(np.arange(256), np.arange(256))
    for places, weight in ((pixels, turned.readings["depth"].values[-1]), (moved, -turned.traction_mpa[-1, ..., 2])):
        (xx, xy), (_, yy) = np.cov(*(place.ravel() for place in places), aweights=weight.ravel())
        assert np.degrees(0.5 * np.arctan2(2 * xy, xx - yy)) == pytest.approx(30, abs=3)


def test_readouts_see_the_plane_at_rest_and_pressed(gel, sheared):
    middle = sheared.readings["middle"].values
    np.testing.assert_allclose(middle[:, :3], sheared.displacement_mm[:, 32, 32])
    np.testing.assert_allclose(middle[:, 3:6], sheared.traction_mpa[:, 32, 32])
    assert np.abs(middle[:, 6]).max() < 1e-3 and not middle[:3, 7].any()          # in contact, and stuck in the middle
    assert middle[2, 2] == pytest.approx(-0.6, abs=1e-3)


def test_a_result_is_written_and_read_back(sheared, tmp_path):
    sheared.write(tmp_path / "gel.nc")
    again = softtact.read_press(tmp_path / "gel.nc")
    for name in ("displacement_mm", "traction_mpa", "slip", "force_n", "torque_nmm"):
        np.testing.assert_array_equal(getattr(again, name), getattr(sheared, name))
    turned = again.placed_object.displacement_mm[-1] - again.placed_object.displacement_mm[-2]
    assert np.linalg.norm(turned, axis=1).max() == pytest.approx(3.0 * 2 * np.sin(np.radians(2.5)), rel=0.01)


def test_forces_alone_are_a_motion_down(gel):
    by_force = gel.press(BALL, force_n=[0.3, 1.0], label="")
    by_motion = gel.press(BALL, motion="fz -0.3; fz -1.0", label="")
    np.testing.assert_allclose(by_force.normal_force_n, [0.3, 1.0], rtol=1e-9)
    np.testing.assert_array_equal(by_force.displacement_mm, by_motion.displacement_mm)
    assert np.isfinite(by_force.slip).any() and (np.diff(by_force.indentation_mm) > 0).all()


def test_pressing_many_presses_each_as_alone(gel):
    together = gel.press_many([BALL, BALL], [None, softtact.Pose([1.0, 0, 0])], force_n=0.5, model="elastic", workers=1, label="")
    np.testing.assert_array_equal(together[0].displacement_mm, gel.press(BALL, force_n=0.5, label="").displacement_mm)
    np.testing.assert_allclose(together[1].displacement_mm[:, :, 4:], together[0].displacement_mm[:, :, :-4], atol=1e-3)


def test_steps_beyond_the_models_validity_are_flagged_with_their_reason(gel):
    deep = gel.press(BALL, motion="z -1.0; z -0.8", label="")
    assert deep.within_validity.tolist() == [1, 0] and "deeper in than 1.5 mm" in deep.validity_reason[1]
    wide = gel.press(CORNERS["plate"], motion="z -0.05", label="")
    assert wide.within_validity.tolist() == [0] and "touches the rim of the gel" in wide.validity_reason[0]
    fine = gel.press(CORNERS["needle"].copy().apply_transform(np.diag([1, -1, -1, 1])), motion="z -0.1", label="")
    assert fine.within_validity.tolist() == [0] and "fewer than 9 points" in fine.validity_reason[0]


def test_steps_on_a_gel_are_given_as_they_are_completed_and_kept_where_a_press_is_stopped(gel, monkeypatch):
    seen = []

    def stop(result):
        seen.append(result)
        if result.steps == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stopped:
        gel.press(BALL, motion="z -0.1 in 4", label="", on_step=stop)
    assert [one.steps for one in seen] == [1, 2] and stopped.value.result.steps == 2
    whole = gel.press(BALL, motion="z -0.1 in 4", label="")
    monkeypatch.setattr("softtact.press.gel.Watch", Spent)
    with pytest.raises(TimeLimitError) as late:
        gel.press(BALL, motion="z -0.1 in 4", label="", time_limit_s=1.0)
    assert late.value.result.steps == len(late.value.result.wall_time_s) == 3
    assert late.value.result.force_n == pytest.approx(whole.force_n[:3])


class Spent:
    """A watch whose time is over at its third report."""

    def __init__(self, label, *, limit_s):
        self.reports = 0

    def report(self, where):
        self.reports += 1
        if self.reports == 3:
            raise TimeLimitError(where)


def test_a_vtu_of_a_gel_that_is_let_go_keeps_the_order_of_its_steps(gel, tmp_path):
    result = gel.press(BALL, motion="z -0.3; z 0.2", label="")
    result.write_vtu(tmp_path / "gel.vtu")
    read = read_vtu(tmp_path / "gel.vtu")
    assert result.normal_force_n[0] > result.normal_force_n[1] and read.force_n == pytest.approx(result.normal_force_n, rel=1e-5)
    assert -read.displacement_mm[:, :, 2].min(axis=1) == pytest.approx([0.3, 0.1], rel=0.2)


@pytest.mark.parametrize(("how", "said"), [
    ({"motion": "z 0.5; x 1"}, "The object never touches gelsight_wonkdim in this motion, which begins at first touch; move"),
    ({"motion": "z -0.3; x 9"}, "Step 2 of the motion takes the object off gelsight_wonkdim: .* x 9, y .*; move it less far"),
    ({"motion": "z -0.3", "pose": [20.0, 0, 0, 0, 0, 0]}, "The object misses the sensor: it spans x 17"),
    ({"motion": "z -0.2; rx 3", "model": "elastic"}, "prescribes x, y, z and rz and loads z only; leave the rotation rx out"),
    ({"motion": "z -0.2; x 1000"}, "takes the object off"),
    ({"force_n": 1.0, "model": "foundation"}, "has no frusta, which the foundation model needs")])
def test_what_a_gel_does_not_take_is_refused_in_a_sentence(gel, how, said):
    with pytest.raises(InputError, match=said):
        gel.press(BALL, label="", **how)


def test_a_turn_that_takes_the_lowest_pin_off_the_gel_is_refused_and_a_smaller_one_is_pressed(gel):
    """The pin is 3.6 mm left of the part's middle, about which it turns: from x = 1 by half a turn to 8.2; the gel ends at 8."""
    plate = trimesh.creation.box((8.0, 4.0, 1.0), transform=trimesh.transformations.translation_matrix([5.0, 0.0, 1.5]))
    pin = trimesh.creation.cylinder(radius=0.8, height=1.0, transform=trimesh.transformations.translation_matrix([1.0, 0.0, 0.5]))
    part = trimesh.util.concatenate([plate, pin])
    with pytest.raises(InputError, match=r"Step 2 of the motion takes the object off gelsight_wonkdim: .* x 8.2, y"):
        gel.press(part, pose=np.zeros(6), motion="z -0.2; rz 180", label="")
    assert gel.press(part, pose=np.zeros(6), motion="z -0.2; rz 5", label="").normal_force_n[1] > 0
    below = [0.0, -5.0, 0.0, 0.0, 0.0, 0.0]     # a quarter turn takes the pin down to y = -8.6, the other way up to -1.4
    with pytest.raises(InputError, match=r"takes the object off gelsight_wonkdim: .* y -8.6 mm"):
        gel.press(part, pose=below, motion="z -0.2; rz 90", label="")
    assert gel.press(part, pose=below, motion="z -0.2; rz -90 in 6", label="").normal_force_n[-1] > 0


def test_the_force_on_a_gelsight_mini_is_about_the_measured_one():
    """GelSight Mini under a sphere of 15 mm, bonded: 1.65 N at 0.5 mm and 13.53 N at 1.5 mm were measured (feats, commit f15e158).

    The modulus is that project's own fit by finite elements; the linear layer is expected within 12 %.
    """
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=7.5)
    result = softtact.load_sensor("gelsight_mini").press(sphere, motion="z -0.5; z -1.0", label="")
    np.testing.assert_allclose(result.normal_force_n, [1.6503, 13.5257], rtol=0.12)
