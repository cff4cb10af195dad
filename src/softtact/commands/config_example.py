"""`softtact config-example`: a file that ships with the package, as a start for one's own."""

import argparse
from importlib import resources
from pathlib import Path

from softtact.commands.common import add_command
from softtact.errors import InputError
from softtact.outputs import check_outputs

EXAMPLES = """
  softtact config-example sensor --kind layers > mine.yaml      # then: softtact press part.stl --unit mm --sensor mine.yaml
  softtact config-example material > my_material.yaml
  softtact config-example study --kind skin --out my_skin.yaml
"""
_SENSORS, _STUDIES = "softtact.sensors", "softtact.studies"
# {what: {kind: (package, path of its file)}}, the default first
FILES = {
    "sensor": {"frusta": (_SENSORS, "data/sensors/coro.yaml"), "layers": (_SENSORS, "data/sensors/sheet.yaml"),
               "gel": (_SENSORS, "data/sensors/gelsight_mini.yaml"), "solid": (_SENSORS, "data/examples/solid.yaml")},
    "material": {"printed": (_SENSORS, "data/materials/silicone.yaml")},
    "study": {name: (_STUDIES, f"data/{'config' if name == 'default' else name}.yaml")
              for name in ("default", "skin", "probe", "grasps", "markers", "real", "decide", "tiny")},
}


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "config-example", _example, "Print a YAML file that ships with the package, to start from.",
                          EXAMPLES, json=False)
    command.add_argument("what", choices=tuple(FILES), help="which file")
    kinds = "; ".join(f"{what}: {', '.join(kinds)}" for what, kinds in FILES.items())
    command.add_argument("--kind", help=f"{kinds} (default: the first)")
    command.add_argument("--out", type=Path, metavar="FILE.yaml", help="file to write; without it the example is printed")


def _example(options):
    known = FILES[options.what]
    kind = options.kind or next(iter(known))
    if kind not in known:
        raise InputError(f"--kind {kind}: there is no example of a {options.what} of that kind; use one of {', '.join(known)}.")
    package, path = known[kind]
    text = (resources.files(package) / path).read_text(encoding="utf-8")
    if options.out is None:
        print(text, end="")
        return
    from softtact.files import atomic_path

    check_outputs(options.out)
    if options.out.exists():
        raise InputError(f"--out {options.out}: the file is there, and may be yours; give another name.")
    with atomic_path(options.out) as temporary:
        temporary.write_text(text, encoding="utf-8")
