"""`softtact grasps`: the study of grasps by a robot, from its configuration to its report."""

import argparse
from pathlib import Path

from softtact.commands.common import add_command, check_count, show
from softtact.outputs import check_output_folder

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
    from softtact.commands.cost import show_costs
    from softtact.press.task import cores
    from softtact.progress import announce
    from softtact.studies.cost import cost_lines, origin_of, read_costs
    from softtact.studies.registry import KINDS, OpenStudy

    check_count("--workers", options.workers)
    opened = OpenStudy("grasps", KINDS["grasps"].call("load", KINDS["grasps"].call("read", options.config), options.config))
    folder = options.out or Path("results") / opened.name
    check_output_folder(folder)
    workers, measured = options.workers or cores(), read_costs()
    costs = opened.costs(measured, folder)
    if options.cost:
        show_costs(opened, costs, cores=workers, as_json=options.json)
        return
    for line in cost_lines(opened.name, costs, origin=origin_of(opened, measured), cores=workers):
        announce(line)
    _run(opened, folder, workers, as_json=options.json)


def _run(opened, folder, workers, *, as_json):
    from softtact.robot.settings import import_mujoco

    import_mujoco()
    from softtact.files import read_csv
    from softtact.studies.jobs import run_jobs

    run_jobs(opened.kind, opened.jobs(folder), folder, threads=workers, label=opened.name)
    grasps, claims = read_csv(folder / "grasps.csv"), read_csv(folder / "tables/claims.csv")
    failed = int((grasps.status != "done").sum())
    summary = {"grasps": len(grasps), "failed": failed, "report": str(folder / "report.html"),
               "claims": dict(zip(claims.claim, claims.verdict, strict=True))}
    show(summary, as_json=as_json, lines=[*(f"{verdict:20} {claim}" for claim, verdict in summary["claims"].items()),
                                          f"{len(grasps)} grasps, {failed} failed; open {summary['report']}"])
