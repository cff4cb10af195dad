"""The record of a grasp, and the presses of the true mesh on both sensors at its events; stored in `events.nc`, without MuJoCo.

A press uses the object's pose in the sensor's frame, the normal force and optionally the shear force of the record. So the presses
of a stored record (`press_events` of `record_of`) give the same maps. A press with shear solves for the tangential
displacement at which friction carries the shear.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError, InputError
from softtact.files import PROVENANCE, read_dataset, write_dataset
from softtact.geometry.pose import Pose

if TYPE_CHECKING:
    import xarray

    from softtact.press.result import PressResult
    from softtact.press.sensor import Sensor


FINGERS = ("left", "right")
PHASES = ("approach", "close", "grip", "lift")
EVENTS = ("contact", "grip", "lift")


@dataclass(frozen=True)
class GraspRecord:
    """A grasp over time, one row for each record; a finger is 0 (left) or 1 (right)."""

    time_s: np.ndarray
    """(t,) in s."""
    phase: np.ndarray
    """(t,) numbers in `PHASES`."""
    joint_rad: np.ndarray
    """(t, 6) in rad."""
    opening_mm: np.ndarray
    """(t,) between the pads' faces."""
    sensor_pose_world: np.ndarray
    """(t, finger, 7): x, y, z in mm and the quaternion w, x, y, z of each sensor in the robot's base frame."""
    object_pose_sensor: np.ndarray
    """(t, finger, 7): pose of the object's mesh in each sensor's frame, likewise."""
    force_n: np.ndarray
    """(t, finger, 3) in N: the object's force on each sensor, in its frame; z is negative where it presses."""
    contact: np.ndarray
    """(t, finger) of bool: whether the object touches the pad."""
    event_row: np.ndarray
    """(event,) rows of the events, in the order of `EVENTS`; without a lift there are two."""


SHEAR_MODELS = ("elastic", "hyperelastic")     # models with friction and tangential motion
_FIRST_MM = 0.01        # first tangential displacement: small enough that almost nothing slips
_TOLERANCE = 0.01       # of the shear, and
_FORCE_N = 1e-3         # resolution of the record's forces
_MOST_PRESSES = 8


@dataclass(frozen=True)
class ShearPress:
    """A press with a shear force."""

    result: "PressResult"
    """Two load steps: straight down, then tangential."""
    slide_mm: np.ndarray
    """(2,) tangential displacement of the object along x and y that the shear needs."""

    @property
    def shear_n(self) -> np.ndarray:
        """Force (2,) in N of the object on the sensor along x and y."""
        return np.asarray(self.result.force_n)[-1, :2]


def press_with_shear(sensor: "Sensor", mesh: trimesh.Trimesh, pose: Pose | None, *, force_n: float, shear_n: np.ndarray,
                     model: str = "elastic", threads: int | None = None) -> ShearPress:
    """Press a mesh (mm) in a pose by a normal force and a shear force (2,), both in N, of the object on the sensor.

    model: elastic or hyperelastic;  the sensor's `friction.object` carries the shear
    Raises InputError for another model or a shear that friction does not carry, ConvergenceError where it is not reached.
    """
    shear, bound = np.asarray(shear_n, dtype=float), sensor.spec.friction.object * force_n
    if model not in SHEAR_MODELS:
        raise InputError(f"model={model!r}: shear is pressed with {' or '.join(SHEAR_MODELS)}; name one of them.")
    size = float(np.linalg.norm(shear))
    if size >= bound:
        raise InputError(f"A shear of {size:.3g} N slips under {force_n:g} N: friction carries less than {bound:.3g} N; state a "
                         "larger friction, or less shear.")

    def pressed(slide: np.ndarray) -> ShearPress:
        motion = Motion().press(force_n=force_n).slide(x_mm=float(slide[0]), y_mm=float(slide[1]))
        return ShearPress(sensor.press(mesh, pose=pose, motion=motion, model=model, label="", threads=threads), slide)

    found = pressed(_FIRST_MM * shear / max(size, 1e-300))
    stiffness = float(found.shear_n @ shear) / max(size, 1e-300) / _FIRST_MM
    inverse = np.eye(2) / stiffness
    for _ in range(_MOST_PRESSES):
        missing = shear - found.shear_n
        if np.linalg.norm(missing) <= _TOLERANCE * size + _FORCE_N:
            return found
        step = inverse @ missing
        trial = pressed(found.slide_mm + step)
        change = trial.shear_n - found.shear_n
        along = step @ inverse
        if abs(along @ change) > 1e-12:      # Broyden's good update of the inverse (Nocedal and Wright, section 11.1)
            inverse = inverse + np.outer(step - inverse @ change, along) / (along @ change)
        found = trial
    rest = np.linalg.norm(shear - found.shear_n)
    raise ConvergenceError(f"A shear of {size:.3g} N was not reached in {_MOST_PRESSES} presses, {rest:.3g} N are missing; it is "
                           "near the limit of friction: state a larger friction.")


_LEAST_SHEAR_N = 0.01     # smaller shears are round-off of the scene
_FORCE_DIGITS = 3     # forces are rounded to 1 mN: then both fingers' are equal, and one call presses both
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
            "selection_reason": (("event", "finger"), ""), "within_validity": (("event", "finger"), "1"),
            "validity_reason": (("event", "finger"), "")}


@dataclass(frozen=True)
class EventMaps:
    """Maps and counts of both sensors at the events of a grasp."""

    deformation_map_mm: np.ndarray
    """(event, finger, y, x) in mm; zero where a finger touches nothing."""
    tactile_map: np.ndarray
    """(event, finger, row, column) in counts: the taxels' ideal reading."""
    pressed_force_n: np.ndarray
    """(event, finger) in N: normal force that the model found on the sensing surface and the shell."""
    pressed_shear_n: np.ndarray
    """(event, finger, 2) in N: shear along x and y in the press; zero for presses without shear."""
    model: np.ndarray
    """(event, finger): model of the press, or `none`."""
    selection_reason: np.ndarray
    """(event, finger): reason for this model."""
    within_validity: np.ndarray
    """(event, finger): 0 where the press is outside the model's validity."""
    validity_reason: np.ndarray
    """(event, finger): why it is; empty where it is not."""


def press_events(sensor: "Sensor", mesh: trimesh.Trimesh, record: GraspRecord, *, model: str = "auto", workers: int | None = None,
                 label: str = "grasp", friction: float | None = None, **options: Any) -> EventMaps:
    """Press the mesh on both sensors at each event of a record, with the named model or, for `auto`, a chosen one.

    friction: Coulomb's coefficient of the object on the sensors. With it the record's shear forces above 10 mN are pressed, too;
        the model must then be named, elastic or hyperelastic
    options: policy, tolerance_mm, as for `Sensor.press`
    Raises InputError for a force out of the sensor's range, ConvergenceError as a press does.
    """
    spec, taxels = sensor.spec, sensor.spec.need_taxels("a record of grasps")
    events = len(record.event_row)
    forces = np.round(np.maximum(-record.force_n[record.event_row, :, 2], 0.0), _FORCE_DIGITS) + 0.0
    poses = record.object_pose_sensor[record.event_row]
    maps = EventMaps(np.zeros((events, 2, *spec.map_shape)), np.zeros((events, 2, taxels.rows, taxels.columns)),
                     np.zeros((events, 2)), np.zeros((events, 2, 2)), np.full((events, 2), NO_PRESS, dtype=object),
                     np.full((events, 2), "", dtype=object), np.ones((events, 2), dtype=np.int8),
                     np.full((events, 2), "", dtype=object))
    shears = np.zeros((events, 2, 2)) if friction is None else record.force_n[record.event_row, :, :2]
    sheared = (np.linalg.norm(shears, axis=2) > _LEAST_SHEAR_N) & (forces > 0)
    if friction is not None and model not in SHEAR_MODELS:
        raise InputError(f"model={model!r}: shear is pressed with {' or '.join(SHEAR_MODELS)}; name one of them.")
    for event, finger in np.argwhere(sheared):
        pose = set_down(mesh, pose_of(poses[event, finger]))
        pressed = press_with_shear(sensor.with_friction(friction), mesh, pose, force_n=float(forces[event, finger]),     # type: ignore[arg-type]
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
    maps.pressed_force_n[place] = result.pad_force_n[step] + result.shell_force_n[step]
    maps.model[place], maps.selection_reason[place] = result.model, result.selection_reason or "named by the user"
    maps.within_validity[place], maps.validity_reason[place] = result.within_validity[step], str(result.validity_reason[step])


def pose_of(values: np.ndarray) -> Pose:
    """The `Pose` of seven numbers: x, y, z in mm and the quaternion w, x, y, z."""
    return Pose(np.array(values[:3]), Rotation.from_quat(values[3:], scalar_first=True))


def set_down(mesh: trimesh.Trimesh, pose: Pose) -> Pose:
    """The pose with the mesh's lowest point on the sensing surface, where a press begins.

    The depth to which MuJoCo's pads sink in has no meaning.
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
    """The facts that `to_dataset` was given, from the data set of an `events.nc`."""
    kept = {name: value for name, value in data.attrs.items() if name not in (*PROVENANCE, "sensor")}
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in kept.items()}


def read_events(path: str | Path) -> "xarray.Dataset":
    """The data set of an `events.nc`. Raises InputError that names the file and a missing array."""
    data = read_dataset(path)
    for name, (dims, _) in _OF_RECORD.items():
        if name not in data.variables or data[name].dims != dims:
            raise InputError(f"{path}: it holds no grasp ({name!r} is missing or has other dimensions than {', '.join(dims)}); "
                             "give a file that softtact grasp wrote.")
    return data


def record_of(data: "xarray.Dataset") -> GraspRecord:
    """The `GraspRecord` in the data set of an `events.nc`, with identical bits."""
    arrays = {one.name: data[one.name].values for one in fields(GraspRecord)}
    return GraspRecord(**arrays | {"contact": arrays["contact"].astype(bool)})
