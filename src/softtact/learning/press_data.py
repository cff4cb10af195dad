"""Data sets of random presses: HDF5, NetCDF, or LeRobot's format.

A run that is killed, or stopped by a full disk, keeps its finished blocks of presses (`press_blocks`), from which the same call
continues. Once all blocks are there, the data set is written, read back, compared with them, and only then gets its name.

Press n uses object n modulo the number of objects. Its place and angle are drawn from the seed, the object's name and n only. All
presses have the same forces. With two fingers the object is also pressed from its opposite side, as in a grip.

Formats of a finished data set:
hdf5      arrays by name: (press, force, finger, ...)
netcdf    the same, labelled (xarray)
lerobot   a folder in LeRobot's format (`softtact.learning.lerobot`), a frame for each press and force: `observation.tactile.left`,
          `observation.force`, `observation.state`, and a video of the deformation map, `observation.images.deformation.left`. An
          episode is a press with its forces, a task is an object.
"""

import json
import os
import shutil
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import softtact
from softtact.errors import InputError, OutputError, SofttactError, require
from softtact.files import atomic_path, digest, new_hdf5, wait_for_disk, write_dataset
from softtact.geometry.pose import Pose, draw_poses
from softtact.learning.lerobot import FPS, same_as, write_lerobot
from softtact.learning.press_blocks import BLOCK, PressBlocks
from softtact.outputs import held, not_written, target_of
from softtact.press.kinds import KINDS
from softtact.progress import progress
from softtact.readout.taxels import need_whole_counts, whole_counts

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_BEHIND = Rotation.from_euler("y", 180, degrees=True)
DONE, FAILED = 1, 2     # status of a press
FORMATS = {"hdf5": (".h5", ".hdf5"), "netcdf": (".nc",), "lerobot": ("",)}
FINGERS = ("left", "right")
_PIXELS = 4     # of a picture, along a step of the deformation map
_OF_A_BLOCK = {"deformation_map_mm": ("mm", "force", "finger", "y", "x"),
               "tactile_map": ("counts", "force", "finger", "row", "column"), "indentation_mm": ("mm", "force", "finger"),
               "within_validity": ("1", "force", "finger"), "status": ("1",), "pose": ("mm, degrees", "six"),
               "object": ("number in objects",)}     # unit and dimensions after the press


@dataclass(frozen=True)
class PressPlan:
    """The contents of a data set: presses of meshes {name: trimesh in mm} on a sensor at forces (N), on one or two fingers."""

    sensor: "Sensor"
    meshes: Mapping[str, trimesh.Trimesh]
    presses: int
    forces_n: Sequence[float]
    model: str
    seed: int
    fingers: int = 1

    def __post_init__(self) -> None:
        self.sensor.checked_forces(self.forces_n)
        self.sensor.spec.need_layers()
        self.sensor.spec.need_taxels("a data set of presses")
        need_whole_counts(self.sensor.spec, "a data set of presses")
        KINDS[self.sensor.spec.kind].press(self.model, self.sensor.spec.name)     # refuses an unknown model
        if self.presses < 1:
            raise InputError(f"A data set of {self.presses} presses is empty; give 1 or more.")
        if not self.meshes:
            raise InputError("A data set of no meshes is empty; give 1 object or more.")
        if self.fingers not in (1, 2):
            raise InputError(f"fingers {self.fingers}: an object is pressed by one finger or between two; give 1 or 2.")
        if self.seed < 0:
            raise InputError(f"seed {self.seed}: places are drawn from whole numbers that are not negative; give 0 or more.")

    @cached_property
    def settings(self) -> str:
        """Hash of all settings that determine the numbers."""
        shapes = {name: digest([mesh.vertices.tolist(), mesh.faces.tolist()]) for name, mesh in self.meshes.items()}
        return digest([_of_sensor(self.sensor), shapes, list(self.meshes), self.presses, list(self.forces_n),
                       self.model, self.seed, self.fingers, softtact.__version__])

    @cached_property
    def poses(self) -> np.ndarray:
        """(press, 6) in mm and degrees, as `Pose.from_values` takes them."""
        each = -(-self.presses // len(self.meshes))
        drawn = [draw_poses(mesh.triangles, count=each, footprint_mm=self.sensor.spec.footprint_mm,
                            seed=[self.seed, zlib.crc32(name.encode())]) for name, mesh in self.meshes.items()]
        return np.array(drawn).swapaxes(0, 1).reshape(-1, 6)[:self.presses]

    def mesh_of(self, number: int) -> trimesh.Trimesh:
        """The mesh of a press."""
        return list(self.meshes.values())[number % len(self.meshes)]


def _of_sensor(sensor):
    """What a sensor's presses depend on, as plain values: its file names materials, whose constants are in its laws."""
    laws = {name: [repr(law), law.parameters, law.bulk_modulus, law.stretch_window, repr(law.inelastic)]
            for name, law in sensor.laws.items()}
    scatter = sensor.scatter and [np.asarray(factors).tolist() for factors in sensor.scatter]
    return [sensor.spec.model_dump(mode="json"), laws, asdict(sensor.mesh), asdict(sensor.solver), scatter]


def behind(mesh: trimesh.Trimesh, pose: Pose) -> Pose:
    """The pose of an object in the frame of a second sensor that faces the first and touches its upper side."""
    turned = Pose(_BEHIND.apply(pose.translation_mm), _BEHIND * pose.rotation)
    return Pose(turned.translation_mm - [0.0, 0.0, turned.apply(mesh.vertices)[:, 2].min()], turned.rotation)


def write_press_data(path: str | Path, plan: PressPlan, *, form: str = "hdf5", workers: int | None = None,
                     label: str = "presses") -> int:
    """Write a data set, or continue an unfinished one; return the number of failed presses, which hold zeros and a status.

    form: hdf5, netcdf or lerobot. Finished blocks are in a folder beside `path` with the ending `.part` until the end.
    Raises InputError for an unknown form or ending, if another data set exists there, or if another run writes it; OutputError if
    there is no room on the disk.
    """
    check_name(Path(path), form)
    path, part = target_of(path), _part(path)
    _refuse_finished(path)
    with held(part, busy="another run writes this data set"):
        _refuse_finished(path)     # by a run that has ended since
        blocks = PressBlocks(part, plan.settings, plan.presses)
        for numbers in progress(blocks.missing(), label=f"{label}, in blocks of {BLOCK}" if label else ""):
            blocks.write(numbers, _arrays(plan, _pressed(plan, numbers, workers)))
        failed = _finish(part, path, form, plan, blocks)
        shutil.rmtree(part)
    return failed


def presses_left(path: str | Path, plan: PressPlan) -> int:
    """Number of presses that a data set still needs."""
    return sum(map(len, PressBlocks(_part(path), plan.settings, plan.presses).missing()))


def check_name(path: Path, form: str) -> None:
    """Refuse an unknown form, a name without the form's ending, or a form whose packages are not installed."""
    if form not in FORMATS:
        raise InputError(f"The format {form!r} is unknown; use one of {', '.join(FORMATS)}.")
    if form == "lerobot" and path.suffix:
        raise InputError(f"{path}: the format lerobot is written as a folder; give a name without an ending.")
    if path.suffix.lower() not in FORMATS[form]:
        raise InputError(f"{path}: the format {form} is written as {' or '.join(FORMATS[form])}; give a name with such an ending.")
    for package in ("pyarrow", "av", "matplotlib") if form == "lerobot" else ():
        require(package, path)


def _refuse_finished(path):
    if path.exists():
        raise InputError(f"{path}: there is already a finished data set; give another name.")


def _part(path):
    path = target_of(path)
    part = path.with_name(f"{path.name}.part")
    if part.is_file():
        raise InputError(f"{part}: this is an unfinished data set of an earlier version; give another name, or finish it "
                         "with that.")
    return part


def _pressed(plan, numbers, workers):
    """[[result or error of each finger]] of the presses `numbers`."""
    meshes = [plan.mesh_of(number) for number in numbers]
    poses = [[Pose.from_values(plan.poses[number])] for number in numbers]
    if plan.fingers == 2:
        poses = [[one[0], behind(mesh, one[0])] for mesh, one in zip(meshes, poses, strict=True)]
    both = [mesh for mesh in meshes for _ in range(plan.fingers)]
    results = plan.sensor.press_many(both, [pose for one in poses for pose in one],
                                     force_n=plan.forces_n, model=plan.model, workers=workers, failures="keep", label="")
    return [results[first:first + plan.fingers] for first in range(0, len(results), plan.fingers)]


def _arrays(plan: PressPlan, results: Sequence[Sequence[Any]]) -> dict[str, np.ndarray]:
    """The arrays of a block from the results of each press for each finger; a failed press has zeros."""
    count, spec = (len(results), len(plan.forces_n), plan.fingers), plan.sensor.spec
    taxels = spec.need_taxels("a data set of presses")
    arrays = {"deformation_map_mm": np.zeros((*count, *spec.map_shape), np.float32),
              "tactile_map": np.zeros((*count, taxels.rows, taxels.columns), np.uint16),
              "indentation_mm": np.zeros(count, np.float32), "within_validity": np.zeros(count, np.int8),
              "status": np.full(len(results), FAILED, np.int8)}
    for number, of_fingers in enumerate(results):
        if any(isinstance(one, SofttactError) for one in of_fingers):
            continue
        for name in ("deformation_map_mm", "indentation_mm", "within_validity"):
            arrays[name][number] = np.stack([getattr(one, name) for one in of_fingers], axis=1)
        arrays["tactile_map"][number] = whole_counts(np.stack([one.tactile_map for one in of_fingers], axis=1))
        arrays["status"][number] = DONE
    return arrays


def _finish(part, path, form, plan, blocks):
    """Write the data set of a form from all blocks, check it, and give it its name; return the number of failed presses."""
    failed = sum(int((arrays["status"] == FAILED).sum()) for _, arrays in blocks)
    whole = part / f"whole{path.suffix}"
    if form == "lerobot":
        if failed == plan.presses:
            raise InputError(f"{path}: all presses failed, so that there is no episode to write; take smaller forces or "
                             "other objects.")
        _write_lerobot(whole, plan, blocks)
    else:
        (_write_netcdf if form == "netcdf" else _write_hdf5)(whole, plan, blocks)
        _refuse_other_rows(whole, plan, blocks)
    try:
        for file in [whole, *whole.rglob("*")]:
            wait_for_disk(file)
        os.replace(whole, path)
        wait_for_disk(path.parent)
    except OSError as error:
        raise not_written(path, error) from None
    return failed


def _refuse_other_rows(whole, plan, blocks):
    """Read a written file back and compare it with all blocks."""
    try:
        with h5py.File(whole, "r") as file:
            same = all(len(file[name]) == plan.presses and file[name][part].tobytes() == values.tobytes()
                       for part, arrays in _rows(plan, blocks) for name, values in arrays.items())
    except (OSError, KeyError):
        same = False
    _refuse_unless(same, whole)


def _refuse_unless(same, whole):
    if not same:
        raise OutputError(f"{whole}: what was written is not what is read back; check the disk, and run again: finished presses "
                          "are kept.")


def _rows(plan, blocks):
    """(slice of the presses, {name: their values}) of each block."""
    for numbers, arrays in blocks:
        yield (slice(numbers[0], numbers[-1] + 1),
               arrays | {"pose": plan.poses[numbers], "object": numbers.astype(np.int32) % len(plan.meshes)})


def _write_lerobot(folder, plan, blocks):
    """Write a data set in LeRobot's format, without failed presses, and read it back."""
    largest = max(float(arrays["deformation_map_mm"].max()) for _, arrays in blocks)
    fingers = FINGERS[:plan.fingers]
    videos = [f"observation.images.deformation.{name}" for name in fingers]
    names = {f"observation.tactile.{name}": ["row", "column"] for name in fingers} | {
        "observation.force": ["force_n"], "observation.state": ["x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"]}

    def frames():
        first = 0
        for numbers, arrays in blocks:
            done = arrays["status"] == DONE
            if done.any():
                yield _as_frames(plan, numbers[done], {name: values[done] for name, values in arrays.items()}, first, largest)
            first += int(done.sum()) * len(plan.forces_n)

    shutil.rmtree(folder, ignore_errors=True)     # what an earlier run left unfinished
    write_lerobot(folder, frames, length=len(plan.forces_n), tasks=[f"press {name}" for name in plan.meshes], names=names,
                  videos=videos, robot=plan.sensor.spec.name)
    _refuse_unless(same_as(folder, frames(), videos), folder)
    facts = _facts(plan) | {"deformation_largest_mm": largest}
    (folder / "meta/softtact.json").write_text(json.dumps(facts, indent=4), encoding="utf-8")


def _as_frames(plan, done, arrays, first, largest_mm):
    """Frames of the presses `done`, one for each force, of which the first has the number `first`."""
    forces = len(plan.forces_n)
    index = first + np.arange(len(done) * forces)
    frame, rows = index % forces, {}
    for finger, name in enumerate(FINGERS[:plan.fingers]):
        of_finger = {kind: arrays[kind][:, :, finger].reshape(len(index), *arrays[kind].shape[3:])
                     for kind in ("tactile_map", "deformation_map_mm")}
        rows[f"observation.tactile.{name}"] = of_finger["tactile_map"].astype(np.float32)
        rows[f"observation.images.deformation.{name}"] = _pictures(of_finger["deformation_map_mm"], largest_mm)
    return rows | {"observation.force": np.tile(np.asarray(plan.forces_n, np.float32), len(done))[:, None],
                   "observation.state": np.repeat(plan.poses[done], forces, axis=0).astype(np.float32),
                   "episode_index": index // forces, "frame_index": frame, "timestamp": (frame / FPS).astype(np.float32),
                   "index": index, "task_index": np.repeat(done % len(plan.meshes), forces).astype(np.int64)}


def _pictures(maps_mm, largest_mm):
    """Deformation maps (n, y, x) in mm as pictures (n, height, width, 3) uint8: viridis from 0 to the largest."""
    from matplotlib import colormaps

    shade = colormaps["viridis"](np.clip(maps_mm / max(largest_mm, 1e-12), 0, 1), bytes=True)[..., :3]
    return shade.repeat(_PIXELS, axis=1).repeat(_PIXELS, axis=2)


def _facts(plan):
    return {"settings": plan.settings, "seed": plan.seed, "model": plan.model, "sensor": plan.sensor.spec.name,
            "objects": ",".join(plan.meshes), "source": "simulation, ideal readout", "softtact_version": softtact.__version__}


def _unit(name):
    return _OF_A_BLOCK[name][0] if name in _OF_A_BLOCK else "1"


def _write_hdf5(path, plan, blocks):
    with atomic_path(path) as temporary, new_hdf5(temporary) as file:
        for part, arrays in _rows(plan, blocks):
            for name, values in arrays.items():
                if name not in file:
                    file.create_dataset(name, (plan.presses, *values.shape[1:]), values.dtype).attrs["units"] = _unit(name)
                file[name][part] = values
        file.create_dataset("force_n", data=np.asarray(plan.forces_n, dtype=float)).attrs["units"] = "N"
        file.attrs.update(_facts(plan))


def _write_netcdf(path, plan, blocks):
    import xarray

    parts = [arrays for _, arrays in _rows(plan, blocks)]
    arrays = {name: (("press", *dims), np.concatenate([part[name] for part in parts]), {"units": units})
              for name, (units, *dims) in _OF_A_BLOCK.items()}
    arrays["force_n"] = (("force",), np.asarray(plan.forces_n, dtype=float), {"units": "N"})
    fingers = np.array(FINGERS[:plan.fingers], dtype=object)
    write_dataset(path, xarray.Dataset(arrays, coords={"finger": fingers}, attrs=_facts(plan)), seed=plan.seed,
                  settings=plan.settings)
