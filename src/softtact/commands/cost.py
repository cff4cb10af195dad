"""`softtact cost`: what a study takes before it is started."""

import argparse
import os
from pathlib import Path

from softtact.commands.common import add_command, show

EXAMPLES = """
  softtact cost
  softtact cost --configfile config/paper.yaml --cores 32 --json
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "cost", _cost, "Tell a study's jobs, hours and disk before it is started.", EXAMPLES)
    command.add_argument("--configfile", type=Path, metavar="FILE.yaml",
                         help="the study's configuration over config/config.yaml (default: that alone)")
    command.add_argument("--cores", type=int, default=os.cpu_count(), metavar="N", help="to work on (default: all)")


def _cost(options):
    from dataclasses import asdict

    from softtact.studies.cost import cost_lines, read_costs, study_costs
    from softtact.studies.hybrid.config import load_study, read_values

    study, measured = load_study(read_values(options.configfile)), read_costs()
    costs = study_costs(study, measured)
    result = {"study": study.name, "stages": [asdict(cost) | {"hours": cost.hours} for cost in costs],
              "core_hours": sum(cost.hours for cost in costs), "disk_mb": sum(cost.disk_mb for cost in costs),
              "origin": measured["origin"]}
    show(result, as_json=options.json, lines=cost_lines(study, costs, measured, cores=options.cores))
