"""`softtact stage`: one stage of the workflow on files."""

import argparse

from softtact.commands.common import add_command

EXAMPLES = r"""
  softtact stage make_curves --out 'curves[]=uniaxial.csv' --settings '{"material": "mine", "kind": "synthetic",
      "law": "neo_hooke", "parameters": {"c10": 0.2}, "noise": 0.01, "points": 9, "seed": 1, "modes": {"uniaxial": [0.8, 1.4]}}'
  snakemake --cores all --printshellcmds      # runs all stages of the study, and prints their commands
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    from softtact.studies.__main__ import add_arguments

    add_arguments(add_command(commands, "stage", _stage, "Run one stage of the workflow on files, as its rule does.", EXAMPLES,
                              json=False))


def _stage(options):
    from softtact.studies.__main__ import run_stage

    run_stage(options)
