"""Data sets of random presses, written in blocks so that an interrupted run can continue: HDF5, NetCDF, or LeRobot's key names.

Press n uses object n modulo the number of objects. Its place and angle are drawn from the seed, the object's name and n only. All
presses have the same forces. With two fingers the object is also pressed from its opposite side, as in a grip.

Formats of a finished data set:
hdf5      arrays by name: (press, force, finger, ...)
netcdf    the same, labelled (xarray)
lerobot   a row for each press and force, in HDF5, with the key names of LeRobot's data sets (`observation.tactile.left`,
          `observation.force`, `episode_index`, `frame_index`, `timestamp`); an episode is a press with its forces. LeRobot
          stores such keys in Parquet files, which its tools create.
"""

import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import softtact
from softtact.errors import InputError, OutputError, SofttactError
from softtact.files import atomic_path, digest, write_dataset
from softtact.geometry.pose import Pose, draw_poses
from softtact.progress import progress

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_BEHIND = Rotation.from_euler("y", 180, degrees=True)
_BLOCK = 32     # presses written together
TO_DO, DONE, FAILED = 0, 1, 2
FORMATS = {"hdf5": (".h5", ".hdf5"), "netcdf": (".nc",), "lerobot": (".h5", ".hdf5")}
FINGERS = ("left", "right")
_FPS = 10.0     # of the timestamps: 0.1 s between two forces, assumed because a press is quasi-static
_DIMENSIONS = {"deformation_map_mm": ("press", "force", "finger", "y", "x"),
               "tactile_map": ("press", "force", "finger", "row", "column"), "indentation_mm": ("press", "force", "finger"),
               "within_validity": ("press", "force", "finger"), "status": ("press",), "force_n": ("force",),
               "pose": ("press", "six"), "object": ("press",)}


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
        if self.presses < 1:
            raise InputError(f"A data set of {self.presses} presses is empty; give 1 or more.")

    @cached_property
    def settings(self) -> str:
        """Hash of all settings that determine the numbers."""
        shapes = {name: digest([mesh.vertices.tolist(), mesh.faces.tolist()]) for name, mesh in self.meshes.items()}
        return digest([self.sensor.spec.model_dump(mode="json"), shapes, list(self.meshes), self.presses, list(self.forces_n),
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


def behind(mesh: trimesh.Trimesh, pose: Pose) -> Pose:
    """The pose of an object in the frame of a second sensor that faces the first and touches its upper side."""
    turned = Pose(_BEHIND.apply(pose.translation_mm), _BEHIND * pose.rotation)
    return Pose(turned.translation_mm - [0.0, 0.0, turned.apply(mesh.vertices)[:, 2].min()], turned.rotation)


def write_press_data(path: str | Path, plan: PressPlan, *, form: str = "hdf5", workers: int | None = None,
                     label: str = "presses") -> int:
    """Write a data set, or continue an unfinished one; return the number of failed presses, which hold zeros and a status.

    form: hdf5, netcdf or lerobot. The unfinished file lies beside `path` with the ending `.part`
    Raises InputError for an unknown form or ending, or if another data set exists there.
    """
    path = Path(path)
    check_name(path, form)
    if path.exists():
        raise InputError(f"{path}: there is already a finished data set; delete it, or give another name.")
    part = _part(path)
    with _opened(part, "a") as file:
        if "settings" in file.attrs:
            _refuse_other(part, file, plan)
        else:
            _begin(file, plan)
        _fill(file, plan, workers, label)
        failed = int((file["status"][:] == FAILED).sum())
    finish(part, path, form)
    return failed


def presses_left(path: str | Path, plan: PressPlan) -> int:
    """Number of presses that a data set still needs."""
    part = _part(Path(path))
    if not part.exists():
        return plan.presses
    with _opened(part, "r") as file:
        _refuse_other(part, file, plan)
        return int((file["status"][:] == TO_DO).sum())


def check_name(path: Path, form: str) -> None:
    """Refuse an unknown form, or a name without the form's ending."""
    if form not in FORMATS:
        raise InputError(f"The format {form!r} is unknown; use one of {', '.join(FORMATS)}.")
    if path.suffix.lower() not in FORMATS[form]:
        raise InputError(f"{path}: the format {form} is written as {' or '.join(FORMATS[form])}; give a name with such an ending.")


def _part(path):
    return path.with_name(f"{path.name}.part")


def _opened(path, mode):
    try:
        return h5py.File(path, mode, libver="latest")
    except OSError as error:
        reason = " ".join(str(error).split())[:120]
        if mode == "a" and not path.exists():
            raise OutputError(f"{path}: cannot be written ({reason}); make its folder, or room on the disk.") from None
        raise InputError(f"{path}: not readable as an unfinished data set ({reason}); delete it and start again.") from None


def _refuse_other(part, file, plan):
    if file.attrs.get("settings") != plan.settings:
        raise InputError(f"{part}: there is an unfinished data set of other objects or settings; delete it, or give another name.")


def _begin(file, plan):
    """Empty arrays of their final size."""
    spec, n, f, s = plan.sensor.spec, plan.presses, plan.fingers, len(plan.forces_n)
    taxels = spec.need_taxels("a data set of presses")
    shapes = {"deformation_map_mm": ((n, s, f, *spec.map_shape), "f4", "mm"),
              "tactile_map": ((n, s, f, taxels.rows, taxels.columns), "u2", "counts"),
              "indentation_mm": ((n, s, f), "f4", "mm"), "within_validity": ((n, s, f), "i1", "1"), "status": ((n,), "i1", "1")}
    for name, (shape, kind, units) in shapes.items():
        file.create_dataset(name, shape, kind, chunks=(min(n, _BLOCK), *shape[1:])).attrs["units"] = units
    file.create_dataset("force_n", data=np.asarray(plan.forces_n, dtype=float)).attrs["units"] = "N"
    file.create_dataset("pose", data=plan.poses).attrs["units"] = "mm, degrees"
    file.create_dataset("object", data=np.arange(n, dtype="i4") % len(plan.meshes)).attrs["units"] = "number in objects"
    facts = {"settings": plan.settings, "seed": plan.seed, "model": plan.model, "sensor": spec.name,
             "objects": ",".join(plan.meshes), "source": "simulation, ideal readout", "softtact_version": softtact.__version__}
    for name, value in facts.items():
        file.attrs[name] = value


def _fill(file, plan, workers, label):
    left = np.flatnonzero(file["status"][:] == TO_DO)
    blocks = [left[first:first + _BLOCK] for first in range(0, len(left), _BLOCK)]
    for block in progress(blocks, label=f"{label}, in blocks of {_BLOCK}"):
        results = _pressed(plan, block, workers)
        for number, of_fingers in zip(block, results, strict=True):
            _keep(file, int(number), of_fingers)
        file.flush()


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


def _keep(file: Any, number: int, results: Sequence[Any]) -> None:
    """Write the results of one press for each finger; a failed one keeps zeros."""
    if any(isinstance(one, SofttactError) for one in results):
        file["status"][number] = FAILED
        return
    for name in ("deformation_map_mm", "indentation_mm", "within_validity"):
        file[name][number] = np.stack([getattr(one, name) for one in results], axis=1)
    file["tactile_map"][number] = np.round(np.stack([one.tactile_map for one in results], axis=1)).astype(np.uint16)
    file["status"][number] = DONE


def finish(part: Path, path: Path, form: str) -> None:
    """Convert a complete file to the data set of a form, and delete the file."""
    if form == "hdf5":
        os.replace(part, path)
        return
    with h5py.File(part, "r") as file:
        {"netcdf": _as_netcdf, "lerobot": _as_lerobot}[form](file, path)
    part.unlink()


def _as_netcdf(file, path):
    import xarray

    arrays = {name: (dims, file[name][:], {"units": file[name].attrs["units"]}) for name, dims in _DIMENSIONS.items()}
    facts = {name: value.item() if isinstance(value, np.generic) else value for name, value in file.attrs.items()}
    fingers = np.array(FINGERS[:file["tactile_map"].shape[2]], dtype=object)
    write_dataset(path, xarray.Dataset(arrays, coords={"finger": fingers}, attrs=facts), seed=facts["seed"],
                  settings=facts["settings"])


def _as_lerobot(file, path):
    """Rows of the successful presses."""
    done = np.flatnonzero(file["status"][:] == 1)
    presses, forces = len(done), len(file["force_n"])
    taxels = file["tactile_map"][:][done]
    frame = np.tile(np.arange(forces), presses)
    columns = {f"observation.tactile.{name}": taxels[:, :, finger].reshape(presses * forces, *taxels.shape[3:])
               for finger, name in enumerate(FINGERS[:taxels.shape[2]])}
    columns |= {"observation.force": np.tile(file["force_n"][:], presses).astype(np.float32)[:, None],
                "observation.state": np.repeat(file["pose"][:][done], forces, axis=0).astype(np.float32),
                "episode_index": np.repeat(np.arange(presses), forces), "frame_index": frame,
                "timestamp": (frame / _FPS).astype(np.float32), "index": np.arange(presses * forces),
                "task_index": np.repeat(file["object"][:][done], forces).astype(np.int64)}
    units = {"observation.force": "N", "observation.state": "mm, degrees", "timestamp": "s"}
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as out:
        for name, values in columns.items():
            out.create_dataset(name, data=values)
            out[name].attrs["units"] = "counts" if "tactile" in name else units.get(name, "1")
        for name, value in file.attrs.items():
            out.attrs[name] = value
        out.attrs["fps"] = _FPS
