"""Train a network of one model.

inputs: train, validation, best (of the search), and rate if that of the printed network is found by a trial
outputs: model (weights of the best epoch), history, timing (optional); during the training a checkpoint lies beside them
settings: training, network (with its `architecture`), ssim, seed, threads (by default those of the job)
"""

from typing import Any

import pandas as pd

from softtact.files import digest, read_json, write_csv
from softtact.learning.dataset import read_samples
from softtact.learning.network import save_network
from softtact.learning.settings import Network, Ssim, Training, chosen_network, chosen_training, found_for
from softtact.learning.training import Run, prepare_torch, start_run, train_network

HISTORY = ["epoch", "train_loss", "validation_loss", "validation_ssim", "learning_rate"]


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train, or continue an interrupted training, and write the best weights and the history."""
    network = Network.from_dict(settings["network"], where="network")
    best, seed = read_json(inputs["best"]), settings["seed"]
    trial = read_json(inputs["rate"]) if "rate" in inputs else None
    options = chosen_training(Training.from_dict(settings["training"], where="training"), network,
                              found_for(network, search=best, trial=trial))
    ssim = Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump()
    train, validation = read_samples(inputs["train"]), read_samples(inputs["validation"])
    training = start_run(train, network=chosen_network(network, best), seed=seed,
                         learning_rate=options.learning_rate,     # type: ignore[arg-type]
                         device=prepare_torch(threads=settings.get("threads", threads), device=options.device))
    checkpoint = outputs["model"].with_name("checkpoint.pt")
    for _ in train_network(training, train, validation, options=options, ssim=ssim, seed=seed, checkpoint=checkpoint,
                           label=f"{network.architecture} network of {train.model}"):
        pass
    write_results(outputs, training, facts={
        "model": train.model, "architecture": network.architecture, "source": train.source, "seed": seed, "range": train.range(),
        "config_digest": digest(settings)})
    checkpoint.unlink(missing_ok=True)


def write_results(outputs: dict[str, Any], training: Run, *, facts: dict[str, Any]) -> None:
    """Write the best weights and the history; wall times, which differ between runs, go to a separate file."""
    best = training.best
    training.network.load_state_dict(best["weights"])
    save_network(outputs["model"], training.network,
                 facts={**facts, "epoch": best["epoch"], "validation_loss": best["validation_loss"]})
    history = pd.DataFrame(training.history)
    write_csv(outputs["history"], history[HISTORY])
    if "timing" in outputs:
        write_csv(outputs["timing"], history[["epoch", "wall_time_s"]])
