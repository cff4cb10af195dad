"""Figure 9.

inputs: networks (CSV), histories (of each of its networks, in its order);  outputs: png, svg;  settings: ssim {window, data_range}
"""

from typing import Any

import pandas as pd

from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig9_networks import draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    networks = pd.read_csv(inputs["networks"])
    kinds = list(networks.groupby(["model", "architecture"], sort=False).groups)
    histories = dict(zip(kinds, map(pd.read_csv, inputs["histories"]), strict=True))
    save(draw(networks, histories, choices=settings["ssim"]), outputs["png"], outputs["svg"])
