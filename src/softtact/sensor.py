"""The public face: a sensor, and a press of a rigid mesh on it.

    sensor = softtact.load_sensor("coro")
    result = sensor.press(mesh, force_n=[5, 20, 50], model="auto")
"""

import os
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.errors import ConvergenceError, InputError
from softtact.files import atomic_path, digest
from softtact.geometry.complexity import choose_model, score
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.sensor_spec import SensorSpec
from softtact.materials.config import law_from_printed
from softtact.mechanics import elastic, hyperelastic
from softtact.mechanics.layered_body import MeshSettings, build_sensor_body
from softtact.press_result import PressResult
from softtact.progress import announce, progress
from softtact.sensing.capacitance import ideal_counts

MODELS = ("auto", "elastic", "hyperelastic")
PROJECT = Path(__file__).parents[2]
ELASTIC_EDGE_MM = 0.75   # gives about 30,000 tetrahedra for the default sensor, as many as the paper's layer


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
    """A sensor with one law per layer; `mesh` sets the layered body's resolution, `solver` what counts as solved."""

    spec: SensorSpec
    laws: dict
    mesh: MeshSettings = MeshSettings()
    solver: hyperelastic.NewtonSettings = hyperelastic.NewtonSettings()
    compliance: elastic.Compliance | None = None
    scatter: tuple | None = None
    attributes: dict = field(default_factory=dict)

    def press(self, mesh, *, pose=None, force_n, model="auto", label="press", threads=None):
        """Press a mesh (trimesh, mm) through forces (N, one or an increasing list) and return a `PressResult`.

        pose: `Pose` of the mesh in the sensor frame; by default its bounding box is centred over the sensor, its lowest
        side down. model: elastic, hyperelastic, or auto (chosen by the complexity of the contact). threads: of the
        hyperelastic model, by default one for each core. Raises ConvergenceError at a force that is not reached; its
        `result` holds the forces before.
        """
        if model not in MODELS:
            raise InputError(f"Model {model!r} is unknown; use one of {', '.join(MODELS)}.")
        forces = self.checked_forces(force_n)
        placed = place(mesh, pose=pose)
        check_over_sensor(placed, self.spec.footprint_mm)
        if model == "auto":
            model = self.choose(placed)
        surface = HeightField(placed)
        # Hundreds of small dense products: on more threads they wait for each other, five times as long in all.
        with threadpool_limits(limits=1):
            if model == "elastic":
                return self._press_elastic(surface, forces, label)
            return self._press_hyperelastic(surface, forces, label, threads or _cores())

    def body(self, *, threads=1, surface=None):
        """The `LayeredBody` that the hyperelastic model presses on."""
        return build_sensor_body(self.spec, dielectric_law=self.laws["dielectric"], cover_law=self.laws["cover"],
                                 mesh=self.mesh, scatter=self.scatter, threads=threads, surface=surface)

    def choose(self, placed):
        """The model that the contact of a placed mesh asks for (PAPER section 3.3.1)."""
        counts = score(placed.triangles, footprint_mm=self.spec.footprint_mm, reach_mm=self.spec.thickness_mm)
        return choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)

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

    def _press_elastic(self, surface, forces, label):
        compliance = self.compliance or cached_compliance(self.spec)
        gap0, _ = surface(*compliance.points.T)
        if gap0.min() >= NO_CONTACT_MM:
            raise InputError("The object misses every free point of the sensor's surface; move it over the sensor.")
        times = []
        levels = _timed(elastic.press_elastic(compliance, gap0, forces), forces, label, times)
        maps = np.stack([compliance.sampling @ level.displacement for level in levels])
        touching = np.array([compliance.area[level.nodal_force > 0].sum() for level in levels])
        indentation = np.array([level.indentation for level in levels])
        valid = maps.max(axis=1) < 0.5 * self.spec.thickness_mm
        unknown = np.full(len(levels), np.nan)
        return self._result("elastic", "dense", maps, forces, np.array(times), indentation_mm=indentation,
                            contact_area_mm2=touching, within_validity=valid,
                            penetration_mm=[level.penetration for level in levels],
                            frustum_compression_mm=unknown, residual_n=unknown, outside_card=unknown,
                            iterations=[level.iterations for level in levels])

    def _press_hyperelastic(self, surface, forces, label, threads):
        body = self.body(threads=threads, surface=surface)
        grid = np.stack(np.meshgrid(self.spec.map_x_mm, self.spec.map_y_mm), axis=-1).reshape(-1, 2)
        sampling = body.slab.sampling(grid)
        announce(f"{label}: {body.bed.count} frusta, {len(forces)} force levels of the hyperelastic model, some seconds each")
        record, times = [], []
        levels = (record.append(self._read_level(body, sampling, level))
                  for level in hyperelastic.press_levels(body, surface, forces, settings=self.solver))
        try:
            _timed(levels, forces, label, times)
        except ConvergenceError as error:
            error.result = self._of_record(body, record, forces, times) if record else None
            raise
        finally:
            body.close()
        return self._of_record(body, record, forces, times)

    def _of_record(self, body, record, forces, times):
        maps, *numbers = zip(*record, strict=True)
        names = ("indentation_mm", "contact_area_mm2", "penetration_mm", "frustum_compression_mm", "residual_n", "outside_card",
                 "iterations")
        numbers = dict(zip(names, map(np.array, numbers), strict=True))
        # Above four fifths of its height a frustum's pocket is full, and contacts that the model leaves out begin.
        valid = numbers["frustum_compression_mm"] < 0.8 * self.spec.dielectric.frusta.height_mm
        return self._result("hyperelastic", body.solver.name, np.stack(maps), forces[:len(maps)], np.array(times),
                            within_validity=valid, **numbers)

    @staticmethod
    def _read_level(body, sampling, level):
        slab, bed = level.state.slab, level.state.bed
        return (-(sampling @ slab.displacement[:, 2]), level.state.indentation,
                body.slab.top.area_under_pressure(slab), level.penetration_mm,
                float(body.bed.compression(bed.displacement).max()), level.residual_n,
                body.share_outside_window(level.state), level.iterations)

    def _result(self, model, solver, maps, forces, times, **numbers):
        maps = maps.reshape(len(forces), *self.spec.map_shape)
        flags = {"converged": np.ones(len(forces), dtype=np.int8),
                 "within_validity": np.asarray(numbers.pop("within_validity"), dtype=np.int8)}
        return PressResult(deformation_map_mm=maps, tactile_map=ideal_counts(self.spec, maps), force_n=forces,
                           wall_time_s=times, x_mm=self.spec.map_x_mm, y_mm=self.spec.map_y_mm, model=model,
                           sensor=self.spec.name, solver=solver, attributes={**self._friction(model), **self.attributes}, **flags,
                           **{name: np.asarray(values) for name, values in numbers.items()})

    def _friction(self, model):
        """Attributes that state the friction of a result."""
        if model == "elastic":
            return {"friction": "none: the elastic model knows no friction"}
        friction = self.spec.friction
        return {"friction_object": friction.object, "friction_board": friction.board, "tips_held": int(self.spec.tips_held)}


def _cores():
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def _timed(levels, forces, label, times):
    """The levels as a list, and into `times` the seconds that each took; the solver's preparation counts to the first."""
    out, start = [], time.perf_counter()
    for level in progress(levels, label=label, total=len(forces)):
        now = time.perf_counter()
        out.append(level)
        times.append(now - start)
        start = now
    return out


def compute_compliance(spec, *, edge_length_mm=ELASTIC_EDGE_MM, mesh=None):
    """Surface compliance of the sensor's elastic layer; `mesh` (points, tetrahedra) or one made here."""
    points, tets = mesh or elastic.layer_mesh(spec.footprint_mm, spec.thickness_mm, edge_length_mm=edge_length_mm)
    layer = spec.elastic_layer
    return elastic.surface_compliance(points, tets, young_mpa=layer.young_mpa, poisson=layer.poisson,
                                      map_x_mm=spec.map_x_mm, map_y_mm=spec.map_y_mm)


def cached_compliance(spec):
    """The compliance from the user's cache (~/.cache/softtact), computed on first use and keyed by the sensor's values."""
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "softtact"
    path = cache / f"compliance-{digest([spec.model_dump(mode='json'), ELASTIC_EDGE_MM])}.npz"
    if not path.exists():
        announce(f"{spec.name}: computing the elastic layer's flexibility, once for this sensor (about ten seconds)")
        with atomic_path(path) as temporary:
            compute_compliance(spec).save(temporary)
    return elastic.Compliance.load(path)
