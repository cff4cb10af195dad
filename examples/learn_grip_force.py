"""A small network that estimates the grip's force from the taxels, trained in the environment for learning.

    python examples/learn_grip_force.py --episodes 60 --out grip_force.png

A random policy closes the gripper on a cylinder at random places and with random forces. A network of one hidden layer learns the
force of the pads from the 2 x 28 taxels. The test has other episodes than the training. The network is compared with the mean force
and with a line on the sum of all counts. Taxels are those of an ideal readout, so the network learns the simulation, not a real
sensor.
Needs the extras `robot` and `learn`.
"""

import argparse
from pathlib import Path

import gymnasium
import numpy as np
import torch

import softtact.robot.environment  # noqa: F401     registers the environment

STEPS = 60            # of an episode: 0.6 s
HIDDEN, EPOCHS, BATCH, RATE = 32, 400, 64, 3e-3


def main(arguments=None):
    options = parse(arguments)
    taxels, force, episode = collect(options.episodes, seed=options.seed)
    test = episode % 4 == 3                              # every fourth episode
    network = learn(taxels[~test], force[~test], seed=options.seed)
    estimates = {"mean force": np.full(test.sum(), force[~test].mean()), "line on the sum of counts": line(taxels, force, test),
                 "network": network(taxels[test])}
    errors = {name: float(np.sqrt(np.mean((values - force[test]) ** 2))) for name, values in estimates.items()}
    for name, error in errors.items():
        print(f"{name:27} root mean square error {error:6.3f} N on {test.sum()} observations of {len(set(episode[test]))} episodes")
    draw(force[test], estimates, options.out)
    print(f"written: {options.out}")
    return errors


def collect(episodes, *, seed):
    """Taxels (n, 56), force of a pad (n,) in N and episode (n,) of observations in which both pads touch."""
    env, rng = gymnasium.make("softtact/Grasp-v0"), np.random.default_rng(seed)
    rows = []
    for number in range(episodes):
        observation, _ = env.reset(seed=seed + number)
        for step in range(STEPS):
            if step % 20 == 0:
                grip = rng.uniform(-0.95, 1.0)
            observation, *_ = env.step(np.array([grip, 0.0, 0.0], dtype=np.float32))
            force = -observation["force_n"][:, 2]
            if (force > 0.1).all():
                rows.append((observation["tactile"].ravel(), force.mean(), number))
    taxels, force, episode = (np.array(column) for column in zip(*rows, strict=True))
    return taxels.astype(np.float32), force.astype(np.float32), episode


def learn(taxels, force, *, seed):
    """A function from taxels (n, 56) to forces (n,) in N."""
    torch.manual_seed(seed)
    scale, largest = max(float(taxels.max()), 1.0), float(force.max())
    x, y = torch.tensor(taxels / scale), torch.tensor(force / largest)
    network = torch.nn.Sequential(torch.nn.Linear(x.shape[1], HIDDEN), torch.nn.ReLU(), torch.nn.Linear(HIDDEN, 1))
    optimiser = torch.optim.Adam(network.parameters(), lr=RATE)
    for _ in range(EPOCHS):
        for part in torch.randperm(len(x)).split(BATCH):
            optimiser.zero_grad()
            torch.nn.functional.mse_loss(network(x[part])[:, 0], y[part]).backward()
            optimiser.step()

    def estimate(values):
        with torch.no_grad():
            return network(torch.tensor(values / scale))[:, 0].numpy() * largest

    return estimate


def line(taxels, force, test):
    """Forces (n,) of the test by a straight line through the training's sums of counts."""
    sums = taxels.sum(axis=1)
    return np.polyval(np.polyfit(sums[~test], force[~test], 1), sums[test])


def draw(force, estimates, path):
    """Estimated against true force, a colour for each estimator."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6, 4.4), layout="constrained")
    axes = figure.subplots()
    for name, values in estimates.items():
        axes.plot(force, values, ".", markersize=3, label=name)
    axes.plot([0, force.max()], [0, force.max()], "k-", linewidth=0.8)
    axes.set(xlabel="force of a pad in the scene (N)", ylabel="force estimated from the taxels (N)", aspect="equal")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=150)


def parse(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--episodes", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("grip_force.png"))
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
