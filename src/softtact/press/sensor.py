"""The public face: a sensor, and a press of a rigid mesh on it.

    sensor = softtact.load_sensor("coro")
    result = sensor.press(mesh, force_n=[5, 20, 50], model="auto")
"""

import os
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from softtact.devices import find_device
from softtact.errors import ConvergenceError, InputError
from softtact.geometry.meshes import check_over_sensor, place
from softtact.materials.config import law_from_printed
from softtact.models.hyperelastic import newton
from softtact.models.hyperelastic.build import build_sensor_body
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.cache import cached_compliance, cached_foundation
from softtact.press.choice import TOLERANCE_MM, press_auto
from softtact.press.many import press_many, raise_first
from softtact.press.models import PRESSES
from softtact.press.validity import flag_buried
from softtact.sensors.specification import SensorSpec

MODELS = ("auto", *PRESSES)
PROJECT = Path(__file__).parents[3]


def load_sensor(name_or_yaml, *, materials=None):
    """The `Sensor` of a name (config/sensors/NAME.yaml) or of a YAML file.

    materials: {"dielectric": Law, "cover": Law} to replace the Mooney-Rivlin constants printed for its materials
    """
    path = _config_file("sensors", name_or_yaml)
    spec = SensorSpec.from_yaml(path)
    laws = dict(materials or {})
    for layer in ("dielectric", "cover"):
        if layer not in laws:
            laws[layer] = law_from_printed(_config_file("materials", getattr(spec, layer).material), "mooney_rivlin")
    return Sensor(spec, laws)


def _config_file(kind, name):
    if Path(name).suffix in (".yaml", ".yml"):
        return Path(name)
    for folder in (Path("config"), PROJECT / "config"):
        path = folder / kind / f"{name}.yaml"
        if path.exists():
            return path
    raise InputError(f"There is no config/{kind}/{name}.yaml; give one of the names there or the path of a YAML file.")


@dataclass
class Sensor:
    """A sensor with one law per layer; `mesh` sets the layered body's resolution, `solver` what counts as solved.

    device: where the hyperelastic model sums up its elements: `cpu`, `cuda`, or `auto`: a GPU where torch finds one
    prepared_models: {"elastic": Compliance, "foundation": FoundationCompliance}, what the fast models start from; else the
    user's cache
    """

    spec: SensorSpec
    laws: dict
    mesh: MeshSettings = MeshSettings()
    solver: newton.NewtonSettings = newton.NewtonSettings()
    prepared_models: dict = field(default_factory=dict)
    scatter: tuple | None = None
    attributes: dict = field(default_factory=dict)
    device: str = "cpu"

    def press(self, mesh, *, pose=None, force_n, model="auto", policy="paper", tolerance_mm=TOLERANCE_MM, label="press",
              threads=None, keep_body=False):
        """Press a mesh (trimesh, mm) through forces (N, one or an increasing list) and return a `PressResult`.

        pose: `Pose` of the mesh in the sensor frame; by default its bounding box is centred over the sensor, its lowest
        side down. model: elastic, foundation, hyperelastic, or auto: chosen by a policy, `paper` (complexity of the contact)
        or `error` (the cheapest model that is expected to be within `tolerance_mm` of the hyperelastic one; see `choice`).
        threads: by default one for each core.
        keep_body: let the result hold the deformed body at each force (`PressResult.pressed_body`), some 20 MB each; of the
        hyperelastic model, for the others have displacements of the map's plane alone.
        Raises ConvergenceError at a force that is not reached; its `result` holds the forces before.
        """
        if model not in MODELS:
            raise InputError(f"Model {model!r} is unknown; use one of {', '.join(MODELS)}.")
        forces = self.checked_forces(force_n)
        placed = place(mesh, pose=pose)
        check_over_sensor(placed, self.spec.footprint_mm)
        threads = threads or cores()
        # Dense products of some hundred rows would wait for each other on more threads, up to five times as long.
        press = PRESSES[model] if model != "auto" else partial(press_auto, policy=policy, tolerance_mm=tolerance_mm)
        try:
            with threadpool_limits(limits=threads if model == "elastic" else 1):
                result = press(self, placed, forces, label=label, threads=threads, keep_body=keep_body)
                return flag_buried(result, placed.bounds[1, 2])
        except ConvergenceError as error:
            error.result = error.result and flag_buried(error.result, placed.bounds[1, 2])
            raise

    def press_many(self, meshes, poses=None, *, force_n, model="auto", workers=None, device="auto", failures="raise",
                   label="presses", **options):
        """Press each of `meshes` in its pose, all through the same forces; a list of `PressResult`s in their order.

        meshes: one for each press, or a single one for all poses;  poses: a `Pose` or None (centred) for each press
        workers: processes, by default one for each core;  device: `cuda`, or `auto` where there is one, takes all presses of the
        elastic model to a GPU as one batch; the other models', and those on the `cpu`, go over processes
        failures: `raise` the first, after all are done, or `keep` each error in its press' place
        options: policy, tolerance_mm, as for `press`
        """
        meshes = list(meshes) if isinstance(meshes, (list, tuple)) else [meshes] * len(poses)
        poses = list(poses) if poses is not None else [None] * len(meshes)
        if len(meshes) != len(poses):
            raise InputError(f"There are {len(meshes)} meshes and {len(poses)} poses; give one pose for each mesh, or one mesh.")
        if failures not in ("raise", "keep"):
            raise InputError(f"failures={failures!r} is unknown; write 'raise' or 'keep'.")
        results = press_many(self, meshes, poses, self.checked_forces(force_n), model=model, workers=workers or cores(),
                             device=device, label=label, options=options)
        return raise_first(results) if failures == "raise" else results

    def prepared(self, model, threads=1):
        """What a fast model starts from: `Compliance` or `FoundationCompliance`, computed on first use."""
        if model not in self.prepared_models:
            self.prepared_models[model] = (cached_compliance(self.spec, threads=threads) if model == "elastic"
                                 else cached_foundation(self.spec, self.laws, threads=threads))
        return self.prepared_models[model]

    def body(self, *, threads=1, surface=None):
        """The `LayeredBody` that the hyperelastic model presses on."""
        device = find_device(self.device)
        body = build_sensor_body(self.spec, dielectric_law=self.laws["dielectric"], cover_law=self.laws["cover"],
                                 mesh=self.mesh, scatter=self.scatter, threads=threads, surface=surface)
        if device != "cpu":
            from softtact.fem.kernels_torch import DeviceKernels  # torch, which takes seconds to import

            body.sum_with(DeviceKernels(device))
        return body

    def checked_forces(self, force_n):
        """Forces (N) as an increasing array within the sensor's range; others are refused."""
        forces = np.atleast_1d(np.asarray(force_n, dtype=float))
        low, high = self.spec.force_range_n
        outside = forces[~((forces > low) & (forces <= high))]
        if len(outside):
            raise InputError(f"The force {outside[0]:g} N is out of the range of {self.spec.name}; "
                             f"give forces above {low:g} N and up to {high:g} N.")
        if (np.diff(forces) <= 0).any():
            raise InputError("The forces must increase; sort them and leave out doubles.")
        return forces


def cores():
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
