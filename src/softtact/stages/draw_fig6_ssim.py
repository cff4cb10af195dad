"""Figure 6.

inputs: ssim, ceiling;  outputs: png, svg;  settings: ssim {window, data_range}
"""

import pandas as pd

from softtact.reporting.fig6_ssim import draw
from softtact.reporting.style import save


def run(*, inputs, outputs, settings, threads=1):
    """Draw."""
    figure = draw(pd.read_csv(inputs["ssim"]), pd.read_csv(inputs["ceiling"]), choices=settings["ssim"])
    save(figure, outputs["png"], outputs["svg"])
