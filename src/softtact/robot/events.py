"""What the sensors feel at the events of a grasp: presses of the true mesh on both fingers, kept with the grasp in `events.nc`.

A press takes the object's pose in the sensor's frame and the normal force from the record, where it is asked for the shear force,
too, and nothing else. So a file that is pressed again (`press_events` of `record_of`) gives the same maps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.files import PROVENANCE, read_dataset, write_dataset
from softtact.geometry.pose import Pose
from softtact.robot.record import EVENTS, FINGERS, PHASES, GraspRecord
from softtact.robot.shear import MODELS as SHEAR_MODELS
from softtact.robot.shear import press_with_shear, with_friction

if TYPE_CHECKING:
    import xarray

    from softtact.press.result import PressResult
    from softtact.press.sensor import Sensor

_LEAST_SHEAR_N = 0.01     # below, shear is the scene's own rounding
_FORCE_DIGITS = 3     # forces are pressed with to 1 mN: both fingers' then agree, and one call presses both
NO_PRESS = "none"     # model of a finger that touches nothing
_POSE = "mm; quaternion w, x, y, z"
_OF_RECORD = {"time_s": (("time",), "s"), "phase": (("time",), "1"), "joint_rad": (("time", "joint"), "rad"),
              "opening_mm": (("time",), "mm"), "sensor_pose_world": (("time", "finger", "pose"), _POSE),
              "object_pose_sensor": (("time", "finger", "pose"), _POSE), "force_n": (("time", "finger", "axis"), "N"),
              "contact": (("time", "finger"), "1"), "event_row": (("event",), "1")}
_OF_MAPS = {"deformation_map_mm": (("event", "finger", "y", "x"), "mm"),
            "tactile_map": (("event", "finger", "row", "column"), "counts"),
            "pressed_force_n": (("event", "finger"), "N"), "pressed_shear_n": (("event", "finger", "aside"), "N"),
            "model": (("event", "finger"), ""),
            "selection_reason": (("event", "finger"), ""), "within_validity": (("event", "finger"), "1")}


@dataclass(frozen=True)
class EventMaps:
    """What both sensors feel at the events of a grasp."""

    deformation_map_mm: np.ndarray
    """(event, finger, y, x) in mm; zero where a finger touches nothing."""
    tactile_map: np.ndarray
    """(event, finger, row, column) in counts: the taxels' ideal reading."""
    pressed_force_n: np.ndarray
    """(event, finger) in N: sum of the pressure on the sensing surface that the model found, with what its shell carries."""
    pressed_shear_n: np.ndarray
    """(event, finger, 2) in N: shear along x and y that the press had; zero where none was asked for."""
    model: np.ndarray
    """(event, finger): which model pressed, or `none`."""
    selection_reason: np.ndarray
    """(event, finger): why this model."""
    within_validity: np.ndarray
    """(event, finger): 0 where the press is not to be relied on."""


def press_events(sensor: "Sensor", mesh: trimesh.Trimesh, record: GraspRecord, *, model: str = "auto", workers: int | None = None,
                 label: str = "grasp", friction: float | None = None, **options: Any) -> EventMaps:
    """Press the mesh on both sensors at each event of a record, by the model that is named or, with `auto`, chosen.

    friction: Coulomb's coefficient of the object on the sensors, with which the record's shear forces are pressed, too, where they
        are above 10 mN; the model must then be named, elastic or hyperelastic
    options: policy, tolerance_mm, as for `Sensor.press`
    Raises InputError for a force out of the sensor's range, ConvergenceError as a press does.
    """
    spec = sensor.spec
    events = len(record.event_row)
    forces = np.round(np.maximum(-record.force_n[record.event_row, :, 2], 0.0), _FORCE_DIGITS) + 0.0
    poses = record.object_pose_sensor[record.event_row]
    maps = EventMaps(np.zeros((events, 2, *spec.map_shape)), np.zeros((events, 2, spec.taxels.rows, spec.taxels.columns)),
                     np.zeros((events, 2)), np.zeros((events, 2, 2)), np.full((events, 2), NO_PRESS, dtype=object),
                     np.full((events, 2), "", dtype=object), np.ones((events, 2), dtype=np.int8))
    shears = np.zeros((events, 2, 2)) if friction is None else record.force_n[record.event_row, :, :2]
    sheared = (np.linalg.norm(shears, axis=2) > _LEAST_SHEAR_N) & (forces > 0)
    if friction is not None and model not in SHEAR_MODELS:
        raise InputError(f"model={model!r}: shear is pressed with {' or '.join(SHEAR_MODELS)}; name one of them.")
    for event, finger in np.argwhere(sheared):
        pose = set_down(mesh, pose_of(poses[event, finger]))
        pressed = press_with_shear(with_friction(sensor, float(friction)), mesh, pose, force_n=float(forces[event, finger]),     # type: ignore[arg-type]
                                   shear_n=shears[event, finger], model=model, threads=workers)
        _keep(maps, (event, finger), pressed.result, step=-1)
        maps.pressed_shear_n[event, finger] = pressed.shear_n
    forces = np.where(sheared, 0.0, forces)
    for force in np.unique(forces[forces > 0]):
        places = np.argwhere(forces == force)
        seen = [set_down(mesh, pose_of(poses[tuple(place)])) for place in places]
        results = sensor.press_many(mesh, seen, force_n=[force], model=model, workers=workers, device="cpu",
                                    label=label and f"{label}, {force:g} N", **options)
        for place, result in zip(places, results, strict=True):
            _keep(maps, tuple(place), result)
    return maps


def _keep(maps: EventMaps, place: tuple[int, ...], result: "PressResult", *, step: int = 0) -> None:
    maps.deformation_map_mm[place], maps.tactile_map[place] = result.deformation_map_mm[step], result.tactile_map[step]
    maps.pressed_force_n[place] = result.pad_force_n[step] + result.shell_force_n[step]     # type: ignore[index]
    maps.model[place], maps.selection_reason[place] = result.model, result.selection_reason or "named by the user"
    maps.within_validity[place] = result.within_validity[step]


def pose_of(values: np.ndarray) -> Pose:
    """The `Pose` of seven numbers: x, y, z in mm and the quaternion w, x, y, z."""
    return Pose(np.array(values[:3]), Rotation.from_quat(values[3:], scalar_first=True))


def set_down(mesh: trimesh.Trimesh, pose: Pose) -> Pose:
    """The pose with the mesh's lowest point on the sensing surface, where a press begins: how deep a pad of MuJoCo's sinks says
    nothing.
    """
    lowest = float(pose.apply(mesh.vertices)[:, 2].min())
    return Pose(pose.translation_mm - [0.0, 0.0, lowest], pose.rotation)


def to_dataset(record: GraspRecord, maps: EventMaps, sensor: "Sensor", facts: Mapping[str, Any]) -> "xarray.Dataset":
    """The content of `events.nc`: dimensions time, finger, event, y, x, row, column; facts: attributes (numbers and texts)."""
    import xarray

    arrays = {name: (dims, np.asarray(getattr(source, name)), {"units": units} if units else {})
              for source, table in ((record, _OF_RECORD), (maps, _OF_MAPS)) for name, (dims, units) in table.items()}
    arrays["phase"][2]["flag_meanings"] = " ".join(PHASES)
    arrays["contact"] = (arrays["contact"][0], record.contact.astype(np.int8), arrays["contact"][2])
    events = np.array(EVENTS[:len(record.event_row)], dtype=object)
    coordinates = {"finger": np.array(FINGERS, dtype=object), "event": events, "x": ("x", sensor.spec.map_x_mm, {"units": "mm"}),
                   "y": ("y", sensor.spec.map_y_mm, {"units": "mm"})}
    return xarray.Dataset(arrays, coords=coordinates, attrs=dict(sorted({"sensor": sensor.spec.name, **facts}.items())))


def write_events(path: str | Path, dataset: "xarray.Dataset") -> None:
    """Write `events.nc`; the same grasp gives the same bytes."""
    write_dataset(path, dataset, seed=None, settings=dict(dataset.attrs))


def facts_of(data: "xarray.Dataset") -> dict[str, Any]:
    """What `to_dataset` was given as facts, from the data set of an `events.nc`."""
    kept = {name: value for name, value in data.attrs.items() if name not in (*PROVENANCE, "sensor")}
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in kept.items()}


def read_events(path: str | Path) -> "xarray.Dataset":
    """The data set of an `events.nc`. Raises InputError that names the file and what it lacks."""
    data = read_dataset(path)
    for name, (dims, _) in _OF_RECORD.items():
        if name not in data.variables or data[name].dims != dims:
            raise InputError(f"{path}: it holds no grasp ({name!r} is missing or has other dimensions than {', '.join(dims)}); "
                             "give a file that softtact grasp wrote.")
    return data


def record_of(data: "xarray.Dataset") -> GraspRecord:
    """The `GraspRecord` in the data set of an `events.nc`, to the bit."""
    arrays = {one.name: data[one.name].values for one in fields(GraspRecord)}
    return GraspRecord(**arrays | {"contact": arrays["contact"].astype(bool)})
