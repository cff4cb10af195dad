"""Many hands at once: `gymnasium.make_vec("softtact/Grasp-v0", num_envs=8, vectorization_mode="vector_entry_point")`.

Each hand has its own scene. All share one memory of pressed places, and one batch gives the readings of all their sensors. New
places of all hands are pressed together, as many at a time as there are cores. With the same seeds and actions an observation is
that of single environments. Gels with a camera follow their objects one by one.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from softtact.errors import InputError
from softtact.robot.environment import GraspEnv, loads_of, observed_loads, three_numbers
from softtact.robot.gels import GelReadings

_SURFACES_EACH = 4     # cached undersides of a hand: of two fingers, before and after a turn


class GraspVectorEnv(gymnasium.vector.VectorEnv):
    """A batch of `GraspEnv`s with the same object and sensor.

    Autoreset is gymnasium's NEXT_STEP: the step after the end of an episode begins the next one, its action is not used, and its
    reward is 0. `info` holds arrays (n, ...) with masks (`_NAME`) as gymnasium has them; `expected_error_mm` and
    `force_above_largest_n` (n, 2) of taxels.
    """

    metadata = {**GraspEnv.metadata, "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int = 1, *, max_episode_steps: int | None = None, **options: Any) -> None:
        """num_envs: of hands;  max_episode_steps: after which an episode is cut;  options: those of `GraspEnv`

        Raises InputError for other numbers than whole ones from 1 on, and as `GraspEnv` does.
        """
        if not _whole(num_envs, 1):
            raise InputError(f"num_envs={num_envs!r}: give a whole number from 1 on.")
        if max_episode_steps is not None and not _whole(max_episode_steps, 1):
            raise InputError(f"max_episode_steps={max_episode_steps!r}: give a whole number from 1 on, or leave it out.")
        first = GraspEnv(**options)
        self._hands = [first, *(first.beside() for _ in range(num_envs - 1))]
        self.num_envs, self.render_mode, self._longest = int(num_envs), first.render_mode, max_episode_steps
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        if not isinstance(first.readings, GelReadings):
            first.readings.surfaces = max(first.readings.surfaces, _SURFACES_EACH * num_envs)
        self._steps, self._over = np.zeros(num_envs, dtype=int), np.zeros(num_envs, dtype=bool)
        self._seen: dict[str, np.ndarray] = {}

    def reset(self, *, seed: int | Sequence[int | None] | None = None,
              options: dict[str, Any] | None = None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """New episodes of all hands, or of those in `options["reset_mask"]` (n,) of bool.

        seed: of the first hand, the others count on from it; or one for each
        """
        if not isinstance(options, dict | None):
            raise InputError(f"reset: the options are {options!r}; give a dictionary, or leave them out.")
        given = dict(options or {})
        mask = np.asarray(given.pop("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise InputError(f"reset: the option reset_mask has the shape {mask.shape}; give {self.num_envs} times True or False.")
        if not mask.any():
            raise InputError("reset: the option reset_mask names no hand; give True for at least one.")
        if new := [int(hand) for hand in np.flatnonzero(~mask) if not self._hands[hand].has_scene]:
            raise InputError(f"reset: the option reset_mask leaves out hand {new[0]}, which has no episode yet; reset all hands "
                             "first.")
        seeds = _seeds(seed, self.num_envs)
        drawn = {hand: self._hands[hand].draw(seed=seeds[hand], options=given) for hand in np.flatnonzero(mask)}
        for hand, beginning in drawn.items():     # none where one is refused
            self._hands[hand].begin(beginning)
        self._steps[mask], self._over[mask] = 0, False
        return self._observe(mask)

    def step(self, actions: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Ten milliseconds of all scenes; actions (n, 3)."""
        if np.ndim(actions) == 0:
            raise InputError(f"step: the actions are {actions!r}; give an array ({self.num_envs}, 3).")
        if len(actions) != self.num_envs:
            raise InputError(f"step: {len(actions)} actions for {self.num_envs} hands; give one for each.")
        checked = [three_numbers(action) for action in actions]     # before any hand moves
        for hand in self._hands:
            hand.need_scene()
        rewards, ended = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=bool)
        for number, (hand, action) in enumerate(zip(self._hands, checked, strict=True)):
            if self._over[number]:
                hand.begin(hand.draw())
            else:
                rewards[number], ended[number] = hand.advance(action)
        self._steps = np.where(self._over, 0, self._steps + 1)
        cut = np.zeros(self.num_envs, dtype=bool) if self._longest is None else self._steps >= self._longest
        self._over = ended | cut
        observation, infos = self._observe(np.ones(self.num_envs, dtype=bool))
        return observation, rewards, ended, cut, infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """An image of each hand; None without a `render_mode`."""
        if self.render_mode is None:
            return None
        return tuple(hand.render() for hand in self._hands)     # type: ignore[misc]

    def close_extras(self, **_: Any) -> None:
        """End the processes that draw."""
        for hand in self._hands:
            hand.close()

    def _observe(self, mask):
        """Observations of all hands, and the infos of those in a mask (n,); hands beside it keep their last observation."""
        infos: dict[str, Any] = {}
        numbers, readings = np.flatnonzero(mask), self._hands[0].readings
        hands = [self._hands[number] for number in numbers]
        poses, forces = loads_of(hands)
        if isinstance(readings, GelReadings):
            seen = [hand.readings.observe(*load) for hand, *load in zip(hands, poses, forces, strict=True)]
            read = {name: np.stack([one[name] for one in seen]) for name in seen[0]}
            facts = [hand.readings.facts() for hand in hands]
        else:
            read, errors = readings.observe_many(poses, forces)
            facts = [{**readings.facts(), "expected_error_mm": error, "force_above_largest_n": above}
                     for error, above in zip(errors, readings.above_largest(forces), strict=True)]
        for number, hand, fact in zip(numbers, hands, facts, strict=True):
            infos = self._add_info(infos, {**hand.scene_facts(), **fact}, int(number))
        now = {**read, **observed_loads(poses, forces)}
        for name, values in now.items():
            kept = self._seen.get(name, np.zeros((self.num_envs, *values.shape[1:]), dtype=values.dtype)).copy()
            kept[numbers] = values
            self._seen[name] = kept
        return {name: self._seen[name].copy() for name in self.single_observation_space.spaces}, infos


def _whole(number, least):
    return isinstance(number, int | np.integer) and not isinstance(number, bool) and number >= least


def _seeds(seed, count):
    """A seed, or None, for each of `count` hands, from None, one number, or one for each."""
    each = list(seed) if isinstance(seed, Sequence | np.ndarray) else [seed]
    for one in each:
        if one is not None and not _whole(one, 0):
            raise InputError(f"reset: the seed {one!r} is no whole number from 0 on.")
    if not isinstance(seed, Sequence | np.ndarray):
        each = [None if seed is None else seed + number for number in range(count)]
    if len(each) != count:
        raise InputError(f"reset: {len(each)} seeds for {count} hands; give one for each, or one number.")
    return [None if one is None else int(one) for one in each]     # gymnasium takes no number of numpy
