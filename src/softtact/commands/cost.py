"""`softtact cost`: the cost of a study before it starts."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from softtact.commands.common import add_command, check_count, show

if TYPE_CHECKING:
    from softtact.studies.cost import Cost
    from softtact.studies.registry import OpenStudy

EXAMPLES = """
  softtact cost
  softtact cost --configfile config/paper.yaml --cores 32 --json
  softtact cost --configfile config/grasps.yaml
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "cost", _cost, "Tell a study's jobs, hours and disk before it is started.", EXAMPLES)
    command.add_argument("--configfile", type=Path, metavar="FILE.yaml",
                         help="the configuration of a study of any kind (default: config/config.yaml)")
    command.add_argument("--cores", type=int, default=os.cpu_count(), metavar="N", help="to work on (default: all)")


def _cost(options):
    from softtact.studies.cost import read_costs
    from softtact.studies.registry import open_study

    check_count("--cores", options.cores)
    opened = open_study(options.configfile or "config/config.yaml")
    show_costs(opened, opened.costs(read_costs(), Path("results") / opened.name), cores=options.cores, as_json=options.json)


def show_costs(opened: "OpenStudy", costs: "list[Cost]", *, cores: int, as_json: bool) -> None:
    """Print the cost of a study."""
    from dataclasses import asdict

    from softtact.studies.cost import cost_lines, origin_of, read_costs

    origin = origin_of(opened, read_costs())
    result = {"study": opened.name, "kind": opened.kind, "stages": [asdict(cost) | {"hours": cost.hours} for cost in costs],
              "core_hours": sum(cost.hours for cost in costs), "disk_mb": sum(cost.disk_mb for cost in costs), "origin": origin}
    show(result, as_json=as_json, lines=cost_lines(opened.name, costs, origin=origin, cores=cores))
