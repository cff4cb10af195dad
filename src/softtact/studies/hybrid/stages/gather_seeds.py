"""The spread of scores over the seeds of learning.

inputs: seeds (list of seeds.csv, one of each model);  outputs: table (CSV)
"""

from typing import Any

import pandas as pd

from softtact.evaluation.retraining import spread_of_seeds
from softtact.files import write_csv


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Gather, and write a row per model, network and set."""
    write_csv(outputs["table"], spread_of_seeds(pd.concat(map(pd.read_csv, inputs["seeds"]))))
