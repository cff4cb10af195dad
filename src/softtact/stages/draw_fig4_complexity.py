"""Figure 4.

inputs: complexity, objects (list of meshes);  outputs: png, svg;  settings: thresholds, units [[object, unit], ...]
"""

import pandas as pd

from softtact.geometry.meshes import read_mesh
from softtact.reporting.fig4_complexity import draw
from softtact.reporting.style import save


def run(*, inputs, outputs, settings, threads=1):
    """Draw."""
    meshes = {name: read_mesh(path, unit=unit)
              for path, (name, unit) in zip(inputs["objects"], settings["units"], strict=True)}
    save(draw(pd.read_csv(inputs["complexity"]), meshes, thresholds=settings["thresholds"]), outputs["png"], outputs["svg"])
