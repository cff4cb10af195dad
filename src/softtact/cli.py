"""The command `softtact`: press a mesh, score it, fit curves, export a deck, measure contact discs, run a stage.

What the user can mend ends with one sentence on stderr: exit status 2 for a wrong command line, 1 for a refusal.
Heavy imports stand inside the commands, so that `softtact --help` answers at once.
"""

import argparse
import json
import sys
from pathlib import Path

import softtact
from softtact.errors import ConvergenceError, InputError, SofttactError

UNITS = ("mm", "cm", "m", "inch")
MODELS = ("auto", "elastic", "foundation", "hyperelastic")
DECK_FORMATS = ("calculix", "abaqus")


def main(arguments=None):
    """Run one command; return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except SofttactError as error:
        print(f"softtact {options.command}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"softtact {options.command}: interrupted; nothing was written.", file=sys.stderr)
        return 130
    return 0


class _Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one sentence."""

    def error(self, message):
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help.\n")


def _parser():
    parser = _Parser(prog="softtact", description=softtact.__doc__)
    parser.add_argument("--version", action="version", version=f"softtact {softtact.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (_add_press, _add_complexity, _add_fit, _add_export_deck, _add_detect_discs, _add_stage):
        add(commands)
    return parser


def _add_command(commands, name, run, summary):
    command = commands.add_parser(name, help=summary, description=summary)
    command.set_defaults(run=run)
    if name != "stage":
        command.add_argument("--json", action="store_true", help="print the result as JSON")
    return command


def _add_mesh(command):
    command.add_argument("mesh", metavar="MESH", type=Path, help="STL, OBJ or PLY file of a closed body")
    command.add_argument("--unit", required=True, choices=UNITS, help="the mesh's unit; the file itself does not say")
    command.add_argument("--pose", metavar="x,y,z,rx,ry,rz",
                         help="the mesh's origin in the sensor's frame, mm and degrees (default: centred, touching); "
                              "write --pose=-1,... where it begins with a minus")
    command.add_argument("--sensor", default="coro", help="name or YAML file of a sensor (default: coro)")


def _print(result, *, as_json, lines):
    """`result` as JSON, or the lines for people."""
    print(json.dumps(result, indent=2) if as_json else "\n".join(lines))


def _add_press(commands):
    command = _add_command(commands, "press", _press, "Press a mesh on the sensor: deformation map and taxels.")
    _add_mesh(command)
    command.add_argument("--force", type=float, action="append", required=True, metavar="N",
                         help="force in N; repeat it for several levels")
    command.add_argument("--model", choices=MODELS, default="auto",
                         help="auto takes the one that the policy asks for (default)")
    command.add_argument("--policy", choices=("paper", "error"), default="paper",
                         help="of auto: the mesh's complexity as in the paper (default), or the error to expect")
    command.add_argument("--tolerance", type=float, default=0.01, metavar="MM",
                         help="of --policy error: root mean square over the map, in mm (default: 0.01)")
    command.add_argument("--card", action="append", metavar="LAYER=CARD.json",
                         help="a card of `softtact fit` for the dielectric or the cover, in place of the printed constants")
    command.add_argument("--out", type=Path, metavar="FILE.nc", help="write the maps as NetCDF")
    command.add_argument("--plot", type=Path, metavar="FILE.png", help="draw deformation map and taxels")


def _press(options):
    from softtact.geometry.meshes import check_over_sensor, place, read_mesh

    spec, forces, pose = _sensor_spec(options.sensor), sorted(set(options.force)), _pose(options)
    _check_forces(forces, spec)
    _check_folders(options.out, options.plot)
    mesh = read_mesh(options.mesh, unit=options.unit)
    check_over_sensor(place(mesh, pose=pose), spec.footprint_mm, name=str(options.mesh))
    try:
        sensor = softtact.load_sensor(options.sensor, materials=_cards(options))
        result = sensor.press(mesh, pose=pose, force_n=forces, model=options.model,
                                                              policy=options.policy, tolerance_mm=options.tolerance)
    except ConvergenceError as error:
        if error.result is not None:
            _show_press(error.result, options)
        raise
    _show_press(result, options)


def _show_press(result, options):
    """Write and print what a press gave, be it the levels before one that was not reached."""
    if options.out:
        result.write(options.out)
    if options.plot:
        from softtact.reporting.press_plot import plot_press

        plot_press(result, options.plot)
    summary = _press_summary(result)
    _print(summary, as_json=options.json, lines=_press_lines(summary))


def _cards(options):
    """{layer: Law} of the cards given on the command line."""
    from softtact.materials.cards import law_from_card, load_card

    laws = {}
    for layer, path in _pairs("--card", options.card):
        if layer not in ("dielectric", "cover"):
            raise InputError(f"--card {layer}={path}: the layer is {layer!r}; give dielectric or cover.")
        laws[layer] = law_from_card(load_card(path))
    return laws


def _check_forces(forces, spec):
    """Refuse a force that the sensor does not bear, before a mesh is read or a solver loaded."""
    low, high = spec.force_range_n
    for force in forces:
        if not low < force <= high:
            raise InputError(f"--force {force:g}: {force:g} N is out of the range of sensor {spec.name}; "
                             f"give a force above {low:g} N and up to {high:g} N.")


def _press_summary(result):
    """What a press gave at each force, as plain JSON values."""
    levels = {"force_n": result.force_n, "indentation_mm": result.indentation_mm,
              "contact_area_mm2": result.contact_area_mm2,
              "largest_deformation_mm": result.deformation_map_mm.max(axis=(1, 2)),
              "tactile_map": result.tactile_map}
    names = ("penetration_mm", "frustum_compression_mm", "residual_n", "outside_card", "expected_error_mm", "within_validity",
             "iterations", "wall_time_s")
    levels |= {name: getattr(result, name) for name in names}
    facts = {name: getattr(result, name) for name in ("model", "solver", "why")}
    return facts | {name: _or_none(values) for name, values in levels.items()}


def _or_none(values):
    """Numbers as lists; what a model does not tell, nan, as null: JSON has no nan."""
    return [None if value != value else value for value in values.tolist()] if values.ndim == 1 else values.tolist()


def _press_lines(summary):
    yield f"model: {summary['model']}, linear solver: {summary['solver']}"
    if summary["why"]:
        yield f"chosen because: {summary['why']}"
    yield f"{'force, N':>10}{'indentation, mm':>18}{'contact, mm2':>15}{'deepest, mm':>14}{'counts, sum':>14}"
    names = ("force_n", "indentation_mm", "contact_area_mm2", "largest_deformation_mm", "tactile_map")
    for force, depth, area, deepest, counts in zip(*(summary[name] for name in names), strict=True):
        yield f"{force:10.4g}{depth:18.4f}{area:15.1f}{deepest:14.4f}{sum(map(sum, counts)):14.0f}"
    yield from _quality_lines(summary)


def _quality_lines(summary):
    """How well the levels were solved, by the worst of them."""
    yield f"iterations: {sum(summary['iterations'])}; deepest overlap in a contact: {1e3 * max(summary['penetration_mm']):.2g} um"
    if None not in summary["residual_n"]:
        yield f"largest unbalanced nodal force: {max(summary['residual_n']):.2g} N"
    if None not in summary["frustum_compression_mm"]:
        yield f"most compressed frustum: {max(summary['frustum_compression_mm']):.3f} mm"
    if None not in summary["expected_error_mm"]:
        yield f"error to expect against the hyperelastic model: {1e3 * max(summary['expected_error_mm']):.2g} um, root mean square"
    if not all(summary["within_validity"]):
        forces = ", ".join(f"{force:g}" for force, valid in zip(summary["force_n"], summary["within_validity"], strict=True)
                           if not valid)
        yield f"beyond what the model is valid for: {forces} N"
    if None not in summary["outside_card"]:
        yield f"strained beyond the data behind its law: {max(summary['outside_card']):.1%} of a layer"


def _pose(options):
    from softtact.geometry.pose import Pose

    return Pose.parse(options.pose) if options.pose else None


def _check_folders(*paths):
    """Refuse now what could not be written after a long press."""
    for path in paths:
        if path and not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}; make it first.")


def _add_complexity(commands):
    command = _add_command(commands, "complexity", _complexity, "Count a mesh's complexity and choose its model.")
    _add_mesh(command)
    command.add_argument("--rule", choices=("any", "all"), default="any",
                         help="which of the two criteria the hyperelastic model takes (default: any)")


def _complexity(options):
    from softtact.geometry.complexity import choose_model, score_file

    spec = _sensor_spec(options.sensor)
    counts = score_file(options.mesh, unit=options.unit, footprint_mm=spec.footprint_mm, pose=_pose(options),
                        reach_mm=spec.thickness_mm)
    four = {"NPt": counts.NPt, "CHt": counts.CHt, "NPo": counts.NPo, "CHo": counts.CHo}
    result = four | {"ratio_total": counts.ratio_total, "ratio_overlap": counts.ratio_overlap}
    result["model"] = choose_model(**four, rule=options.rule)
    _print(result, as_json=options.json, lines=[f"{name:14}{_short(value)}" for name, value in result.items()])


def _add_fit(commands):
    command = _add_command(commands, "fit", _fit, "Fit hyperelastic laws to test curves and write a material card.")
    command.add_argument("curves", nargs="+", metavar="CURVES",
                         help="CSV files, one test each, MODE=FILE to state a file's mode; or one YAML file of a material")
    command.add_argument("--law", help="a law's name, several with commas, or all (default)")
    command.add_argument("--choose", help="the law that solvers take (default: best of the ranking)")
    command.add_argument("--material", help="the material's name in the card")
    command.add_argument("--poisson", type=float, help="Poisson's ratio of the linear constants (default: from a volumetric curve)")
    command.add_argument("--bulk-over-shear", type=float, metavar="RATIO",
                         help="K / mu0 where no volumetric curve is given (default: 20)")
    command.add_argument("--window", action="append", metavar="MODE=FROM:TO", help="stretches of a mode to use; repeat it")
    command.add_argument("--residual", choices=("absolute", "relative"), help="errors in MPa (default) or over the stress")
    command.add_argument("--weight", action="append", metavar="MODE=W", help="weight of a mode's squared errors; repeat it")
    command.add_argument("--nonnegative", action="store_true", default=None, help="keep constants in MPa from being negative")
    command.add_argument("--small-strain", type=float, metavar="E", help="strain up to which E is the slope (default: 0.1)")
    reading = command.add_argument_group("how the files are read")
    reading.add_argument("--mode", choices=("uniaxial", "equibiaxial", "planar", "volumetric"),
                         help="test mode of all the files (default: as each file or its name says)")
    reading.add_argument("--layout", choices=("plain", "soro_db", "stress_stretch", "literature"), default="plain",
                         help="how the files are laid out (default: plain, columns named in a header; literature: a folder)")
    reading.add_argument("--column", action="append", metavar="NAME=HEADER",
                         help="a column's quantity and unit, and the file's own name of it; repeat it")
    reading.add_argument("--sort", action="store_true", help="order the rows by stretch")
    reading.add_argument("--compression", action="store_true", help="a compression test written without a minus")
    command.add_argument("--plot", type=Path, metavar="FILE.png", help="draw data, fits, residuals and stable ranges")
    command.add_argument("--out", type=Path, required=True, metavar="CARD.json", help="the material card to write")


def _fit(options):
    from softtact.files import write_json
    from softtact.materials.cards import make_card
    from softtact.materials.readers import read_curves

    _check_folders(options.out, options.plot)
    if Path(options.curves[0]).suffix in (".yaml", ".yml"):
        curves, settings = _yaml_curves(options)
    else:
        curves, settings = read_curves(options.curves, **_reading(options)), {}
    card = make_card(curves, **settings | _fit_settings(options))
    write_json(options.out, card)
    if options.plot:
        from softtact.reporting.material_plot import plot_material

        plot_material(card, curves, options.plot)
    _print(card, as_json=options.json, lines=[*_fit_lines(card), f"written: {options.out}"])


def _reading(options):
    """How the files are read, as `read_curves` takes it."""
    return {"mode": options.mode, "layout": options.layout, "columns": dict(_pairs("--column", options.column)),
            "sort": options.sort, "compression": options.compression}


def _yaml_curves(options):
    """Curves and fit settings of a material's YAML."""
    from softtact.materials.config import load_material
    from softtact.materials.making import curves_of

    if len(options.curves) > 1 or any(_reading(options)[key] for key in ("mode", "columns", "sort", "compression")):
        raise InputError(f"{options.curves[0]}: a material's YAML says itself what its files are; give it alone.")
    config = load_material(options.curves[0])
    return curves_of(config.curve_settings), config.fit_settings


def _fit_settings(options):
    """What the command line says of the fit, as `make_card` takes it."""
    stated = {name: getattr(options, name) for name in ("choose", "material", "poisson", "bulk_over_shear", "residual",
                                                        "nonnegative", "small_strain")}
    stated["laws"] = options.law if options.law in (None, "all") else options.law.split(",")
    stated["window"] = {mode: _numbers("--window", text, 2) for mode, text in _pairs("--window", options.window)} or None
    stated["weights"] = {mode: _numbers("--weight", text, 1)[0] for mode, text in _pairs("--weight", options.weight)} or None
    return {name: value for name, value in stated.items() if value is not None}


def _pairs(option, texts):
    """(name, value) of texts NAME=VALUE."""
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise InputError(f"{option} {text}: write it as NAME=VALUE.")
        yield name, value


def _numbers(option, text, count):
    """`count` numbers with colons between them."""
    try:
        values = [float(part) for part in text.split(":")]
    except ValueError:
        values = []
    if len(values) != count or sorted(values) != values:
        wanted = "a number" if count == 1 else "two rising numbers with a colon between them"
        raise InputError(f"{option} MODE={text}: {text!r} is not {wanted}; correct it.")
    return values


def _fit_lines(card):
    yield (f"{'law':20}{'RMSE, MPa':>11}{'relative':>10}{'left out':>10}{'mu0, MPa':>10}"
           "  stable in uniaxial, equibiaxial, planar stretch")
    for name in card["ranking"]:
        law = card["laws"][name]
        ranges = ", ".join(f"{low:.2f}-{high:.3g}" for low, high in law["stable_range"].values())
        note = "  <- chosen" if name == card["chosen"] else "" if law["stable_over_data"] else "  UNSTABLE over the data"
        yield (f"{name:20}{law['rmse_mpa']:11.4g}{law['relative_error']:10.1%}{_left_out(law):>10}{law['mu0_mpa']:10.4g}"
               f"  {ranges}{note}")
    yield f"bulk modulus: {card['bulk_source']}"
    yield from card["warnings"]


def _left_out(law):
    """The worst relative error on a mode that the law did not see."""
    errors = [entry["relative_error"] if entry else float("inf") for entry in law["left_out"].values()]
    return f"{max(errors):.0%}" if errors else "-"


def _add_export_deck(commands):
    command = _add_command(commands, "export-deck", _export_deck,
                           "Write the hyperelastic press of a mesh as an input deck for another solver.")
    _add_mesh(command)
    command.add_argument("--force", type=float, action="append", required=True, metavar="N",
                         help="force in N; repeat it for several steps")
    command.add_argument("--format", choices=DECK_FORMATS, required=True, help="the solver that is to read the deck")
    command.add_argument("--control", choices=("force", "indentation"), default="force",
                         help="push with the forces (default), or follow the indentations that softtact finds at them, "
                              "which it solves first")
    command.add_argument("--out", type=Path, required=True, metavar="DECK.inp", help="the deck to write")


def _export_deck(options):
    from softtact.geometry.meshes import check_over_sensor, place, read_mesh

    spec, forces, pose = _sensor_spec(options.sensor), sorted(set(options.force)), _pose(options)
    _check_forces(forces, spec)
    _check_folders(options.out)
    mesh = read_mesh(options.mesh, unit=options.unit)
    check_over_sensor(place(mesh, pose=pose), spec.footprint_mm, name=str(options.mesh))
    from softtact.decks.export import export_press

    model = export_press(softtact.load_sensor(options.sensor), mesh, pose=pose, force_n=forces, control=options.control,
                         dialect=options.format, path=options.out, name=options.mesh.name)
    result = {"deck": str(options.out), "format": options.format, "nodes": len(model.points),
              "elements": {part.name: len(part.elements) for part in model.parts}, "tied_nodes": len(model.ties),
              "facets": {body.name: len(body.facets) for body in model.rigid}, "steps": [step.name for step in model.steps]}
    lines = [f"{name}: {value}" for name, value in result.items() if name != "deck"]
    _print(result, as_json=options.json, lines=[*lines, f"written: {options.out}"])


def _add_detect_discs(commands):
    command = _add_command(commands, "detect-discs", _detect_discs,
                           "Measure the bright contact discs in camera frames: table and annotated pictures.")
    command.add_argument("frames", metavar="FRAMES", type=Path, help="an image, a multi-page TIFF, a video, or a folder of images")
    command.add_argument("--out", type=Path, required=True, metavar="DISCS.csv", help="the table to write, one row per disc")
    command.add_argument("--pixel-mm", type=float, metavar="MM", help="side of a pixel on the glass")
    command.add_argument("--calibration-mm", type=float, metavar="MM", help="instead: a known length in the picture, and")
    command.add_argument("--calibration-px", type=float, metavar="PX", help="how many pixels it is long")
    command.add_argument("--min-diameter-mm", type=float, default=0.0, metavar="MM", help="leave smaller discs out")
    command.add_argument("--every", type=int, default=1, metavar="N", help="take each N-th frame only (default: 1)")
    command.add_argument("--picture", type=Path, metavar="PATH",
                         help="the annotated picture (PNG), or for several frames the folder of theirs "
                              "(default: named after the table, beside it)")
    command.add_argument("--no-picture", action="store_true", help="draw none")


def _detect_discs(options):
    pixel_mm = _pixel_mm(options)
    _check_detect_discs(options)
    _check_folders(options.out, options.picture)
    from softtact.reporting.disc_report import report_discs

    picture = None if options.no_picture else options.picture or options.out.with_suffix("")
    summary = report_discs(options.frames, options.out, picture=picture, pixel_mm=pixel_mm,
                           smallest_mm=options.min_diameter_mm, every=options.every)
    _print(summary, as_json=options.json, lines=_detect_discs_lines(summary))


def _pixel_mm(options):
    """Side of a pixel in mm, from the one way in which the user gave it."""
    calibration = (options.calibration_mm, options.calibration_px)
    if (options.pixel_mm is None) == (calibration == (None, None)) or (None in calibration and calibration != (None, None)):
        raise InputError("the scale is not clear; give either --pixel-mm, or both --calibration-mm and --calibration-px.")
    for name in ("pixel_mm", "calibration_mm", "calibration_px"):
        value = getattr(options, name)
        if value is not None and not 0 < value < float("inf"):
            raise InputError(f"--{name.replace('_', '-')} {value:g}: a length must be above 0; measure it again.")
    return options.pixel_mm or options.calibration_mm / options.calibration_px


def _check_detect_discs(options):
    if options.every < 1:
        raise InputError(f"--every {options.every}: give 1 for all frames, 2 for each second one, and so on.")
    if not 0 <= options.min_diameter_mm < float("inf"):
        raise InputError(f"--min-diameter-mm {options.min_diameter_mm:g}: a diameter cannot be below 0; give one in mm.")
    if options.out.suffix.lower() != ".csv":
        raise InputError(f"{options.out}: the table is written as CSV; give a name that ends in .csv.")


def _detect_discs_lines(summary):
    frames, discs = summary["frames"], sum(frame["discs"] for frame in summary["frames"])
    yield f"frames: {len(frames)}, discs: {discs}, a pixel is {summary['pixel_mm']:.4g} mm"
    yield f"{'frame':24}{'discs':>7}{'mean area, mm2':>16}{'total area, mm2':>17}{'clipped':>9}{'touching':>10}"
    for frame in frames if len(frames) <= 20 else [*frames[:10], None, *frames[-10:]]:
        yield "..." if frame is None else (
            f"{frame['frame']:24}{frame['discs']:7d}{frame['mean_area_mm2'] or 0:16.4f}{frame['total_area_mm2']:17.4f}"
            f"{frame['clipped']:9d}{frame['touching']:10d}")
    yield from (f"written: {summary[name]}" for name in ("table", "picture") if summary[name])


def _add_stage(commands):
    from softtact.stages.__main__ import add_arguments

    add_arguments(_add_command(commands, "stage", _stage, "Run one stage of the workflow on files, as its rule does."))


def _stage(options):
    from softtact.stages.__main__ import run_stage

    run_stage(options)


def _sensor_spec(name):
    """The description of a sensor by its name or its YAML file, without its solvers."""
    from softtact.config import sensor_file
    from softtact.geometry.sensor_spec import SensorSpec

    return SensorSpec.from_yaml(sensor_file(name))


def _short(value):
    return f"{value:.4g}" if isinstance(value, float) else str(value)

