"""Compare the study's networks, those trained for comparison on the same split, and the predictors without a network.

inputs: networks, timings, histories (of each network, in its order), validation, unseen, grasps (one per model each), baselines,
    ceiling
outputs: networks, scores, levels (CSV), verdicts (JSON: sentences on the study's networks)
settings: architecture, ssim, seed
"""

from typing import Any

from softtact.evaluation.networks import Trained, compare_networks, score_networks
from softtact.evaluation.score_tables import level_table, score_table, verdicts
from softtact.files import read_csv, write_csv, write_json
from softtact.learning.dataset import TESTS, read_samples
from softtact.learning.network import load_network
from softtact.learning.settings import Ssim
from softtact.learning.training import prepare_torch


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Score and time every network; write the tables."""
    prepare_torch(threads=threads)
    ssim = Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump()
    splits = {name: {samples.model: samples for samples in map(read_samples, inputs[name])} for name in TESTS}
    files = zip(*(inputs[name] for name in ("networks", "timings", "histories")), strict=True)
    networks = [Trained(*load_network(path), read_csv(timing), read_csv(history)) for path, timing, history in files]
    scores, ceiling = score_networks(networks, splits, ssim=ssim), read_csv(inputs["ceiling"])
    table = score_table(scores, read_csv(inputs["baselines"]), ceiling)
    some = next(iter(splits["validation"].values()))
    write_csv(outputs["networks"], compare_networks(networks, scores, ceiling, table, maps_mm=some.maps_mm,
                                                    taxels=some.counts[0].size, seed=settings["seed"]))
    write_csv(outputs["scores"], table)
    write_csv(outputs["levels"], level_table(table))
    write_json(outputs["verdicts"], {"sentences": verdicts(table, architecture=settings["architecture"])})
