"""`softtact dataset`: random presses of objects as a data set for learning."""

import argparse
from pathlib import Path

import softtact
from softtact.commands.common import add_command, add_repair, add_unit, check_count, check_forces, read_object, sensor_spec, show
from softtact.errors import InputError
from softtact.outputs import check_outputs

EXAMPLES = """
  softtact dataset part.stl --unit mm --presses 100 --out data.h5
  softtact dataset objects/ --unit mm --presses 1000 --force 5 --force 20 --seed 7 --format netcdf --out data.nc
  softtact dataset objects/ --unit mm --presses 1000 --fingers 2 --format lerobot --out data
  softtact dataset objects/ --unit mm --presses 1000 --cost --out data.h5      # what is left, and how long it takes
"""
_FORCES_N = (5.0, 10.0, 20.0, 40.0)


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "dataset", _dataset, "Random presses of objects as a data set for learning.", EXAMPLES)
    command.add_argument("mesh", metavar="OBJECT", type=Path, nargs="+",
                         help="mesh files of closed bodies (STL, OBJ, PLY, OFF, 3MF, AMF, DAE, GLB, STEP), or folders")
    add_unit(command)
    add_repair(command)
    command.add_argument("--presses", type=int, required=True, metavar="N", help="in all; the objects take turns")
    command.add_argument("--force", type=float, action="append", metavar="N",
                         help="force in N; repeat it (default: 5, 10, 20 and 40, as far as the sensor bears them)")
    command.add_argument("--fingers", type=int, choices=(1, 2), default=1,
                         help="2 presses each object from its other side, too, as in a grip (default: 1)")
    command.add_argument("--sensor", default="coro", help="name or YAML file of a sensor (default: coro)")
    command.add_argument("--model", choices=("elastic", "foundation", "hyperelastic", "auto"), default="elastic",
                         help="elastic by default")
    command.add_argument("--seed", type=int, default=1, help="of the drawn places (default: 1)")
    command.add_argument("--format", choices=("hdf5", "netcdf", "lerobot"), default="hdf5",
                         help="lerobot: a folder in LeRobot's format v3.0, with videos of the deformation map")
    command.add_argument("--workers", type=int, metavar="N", help="processes (default: one for each core)")
    command.add_argument("--cost", action="store_true", help="say what is left and how long it takes, and do nothing")
    command.add_argument("--out", type=Path, required=True, metavar="FILE",
                         help="the data set (a folder of lerobot); until it is whole, finished presses are in the folder "
                              "FILE.part, from which the same command continues")


def _dataset(options):
    from softtact.learning.press_data import PressPlan, check_name, presses_left, write_press_data
    from softtact.press.task import cores
    from softtact.progress import announce
    from softtact.studies.cost import read_costs

    check_outputs(options.out)
    check_count("--workers", options.workers)
    check_name(options.out, options.format)
    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: give 0 or more.")
    spec = sensor_spec(options.sensor)
    forces = sorted(set(options.force or [force for force in _FORCES_N if force <= spec.force_range_n[1]]))
    check_forces(forces, spec)
    meshes = _meshes(options)
    plan = PressPlan(softtact.load_sensor(options.sensor), meshes, options.presses, forces, options.model, options.seed,
                     fingers=options.fingers)
    cost = _cost(plan, presses_left(options.out, plan), read_costs(), options.workers or cores())
    if options.cost:
        show({"cost": cost}, as_json=options.json, lines=[cost])
        return
    announce(f"softtact dataset: {cost}")
    failed = write_press_data(options.out, plan, form=options.format, workers=options.workers)
    summary = {"written": str(options.out), "presses": options.presses, "failed": failed, "forces_n": forces,
               "objects": list(meshes), "format": options.format}
    show(summary, as_json=options.json, lines=[f"{options.presses} presses of {len(meshes)} objects at {len(forces)} forces, "
                                               f"{failed} failed: {options.out}"])


def _meshes(options):
    """{name: mesh} of files and folders."""
    from softtact.geometry.formats import meshes_in

    paths = [file for path in options.mesh for file in (meshes_in(path) if path.is_dir() else [path])]
    names = [path.stem for path in paths]
    for name, path in zip(names, paths, strict=True):
        if names.count(name) > 1:
            raise InputError(f"{path}: two objects have the name {name}; rename one, since the data set names its objects.")
    return {name: read_object(options, path)[0] for name, path in zip(names, paths, strict=True)}


def _cost(plan, left, costs, cores):
    """One sentence on the presses left and their time."""
    spec, times = plan.sensor.spec, costs["grasps"]["seconds"]
    bound = "at most " if plan.model == "auto" else ""
    minutes = left * plan.fingers * times["hyperelastic" if plan.model == "auto" else plan.model] / 60 / cores
    taxels = spec.need_taxels("a data set of presses")
    each = 4 * spec.map_shape[0] * spec.map_shape[1] + 2 * taxels.rows * taxels.columns
    size_mb = plan.presses * plan.fingers * len(plan.forces_n) * each / 1e6
    return (f"{left} of {plan.presses} presses left, {bound}{minutes:.0f} minutes on {cores} cores and {size_mb:.0f} MB in all; "
            f"times: {costs['grasps']['origin']}")
