"""The sensor that a model of the study presses, and one press of it."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import ConvergenceError
from softtact.geometry.meshes import read_mesh
from softtact.materials.config import law_from_printed
from softtact.models.elastic.compliance import electrode_plane_compliance
from softtact.models.hyperelastic.mesh_settings import frustum_scatter, mesh_settings, newton_settings
from softtact.press.result import PressResult, wall_time_s
from softtact.press.sensor import Sensor, load_sensor
from softtact.progress import announce
from softtact.sensors.frusta import SensorSpec
from softtact.sensors.library import material_file

if TYPE_CHECKING:
    import xarray


def sensor_of(path: str | Path, model: Mapping[str, Any], *, young_mpa: float | None = None) -> Sensor:
    """The sensor of a file as a model has it.

    model: values of `config.Pressing`;  young_mpa: of the elastic layer where the model's is neither printed nor a number
    """
    spec = SensorSpec.from_yaml(path)
    if model["kind"] == "elastic":
        return _elastic(path, model, young_mpa or _stated(model, spec))
    laws = {layer: law_from_printed(material_file(material), model["law"], bulk_over_shear=model.get("bulk_over_shear"))
            for layer, material in spec.materials.items()}
    board = 0.0 if model["tips_bonded"] else model["friction"]
    spec = SensorSpec.from_dict({**spec.model_dump(mode="json"), "tips_bonded": model["tips_bonded"],
                                 "friction": {"object": model["friction"], "board": board}}, where=str(path))
    mesh = model["mesh"]
    return replace(load_sensor(path, materials=laws), spec=spec, mesh=mesh_settings(mesh), solver=newton_settings(mesh),
                   scatter=frustum_scatter(spec, mesh))


def _stated(model, spec):
    """The modulus (MPa) that a model states, or that of the sensor's file."""
    return spec.elastic_layer.young_mpa if model["young_mpa"] == "printed" else float(model["young_mpa"])


def _elastic(path, model, young_mpa):
    """A sensor whose elastic model has a modulus and gives the maps of a plane."""
    sensor = load_sensor(path)
    printed, spec = sensor.spec.elastic_layer, sensor.spec
    compliance = electrode_plane_compliance(spec) if model["plane"] == "electrodes" else sensor.prepared("elastic")
    spec = spec.model_copy(update={"elastic_layer": printed.model_copy(update={"young_mpa": young_mpa})})
    return replace(sensor, spec=spec, prepared_models={"elastic": compliance.stiffened(young_mpa / printed.young_mpa)})


def press_item(sensor: Sensor, model: Mapping[str, Any], mesh: str | Path, *, unit: str, forces_n: Sequence[float],
               label: str = "", threads: int = 1) -> "xarray.Dataset":
    """The data set of a press (as `PressResult.write` writes it) of a mesh file, centred over the sensor.

    A load step that is not reached is flagged, with those after it: their numbers are nan, `converged` and `within_validity` 0. A
    study of forty objects goes on without the last load step of one; a press without any fails.
    threads: of the solver; Snakemake runs as many jobs beside each other as there are cores
    """
    started = os.getloadavg()[0] / (os.cpu_count() or 1)
    try:
        result = sensor.press(read_mesh(mesh, unit=unit), force_n=forces_n, model=model["kind"], label=label, threads=threads)
    except ConvergenceError as error:
        if not isinstance(error.result, PressResult):
            raise
        announce(f"{label}: {error}")
        result = error.result
    data = _with_all_steps(result.to_dataset(), np.asarray(forces_n, dtype=float))
    return data.assign_attrs(load_per_core=started)


def _with_all_steps(data, forces):
    """A press' data set with a load step for each force (l,); those that it lacks are flagged."""
    missing = len(forces) - data.sizes["step"]
    if not missing:
        return data
    whole = data.drop_vars("validity_reason").pad(step=(0, missing))
    reasons = [*data["validity_reason"].values, *["the load step was not reached"] * missing]
    flags = {name: ("step", np.pad(data[name].values, (0, missing)), data[name].attrs) for name in ("converged", "within_validity")}
    whole = whole.assign_attrs(wall_time_s=np.pad(wall_time_s(data), (0, missing), constant_values=np.nan))
    return whole.assign(normal_force_n=("step", forces, data.normal_force_n.attrs),
                        validity_reason=("step", np.array(reasons, dtype=str), data.validity_reason.attrs), **flags)
