"""The forms that a finished data set of presses is kept in.

hdf5      arrays by name: (press, force, finger, ...)
netcdf    the same, labelled (xarray)
lerobot   a row for each press and force, in HDF5, with the key names of LeRobot's data sets (`observation.tactile.left`,
          `observation.force`, `episode_index`, `frame_index`, `timestamp`); an episode is a press through its forces. LeRobot
          itself keeps such keys in Parquet files; its own tools make those.
"""

import os
from pathlib import Path

import h5py
import numpy as np

from softtact.files import atomic_path, write_dataset

FORMATS = {"hdf5": (".h5", ".hdf5"), "netcdf": (".nc",), "lerobot": (".h5", ".hdf5")}
FINGERS = ("left", "right")
_FPS = 10.0     # of the timestamps: a tenth of a second between two forces; a press has no time of its own
_DIMENSIONS = {"deformation_map_mm": ("press", "force", "finger", "y", "x"),
               "tactile_map": ("press", "force", "finger", "row", "column"), "indentation_mm": ("press", "force", "finger"),
               "within_validity": ("press", "force", "finger"), "status": ("press",), "force_n": ("force",),
               "pose": ("press", "six"), "object": ("press",)}


def finish(part: Path, path: Path, form: str) -> None:
    """Turn a filled file into the data set of a form; the unfinished one goes away."""
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
    """Rows of the presses that were done."""
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
