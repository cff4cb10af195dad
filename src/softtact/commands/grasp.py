"""`softtact grasp`: a robot grasps an object between two sensors; maps and counts of both at the events."""

import argparse
import hashlib
from pathlib import Path

import softtact
from softtact.commands.common import (
    MESH_FILE,
    add_command,
    add_repair,
    add_unit,
    check_count,
    check_forces,
    check_pictures,
    read_object,
    sensor_spec,
    show,
)
from softtact.errors import InputError
from softtact.outputs import check_output_folder

EXAMPLES = """
  softtact grasp part.stl --unit mm --force 20 --out results/grasp
  softtact grasp part.stl --unit mm --force 20 --x 2 --y -5 --angle 30 --model elastic --out results/turned
  softtact grasp part.stl --unit mm --force 50 --model elastic --video --out results/grasp
  softtact grasp --replay results/grasp/events.nc --out results/replay     # the same maps, without the robot
"""
_OF_GRASP = {"unit": None, "force": None, "x": 0.0, "y": 0.0, "angle": 0.0, "mass": None, "scene": None, "lift": True,
             "model": "auto", "policy": "error", "tolerance": 0.01, "sensor": "coro",
             "shear": False, "repair": True}     # read from the file in a replay


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "grasp", _grasp, "Grasp an object with a UR10 and a 2F-85 gripper: maps of both sensors.",
                          EXAMPLES)
    command.add_argument("mesh", metavar="OBJECT", type=Path, nargs="?",
                         help=f"{MESH_FILE}; its z axis lies along the closing of the fingers")
    add_unit(command)
    add_repair(command)
    command.add_argument("--force", type=float, metavar="N", help="of each pad on the object, in N")
    for name, meaning in (("x", "along the sensor's short side, in mm"), ("y", "along its long side, towards the palm, in mm")):
        command.add_argument(f"--{name}", type=float, default=0.0, metavar="MM",
                             help=f"where the middle of the object is {meaning} (default: 0)")
    command.add_argument("--angle", type=float, default=0.0, metavar="DEG",
                         help="how far the object is turned about the closing direction (default: 0)")
    command.add_argument("--mass", type=float, metavar="KG", help="of the object (default: its volume times the scene's density)")
    command.add_argument("--lift", action=argparse.BooleanOptionalAction, default=True, help="lift the object at the end (default)")
    command.add_argument("--sensor", default="coro", help="name or YAML file of the sensor on both fingers (default: coro)")
    command.add_argument("--scene", type=Path, metavar="FILE.yaml",
                         help="what differs from the scene that ships; docs/how-to/grasp_in_simulation.md lists the keys")
    command.add_argument("--model", choices=("auto", "elastic", "foundation", "hyperelastic"), default="auto",
                         help="a model by its name; auto (default) lets the policy choose at each event")
    command.add_argument("--policy", choices=("error", "paper"), default="error", help="how auto chooses, as in softtact press")
    command.add_argument("--shear", action="store_true",
                         help="press the shear of each event, too, with the scene's friction; --model elastic or hyperelastic")
    command.add_argument("--tolerance", type=float, default=0.01, metavar="MM", help="for the policy error (default: 0.01)")
    command.add_argument("--workers", type=int, metavar="N", help="processes that press (default: one for each core)")
    command.add_argument("--replay", type=Path, metavar="events.nc",
                         help="press the events of a file again, in place of a grasp; all other options come from the file")
    command.add_argument("--picture", action=argparse.BooleanOptionalAction, default=True,
                         help="draw the robot at the events beside maps and counts (default)")
    command.add_argument("--video", action="store_true", help="write the grasp as grasp.mp4")
    command.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where events.nc, grasp.png and grasp.mp4 go")


def _grasp(options):
    from softtact.robot.settings import import_mujoco

    import_mujoco()     # reports a missing extra at once
    from softtact.robot.events import write_events

    check_output_folder(options.out)
    check_pictures(options.out)
    check_count("--workers", options.workers)
    made = _replayed(options) if options.replay else _new(options)
    data, scene, record = made
    events = options.out / "events.nc"
    write_events(events, data)
    written = [events, *_pictures(options, data, scene, record)]
    summary = _summary(data) | {"written": [str(path) for path in written]}
    show(summary, as_json=options.json, lines=_lines(summary))


def _new(options):
    """(data set, scene, record) of a new grasp."""
    from softtact.robot.grasp import GraspRun
    from softtact.robot.scene import Placement, build_scene
    from softtact.robot.settings import load_scene

    for name in ("mesh", "force"):
        if getattr(options, name) is None:
            raise InputError(f"{'OBJECT' if name == 'mesh' else f'--{name}'} is missing: a grasp needs a mesh and a "
                             "force; or give --replay events.nc.")
    spec = sensor_spec(options.sensor)
    check_forces([options.force], spec)
    spec.need_taxels("a record of grasps")
    if options.model != "auto":
        spec.check_for(options.model)
    if options.shear and options.model not in ("elastic", "hyperelastic"):
        raise InputError(f"--shear: {options.model} has no tangential motion; name --model elastic or hyperelastic.")
    if options.mass is not None and not options.mass > 0:
        raise InputError(f"--mass {options.mass:g}: a mass is above 0; give it in kg.")
    settings = load_scene(options.scene)
    mesh, _ = read_object(options, options.mesh)
    scene = build_scene(mesh, spec, settings, Placement(options.x, options.y, options.angle), mass_kg=options.mass)
    record = GraspRun(scene).run(options.force, lift=options.lift)
    facts = {"mesh": str(options.mesh), "mesh_sha256": _digest(options.mesh), "unit": options.unit or "",
             "repair": int(options.repair), "sensor_asked_for": options.sensor, "requested_force_n": options.force,
             "x_mm": options.x, "y_mm": options.y, "angle_deg": options.angle, "mass_kg": scene.mass_kg,
             "model_asked_for": options.model, "policy": options.policy, "tolerance_mm": options.tolerance,
             "shear": int(options.shear), "scene": settings.model_dump_json()}
    return _pressed(mesh, record, facts, options.workers), scene, record


def _replayed(options):
    """(data set, scene, record) of a file, whose events are pressed again."""
    from softtact.robot.events import facts_of, read_events, record_of
    from softtact.robot.scene import Placement, build_scene
    from softtact.robot.settings import SceneSettings

    for name, default in _OF_GRASP.items():
        if getattr(options, name) != default:
            stated = "--no-repair" if name == "repair" else f"--{name} {getattr(options, name)}"
            raise InputError(f"{stated}: it has no effect on --replay, which takes it from the file; "
                             "leave it out.")
    data = read_events(options.replay)
    facts, record = facts_of(data), record_of(data)
    if "mesh" not in facts:
        raise InputError(f"{options.replay}: it does not name its mesh; give a file that softtact grasp wrote.")
    path = options.mesh or Path(facts["mesh"])
    if not path.is_file():
        raise InputError(f"{options.replay}, at 'mesh': there is no file {path} here; run in the folder of the grasp, or name the "
                         "mesh as OBJECT.")
    if _digest(path) != facts["mesh_sha256"]:
        raise InputError(f"{path}: it is not the mesh that {options.replay} was made with; give that one as OBJECT.")
    options.unit, options.repair = facts["unit"] or None, bool(facts["repair"])
    mesh, _ = read_object(options, path)
    settings = SceneSettings.model_validate_json(facts["scene"])
    scene = build_scene(mesh, sensor_spec(facts["sensor_asked_for"]), settings,
                        Placement(*(facts[name] for name in ("x_mm", "y_mm", "angle_deg"))), mass_kg=facts["mass_kg"])
    return _pressed(mesh, record, facts, options.workers), scene, record


def _pressed(mesh, record, facts, workers):
    """The data set of a record, with maps and counts of both sensors at its events."""
    from softtact.robot.events import press_events, to_dataset
    from softtact.robot.settings import SceneSettings

    sensor = softtact.load_sensor(facts["sensor_asked_for"])
    choice = {"policy": facts["policy"], "tolerance_mm": facts["tolerance_mm"]}
    if facts.get("shear"):
        choice["friction"] = SceneSettings.model_validate_json(facts["scene"]).friction
    maps = press_events(sensor, mesh, record, model=facts["model_asked_for"], workers=workers, **choice)
    return to_dataset(record, maps, sensor, facts)


def _digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _pictures(options, data, scene, record):
    """Draw the pictures; return their paths."""
    from softtact.imaging.movies import write_movie
    from softtact.robot.render import CLOSE, WHOLE, draw_grasp, draw_rows

    written = []
    if options.picture:
        images = [draw_rows(scene, record, record.event_row, view=view) for view in (WHOLE, CLOSE)]
        written.append(options.out / "grasp.png")
        draw_grasp(data, written[-1], images=images)
    if options.video:
        rows = range(0, len(record.time_s), 4)      # of rows 10 ms apart: 25 a second
        images = draw_rows(scene, record, rows, view=WHOLE)
        if images is not None:
            written.append(options.out / "grasp.mp4")
            write_movie(written[-1], images, fps=0.25 / scene.settings.record_s)
    return written


def _summary(data):
    """The results of a grasp for each event, as plain JSON values."""
    rows = data.event_row.values
    events = [{"event": str(data.event.values[k]), "time_s": float(data.time_s[row]), "opening_mm": float(data.opening_mm[row]),
               "force_n": data.force_n[row].values.tolist(), "contact": data.contact[row].values.tolist(),
               "model": data.model[k].values.tolist(), "selection_reason": data.selection_reason[k].values.tolist(),
               "within_validity": data.within_validity[k].values.tolist(),
               "validity_reason": data.validity_reason[k].values.tolist(),
               "largest_deformation_mm": data.deformation_map_mm[k].max(dim=("y", "x")).values.tolist(),
               "tactile_map": data.tactile_map[k].values.tolist()} for k, row in enumerate(rows)]
    held = bool(data.contact[rows[-1]].all())
    return {"events": events, "held": held, "mass_kg": data.attrs["mass_kg"]}


def _lines(summary):
    yield (f"{'event':9}{'time, s':>9}{'opening, mm':>13}  {'finger':7}{'force, N':>10}{'shear, N':>10}{'deepest, mm':>13}"
           f"{'counts, sum':>13}  model")
    for event in summary["events"]:
        for finger, name in enumerate(("left", "right")):
            x, y, z = event["force_n"][finger]
            head = f"{event['event']:9}{event['time_s']:9.2f}{event['opening_mm']:13.3f}" if finger == 0 else " " * 31
            counts = sum(map(sum, event["tactile_map"][finger]))
            flag = ("" if event["within_validity"][finger] else
                    f"  (beyond what the model is valid for: {event['validity_reason'][finger]})")
            yield (f"{head}  {name:7}{-z + 0.0:10.3f}{(x * x + y * y) ** 0.5:10.3f}{event['largest_deformation_mm'][finger]:13.4f}"
                   f"{counts:13.0f}  {event['model'][finger]}{flag}")
    if summary["events"][-1]["event"] == "lift":
        yield f"object of {1e3 * summary['mass_kg']:.3g} g: " + ("held" if summary["held"] else "not held; give a larger force")
    yield from (f"written: {path}" for path in summary["written"])
