"""The command `softtact`: its commands are the modules of `softtact.commands`.

An error that the user can correct ends with one sentence on stderr and an exit status (`softtact.exits`).
The commands import heavy packages inside their functions, so that `softtact --help` answers at once.
"""

import argparse
import os
import re
import sys
import warnings
from collections.abc import Sequence
from functools import partial

import softtact
from softtact.commands import (
    calibrate,
    calibrate_camera,
    completion,
    config_example,
    cost,
    dataset,
    detect_discs,
    export_deck,
    fit,
    grasp,
    grasps,
    mesh,
    palpate,
    play,
    predict,
    press,
    skin,
    stage,
    view,
)
from softtact.commands.common import EXIT_TEXT
from softtact.exits import run_to_status

COMMANDS = (press, play, grasp, grasps, skin, palpate, dataset, view, calibrate, calibrate_camera, predict, fit, mesh,
            export_deck, detect_discs, cost, stage, config_example, completion)
EXAMPLES = """examples:
  softtact press part.stl --unit mm --force 5 --force 20 --out press.nc --vtu press.vtu --plot press.png
  softtact grasp part.stl --unit mm --force 20 --out results/grasp   # a robot grasps it: both sensors
  softtact view press.vtu                     # turn the pressed sensor in a browser
  softtact complexity part.stl --unit mm      # which model the paper's rule takes for it
  softtact fit uniaxial=tension.csv --out card.json
  softtact cost --configfile config/paper.yaml   # jobs, hours and disk of a study, before it runs
  softtact press --help                       # each command's help has examples
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit status."""
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:     # a shell asks for completions
        import argcomplete

        argcomplete.autocomplete(parser)
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        command = f"softtact {options.command}"
        parser.exit(2, f"{command}: {unknown[0]} is no option or argument of it; see {command} --help.\n")
    options.given = list(sys.argv[1:] if arguments is None else arguments)
    with warnings.catch_warnings():
        warnings.showwarning = partial(_show_warning, options.command, set())
        return run_to_status(f"softtact {options.command}", lambda: options.run(options))


def _show_warning(command, shown, message, category, filename, lineno, file=None, line=None):
    """A warning in one line without the place in the code, once."""
    text = f"softtact {command}: WARNING: {message}"
    if text not in shown:
        shown.add(text)
        print(text, file=file or sys.stderr)


class _Parser(argparse.ArgumentParser):
    """An argument parser whose error message is one sentence."""

    _words: Sequence[str] = ()
    _seen: dict[argparse.Action, str] = {}

    def parse_known_args(self, args=None, namespace=None):
        self._words, self._seen = sys.argv[1:] if args is None else list(args), {}
        return super().parse_known_args(args, namespace)

    def _get_values(self, action, arg_strings):
        """The values of an option or argument, once; argparse would let the last one of an option win without a word."""
        if isinstance(action, argparse._StoreAction | argparse.BooleanOptionalAction) and action.option_strings:
            if action in self._seen:
                remedy = "write its values with commas" if "with commas" in (action.help or "") else "give it once"
                both = f", {self._seen[action]} and {' '.join(arg_strings)}" if arg_strings else ""
                raise argparse.ArgumentError(action, f"it is given twice{both}; {remedy}")
            self._seen[action] = " ".join(arg_strings)
        return super()._get_values(action, arg_strings)

    def error(self, message):
        self.exit(2, f"{self.prog}: {self._with_minus(message) or message}; see {self.prog} --help.\n")

    def _with_minus(self, message):
        """The message for an option whose value begins with a minus, which argparse takes for another option; else None."""
        option = re.match(r"argument (?:\S+/)?(--[\w-]+):? .*expected ", message)
        for word, value in zip(self._words, self._words[1:], strict=False):
            if option and option[1].startswith(word) and re.match(r"-[\d.]", value):
                return f"{option[1]} {value}: a value that begins with a minus reads as an option; write {option[1]}={value}"
        return None


def _parser():
    parser = _Parser(prog="softtact", description=softtact.__doc__, epilog=f"{EXAMPLES}\n{EXIT_TEXT}",
                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"softtact {softtact.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    return parser
