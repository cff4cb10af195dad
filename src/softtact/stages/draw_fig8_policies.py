"""Figure 8.

inputs: policies, presses;  outputs: png, svg
"""

from typing import Any

import pandas as pd

from softtact.reporting.fig8_policies import draw
from softtact.reporting.style import save


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    save(draw(pd.read_csv(inputs["policies"]), pd.read_csv(inputs["presses"])), outputs["png"], outputs["svg"])
