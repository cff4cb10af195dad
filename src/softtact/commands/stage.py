"""`softtact stage`: one stage of the workflow on files."""

from softtact.commands.common import add_command


def add(commands):
    """Add the command to the parser."""
    from softtact.stages.__main__ import add_arguments

    add_arguments(add_command(commands, "stage", _stage, "Run one stage of the workflow on files, as its rule does."))


def _stage(options):
    from softtact.stages.__main__ import run_stage

    run_stage(options)
