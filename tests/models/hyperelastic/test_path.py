"""An object that moves on the hyperelastic sensor: down by depth or force, aside, and back."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from support.bodies import COARSE, small_body
from support.laws import LAWS
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.errors import HardPressWarning, InputError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.models.hyperelastic import newton, path
from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps, press_motion
from softtact.press.sensor import Sensor
from softtact.sensors.fields import Edge

SMALL = CORO.model_copy(update={"footprint_mm": (4.8, 4.8), "map_shape": (9, 9)})     # 4 x 4 frusta
TIGHT = NewtonSettings(relative_tolerance=1e-6, largest_penetration_mm=1e-4)
MU = 0.3


def sensor(mu=0.0, solver=TIGHT):
    spec = SMALL.model_copy(update={"friction": SMALL.friction.model_copy(update={"object": mu})})
    return Sensor(spec, LAWS, mesh=COARSE, solver=solver)


def ball(radius=3.0):
    return trimesh.creation.icosphere(subdivisions=4, radius=radius)


@pytest.fixture(scope="module")
def slid():
    """A ball pressed 0.15 mm deep, moved aside by 0.3 mm and back."""
    motion = Motion().press(depth_mm=[0.08, 0.15]).slide(x_mm=0.3, steps=3).slide(x_mm=-0.3, steps=3)
    return sensor(MU).press(ball(), motion=motion, model="hyperelastic", label="")


@pytest.mark.slow
def test_a_ball_sinks_as_deep_by_force_as_the_depth_that_gave_that_force():
    """One curve of force and depth, walked by either control. The light press is settled to 1e-5 of its force, so 1e-4 is ample."""
    fine = replace(TIGHT, relative_tolerance=5e-8, first_touch_tolerance_n=1e-6)
    by_depth = sensor(solver=fine).press(ball(), motion=Motion().press(depth_mm=[0.05, 0.1, 0.15]), model="hyperelastic", label="")
    by_force = sensor(solver=fine).press(ball(), force_n=by_depth.normal_force_n, model="hyperelastic", label="")
    np.testing.assert_allclose(by_depth.indentation_mm, [0.05, 0.1, 0.15], rtol=1e-12)
    np.testing.assert_allclose(by_force.indentation_mm, by_depth.indentation_mm, rtol=1e-4)
    np.testing.assert_allclose(by_force.deformation_map_mm, by_depth.deformation_map_mm, atol=1e-4 * 0.15)


def test_the_vector_of_force_holds_the_normal_force_and_a_ball_in_the_middle_gives_no_torque(slid):
    np.testing.assert_allclose(slid.force_n[:, 2], -slid.normal_force_n, rtol=1e-9)
    assert np.abs(slid.torque_nmm[:2]).max() < 1e-3 * 0.25 * 0.3      # of the force times the contact's radius


@pytest.mark.slow
def test_a_plate_that_slides_is_held_by_the_coefficient_times_the_force():
    """Coulomb: |T| = mu N once all points slide; the cover of a plate without slope has no other force along x."""
    plate = trimesh.creation.box((2.6, 2.6, 1.0))
    result = sensor(MU).press(plate, motion=Motion().press(force_n=1.0).slide(x_mm=0.6, steps=3), model="hyperelastic", label="")
    np.testing.assert_allclose(result.normal_force_n, 1.0, rtol=1e-4)
    assert result.force_n[-1, 0] == pytest.approx(MU * 1.0, rel=2e-3)   # where the trough's rim leans, pressure has a part along x
    assert 0 < np.nanmin(result.slip[-1]) and np.isnan(result.slip[-1]).any()
    # Once all slide, a step of 0.2 mm is slip alone: the cover is pulled by the same force as before, here and there a bit back.
    assert np.nanmean(np.diff(result.slip[:, 3:6, 3:6], axis=0)[-1]) == pytest.approx(0.2, rel=0.06)


@pytest.mark.slow
def test_a_path_that_returns_dissipates_and_one_that_sticks_does_not():
    """Work of the object along x over a closed path: friction takes what sliding points lose, and sticking ones give all back."""
    def loop(mu, way):
        motion = Motion().press(depth_mm=0.1).slide(x_mm=way, steps=2).slide(x_mm=-way, steps=2)
        result = sensor(mu).press(ball(), motion=motion, model="hyperelastic", label="")
        force, place = result.force_n[:, 0], np.concatenate([[0.0], way * np.array([1, 2, 1, 0]) / 2])
        pull = np.concatenate([[0.0], force[1:]])
        return 0.5 * (pull[1:] + pull[:-1]) @ np.diff(place), np.abs(pull).max() * way
    lost, scale = loop(MU, 0.2)
    kept, stuck_scale = loop(3.0, 0.01)
    assert lost > 0.5 * scale and abs(kept) < 0.05 * stuck_scale


@pytest.mark.slow
def test_the_end_depends_on_the_path_with_friction_and_not_without():
    def end(mu, before):
        motion = Motion().step(ways={"x": before}) if before else Motion()
        motion = motion.press(depth_mm=0.1)
        result = sensor(mu).press(ball(), motion=motion.slide(x_mm=-before) if before else motion, model="hyperelastic", label="")
        return result.displacement_mm[-1]
    straight = {mu: end(mu, 0.0) for mu in (0.0, MU)}
    assert np.abs(end(MU, -0.3) - straight[MU])[..., 0].max() > 1e-3
    assert np.abs(end(0.0, -0.3) - straight[0.0]).max() < 2e-4      # facets under other points, 0.1 um of overlap


@pytest.mark.slow
def test_a_mirrored_motion_gives_mirrored_maps():
    right, left = (sensor(MU).press(ball(), motion=Motion().press(depth_mm=0.1).slide(x_mm=way, steps=2), model="hyperelastic",
                                    label="") for way in (0.2, -0.2))
    np.testing.assert_allclose(left.deformation_map_mm[:, :, ::-1], right.deformation_map_mm, atol=2e-5)
    np.testing.assert_allclose(left.force_n * [-1, 1, 1], right.force_n, atol=2e-4)


def test_a_body_pressed_twice_gives_the_same_bytes():
    """What an earlier press left in multipliers, anchors, tangents and factors has no part in the next one."""
    spec = SMALL.model_copy(update={"friction": SMALL.friction.model_copy(update={"object": MU})})
    body = build_sensor_body(spec, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=COARSE)

    def surface(x, y):      # a cone, whose edges and multipliers change with every press that remembers
        height = 0.3 * np.hypot(x, y)
        slope = np.stack([0.3 * x, 0.3 * y], axis=-1) / np.maximum(np.hypot(x, y), 1e-9)[:, None]
        normal = np.column_stack([slope, -np.ones(len(x))])
        return height, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    straight = [[step.state.slab.displacement.tobytes() for step in press_load_steps(body, surface, [0.3, 1.0])] for _ in range(2)]
    motion = Motion().press(depth_mm=0.1).slide(y_mm=0.1)
    aside = [[step.state.slab.displacement.tobytes() for step in press_motion(body, surface, motion, 0.0)] for _ in range(2)]
    assert straight[0] == straight[1] and aside[0] == aside[1]


@pytest.mark.parametrize(("motion", "sentence"), [
    (Motion().press(depth_mm=0.1).step(ways={"rz": 5.0}), "neither turns an object nor loads it aside; use model='solid'"),
    (Motion().press(depth_mm=0.1).step(loads={"x": 1.0}), "neither turns an object nor loads it aside; use model='solid'"),
    (Motion().step(ways={"x": 0.1}, loads={"z": 2.0}), "Motion, step 1: the load z is 2 N, which does not press")])
def test_a_motion_that_the_model_cannot_do_is_refused_by_its_step(motion, sentence):
    with pytest.raises(InputError, match=sentence):
        sensor(MU).press(ball(), motion=motion, model="hyperelastic")


def test_the_foundation_model_takes_forces_only_and_one_of_force_and_motion_is_wanted():
    with pytest.raises(InputError, match="the foundation model presses straight down by force only"):
        sensor().press(ball(), motion=Motion().press(depth_mm=0.1), model="foundation")
    with pytest.raises(InputError, match="takes either force_n or motion"):
        sensor().press(ball(), model="hyperelastic")


def test_a_motion_of_forces_is_the_press_by_these_forces():
    by_motion, by_force = (sensor().press(ball(), model="hyperelastic", label="", **how)
                           for how in ({"motion": Motion().press(force_n=[0.1, 0.2])}, {"force_n": [0.1, 0.2]}))
    assert by_motion.deformation_map_mm.tobytes() == by_force.deformation_map_mm.tobytes()


def test_a_press_by_depth_goes_on_by_force_and_back():
    """Down by depth, on by the force of a deeper press, and up until the object lets go: one curve without friction."""
    deep = sensor().press(ball(), motion=Motion().press(depth_mm=0.1), model="hyperelastic", label="")
    motion = Motion().press(depth_mm=0.05).press(force_n=deep.normal_force_n[0]).step(ways={"z": 0.2})
    result = sensor().press(ball(), motion=motion, model="hyperelastic", label="")
    assert result.indentation_mm[1] == pytest.approx(0.1, rel=1e-3)
    # What is left: the tolerance of 1e-5 N over the softest stiffness of a frustum, 0.03 N/mm.
    assert result.normal_force_n[2] == 0.0 and np.abs(result.deformation_map_mm[2]).max() < 3e-4


def test_a_motion_presses_with_friction_as_forces_alone_do():
    """The force grows in the same increments, so friction finds the same path; a slide of a nanometre makes it a motion.

    On a free rim, which slides more, the pressure that friction is first guessed by changes the path by 1e-3.
    """
    spec = SMALL.model_copy(update={"friction": SMALL.friction.model_copy(update={"object": MU}), "edge": Edge(held="sides")})
    body = build_sensor_body(spec, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=COARSE)

    def surface(x, y):
        return 0.15 * (x**2 + y**2), np.column_stack([0.3 * x, 0.3 * y, -np.ones(len(x))]) / np.sqrt(
            1 + 0.09 * (x**2 + y**2))[:, None]

    *_, straight = press_load_steps(body, surface, [2.0], settings=TIGHT)
    first, _ = press_motion(body, surface, Motion().press(force_n=2.0).slide(x_mm=1e-6), 0.0, settings=TIGHT)
    assert first.state.indentation == pytest.approx(straight.state.indentation, rel=2e-4)


@pytest.mark.parametrize("lift_mm", [0.2, 3.0])
def test_a_load_after_a_step_without_contact_finds_the_cover_as_it_does_from_the_start(lift_mm):
    body = build_sensor_body(SMALL, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], mesh=COARSE)

    def surface(x, y):
        return 0.15 * (x**2 + y**2), np.column_stack([0.3 * x, 0.3 * y, -np.ones(len(x))]) / np.sqrt(
            1 + 0.09 * (x**2 + y**2))[:, None]

    (straight,) = press_load_steps(body, surface, [1.0], settings=TIGHT)
    lifted, pressed = press_motion(body, surface, Motion().step(ways={"z": lift_mm}).press(force_n=1.0), 0.0, settings=TIGHT)
    assert lifted.force_n == 0 and pressed.state.indentation == pytest.approx(straight.state.indentation, rel=2e-4)


def test_an_object_wider_than_the_pad_touches_where_it_is_over_the_pad():
    """All corners of a plate lie beside the pad; lifted by 1 mm it touches after 1 mm, from where its depth counts."""
    plate = trimesh.creation.box((20.0, 20.0, 1.0))
    low, lifted = (sensor().press(plate, pose=Pose.from_values([0, 0, height, 0, 0, 0]), motion=Motion().press(depth_mm=0.01),
                                  model="hyperelastic", label="") for height in (0.5, 1.5))
    assert lifted.indentation_mm[0] == pytest.approx(0.01) and lifted.normal_force_n[0] > 0.1
    np.testing.assert_allclose(lifted.deformation_map_mm, low.deformation_map_mm, atol=1e-6)


def test_a_depth_that_needs_more_force_than_the_sensor_bears_is_flagged():
    weak = sensor()
    weak.spec = weak.spec.model_copy(update={"force_range_n": (0.0, 0.5)})
    result = weak.press(ball(), motion=Motion().press(depth_mm=[0.15, 0.25]), model="hyperelastic", label="")
    bears = weak.spec.force_range_n[1]
    assert result.normal_force_n[0] < bears < result.normal_force_n[1] and result.within_validity.tolist() == [1, 0]


def pressed_ball(force_n, **options):
    """The load step of a ball on the small body, in a body of its own."""
    body, surface = small_body(), HeightField(place(ball()))
    load_step, = press_load_steps(body, surface, [force_n], settings=NewtonSettings.draft(), **options)
    body.close()
    return load_step


def test_a_run_that_stays_below_the_shell_ends_there(monkeypatch):
    """The shell stops the ball at 0.2 mm, which 20 N would press far deeper, in steps of 0.12 mm."""
    depths, accepted = [], newton._Press.accepted

    def noting(self, state, trial):
        depths.append(trial.indentation)
        accepted(self, state, trial)

    monkeypatch.setattr(newton._Press, "accepted", noting)
    load_step = pressed_ball(20.0, stop_mm=0.2)
    assert load_step.state.indentation == pytest.approx(0.2) and load_step.force_n == 20.0
    assert load_step.elsewhere_n == pytest.approx(20.0 - load_step.state.force) and 0 < load_step.state.force < 3.0
    assert (np.array(depths) > 0.2).sum() == newton._ASTRAY


def test_a_balance_above_the_shell_is_found_though_the_way_to_it_leads_below(monkeypatch):
    advance = path._advance

    def sent_below(body, surface, state, reached, stage, settings):
        if stage.deepest_mm < np.inf:
            raise path._BelowShell("below", state, reached)
        return advance(body, surface, state, reached, stage, settings)

    free = pressed_ball(0.5)
    monkeypatch.setattr(path, "_advance", sent_below)
    load_step = pressed_ball(0.5, stop_mm=1.5 * free.state.indentation)
    assert load_step.elsewhere_n == 0.0 and load_step.state.indentation == pytest.approx(free.state.indentation, rel=1e-3)


def test_the_way_to_the_shell_is_given_more_iterations_than_a_load_step(monkeypatch):
    """A cover that slips off an edge on that way takes 65 of the longest steps."""
    given, newton_of = [], path.settle

    def noting(body, surface, state, force, tolerance, settings, **options):
        given.append((force, settings.max_iterations))
        return newton_of(body, surface, state, force, tolerance, settings, **options)

    monkeypatch.setattr(path, "settle", noting)
    pressed_ball(20.0, stop_mm=0.2)
    by_force, to_shell = ({most for force, most in given if (force is None) == way} for way in (False, True))
    usual = NewtonSettings.draft().max_iterations
    assert by_force == {usual} and 65 < min(to_shell) == max(to_shell)


@pytest.mark.parametrize(("failures", "told"), [(1, 0), (2, 1), (3, 1)])
def test_a_press_whose_increments_find_no_balance_twice_tells_so_once_and_goes_on(monkeypatch, failures, told):
    settled, left = path.settle, [failures]

    def failing(body, surface, state, force, *given, **options):
        found = settled(body, surface, state, force, *given, **options)
        left[0] -= (fails := left[0] > 0)
        return replace(found, state=None) if fails else found

    monkeypatch.setattr(path, "settle", failing)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert pressed_ball(0.5).force_n == 0.5
    texts = [str(one.message) for one in caught if one.category is HardPressWarning]
    assert len(texts) == told
    assert all("the load step of 0.5 N was not reached: from 0 N" in text and "may end there" in text for text in texts)


@pytest.mark.parametrize(("friction", "rounds", "increment"), [(False, False, 0.15), (True, False, 0.05), (False, True, 0.05)])
def test_increments_to_the_shell_are_longer_where_neither_friction_nor_rounded_edges_forbid_it(friction, rounds, increment):
    slab = SimpleNamespace(top=SimpleNamespace(rounds_edges=rounds))
    body = SimpleNamespace(friction=SimpleNamespace(active=friction), slab=slab)
    begin, end = (path.Control(None, depth, np.zeros(2)) for depth in (0.0, 1.0))
    stage = path.ToStop(begin, end, 0.0, TIGHT.largest_way_mm, 1)
    assert stage.control(stage.reach(body, 0.0, TIGHT)).indentation == pytest.approx(increment)


def test_the_deepest_place_goes_with_the_object():
    """Centre of the map's depths under a ball without friction, 0.4 mm aside; a node's distance is 0.6 mm."""
    start, end = sensor().press(ball(), motion=Motion().press(depth_mm=0.1).slide(x_mm=0.4, y_mm=-0.2), model="hyperelastic",
                                label="").deformation_map_mm
    x, y = np.meshgrid(SMALL.map_x_mm, SMALL.map_y_mm)
    centre = [np.array([(depth * line).sum() / depth.sum() for line in (x, y)]) for depth in (start.clip(0.0), end.clip(0.0))]
    np.testing.assert_allclose(centre[1] - centre[0], [0.4, -0.2], atol=0.15)
