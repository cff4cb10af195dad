"""Common parts of the commands: arguments, checks before long work, and the printing of a result."""

import argparse
import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.errors import InputError, require
from softtact.exits import EXIT_STATUS

if TYPE_CHECKING:
    from webbrowser import BaseBrowser

    import trimesh

    from softtact.geometry.pose import Pose
    from softtact.sensors.base import Specification
    from softtact.sensors.specification import AnySpec

UNITS = ("mm", "cm", "m", "inch", "in")
MESH_FILE = "file of a closed body: STL, OBJ, PLY, OFF, 3MF, AMF, DAE, GLB or STEP, or one of them in a ZIP archive"
EXIT_TEXT = "exit status:\n" + "\n".join(f"  {status:<4}{meaning}" for status, meaning in EXIT_STATUS.items())


def add_command(commands: argparse._SubParsersAction, name: str, run: Callable[[argparse.Namespace], None], summary: str,
                examples: str, *, json: bool = True) -> argparse.ArgumentParser:
    """Add a command `name` that calls run(options), with examples in its help; `json`: with the option --json."""
    command = commands.add_parser(name, help=summary, description=summary, epilog=f"examples:{examples.rstrip()}\n\n{EXIT_TEXT}",
                                  formatter_class=argparse.RawDescriptionHelpFormatter)
    command.set_defaults(run=run)
    if json:
        command.add_argument("--json", action="store_true", help="print the result as JSON; messages go to stderr")
    return command


def add_mesh(command: argparse.ArgumentParser, *, several: bool = False) -> None:
    """The arguments of a mesh over a sensor, or of `several`."""
    if several:
        command.add_argument("mesh", metavar="MESH", type=Path, nargs="+",
                             help=f"{MESH_FILE}; several, or a folder of them, are pressed one by one")
    else:
        command.add_argument("mesh", metavar="MESH", type=Path, help=MESH_FILE)
    add_unit(command)
    command.add_argument("--pose", metavar="x,y,z,rx,ry,rz",
                         help="the mesh's origin in the sensor's frame, mm and degrees (default: centred, touching); "
                              "write --pose=-1,... where it begins with a minus")
    command.add_argument("--sensor", default="coro", help="name or YAML file of a sensor (default: coro)")


def add_unit(command: argparse.ArgumentParser) -> None:
    """The option of the unit of mesh files."""
    command.add_argument("--unit", choices=UNITS, help="the mesh's unit, which STL, OBJ, PLY and OFF files do not state; for other "
                                                       "formats it may be left out, and is that of the file")


def add_repair(command: argparse.ArgumentParser) -> None:
    """The option to repair a mesh that is not a clean body."""
    command.add_argument("--repair", action=argparse.BooleanOptionalAction, default=True,
                         help="repair clear faults of the mesh (flat or small holes, doubled, turned or broken facets, "
                              "overlapping bodies) and name each repair on stderr; --no-repair refuses such a mesh")


def read_object(options: argparse.Namespace, path: Path) -> "tuple[trimesh.Trimesh, list[str]]":
    """A mesh of the command line (trimesh, mm) and the list of its repairs, which go to stderr, as does how it was read."""
    from softtact.geometry.meshes import read_mesh
    from softtact.geometry.repair import read_mended

    if not options.repair:
        mesh = read_mesh(path, unit=options.unit)
        report_reading(options, path, mesh.metadata["notes"])
        return mesh, []
    mended = read_mended(path, unit=options.unit)
    report_reading(options, path, mended.notes)
    for repair in mended.repairs:
        print(f"softtact {options.command}: {path} was repaired: {repair}", file=sys.stderr)
    return mended.mesh, mended.repairs


def report_reading(options: argparse.Namespace, path: Path, notes: Iterable[str]) -> None:
    """Report on stderr how a mesh file was read."""
    for note in notes:
        print(f"softtact {options.command}: {path}: {note}", file=sys.stderr)


def show(result: Any, *, as_json: bool, lines: Iterable[str]) -> None:
    """Print `result` as JSON, in which a number that is not finite is null, or the lines for people."""
    print(json.dumps(_finite(result), indent=2, allow_nan=False) if as_json else "\n".join(lines))


def _finite(value):
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def check_count(option: str, number: int | None) -> None:
    """Refuse a number of threads, processes or cores below 1; None is for the command to choose."""
    if number is not None and number < 1:
        raise InputError(f"{option} {number}: give 1 or more.")


def check_forces(forces: Iterable[float], spec: "Specification") -> None:
    """Refuse a force outside the sensor's range, before a mesh is read or a solver is imported."""
    low, high = spec.force_range_n
    for force in forces:
        if not low < force <= high:
            raise InputError(f"--force {force:g}: {force:g} N is out of the range of sensor {spec.name}; "
                             f"give a force above {low:g} N and up to {high:g} N.")


def sensor_path(name: str) -> Path:
    """The YAML file of a sensor, from its name or its path."""
    from softtact.sensors.library import sensor_file

    return sensor_file(name)


def pose_of(options: argparse.Namespace) -> "Pose | None":
    """The `Pose` given on the command line, or None."""
    from softtact.geometry.pose import Pose

    return Pose.parse(options.pose) if options.pose else None


def origin(options: argparse.Namespace, path: Path) -> dict[str, str]:
    """The inputs of a press, as attributes of its file."""
    import hashlib

    return {"mesh": path.name, "mesh_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "unit": options.unit or "that of the file", "pose": options.pose or "centred, touching",
            "command": shlex.join(["softtact", *options.given])}


def check_names(endings: Mapping[Path | None, tuple[str, ...]]) -> None:
    """Refuse an output file without one of its known endings: {path or None: endings}."""
    for path, known in endings.items():
        if path and path.suffix.lower() not in known:
            raise InputError(f"{path}: the file is written as {' or '.join(known)}; give a name with such an ending.")


def check_pictures(*paths: Path | None) -> None:
    """Refuse a page or a picture, before any work, where the package that draws it is not installed."""
    for path in filter(None, paths):
        require("matplotlib", path)


def import_trimesh() -> None:
    """Import trimesh without packages that it loads wherever they are, which takes a third of a second, and that commands use
    through it seldom (`geometry.repair`) or never. In a command's process alone: trimesh works without them from then on."""
    hidden = [name for name in ("cascadio", "meshio", "networkx", "scipy.ndimage", "scipy.optimize") if name not in sys.modules]
    try:
        sys.modules |= dict.fromkeys(hidden)     # type: ignore[arg-type]
        import trimesh  # noqa: F401
    finally:
        for name in hidden:
            del sys.modules[name]


def pairs(option: str, texts: Iterable[str] | None) -> Iterator[tuple[str, str]]:
    """(name, value) of texts NAME=VALUE, each name once."""
    seen: dict[str, str] = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f"{option} {text}: write it as NAME=VALUE.")
        if name in seen:
            raise InputError(f"{option} {text}: {name} was already given as {seen[name]}; give it once.")
        seen[name] = value
        yield name, value


def numbers(option: str, text: str, count: int) -> list[float]:
    """`count` numbers, separated by colons."""
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if len(values) != count or sorted(values) != values or not all(abs(value) < float("inf") for value in values):
        wanted = "a number" if count == 1 else "two rising numbers with a colon between them"
        raise InputError(f"{option} MODE={text}: {text!r} is not {wanted}; correct it.")
    return values


def sensor_spec(name: str) -> "AnySpec":
    """The specification of a sensor by its name or its YAML file, without its solvers."""
    from softtact.sensors.specification import read_spec

    return read_spec(sensor_path(name))


def any_sensor_spec(name: str) -> Any:
    """The specification of a sensor of any kind, without its solvers."""
    from softtact.sensors.specification import read_any_spec

    return read_any_spec(sensor_path(name))


def short(value: object) -> str:
    """A number with four digits, anything else unchanged."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def find_browser() -> "BaseBrowser | None":
    """The browser, or None without a screen or a browser."""
    import webbrowser

    screen = sys.platform in ("darwin", "win32") or any(name in os.environ for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    try:
        return webbrowser.get() if screen else None
    except webbrowser.Error:
        return None
