"""Gels in the environment for learning: they carry the scene's forces, and their markers move as the object drags them."""

import numpy as np
import pytest
import trimesh
from support.gels import SMALL_GEL

from softtact.errors import InputError

gymnasium = pytest.importorskip("gymnasium", reason="pip install 'softtact[robot]'")
pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")

ID = "softtact.robot.environment:softtact/Grasp-v0"
STILL = {"x_mm": 0.0, "y_mm": 0.0, "angle_deg": 0.0}

@pytest.fixture(scope="module")
def gel(tmp_path_factory):
    path = tmp_path_factory.mktemp("gel") / "small_gel.yaml"
    path.write_text(SMALL_GEL)
    return str(path)


@pytest.fixture(scope="module")
def grasp(gel):
    """(environment, observation at rest, in the grip, after a slide) of one episode."""
    env = gymnasium.make(ID, mesh=trimesh.creation.box((6, 8, 20)), sensor=gel, mass_kg=0.1)
    rest, _ = env.reset(seed=1, options=STILL)
    held = [env.step(np.array([-0.6, 0.0, 0.0]))[0] for _ in range(30)][-1]
    slid = [env.step(np.array([-0.6, 0.0, 1.0]))[0] for _ in range(10)][-1]
    return env, rest, held, slid


def test_observations_are_the_readouts_of_both_gels(grasp):
    env, rest, held, _ = grasp
    assert rest["camera"].shape == (2, 48, 64, 3) and rest["camera"].dtype == np.uint8 and rest["markers"].shape == (2, 15, 2)
    assert env.observation_space.contains(rest) and env.observation_space.contains(held)
    assert np.abs(held["camera"].astype(int) - rest["camera"]).max() > 20


def carried(touch):
    """Force (3,) in N of the object on a gel."""
    state = touch.mover._state
    return np.append(state.tangential.sum(axis=(1, 2)), -state.normal.sum())


def test_a_gel_carries_the_weight_of_what_it_holds(gel):
    env = gymnasium.make(ID, mesh=trimesh.creation.box((6, 8, 20)), sensor=gel, mass_kg=0.4)
    env.reset(seed=1, options=STILL)
    plan = [(-0.6, 0.0)] * 30 + [(-0.6, 0.2)] * 20 + [(-0.6, 0.0)] * 10
    held = [env.step(np.array([grip, lift, 0.0]))[0] for grip, lift in plan][-1]
    touches = env.unwrapped.readings._touches
    assert sum(abs(carried(touch)[1]) for touch in touches.values()) == pytest.approx(0.4 * 9.81, rel=0.05)     # y is upright
    for finger, touch in touches.items():
        force, bound = held["force_n"][finger], 0.8 * -held["force_n"][finger, 2]     # 0.8: the scene's friction
        assert carried(touch)[2] == pytest.approx(force[2], rel=1e-3)
        assert np.linalg.norm(carried(touch)[:2] - force[:2]) < 0.03 * bound     # 0.02 of it, and what follows in the next call


def test_a_gel_over_which_an_object_slides_carries_most_of_what_friction_does(grasp):
    env, _, _, slid = grasp
    for finger, touch in env.unwrapped.readings._touches.items():
        force, bound = slid["force_n"][finger], 0.8 * -slid["force_n"][finger, 2]
        assert carried(touch)[2] == pytest.approx(force[2], rel=1e-4)
        assert 0.7 * bound < np.linalg.norm(carried(touch)[:2]) <= bound * (1 + 1e-6)
        assert carried(touch)[:2] @ force[:2] > 0.95 * np.linalg.norm(carried(touch)[:2]) * np.linalg.norm(force[:2])


def test_a_gel_is_pressed_where_the_object_has_slid_to(grasp):
    env, _, held, slid = grasp
    touch = env.unwrapped.readings._touches[0]
    normal, (x, y) = touch.mover._state.normal, touch.mover.points
    middle = np.array([x[normal > 0].mean(), y[normal > 0].mean()])
    assert slid["object_pose"][0] - held["object_pose"][0] > 1.2
    assert np.abs(middle - slid["object_pose"][:2]).max() < 0.5     # mm, the distance of the map's points


def test_markers_move_with_the_object_that_drags_them(grasp):
    _, rest, held, slid = grasp
    along, moved = slid["force_n"][0, :2], (slid["markers"] - held["markers"])[0]
    under = np.abs(held["markers"] - rest["markers"])[0].sum(axis=1).argsort()[-5:]
    assert np.linalg.norm(moved[under].mean(axis=0)) > 0.3                        # px of 0.3 mm
    direction = moved[under].mean(axis=0) / np.linalg.norm(moved[under].mean(axis=0))
    assert abs(direction @ (along / np.linalg.norm(along))) > 0.95


def test_a_gel_that_is_free_again_is_at_rest(grasp):
    env, rest, *_ = grasp
    for _ in range(15):
        opened = env.step(np.array([-1.0, 0.0, 0.0]))[0]
    assert np.array_equal(opened["camera"], rest["camera"]) and np.array_equal(opened["markers"], rest["markers"])


def test_another_model_than_the_one_that_follows_is_refused(gel):
    with pytest.raises(InputError, match="model='foundation': a gel with a camera has the elastic model alone"):
        gymnasium.make(ID, sensor=gel, model="foundation")
