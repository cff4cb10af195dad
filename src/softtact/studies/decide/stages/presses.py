"""Objects, the matched modulus, the presses of all models, and what the virtual sensor reads of the truths'."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import ConvergenceError
from softtact.files import atomic_path, read_dataset, read_json, write_dataset, write_json
from softtact.progress import announce
from softtact.studies.decide.pressing import press_item, sensor_of

if TYPE_CHECKING:
    import xarray

_STIFFEST = 10.0     # times the printed modulus, and its inverse: what is searched
_TOLERANCE = 0.005   # of the modulus


def draw_object(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write an object as STL, and what the paper's rule says of it in several meshes.

    outputs: mesh (STL, mm), facts (JSON: step_mm, and of each mesh its longest edge, the counts of points and the model)
    settings: object (values of `GeneratedObject`), edges_mm [one for each mesh; the first is written], footprint_mm, reach_mm,
    rule {total, overlap}
    """
    from softtact.geometry.complexity import choose_model, score
    from softtact.geometry.generated import object_of_values
    from softtact.geometry.meshes import place

    made, meshes = object_of_values(settings["object"]), []
    for number, edge in enumerate(settings["edges_mm"]):
        mesh = made.mesh(edge_length_mm=edge)
        if number == 0:
            with atomic_path(outputs["mesh"]) as temporary:
                mesh.export(temporary, file_type="stl")
        counts = score(place(mesh).triangles, footprint_mm=settings["footprint_mm"], reach_mm=settings["reach_mm"])
        four: dict[str, Any] = {name: int(getattr(counts, name)) for name in ("NPt", "CHt", "NPo", "CHo")}
        chosen = choose_model(**(four | settings["rule"]))
        meshes.append({"edge_mm": edge, **four, "model": chosen})
    write_json(outputs["facts"], {"name": made.name, "step_mm": made.step_mm, "meshes": meshes})


def match_stiffness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Find the modulus with which the elastic model's maps come nearest to another model's.

    inputs: presses (list), objects (list of meshes), sensor;  outputs: modulus (JSON: young_mpa, error_mm, printed_error_mm)
    settings: units (of the meshes)
    The error is the root mean square over all maps at their valid load steps; the modulus is the same for all.
    """
    from scipy.optimize import minimize_scalar

    model = {"kind": "elastic", "plane": "surface", "young_mpa": "printed"}
    sensor = sensor_of(inputs["sensor"], model)
    printed = sensor.spec.elastic_layer.young_mpa
    presses = [read_dataset(path) for path in inputs["presses"]]

    def error(log_factor):
        scaled = sensor_of(inputs["sensor"], model | {"young_mpa": printed * float(np.exp(log_factor))})
        squares = [square for path, unit, press in zip(inputs["objects"], settings["units"], presses, strict=True)
                   for square in _squares(scaled, model, path, unit, press)]
        announce(f"modulus {printed * np.exp(log_factor):.3f} MPa: {1e3 * np.sqrt(np.mean(squares)):.1f} um")
        return float(np.sqrt(np.mean(squares)))

    found = minimize_scalar(error, bounds=(-np.log(_STIFFEST), np.log(_STIFFEST)), method="bounded",
                            options={"xatol": _TOLERANCE})
    write_json(outputs["modulus"], {"young_mpa": float(printed * np.exp(found.x)), "error_mm": float(found.fun),
                                    "printed_mpa": float(printed), "printed_error_mm": error(0.0)})


def _squares(sensor, model, path, unit, press):
    """Mean squares (load steps,) in mm2 of the difference of a press' valid maps; of a modulus that does not bear it, of 1 mm."""
    valid = press.within_validity.values == 1
    if not valid.any():
        return np.empty(0)
    try:
        maps = press_item(sensor, model, path, unit=unit, forces_n=press.normal_force_n.values[valid]).deformation_map_mm.values
    except ConvergenceError:
        return np.ones(valid.sum())
    squares = ((maps - press.deformation_map_mm.values[valid])**2).mean(axis=(1, 2))
    return np.where(np.isnan(squares), 1.0, squares)


def press(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press one item with the hyperelastic model.

    inputs: object (mesh), sensor, materials;  outputs: press;  settings: name, model, item, unit, forces_n
    """
    data = press_item(sensor_of(inputs["sensor"], settings["model"]), settings["model"], inputs["object"], unit=settings["unit"],
                      forces_n=settings["forces_n"], label=f"{settings['name']}/{settings['item']}", threads=threads)
    _write(outputs["press"], data, settings["name"], settings["item"], settings)


def press_fast(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press all items with a fast model, in one job: its start takes longer than a press.

    inputs: objects (list), sensor, materials, and modulus (JSON of `match_stiffness`) where the model's is matched
    outputs: presses (list, in the items' order);  settings: name, model, items [{item, unit}, ...], forces_n
    """
    young = read_json(inputs["modulus"])["young_mpa"] if "modulus" in inputs else None
    sensor = sensor_of(inputs["sensor"], settings["model"], young_mpa=young)
    for entry, mesh, path in zip(settings["items"], inputs["objects"], outputs["presses"], strict=True):
        data = press_item(sensor, settings["model"], mesh, unit=entry["unit"], forces_n=settings["forces_n"],
                          label=f"{settings['name']}/{entry['item']}", threads=threads)
        _write(path, data, settings["name"], entry["item"], settings["model"])


def _write(path: Path, data: "xarray.Dataset", name: str, item: str, settings: Any) -> None:
    write_dataset(path, data.assign_attrs(model=name, item=item), seed=None, settings=settings)


def gather_maps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the maps of all models of all items into one file.

    inputs: presses_MODEL (lists, in the items' order);  outputs: maps (NetCDF);  settings: models, sets (of the items)
    """
    import xarray

    maps, valid, reached = [], [], []
    for model in settings["models"]:
        presses = [read_dataset(path) for path in inputs[f"presses_{model}"]]
        maps.append([press.deformation_map_mm.values.astype(np.float32) for press in presses])
        valid.append([press.within_validity.values.astype(np.int8) for press in presses])
        reached.append([press.converged.values.astype(np.int8) for press in presses])
    axes = ("model", "item", "force")
    data = xarray.Dataset(
        {"deformation_map_mm": ((*axes, "y", "x"), np.array(maps), {"units": "mm"}),
         "valid": (axes, np.array(valid)), "reached": (axes, np.array(reached))},
        coords={"model": np.array(settings["models"], dtype=object),
                "item": np.array([press.attrs["item"] for press in presses], dtype=object),
                "set": ("item", np.array(settings["sets"], dtype=object)),
                "force_n": ("force", presses[0].normal_force_n.values, {"units": "N"})})
    write_dataset(outputs["maps"], data, seed=None, settings=settings)


def read_truth(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read each press of a truth once by the virtual sensor, whose specimen is the same for all.

    inputs: maps (of `gather_maps`), sensor;  outputs: readings (NetCDF);  settings: truth, model, seed, virtual_sensor
    The counts of a load step that was not reached are nan.
    """
    import xarray

    from softtact.readout.virtual_sensor import VirtualSensorSettings, read_virtual_sensor
    from softtact.sensors.frusta import SensorSpec

    spec, choices = SensorSpec.from_yaml(inputs["sensor"]), VirtualSensorSettings.from_dict(settings["virtual_sensor"])
    maps = read_dataset(inputs["maps"]).sel(model=settings["model"])
    counts = np.full((*maps.reached.shape, spec.taxels.rows, spec.taxels.columns), np.nan)
    for number, item in enumerate(maps.item.values):
        reached = maps.reached.values[number] == 1
        if reached.any():
            counts[number, reached] = read_virtual_sensor(
                spec, maps.deformation_map_mm.values[number, reached].astype(float), force_n=maps.force_n.values[reached], trials=1,
                seed=settings["seed"], item=str(item), settings=choices)[0]
    data = xarray.Dataset({"tactile_map": (("item", "force", "row", "column"), counts, {"units": "counts"})},
                          coords={"item": maps.item.values, "force_n": ("force", maps.force_n.values, {"units": "N"})},
                          attrs={"source": "virtual sensor", "truth": settings["truth"], "model": settings["model"]})
    write_dataset(outputs["readings"], data, seed=settings["seed"], settings=settings)
