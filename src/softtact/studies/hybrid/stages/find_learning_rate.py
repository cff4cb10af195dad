"""The learning rate of the printed network of one model, by short trainings.

inputs: train, validation;  outputs: rates (CSV, a row for each rate), rate (JSON)
settings: training, network, ssim, seed, threads (by default those of the job)
"""

from typing import Any

from softtact.files import write_csv, write_json
from softtact.learning.dataset import read_samples
from softtact.learning.settings import Network, Ssim, Training, chosen_network
from softtact.learning.training import best_rate, prepare_torch, try_rates


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train with each rate; write the table of all and the best one."""
    options = Training.from_dict(settings["training"], where="training")
    network = Network.from_dict(settings["network"] | {"architecture": "printed"}, where="network")
    table = try_rates(read_samples(inputs["train"]), read_samples(inputs["validation"]), network=chosen_network(network, None),
                      options=options, ssim=Ssim.from_dict(settings.get("ssim", {}),
                                                           where="ssim").model_dump(), seed=settings["seed"],
                      device=prepare_torch(threads=settings.get("threads", threads), device=options.device))
    write_csv(outputs["rates"], table)
    write_json(outputs["rate"], {"architecture": "printed", "learning_rate": best_rate(table)})
