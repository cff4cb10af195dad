"""Observations a second of the environment for learning, on one core: `OMP_NUM_THREADS=1 python benchmarks/environment.py`.

Rates are by processor time, so that other work beside does not count, and by wall time. `held`: the object stays in its place, from
the second step on. `slide`: the hand slides over the object through places that are all new. `again`: the same slide once more.
"""

import time

import gymnasium
import numpy as np
import record

import softtact.robot.environment as environment

CLOSE, SLIDE, HOLD = (0.0, 0.0, 0.0), (-0.6, 0.0, 1.0), (0.2, 0.0, 0.0)
STILL = {"x_mm": 0.0, "y_mm": 0.0, "angle_deg": 0.0}
CLOSING, SLIDING, HOLDING = 40, 30, 300


def run(env, action, count):
    """(processor, wall) seconds of so many steps."""
    start = time.process_time(), time.perf_counter()
    for _ in range(count):
        env.step(np.array(action, dtype=np.float32))
    return time.process_time() - start[0], time.perf_counter() - start[1]


def rates(model):
    """Rows of one model."""
    env = gymnasium.make(environment.ENVIRONMENT, model=model, max_episode_steps=10_000)
    env.reset(seed=0, options=STILL)
    run(env, CLOSE, CLOSING)
    for case in ("slide", "again"):
        places = env.unwrapped._memory.places
        yield row(model, case, SLIDING, run(env, SLIDE, SLIDING), env.unwrapped._memory.places - places)
        env.reset(seed=0, options=STILL)
        run(env, CLOSE, CLOSING)
    yield row(model, "held", HOLDING, run(env, HOLD, HOLDING), 0)
    start = time.process_time(), time.perf_counter()
    for seed in range(20):
        env.reset(seed=seed)
    yield row(model, "reset", 20, (time.process_time() - start[0], time.perf_counter() - start[1]), 0)


def row(model, case, count, seconds, places):
    """One line of the record."""
    made = {"model": model, "case": case, "observations": count, "places_pressed": places,
            "per_processor_s": round(count / seconds[0], 1), "per_wall_s": round(count / seconds[1], 1)}
    print(f"{model:12}{case:8}{made['per_processor_s']:9} a processor's second{made['per_wall_s']:9} a second, {places} places",
          flush=True)
    return made


def main():
    """Print a row for each model and case and write benchmarks/results/environment.json."""
    rows = [one for model in ("elastic", "foundation") for one in rates(model)]
    print(record.write("environment", mujoco=environment.mujoco.__version__, gymnasium=gymnasium.__version__, rows=rows))


if __name__ == "__main__":
    main()
