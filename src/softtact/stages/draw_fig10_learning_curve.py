"""Figure 10.

inputs: curves (list of CSV, one per model), ceiling;  outputs: png, svg
"""

import pandas as pd

from softtact.reporting.fig10_learning_curve import draw
from softtact.reporting.style import save


def run(*, inputs, outputs, settings, threads=1):
    """Draw."""
    curves = pd.concat(map(pd.read_csv, inputs["curves"]))
    save(draw(curves, pd.read_csv(inputs["ceiling"])), outputs["png"], outputs["svg"])
