"""`softtact grasps`: the study of grasps by a robot, from its configuration to its report."""

import argparse
from pathlib import Path

from softtact.commands.common import add_command, show
from softtact.errors import InputError

EXAMPLES = """
  softtact grasps config/grasps.yaml --cost                          # what is left to do, and how long it takes
  softtact grasps config/grasps.yaml --out results/grasps            # goes on where it was interrupted
  softtact grasps config/tiny_grasps.yaml --out results/tiny_grasps
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "grasps", _grasps, "A study of grasps by a robot: objects in several positions, a report.",
                          EXAMPLES)
    command.add_argument("config", metavar="CONFIG.yaml", type=Path, help="what differs from config/grasps.yaml, or that file")
    command.add_argument("--out", type=Path, metavar="FOLDER", help="where all results go (default: results/ and the study's name)")
    command.add_argument("--cost", action="store_true", help="say what is left and how long it takes, and do nothing")
    command.add_argument("--workers", type=int, metavar="N", help="processes that press (default: one for each core)")


def _grasps(options):
    from softtact.press.asked import cores
    from softtact.progress import announce
    from softtact.studies.cost import read_costs
    from softtact.studies.grasps.config import cost_lines, load_grasp_study

    study = load_grasp_study(options.config)
    folder = options.out or Path("results") / study.values.study
    if folder.is_file():
        raise InputError(f"--out {folder}: it is a file; give a folder for the results.")
    lines = list(cost_lines(study, folder, read_costs(), cores=options.workers or cores()))
    if options.cost:
        show({"cost": lines}, as_json=options.json, lines=lines)
        return
    for line in lines:
        announce(line)
    _run(study, folder, options)


def _run(study, folder, options):
    from softtact.robot.settings import import_mujoco

    import_mujoco()
    from softtact.files import read_dataset, write_csv
    from softtact.studies.grasps.claims import claims_of_grasps
    from softtact.studies.grasps.report import draw_objects, draw_one_event, write_grasps_report
    from softtact.studies.grasps.run import run_study

    grasps = run_study(study, folder, workers=options.workers)
    values = study.values
    compared = {name: read_dataset(folder / "one_event" / f"{name}.nc") for name in values.one_event.objects}
    claims = claims_of_grasps(grasps, compared, force_n=values.force_n, policy=values.policy, model=values.model)
    write_csv(folder / "tables/claims.csv", claims)
    figures = []
    events, readings = _first_of_each(grasps, folder)
    if events:
        figures.append((folder / "figures/objects.png", f"Each object's first position at the grip, {values.force_n:g} N: the "
                        "hand, and for both sensors the deformation map and the virtual sensor's mean reading."))
        draw_objects(figures[-1][0], events, readings, _pictures(study, events))
    if compared:
        figures.append((folder / "figures/one_event.png", f"One and the same event, {values.one_event.force_n:g} N, by several "
                        "models: what the left sensor feels."))
        draw_one_event(figures[-1][0], compared)
    write_grasps_report(folder, study=values.study, grasps=grasps, claims=claims, figures=figures,
                        config=values.model_dump_json(indent=2))
    failed = int((grasps.status != "done").sum())
    summary = {"grasps": len(grasps), "failed": failed, "report": str(folder / "report.html"),
               "claims": dict(zip(claims.claim, claims.verdict, strict=True))}
    show(summary, as_json=options.json, lines=[*(f"{verdict:20} {claim}" for claim, verdict in summary["claims"].items()),
                                               f"{len(grasps)} grasps, {failed} failed; open {summary['report']}"])


def _first_of_each(grasps, folder):
    """{object: events} and {object: readings} of the first position of each object that was done."""
    from softtact.files import read_dataset
    from softtact.robot.events import read_events

    first = grasps[grasps.status == "done"].drop_duplicates("object")
    events = {one.object: read_events(folder / "grasps" / one.grasp / "events.nc") for one in first.itertuples()}
    return events, {one.object: read_dataset(folder / "grasps" / one.grasp / "readings.nc") for one in first.itertuples()}


def _pictures(study, events):
    """{object: image of the hand at the grip}, without any where MuJoCo does not draw."""
    from softtact.geometry.meshes import read_mesh
    from softtact.robot.events import record_of
    from softtact.robot.render import draw_rows
    from softtact.robot.scene import Placement, build_scene
    from softtact.robot.settings import load_scene
    from softtact.studies.grasps.config import entry_of

    pictures = {}
    for name, data in events.items():
        entry, record = entry_of(study, name), record_of(data)
        scene = build_scene(read_mesh(entry.file, unit=entry.unit), study.spec, load_scene(**study.values.scene),
                            Placement(*(data.attrs[key] for key in ("x_mm", "y_mm", "angle_deg"))))
        images = draw_rows(scene, record, [record.event_row[1]], view=(20.0, -20.0, 0.22), size=(300, 300))
        if images is None:
            return {}
        pictures[name] = images[0]
    return pictures
