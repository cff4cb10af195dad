"""The environment for learning: Gymnasium's rules, the same episode for the same seed, and physics that a policy can rely on."""

import warnings

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.pose import Pose

gymnasium = pytest.importorskip("gymnasium", reason="pip install 'softtact[robot]'")
mujoco = pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")

ID = "softtact.robot.environment:softtact/Grasp-v0"
CLOSE, HOLD, LIFT, SLIDE = (0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.2, 1.0, 0.0), (-0.6, 0.0, 1.0)
STILL = {"x_mm": 0.0, "y_mm": 0.0, "angle_deg": 0.0}


@pytest.fixture(scope="module")
def env():
    return gymnasium.make(ID)


def play(env, *plan, seed=1, options=None):
    """Observations of an episode; plan: (action, steps)."""
    seen = [env.reset(seed=seed, options=options)[0]]
    rewards = []
    for action, steps in plan:
        for _ in range(steps):
            observation, reward, ended, cut, info = env.step(np.array(action, dtype=np.float32))
            seen.append(observation)
            rewards.append(reward)
            if ended or cut:
                return seen, rewards, ended, info
    return seen, rewards, False, info


def test_gymnasium_s_checker_has_nothing_against_it(env):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*infinity.*")     # forces and poses have no bounds
        check_env(env.unwrapped)


def test_observations_are_of_both_fingers_with_stated_types(env):
    first = play(env, (CLOSE, 1))[0][0]
    assert {name: (value.shape, value.dtype.name) for name, value in first.items()} == {
        "tactile": ((2, 7, 4), "uint16"), "force_n": ((2, 3), "float32"), "object_pose": ((7,), "float32")}
    assert not first["tactile"].any() and not first["force_n"].any()


def test_an_object_that_turns_in_the_hand_has_not_risen_wherever_its_mesh_has_its_origin():
    """Turns of 5 degrees at rest in the middle of the grip, by one of which the mesh's origin rises by 26 mm."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=9.0)
    for origin in ((0.0, 0.0, 0.0), (300.0, 0.0, 0.0)):
        one = gymnasium.make(ID, mesh=ball.copy().apply_translation(origin)).unwrapped
        one.reset(seed=1, options=STILL)
        middle, free = one._data.body("object").xipos.copy(), one._data.joint("object").qpos
        for turn in Rotation.from_euler("xyz", 5 * np.eye(3), degrees=True):
            free[:3] = middle + turn.apply(free[:3] - middle)
            free[3:] = (turn * Rotation.from_quat(free[3:], scalar_first=True)).as_quat(scalar_first=True)
            mujoco.mj_forward(one._scene.model, one._data)
            assert abs(one.scene_facts()["risen_mm"]) < 0.01


def test_a_seed_gives_the_same_episode_and_another_one_another(env):
    plan = ((CLOSE, 30), (HOLD, 10))
    one, same, other = (play(env, *plan, seed=seed)[0] for seed in (3, 3, 4))
    assert all(np.array_equal(a[name], b[name]) for a, b in zip(one, same, strict=True) for name in a)
    assert not np.array_equal(one[-1]["object_pose"], other[-1]["object_pose"])


def test_a_policy_that_closes_and_lifts_earns_the_whole_height(env):
    _, rewards, ended, info = play(env, (CLOSE, 40), (HOLD, 10), (LIFT, 120))
    assert ended and sum(rewards) == pytest.approx(info["risen_mm"] / 40.0, abs=1e-9) and info["risen_mm"] > 39


def test_an_unknown_option_of_a_reset_is_refused(env):
    with pytest.raises(InputError, match="the option 'x' is unknown; use one of x_mm, y_mm, angle_deg"):
        env.reset(options={"x": 1.0})


def test_a_lift_with_too_little_force_loses_the_object(env):
    heavy = gymnasium.make(ID, mass_kg=2.0, mesh=trimesh.creation.box((16, 16, 20)))     # slips below 2 x 9.81 / (2 x 0.8) = 12.3 N
    _, rewards, ended, info = play(heavy, ((-0.3, 0.0, 0.0), 40), ((-0.3, 1.0, 0.0), 200), options=STILL)     # 10.5 N
    assert ended and info["risen_mm"] < -20 and sum(rewards) < 0


def test_while_the_fixture_holds_the_object_the_hand_slides_over_it(env):
    seen, *_ = play(env, (CLOSE, 40), (SLIDE, 20), options=STILL)
    before, after = seen[40], seen[-1]
    assert after["object_pose"][0] - before["object_pose"][0] == pytest.approx(4.0, abs=1.0)     # 20 steps of 0.2 mm, less the lag
    share = [np.arange(4) @ one["tactile"][0].sum(axis=0) / one["tactile"][0].sum() for one in (before, after)]
    assert share[1] > share[0] + 0.2      # the pattern moves towards larger x on the left sensor


def test_taxels_are_those_of_a_press_at_that_place_and_force(env):
    seen, *_ = play(env, (CLOSE, 40), (HOLD, 20), options=STILL)
    inner = env.unwrapped
    force = float(-seen[-1]["force_n"][0, 2])
    exact = inner._sensor.press(inner._mesh, pose=Pose.from_values([0] * 6), force_n=[force], model="elastic", threads=1)
    assert force == pytest.approx(18.0, rel=0.01)
    assert np.abs(seen[-1]["tactile"][0] - exact.tactile_map[0]).max() <= 0.02 * exact.tactile_map.max()     # linear between forces


def test_a_force_above_the_largest_whose_map_is_the_reading_is_told():
    weak = gymnasium.make(ID, largest_force_n=0.5)
    weak.unwrapped.largest_force_n = 1.0     # of the fingers' motors, after the readings were made for 0.5 N
    seen, *_, info = play(weak, ((1.0, 0.0, 0.0), 40), options=STILL)
    assert info["force_above_largest_n"] == pytest.approx(-seen[-1]["force_n"][:, 2] - 0.5, rel=1e-5)
    assert info["force_above_largest_n"].min() > 0.3
    assert not play(weak, ((-0.5, 0.0, 0.0), 1))[-1]["force_above_largest_n"].any()


@pytest.mark.parametrize(("largest_n", "grip"), [(0.3, 1.0), (30.0, -0.98)])
def test_closed_fingers_press_with_their_share_of_the_largest_force_below_a_newton_too(largest_n, grip):
    """0.3 N each; the pads lie on the object before its share is set, for which the open fingers' motors have 1 N."""
    force = -play(gymnasium.make(ID, largest_force_n=largest_n), ((grip, 0.0, 0.0), 60), options=STILL)[0][-1]["force_n"][:, 2]
    assert force == pytest.approx([0.3, 0.3], abs=0.03)


def test_a_refused_reset_changes_no_episode_and_no_later_draw(env):
    env.reset(seed=3)
    drawn = env.reset()[0]["object_pose"]
    env.reset(seed=3)
    before = env.unwrapped._data
    with pytest.raises(InputError, match="y_mm=-40"):
        env.reset(options={"y_mm": -40.0})
    assert env.unwrapped._data is before and (env.reset()[0]["object_pose"] == drawn).all()


@pytest.mark.slow
def test_environments_run_beside_each_other_in_processes():
    many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="async", vector_kwargs={"context": "spawn"})
    try:
        first, _ = many.reset(seed=[1, 2])
        assert first["tactile"].shape == (2, 2, 7, 4) and not np.array_equal(*first["object_pose"])
        assert many.step(np.zeros((2, 3), dtype=np.float32))[0]["force_n"].shape == (2, 2, 3)
    finally:
        many.close()


@pytest.mark.parametrize(("wrong", "said"), [({"model": "hyperelastic"}, "model='hyperelastic': an environment needs a reading in"),
                                             ({"mesh": "part.stl"}, "part.stl: there is no such mesh file"),
                                             ({"largest_force_n": 90.0}, "The force 90 N is out of the range"),
                                             ({"device": "tpu"}, "tpu"),
                                             ({"device": "cuda", "model": "foundation"}, "device='cuda': only the elastic model"),
                                             ({"device": "cuda", "sensor": "gelsight_mini"}, "device='cuda': gels follow their ob"),
                                             ({"place_step_mm": 0.0}, "place_step_mm=0: give a length in mm above 0 and below"),
                                             ({"scene": {"frction": 1}}, "at 'frction': the key is unknown"),
                                             ({"scene": {"time_step_s": 0.03}}, "scene: time_step_s=0.03: an action takes 0.01 s"),
                                             ({"scene": {"time_step_s": 0.004}}, "time_step_s=0.004: .* which is no multiple"),
                                             ({"scene": ["friction"]}, r"scene=\['friction'\]: give keys and values"),
                                             ({"mass_kg": 0.0}, "mass_kg=0.0: give a finite number from 1e-06 to 100 .kg"),
                                             ({"mass_kg": -1}, "mass_kg=-1: give a finite number"),
                                             ({"mass_kg": "1"}, "mass_kg='1': give a finite number"),
                                             ({"largest_force_n": np.nan}, "largest_force_n=nan: give a finite number .N"),
                                             ({"render_mode": "ansi"}, "render_mode='ansi': the environment draws images only")])
@pytest.mark.filterwarnings("ignore:.*render_mode='ansi'")
def test_a_wrong_argument_is_refused_in_one_sentence(wrong, said):
    with pytest.raises(InputError, match=said):
        gymnasium.make(ID, **wrong)


@pytest.mark.parametrize("action", [[np.nan, 0, 0], [1, np.nan, 0], [0, 0, np.inf], [0, 0], [0, 0, 0, 0], ["close", 0, 0],
                                    ["1", "0", "0"], [1j, 0, 0], 1.0, None])
def test_an_action_that_is_not_three_finite_numbers_is_refused_and_moves_nothing(env, action):
    env.reset(seed=1, options=STILL)
    before = env.unwrapped._data.time
    with pytest.raises(InputError, match="step: the action .* is not three finite numbers from -1 to 1; give grip, lift and slide"):
        env.unwrapped.step(action)
    assert env.unwrapped._data.time == before


def test_a_step_before_the_first_reset_says_so():
    with pytest.raises(InputError, match="step: there is no scene yet; call reset first"):
        gymnasium.make(ID).unwrapped.step(np.zeros(3))


@pytest.mark.parametrize(("options", "sentence"), [
    ({"x_mm": "1"}, "reset: x_mm='1': give a finite number"), ({"y_mm": np.nan}, "reset: y_mm=nan: give a finite number"),
    ({"angle_deg": None}, "reset: angle_deg=None: give a finite number"),
    ({"x_mm": 500}, "reset: x_mm=500, .*: no part of the object is between the pads"),
    ({"y_mm": -40.0}, "y_mm=-40: no part of the object is between the pads of 22 x 37 mm"),
    ({"z_mm": 1.0}, "reset: the option 'z_mm' is unknown; use one of x_mm")])
def test_a_placement_that_is_no_number_or_beside_the_pads_is_refused_by_its_name(env, options, sentence):
    with pytest.raises(InputError, match=sentence):
        env.reset(seed=1, options=options)


def test_a_placement_at_the_rim_of_the_pads_is_taken(env):
    env.reset(seed=1, options=STILL | {"y_mm": 25.0})     # the cylinder's radius is 8 mm, the pads end at 18.5 mm


def test_the_environment_draws_the_hand_and_what_it_lifts():
    env = gymnasium.make(ID, render_mode="rgb_array")
    try:
        env.reset(seed=1, options=STILL)
        open_hand = env.render()
        for _ in range(25):
            env.step(np.array(CLOSE, dtype=np.float32))
        closed = env.render()
    except InputError as error:
        pytest.skip(str(error))     # no EGL here
    finally:
        env.close()
    assert open_hand.shape == (480, 640, 3) and open_hand.dtype == np.uint8 and open_hand.std() > 10
    assert (np.abs(open_hand.astype(int) - closed).max(axis=2) > 30).sum() > 1000     # pixels in which the fingers moved


def test_without_a_render_mode_nothing_is_drawn(env):
    env.reset(seed=1)
    assert env.unwrapped.render() is None


def test_a_computer_that_cannot_draw_says_so_when_a_picture_is_asked_for(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    env = gymnasium.make(ID, render_mode="rgb_array")
    env.reset(seed=1)
    with pytest.raises(InputError, match="MuJoCo does not draw off screen here .*; install EGL"):
        env.render()
    env.close()
