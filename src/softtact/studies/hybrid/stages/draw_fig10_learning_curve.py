"""Figure 10.

inputs: curves (list of CSV, one per model), ceiling;  outputs: png, svg
"""

from typing import Any

import pandas as pd

from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig10_learning_curve import draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    curves = pd.concat(map(pd.read_csv, inputs["curves"]))
    save(draw(curves, pd.read_csv(inputs["ceiling"])), outputs["png"], outputs["svg"])
