"""Figure 6.

inputs: ssim, ceiling, baselines;  outputs: png, svg;  settings: ssim {window, data_range}
"""

from typing import Any

import pandas as pd

from softtact.learning.dataset import object_of
from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig6_ssim import draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw; an object's presses in several places stand together."""
    tables = (pd.read_csv(inputs[name]) for name in ("ssim", "ceiling", "baselines"))
    together = (table.assign(item=table["item"].map(object_of)) for table in tables)
    save(draw(*together, choices=settings["ssim"]), outputs["png"], outputs["svg"])
