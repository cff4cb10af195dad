"""What all grasps of a study tell together: their table, the paper's claims, figures, the report."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.files import read_dataset, write_csv

if TYPE_CHECKING:
    import trimesh

GRIP = 1     # number of the event `grip` in `softtact.robot.events.EVENTS`


def tabulate_grasps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write a row for each grasp, and the verdict on each of the paper's claims.

    inputs: events, readings, objects (lists, in the grasps' order), compared (list), sensor (YAML);  outputs: table, claims (CSV)
    settings: items [{grasp, object, unit, x_mm, y_mm, angle_deg}, ...], force_n, policy, model
    """
    from softtact.geometry.meshes import read_mesh
    from softtact.sensors.specification import read_spec
    from softtact.studies.grasps.claims import claims_of_grasps

    spec = read_spec(inputs["sensor"])
    rows = []
    files = (inputs[name] for name in ("events", "readings", "objects"))
    for item, events, readings, mesh in zip(settings["items"], *files, strict=True):
        row = {name: item[name] for name in ("grasp", "object", "x_mm", "y_mm", "angle_deg")}
        data = read_dataset(events)
        rows.append(row | ({"status": "failed", "message": data.attrs["failed"]} if "failed" in data.attrs else
                           _facts(data, read_dataset(readings), read_mesh(mesh, unit=item["unit"]), spec)))
    table = pd.DataFrame(rows)
    write_csv(outputs["table"], table)
    write_csv(outputs["claims"], claims_of_grasps(table, _compared(inputs), force_n=settings["force_n"], policy=settings["policy"],
                                                  model=settings["model"]))


def draw_grasped_objects(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw each object's first grasp that was done: the hand, and what both sensors feel.

    inputs: events, readings, objects (lists, in the grasps' order), sensor (YAML), materials;  outputs: png
    settings: items, mesh, scene
    """
    from softtact.studies.grasps.report import draw_objects

    events, readings, files = {}, {}, {}
    for item, *paths in zip(settings["items"], inputs["events"], inputs["readings"], inputs["objects"], strict=True):
        data = read_dataset(paths[0])
        if "failed" not in data.attrs and item["object"] not in events:
            events[item["object"]], readings[item["object"]] = data, read_dataset(paths[1])
            files[item["object"]] = (paths[2], item["unit"])
    draw_objects(outputs["png"], events, readings, dict(_pictures(events, files, inputs["sensor"], settings)))


def draw_one_event(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw what several models make of one event.  inputs: compared (list);  outputs: png."""
    from softtact.studies.grasps.report import draw_one_event as draw

    draw(outputs["png"], _compared(inputs))


def report(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page.  inputs: table, claims, figures (list);  outputs: page;  settings: study, captions, config."""
    from softtact.studies.grasps.report import write_grasps_report

    grasps, claims = pd.read_csv(inputs["table"]), pd.read_csv(inputs["claims"], keep_default_na=False)
    write_grasps_report(outputs["page"].parent, study=settings["study"], grasps=grasps, claims=claims,
                        figures=list(zip(inputs["figures"], settings["captions"], strict=True)), config=settings["config"])


def papers_model(placed: "trimesh.Trimesh", *, footprint_mm: tuple[float, float], reach_mm: float) -> str:
    """The model that the paper's rule takes for an object that is placed over the pad: what of it is over the pad counts."""
    from softtact.geometry.complexity import choose_model, score

    counts = score(placed.triangles, footprint_mm=footprint_mm, reach_mm=reach_mm)
    return choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)


def _compared(inputs):
    """{object: maps of several models}."""
    return {data.attrs["object"]: data for data in map(read_dataset, inputs.get("compared", []))}


def _facts(data, readings, mesh, spec):
    """What a row of the table says of a grasp that was done."""
    from softtact.geometry.meshes import place
    from softtact.robot.events import pose_of, set_down

    at = int(data.event_row[GRIP])
    row = {"status": "done", "message": "", "trials": readings.sizes["trial"],
           "contact_s": float(data.time_s[int(data.event_row[0])]), "grip_s": float(data.time_s[at])}
    for finger, name in enumerate(map(str, data.finger.values)):
        placed = place(mesh, pose=set_down(mesh, pose_of(data.object_pose_sensor.values[at, finger])))
        spread = readings.tactile_map.values[finger].std(axis=0, ddof=1) if readings.sizes["trial"] > 1 else np.zeros(1)
        row |= {f"force_{name}_n": -float(data.force_n[at, finger, 2]), f"model_contact_{name}": data.model.values[0, finger],
                f"model_grip_{name}": data.model.values[GRIP, finger],
                f"rule_{name}": papers_model(placed, footprint_mm=spec.footprint_mm, reach_mm=spec.thickness_mm),
                f"valid_{name}": int(data.within_validity[GRIP, finger]),
                f"deepest_{name}_mm": float(data.deformation_map_mm[GRIP, finger].max()),
                f"counts_{name}": float(readings.tactile_map[finger].sum(dim=("row", "column")).mean()),
                f"trial_sd_{name}_counts": float(spread.mean())}
    return row


def _pictures(events, files, sensor: Path, settings) -> Iterator[tuple[str, np.ndarray]]:
    """(object, image of the hand at the grip) of each object; nothing where MuJoCo does not draw."""
    from softtact.geometry.meshes import read_mesh
    from softtact.robot.settings import import_mujoco

    import_mujoco()
    from softtact.robot.events import record_of
    from softtact.robot.render import draw_rows
    from softtact.robot.scene import Placement, build_scene
    from softtact.robot.settings import load_scene
    from softtact.sensors.specification import read_spec

    for name, data in events.items():
        path, unit = files[name]
        record = record_of(data)
        scene = build_scene(read_mesh(path, unit=unit), read_spec(sensor), load_scene(**settings["scene"]),
                            Placement(*(data.attrs[key] for key in ("x_mm", "y_mm", "angle_deg"))))
        images = draw_rows(scene, record, [record.event_row[1]], view=(20.0, -20.0, 0.22), size=(300, 300))
        if images is None:
            return
        yield name, images[0]
