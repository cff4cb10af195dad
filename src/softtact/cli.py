"""The command `softtact`: its commands are the modules of `softtact.commands`.

What the user can mend ends with one sentence on stderr: exit status 2 for a wrong command line, 1 for a refusal.
Heavy imports stand inside the commands' functions, so that `softtact --help` answers at once.
"""

import argparse
import os
import sys

import softtact
from softtact.commands import complexity, cost, detect_discs, export_deck, fit, predict, press, stage
from softtact.errors import SofttactError

COMMANDS = (press, predict, complexity, fit, export_deck, detect_discs, cost, stage)


def main(arguments=None):
    """Run one command; return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except SofttactError as error:
        print(f"softtact {options.command}: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:     # `| head` has seen enough; what is still in the buffer must not raise at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        print(f"softtact {options.command}: interrupted; nothing was written.", file=sys.stderr)
        return 130
    return 0


class _Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one sentence."""

    def error(self, message):
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help.\n")


def _parser():
    parser = _Parser(prog="softtact", description=softtact.__doc__)
    parser.add_argument("--version", action="version", version=f"softtact {softtact.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    return parser
