"""Figure 7.

inputs: predictions, complexity, objects (list of meshes), presses (list: every model of every object)
outputs: png, svg;  settings: units [[object, unit], ...], trials (of each object), largest_counts
"""

from typing import Any

import pandas as pd

from softtact.files import read_dataset
from softtact.geometry.meshes import read_mesh
from softtact.reporting.style import save
from softtact.studies.hybrid.figures.fig7_maps import draw


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the grasped objects at the largest force."""
    predictions = read_dataset(inputs["predictions"])
    chosen = pd.read_csv(inputs["complexity"]).set_index("object").model
    presses = {(press.attrs["item"], press.attrs["model"]): press for press in map(read_dataset, inputs["presses"])}
    objects = [_object(name, read_mesh(path, unit=unit), chosen[name], presses, predictions) | {"trials": trials}
               for path, (name, unit), trials in zip(inputs["objects"], settings["units"], settings["trials"], strict=True)]
    save(draw(objects, largest_counts=settings["largest_counts"]), outputs["png"], outputs["svg"])


def _object(name, mesh, chosen, presses, predictions):
    models = [str(model) for model in predictions.model.values]
    first = presses[name, models[0]]
    last = predictions.sel(item=name).isel(force=-1)
    return {"name": name, "mesh": mesh, "chosen": chosen, "force": float(first.normal_force_n.values[-1]),
            "deformation": {model: presses[name, model].deformation_map_mm.values[-1] for model in models},
            "tactile": {model: last.tactile_map.sel(model=model).values for model in models},
            "sensor": last.sensor_map.values, "source": predictions.attrs["source"],
            "extent": (*first.x.values[[0, -1]], *first.y.values[[0, -1]])}
