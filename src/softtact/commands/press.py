"""`softtact press`: a mesh on the sensor, its maps and a summary."""

import argparse
import sys
from functools import partial
from pathlib import Path

import softtact
from softtact.commands import press_soft, press_solid
from softtact.commands.common import (
    add_command,
    add_mesh,
    add_repair,
    check_folders,
    check_forces,
    check_names,
    origin,
    pairs,
    pose_of,
    read_object,
    sensor_path,
    sensor_spec,
    show,
)
from softtact.commands.press_each import LAYERED, Files, is_several, press_each
from softtact.errors import ConvergenceError, InputError

EXAMPLES = """
  softtact press part.stl --unit mm --force 20
  softtact press part.obj --unit inch --force 5 --force 20 --model elastic --out press.nc --plot press.png
  softtact press part.ply --unit m --pose=-2,1.5,0,0,0,30 --force 10 --model foundation --vtu press.vtu
  softtact press part.stl --unit mm --force 20 --sensor my_sensor.yaml --policy error --tolerance 0.02
  softtact press part.stl --unit mm --force 5 --model elastic --json > press.json
  softtact press parts/ --unit mm --force 20 --model elastic --out results/ --plot press.png
  softtact press tomato.stl --unit mm --force 10 --object-law card.json --object-size 2.5
  softtact press part.stl --unit mm --motion "z -0.5; x 1.0 in 10" --model elastic --out slide.nc
  softtact press ball.stl --unit mm --force 5 --sensor dome.yaml --out press.nc     # a sensor of kind solid
"""
MODELS = ("auto", "elastic", "foundation", "hyperelastic", "solid")


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "press", _press, "Press a mesh on the sensor: deformation map and taxels.", EXAMPLES)
    add_mesh(command, several=True)
    add_repair(command)
    how = command.add_mutually_exclusive_group(required=True)
    how.add_argument("--force", type=float, action="append", metavar="N", help="force in N; repeat it for several load steps")
    how.add_argument("--motion", metavar="STEPS",
                     help='steps between semicolons: ways in mm ("z -1.0" is down), "fz -20" a force in N, "x 1.0 in 10" ten steps')
    command.add_argument("--model", choices=MODELS, default="auto",
                         help="a model by its name; auto (default) lets the policy choose")
    command.add_argument("--policy", choices=("error", "paper"), default="error",
                         help="how auto chooses: by the error to expect (default), or by the mesh's complexity as in the paper")
    command.add_argument("--tolerance", type=float, default=0.01, metavar="MM",
                         help="for the policy error: root mean square error over the map, in mm (default: 0.01)")
    command.add_argument("--mesh-quality", choices=("default", "draft", "stable", "fine"), default="default",
                         help="mesh of the hyperelastic model: default (error 1 to 2 %% of the map's maximum), draft (2 to 5 %%, "
                              "half of the time), fine (1 %%, twice the time) or stable (for frusta pressed deeper than "
                              "half of their height)")
    command.add_argument("--device", default="cpu", metavar="DEVICE",
                         help="where the hyperelastic model sums up elements: cpu (default), cuda, or auto (a GPU if there is one)")
    command.add_argument("--card", action="append", metavar="LAYER=CARD.json",
                         help="a card of `softtact fit` for the dielectric or the cover, in place of the printed constants")
    press_soft.add_options(command)
    command.add_argument("--time-limit", type=float, metavar="S",
                         help="end after so many seconds; the load steps that were reached are written and shown")
    command.add_argument("--out", type=Path, metavar="FILE.nc",
                         help="write the maps as NetCDF, anew with each load step that is reached; of several meshes: the folder "
                              "in which each gets a folder of its own with press.nc, --vtu and --plot")
    command.add_argument("--vtu", type=Path, metavar="FILE.vtu",
                         help="write the pressed sensor for ParaView and softtact view: the hyperelastic model's whole mesh, the "
                              "others' surface")
    command.add_argument("--plot", type=Path, metavar="FILE.png", help="draw deformation map and taxels (PNG or SVG)")
    command.add_argument("--full-scale", action="store_true",
                         help="let the taxels' colours in --plot end at the readout's largest count, not at the data's")


def _press(options):
    from softtact.files import refuse_overwriting

    solid = press_solid.is_solid(options.sensor)
    (press_solid.refuse_idle if solid else _refuse_idle)(options)
    press_soft.check(options, solid=solid)
    if options.time_limit is not None and not options.time_limit > 0:
        raise InputError(f"--time-limit {options.time_limit:g}: a press needs some time; give seconds above 0.")
    spec, pose = press_solid.spec_of(options.sensor) if solid else sensor_spec(options.sensor), pose_of(options)
    how = _how(options, spec)
    several = is_several(options.mesh)
    if not several:
        check_folders(options.out, options.vtu, options.plot)
    cards = [path for _, path in pairs("--card", options.card)] + ([options.object_law] if options.object_law else [])
    cards += spec.paths if solid else []
    refuse_overwriting([*options.mesh, sensor_path(options.sensor), *cards],
                       {"--out": options.out, "--vtu": options.vtu, "--plot": options.plot})
    check_names({options.vtu: (".vtu",), options.plot: (".png", ".svg")})
    if not several:
        check_names({options.out: (".nc",)})
    press = partial(press_solid.press_one if solid else _press_one, options=options, spec=spec, pose=pose, how=how, sensors={})
    if several:
        return press_each(options, press, press_solid.COLUMNS if solid else LAYERED)
    summary, error = press(options.mesh[0], Files(options.out, options.vtu, options.plot))
    show(summary, as_json=options.json, lines=press_solid.lines(summary) if solid else _press_lines(summary))
    if error:
        raise error


def _press_one(path, files, label="press", *, options, spec, pose, how, sensors):
    """Summary of a mesh's press, whose files are written, and the error that ended it before its last load step or None.

    sensors: holds the sensor from the first press on, with what its models prepared
    """
    from dataclasses import replace

    from softtact.geometry.meshes import check_over_sensor, place

    mesh, repairs = read_object(options, path)
    check_over_sensor(place(mesh, pose=pose), spec.footprint_mm, name=str(path))
    if not sensors:
        sensors["own"] = replace(softtact.load_sensor(options.sensor, materials=_cards(options)), **_quality(options),
                                 device=options.device)
    sensor = replace(sensors["own"], attributes={"mesh_repairs": "; ".join(repairs), **origin(options, path)})
    on_step = None if files.out is None else lambda result: result.write(files.out)
    pressed, own = press_soft.arguments(options, mesh, keep_body=files.vtu is not None)
    try:
        result, error = sensor.press(pressed, pose=pose, **how, model=options.model, policy=options.policy, label=label,
                                     tolerance_mm=options.tolerance, on_step=on_step, time_limit_s=options.time_limit, **own), None
    except (ConvergenceError, KeyboardInterrupt) as stop:
        if getattr(stop, "result", None) is None:
            raise
        result, error = stop.result, stop
    return _written(result, files, options), error


# Options that have an effect on the hyperelastic model alone, on the laws that the elastic model has none of, or on the choice.
_IDLE = {"card": ("elastic",), "mesh_quality": ("elastic", "foundation"), "device": ("elastic", "foundation"),
         "policy": MODELS[1:], "tolerance": MODELS[1:]}
_DEFAULTS = {"card": None, "mesh_quality": "default", "device": "cpu", "policy": "error", "tolerance": 0.01}


def _refuse_idle(options):
    """Refuse an option that would change nothing: in the model that is asked for by its name, or for want of another option."""
    for name, models in _IDLE.items():
        if options.model in models and getattr(options, name) != _DEFAULTS[name]:
            given = " ".join(options.card) if name == "card" else getattr(options, name)
            raise InputError(f"--{name.replace('_', '-')} {given}: it has no effect on the {options.model} model; "
                             "leave it out, or choose another model.")
    if options.policy == "paper" and options.tolerance != _DEFAULTS["tolerance"]:
        raise InputError(f"--tolerance {options.tolerance:g}: it has no effect on the policy paper; leave one of the two out.")
    if options.full_scale and not options.plot:
        raise InputError("--full-scale: it has no effect without --plot; give --plot FILE.png, or leave it out.")


def _how(options, spec):
    """Forces or a motion, by the names of `Sensor.press`."""
    if options.motion is not None:
        from softtact.contact.motion import Motion  # NumPy, which the parser does without

        motion = Motion.parse(options.motion)
        for name in ("policy", "tolerance"):
            if not motion.forces_n and getattr(options, name) != _DEFAULTS[name]:
                raise InputError(f"--{name} {getattr(options, name)}: it has no effect on a motion other than straight down by "
                                 "forces, for which auto is the hyperelastic model; leave it out.")
        return {"motion": motion}
    forces = sorted(set(options.force))
    check_forces(forces, spec)
    return {"force_n": forces}


def _quality(options):
    """The hyperelastic body's mesh and what counts as solved on it, by the names of `Sensor`."""
    from softtact.models.hyperelastic.mesh_settings import PRESETS

    mesh, solver = PRESETS[options.mesh_quality]
    return {"mesh": mesh(), "solver": solver()}


def _written(result, files, options):
    """The summary of what a press gave, be it the load steps before one that was not reached; its files are written."""
    if files.out:
        result.write(files.out)
    if files.vtu:
        result.write_vtu(files.vtu)
    if files.plot:
        result.plot(files.plot, full_scale=options.full_scale)
    if options.card and result.model == "elastic":
        print(f"softtact press: WARNING: --card {' '.join(options.card)} has no effect on the elastic model, which was chosen; "
              "name another model to use it.", file=sys.stderr)
    return _press_summary(result) | {"written": [str(path) for path in (files.out, files.vtu, files.plot) if path]}


def _cards(options):
    """{layer: Law} of the cards given on the command line."""
    from softtact.materials.cards import law_from_card, load_card

    laws = {}
    for layer, path in pairs("--card", options.card):
        if layer not in ("dielectric", "cover"):
            raise InputError(f"--card {layer}={path}: the layer is {layer!r}; give dielectric or cover.")
        laws[layer] = law_from_card(load_card(path))
    return laws


def _press_summary(result):
    """What a press gave at each force, as plain JSON values."""
    load_steps = {"normal_force_n": result.normal_force_n, "force_n": result.force_n, "indentation_mm": result.indentation_mm,
              "contact_area_mm2": result.contact_area_mm2,
              "largest_deformation_mm": result.deformation_map_mm.max(axis=(1, 2)),
              "tactile_map": result.tactile_map}
    names = ("penetration_mm", "frustum_compression_mm", "residual_n", "extrapolated_volume_fraction", "expected_error_mm",
             "within_validity",
             "iterations", "wall_time_s")
    load_steps |= {name: getattr(result, name) for name in names}
    load_steps |= {"torque_nmm": result.torque_nmm}
    facts = {name: getattr(result, name) for name in ("model", "solver", "selection_reason")}
    facts["repairs"] = [repair for repair in result.attributes["mesh_repairs"].split("; ") if repair]
    facts["expected_error_interval"] = ([result.attributes[f"expected_error_times_{end}"] for end in ("low", "high")]
                                        if "expected_error_times_low" in result.attributes else None)
    return facts | {name: _or_none(values) for name, values in load_steps.items()}


def _or_none(values):
    """Numbers as lists; what a model does not tell, nan, as null: JSON has no nan."""
    if values.ndim > 1:
        return [_or_none(row) for row in values]
    return [None if value != value else value for value in values.tolist()]


def _press_lines(summary):
    yield f"model: {summary['model']}, linear solver: {summary['solver']}"
    if summary["selection_reason"]:
        yield f"chosen because: {summary['selection_reason']}"
    yield f"{'force, N':>10}{'indentation, mm':>18}{'contact, mm2':>15}{'deepest, mm':>14}{'counts, sum':>14}"
    names = ("normal_force_n", "indentation_mm", "contact_area_mm2", "largest_deformation_mm", "tactile_map")
    for force, depth, area, deepest, counts in zip(*(summary[name] for name in names), strict=True):
        yield f"{force:10.4g}{depth:18.4f}{area:15.1f}{deepest:14.4f}{sum(map(sum, counts)):14.0f}"
    yield from _quality_lines(summary)


def _error_line(expected_um, interval):
    """The error to expect of a fast model, with the interval that the true one lies in; the hyperelastic model is the measure."""
    if interval is not None:
        low, high = (factor * expected_um for factor in interval)
        yield (f"error to expect against the hyperelastic model: {expected_um:.2g} um ({low:.2g} to {high:.2g}), root mean square "
               "over the map")


def _quality_lines(summary):
    """How well the load steps were solved, by the worst of them."""
    yield f"iterations: {sum(summary['iterations'])}; deepest overlap in a contact: {1e3 * max(summary['penetration_mm']):.2g} um"
    if None not in summary["residual_n"]:
        yield f"largest unbalanced nodal force: {max(summary['residual_n']):.2g} N"
    if None not in summary["frustum_compression_mm"]:
        yield f"most compressed frustum: {max(summary['frustum_compression_mm']):.3f} mm"
    if None not in summary["expected_error_mm"]:
        yield from _error_line(1e3 * max(summary["expected_error_mm"]), summary["expected_error_interval"])
    if not all(summary["within_validity"]):
        flagged = zip(summary["normal_force_n"], summary["within_validity"], strict=True)
        forces = ", ".join(f"{force:.4g}" for force, valid in flagged if not valid)
        yield f"beyond what the model is valid for: {forces} N"
    if None not in summary["extrapolated_volume_fraction"]:
        yield f"strained beyond the data behind its law: {max(summary['extrapolated_volume_fraction']):.1%} of a layer"
    yield from (f"written: {path}" for path in summary["written"])
