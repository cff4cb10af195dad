"""Figure 8.

inputs: policies, presses;  outputs: png, svg
"""

import pandas as pd

from softtact.reporting.fig8_policies import draw
from softtact.reporting.style import save


def run(*, inputs, outputs, settings, threads=1):
    """Draw."""
    save(draw(pd.read_csv(inputs["policies"]), pd.read_csv(inputs["presses"])), outputs["png"], outputs["svg"])
