"""`softtact complexity`: the counts that the paper chooses a model by."""

import argparse

from softtact.commands.common import add_command, add_mesh, pose_of, sensor_spec, short, show

EXAMPLES = """
  softtact complexity part.stl --unit mm
  softtact complexity part.stl --unit mm --pose=0,0,0,0,0,90 --rule all --json
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "complexity", _complexity, "Count a mesh's complexity and choose its model.", EXAMPLES)
    add_mesh(command)
    command.add_argument("--rule", choices=("any", "all"), default="any",
                         help="which of the two criteria the hyperelastic model takes (default: any)")


def _complexity(options):
    from softtact.geometry.complexity import choose_model, score_file

    spec = sensor_spec(options.sensor)
    counts = score_file(options.mesh, unit=options.unit, footprint_mm=spec.footprint_mm, pose=pose_of(options),
                        reach_mm=spec.thickness_mm)
    four = {"NPt": counts.NPt, "CHt": counts.CHt, "NPo": counts.NPo, "CHo": counts.CHo}
    result = four | {"ratio_total": counts.ratio_total, "ratio_overlap": counts.ratio_overlap}
    result["model"] = choose_model(**four, rule=options.rule)
    show(result, as_json=options.json, lines=[f"{name:14}{short(value)}" for name, value in result.items()])
