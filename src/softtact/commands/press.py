"""`softtact press`: press a mesh on a sensor of any kind; maps or solids, and a summary."""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import softtact
from softtact.commands.common import (
    add_command,
    add_mesh,
    add_repair,
    any_sensor_spec,
    check_forces,
    check_names,
    check_pictures,
    import_trimesh,
    origin,
    pairs,
    pose_of,
    read_object,
    sensor_path,
    show,
)
from softtact.commands.press_each import ON_LAYERS, ON_SOLIDS, Files, is_several, press_each
from softtact.commands.press_gel import add_images, check_images, is_image, summary_of_gel, write_images
from softtact.commands.press_summary import lines_on_layers, lines_on_solids, or_none, summary_on_layers, summary_on_solids
from softtact.errors import ConvergenceError, InputError
from softtact.outputs import check_outputs, refuse_overwriting

if TYPE_CHECKING:
    import trimesh

    from softtact.press.objects import SoftObject

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
  softtact press part.stl --unit mm --motion "fz -10 over 0.2; hold 60 in 6" --sensor mine.yaml    # of a sensor that relaxes
  softtact press part.stl --unit mm --sensor gelsight_mini --motion "z -1.0 in 5; x 1.0 in 5" --image out.png --movie out.mp4
"""
MODELS = ("auto", "elastic", "foundation", "hyperelastic", "solid")
_HELD = 0.3     # default share of a soft object's height that is held


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "press", _press, "Press a mesh on the sensor: deformation map and taxels.", EXAMPLES)
    add_mesh(command, several=True)
    add_repair(command)
    how = command.add_mutually_exclusive_group(required=True)
    how.add_argument("--force", type=float, action="append", metavar="N", help="force in N; repeat it for several load steps")
    how.add_argument("--motion", metavar="STEPS",
                     help='steps between semicolons: x, y, z in mm ("z -1.0" is down), rx, ry, rz in degrees, "fz -20" a force in '
                          'N, "x 1.0 in 10" ten steps; of what relaxes "fz -20 over 0.5; hold 60 in 6" in s')
    command.add_argument("--model", choices=MODELS, default="auto",
                         help="a model by its name; auto (default) lets the policy choose")
    command.add_argument("--policy", choices=("error", "paper"), default="error",
                         help="how auto chooses: by the error to expect (default), or by the mesh's complexity as in the paper")
    command.add_argument("--tolerance", type=float, default=0.01, metavar="MM",
                         help="for the policy error: root mean square error over the map, in mm (default: 0.01)")
    command.add_argument("--mesh-quality", choices=("default", "draft", "stable", "fine", "light"), default="default",
                         help="mesh of the hyperelastic model: default (error 1 to 2 %% of the map's maximum), draft (2 to 5 %%, "
                              "half of the time), fine (1 %%, twice the time), stable (for frusta pressed deeper than "
                              "half of their height) or light (softer frusta, pressed by less than a third)")
    command.add_argument("--device", default="cpu", metavar="DEVICE",
                         help="where the hyperelastic model sums up elements: cpu (default), cuda, or auto (a GPU if there is "
                              "one), with the extra device")
    command.add_argument("--card", action="append", metavar="LAYER=CARD.json",
                         help="a card of `softtact fit` for the dielectric or the cover, in place of the printed constants")
    _add_soft(command)
    command.add_argument("--time-limit", type=float, metavar="S",
                         help="end after so many seconds; the load steps that were reached are written and shown")
    command.add_argument("--out", type=Path, metavar="FILE.nc",
                         help="write the maps as NetCDF, anew with each load step that is reached; of several meshes: the folder "
                              "in which each gets a folder with press.nc, --vtu and --plot")
    command.add_argument("--vtu", type=Path, metavar="FILE.vtu",
                         help="write the pressed sensor for ParaView and softtact view: the hyperelastic model's whole mesh, the "
                              "others' surface")
    command.add_argument("--plot", type=Path, metavar="FILE.png", help="draw deformation map and taxels (PNG or SVG)")
    add_images(command)
    command.add_argument("--verbose", action="store_true",
                         help="also tell how the solver did: iterations, overlaps, unbalanced forces")
    command.add_argument("--full-scale", action="store_true",
                         help="let the taxels' colours in --plot end at the readout's largest count, not at the data's")


def _add_soft(command):
    """The options of a soft object: its law, the size of its elements, and its held part."""
    soft = command.add_argument_group("soft objects")
    soft.add_argument("--object-law", type=Path, metavar="CARD.json",
                      help="card of `softtact fit` of the object, which then bends as the sensor does (model solid)")
    soft.add_argument("--object-size", type=float, metavar="MM", help="length of the object's elements in mm")
    soft.add_argument("--object-held", type=float, default=_HELD, metavar="SHARE",
                      help=f"share of the object's height, from the top, that a rigid holder carries (default: {_HELD:g})")


def _press(options):

    spec, pose = any_sensor_spec(options.sensor), pose_of(options)
    _refuse_idle(options, spec)
    _check_soft(options, spec)
    check_images(options, spec)
    if options.time_limit is not None and not options.time_limit > 0:
        raise InputError(f"--time-limit {options.time_limit:g}: a press needs some time; give seconds above 0.")
    how = _how(options, spec)
    several = is_several(options.mesh)
    if not several:
        check_outputs(options.out, options.vtu, options.plot, options.image, options.movie)
    cards = [path for _, path in pairs("--card", options.card)] + ([options.object_law] if options.object_law else [])
    refuse_overwriting([*options.mesh, sensor_path(options.sensor), *cards, *spec.paths],
                       {"--out": options.out, "--vtu": options.vtu, "--plot": options.plot, "--image": options.image,
                        "--movie": options.movie})
    check_names({options.vtu: (".vtu",), options.plot: (".png", ".svg")})
    check_pictures(options.plot)
    if not several:
        check_names({options.out: (".nc",)})
    press = partial(_press_one, options=options, spec=spec, pose=pose, how=how, sensors=[])
    if several:
        return press_each(options, press, ON_LAYERS if spec.has_layers else ON_SOLIDS)
    summary, error = press(options.mesh[0], Files(options.out, options.vtu, options.plot, options.image, options.movie))
    lines = lines_on_layers if spec.has_layers else lines_on_solids
    show(summary, as_json=options.json, lines=lines(summary, verbose=options.verbose))
    if error:
        raise error


def _press_one(path, files, label="press", *, options, spec, pose, how, sensors):
    """Press a mesh and write its files; return the summary, and the error that ended it before its last load step or None.

    sensors: holds the sensor after the first press, with its prepared models
    """
    from dataclasses import replace

    import_trimesh()
    from softtact.geometry.meshes import check_over_sensor, place

    mesh, repairs = read_object(options, path)
    if spec.has_layers:
        check_over_sensor(place(mesh, pose=pose), spec.footprint_mm, name=str(path))
    if not sensors:
        sensors.append(replace(softtact.load_sensor(options.sensor, materials=_cards(options, spec), device=options.device),
                               **_quality(options)))
    sensor = replace(sensors[0], attributes={"mesh_repairs": "; ".join(repairs), **origin(options, path)})
    pressed = mesh if options.object_law is None else _soft_object(options, mesh)
    error = None
    try:
        result = sensor.press(pressed, pose=pose, **how, model=options.model, policy=options.policy, label=label,
                              tolerance_mm=options.tolerance, time_limit_s=options.time_limit, keep_body=files.vtu is not None,
                              keep_object=options.object_law is None,
                              on_step=None if files.out is None else lambda result: result.write(files.out))
    except (ConvergenceError, KeyboardInterrupt) as stop:
        if getattr(stop, "result", None) is None:
            raise
        result, error = stop.result, stop
    return _written(result, files, options, sensor), error


# Options with an effect only on the hyperelastic model, on laws (which the elastic model has none of), or on the choice.
_IDLE = {"card": ("elastic",), "mesh_quality": ("elastic", "foundation", "solid"), "device": ("elastic", "foundation", "solid"),
         "policy": MODELS[1:], "tolerance": MODELS[1:]}
_DEFAULTS = {"card": None, "mesh_quality": "default", "device": "cpu", "policy": "error", "tolerance": 0.01}
_REMEDIES = {"mesh_quality": "give a finer mesh to the sensor's file"}     # of options without effect on sensors without layers


def _refuse_idle(options, spec):
    """Refuse an option without effect: on this sensor, in the named model, or because another option is missing."""
    if not spec.has_layers and options.model not in ("auto", *spec.models):
        raise InputError(f"--model {options.model}: a sensor of kind {spec.kind}, such as {options.sensor}, is pressed "
                         f"only with the {' or the '.join(spec.models)} model; leave it out.")
    names, on, remedy = _idle_on(spec, options.model)
    for name in names:
        if getattr(options, name) != _DEFAULTS[name]:
            raise InputError(f"{_given(options, name)}: it has no effect on {on}; {remedy.get(name, 'leave it out')}.")
    for name, models in _IDLE.items():
        if spec.has_layers and options.model in models and getattr(options, name) != _DEFAULTS[name]:
            raise InputError(f"{_given(options, name)}: it has no effect on the {options.model} model; "
                             "leave it out, or choose another model.")
    if options.policy == "paper" and options.tolerance != _DEFAULTS["tolerance"]:
        raise InputError(f"--tolerance {options.tolerance:g}: it has no effect on the policy paper; leave one of the two out.")
    has_taxels = spec.has_layers and "taxels" in spec.stated_readouts
    if options.full_scale and not (options.plot and has_taxels):
        raise InputError("--full-scale: it has no effect without --plot; give --plot FILE.png, or leave it out." if has_taxels
                         else "--full-scale: it has no effect on a sensor without taxels; leave it out.")


def _idle_on(spec, model):
    """Options without effect on a sensor, what it is in words, and their remedies, where it is not to leave them out."""
    idle = ("policy", "tolerance", "mesh_quality")
    if not spec.has_layers:
        return (*idle, *(["device"] if spec.kind == "skin" else [])), f"a sensor of kind {spec.kind}", _REMEDIES
    if spec.edge.far and model == "auto":
        return (*idle, "device"), "a gel, for which auto is the elastic model, or the solid one where that cannot follow", {}
    return (), "", {}


def _given(options, name):
    """An option as it was written."""
    value = " ".join(options.card) if name == "card" else getattr(options, name)
    return f"--{name.replace('_', '-')} {value}"


def _check_soft(options, spec):
    """Refuse options of a soft object that are incomplete, or that the solid model does not have."""
    if options.object_law is None:
        if options.object_size is not None or options.object_held != _HELD:
            raise InputError("--object-size and --object-held have no effect on a rigid object; add --object-law CARD.json.")
        return
    if options.object_size is None:
        raise InputError(f"--object-law {options.object_law}: give --object-size MM, the length of the object's elements.")
    if options.model not in ("auto", "solid"):
        raise InputError(f"--model {options.model}: a soft object is pressed only with the solid model; leave it out.")
    for name in ("mesh_quality", "policy", "tolerance", *(["device"] if spec.has_layers else [])):
        if getattr(options, name) != _DEFAULTS[name]:
            raise InputError(f"{_given(options, name)}: it has no effect on a soft object; leave it out.")


def _soft_object(options, mesh: "trimesh.Trimesh") -> "SoftObject":
    """The `SoftObject` of a mesh (mm) with the law, size and held share of the command line."""
    from softtact.fem.body_mesh import mesh_body
    from softtact.materials.cards import law_from_card, load_card
    from softtact.press.objects import SoftObject

    body = mesh_body(mesh, size_mm=options.object_size)
    return SoftObject(body, law_from_card(load_card(options.object_law)), held_share=options.object_held)


def _how(options, spec):
    """Forces or a motion, by the names of `Sensor.press`."""
    if options.motion is not None:
        from softtact.contact.motion import Motion  # NumPy, which the parser does without

        motion = Motion.parse(options.motion)
        for name in ("policy", "tolerance"):
            if not motion.forces_n and getattr(options, name) != _DEFAULTS[name]:
                raise InputError(f"--{name} {getattr(options, name)}: it has no effect on a motion other than straight down by "
                                 "forces, for which auto is the hyperelastic model; leave it out.")
        if (options.mesh_quality != _DEFAULTS["mesh_quality"] and options.model == "auto" and spec.has_layers
                and (motion.turns or motion.loaded_aside)):
            raise InputError(f"{_given(options, 'mesh_quality')}: it has no effect on this motion, for which auto is not the "
                             "hyperelastic model; leave it out.")
        return {"motion": motion}
    forces = sorted(set(options.force))
    if forces != options.force:
        rising = ", ".join(f"{force:g}" for force in forces)
        print(f"softtact press: the forces are pressed in rising order, each once: {rising} N.", file=sys.stderr)
    check_forces(forces, spec)
    return {"force_n": forces}


def _quality(options):
    """Mesh and tolerances of the hyperelastic body, by the names of `Sensor`."""
    from softtact.models.hyperelastic.mesh_settings import PRESETS

    mesh, solver = PRESETS[options.mesh_quality]
    return {"mesh": mesh(), "solver": solver()}


def _written(result, files, options, sensor):
    """Write the files of a press, also of one that stopped at a load step; return its summary."""
    if files.out:
        result.write(files.out)
    if files.vtu:
        result.write_vtu(files.vtu)
    if files.plot:
        result.plot(files.plot, full_scale=options.full_scale)
    write_images(result, sensor, files.image, files.movie)
    if options.card and result.model == "elastic":
        print(f"softtact press: WARNING: --card {' '.join(options.card)} has no effect on the elastic model, which was chosen; "
              "name another model to use it.", file=sys.stderr)
    summary = summary_on_layers(result) if result.deformation_map_mm is not None else summary_on_solids(result)
    others = {name: or_none(result.readings[name].values) for name in result.readings
              if name not in ("taxels", "points") and not is_image(result.readings[name])}
    facts = {"repairs": [repair for repair in result.attributes["mesh_repairs"].split("; ") if repair], "readings": others}
    return summary | facts | summary_of_gel(result) | {"written": [str(path) for path in files.all if path]}


def _cards(options, spec):
    """{layer or region: Law} of the cards on the command line."""
    from softtact.materials.cards import law_from_card, load_card

    laws = {}
    for layer, path in pairs("--card", options.card):
        if spec.has_layers and layer not in ("dielectric", "cover"):
            raise InputError(f"--card {layer}={path}: the layer is {layer!r}; give dielectric or cover.")
        laws[layer] = law_from_card(load_card(path))
    return laws
