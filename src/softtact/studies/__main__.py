"""Run one stage on files, like the workflow.

Example:
    python -m softtact.studies hybrid.fit_material --in curves=a.csv --in curves=b.csv --out card=x.json --settings '{...}'
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from softtact.errors import InputError
from softtact.exits import run_to_status
from softtact.processes import end_after


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the stage that the command line names; return its exit status."""
    options = add_arguments(argparse.ArgumentParser(prog="softtact stage", description=__doc__)).parse_args(arguments)
    if workflow := os.environ.get("SOFTTACT_WORKFLOW"):     # Snakemake, which a shell stands between
        end_after(int(workflow))
    return run_to_status(f"softtact {options.stage}", lambda: run_stage(options))


def add_arguments(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Declare a stage's command line on `parser`."""
    parser.add_argument("stage", metavar="NAME",
                        help="KIND.NAME, a stage of a kind of study named as the workflow's rule; of the hybrid study NAME alone")
    parser.add_argument("--in", dest="inputs", action="append", default=[], metavar="NAME=PATH",
                        help="an input file; a repeated name, or NAME[]=PATH, makes a list, and NAME[]= an empty one")
    parser.add_argument("--out", dest="outputs", action="append", default=[], metavar="NAME=PATH",
                        help="an output file; lists as for --in")
    parser.add_argument("--settings", default="{}", metavar="JSON", help="the values that the stage uses")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="cores that it may use (default: 1)")
    return parser


def run_stage(options: argparse.Namespace) -> None:
    """Import the stage and call it."""
    from softtact.outputs import check_output_folder, refuse_overwriting, target_of
    from softtact.studies.jobs import find_stage

    run = find_stage(options.stage if "." in options.stage else f"hybrid.{options.stage}")
    inputs, outputs = _named_paths(options.inputs, option="--in"), _named_paths(options.outputs, option="--out")
    for _, path in _flat(outputs):
        check_output_folder(path if path.is_dir() else target_of(path).parent)
    refuse_overwriting((path for _, path in _flat(inputs)), dict(_flat(outputs)))
    run(inputs=inputs, outputs=outputs, settings=_settings(options.settings), threads=options.threads)


class _Named(dict):
    """{name: path or list of paths}; a missing name raises an InputError that names the option."""

    def __init__(self, option, paths):
        super().__init__(paths)
        self.option = option

    def __missing__(self, name):
        raise InputError(f"{self.option} {name}=PATH is missing; this stage needs it.")


def _named_paths(pairs, *, option):
    """{name: Path} of NAME=PATH arguments; a repeated name or NAME[] gives a list in the order given, NAME[]= an empty one."""
    paths, lists = {}, set()
    for pair in pairs:
        key, _, path = pair.partition("=")
        name = key.removesuffix("[]")
        if not name or (not path and key == name):
            raise InputError(f"{option} {pair}: write it as NAME=PATH.")
        if key != name or name in paths:
            lists.add(name)
        paths.setdefault(name, []).extend([Path(path)] if path else [])
    return _Named(option, {name: found if name in lists else found[0] for name, found in paths.items()})


def _flat(named):
    """(--out NAME, path) of each path, numbered in lists."""
    for name, paths in named.items():
        for k, path in enumerate(paths if isinstance(paths, list) else [paths]):
            yield f"--out {name}{f'[{k}]' * isinstance(paths, list)}", path


def _settings(text):
    from softtact.files import parse_json  # NumPy, which the parser does without

    try:
        return parse_json(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"--settings is not valid JSON ({error}).") from None


if __name__ == "__main__":
    sys.exit(main())
