"""What several commands share: their common arguments, refusals before long work, and how a result is printed."""

import json
from pathlib import Path

from softtact.errors import InputError

UNITS = ("mm", "cm", "m", "inch")


def add_command(commands, name, run, summary):
    """A new command `name` that calls run(options); every one but `stage` can answer in JSON."""
    command = commands.add_parser(name, help=summary, description=summary)
    command.set_defaults(run=run)
    if name != "stage":
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return command


def add_mesh(command):
    """The arguments of a mesh over a sensor."""
    command.add_argument("mesh", metavar="MESH", type=Path, help="STL, OBJ or PLY file of a closed body")
    command.add_argument("--unit", required=True, choices=UNITS, help="the mesh's unit; the file itself does not say")
    command.add_argument("--pose", metavar="x,y,z,rx,ry,rz",
                         help="the mesh's origin in the sensor's frame, mm and degrees (default: centred, touching); "
                              "write --pose=-1,... where it begins with a minus")
    command.add_argument("--sensor", default="coro", help="name or YAML file of a sensor (default: coro)")


def show(result, *, as_json, lines):
    """`result` as JSON, or the lines for people."""
    print(json.dumps(result, indent=2) if as_json else "\n".join(lines))


def check_forces(forces, spec):
    """Refuse a force that the sensor does not bear, before a mesh is read or a solver loaded."""
    low, high = spec.force_range_n
    for force in forces:
        if not low < force <= high:
            raise InputError(f"--force {force:g}: {force:g} N is out of the range of sensor {spec.name}; "
                             f"give a force above {low:g} N and up to {high:g} N.")


def pose_of(options):
    """The `Pose` given on the command line, or None."""
    from softtact.geometry.pose import Pose

    return Pose.parse(options.pose) if options.pose else None


def check_folders(*paths):
    """Refuse now what could not be written after a long press."""
    for path in paths:
        if path and not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}; make it first.")


def pairs(option, texts):
    """(name, value) of texts NAME=VALUE."""
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f"{option} {text}: write it as NAME=VALUE.")
        yield name, value


def numbers(option, text, count):
    """`count` numbers with colons between them."""
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if len(values) != count or sorted(values) != values:
        wanted = "a number" if count == 1 else "two rising numbers with a colon between them"
        raise InputError(f"{option} MODE={text}: {text!r} is not {wanted}; correct it.")
    return values


def sensor_spec(name):
    """The description of a sensor by its name or its YAML file, without its solvers."""
    from softtact.config import sensor_file
    from softtact.geometry.sensor_spec import SensorSpec

    return SensorSpec.from_yaml(sensor_file(name))


def short(value):
    """A number in four digits, anything else as it is."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
