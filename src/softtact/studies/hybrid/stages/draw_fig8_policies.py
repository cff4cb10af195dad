"""Figure 8.

inputs: policies, presses;  outputs: png, svg
"""

from typing import Any

import pandas as pd

from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig8_policies import draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    save(draw(pd.read_csv(inputs["policies"]), pd.read_csv(inputs["presses"])), outputs["png"], outputs["svg"])
