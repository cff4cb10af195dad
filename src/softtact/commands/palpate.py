"""`softtact palpate`: a palpation sensor under load and displacement of a jaw."""

import argparse
import sys
from pathlib import Path

from softtact.commands.common import add_command, check_count, show
from softtact.outputs import check_output_folder

EXAMPLES = """
  softtact palpate config/tiny_probe.yaml --out results/tiny_probe      # within a minute
  softtact palpate config/probe.yaml --out results/probe --threads 2
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "palpate", _palpate, "Press tissue on a palpation sensor; write a report.", EXAMPLES)
    command.add_argument("design", type=Path, metavar="DESIGN.yaml", help="the sensor, its tissues and sweeps")
    command.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="for tables, pictures, fields and report.html")
    command.add_argument("--threads", type=int, default=1, metavar="N", help="threads of the solver (default: 1)")


def _palpate(options):
    from softtact.studies.registry import open_study

    check_count("--threads", options.threads)
    check_output_folder(options.out)
    opened = open_study(options.design, kind="palpation")
    from softtact.files import read_json
    from softtact.studies.jobs import run_jobs

    run_jobs("palpation", opened.jobs(options.out), options.out, threads=options.threads, label=opened.name)
    summary = read_json(options.out / "summary.json")
    print(f"softtact palpate: wrote {options.out / 'report.html'}", file=sys.stderr)
    show(summary, as_json=options.json, lines=_lines(summary))


def _lines(summary):
    for slope in summary["slopes"]:
        yield (f"{slope['tissue']}, {slope['scenario']}: trend line {slope['line_n_mm']:.2f} N/mm, "
               f"at rest {slope['initial_n_mm']:.2f}, F/d {slope['secant_least_n_mm']:.2f} to {slope['secant_largest_n_mm']:.2f}")
    for claim in summary["claims"]:
        yield f"{claim['verdict']}: {claim['claim']} ({claim['ours']})"
