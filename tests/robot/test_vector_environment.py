"""Many hands in one batch: what single environments with the same seeds see, by gymnasium's rules."""

import warnings

import numpy as np
import pytest

from softtact.errors import InputError

gymnasium = pytest.importorskip("gymnasium", reason="pip install 'softtact[robot]'")
pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")
from support.gels import SMALL_GEL  # noqa: E402

ID = "softtact.robot.environment:softtact/Grasp-v0"
LONGEST = 14     # steps of an episode: beyond the first touch, so that each test sees an end and a new beginning


def make(mode, count=2, **options):
    return gymnasium.make_vec(ID, num_envs=count, vectorization_mode=mode, **{"max_episode_steps": LONGEST} | options)


def play(many, steps, seed=5):
    """(observations, rewards, ended, cut, info) of the reset and each step of a random policy that closes."""
    rng = np.random.default_rng(1)
    seen = [(*many.reset(seed=seed),)]
    for _ in range(steps):
        actions = rng.uniform([-0.8, -1, -1], [1, 0.2, 1], (many.num_envs, 3)).astype(np.float32)
        seen.append(many.step(actions))
    return seen


def takes(many, seed):
    """Whether the first hand begins an episode with the object far aside."""
    try:
        many._hands[0].draw(seed=seed, options={"y_mm": 34.0})
    except InputError:
        return False
    return True


@pytest.fixture(scope="module")
def batch():
    many = make("vector_entry_point")
    yield many
    many.close()


@pytest.fixture(scope="module")
def both(batch):
    """The same actions for a batch and for single environments, over the end of an episode."""
    return play(batch, 2 * LONGEST), play(make("sync"), 2 * LONGEST)


def test_the_same_seeds_give_the_observations_of_single_environments(both):
    one, other = both
    assert all((a[0][name] == b[0][name]).all() and a[0][name].dtype == b[0][name].dtype
               for a, b in zip(one, other, strict=True) for name in b[0])
    assert one[LONGEST][0]["tactile"].max() > 0 and not np.array_equal(*one[0][0]["object_pose"])


def test_rewards_and_ends_are_those_of_single_environments(both):
    for one, other in zip(*(seen[1:] for seen in both), strict=True):
        assert all((a == b).all() for a, b in zip(one[1:4], other[1:4], strict=True))
    cut = [step[3].all() for step in both[0][1:]]
    assert cut.index(True) == LONGEST - 1 and not both[0][LONGEST + 1][1].any()     # the step after the end gives no reward


def test_infos_are_those_of_single_environments_with_the_error_to_expect(both):
    for one, other in zip(*both, strict=True):
        for name in ("risen_mm", "opening_mm", "expected_error_mm"):
            assert np.array_equal(np.stack(one[-1][name]), np.stack(other[-1][name])) and one[-1][f"_{name}"].all()
    last = both[0][LONGEST]
    felt = last[0]["tactile"].any(axis=(2, 3))
    assert ((np.stack(last[-1]["expected_error_mm"]) > 0) == felt).all()


def test_forces_above_the_largest_are_told_of_each_hand():
    many, single = (make(mode, largest_force_n=0.5) for mode in ("vector_entry_point", "sync"))
    for hand in (*many._hands, *(env.unwrapped for env in single.envs)):
        hand.largest_force_n = 1.0     # of the fingers' motors, after the readings were made for 0.5 N
    infos, others = (play(one, LONGEST)[-1][-1] for one in (many, single))
    above = np.stack(infos["force_above_largest_n"])
    assert above.shape == (2, 2) and above.max() > 0.1
    assert np.array_equal(above, np.stack(others["force_above_largest_n"])) and infos["_force_above_largest_n"].all()


def test_gymnasium_s_rules_for_spaces_and_autoreset_hold(batch):
    assert batch.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.NEXT_STEP
    assert batch.observation_space.contains(batch.reset(seed=1)[0]) and batch.action_space.shape == (2, 3)
    observation, rewards, ended, cut, _ = batch.step(batch.action_space.sample())
    assert batch.observation_space.contains(observation) and rewards.dtype == np.float64 and ended.dtype == cut.dtype == bool


def test_gymnasium_s_checker_passes_the_single_environment_of_the_batch():
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*infinity.*")
        check_env(make("vector_entry_point", 1)._hands[0])


def test_a_wrapper_for_batches_counts_its_episodes():
    many = gymnasium.wrappers.vector.RecordEpisodeStatistics(make("vector_entry_point", max_episode_steps=3))
    infos = [step[-1] for step in play(many, 4)]
    assert (infos[3]["episode"]["l"] == 3).all()


def test_some_hands_alone_begin_again(batch):
    batch.reset(seed=3)
    before = batch.step(np.zeros((2, 3), np.float32))[0]
    after, infos = batch.reset(seed=[7, 8], options={"reset_mask": np.array([False, True]), "x_mm": 0.0})
    assert (after["object_pose"][0] == before["object_pose"][0]).all()
    assert after["object_pose"][1][0] == pytest.approx(0.0, abs=0.01)
    assert not infos["_risen_mm"][0] and infos["_risen_mm"][1]


def test_a_first_reset_of_some_hands_alone_is_refused_and_begins_none():
    many = make("vector_entry_point")
    with pytest.raises(InputError, match="reset: the option reset_mask leaves out hand 1, which has no episode yet; reset all h"):
        many.reset(seed=1, options={"reset_mask": np.array([True, False])})
    with pytest.raises(InputError, match="step: there is no scene yet; call reset first"):
        many.step(np.zeros((2, 3)))
    assert not any(hand.has_scene for hand in many._hands)


def test_a_reset_that_one_hand_refuses_begins_none():
    """A box of 20 x 30 mm turned by its drawn angle still reaches the pads, or does not; with these seeds the first alone does."""
    import trimesh

    many = make("vector_entry_point", mesh=trimesh.creation.box((20, 30, 24)))
    seeds = next([one, other] for one in range(30) for other in range(30) if takes(many, one) and not takes(many, other))
    for hand in many._hands:
        hand.begin(hand.draw(seed=1))
    before = [hand._data for hand in many._hands]
    with pytest.raises(InputError, match="no part of the object is between the pads"):
        many.reset(seed=seeds, options={"y_mm": 34.0})
    assert all(hand._data is data for hand, data in zip(many._hands, before, strict=True))


def test_no_hand_moves_while_another_has_no_episode():
    many = make("vector_entry_point")
    many._hands[0].begin(many._hands[0].draw(seed=1))     # alone
    with pytest.raises(InputError, match="step: there is no scene yet; call reset first"):
        many.step(np.zeros((2, 3)))
    assert many._hands[0]._data.time == 0.0


def test_gels_follow_their_objects_each(tmp_path):
    (tmp_path / "gel.yaml").write_text(SMALL_GEL)
    many = make("vector_entry_point", sensor=str(tmp_path / "gel.yaml"))
    many.reset(seed=2)
    for _ in range(13):
        observation, *_ = many.step(np.tile(np.array([-0.6, 0, 0], np.float32), (2, 1)))
    rest = many._hands[0].readings.at_rest["camera"]
    assert observation["camera"].shape == (2, *rest.shape)
    assert all(np.abs(one.astype(int) - rest).max() > 10 for one in observation["camera"])


@pytest.mark.parametrize("count", [0, -1, 2.0, "3", True])
def test_a_wrong_number_of_hands_is_refused(count):
    from softtact.robot.vector_environment import GraspVectorEnv

    with pytest.raises(InputError, match="num_envs=.*: give a whole number from 1 on"):
        GraspVectorEnv(count)


@pytest.mark.parametrize(("actions", "sentence"), [
    (np.zeros((3, 3)), "step: 3 actions for 2 hands; give one for each"), (1.0, "step: the actions are 1.0; give an array"),
    (None, "step: the actions are None; give an array"),
    (np.array([[0.0, 0, 0], [0, np.nan, 0]]), "step: the action .* is not three finite numbers")])
def test_wrong_actions_are_refused_and_no_hand_moves(batch, actions, sentence):
    batch.reset(seed=1)
    with pytest.raises(InputError, match=sentence):
        batch.step(actions)
    assert all(hand._data.time == 0.0 for hand in batch._hands)


@pytest.mark.parametrize(("given", "sentence"), [
    ({"seed": [1]}, "reset: 1 seeds for 2 hands"), ({"options": {"reset_mask": np.ones(3, bool)}}, "reset_mask has the shape"),
    ({"options": {"x": 1.0}}, "reset: the option 'x' is unknown"), ({"options": "x"}, "reset: the options are 'x'; give a dict"),
    ({"options": {"reset_mask": np.zeros(2, bool)}}, "reset_mask names no hand"), ({"seed": -1}, "the seed -1 is no whole number"),
    ({"seed": 1.5}, "the seed 1.5 is no whole number"), ({"seed": [1, "a"]}, "the seed 'a' is no whole number")])
def test_a_wrong_reset_is_refused(batch, given, sentence):
    with pytest.raises(InputError, match=sentence):
        batch.reset(**given)


@pytest.mark.parametrize("steps", [0, -2, 2.5, "9", True])
def test_a_wrong_length_of_episodes_is_refused(steps):
    with pytest.raises(InputError, match="max_episode_steps=.*: give a whole number from 1 on"):
        make("vector_entry_point", max_episode_steps=steps)


def test_seeds_may_be_numbers_of_numpy(batch):
    wanted = batch.reset(seed=4)[0]["object_pose"]
    for seed in (np.int64(4), np.array([4, 5]), (4, np.int32(5))):
        np.testing.assert_array_equal(batch.reset(seed=seed)[0]["object_pose"], wanted)
