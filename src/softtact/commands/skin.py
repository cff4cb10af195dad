"""`softtact skin`: design a robot skin, from its module to the readings of its taxels."""

import argparse
import os
import sys
from pathlib import Path

from softtact.commands.common import add_command, check_count, show
from softtact.outputs import check_output_folder

EXAMPLES = """
  softtact skin config/skin.yaml --out results/skin
  softtact skin config/tiny_skin.yaml --out results/tiny_skin --json
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands,
        "skin",
        _skin,
        "Design a capacitive robot skin: readings under loads, elastomer and thickness, maps, exports, a report.",
        EXAMPLES,
    )
    command.add_argument(
        "design", metavar="DESIGN.yaml", type=Path, help="the design; docs/how-to/design_a_skin.md explains its keys"
    )
    command.add_argument(
        "--out", type=Path, required=True, metavar="FOLDER", help="the folder of the results; report.html is the page"
    )
    command.add_argument(
        "--threads", type=int, default=os.cpu_count() or 1, metavar="N", help="of the solver at finite strains (default: all cores)"
    )


def _skin(options):
    from softtact.studies.registry import open_study

    opened = open_study(options.design, kind="skin")
    check_count("--threads", options.threads)
    check_output_folder(options.out)
    from softtact.files import read_json
    from softtact.studies.jobs import run_jobs

    run_jobs("skin", opened.jobs(options.out), options.out, threads=options.threads, label=opened.study.design.skin)
    summary = read_json(options.out / "summary.json") | {"out": str(options.out), "report": str(options.out / "report.html")}
    for remark in summary["remarks"]:
        print(f"softtact skin: WARNING: {remark}", file=sys.stderr)
    show(summary, as_json=options.json, lines=_lines(summary))


def _lines(summary):
    yield f"{'load':24}{'force, N':>10}{'deepest, mm':>13}{'taxel':>7}{'rise, fF':>10}{'counts':>8}"
    for row in summary["loads"]:
        yield (
            f"{row['load']:24}{row['force_n']:10.4g}{row['deepest_mm']:13.4f}{row['taxel']:7d}{row['delta_ff']:10.3f}"
            f"{row['counts']:8d}"
        )
    if summary.get("chosen"):
        yield f"chosen: {_layer(summary['chosen'])}"
    if summary.get("chosen_at_worst"):
        yield f"chosen so that the worst batch meets the needs, too: {_layer(summary['chosen_at_worst'])}"
    if summary.get("maps"):
        maps = summary["maps"]
        yield (f"a finger is felt from {maps['least_force_n']:.3g} N on at best, {maps['worst_force_n']:.3g} N at worst; "
               f"{maps['asked_n']:g} N is missed on {maps['share_not_felt']:.0%} of the places")
    if summary.get("link"):
        link = summary["link"]
        yield (f"link: {link['modules']} modules, {link['elastomer_g']:.3g} g of elastomer, bend radius "
               f"{link['least_bend_radius_mm']:.3g} mm or more, gaps up to {link['widest_gap_mm']:.2g} mm, overlaps up to "
               f"{link['widest_overlap_mm']:.2g} mm; "
               f"{link['bent_too_much']} bend too much and are left out, {link['without_place']} found no place")
    yield f"written: {summary['report']}"


def _layer(best):
    return f"{best['thickness_mm']:g} mm of {best['elastomer']}, {best['weight_g_module']:.3g} g a module"
