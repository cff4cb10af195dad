"""Sequences of frames of one object: pressed by the elastic model, seen by the camera, written as a file of image sequences.

A file (NetCDF) has the dimension `frame`; the labels of each frame are `sequence`, `split`, `object`, `pose_x_mm`, `pose_y_mm`,
`pose_angle_deg`, `aside`, `end_depth_mm`, `depth_mm`, `aside_mm`; its values are

    depth_grey (frame, row, column)              object's depth below the surface at rest, 255 for the depth readout's largest
    image (frame, row, column, channel)          camera image, reduced by means over blocks of pixels
    marker_px (frame, marker, axis)              column and row in px of the camera's own image, not of the reduced one
    marker_mm (frame, marker, direction)         place on the surface in mm
    force_n (frame, direction), slip_share       force on the surface; share of the touching points that slide

and, where `surface_maps` is asked for, displacement_mm, traction_mpa (frame, y, x, direction) and slip (frame, y, x).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.readout.depth import grey
from softtact.studies.markers.paths import Path, SequencePlan, pose_on_sensor

if TYPE_CHECKING:
    import trimesh
    import xarray

    from softtact.press.sensor import Sensor

LABELS = (
    "sequence",
    "split",
    "object",
    "pose_x_mm",
    "pose_y_mm",
    "pose_angle_deg",
    "aside",
    "end_depth_mm",
    "depth_mm",
    "aside_mm",
)


@dataclass(frozen=True)
class Frames:
    """What a sensor gives along a motion; the first frame is at rest."""

    depth_mm: np.ndarray
    """(frame, row, column): the object's depth below the surface at rest, in the camera's pixels."""
    image: np.ndarray
    """(frame, row, column, 3) uint8."""
    marker_px: np.ndarray
    """(frame, marker, 2) column and row."""
    marker_mm: np.ndarray
    """(frame, marker, 3) on the surface."""
    displacement_mm: np.ndarray
    """(frame, y, x, 3) of the surface."""
    traction_mpa: np.ndarray
    """(frame, y, x, 3) on the surface."""
    slip: np.ndarray
    """(frame, y, x) bool: touches and slides."""
    force_n: np.ndarray
    """(frame, 3) on the surface."""
    x_mm: np.ndarray
    """(x,) of the maps."""
    y_mm: np.ndarray
    """(y,)."""


Maker = Callable[["trimesh.Trimesh", SequencePlan, Path], Frames]


def press_frames(sensor: "Sensor", mesh: "trimesh.Trimesh", plan: SequencePlan, path: Path) -> Frames:
    """The `Frames` of a sequence, by the elastic model."""
    pose = pose_on_sensor(plan.x_mm, plan.y_mm, plan.angle_deg)
    result = sensor.press(mesh, pose=pose, motion=plan.motion(path), model="elastic")
    rest = rest_readings(sensor)
    image, px = (np.concatenate([rest[name].values, result.readings[name].values]) for name in ("camera", "markers"))
    places = [np.stack([read["markers"][f"{axis}_mm"].values for axis in "xyz"], axis=-1) for read in (rest, result.readings)]
    slid = np.nan_to_num(result.slip)
    return Frames(
        depth_mm=_after_rest(result.readings["depth"].values),
        image=image,
        marker_px=px,
        marker_mm=np.concatenate(places),
        displacement_mm=_after_rest(result.displacement_mm),
        traction_mpa=_after_rest(result.traction_mpa),
        slip=np.diff(_after_rest(_after_rest(slid)), axis=0) > 0,
        force_n=_after_rest(np.asarray(result.force_n)),
        x_mm=sensor.spec.map_x_mm,
        y_mm=sensor.spec.map_y_mm,
    )


def deepest_mm(spec: Any) -> float:
    """Depth that grey 255 stands for: the largest of a sensor's depth readout."""
    return float((spec.readouts["depth"].model_extra or {})["max_mm"])


def rest_readings(sensor: "Sensor") -> "Mapping[str, xarray.DataArray]":
    """{name: (1, ...)} readings of camera and markers without an object."""
    from softtact.press.kinds import KINDS
    from softtact.readout.registry import readings_of

    readouts = {name: one for name, one in sensor.readouts.items() if name in ("camera", "markers")}
    return readings_of(readouts, KINDS[sensor.spec.kind].at_rest(sensor))


def _after_rest(values: np.ndarray) -> np.ndarray:
    """(1 + step, ...) with zeros first."""
    return np.concatenate([np.zeros_like(values[:1]), values])


def sequence_file(
    plans: Sequence[SequencePlan],
    numbers: Sequence[int],
    make: Callable[[SequencePlan], Frames],
    *,
    path: Path,
    pixels: int,
    max_mm: float,
    surface_maps: bool = False,
) -> "xarray.Dataset":
    """The data set of some sequences, numbered for the whole study.

    make: the frames of a plan;  max_mm: depth that grey 255 stands for
    """
    import xarray

    parts: dict[str, list[np.ndarray]] = {}
    for plan, number in zip(plans, numbers, strict=True):
        frames = make(plan)
        for name, values in (_labels(plan, number, path) | _values(frames, pixels, max_mm, surface_maps)).items():
            parts.setdefault(name, []).append(values)
    joined = {name: np.concatenate(values) for name, values in parts.items()}
    data = xarray.Dataset({name: (_DIMENSIONS.get(name, ("frame",)), values, _attributes(name)) for name, values in joined.items()})
    if surface_maps:
        data = data.assign_coords(x=("x", frames.x_mm, {"units": "mm"}), y=("y", frames.y_mm, {"units": "mm"}))
    for name in set(_DIMENSIONS) & set(joined):
        data[name].encoding = {"zlib": True, "complevel": 4}
    return data.assign_attrs(max_mm=max_mm, camera_px=frames.image.shape[1])


_DIMENSIONS = {
    "depth_grey": ("frame", "row", "column"),
    "image": ("frame", "row", "column", "channel"),
    "marker_px": ("frame", "marker", "axis"),
    "marker_mm": ("frame", "marker", "direction"),
    "force_n": ("frame", "direction"),
    "displacement_mm": ("frame", "y", "x", "direction"),
    "traction_mpa": ("frame", "y", "x", "direction"),
    "slip": ("frame", "y", "x"),
}
_UNITS = {"_mm": "mm", "_px": "px", "_n": "N", "_mpa": "MPa", "_deg": "degrees"}


def _attributes(name):
    unit = next((unit for end, unit in _UNITS.items() if name.endswith(end)), None)
    return {"units": unit} if unit else {}


def _labels(plan: SequencePlan, number: int, path: Path) -> dict[str, np.ndarray]:
    moved = plan.moved_mm(path)
    same = {
        "sequence": number,
        "split": plan.split,
        "object": plan.object,
        "pose_x_mm": plan.x_mm,
        "pose_y_mm": plan.y_mm,
        "pose_angle_deg": plan.angle_deg,
        "aside": plan.aside,
        "end_depth_mm": plan.depth_mm,
    }
    repeated = {name: np.full(len(moved), value, dtype=object if isinstance(value, str) else None) for name, value in same.items()}
    return repeated | {"depth_mm": moved[:, 0], "aside_mm": moved[:, 1]}


def _values(frames: Frames, pixels: int, max_mm: float, surface_maps: bool) -> dict[str, np.ndarray]:
    touching = frames.traction_mpa[..., 2] < 0
    found = {
        "depth_grey": grey(reduced(frames.depth_mm, pixels), max_mm=max_mm),
        "image": np.round(reduced(frames.image, pixels)).astype(np.uint8),
        "marker_px": frames.marker_px.astype(np.float32),
        "marker_mm": frames.marker_mm.astype(np.float32),
        "force_n": frames.force_n.astype(np.float32),
        "slip_share": ((frames.slip & touching).sum(axis=(1, 2)) / np.maximum(touching.sum(axis=(1, 2)), 1)).astype(np.float32),
    }
    if surface_maps:
        found |= {name: getattr(frames, name).astype(np.float32) for name in ("displacement_mm", "traction_mpa")}
        found["slip"] = frames.slip.astype(np.int8)
    return found


def reduced(images: np.ndarray, pixels: int) -> np.ndarray:
    """Square images (n, y, x) or (n, y, x, channel) as means over blocks, `pixels` a side, float."""
    side = images.shape[1]
    if images.shape[2] != side or side % pixels:
        raise InputError(
            f"the camera's image of {images.shape[2]} x {side} px is not divided into {pixels} x {pixels} blocks; name a "
            "sensor whose camera has 256 x 256 px."
        )
    block = side // pixels
    shape = (len(images), pixels, block, pixels, block, *images.shape[3:])
    return images.reshape(shape).mean(axis=(2, 4), dtype=np.float32)


def facts_of(data: "xarray.Dataset") -> dict[str, Any]:
    """Numbers of a file for the report: sequences, frames, largest force and motion of a marker."""
    rest = data.marker_px.values[0]
    return {
        "sequences": int(len(np.unique(data.sequence.values))),
        "frames": int(data.sizes["frame"]),
        "largest_force_n": float(-data.force_n.values[:, 2].min()),
        "largest_marker_motion_px": float(np.linalg.norm(data.marker_px.values - rest, axis=-1).max()),
    }
