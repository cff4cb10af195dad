"""Hyperparameter search for one model's network.

inputs: train, validation;  outputs: search (CSV), best (JSON), and the journal of the trials beside them
settings: search, network, ssim, device, seed
"""

from typing import Any

from softtact.files import write_csv, write_json
from softtact.learning.dataset import read_samples
from softtact.learning.search import best_trial, search_hyperparameters, search_table
from softtact.learning.settings import Network, Search, Ssim
from softtact.learning.training import prepare_torch


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Run the remaining trials; write the table of all and the best one."""
    options = Search.from_dict(settings["search"], where="search")
    network = Network.from_dict(settings.get("network", {}), where="network")
    ssim = Ssim.from_dict(settings.get("ssim", {}), where="ssim")
    study = search_hyperparameters(
        read_samples(inputs["train"]), read_samples(inputs["validation"]), options=options,
        activation=network.activation, ssim=ssim.model_dump(), seed=settings["seed"],
        device=prepare_torch(threads=settings.get("threads", threads), device=settings.get("device", "auto")),
        journal=outputs["search"].with_name("search.journal"))
    write_csv(outputs["search"], search_table(study))
    write_json(outputs["best"], best_trial(study))
