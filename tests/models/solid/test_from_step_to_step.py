"""What goes on from step to step of a path: the penalty of a contact, and the loads of freedoms that a step does not name."""

import numpy as np
import pytest
import trimesh

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.frames import FramePose
from softtact.models.solid.path import SolidPath


def block_under_a_plate():
    """A bonded block of 2 x 2 x 1 mm and a rigid plate that lies on it."""
    mesh = box((-1, -1, 0), (1, 1, 1), (3, 3, 2))
    plate = trimesh.creation.box((4, 4, 1))
    plate.apply_translation([0, 0, 1.5])
    body = SolidBody(mesh, {"body": make_law("neo_hooke", {"c10": 0.1})}, held={"z0": "xyz"},
                     rigid={"plate": ((0, 0, 1), plate.triangles)})
    body.add(ContactPair(Surface.of(mesh.face("z1")), Surface.of({"triangle": body.surface_nodes("plate")}), stiffness=20.0,
                              reach_mm=0.5, rigid=True))
    return body


def test_a_load_stays_while_a_later_step_tilts_the_object():
    body = block_under_a_plate()
    steps = list(SolidPath(body, {"plate": Motion().press(force_n=0.2).step(ways={"rx": 2.0})}).run())
    assert [step.loads[0, 2] for step in steps] == pytest.approx([-0.2, -0.2], rel=1e-4)
    heights = [step.state.poses[0].translation[2] for step in steps]
    assert heights[1] > heights[0], "it rises, for one side presses more"


@pytest.mark.parametrize("gap", [0.0005, 0.3])
def test_a_soft_object_that_hangs_above_is_brought_to_touch_before_its_load_acts(gap):
    lower = box((-1, -1, 0), (1, 1, 1), (3, 3, 2), region="lower")
    upper = box((-0.5, -0.5, 1 + gap), (0.5, 0.5, 2 + gap), (2, 2, 2))
    mesh, law = lower.joined(upper, prefix="upper "), make_law("neo_hooke", {"c10": 0.1})
    body = SolidBody(mesh, {"lower": law, "upper body": law}, held={"z0": "xyz"}, carried={"holder": ((0, 0, 2), ["upper z1"])})
    body.add(ContactPair(Surface.of(mesh.face("z1")), Surface.of(mesh.face("upper z0")), stiffness=20.0, reach_mm=0.5,
                              segments=True))
    (step,) = SolidPath(body, {"holder": Motion().press(force_n=0.05)}).run()
    assert step.loads[0, 2] == pytest.approx(-0.05, rel=1e-5)
    assert -gap - 0.3 < step.state.poses[0].translation[2] < -gap


def test_the_penalty_of_a_plate_pressed_in_eight_steps_is_no_larger_than_in_one():
    body, motion = block_under_a_plate(), Motion()
    for _ in range(8):
        motion = motion.step(ways={"z": -0.02})
    largest = [step.state.histories[0].stiffness for step in SolidPath(body, {"plate": motion}).run()]
    (once,) = SolidPath(body, {"plate": Motion().step(ways={"z": -0.16})}).run()
    assert max(largest) <= once.state.histories[0].stiffness


@pytest.mark.parametrize("way_mm", [1.0, 1000.0])
def test_a_block_that_nothing_holds_moves_freely_although_rounding_leaves_some_force(way_mm):
    """Without loads every share of them is zero: only rounding tells that the balance is found."""
    body = SolidBody(box((-5, -5, 0), (5, 5, 10), (2, 2, 2)), {"body": make_law("neo_hooke", {"c10": 0.1})}, held={"z0": "xy"},
                     carried={"grip": ((0, 0, 10), ["z1"], "z")})
    (step,) = SolidPath(body, {"grip": Motion().step(ways={"z": way_mm})}).run()
    assert step.state.displacement[:, 2] == pytest.approx(way_mm, rel=1e-12) and step.increments == 1
    pulled = 0.6 * 100 * 1e-9       # N: Young's modulus, area, and a strain that no press resolves
    assert step.residual_n <= body.rounding_n(step.state) < pulled


def test_a_step_that_is_too_large_is_divided_with_its_reason_and_no_force_of_the_balance_before():
    told = []
    body = SolidBody(box((-1, -1, 0), (1, 1, 2), (2, 2, 2)), {"body": make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=2000)},
                     held={"z0": "xyz"}, carried={"grip": ((0, 0, 2), ["z1"])})
    (step,) = SolidPath(body, {"grip": Motion().step(ways={"z": -1.3})}, tell=told.append).run()
    assert step.increments > 1 and told[0] == "increment divided: The prescribed step turns an element inside out."


@pytest.mark.parametrize("torque_nmm", [0.02, 0.1])
def test_a_torque_tilts_an_object_without_friction_until_the_surface_bears_it(torque_nmm):
    told, loads = [], {"z": -0.2, "rx": torque_nmm}
    _, tilted = SolidPath(block_under_a_plate(), {"plate": Motion().press(force_n=0.2).step(loads=loads)}, tell=told.append).run()
    assert tilted.loads[0, [2, 3]] == pytest.approx([-0.2, torque_nmm], rel=1e-4) and not told
    assert tilted.state.poses[0].step_from(FramePose())[3] > 0, "it turns in the sense of its torque"


@pytest.mark.parametrize("step", [[0.1, -0.2, 0.3, 0.4, 0.5, -0.6], [0, 0, 0, 0, 0, 3.0]])
def test_the_step_from_one_pose_to_another_leads_there(step):
    before = FramePose().moved(np.array([1.0, 2.0, 3.0, 0.7, -0.8, 0.9]))
    assert before.moved(np.array(step)).step_from(before) == pytest.approx(step, abs=1e-12)


def test_the_work_of_a_bar_twisted_by_60_degrees_in_one_step_is_its_strain_energy():
    body = SolidBody(box((-1, -1, 0), (1, 1, 4), (3, 3, 4)), {"body": make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=50)},
                     held={"z0": "xyz"}, carried={"grip": ((0, 0, 4), ["z1"])})
    (step,) = SolidPath(body, {"grip": Motion().turn(z_deg=60)}).run()
    assert step.work_mj == pytest.approx(step.state.strain_energy, rel=0.01)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("ways", [{"x": 0.1}, {"x": 0.37}, {"rz": 10.0}])
def test_an_object_that_lies_on_the_surface_is_moved_aside_or_turned_at_once(ways, friction):
    body = block_under_a_plate()
    body.items[0].friction = friction
    (step,) = SolidPath(body, {"plate": Motion().step(ways=ways)}).run()
    assert step.increments == 1 and step.iterations <= 10
    assert step.residual_n < 1e-6 * 20.0 * 1e-3 * 4.0, "N: penalty, overlap and area, and a millionth of their product"


@pytest.mark.parametrize("before", [
    [{"z": 0.1}], [{"z": 1.5}], [{"z": -0.1}, {"z": 0.2}], [{"x": 0.37}, {"x": -0.37}], [{}]])
def test_a_load_after_a_step_without_contact_finds_the_surface_as_it_does_from_the_start(before):
    motion = Motion()
    for ways in before:
        motion = motion.step(ways=ways)
    *_, loaded = SolidPath(block_under_a_plate(), {"plate": motion.press(force_n=0.2)}).run()
    (straight,) = SolidPath(block_under_a_plate(), {"plate": Motion().press(force_n=0.2)}).run()
    assert loaded.loads[0] == pytest.approx(straight.loads[0], abs=2e-6) and loaded.increments == 1
    assert loaded.state.poses[0].translation == pytest.approx(straight.state.poses[0].translation, abs=1e-5)


def test_a_load_on_an_object_that_the_surface_bears_goes_on_from_there():
    motion = Motion().press(force_n=[0.1, 0.2])
    path = SolidPath(block_under_a_plate(), {"plate": motion})
    first, _ = path.run()
    assert path._bears(first.state, {"plate": motion.steps[1]})
    assert not path._bears(path.body.rest(), {"plate": motion.steps[1]})
