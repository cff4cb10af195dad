"""d of the physics, of no motion and of a network against real markers that were measured in an image of a known press.

    python -m softtact.studies markers.compare_markers --in mesh=cone.stl --in markers=markers.csv --in sensor=gel.yaml \\
        --out table=d.csv --settings '{"pose": [4, 0, 30], "motion": "z -1.5; x -1.0 in 10"}'

The CSV has the columns x_px and y_px, a row for each marker, row by row of the grid, and may have rest_x_px and rest_y_px, the same
markers in the image of the untouched gel. With these the physics moves each marker from where it really was, else from the sensor's
grid.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.evaluation.image_scores import motion_error_px, position_error_px
from softtact.files import read_csv, write_csv
from softtact.studies.markers.paths import pose_on_sensor
from softtact.studies.markers.pressing import deepest_mm, rest_readings
from softtact.studies.markers.stages.data import sensor_with

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_NOW, _REST = ["x_px", "y_px"], ["rest_x_px", "rest_y_px"]


def compare_markers(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write d and the error vector magnitude of each source, in px.

    inputs: mesh (mm, y up as the study's objects), markers (CSV), sensor (YAML), generator (optional)
    outputs: table (CSV: source, d_px, e_px), places (optional CSV: each marker's real and solved place)
    settings: pose [x mm, y mm, angle deg] of the sensor over the object, motion of the object on the sensor, friction (optional)
    """
    from softtact.geometry.meshes import read_mesh

    sensor = sensor_with(inputs["sensor"], settings.get("friction"))
    mesh, pose, motion = read_mesh(inputs["mesh"], unit="mm"), pose_on_sensor(*settings["pose"]), Motion.parse(settings["motion"])
    result = sensor.press(mesh, pose=pose, motion=motion, model="elastic")
    rest = rest_readings(sensor)["markers"].values[0]
    real, real_rest = read_markers(inputs["markers"], rest)
    made = result.readings["markers"].values[-1] - rest + real_rest
    sources = {"no_motion": (real_rest, real_rest), "physics": (made, real_rest)}
    if "generator" in inputs:
        depth = result.readings["depth"].values
        depth = np.concatenate([np.zeros_like(depth[:1]), depth])      # at rest the object just touches
        sources["network"] = _generated(sensor, inputs["generator"], depth, rest, threads)
    write_csv(outputs["table"], pd.DataFrame([
        {"source": name, "d_px": float(position_error_px(places, real)),
         "e_px": float(motion_error_px(places, real, made_at_rest=at_rest, real_at_rest=real_rest))}
        for name, (places, at_rest) in sources.items()]))
    if "places" in outputs:
        columns = {"x_px": real[:, 0], "y_px": real[:, 1], "solved_x_px": made[:, 0], "solved_y_px": made[:, 1]}
        write_csv(outputs["places"], pd.DataFrame(columns))


def read_markers(path: str | Path, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(places, places at rest), each (marker, 2) in px, of a CSV; without the latter in it, those of the sensor, `rest`."""
    try:
        table = read_csv(path)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    if missing := [name for name in _NOW if name not in table]:
        raise InputError(f"{path}: the column {missing[0]!r} is missing; give x_px and y_px, a row for each marker.")
    if len(table) != len(rest):
        raise InputError(f"{path}: it has {len(table)} rows and the sensor {len(rest)} markers; give one row for each, row by row.")
    if not np.isfinite(table[_NOW].to_numpy(dtype=float)).all():
        raise InputError(f"{path}: a place is not a number; give x_px and y_px of every marker.")
    places = table[_NOW].to_numpy(dtype=float)
    return places, table[_REST].to_numpy(dtype=float) if set(_REST) <= set(table) else rest


def _generated(sensor: "Sensor", file: Path, depth_mm: np.ndarray, rest: np.ndarray, threads: int) -> tuple[np.ndarray, np.ndarray]:
    """(places, places at rest) of the markers in the images that a network makes of depth images (n, row, column)."""
    from softtact.learning.image_training import generate
    from softtact.readout.camera import camera_of
    from softtact.readout.depth import grey
    from softtact.studies.markers.pressing import reduced
    from softtact.studies.markers.scoring import Camera, marker_places
    from softtact.studies.markers.stages.scoring import opened_generator

    generator, camera = opened_generator(file, threads), camera_of(sensor.spec, "camera")
    images = generate(generator, grey(reduced(depth_mm, generator.options["pixels"]), max_mm=deepest_mm(sensor.spec)))
    radius = camera.markers.radius_mm / camera.pinhole.mm_per_px     # type: ignore[union-attr]
    places = marker_places(images, Camera(depth_mm.shape[1], radius, rest))
    return places[-1], places[0]
