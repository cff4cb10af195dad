"""A press with shear has the forces that were asked for, turns with them, and slips where friction does not carry them."""

import numpy as np
import pytest
import trimesh

import softtact
from softtact.errors import InputError
from softtact.robot.events import press_with_shear


@pytest.fixture(scope="module")
def sensor():
    return softtact.load_sensor("pad4x4").with_friction(0.5)


@pytest.fixture(scope="module")
def ball():
    return trimesh.creation.icosphere(3, radius=4.0)


@pytest.mark.parametrize("shear", [(0.2, 0.0), (0.1, -0.3), (0.0, 0.45)], ids=["x", "aslant", "most of what friction carries"])
def test_both_forces_are_those_asked_for(sensor, ball, shear):
    found = press_with_shear(sensor, ball, None, force_n=1.0, shear_n=np.array(shear), threads=1)
    assert found.result.normal_force_n[-1] == pytest.approx(1.0, rel=1e-3)
    np.testing.assert_allclose(found.shear_n, shear, atol=0.01 * np.linalg.norm(shear) + 1.1e-3)
    assert found.slide_mm @ np.array(shear) > 0          # the object goes where it pushes


def test_the_way_is_found_in_a_few_presses(sensor, ball, monkeypatch):
    presses, press = [], type(sensor).press

    def counted(*given, **options):
        presses.append(options["motion"])
        return press(*given, **options)

    monkeypatch.setattr(type(sensor), "press", counted)
    press_with_shear(sensor, ball, None, force_n=1.0, shear_n=np.array([0.1, -0.1]), threads=1)
    assert len(presses) <= 3      # a probe, a step of Newton's method, and one that mends what has slid


@pytest.mark.slow
def test_the_opposite_shear_is_felt_mirrored(sensor, ball):
    one, other = (press_with_shear(sensor, ball, None, force_n=1.0, shear_n=np.array([sign * 0.3, 0.0]), threads=1).result
                  for sign in (1, -1))
    maps = one.deformation_map_mm[-1], other.deformation_map_mm[-1]
    assert np.abs(maps[0] - maps[1][:, ::-1]).max() < 0.02 * maps[0].max()
    straight = one.deformation_map_mm[0]
    assert np.abs(maps[0] - straight).max() > 0.005 * straight.max()      # shear tilts what a pressed layer shows


@pytest.mark.parametrize(("options", "message"), [
    ({"shear_n": np.array([0.6, 0.0])}, "slips under 1 N: friction carries less than 0.5 N"),
    ({"shear_n": np.array([0.1, 0.0]), "model": "foundation"}, "shear is pressed with elastic or hyperelastic")])
def test_what_cannot_be_pressed_is_refused(sensor, ball, options, message):
    with pytest.raises(InputError, match=message):
        press_with_shear(sensor, ball, None, force_n=1.0, **options)
