"""Objects, their presses, and the data set."""

import shutil
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.files import atomic_path, read_dataset, write_csv, write_dataset, write_json
from softtact.progress import Watch
from softtact.studies.markers import paths
from softtact.studies.markers.pressing import LABELS, Frames, facts_of, press_frames, sequence_file
from softtact.studies.markers.shapes import generated_object

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

# Friction at which hardly a point slides, some in a million at the edges of a tetrahedron; with 1000 such edges may not settle.
FULL_STICK = 10.0
_OF_A_PAIR = ["object", "pose_x_mm", "pose_y_mm", "pose_angle_deg", "depth_mm", "aside_mm", "aside"]
_DECIMALS = 6      # of lengths in mm: the same depth of two sequences differs by round-off
_FRICTION = {"full_stick": FULL_STICK, "linear_frictionless": 0.0}


def shape_object(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write an object's mesh: a copy of its file, or a generated one.

    inputs: mesh, where there is a file;  outputs: mesh (STL, mm, y up);  settings: object
    """
    with atomic_path(outputs["mesh"]) as temporary:
        if "mesh" in inputs:
            shutil.copyfile(inputs["mesh"], temporary)
        else:
            generated_object(settings["object"]).export(temporary, file_type="stl")


def press_object(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press an object along some sequences, and write what camera, markers and depth readout give.

    inputs: mesh, sensor, materials;  outputs: sequences (NetCDF of `pressing`)
    settings: plans (values of `paths.SequencePlan`), numbers, path, pixels, deepest_mm, friction, surface_maps
    """
    press = _Press(inputs, settings)
    data = sequence_file(
        press.plans,
        settings["numbers"],
        press,
        path=press.path,
        pixels=settings["pixels"],
        max_mm=settings["deepest_mm"],
        surface_maps=settings["surface_maps"],
    )
    write_dataset(outputs["sequences"], data, seed=None, settings=settings)


def press_baseline(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press an object with another physics, and write the markers of all frames.

    inputs, settings: as of `press_object`, with baseline (its name);  outputs: markers (NetCDF)
    """
    import xarray

    press = _Press(inputs, settings | {"friction": _FRICTION[settings["baseline"]]})
    frames = [press(plan) for plan in press.plans]
    numbers = np.repeat(settings["numbers"], [len(one.marker_px) for one in frames])
    data = xarray.Dataset(
        {
            "marker_px": (("frame", "marker", "axis"), np.concatenate([one.marker_px for one in frames]), {"units": "px"}),
            "sequence": ("frame", numbers),
        },
        attrs={"baseline": settings["baseline"]},
    )
    write_dataset(outputs["markers"], data, seed=None, settings=settings)


class _Press:
    """The presses of one object, with progress."""

    def __init__(self, inputs: dict[str, Any], settings: dict[str, Any]) -> None:
        from softtact.geometry.meshes import read_mesh

        self.path = paths.Path(**settings["path"])
        self.plans = [paths.SequencePlan(**values) for values in settings["plans"]]
        self._sensor, self._mesh = sensor_with(inputs["sensor"], settings["friction"]), read_mesh(inputs["mesh"], unit="mm")
        self._watch, self._done = Watch(f"presses of {self.plans[0].object}"), 0

    def __call__(self, plan: paths.SequencePlan) -> Frames:
        found = press_frames(self._sensor, self._mesh, plan, self.path)
        self._done += 1
        self._watch.report(f"{self._done} of {len(self.plans)} sequences")
        return found


def sensor_with(file: str | Path, friction: float | None) -> "Sensor":
    """A sensor with another coefficient of friction of objects; None: its own."""
    from softtact.press.sensor import load_sensor

    sensor = load_sensor(file)
    return sensor if friction is None else sensor.with_friction(friction)


def pairs_of(labels: pd.DataFrame) -> pd.DataFrame:
    """The different pairs of images among frames, as the paper counts them.

    Sequences of a pose share their way down, so each depth counts once, and each place aside from a depth once.
    labels: a row for each frame, with the columns `pressing.LABELS`
    """
    pressed = labels.loc[labels.depth_mm > 0, _OF_A_PAIR].round(_DECIMALS)
    return pressed.assign(aside=pressed.aside.where(pressed.aside_mm > 0, "")).drop_duplicates()


def list_data(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """List the sequences of the data set, and state its size.

    inputs: sequences (list);  outputs: manifest (CSV, a row for each sequence), facts (JSON)
    settings: path, generated (names of generated objects), objects (number)
    """
    rows, facts, pairs = [], [], []
    for file in inputs["sequences"]:
        data = read_dataset(file)
        facts.append(facts_of(data))
        frame = pd.DataFrame({name: data[name].values for name in LABELS} | {"slip_share": data.slip_share.values})
        pairs.append(pairs_of(frame))
        for _, one in frame.groupby("sequence"):
            first = one.iloc[0]
            rows.append(
                {
                    **{name: first[name] for name in LABELS[:-2]},
                    "frames": len(one),
                    "largest_slip_share": one.slip_share.max(),
                    "file": Path(file).name,
                }
            )
    write_csv(outputs["manifest"], pd.DataFrame(rows).sort_values("sequence"))
    path = paths.Path(**settings["path"])
    write_json(
        outputs["facts"],
        {
            "sequences": sum(one["sequences"] for one in facts),
            "frames": sum(one["frames"] for one in facts),
            "share_of_printed_pairs": len(pd.concat(pairs)) / paths.PAIRS_PRINTED,
            "pairs_of_object": path.pairs(),
            "poses": len(path.poses),
            "largest_force_n": max(one["largest_force_n"] for one in facts),
            "largest_marker_motion_px": max(one["largest_marker_motion_px"] for one in facts),
            "generated": settings["generated"],
            "objects": settings["objects"],
        },
    )


def plan_values(plan: paths.SequencePlan) -> dict[str, Any]:
    """A plan as plain values of a stage's settings."""
    return asdict(plan)


def press_sliding(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """As `press_object`, of the one sequence of the sliding test."""
    press_object(inputs=inputs, outputs=outputs, settings=settings, threads=threads)
