"""A sensor's layers as a solid on frusta, under a rigid object that is pressed, twisted and rolled."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.frustum_laws import made_up
from support.meshed_frusta import punch_surface

import softtact
from softtact.contact.motion import Motion
from softtact.contact.surface_places import places
from softtact.errors import InputError
from softtact.geometry.meshes import place
from softtact.models.solid.frusta import FrustumItem
from softtact.models.solid.path import SolidPath
from softtact.press import solid_pad
from softtact.press.solid_pad import OBJECT, SolidPad
from softtact.sensors.fields import Edge


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
    with pytest.raises(InputError, match="no part of it is over the 10 x 16 mm footprint"):
        SolidPad(sensor).with_rigid(far, threads=1)


def small_sensor():
    """3 x 3 frusta of coro with free sides, on frusta of a law that needs no unit cell."""
    coro = softtact.load_sensor("coro")
    spec = coro.spec.model_copy(update={"footprint_mm": (3.6, 3.6), "edge": Edge(held="free"), "map_shape": (7, 7)})
    return replace(coro, spec=spec, prepared_models={"frustum": made_up()})


def steps_of(sensor, motion, *, friction):
    """The pad, the body and the load steps of a round punch that is moved."""
    pad = SolidPad(sensor)
    body = pad.with_rigid(place(punch_surface()), friction=friction, threads=1)
    return pad, body, list(SolidPath(body, {OBJECT: motion}).run())


@pytest.fixture(scope="module")
def twisted():
    """The punch 0.2 mm deep with mu = 0.2, twisted by 20 degrees in five steps."""
    motion = Motion().step(ways={"z": -0.2})
    for turn in (2.0, 2.0, 3.0, 5.0, 8.0):
        motion = motion.step(ways={"rz": turn})
    return steps_of(small_sensor(), motion, friction=0.2)


@pytest.mark.slow
def test_a_twist_that_slides_needs_the_torque_of_coulombs_law(twisted):
    """Expected: the integral of mu p r over the contact, of which 20 degrees slide all but the innermost points."""
    _, body, steps = twisted
    history, contact = steps[-1].state.histories[0], steps[-1].state.contacts[0]
    places_mm = places(history.points, body.points + steps[-1].state.displacement)
    expected = 0.2 * history.points.weight @ (contact.pressure * np.hypot(*places_mm[:, :2].T))
    assert contact.slides[contact.pressure > 0].mean() > 0.9
    assert steps[-1].loads[0, 5] == pytest.approx(expected, rel=0.02)
    assert 0 < steps[1].loads[0, 5] < 0.9 * expected


def test_what_a_twist_works_is_stored_or_dissipated(twisted):
    """Over the twist alone, from the pressed state on; the trapezoidal rule over five steps leaves some percent."""
    _, _, steps = twisted
    work, dissipated = (steps[-1].__dict__[name] - steps[0].__dict__[name] for name in ("work_mj", "dissipated_mj"))
    stored = steps[-1].state.strain_energy - steps[0].state.strain_energy
    assert dissipated > 0.5 * work > 0
    assert stored + dissipated == pytest.approx(work, rel=0.1)


@pytest.mark.slow
def test_a_roll_to_the_other_side_is_the_mirror_image():
    """Pressed and rolled about y by plus and minus 3 degrees: forces aside and torques change their sign, the map its sides."""
    sensor, found = small_sensor(), []
    for sign in (1, -1):
        motion = Motion().step(ways={"z": -0.2}).step(ways={"ry": sign * 3.0})
        pad, body, steps = steps_of(sensor, motion, friction=0.3)
        found.append((steps[-1].loads[0], pad.result(body, steps).deformation_map_mm[-1]))
    (one, its_map), (other, other_map) = found
    np.testing.assert_allclose(one * [-1, 1, 1, 1, -1, -1], other, atol=5e-3 * np.abs(one).max())
    np.testing.assert_allclose(its_map, other_map[:, ::-1], atol=5e-3 * its_map.max())
    assert abs(one[0]) > 0.02 * abs(one[2])


def test_layers_without_frusta_are_pressed_and_twisted_too(monkeypatch):
    """pad4x4 with few elements: by 0.5 N, then 5 degrees; the force stays, and a torque about z comes up, less than mu F a."""
    monkeypatch.setattr(solid_pad, "_CELL_OF_LAYERS", 5)
    monkeypatch.setattr(solid_pad, "_MOST_PARTS", 1)
    motion = Motion().press(force_n=0.5).step(ways={"rz": 5.0})
    pad, body, steps = steps_of(softtact.load_sensor("pad4x4"), motion, friction=0.3)
    result = pad.result(body, steps)
    assert result.normal_force_n == pytest.approx([0.5, 0.5], rel=1e-4)
    assert abs(result.torque_nmm[0, 2]) < 1e-3 < result.torque_nmm[1, 2] * -np.sign(steps[1].loads[0, 2]) < 0.3 * 0.5 * 1.5
    cells, spec = pad._cells_mm2, pad.sensor.spec
    x, y = np.meshgrid(spec.map_x_mm, spec.map_y_mm)
    np.testing.assert_allclose(np.einsum("yx,lyxi->li", cells, result.traction_mpa), result.force_n, atol=1e-9)
    moment = np.einsum("yx,lyx->l", cells, x * result.traction_mpa[..., 1] - y * result.traction_mpa[..., 0])
    assert moment[1] == pytest.approx(result.torque_nmm[1, 2], rel=0.03)     # at the places at rest
    touching = np.isfinite(result.slip)
    assert (touching == (result.traction_mpa[..., 2] < 0)).all() and 0 < touching[1].mean() < 0.2
    assert np.nanmax(result.slip[1]) > np.nanmax(result.slip[0])
