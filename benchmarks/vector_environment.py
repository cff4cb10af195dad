"""Observations a second of the batch of hands, `GraspVectorEnv`, beside single environments with the same seeds and actions.

    OMP_NUM_THREADS=1 python benchmarks/vector_environment.py

Rates are by processor time, twice what one core does in a second, so that other work beside does not count; how well two cores
share the work by the clock is not told. Cases: `slide`, all hands slide through places that are new; `again`, the same once more;
`held`; `episodes`, whole episodes by a random smooth policy from other places on; `later`, the same when their places are known.
"""

import time
import warnings

import gymnasium
import numpy as np
import record
from environment import CLOSE, CLOSING, HOLD, SLIDE, SLIDING, STEPS, smooth_policy

import softtact.robot.environment as environment

HANDS, HOLDING = 8, 60
CORES = 2


def rate(many, actions):
    """(observations a second of two cores) of actions, each for all hands or (hand, 3)."""
    start = time.process_time()
    for action in actions:
        many.step(np.broadcast_to(np.asarray(action, dtype=np.float32), (HANDS, 3)))
    return CORES * HANDS * len(actions) / (time.process_time() - start)


def rates(mode):
    """Rows of a mode of `gymnasium.make_vec`."""
    many = gymnasium.make_vec(environment.ENVIRONMENT, num_envs=HANDS, vectorization_mode=mode, max_episode_steps=10_000)
    many.reset(seed=0)
    rate(many, [CLOSE] * CLOSING)
    yield row(mode, "slide", rate(many, [SLIDE] * SLIDING))
    many.reset(seed=0)
    rate(many, [CLOSE] * CLOSING)
    yield row(mode, "again", rate(many, [SLIDE] * SLIDING))
    yield row(mode, "held", rate(many, [HOLD] * HOLDING))
    policy = np.stack([smooth_policy(seed) for seed in range(HANDS)], axis=1)
    for case in ("episodes", "later"):
        start = time.process_time()
        many.reset(seed=100)
        spent = time.process_time() - start + CORES * HANDS * STEPS / rate(many, policy)
        yield row(mode, case, CORES * HANDS * STEPS / spent)


def row(mode, case, found):
    """One line of the record."""
    print(f"{mode:22}{case:10}{found:8.0f} observations a second of {CORES} cores", flush=True)
    return {"mode": mode, "case": case, "hands": HANDS, "per_second_of_two_cores": round(found)}


def main():
    """Print a row for each mode and case and write benchmarks/results/vector_environment.json."""
    warnings.simplefilter("ignore")     # of places where the object rests on the shell
    rows = [one for mode in ("sync", "vector_entry_point") for one in rates(mode)]
    print(record.write("vector_environment", mujoco=environment.mujoco.__version__, gymnasium=gymnasium.__version__, rows=rows))


if __name__ == "__main__":
    main()
