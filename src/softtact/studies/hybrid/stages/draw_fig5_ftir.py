"""Figure 5.

inputs: area, orientations, summary;  outputs: png, svg
"""

from typing import Any

import pandas as pd

from softtact.files import read_json
from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig5_ftir import draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw."""
    figure = draw(pd.read_csv(inputs["area"]), read_json(inputs["summary"]), orientations=pd.read_csv(inputs["orientations"]))
    save(figure, outputs["png"], outputs["svg"])
