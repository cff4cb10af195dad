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
    origin,
    pairs,
    pose_of,
    read_object,
    sensor_path,
    show,
)
from softtact.commands.press_each import ON_LAYERS, ON_SOLIDS, Files, is_several, press_each
from softtact.commands.press_gel import add_images, check_images, gel_lines, is_image, summary_of_gel, write_images
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
    command.add_argument("--mesh-quality", choices=("default", "draft", "stable", "fine"), default="default",
                         help="mesh of the hyperelastic model: default (error 1 to 2 %% of the map's maximum), draft (2 to 5 %%, "
                              "half of the time), fine (1 %%, twice the time) or stable (for frusta pressed deeper than "
                              "half of their height)")
    command.add_argument("--device", default="cpu", metavar="DEVICE",
                         help="where the hyperelastic model sums up elements: cpu (default), cuda, or auto (a GPU if there is one)")
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
    if not several:
        check_names({options.out: (".nc",)})
    press = partial(_press_one, options=options, spec=spec, pose=pose, how=how, sensors=[])
    if several:
        return press_each(options, press, ON_LAYERS if spec.has_layers else ON_SOLIDS)
    summary, error = press(options.mesh[0], Files(options.out, options.vtu, options.plot, options.image, options.movie))
    show(summary, as_json=options.json, lines=_lines_on_layers(summary) if spec.has_layers else _lines_on_solids(summary))
    if error:
        raise error


def _press_one(path, files, label="press", *, options, spec, pose, how, sensors):
    """Press a mesh and write its files; return the summary, and the error that ended it before its last load step or None.

    sensors: holds the sensor after the first press, with its prepared models
    """
    from dataclasses import replace

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
_IDLE = {"card": ("elastic",), "mesh_quality": ("elastic", "foundation", "solid"), "device": ("elastic", "foundation"),
         "policy": MODELS[1:], "tolerance": MODELS[1:]}
_DEFAULTS = {"card": None, "mesh_quality": "default", "device": "cpu", "policy": "error", "tolerance": 0.01}
_REMEDIES = {"mesh_quality": "give a finer mesh to the sensor's file"}     # of options without effect on sensors without layers


def _refuse_idle(options, spec):
    """Refuse an option without effect: on this sensor, in the named model, or because another option is missing."""
    if not spec.has_layers:
        if options.model not in ("auto", "solid"):
            raise InputError(f"--model {options.model}: a sensor of kind {spec.kind}, such as {options.sensor}, is pressed "
                             "only with the solid model; leave it out.")
        for name in ("policy", "tolerance", "mesh_quality"):
            if getattr(options, name) != _DEFAULTS[name]:
                raise InputError(f"{_given(options, name)}: it has no effect on a sensor of kind {spec.kind}; "
                                 f"{_REMEDIES.get(name, 'leave it out')}.")
    for name, models in _IDLE.items():
        if spec.has_layers and options.model in models and getattr(options, name) != _DEFAULTS[name]:
            raise InputError(f"{_given(options, name)}: it has no effect on the {options.model} model; "
                             "leave it out, or choose another model.")
    if options.policy == "paper" and options.tolerance != _DEFAULTS["tolerance"]:
        raise InputError(f"--tolerance {options.tolerance:g}: it has no effect on the policy paper; leave one of the two out.")
    if options.full_scale and not (options.plot and spec.has_layers):
        raise InputError("--full-scale: it has no effect without --plot; give --plot FILE.png, or leave it out." if spec.has_layers
                         else "--full-scale: it has no effect on a sensor without taxels; leave it out.")


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
    for name in ("mesh_quality", "policy", *(["device"] if spec.has_layers else [])):
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
        return {"motion": motion}
    forces = sorted(set(options.force))
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
    summary = _summary_on_layers(result) if result.deformation_map_mm is not None else _summary_on_solids(result)
    others = {name: _or_none(reading.values) for name, reading in result.readings.items()
              if name not in ("taxels", "points") and not is_image(reading)}
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


def _summary_on_layers(result):
    """The results of a press at each load step, as plain JSON values."""
    load_steps = {"normal_force_n": result.normal_force_n, "force_n": result.force_n, "indentation_mm": result.indentation_mm,
              "contact_area_mm2": result.contact_area_mm2,
              "largest_deformation_mm": result.deformation_map_mm.max(axis=(1, 2))}
    if "taxels" in result.readings:
        load_steps |= {"tactile_map": result.tactile_map, "taxels_at_range_end": result.taxels_at_range_end}
    names = ("penetration_mm", "frustum_compression_mm", "residual_n", "extrapolated_volume_fraction", "expected_error_mm",
             "within_validity", "validity_reason", "iterations", "wall_time_s")
    load_steps |= {name: getattr(result, name) for name in names}
    load_steps |= {name: getattr(result, name) for name in ("torque_nmm", "hyperelastic_counts", "expected_error_counts")}
    facts = {name: getattr(result, name) for name in ("model", "solver", "selection_reason")}
    facts["expected_error_interval"] = ([result.attributes[f"expected_error_times_{end}"] for end in ("low", "high")]
                                        if "expected_error_times_low" in result.attributes else None)
    facts["expected_error_calibrated_on"] = result.attributes.get("expected_error_calibrated_on")
    facts |= {"sensor": result.sensor, "largest_counts": result.largest_counts}
    return facts | _times(result) | {name: _or_none(values) for name, values in load_steps.items()}


def _times(result):
    """The steps' times, where they have durations."""
    return {} if result.time_s is None else {"time_s": _or_none(result.time_s)}


def _time_column(summary):
    """Head and cells of a column of the steps' times; without durations empty."""
    times = summary.get("time_s")
    return (f"{'time, s':>10}", [f"{time:10.4g}" for time in times]) if times else ("", [""] * len(summary["iterations"]))


def _summary_on_solids(result):
    """The results of a press on a sensor of kind solid at each load step, as plain JSON values."""
    import numpy as np

    values = {"load": result.load("object"), "way_mm": result.frame_way_mm[:, result.frames.index("object")],
              "largest_displacement_mm": np.nanmax(np.linalg.norm(result.displacement_mm, axis=2), axis=1),
              "largest_pressure_mpa": np.nanmax(result.contact_pressure_mpa, axis=(1, 2))}
    names = ("volume_ratio_range", "stretch_range", "extrapolated_volume_fraction", "penetration_mm", "residual_n", "iterations",
             "increments", "reading_points_mm", "reading_displacement_mm", "reading_pressure_mpa", "wall_time_s")
    return {"model": result.model} | _times(result) | {name: _or_none(value) for name, value in
                                      (values | {name: getattr(result, name) for name in names}).items()}


def _or_none(values):
    """Numbers as lists, with null for nan, which JSON does not have; nan marks values that a model does not compute."""
    if values.ndim > 1:
        return [_or_none(row) for row in values]
    return [None if value != value else value for value in values.tolist()]


def _lines_on_layers(summary):
    yield f"model: {summary['model']}, linear solver: {summary['solver']}"
    if summary["selection_reason"]:
        yield f"chosen because: {summary['selection_reason']}"
    if "tactile_map" not in summary:
        yield from gel_lines(summary)
        yield from _quality_lines(summary)
        return
    head, times = _time_column(summary)
    yield f"{head}{'force, N':>10}{'indentation, mm':>18}{'contact, mm2':>15}{'deepest, mm':>14}{'counts, sum':>14}"
    names = ("normal_force_n", "indentation_mm", "contact_area_mm2", "largest_deformation_mm")
    counts = (sum(map(sum, one)) for one in summary["tactile_map"])
    for time, force, depth, area, deepest, total in zip(times, *(summary[name] for name in names), counts, strict=True):
        yield f"{time}{force:10.4g}{depth:18.4f}{area:15.1f}{deepest:14.4f}{total:14.0f}"
    yield from _quality_lines(summary)


def _error_line(summary):
    """The expected error of a fast model against the hyperelastic model, with an interval for the true error."""
    interval, expected_um = summary["expected_error_interval"], 1e3 * max(summary["expected_error_mm"])
    if interval is None:
        return
    low, high = (factor * expected_um for factor in interval)
    known_of = summary["expected_error_calibrated_on"]
    other = f"; calibrated on the sensor {known_of}, not on {summary['sensor']}" if known_of != summary["sensor"] else ""
    yield (f"error to expect against the hyperelastic model: {expected_um:.2g} um ({low:.2g} to {high:.2g}), root mean square over "
           f"the map{other}")


def _range_line(summary):
    """The load steps at which taxels read the end of the converter's range: there the true change is larger than the counts."""
    numbers = summary.get("taxels_at_range_end", [])
    if any(numbers):
        steps = ", ".join(f"{number:g} at {force:.4g} N" for number, force in zip(numbers, summary["normal_force_n"], strict=True)
                          if number)
        yield f"taxels at the end of the converter's range ({summary['largest_counts']:g} counts), which read too little: {steps}"


def _count_lines(summary):
    """The error to expect in counts of all taxels, at each load step."""
    steps = zip(summary["normal_force_n"], summary["tactile_map"], summary["hyperelastic_counts"], strict=True)
    for force, counts, (low, middle, high) in steps:
        read = sum(map(sum, counts))
        share = f", {abs(read - middle) / read:.0%} {'less' if read > middle else 'more'}" if read > 0 else ""
        yield f"counts to expect of the hyperelastic model at {force:.4g} N: {middle:.0f} ({low:.0f} to {high:.0f}){share}"


def _validity_lines(summary):
    """The forces of the flagged load steps, a line for each reason."""
    from softtact.press.validity import by_reason

    for reason, forces in by_reason(*(summary[name] for name in ("normal_force_n", "within_validity", "validity_reason"))).items():
        yield f"beyond what the model is valid for: {', '.join(f'{force:.4g}' for force in forces)} N: {reason}"


def _quality_lines(summary):
    """The quality of the solution, as the worst of the load steps."""
    yield f"iterations: {sum(summary['iterations'])}; deepest overlap in a contact: {1e3 * max(summary['penetration_mm']):.2g} um"
    if None not in summary["residual_n"]:
        yield f"largest unbalanced nodal force: {max(summary['residual_n']):.2g} N"
    if None not in summary["frustum_compression_mm"]:
        yield f"most compressed frustum: {max(summary['frustum_compression_mm']):.3f} mm"
    if None not in summary["expected_error_mm"]:
        yield from _error_line(summary)
    if None not in summary["expected_error_counts"]:
        yield from _count_lines(summary)
    yield from _range_line(summary)
    yield from _validity_lines(summary)
    if None not in summary["extrapolated_volume_fraction"]:
        yield f"strained beyond the data behind its law: {max(summary['extrapolated_volume_fraction']):.1%} of a layer"
    yield from (f"written: {path}" for path in summary["written"])


def _lines_on_solids(summary):
    head, times = _time_column(summary)
    yield f"{head}{'force x, y, z, N':>33}{'displacement x, y, z, mm':>33}{'most moved, mm':>16}{'pressure, MPa':>15}"
    names = ("load", "way_mm", "largest_displacement_mm", "largest_pressure_mpa")
    for time, load, displacement, moved, pressure in zip(times, *(summary[name] for name in names), strict=True):
        yield time + "".join(f"{value:11.3g}" for value in (*load[:3], *displacement)) + f"{moved:16.4f}{pressure:15.4g}"
    if summary["reading_points_mm"]:
        yield "readings at the last step:"
        yield f"{'point x, y, z, mm':>33}{'displacement x, y, z, mm':>33}{'pressure, MPa':>15}"
        read = (summary[f"reading_{name}"][-1] for name in ("displacement_mm", "pressure_mpa"))
        for point, moved, pressure in zip(summary["reading_points_mm"], *read, strict=True):
            shown = "-" if pressure is None else f"{pressure:.4g}"
            yield "".join(f"{value:11.3g}" for value in (*point, *moved)) + f"{shown:>15}"
    yield f"iterations: {sum(summary['iterations'])}; deepest overlap in a contact: {1e3 * max(summary['penetration_mm']):.2g} um"
    yield f"largest unbalanced force: {max(summary['residual_n']):.2g} N"
    if None not in summary["extrapolated_volume_fraction"]:
        yield f"strained beyond the data behind its law: {max(summary['extrapolated_volume_fraction']):.1%} of a region"
    yield from (f"written: {path}" for path in summary["written"])
