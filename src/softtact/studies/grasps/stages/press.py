"""Stages that grasp objects with the robot, press them on the sensors, and read these."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import ConvergenceError, InputError
from softtact.files import read_dataset, write_dataset
from softtact.geometry.meshes import place, read_mesh

if TYPE_CHECKING:
    import trimesh

    from softtact.press.sensor import Sensor
    from softtact.robot.scene import Scene

GRIP = 1     # number of the event `grip` in `softtact.robot.events.EVENTS`


def grasp(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Grasp one object in one position, and press it on both sensors at the grasp's events.

    inputs: object (mesh), sensor (YAML), materials (YAML of its layers), mjcf of the robot unless it is the default
    outputs: events (NetCDF);  settings: object, unit, x_mm, y_mm, angle_deg, force_n, model, policy, mesh, scene
    A failed grasp is a result of the study: `events` then has an attribute `failed`, a sentence, and no data.
    """
    import xarray

    from softtact.robot.events import press_events, to_dataset, write_events

    sensor = study_sensor(inputs["sensor"], settings["mesh"])
    mesh = read_mesh(inputs["object"], unit=settings["unit"])
    at = {name: settings[name] for name in ("x_mm", "y_mm", "angle_deg")}
    try:
        scene = scene_of(mesh, sensor, settings["scene"], **at)
        record = _closed(scene, settings["force_n"])
        maps = press_events(sensor, mesh, record, model=settings["model"], workers=threads, label="", policy=settings["policy"])
    except (ConvergenceError, InputError) as error:
        write_dataset(outputs["events"], xarray.Dataset(attrs={"object": settings["object"], "failed": str(error)}), seed=None,
                      settings=settings)
    else:
        facts = {"object": settings["object"], **at, "mass_kg": scene.mass_kg}
        write_events(outputs["events"], to_dataset(record, maps, sensor, facts))


def read_grasp(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read both sensors, two specimens of the virtual sensor, at the event `grip` of a grasp; no readings of a failed grasp.

    inputs: events (NetCDF), sensor (YAML);  outputs: readings (NetCDF);  settings: item, force_n, trials, seed, virtual_sensor
    """
    import xarray

    from softtact.sensors.specification import read_spec

    events = read_dataset(inputs["events"])
    data = xarray.Dataset(attrs={"failed": events.attrs["failed"]}) if "failed" in events.attrs else _readings(
        read_spec(inputs["sensor"]), events, settings)
    write_dataset(outputs["readings"], data, seed=settings["seed"], settings=settings)


def one_event(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press one event of an object with several models: maps (model, y, x) of the left sensor.

    inputs: as of `grasp`;  outputs: maps (NetCDF), in which `lower_share` is the deformation under the features 0.5 mm above the
    lowest ones over that under the lowest ones (`evaluation.curve_shape`)
    settings: object, unit, force_n, models, cover_law, mesh, scene
    """
    import xarray

    from softtact.contact.height_field import HeightField
    from softtact.evaluation.curve_shape import feature_masks
    from softtact.robot.events import pose_of, set_down

    sensor = study_sensor(inputs["sensor"], settings["mesh"], cover_law=settings["cover_law"])
    mesh, spec = read_mesh(inputs["object"], unit=settings["unit"]), sensor.spec
    name, models = settings["object"], settings["models"]
    record = _closed(scene_of(mesh, sensor, settings["scene"]), settings["force_n"])
    row = record.event_row[GRIP]
    pose, force = set_down(mesh, pose_of(record.object_pose_sensor[row, 0])), round(float(-record.force_n[row, 0, 2]), 3)
    pressed = [sensor.press(mesh, pose=pose, force_n=[force], model=model, label=f"{name}, {model}", threads=threads)
               for model in models]
    maps = [result.deformation_map_mm[0] for result in pressed]
    raised, lower = feature_masks(HeightField(place(mesh, pose=pose)).on_grid(spec.map_x_mm, spec.map_y_mm))
    shares = [float(one[lower].mean() / one[raised].mean()) if lower.any() else np.nan for one in maps]
    data = xarray.Dataset({"deformation_map_mm": (("model", "y", "x"), np.stack(maps), {"units": "mm"}),
                           "lower_share": ("model", shares, {"units": "1"}),
                           "within_validity": ("model", [int(result.within_validity[0]) for result in pressed])},
                          coords={"model": np.array(models, dtype=object), "x": ("x", spec.map_x_mm, {"units": "mm"}),
                                  "y": ("y", spec.map_y_mm, {"units": "mm"})},
                          attrs={"object": name, "force_n": force, "cover_law": settings["cover_law"],
                                 "time_s": float(record.time_s[row])})
    write_dataset(outputs["maps"], data, seed=None, settings=settings)


def _readings(spec, events, settings):
    """Data set (finger, trial, row, column) of the counts."""
    import xarray

    from softtact.readout.virtual_sensor import VirtualSensorSettings, read_virtual_sensor

    choices = VirtualSensorSettings.from_dict(settings["virtual_sensor"])
    names = [str(name) for name in events.finger.values]
    counts = [read_virtual_sensor(spec, events.deformation_map_mm.values[GRIP, finger][None], force_n=[settings["force_n"]],
                                  trials=settings["trials"], seed=2 * settings["seed"] + finger, item=f"{settings['item']}/{name}",
                                  settings=choices)
              for finger, name in enumerate(names)]
    return xarray.Dataset({"tactile_map": (("finger", "trial", "row", "column"), np.stack(counts)[:, :, 0], {"units": "counts"})},
                          coords={"finger": np.array(names, dtype=object)}, attrs={"source": "virtual sensor"})


def study_sensor(path: Path, mesh: str, *, cover_law: str | None = None) -> "Sensor":
    """The sensor with a preset of the hyperelastic mesh, and a cover with the printed constants of a law."""
    from dataclasses import replace

    from softtact.materials.config import law_from_printed
    from softtact.models.hyperelastic.mesh_settings import PRESETS
    from softtact.press.sensor import load_sensor
    from softtact.sensors.library import material_file
    from softtact.sensors.specification import read_spec

    resolution, solver = PRESETS[mesh]
    cover = {} if cover_law is None else {"cover": law_from_printed(material_file(read_spec(path).materials["cover"]), cover_law)}
    return replace(load_sensor(path, materials=cover), mesh=resolution(), solver=solver())


def scene_of(mesh: "trimesh.Trimesh", sensor: "Sensor", changes: dict[str, Any], **at: float) -> "Scene":
    """The scene of a mesh between two sensors; at: x_mm, y_mm and angle_deg of the object, as of `robot.scene.Placement`."""
    from softtact.robot.settings import import_mujoco

    import_mujoco()
    from softtact.robot.scene import Placement, build_scene
    from softtact.robot.settings import load_scene

    return build_scene(mesh, sensor.spec, load_scene(**changes), Placement(**at))


def _closed(scene, force_n):
    """The record of a grasp up to the force, without lifting the object."""
    from softtact.robot.grasp import GraspRun

    return GraspRun(scene).run(force_n, lift=False)
