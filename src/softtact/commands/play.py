"""`softtact play`: a press in a browser, on this machine alone."""

import argparse
import contextlib
import time
from pathlib import Path

from softtact.commands.common import MESH_FILE, add_command, add_unit, any_sensor_spec, find_browser
from softtact.errors import InputError
from softtact.outputs import check_output_folder
from softtact.processes import Terminated
from softtact.progress import announce

EXAMPLES = """
  softtact play                                    # objects that ship with the package
  softtact play part.stl --unit mm
  softtact play part.stl --unit mm --sensor gelsight_mini --out presses/
  softtact play part.stl --unit mm --recording real.csv --force-log log.csv     # a real sensor's readings beside the simulated ones
  softtact play --port 8090 --no-open              # prints the address, and opens no browser
"""
_FIRST = "sphere"       # of the catalogue


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "play", _play, "Press an object in the browser: drag it over the sensor, see map and taxels at "
                          "once.", EXAMPLES, json=False)
    command.add_argument("mesh", metavar="MESH", type=Path, nargs="*", help=f"{MESH_FILE}; more can be given in the page")
    add_unit(command)
    command.add_argument("--sensor", default="coro", help="name or YAML file of a sensor, of any kind (default: coro)")
    command.add_argument("--recording", type=Path, metavar="FILE", help="recording of a real sensor, which plays beside the press")
    command.add_argument("--force-log", type=Path, metavar="FILE", help="log of its forces, with which the object is pressed then")
    command.add_argument("--finger", type=int, default=0, help="of the recording (default: 0)")
    command.add_argument("--out", type=Path, default=Path("play"), metavar="FOLDER",
                         help="folder that the page saves to, and writes nothing outside of (default: play)")
    command.add_argument("--port", type=int, default=8080, help="port, or the next free one (default: 8080)")
    command.add_argument("--open", action=argparse.BooleanOptionalAction, default=True, help="open a browser where there is one")


def _play(options):
    import viser  # noqa: F401     before any work: what is missing is named

    from softtact.play.server import PlayServer
    from softtact.play.solver import Solver
    from softtact.play.state import Object, State

    if not 0 <= options.port < 65536:
        raise InputError(f"--port {options.port}: give a number from 0 to 65535.")
    if options.unit and not options.mesh:
        raise InputError(f"--unit {options.unit}: it is the unit of the meshes that are given; add MESH, or leave it out.")
    solver = Solver()
    solver.bench(options.sensor)     # a file that it names may be missing
    check_output_folder(options.out)
    given = {path.name: Object(path, options.unit) for path in options.mesh}
    if len(given) < len(options.mesh):
        raise InputError("Two of the meshes have one name; rename one of them.")
    for one in given.values():
        solver.mesh(one)
    objects = given | {name: Object(path, unit) for name, path, unit in _shipped() if name not in given}
    recorded = _recorded(options)
    first = next(iter(given.values()), objects[_FIRST])
    server = PlayServer(State(options.sensor, first), objects, _sensors(options.sensor), options.out, port=options.port,
                        recorded=recorded)
    announce(f"softtact play: {server.url} (for this machine alone); Ctrl-C ends it.")
    if options.open and (browser := find_browser()) is not None:
        browser.open(server.url)
    try:
        while True:
            time.sleep(3600)
    except Terminated:
        raise
    except KeyboardInterrupt:     # the way to end it
        pass
    finally:
        server.stop()


def _recorded(options):
    """The `Recorded` of --recording, or None."""
    from softtact.play.recorded import Recorded

    if options.recording is None:
        for name, value in (("--force-log", options.force_log), ("--finger", options.finger)):
            if value:
                raise InputError(f"{name} {value}: it belongs to a recording; add --recording FILE, or leave it out.")
        return None
    return Recorded.read(options.recording, log=options.force_log, finger=options.finger)


def _shipped():
    """Name, file and unit of the objects that ship with the package."""
    from softtact.studies.configuration import SHIPPED
    from softtact.studies.hybrid.objects import read_catalogue

    for name, entry in read_catalogue(SHIPPED / "objects" / "catalogue.yaml").items():
        yield name, Path(entry.file), entry.unit


def _sensors(given):
    """Names of the sensors that are known, the given one first."""
    from softtact.sensors.library import ALIASES, known_names

    names = [given]
    for name in known_names("sensors"):
        with contextlib.suppress(InputError):     # a file in config/sensors/ that is not whole
            if name not in (given, *ALIASES["sensors"]) and any_sensor_spec(name):
                names.append(name)
    return names
