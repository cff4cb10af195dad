"""Presses by the solid model: sensor and object as solids of finite strain that meet surface to surface.

A sensor of kind solid is pressed from any side. The layers of a sensor of layers are meshed as a solid, and its frusta are springs
(`press.solid_pad`). The object is rigid, or a `SoftObject` whose rear a rigid holder carries.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surface_places import places
from softtact.contact.surfaces import Surface, quadrature_points
from softtact.errors import InputError, MissError
from softtact.fem.files.solids import read_mesh_file, with_named_faces
from softtact.fem.solid_mesh import SolidMesh, fine_triangles
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose
from softtact.materials.laws.base import Law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.newton import SolidSettings
from softtact.models.solid.path import SolidLoadStep, SolidPath, times_of
from softtact.models.solid.result import gathered
from softtact.press.creep import refuse_creep
from softtact.press.making import layered_surface
from softtact.press.objects import OBJECT, PlacedObject, SoftObject, distance_to_touch, first_direction
from softtact.press.reached import Reached
from softtact.press.result import PressResult
from softtact.press.solid_pad import SolidPad
from softtact.press.task import PressTask, RunControl
from softtact.press.validity import flag_buried, flag_overloaded
from softtact.progress import Watch, announce
from softtact.readout.registry import Samples, SurfaceMotion, readings_of
from softtact.sensors.solid import SolidSpec

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_PENALTY = 20.0       # times E / h of the softer surface
_REACH = 2.0          # times the length of a facet: the largest gap that the contact search covers


# --- sensors of layers ---


_SMOOTH = SolidSettings()
# Contact points at an edge between two facets of a rigid mesh alternate between these, which leaves up to 1e-5 of the load
# unbalanced (a ball on coro, 0.5 mm deep), far below the error of the mesh.
_ON_FACETS = SolidSettings(relative_residual=2e-5)


def press_pad(sensor: "Sensor", task: PressTask) -> PressResult:
    """Press a soft or a rigid object on layers through a motion; its steps by force load the object, or its holder.

    Raises InputError where the object misses the sensor, ConvergenceError where a step is not reached.
    """
    control = task.control
    refuse_creep(sensor.spec, task.motion)
    pad = SolidPad(sensor)
    if isinstance(task.pressed, SoftObject):
        placed = task.pressed.placed(task.pose, pad.height_mm, pad.shell)
        body = pad.with_object(placed, task.pressed, threads=control.threads)
    else:
        rigid = place(task.pressed, pose=task.pose)
        check_over_sensor(rigid, sensor.spec.footprint_mm)
        body = pad.with_rigid(rigid, threads=control.threads)
        control.reached.finish = partial(_finished, sensor, rigid, task)
    gather = partial(_on_pad, pad, body, None if task.soft else rigid, control)
    return control.reached.finish(run(body, OBJECT, task.motion, gather, control, _SMOOTH if task.soft else _ON_FACETS))


def _finished(sensor, rigid, task, result):
    """A result with flags at steps that bury a rigid object or overload the sensor."""
    touch = HeightField(rigid).first_touch_mm(sensor.spec.map_x_mm, sensor.spec.map_y_mm)
    return flag_overloaded(flag_buried(result, float(rigid.bounds[1, 2]) - touch), sensor.spec.force_range_n[1])


def _on_pad(pad, body, rigid, control, steps):
    """The result of load steps, in the sensor's frame, with solids and the object (None: a soft one) where they are kept."""
    down = np.array([0.0, 0.0, pad.height_mm])
    result = pad.result(body, steps, keep_body=control.keep_body)
    placed = None if rigid is None else _placed_on_pad(pad, body, rigid, steps)
    if pad.sensor.spec.readouts:      # the default, taxels, needs no pressure
        result = replace(result, readings=_readings_on_pad(pad, body, result, steps, placed))
    if control.keep_body:
        solid = gathered(body, steps)
        result = replace(result, solid=replace(solid, mesh=solid.mesh.moved(lambda x: x - down),
                                               object_points_mm=solid.object_points_mm - down))
    return replace(result, placed_object=placed) if control.keep_object else result


def _placed_on_pad(pad, body, rigid, steps):
    """A rigid object and its place at each load step, in the sensor's frame."""
    poses, down = [step.state.poses[0] for step in steps], np.array([0.0, 0.0, pad.height_mm])
    lowered = np.array([0.0, 0.0, body.points[body.surface_nodes(OBJECT)][..., 2].min() - pad.height_mm - rigid.bounds[0, 2]])
    return PlacedObject(
        points_mm=np.asarray(rigid.vertices, dtype=float), triangles=np.asarray(rigid.faces, dtype=np.int64),
        way_mm=np.array([pose.translation for pose in poses]) + lowered, turn=np.array([pose.rotation for pose in poses]),
        about_mm=body.frames[0].point - down - lowered)


def _readings_on_pad(pad, body, result, steps, placed):
    """The readings, with the contact pressure and a rigid object."""
    down = np.array([0.0, 0.0, pad.height_mm])
    contacts = [(step.state.histories[0].points, step.state.contacts[0]) for step in steps]
    pressure = [Samples(places(points, body.points) - down, points.weight, state.pressure) for points, state in contacts]
    surface = layered_surface(pad.sensor.spec, result.deformation_map_mm, result.displacement_mm, pressure)
    return readings_of(pad.sensor.readouts, surface if placed is None else replace(surface, object=placed))


# --- sensors of kind solid ---


def load_solid(spec: SolidSpec, laws: dict[str, Law]) -> tuple[SolidMesh, dict[str, Law]]:
    """The mesh and the laws by region of a sensor of kind solid; `laws`: {region: Law} in place of those of its file.

    Raises InputError for a mesh that does not exist or is not spatial, a region without a law, a face that does not exist or is
    empty.
    """
    mesh = with_named_faces(read_mesh_file(spec.mesh_path, unit=spec.mesh.unit), spec.faces)
    if mesh.geometry != "solid":
        raise InputError(f"the mesh {spec.mesh.file} is of the geometry {mesh.geometry!r}, and objects are spatial; give a spatial "
                         "mesh.")
    stated = [*spec.regions, *laws]
    if strange := [name for name in stated if name not in mesh.regions]:
        raise InputError(f"there is no region {strange[0]!r} in {spec.mesh.file}; its regions are {', '.join(mesh.regions)}.")
    if without := [name for name in mesh.regions if name not in stated]:
        raise InputError(f"the region {without[0]!r} of {spec.mesh.file} has no law; name one under 'regions'.")
    for face in (*spec.held, spec.contact.face):
        mesh.face(face)
    return mesh, {name: laws.get(name) or spec.law_of(name) for name in mesh.regions}


def press_body(sensor: "Sensor", task: PressTask) -> PressResult:
    """Press a rigid or a soft object on a sensor of kind solid.

    By default the middle of the object's bounding box is at that of the contact's face. The object is moved along the first step of
    the motion to first touch, from where displacements count. It turns about the middle of its bounding box.
    Raises InputError where it misses the contact's face, ConvergenceError where a step is not reached.
    """
    body = body_of(sensor, task.pressed, task.pose, task.motion, threads=task.control.threads)
    return run(body, OBJECT, task.motion, partial(_on_body, sensor, body), task.control)


def body_of(sensor: "Sensor", pressed: "trimesh.Trimesh | SoftObject", pose: Any, motion: Motion, *, threads: int = 1) -> SolidBody:
    """A sensor of kind solid and the object (mm) at first touch, as a `SolidBody` with the frame `object` and one pair."""
    pose, direction = Pose.of(pose), first_direction(motion)
    settings: dict[str, Any] = {"held": sensor.spec.held, "threads": threads, "device": sensor.device}
    if isinstance(pressed, SoftObject):
        points = _placed(sensor, pressed.mesh.points, pose)
        points = points + _to_touch(sensor, fine_triangles(pressed.mesh.boundary, points), direction)
        placed = pressed.with_faces(points, direction)
        mesh = sensor.elements.joined(placed, prefix="object ")      # type: ignore[union-attr]
        body = SolidBody(mesh, sensor.laws | {f"object {placed.regions[0]}": pressed.law}, **settings,
                         carried={OBJECT: (_middle(points), ["object held"], "xyz")})
        body.add(_pair(sensor, body, Surface.of(mesh.face("object pressed")), soft=pressed))
        return body
    triangles = _placed(sensor, np.asarray(pressed.vertices), pose)[pressed.faces]
    triangles = triangles + _to_touch(sensor, triangles, direction)
    body = SolidBody(sensor.elements, sensor.laws, **settings, rigid={OBJECT: (_middle(triangles.reshape(-1, 3)), triangles)})  # type: ignore[arg-type, dict-item]
    body.add(_pair(sensor, body, Surface.of({"triangle": body.surface_nodes(OBJECT)})))
    return body


def _middle(points: np.ndarray) -> np.ndarray:
    """Middle of the bounding box of points (n, 3)."""
    middle: np.ndarray = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return middle


def _placed(sensor: "Sensor", points: np.ndarray, pose: Pose | None) -> np.ndarray:
    """An object's points (n, 3) in its pose, or with the middle of their bounding box at that of the contact's face."""
    if pose is not None:
        return pose.apply(points)
    mesh = sensor.elements
    return points + (_middle(mesh.points[mesh.face_nodes(sensor.spec.contact.face)]) - _middle(points))  # type: ignore[union-attr]


def _to_touch(sensor: "Sensor", triangles: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The displacement (3,) in mm after which triangles (t, 3, 3) first touch the contact's face."""
    spec, mesh = sensor.spec, sensor.elements
    distance = distance_to_touch(triangles, fine_triangles(mesh.face(spec.contact.face), mesh.points), direction)  # type: ignore[union-attr]
    if not np.isfinite(distance):
        (x0, y0, z0), (x1, y1, z1) = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        raise MissError(f"The object misses the face {spec.contact.face!r} of {spec.name}: it spans x {x0:.4g} to "
                         f"{x1:.4g}, y {y0:.4g} to {y1:.4g}, z {z0:.4g} to {z1:.4g} mm, and moving along ({direction[0]:.3g}, "
                         f"{direction[1]:.3g}, {direction[2]:.3g}) does not meet it; correct its pose or its motion.")
    return distance * direction


def _pair(sensor: "Sensor", body: SolidBody, other: Surface, *, soft: SoftObject | None = None) -> ContactPair:
    """The contact's face against the object's surface; with a soft object by segments of both surfaces."""
    spec = sensor.spec
    face = Surface.of(sensor.elements.face(spec.contact.face))      # type: ignore[union-attr]
    size = face.size_mm(body.points) if soft is None else other.size_mm(body.points)
    moduli = [3 * law.mu0 for law in sensor.laws.values()] + ([3 * soft.law.mu0] if soft else [])
    friction = max(spec.contact.friction, soft.friction if soft else 0.0)
    return ContactPair(face, other, stiffness=_PENALTY * min(moduli) / size, reach_mm=_REACH * size, friction=friction,
                       segments=soft is not None, rigid=soft is None)


def _on_body(sensor, body, steps):
    """The result of load steps on a sensor of kind solid."""
    surface = surface_of(sensor, [step.state.displacement for step in steps],
                         [(body.pairs[0], step.state.histories[0], step.state.contacts[0]) for step in steps])
    return result_of_steps(body, steps, sensor=sensor.spec.name, readings=readings_of(sensor.readouts, surface),
                           attributes=sensor.attributes)


def surface_of(sensor: "Sensor", displacements: list[np.ndarray], contacts: list[tuple] | None = None) -> SurfaceMotion:
    """Motion of a solid sensor's surface, from displacements (n, 3) of the nodes and (pair, history, state) of the contact.

    contacts: none where nothing touches it
    """
    mesh = sensor.elements

    def face_of(name):
        return Surface.of(mesh.face(name or sensor.spec.contact.face))

    def displacement(name):
        points = quadrature_points(face_of(name), mesh.points)
        return [Samples(places(points, mesh.points), points.weight, places(points, moved)) for moved in displacements]

    def of_contact(value):
        def samples(name):
            if contacts is None or not np.isin(face_of(name).used, contacts[0][0].surface.used).all():
                return None
            return [Samples(places(history.points, mesh.points), history.points.weight, value(state))
                    for _, history, state in contacts]

        return samples

    return SurfaceMotion(spec=sensor.spec, steps=len(displacements), displacement=displacement,
                         pressure=of_contact(lambda state: state.pressure), gap=of_contact(lambda state: state.projection.gap))


# --- any solids ---


def solid_result(path: SolidPath) -> PressResult:
    """Solve all steps of a path of any body.

    Raises ConvergenceError that names the step that was not reached; its `result` holds the steps before, None where there is none.
    """
    reached = Reached()
    with reached.kept():
        steps: list[SolidLoadStep] = []
        reached.follow(map(steps.append, path.run()), path.steps, lambda: result_of_steps(path.body, steps[:len(reached.times)]))
    return result_of_steps(path.body, steps)


def run(body: SolidBody, frame: str, motion: Motion, gather: Callable[[list[SolidLoadStep]], PressResult],
        control: RunControl, settings: SolidSettings = _SMOOTH) -> PressResult:
    """The result that `gather` makes of the load steps of a body with one moving frame."""
    def report(text: str) -> None:
        if control.label:
            announce(f"{control.label}: {text}")

    count, steps, reached = len(motion.steps), list[SolidLoadStep](), control.reached

    def announced() -> Iterator[None]:
        for step in SolidPath(body, {frame: motion}, settings=settings, tell=report).run():
            steps.append(step)
            force = float(np.linalg.norm(step.loads[0, :3]))
            report(f"step {len(steps)} of {count}, {force:.4g} N, {step.iterations} iterations, {step.wall_time_s:.0f} s")
            yield

    body.watch = Watch(control.label, limit_s=control.time_limit_s)
    report(f"{len(body.free)} unknowns, {count} load steps of the solid model")
    try:
        reached.follow(announced(), count, lambda: gather(steps[:len(reached.times)]))
    finally:
        body.watch.end()
    return gather(steps)


def result_of_steps(body: SolidBody, steps: list[SolidLoadStep], *, sensor: str = "", readings: dict[str, Any] | None = None,
                    attributes: dict[str, Any] | None = None) -> PressResult:
    """The `PressResult` of load steps of any body; forces are those of its first frame, along -z where it presses."""
    fields = gathered(body, steps)
    frame = body.frames[0] if body.frames else None

    def each(value):
        return np.array([value(step) for step in steps])

    def torque(step):
        point = frame.point + step.state.poses[0].translation     # torque about the origin of the mesh's frame
        return step.loads[0, 3:] + np.cross(point, step.loads[0, :3])

    force = fields.frame_load[:, 0, :3] if frame else np.zeros((len(steps), 3))
    areas = [[float(history.points.weight[contact.pressure > 0].sum()) for history, contact in
              zip(step.state.histories[:1], step.state.contacts[:1], strict=True)] for step in steps]
    return PressResult(
        model="solid", sensor=sensor, solver=body.solver.name, normal_force_n=-force[:, 2], force_n=force,
        torque_nmm=each(torque) if frame else np.zeros((len(steps), 3)),
        indentation_mm=-fields.frame_way_mm[:, 0, 2] if frame else np.full(len(steps), np.nan),
        contact_area_mm2=np.array(areas).sum(axis=1), penetration_mm=each(lambda step: step.penetration_mm),
        frustum_compression_mm=np.full(len(steps), np.nan), residual_n=each(lambda step: step.residual_n),
        extrapolated_volume_fraction=each(lambda step: step.extrapolated_volume_fraction),
        iterations=each(lambda step: step.iterations), converged=np.ones(len(steps), dtype=np.int8),
        within_validity=np.ones(len(steps), dtype=np.int8), wall_time_s=each(lambda step: step.wall_time_s),
        time_s=times_of(steps), readings=readings or {}, attributes=attributes or {}, solid=fields)
