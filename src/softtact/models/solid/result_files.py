"""A solid's result as a labelled data set, and that in NetCDF or .npz files: the mesh as arrays, then what the steps gave."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh
from softtact.files import atomic_path, read_arrays, read_dataset, write_dataset

if TYPE_CHECKING:
    import xarray as xr

    from softtact.models.solid.result import SolidResult

KIND = "softtact solid result"
_XYZ, _RANGE = "xyz", "least_largest"
DIMENSIONS: dict[str, tuple[tuple[str, ...], str]] = {
    "displacement_mm": (("step", "node", _XYZ), "mm"), "frame_load": (("step", "frame", "load"), "N, N mm"),
    "frame_way_mm": (("step", "frame", _XYZ), "mm"), "contact_pressure_mpa": (("step", "pair", "node"), "MPa"),
    "volume_ratio": (("step", "node"), "1"), "von_mises_mpa": (("step", "node"), "MPa"), "penetration_mm": (("step",), "mm"),
    "residual_n": (("step",), "N"), "iterations": (("step",), "1"), "increments": (("step",), "1"),
    "volume_ratio_range": (("step", _RANGE), "1"), "stretch_range": (("step", _RANGE), "1"),
    "extrapolated_volume_fraction": (("step",), "1"), "work_mj": (("step",), "mJ"), "dissipated_mj": (("step",), "mJ"),
    "strain_energy_mj": (("step",), "mJ"), "wall_time_s": (("step",), "s"), "object_points_mm": (("object_node", _XYZ), "mm"),
    "object_triangles": (("object_facet", "object_corner"), "1"), "object_displacement_mm": (("step", "object_node", _XYZ), "mm"),
    "reading_points_mm": (("reading", _XYZ), "mm"), "reading_displacement_mm": (("step", "reading", _XYZ), "mm"),
    "reading_pressure_mpa": (("step", "reading"), "MPa"),
}     # {field of `SolidResult`: (dimensions, unit)}


def dataset_of(result: "SolidResult") -> "xr.Dataset":
    """The data set of a result."""
    import xarray as xr

    arrays: dict[str, Any] = {name: (dims, getattr(result, name), {"units": unit}) for name, (dims, unit) in DIMENSIONS.items()}
    arrays["node_mm"] = (("node", _XYZ), result.mesh.points, {"units": "mm"})
    for k, (region, kind, nodes) in enumerate(result.mesh.cells):
        arrays[f"cells_{k}"] = ((f"element_{k}", f"node_of_{kind}"), nodes, {"region": region, "kind": kind})
    facets = ((name, kind, nodes) for name, face in result.mesh.faces.items() for kind, nodes in face.items())
    for k, (name, kind, nodes) in enumerate(facets):
        arrays[f"facets_{k}"] = ((f"facet_{k}", f"node_of_{kind}"), nodes, {"face": name, "kind": kind})
    coordinates = {"step": np.arange(1, result.steps + 1), "frame": np.array(result.frames, dtype=str),
                   "pair": np.array(result.pairs, dtype=str), "load": ["fx", "fy", "fz", "mx", "my", "mz"], _XYZ: ["x", "y", "z"]}
    attributes = {"kind": KIND, "geometry": result.mesh.geometry, "thickness_mm": result.mesh.thickness_mm}
    return xr.Dataset(arrays, coordinates, result.attributes | attributes)


def facts_of(dataset: "xr.Dataset") -> dict[str, Any]:
    """What a data set says of where it comes from."""
    return {str(name): value for name, value in dataset.attrs.items() if name not in ("kind", "geometry", "thickness_mm")}


def mesh_of(dataset: "xr.Dataset") -> SolidMesh:
    """The mesh of a data set."""
    cells = [dataset[name] for name in dataset.data_vars if str(name).startswith("cells_")]
    faces: dict[str, dict[str, np.ndarray]] = {}
    for facets in (dataset[name] for name in dataset.data_vars if str(name).startswith("facets_")):
        faces.setdefault(facets.attrs["face"], {})[facets.attrs["kind"]] = facets.values
    return SolidMesh(dataset["node_mm"].values, tuple((own.attrs["region"], own.attrs["kind"], own.values) for own in cells), faces,
                     dataset.attrs["geometry"], float(dataset.attrs["thickness_mm"]))


def write(dataset: "xr.Dataset", path: str | Path) -> None:
    """Write a data set as .nc or .npz, whole or not at all."""
    writers = {".nc": _write_netcdf, ".npz": _write_npz}
    if (ending := Path(path).suffix.lower()) not in writers:
        raise InputError(f"{path}: a result is written as {' or '.join(writers)}; give a name with such an ending.")
    writers[ending](dataset, path)


def _write_netcdf(dataset, path):
    write_dataset(path, dataset, seed=None, settings=dict(dataset.attrs))


def _write_npz(dataset, path):
    layout = {"attributes": dataset.attrs, "arrays": {str(name): {"dims": list(array.dims), "attributes": array.attrs}
                                                      for name, array in dataset.variables.items()},
              "coordinates": [str(name) for name in dataset.coords]}
    arrays = {str(name): array.values for name, array in dataset.variables.items()}
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, layout=json.dumps(layout), **arrays)


def read(path: str | Path) -> "xr.Dataset":
    """The data set of a file. Raises InputError where it holds no solid's result."""
    dataset = _read_npz(path) if Path(path).suffix.lower() == ".npz" else read_dataset(path)
    missing = [name for name in (*DIMENSIONS, "node_mm") if name not in dataset.variables]
    if dataset.attrs.get("kind") != KIND or missing:
        raise InputError(f"{path}: it is no result of solids{f', it lacks {missing[0]}' if missing else ''}; give a file that "
                         "SolidResult.write wrote.")
    return dataset


def _read_npz(path):
    import xarray as xr

    with read_arrays(path) as data:
        if "layout" not in data:
            raise InputError(f"{path}: it holds no layout, so it is no result of solids; give a file that SolidResult.write wrote.")
        layout = json.loads(str(data["layout"]))
        arrays = {name: (own["dims"], data[name], own["attributes"]) for name, own in layout["arrays"].items()}
    coordinates = {name: arrays.pop(name) for name in layout["coordinates"]}
    return xr.Dataset(arrays, coordinates, layout["attributes"])
