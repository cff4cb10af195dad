"""Points that come to touch within a step: their slip begins where they met the object, and anew after they left it."""

import pytest
import trimesh

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath


def ball_on_a_block():
    """A rigid ball of 4 mm beside the middle of a bonded block that it just touches."""
    mesh, ball = box((-2, -2, 0), (2, 2, 1.5), (6, 6, 2)), trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    ball.apply_translation([0.3, 0, 5.5])
    return pressed_by(mesh, make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=10), ball, friction=0.4)


def plate_on_a_block(*, segments=False):
    """A slippery rigid plate that covers a block that does not bulge."""
    plate = trimesh.creation.box((4, 4, 1))
    plate.apply_translation([0, 0, 1.5])
    law = make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=2 / 3)
    return pressed_by(box((-1, -1, 0), (1, 1, 1), (3, 3, 2)), law, plate, friction=0.002, segments=segments)


def pressed_by(mesh, law, rigid, *, friction, segments=False):
    body = SolidBody(mesh, {"body": law}, held={"z0": "xyz"}, rigid={"object": ((0, 0, 1), rigid.triangles)})
    body.add(ContactPair(Surface.of(mesh.face("z1")), Surface.of({"triangle": body.surface_nodes("object")}), stiffness=30.0,
                         reach_mm=0.8, friction=friction, rigid=True, segments=segments))
    return body


def moved(body, *ways):
    """A load step for each of some displacements."""
    motion = Motion()
    for way in ways:
        motion = motion.step(ways=way)
    return list(SolidPath(body, {"object": motion}).run())


def ball_in(count, **ways):
    """The last of so many equal steps of the ball that together move it by `ways`."""
    return moved(ball_on_a_block(), *count * [{name: way / count for name, way in ways.items()}])[-1]


def slid(step):
    """(p,) in mm of the points under pressure."""
    (history,), (contact,) = step.state.histories, step.state.contacts
    return (history.slid + contact.slid_mm)[contact.pressure > 0]


def test_points_slip_in_one_step_straight_down_hardly_farther_than_in_eight():
    once, often = (slid(ball_in(count, z=-0.12)) for count in (1, 8))
    assert len(once) == pytest.approx(len(often), abs=4)
    assert once.mean() < often.mean() + 1e-3 and once.max() < often.max() + 5e-3, "mm; the most at the rim, under little pressure"


def test_the_force_aside_of_a_press_down_and_aside_in_one_step_is_nearly_that_of_eight_steps():
    once, often = (ball_in(count, z=-0.12, x=0.04).loads[0, 0] for count in (1, 8))
    assert once == pytest.approx(often, rel=0.08)


@pytest.mark.parametrize("segments", [False, True])
def test_a_plate_that_comes_down_obliquely_slides_from_where_it_touched_and_takes_work_from_there(segments):
    _, step = moved(plate_on_a_block(segments=segments), {"z": 0.3}, {"z": -0.4, "x": 0.08})
    friction = 0.002 * -step.loads[0, 2]
    assert slid(step).mean() == pytest.approx(0.02, rel=0.1), "mm: a quarter of the way; the surface follows a little"
    assert step.loads[0, 0] == pytest.approx(friction, rel=0.02)
    assert step.dissipated_mj == pytest.approx(friction * slid(step).mean(), rel=0.02)


def test_the_slip_begins_anew_where_an_object_comes_back():
    _, slid_on, gone, back = moved(plate_on_a_block(), {"z": -0.1}, {"x": 0.05}, {"z": 0.2}, {"z": -0.2})
    assert slid(slid_on).mean() > 0.04 and not len(slid(gone)) and slid(back).max() < 0.01, "mm"
