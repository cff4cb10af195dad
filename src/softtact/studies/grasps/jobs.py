"""The jobs of a study of grasps.

    grasps/ITEM/events.nc, readings.nc     one position of an object; readings are of the event `grip`
    one_event/OBJECT.nc                    maps of several models for one event
    grasps.csv                             a row for each grasp
    tables/claims.csv, figures/, report.html
"""

from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from softtact.geometry.meshes import place, read_mesh
from softtact.sensors.library import material_file, sensor_file
from softtact.studies.grasps.config import GraspStudy
from softtact.studies.grasps.stages.summary import papers_model
from softtact.studies.jobs import Job, from_here

_OF_READINGS = {"force_n", "trials", "seed", "virtual_sensor"}
_SIDES = (np.diag([1.0, 1.0, 1.0, 1.0]), np.diag([-1.0, 1.0, -1.0, 1.0]))     # mesh to the frames of the left and the right sensor


def jobs(study: GraspStudy, folder: str | Path) -> list[Job]:
    """All jobs of a study with results in a folder, in an order in which they can run."""
    values = study.values
    grasps, readings = f"{folder}/grasps/{{item}}/events.nc", f"{folder}/grasps/{{item}}/readings.nc"
    sensor = {"sensor": from_here(sensor_file(values.sensor))}
    pressing = sensor | {"materials": [from_here(material_file(name)) for name in study.spec.materials.values()],
                         **({"mjcf": str(values.scene["mjcf"])} if values.scene.get("mjcf") else {})}
    common = values.model_dump(mode="json", include={"mesh", "scene"})
    made: list[Job] = []
    for item in study.items:
        made.append(Job("grasp", {"object": item.entry.file, **pressing}, {"events": grasps},
                        _placed(item) | common | values.model_dump(mode="json", include={"force_n", "model", "policy"}),
                        {"item": item.id}, _presses(study, item.entry)))
        made.append(Job("read_grasp", {"events": grasps.format(item=item.id), **sensor}, {"readings": readings},
                        {"item": item.id} | values.model_dump(mode="json", include=_OF_READINGS), {"item": item.id}))
    event = values.one_event.model_dump(mode="json", exclude={"objects"})
    made += [Job("one_event", {"object": study.catalogue[name].file, **pressing}, {"maps": f"{folder}/one_event/{{item}}.nc"},
                 {"object": name, "unit": study.catalogue[name].unit, **event, **common}, {"item": name},
                 Counter(values.one_event.models)) for name in values.one_event.objects]
    return made + _summary(study, str(folder), sensor, pressing, [job.made() for job in made])


def _summary(study, folder, sensor, pressing, made):
    """The jobs that summarise the results of the others."""
    values = study.values
    items = [{"grasp": item.id} | _placed(item) for item in study.items]
    files = {name: [str(one[name]) for one in made if name in one] for name in ("events", "readings")}
    files["objects"] = [item.entry.file for item in study.items]
    maps = [str(one["maps"]) for one in made if "maps" in one]
    compared: dict[str, Any] = {"compared": maps} if maps else {}
    tables = {"table": f"{folder}/grasps.csv", "claims": f"{folder}/tables/claims.csv"}
    figures = {f"{folder}/figures/objects.png": f"Each object's first position at the grip, {values.force_n:g} N: the hand, and "
               "for both sensors the deformation map and the virtual sensor's mean reading."}
    if maps:
        figures[f"{folder}/figures/one_event.png"] = (f"One and the same event, {values.one_event.force_n:g} N, by several models: "
                                                      "what the left sensor feels.")
    drawn = list(figures)
    return [
        Job("tabulate_grasps", files | compared | sensor, tables,
            {"items": items, **values.model_dump(mode="json", include={"force_n", "policy", "model"})}),
        Job("draw_grasped_objects", files | pressing, {"png": drawn[0]}, {"items": items, "scene": values.scene}),
        *([Job("draw_one_event", compared, {"png": drawn[1]})] if maps else []),
        Job("report", tables | {"figures": drawn}, {"page": f"{folder}/report.html"},
            {"study": study.name, "captions": list(figures.values()), "config": values.model_dump_json(indent=2)}),
    ]


def _placed(item):
    """An object in a position, in the form of a stage's settings."""
    return {"object": item.entry.name, "unit": item.entry.unit, "x_mm": item.x_mm, "y_mm": item.y_mm, "angle_deg": item.angle_deg}


def _presses(study, entry):
    """{model: presses} of a grasp, two events on two sensors, and the scene; the policy `error` may choose a slower model."""
    model, spec = study.values.model, study.spec
    models = [_ruled(entry.file, entry.unit, side, spec.footprint_mm, spec.thickness_mm) if model == "auto" else model
              for side in (0, 1)]
    return {"scene": 1} | Counter(2 * models)


@lru_cache
def _ruled(file, unit, side, footprint_mm, reach_mm):
    """The model that the paper's rule chooses for an object, centred in the frame of a sensor."""
    mesh = read_mesh(file, unit=unit)
    mesh.apply_transform(_SIDES[side])
    return papers_model(place(mesh), footprint_mm=footprint_mm, reach_mm=reach_mm)
