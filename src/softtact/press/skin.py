"""Presses on robot skins: the elastomer under a rigid object that comes straight down, and the counts of its taxels.

`elastic`: small strains with a secant modulus, as in the papers; `solid`: finite strains, by the solid model. Each force is pressed
from rest. A result holds the elastomer as its `solid`, and the reading `skin`: (step, taxel) in counts above rest.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.errors import ConvergenceError, InputError, MissError, require
from softtact.geometry.pose import Pose
from softtact.models.solid.result import SolidFields
from softtact.press.result import PressResult
from softtact.press.task import PressTask
from softtact.progress import Watch, announce
from softtact.readout.registry import labelled
from softtact.sensors.skin import SkinSpec

if TYPE_CHECKING:
    import xarray

    from softtact.press.sensor import Sensor
    from softtact.skin.analysis import Readings, Skin
    from softtact.skin.design import PreparedDesign
    from softtact.skin.loads import Load

_OBJECT = "object"


def load_skin(spec: SkinSpec, laws: dict[str, Any]) -> dict[str, Any]:
    """The fields of `Sensor` of a skin: its `Skin` as the prepared elastic model. Raises InputError for a faulty design."""
    require("skfem", spec.where)
    from softtact.skin.analysis import Skin

    if laws:
        raise InputError(f"{spec.name}, a sensor of kind skin: its elastomer is named in its file; leave the material "
                         f"{next(iter(laws))!r} out.")
    design = prepared_design(spec)
    module, elastomer = design.design.module, design.elastomer
    return {"spec": spec, "laws": {}, "prepared_models": {"elastic": Skin(
        design.layout, thickness_mm=module.thickness_mm, poisson=elastomer.poisson, permittivity=elastomer.permittivity_fe,
        mesh=design.design.mesh.sizes())}}


def prepared_design(spec: SkinSpec) -> "PreparedDesign":
    """The checked design of a skin. Raises InputError for its first fault."""
    from softtact.skin.design import check_design, prepare

    return prepare(check_design(spec.design, spec.where), spec.folder / "design.yaml")


def press_skin(sensor: "Sensor", task: PressTask, *, model: str) -> PressResult:
    """Press a rigid object straight down by forces; by default the middle of its bounding box is over that of the elastomer.

    Raises InputError for another motion, a soft object, one that misses the elastomer, and a first force beyond what the model
    bears; ConvergenceError for a later one, with the result of those before, and for a solution that is not found.
    """
    if task.soft or task.motion.forces_n is None:
        what = "a soft object" if task.soft else "this motion"
        raise InputError(f"{sensor.spec.name}, a sensor of kind skin: it is pressed by a rigid object straight down by forces, not "
                         f"by {what}; give a rigid mesh and force_n.")
    if lifts := [force for force in task.motion.forces_n if force <= 0]:
        raise InputError(f"{sensor.spec.name}: a load of fz {-lifts[0]:g} N does not press; give one below 0, or force_n.")
    placed = over_skin(sensor.prepared_models["elastic"], task.pressed, task.pose, sensor.spec.name)     # type: ignore[arg-type]
    forces, reached = np.array(task.motion.forces_n), task.control.reached
    found: list[tuple[Load, Readings]] = []

    def so_far() -> PressResult:
        steps = len(reached.times)
        return _result(sensor, model, forces[:steps], found[:steps], np.array(reached.times))

    reached.follow(map(found.append, _steps(sensor, task, placed, model)), len(forces), so_far)
    return so_far()


def _steps(sensor, task, placed, model):
    """Load and readings of each force."""
    from softtact.skin.analysis import analyse
    from softtact.skin.contact import contact_load, press_at_finite_strains

    skin, design = sensor.prepared_models["elastic"], prepared_design(sensor.spec)
    find, middle = contact_load if model == "elastic" else press_at_finite_strains, placed.bounds.mean(axis=0)
    watch = Watch(limit_s=task.control.time_limit_s)
    for number, force in enumerate(task.motion.forces_n):
        where = f"{sensor.spec.name} at {force:g} N"
        watch.report(where)
        if task.control.label:
            announce(f"{task.control.label}: contact and field of the skin at {force:g} N, {model} model")
        try:
            load = find(skin, placed, (middle[0], middle[1]), force_n=force, elastomer=design.elastomer, name=_OBJECT)
            readings = analyse(skin, [load], elastomer=design.elastomer, converter=design.converter)
        except InputError as error:
            raise (ConvergenceError if number else InputError)(f"{where}: {error}") from None
        except ConvergenceError as error:
            raise ConvergenceError(f"{where}: {error}") from None
        yield load, readings


def over_skin(skin: "Skin", mesh: trimesh.Trimesh, pose: Pose | None, name: str) -> trimesh.Trimesh:
    """The object in its pose, at first touch of the upper side. Raises InputError where it misses the elastomer."""
    placed = mesh.copy()
    if pose is None:
        placed.apply_translation(np.append(skin.layout.outline_mm.mean(axis=0), 0.0) - mesh.bounds.mean(axis=0))
    else:
        placed.vertices = pose.apply(mesh.vertices)
    height, _ = HeightField(placed)(*skin.layer.mesh.nodes_mm[skin.layer.mesh.top, :2].T)
    if not (height < NO_CONTACT_MM).any():
        (x0, y0, _), (x1, y1, _) = placed.bounds
        if skin.layout.inside(placed.bounds.mean(axis=0)[None, :2], margin_mm=0.0)[0]:
            raise InputError(f"The object lies between the points of the mesh of {name}: it is {x1 - x0:.4g} x {y1 - y0:.4g} mm; "
                             "correct its unit, or give a smaller mesh.spacing_mm in the sensor's file.")
        raise MissError(f"The object misses the skin {name}: it spans x {x0:.4g} to {x1:.4g}, y {y0:.4g} to {y1:.4g} mm, beside "
                         "the elastomer; correct its pose.")
    placed.apply_translation([0.0, 0.0, skin.thickness_mm - height.min()])
    return placed


def _result(sensor: "Sensor", model: str, force: np.ndarray, found: "list[tuple[Load, Readings]]",
            seconds: np.ndarray) -> PressResult:
    """The result of forces (step,) in N as loads, each with its readings."""
    from softtact.skin.contact import solid_layer

    skin, steps, (loads, readings) = sensor.prepared_models["elastic"], len(found), zip(*found, strict=True)
    mesh = solid_layer(skin.layer.mesh)
    down = np.array([load.indentation_mm for load in loads])
    area = np.array([load.total_n / load.pressure_mpa for load in loads])
    least = skin.least_points * skin.layout.area_mm2 / len(skin.layer.mesh.top)
    few = [f"the contact of {one:.2g} mm2 has less than {skin.least_points} points of the elastomer's mesh: depth and counts are "
           "coarse; give a smaller mesh.spacing_mm in the sensor's file" if one < least else "" for one in area]
    reasons = np.array(["; ".join(filter(None, [*one.remarks, reason])) for one, reason in zip(readings, few, strict=True)])
    frame_load, way = np.full((steps, 1, 6), np.nan), np.zeros((steps, 1, 3))
    frame_load[:, 0, :2], frame_load[:, 0, 2], way[:, 0, 2] = 0.0, -force, -down
    moved = np.array([one.layer_mm[0] for one in readings])
    solid = SolidFields.of_displacement(mesh, moved, frames=(_OBJECT,), pairs=("skin on object",), frame_load=frame_load,
                                        frame_way_mm=way, contact_pressure_mpa=_pressure(skin, mesh, loads)[:, None])
    unknown, one = np.full(steps, np.nan), np.ones(steps, dtype=int)
    return PressResult(
        model=model, sensor=sensor.spec.name, solver="direct", normal_force_n=force, indentation_mm=down,
        contact_area_mm2=area, penetration_mm=np.zeros(steps),
        frustum_compression_mm=unknown, residual_n=unknown, iterations=one,
        extrapolated_volume_fraction=np.array([load.beyond_tests for load in loads]),
        converged=one.astype(np.int8), within_validity=(reasons == "").astype(np.int8), validity_reason=reasons,
        wall_time_s=seconds, readings={"skin": _reading(skin, np.concatenate([one.counts for one in readings]))},
        attributes=sensor.attributes | {"thickness_mm": skin.thickness_mm}, solid=solid)


def _pressure(skin, mesh, loads):
    """Contact pressure (step, node) in MPa on the upper side, from the forces on the nodes nearest to their points."""
    from scipy.spatial import cKDTree

    top = skin.layer.mesh.top
    nearest, area = cKDTree(mesh.points[top, :2]), skin.layout.area_mm2 / len(top)
    pressure = np.full((len(loads), len(mesh.points)), np.nan)
    for row, load in zip(pressure, loads, strict=True):
        row[top] = np.bincount(nearest.query(load.points_mm)[1], load.force_n, len(top)) / area
    return pressure


def _reading(skin: "Skin", counts: np.ndarray) -> "xarray.DataArray":
    """Counts (step, taxel) with the taxels' places, and the corners of their modules as an attribute."""
    layout = skin.layout
    places = {f"{axis}_mm": ("taxel", column, {"units": "mm"}) for axis, column in zip("xy", layout.centres_mm.T, strict=True)}
    reading = labelled(counts, ("step", "taxel"), units="counts", coordinates=places | {"module": ("taxel", layout.module)})
    return reading.assign_attrs(modules_mm=layout.corners_mm.ravel(), radius_mm=layout.radius_mm)
