"""A sensor's layers as a solid on frusta, under a rigid object that is pressed, twisted and rolled."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.frustum_laws import made_up

import softtact
from softtact.contact.motion import Motion
from softtact.contact.surface_places import places
from softtact.errors import InputError
from softtact.geometry.meshes import place
from softtact.models.solid.frusta import FrustumItem
from softtact.models.solid.path import SolidPath
from softtact.press.solid_pad import OBJECT, SolidPad


@pytest.mark.parametrize("side", [4.0, 30.0], ids=["narrow", "wide"])
def test_every_frustum_stands_below_the_sheet_once_and_follows_its_mean_descent(side):
    sensor = replace(softtact.load_sensor("coro"), prepared_models={"frustum": made_up()})
    body = SolidPad(sensor).with_rigid(trimesh.creation.box((side, side, 4)), threads=1)
    frusta = [item for item in body.items if isinstance(item, FrustumItem)]
    assert sum(len(item.nodes) for item in frusta) == 18 * 30 and (len(frusta) > 1) == (side == 4.0)
    down = np.zeros_like(body.points)
    down[:, 2] = -0.1 - 0.01 * body.points[:, 0]
    for item in frusta:
        middle = 0.5 * (body.points[item.nodes].min(axis=1) + body.points[item.nodes].max(axis=1))
        np.testing.assert_allclose(item.compressions(down), 0.1 + 0.01 * middle[:, 0], atol=1e-12)


def test_an_object_beside_the_sensor_is_refused():
    sensor = softtact.load_sensor("pad4x4")
    far = trimesh.creation.box((1, 1, 1)).apply_translation((30, 0, 0))
    with pytest.raises(InputError, match="nothing of it is over the 10 x 16 mm footprint"):
        SolidPad(sensor).with_rigid(far, threads=1)


def ball(radius=5.0):
    return trimesh.creation.icosphere(subdivisions=4, radius=radius)


def steps_of(sensor, mesh, motion, *, friction, pose=None):
    """The pad, the body and the load steps of a rigid mesh that is moved."""
    pad = SolidPad(sensor)
    body = pad.with_rigid(place(mesh, pose=pose), friction=friction, threads=1)
    return pad, body, list(SolidPath(body, {OBJECT: motion}).run())


@pytest.fixture(scope="module")
def twisted():
    """A ball of 5 mm, 0.2 mm deep in pad4x4 with mu = 0.2, twisted by 2 and by 30 more degrees."""
    motion = Motion().step(ways={"z": -0.2}).step(ways={"rz": 2.0}).step(ways={"rz": 30.0})
    return steps_of(softtact.load_sensor("pad4x4"), ball(), motion, friction=0.2)


@pytest.mark.slow
def test_a_twist_that_slides_needs_the_torque_of_coulombs_law(twisted):
    """Expected: the integral of mu p r over the contact. 15 degrees about its middle slide all but the innermost points."""
    _, body, steps = twisted
    history, contact = steps[-1].state.histories[0], steps[-1].state.contacts[0]
    places_mm = places(history.points, body.points + steps[-1].state.displacement)
    expected = 0.2 * history.points.weight @ (contact.pressure * np.hypot(*places_mm[:, :2].T))
    assert contact.slides[contact.pressure > 0].mean() > 0.9
    assert steps[-1].loads[0, 5] == pytest.approx(expected, rel=0.02)
    assert 0 < steps[1].loads[0, 5] < 0.9 * expected


@pytest.mark.slow
def test_work_of_press_and_twist_is_stored_or_dissipated(twisted):
    """The trapezoidal rule over the press leaves some percent; over the twist alone the balance is near."""
    _, _, steps = twisted
    work, stored = (np.array([getattr(step, name) for step in steps]) for name in ("work_mj", "dissipated_mj"))
    energy = np.array([step.state.strain_energy for step in steps])
    assert stored[-1] - stored[1] > 0.5 * (work[-1] - work[1])
    assert work[-1] - work[0] == pytest.approx(energy[-1] - energy[0] + stored[-1] - stored[0], rel=0.05)


@pytest.mark.slow
def test_a_roll_to_the_other_side_is_the_mirror_image():
    """Of a ball that is pressed and rolled about y by plus and minus 4 degrees: forces aside and torques change their sign."""
    sensor, found = softtact.load_sensor("pad4x4"), []
    for sign in (1, -1):
        motion = Motion().step(ways={"z": -0.15}).step(ways={"ry": sign * 4.0})
        pad, body, steps = steps_of(sensor, ball(), motion, friction=0.3)
        found.append((steps[-1].loads[0], pad.result(body, steps).deformation_map_mm[-1]))
    (one, its_map), (other, other_map) = found
    scale = np.abs(one).max()
    np.testing.assert_allclose(one * [-1, 1, 1, 1, -1, -1], other, atol=2e-3 * scale)
    np.testing.assert_allclose(its_map, other_map[:, ::-1], atol=2e-3 * its_map.max())
    assert abs(one[0]) > 0.02 * abs(one[2])
