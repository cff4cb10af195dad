"""What limits each score: model, data or network.

inputs: curves (list of learning_curve.csv), networks (CSV);  outputs: limits
settings: own (architecture), tested, reference (names of models), source (of the readings)
"""

from typing import Any

import pandas as pd

from softtact.evaluation.limits import limits
from softtact.files import write_csv


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Compare, and write a row per model and set."""
    write_csv(outputs["limits"], limits(pd.concat(map(pd.read_csv, inputs["curves"])), pd.read_csv(inputs["networks"]), **settings))
