"""Running the study of grasps: each grasp in the scene, pressed at its events, read by the virtual sensor. What is done is kept.

    grasps/ITEM/events.nc, readings.nc     one position of an object; readings are of the event `grip`
    one_event/OBJECT.nc                    what several models make of one event
    grasps.csv                             a row for each grasp
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.errors import ConvergenceError, InputError
from softtact.evaluation.curve_shape import feature_masks
from softtact.files import digest, read_dataset, write_csv, write_dataset
from softtact.geometry.meshes import place, read_mesh
from softtact.progress import announce, progress
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_virtual_sensor
from softtact.robot.events import FINGERS, pose_of, press_events, read_events, set_down, to_dataset, write_events
from softtact.robot.grasp import GraspRun
from softtact.robot.scene import Placement, build_scene
from softtact.robot.settings import load_scene
from softtact.studies.grasps.config import GraspItem, GraspStudy, entry_of

GRIP = 1     # number of the event `grip`


def run_study(study: GraspStudy, folder: Path, *, workers: int | None = None) -> pd.DataFrame:
    """Do what is left of the study's grasps; return, and write as grasps.csv, a row for each.

    A grasp that fails is told in its row (`status`), and the others go on.
    """
    sensor = study.sensor()
    rows = [_row(study, item, _done(study, sensor, item, folder / "grasps" / item.id, workers))
            for item in progress(study.items, label=study.values.study)]
    for name in study.values.one_event.objects:
        compare_models(study, name, folder / "one_event" / f"{name}.nc", workers=workers)
    table = pd.DataFrame(rows)
    write_csv(folder / "grasps.csv", table)
    return table


def _done(study, sensor, item, folder, workers):
    """(events, readings) of an item, made now or kept from before; or the error of one that fails."""
    events, readings = folder / "events.nc", folder / "readings.nc"
    of_readings = digest([study.digest_of(item), study.values.trials, study.values.virtual_sensor])
    if not _is_of(events, study.digest_of(item)):
        try:
            write_events(events, _grasped(study, sensor, item, workers))
        except (ConvergenceError, InputError) as error:
            announce(f"{study.values.study}: {item.id}: {error}")
            return error
    data = read_events(events)
    if not _is_of(readings, of_readings):
        read = _readings(study, item, data).assign_attrs(study_digest=of_readings)
        write_dataset(readings, read, seed=study.values.seed, settings=of_readings)
    return data, read_dataset(readings)


def _is_of(path: Path, wanted: str) -> bool:
    """Whether a file is there and was made with these settings."""
    return path.exists() and read_dataset(path).attrs.get("study_digest") == wanted


def _grasped(study, sensor, item, workers):
    values = study.values
    mesh = read_mesh(item.entry.file, unit=item.entry.unit)
    scene = build_scene(mesh, study.spec, load_scene(**values.scene), Placement(item.x_mm, item.y_mm, item.angle_deg))
    record = GraspRun(scene).run(values.force_n, lift=False)
    maps = press_events(sensor, mesh, record, model=values.model, workers=workers, label="", policy=values.policy)
    facts = {"object": item.entry.name, "x_mm": item.x_mm, "y_mm": item.y_mm, "angle_deg": item.angle_deg,
             "mass_kg": scene.mass_kg, "study_digest": study.digest_of(item)}
    return to_dataset(record, maps, sensor, facts)


def _readings(study, item, data):
    """Readings of both sensors at the event `grip`: two specimens of the virtual sensor."""
    values, settings = study.values, VirtualSensorSettings.from_dict(study.values.virtual_sensor)
    counts = [read_virtual_sensor(study.spec, data.deformation_map_mm.values[GRIP, finger][None], force_n=[values.force_n],
                                  trials=values.trials, seed=2 * values.seed + finger, item=f"{item.id}/{name}", settings=settings)
              for finger, name in enumerate(FINGERS)]
    return xarray.Dataset({"tactile_map": (("finger", "trial", "row", "column"), np.stack(counts)[:, :, 0], {"units": "counts"})},
                          coords={"finger": np.array(FINGERS, dtype=object)}, attrs={"source": "virtual sensor"})


def compare_models(study: GraspStudy, name: str, path: Path, *, workers: int | None = None) -> xarray.Dataset:
    """What each model of `one_event` makes of one event of an object, kept in a file: maps (model, y, x) of the left sensor.

    lower_share: deformation under the features 0.5 mm above the lowest ones, over that under these (`evaluation.features`)
    """
    values = study.values.one_event
    wanted = digest([values.model_dump(exclude={"objects"}), study.values.mesh, study.values.sensor, study.values.scene])
    if _is_of(path, wanted):
        return read_dataset(path)
    entry = entry_of(study, name)
    mesh = read_mesh(entry.file, unit=entry.unit)
    run = GraspRun(build_scene(mesh, study.spec, load_scene(**study.values.scene)))
    record = run.run(values.force_n, lift=False)
    row = record.event_row[GRIP]
    sensor = study.sensor(cover_law=values.cover_law)
    pose, force = set_down(mesh, pose_of(record.object_pose_sensor[row, 0])), round(float(-record.force_n[row, 0, 2]), 3)
    maps, valid = [], []
    for model in values.models:
        result = sensor.press(mesh, pose=pose, force_n=[force], model=model, label=f"{name}, {model}", threads=workers)
        maps.append(result.deformation_map_mm[0])
        valid.append(int(result.within_validity[0]))
    raised, lower = feature_masks(_heights(study, mesh, pose))
    shares = [float(one[lower].mean() / one[raised].mean()) if lower.any() else np.nan for one in maps]
    data = xarray.Dataset({"deformation_map_mm": (("model", "y", "x"), np.stack(maps), {"units": "mm"}),
                           "lower_share": ("model", shares, {"units": "1"}), "within_validity": ("model", valid)},
                          coords={"model": np.array(values.models, dtype=object), "x": ("x", study.spec.map_x_mm, {"units": "mm"}),
                                  "y": ("y", study.spec.map_y_mm, {"units": "mm"})},
                          attrs={"object": name, "force_n": force, "cover_law": values.cover_law,
                                 "time_s": float(record.time_s[row]), "study_digest": wanted})
    write_dataset(path, data, seed=None, settings=wanted)
    return data


def _heights(study, mesh, pose):
    """Heights (y, x) of the object's underside over the map's points, nan beside it."""
    x, y = np.meshgrid(study.spec.map_x_mm, study.spec.map_y_mm)
    heights = np.asarray(HeightField(place(mesh, pose=pose))(x.ravel(), y.ravel())[0], dtype=float).reshape(x.shape)
    return np.where(heights < NO_CONTACT_MM, heights, np.nan)


def _row(study: GraspStudy, item: GraspItem, done: Any) -> dict[str, Any]:
    """A row of grasps.csv."""
    row: dict[str, Any] = {"grasp": item.id, "object": item.entry.name, "x_mm": item.x_mm, "y_mm": item.y_mm,
                           "angle_deg": item.angle_deg}
    if isinstance(done, Exception):
        return row | {"status": "failed", "message": str(done)}
    data, readings = done
    at, mesh = int(data.event_row[GRIP]), read_mesh(item.entry.file, unit=item.entry.unit)
    row |= {"status": "done", "message": "", "trials": readings.sizes["trial"],
            "contact_s": float(data.time_s[int(data.event_row[0])]), "grip_s": float(data.time_s[at])}
    for finger, name in enumerate(FINGERS):
        pose = set_down(mesh, pose_of(data.object_pose_sensor.values[at, finger]))
        spread = readings.tactile_map.values[finger].std(axis=0, ddof=1) if readings.sizes["trial"] > 1 else np.zeros(1)
        row |= {f"force_{name}_n": -float(data.force_n[at, finger, 2]), f"model_contact_{name}": data.model.values[0, finger],
                f"model_grip_{name}": data.model.values[GRIP, finger], f"rule_{name}": study.ruled_at(item.entry, pose),
                f"valid_{name}": int(data.within_validity[GRIP, finger]),
                f"deepest_{name}_mm": float(data.deformation_map_mm[GRIP, finger].max()),
                f"counts_{name}": float(readings.tactile_map[finger].sum(dim=("row", "column")).mean()),
                f"trial_sd_{name}_counts": float(spread.mean())}
    return row
