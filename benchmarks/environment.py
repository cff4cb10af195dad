"""Observations a second of the environment for learning, on one core, and how far its readings are off.

    OMP_NUM_THREADS=1 python benchmarks/environment.py

Rates are by processor time, so that other work beside does not count, and by wall time. `held`: the object stays in its place, from
the second step on. `slide`: the hand slides over the object through places that are all new. `again`: the same slide once more.
`episodes`: whole episodes from random places on by a random smooth policy, from an empty memory on.
Errors: readings at random places and forces against presses at that very place and force, in counts and as shares of the largest
reading of each place.
"""

import time

import gymnasium
import numpy as np
import record
import trimesh
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

import softtact.robot.environment as environment
from softtact.geometry.pose import Pose
from softtact.press.sensor import load_sensor
from softtact.robot.events import set_down
from softtact.robot.taxels import STEP_MM, TaxelMemory

CLOSE, SLIDE, HOLD = (0.0, 0.0, 0.0), (-0.6, 0.0, 1.0), (0.2, 0.0, 0.0)
STILL = {"x_mm": 0.0, "y_mm": 0.0, "angle_deg": 0.0}
CLOSING, SLIDING, HOLDING = 40, 40, 300
EPISODES, STEPS, SMOOTH = {"elastic": 10, "foundation": 4}, 200, 15     # an action of the policy changes within 15 steps
LARGEST_N = 30.0
OBJECTS = {"cylinder of 16 mm on its end": trimesh.creation.cylinder(radius=8.0, height=20.0, sections=64),
           "box of 10 x 6 mm on its end": trimesh.creation.box((10, 6, 20))}
PLACES = {"elastic": 40, "foundation": 12}
FINER_MM = 1.0


def run(env, actions):
    """(processor, wall) seconds of some steps, and how many they were: an episode may end."""
    start, count = (time.process_time(), time.perf_counter()), 0
    for action in actions:
        count += 1
        if env.step(np.array(action, dtype=np.float32))[2]:
            break
    return (time.process_time() - start[0], time.perf_counter() - start[1]), count


def rates(model):
    """Rows of one model."""
    env = gymnasium.make(environment.ENVIRONMENT, model=model, max_episode_steps=10_000)
    memory = env.unwrapped.readings
    env.reset(seed=0, options=STILL)
    run(env, [CLOSE] * CLOSING)
    for case in ("slide", "again"):
        places = memory.places
        seconds, count = run(env, [SLIDE] * SLIDING)
        yield row(model, case, count, seconds, memory.places - places)
        env.reset(seed=0, options=STILL)
        run(env, [CLOSE] * CLOSING)
    yield row(model, "held", HOLDING, run(env, [HOLD] * HOLDING)[0], 0)
    start = time.process_time(), time.perf_counter()
    for seed in range(20):
        env.reset(seed=seed)
    yield row(model, "reset", 20, (time.process_time() - start[0], time.perf_counter() - start[1]), 0)
    yield episodes(model)


def episodes(model):
    """The row of whole episodes."""
    env = gymnasium.make(environment.ENVIRONMENT, model=model, max_episode_steps=10_000)
    env.reset(seed=0)
    env.step(np.array(CLOSE, dtype=np.float32))
    spent, steps = np.zeros(2), 0
    for seed in range(EPISODES[model]):
        start = time.process_time(), time.perf_counter()
        env.reset(seed=seed)
        spent += np.subtract((time.process_time(), time.perf_counter()), start)
        seconds, count = run(env, smooth_policy(seed))
        spent, steps = spent + seconds, steps + count
    return row(model, "episodes", steps, tuple(spent), env.unwrapped.readings.places)


def smooth_policy(seed):
    """Actions (STEPS, 3) of a seed: noise smoothed in time, of a standard deviation of 0.5."""
    noise = gaussian_filter1d(np.random.default_rng(seed).standard_normal((STEPS, 3)), SMOOTH, axis=0)
    return np.clip(0.5 * noise / noise.std(), -1, 1)


def row(model, case, count, seconds, places):
    """One line of the record."""
    made = {"model": model, "case": case, "observations": count, "places_pressed": places,
            "per_processor_s": round(count / seconds[0], 1), "per_wall_s": round(count / seconds[1], 1)}
    print(f"{model:12}{case:10}{made['per_processor_s']:9} a processor's second{made['per_wall_s']:9} a second, {places} places",
          flush=True)
    return made


def errors(model, name, mesh, step_mm):
    """Errors of readings at random places: the finger, x to 8 mm to either side, y and turn as a reset draws them, the force."""
    sensor, rng = load_sensor("coro"), np.random.default_rng(2)
    memory, off, largest = TaxelMemory(sensor, mesh, model, LARGEST_N, step_mm), [], []
    for k in range(PLACES[model]):
        x, y, turn = rng.uniform([-8, -4, -45], [8, 4, 45])
        behind = Rotation.from_euler("y", 180 * (k % 2), degrees=True)
        rotation, force = behind * Rotation.from_euler("z", turn, degrees=True), LARGEST_N * rng.uniform(0.1, 1.0)
        exact = sensor.press(mesh, pose=set_down(mesh, Pose(np.array([x, y, 0.0]), rotation)), force_n=force, model=model,
                             threads=1, label="").tactile_map[0]
        read = memory.counts(k % 2, np.array([x, y, 0.0, *rotation.as_quat(scalar_first=True)]), force)
        off.append(np.abs(read - exact))
        largest.append(exact.max())
    share = np.max(off, axis=(1, 2)) / largest
    made = {"model": model, "object": name, "step_mm": step_mm, "places": len(off), "mean_counts": round(float(np.mean(off)), 2),
            "largest_counts": round(float(np.max(off)), 1), "largest_reading": round(float(np.max(largest))),
            "mean_largest_share": round(float(share.mean()), 4), "largest_share": round(float(share.max()), 4)}
    print(made, flush=True)
    return made


def main():
    """Print a row for each model and case and write benchmarks/results/environment.json."""
    rows = [one for model in ("elastic", "foundation") for one in rates(model)]
    off = [errors(model, name, mesh, step) for model in ("elastic", "foundation") for name, mesh in OBJECTS.items()
           for step in (STEP_MM, FINER_MM)]
    print(record.write("environment", mujoco=environment.mujoco.__version__, gymnasium=gymnasium.__version__, rows=rows,
                       errors=off))


if __name__ == "__main__":
    main()
