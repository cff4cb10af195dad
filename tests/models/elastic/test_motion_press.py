"""A motion on the elastic layer: history, mirrors, energy, control by force and by depth, and what is refused."""


import numpy as np
import pytest
import trimesh
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.contact.underside import Underside
from softtact.errors import ConvergenceError, InputError
from softtact.models.elastic.compliance import elastic_compliance, press_layer
from softtact.models.elastic.sliding import move_on_layer
from softtact.models.elastic.tangential import surface_compliance
from softtact.press.sensor import load_sensor

SMALL = CORO.model_copy(update={"footprint_mm": (9.6, 9.6), "map_shape": (13, 13)})      # nodes 0.4 mm apart, 2.5 mm thick
BALL = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
PUNCH = trimesh.creation.box((3.0, 2.2, 2.0))            # its sides lie between the nodes
NUMBERS = ("depth_mm", "displacement_mm", "force_n", "torque_nmm", "slip", "dissipated_mj", "stored_mj", "work_mj")


@pytest.fixture(scope="module")
def surface():
    return surface_compliance(SMALL)


def standing(mesh, at=(0.0, 0.0), turned=(0, 0, 0)):
    """A copy of a mesh over a place of the sensor, its lowest point at z = 0."""
    mesh = mesh.copy()
    mesh.apply_transform(trimesh.transformations.euler_matrix(*np.radians(turned)))
    mesh.apply_translation([*at, -mesh.bounds[0, 2]])
    return mesh


def move(surface, mesh, motion, friction):
    return move_on_layer(surface, HeightField(mesh), motion, first_touch_mm=0.0, friction=friction, deepest_mm=2.5)


@pytest.mark.parametrize("mesh", [standing(BALL, (0.3, -0.2)), standing(PUNCH)], ids=["ball", "punch"])
def test_without_friction_a_press_by_force_is_the_elastic_models_press(surface, mesh):
    forces, compliance = np.array([0.5, 3.0]), elastic_compliance(SMALL)
    expected = press_layer(compliance, Underside(HeightField(mesh), compliance.grid).nodes(2.5), forces)
    found = move(surface, mesh, Motion().press(force_n=forces), friction=0.0)
    np.testing.assert_allclose(-found.displacement_mm[..., 2], expected.maps, rtol=0, atol=1e-6)      # mm; both in single precision
    np.testing.assert_allclose(found.depth_mm, expected.contact.depth, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.force_n, np.outer(forces, [0, 0, -1]), atol=1e-9)


def test_the_same_motion_twice_gives_the_same_bytes(surface):
    motion, mesh = Motion().press(depth_mm=0.2).slide(x_mm=0.4, steps=2), standing(BALL)
    first, second = (move(surface, mesh, motion, friction=0.3) for _ in range(2))
    for name in NUMBERS:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_a_mirrored_motion_gives_mirrored_maps(surface):
    found, other = (move(surface, standing(BALL, (sign * 0.3, 0.2)),
                         Motion().press(force_n=1.0).slide(x_mm=sign * 0.6, y_mm=0.2, steps=2), friction=0.3) for sign in (1, -1))
    mirror = np.array([-1, 1, 1])
    # the mirrored ball's triangles are others, and forces of nodes at the contact's edge differ with the facets there
    scale = np.abs(found.displacement_mm).max()
    np.testing.assert_allclose(other.displacement_mm[:, :, ::-1] * mirror, found.displacement_mm, rtol=0, atol=2e-3 * scale)
    np.testing.assert_allclose(other.force_n * mirror, found.force_n, rtol=0, atol=2e-3)


def test_a_motion_turned_by_half_a_turn_gives_turned_maps(surface):
    found, other = (move(surface, standing(PUNCH), Motion().press(depth_mm=0.2).slide(x_mm=way, steps=3), friction=0.3)
                    for way in (0.6, -0.6))
    turn = np.array([-1, -1, 1])
    scale = np.abs(found.displacement_mm).max()
    np.testing.assert_allclose(other.displacement_mm[:, ::-1, ::-1] * turn, found.displacement_mm, rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(other.slip[:, ::-1, ::-1], found.slip, rtol=0, atol=1e-5)
    np.testing.assert_allclose(other.torque_nmm[:, 1], -found.torque_nmm[:, 1], rtol=0, atol=1e-5)


@pytest.mark.parametrize("mesh", [BALL, PUNCH], ids=["ball", "punch"])
def test_control_by_force_follows_the_curve_of_control_by_depth(surface, mesh):
    """In steps of one increment each: longer ones are divided by depths that a load is only expected to have."""
    mesh = standing(mesh)
    by_depth = move(surface, mesh, Motion().press(depth_mm=0.02 * np.arange(1, 11)).slide(x_mm=0.5, steps=5), friction=0.3)
    loads = by_depth.force_n[:, 2]
    same = Motion().press(force_n=-loads[:10])
    for load in loads[10:]:
        same = same.step(ways={"x": 0.1}, loads={"z": load})
    by_force = move(surface, mesh, same, friction=0.3)
    assert (by_force.increments == 1).all() and (by_depth.increments == 1).all()
    np.testing.assert_allclose(by_force.depth_mm, by_depth.depth_mm, rtol=1e-4)
    np.testing.assert_allclose(by_force.force_n, by_depth.force_n, rtol=0, atol=1e-4 * -loads[-1])


def test_a_depth_given_after_a_load_goes_on_from_where_the_object_is(surface):
    found = move(surface, standing(PUNCH), Motion().press(force_n=1.0).step(ways={"z": -0.05}).slide(x_mm=0.1), friction=0.3)
    assert found.depth_mm[1] == pytest.approx(found.depth_mm[0] + 0.05)
    assert found.depth_mm[2] == found.depth_mm[1]                # prescribed from then on


@pytest.mark.parametrize(("friction", "differ"), [(0.0, False), (0.6, True)])
def test_two_paths_to_one_place_differ_with_friction_only(surface, friction, differ):
    """z 0.3 at x = 0, or z 0.3 at x = -0.8 and then 0.8 aside."""
    straight = move(surface, standing(BALL), Motion().press(depth_mm=0.3), friction)
    aside = move(surface, standing(BALL, (-0.8, 0.0)), Motion().press(depth_mm=0.3).slide(x_mm=0.8, steps=2), friction)
    difference = np.abs(straight.displacement_mm[-1] - aside.displacement_mm[-1]).max()
    # without friction what is left is rounding; with it the surface is dragged by some hundredths of a mm
    assert (difference > 0.02) if differ else (difference < 1e-6)


def test_a_path_that_returns_dissipates_what_the_force_did_on_it(surface):
    """The loop's area, the sum of mean force times way, is the frictional work: a flat punch that is back where it was."""
    motion = Motion().press(depth_mm=0.3).slide(x_mm=0.1, steps=4).slide(x_mm=-0.2, steps=8).slide(x_mm=0.2, steps=8)
    found = move(surface, standing(PUNCH), motion, friction=0.2)
    force, ways = found.force_n[:, 0], np.array([0.1 / 4] * 4 + [-0.2 / 8] * 8 + [0.2 / 8] * 8)
    loop = slice(5, 21)                                          # from x = 0.1 to there again, through -0.1
    area = (0.5 * (force[4:-1] + force[5:]) * ways[4:]).sum()
    rubbed = found.dissipated_mj[-1] - found.dissipated_mj[4]
    assert (np.diff(found.dissipated_mj[loop]) >= -1e-9).all() and rubbed > 0.01
    stored = found.stored_mj[-1] - found.stored_mj[4]
    # no node comes or goes under this punch, so the trapezoidal balance is exact to the solver's tolerance
    assert area == pytest.approx(rubbed + stored, rel=1e-4)
    np.testing.assert_allclose(found.work_mj, found.stored_mj + found.dissipated_mj, rtol=1e-5)


def test_a_path_on_which_everything_sticks_gives_all_work_back(surface):
    motion = Motion().press(depth_mm=0.3).slide(x_mm=0.2, steps=2).slide(x_mm=-0.2, steps=2)
    found = move(surface, standing(PUNCH), motion, friction=10.0)
    assert not found.dissipated_mj.any() and np.nanmax(found.slip) == 0.0
    assert found.force_n[2, 0] > 0.2                             # it did carry a lateral force
    np.testing.assert_allclose(found.force_n[-1], found.force_n[0], rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.work_mj, found.stored_mj, rtol=1e-5)


def test_forces_torques_and_slip_have_the_documented_signs(surface):
    """A punch at x = 1, y = -0.5 that presses and slides to +x: down, along +x, and moments r x F of it."""
    found = move(surface, standing(PUNCH, (1.0, -0.5)), Motion().press(depth_mm=0.2).slide(x_mm=0.4, steps=2), friction=0.3)
    force, torque = found.force_n[-1], found.torque_nmm[-1]
    assert force[2] < 0 < force[0] and found.displacement_mm[-1, 6, 7, 2] < 0 < found.displacement_mm[-1, 6, 7, 0]
    # the resultant lies under the punch: within its half sides, moved by 0.4 mm, of r x F with z = 0
    at_x, at_y = -torque[1] / force[2], torque[0] / force[2]
    assert 1.0 < at_x < 1.0 + 0.4 + 0.75 and at_y == pytest.approx(-0.5, abs=0.2)
    touched = np.isfinite(found.slip[-1])
    assert touched.any() and not touched[0].any() and found.slip[-1][touched].max() <= 0.4
    assert found.slip[-1][touched].max() > 0.2


def test_tractions_gaps_and_sliding_points_on_the_map_are_those_of_the_contact(surface):
    """Tractions sum to the force to rounding, as nodes share theirs; the object is on the surface where it presses, else above."""
    motion = Motion().press(depth_mm=0.2).slide(x_mm=0.05).slide(x_mm=0.6, steps=2)
    found = move(surface, standing(PUNCH), motion, friction=0.3)
    sides = [np.where(np.arange(13) % 12, 1.0, 0.5)] * 2
    area = np.outer(*sides) * 0.8**2
    np.testing.assert_allclose((found.traction_mpa * area[..., None]).sum(axis=(1, 2)), found.force_n, rtol=1e-9, atol=1e-12)
    touches = np.isfinite(found.slip)
    assert np.abs(found.gap_mm[touches]).max() < 1e-5                    # mm: the displacement is in single precision
    under = np.isfinite(found.gap_mm)
    assert (found.gap_mm[under] > -1e-5).all() and not under[:, 0].any() and (under >= touches).all()
    assert not found.slides[0].any() or found.slip[0][found.slides[0]].min() > 0
    np.testing.assert_array_equal(found.slides[-1], touches[-1])         # gross sliding
    assert found.slides[1].sum() < found.slides[-1].sum()                # partial slip before


def test_lifted_off_the_object_leaves_no_force_and_touches_again(surface):
    motion = Motion().press(depth_mm=0.2).step(ways={"z": 0.3}).step(ways={"x": 0.5}).step(ways={"z": -0.3})
    found = move(surface, standing(BALL), motion, friction=0.3)
    assert not found.force_n[1].any() and np.isnan(found.slip[1]).all() and not found.displacement_mm[1].any()
    assert found.stored_mj[1] == 0.0 and found.depth_mm[1] == pytest.approx(-0.1)
    assert found.force_n[3, 2] < -0.1


REFUSED = {"a rotation": (Motion().step(ways={"rz": 5.0}), "Step 1 .* the elastic model prescribes x, y and z and loads z only"),
           "a lateral load": (Motion().press(force_n=1).step(loads={"x": 1.0}), "Step 2 .* leave the load on x out"),
           "a pull": (Motion().step(loads={"z": 2.0}), "a load of 2 N along z does not press"),
           "nothing": (Motion(), "The motion has no steps")}


@pytest.mark.parametrize(("motion", "said"), REFUSED.values(), ids=REFUSED)
def test_what_the_model_does_not_know_is_refused(surface, motion, said):
    with pytest.raises(InputError, match=said):
        move(surface, standing(BALL), motion, friction=0.3)


def test_an_object_that_slides_off_under_its_load_is_reported(surface):
    with pytest.raises(InputError, match="has slid off the sensor's free surface"):
        move(surface, standing(PUNCH), Motion().press(force_n=1.0).slide(x_mm=8.0), friction=0.0)


def test_an_object_whose_load_takes_it_through_the_layer_beside_the_pads_side_has_left_the_sensor(surface):
    """Of a pad that ends at 4.8 mm; at x 8.6 what of the ball is over the pad is 1.8 mm higher than its lowest point."""
    with pytest.raises(ConvergenceError, match=r"Step 2 .* takes the object off the sensor; .* at x 8\.6, y .* 4\.8 mm") as caught:
        move(surface, standing(BALL), Motion().press(force_n=2.0).slide(x_mm=8.6), friction=0.0)
    assert len(caught.value.result.depth_mm) == 1


def test_a_depth_beyond_the_layer_is_refused_before_it_is_solved(surface, monkeypatch):
    def solve(*_, **__):
        raise AssertionError("solved")

    monkeypatch.setattr("softtact.models.elastic.sliding.solve_increment", solve)
    with pytest.raises(ConvergenceError, match=r"Step 1 was not reached: the object would be 3 mm deep in a layer 2\.5 mm thick"):
        move(surface, standing(BALL), Motion().press(depth_mm=3.0), friction=0.3)


def test_deeper_than_the_layer_is_not_reached_and_the_steps_before_are_kept(surface):
    with pytest.raises(ConvergenceError, match=r"Step 2 was not reached: the object would be 2\.6 mm deep") as caught:
        move(surface, standing(BALL), Motion().press(depth_mm=[0.2, 2.6]), friction=0.0)
    assert caught.value.result.depth_mm == pytest.approx([0.2])


def test_a_sensor_presses_a_motion_with_its_own_friction_from_first_touch(surface):
    sensor = load_sensor("coro")
    sensor.spec = SMALL.model_copy(update={"friction": SMALL.friction.model_copy(update={"object": 0.3})})
    sensor.prepared_models["elastic_surface"] = surface
    mesh = standing(PUNCH)
    mesh.apply_translation([0, 0, 0.7])                          # 0.7 mm over the surface
    motion = Motion().press(depth_mm=0.2).slide(x_mm=0.2)
    result, own = sensor.press(mesh, motion=motion, model="elastic", label=""), move(surface, standing(PUNCH), motion, friction=0.3)
    for name in ("force_n", "torque_nmm", "displacement_mm", "slip"):
        np.testing.assert_array_equal(getattr(result, name), getattr(own, name))
    np.testing.assert_array_equal(result.deformation_map_mm, -own.displacement_mm[..., 2])
    assert result.indentation_mm == pytest.approx([0.2, 0.2]) and (result.wall_time_s > 0).all()
    assert result.normal_force_n == pytest.approx(-own.force_n[:, 2]) and result.attributes["friction_object"] == 0.3
