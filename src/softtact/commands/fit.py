"""`softtact fit`: a material card from test curves."""

import argparse
import sys
from pathlib import Path
from typing import Any

from softtact.commands.common import add_command, check_pictures, numbers, pairs, show
from softtact.errors import InputError
from softtact.outputs import check_outputs, refuse_overwriting

EXAMPLES = """
  softtact fit uniaxial=tension.csv planar=shear.csv --law all --out card.json --plot card.png
  softtact fit uniaxial=tension.csv --law neo_hooke,yeoh --window uniaxial=0.8:1.4 --out card.json
  softtact fit uniaxial=machine.csv --decimal , --skip-rows 2 --column nominal_stress_kpa=Spannung --law yeoh --out card.json
  softtact fit uniaxial=cycles.csv --cycles mullins --law yeoh --out card.json
  softtact fit uniaxial=tension.csv relaxation=relaxation.csv frequency=dma.csv --moduli relaxed --law yeoh --out card.json
  softtact fit relaxation=relaxation.csv --prony 3 --card card.json --out relaxing.json
  softtact fit polyurethane --out card.json      # a material that ships, or config/materials/NAME.yaml
"""
LAYOUTS = ("plain", "soro_db", "stress_stretch", "literature")


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "fit", _fit, "Fit hyperelastic laws to test curves and write a material card.", EXAMPLES)
    command.add_argument("curves", nargs="+", metavar="CURVES",
                         help="CSV or Excel files, one test each, MODE=FILE to state a file's mode; or one material by its name or "
                              "its YAML file")
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
    inelastic = command.add_argument_group("softening and relaxation")
    inelastic.add_argument("--cycles", choices=("first", "steady", "mullins"),
                           help="of tests with unloading: fit laws to first loading, or to the last loading of steady cycles; "
                                "mullins fits first loading, and the Mullins effect to the other rows")
    inelastic.add_argument("--prony", type=int, metavar="N",
                           help="terms of the Prony series of relaxation=FILE and frequency=FILE (default: by the data)")
    inelastic.add_argument("--moduli", choices=("instantaneous", "relaxed"),
                           help="what the laws' constants are beside a Prony series (default: as --holds, else instantaneous)")
    inelastic.add_argument("--card", type=Path, metavar="CARD.json",
                           help="card to which a Prony series is added, without other curves")
    reading = command.add_argument_group("how the files are read")
    reading.add_argument("--mode", choices=("uniaxial", "equibiaxial", "planar", "simple_shear", "volumetric"),
                         help="test mode of all the files (default: as each file or its name says)")
    reading.add_argument("--layout", choices=LAYOUTS, default="plain",
                         help="how the files are laid out (default: plain, columns named in a header; literature: a folder)")
    reading.add_argument("--column", action="append", metavar="NAME=HEADER",
                         help="a column's quantity and unit, and its header in the file; repeat it")
    reading.add_argument("--decimal", choices=(".", ","), default=".", help="decimal sign (default: the point)")
    reading.add_argument("--skip-rows", type=int, default=0, metavar="N", help="pass over N lines above the header")
    reading.add_argument("--sheet", metavar="NAME", help="sheet of an Excel workbook (.xlsx) that has several")
    reading.add_argument("--area-mm2", type=float, metavar="A", help="undeformed section, for a column of force")
    reading.add_argument("--length-mm", type=float, metavar="L", help="undeformed length, for a column of extension")
    reading.add_argument("--holds", choices=("instantaneous", "relaxed"), help="stress to take where steps relax")
    reading.add_argument("--sort", action="store_true", help="order the rows by stretch")
    reading.add_argument("--compression", action="store_true", help="a compression test written without a minus")
    command.add_argument("--plot", type=Path, metavar="FILE.png", help="draw data, fits, residuals and stable ranges")
    command.add_argument("--out", type=Path, required=True, metavar="CARD.json", help="the material card to write")


def _fit(options):
    from softtact.materials.card_making import misfit_warnings
    from softtact.materials.cards import write_card

    check_outputs(options.out, options.plot)
    config = _material(options)
    if options.skip_rows < 0:
        raise InputError(f"--skip-rows {options.skip_rows}: give the number of lines above the header, 0 or more.")
    shape, timed = _parted(options)
    refuse_overwriting(_inputs(options, config, shape, timed), {"--out": options.out, "--plot": options.plot})
    check_pictures(options.plot)
    prony = _prony_fit(options, timed)
    card, curves, tests = _elastic(options, config, shape, prony)
    reported = [*(misfit_warnings(card) if curves else ()), *(remark for curve in curves for remark in curve.remarks)]
    for name, found in (("mullins", _mullins_fit(options, card, tests)), ("prony", prony)):
        if found is not None:
            others = [text for text in card.get("warnings", []) if not text.startswith(f"{name}:")]
            card |= {name: found.entry(), "warnings": [*others, *found.warnings]}
            reported += found.warnings
    write_card(options.out, card)
    if options.plot:
        from softtact.studies.hybrid.figures.material_plot import plot_material

        plot_material(card, curves, options.plot, cycles=tests, over_time=prony.tests if prony else ())
    lines = _fit_lines(card) if curves else [*_modulus_lines(card), *_inelastic_lines(card), *prony.warnings]
    show(card, as_json=options.json, lines=[*lines, f"written: {options.out}"])
    for warning in reported:
        print(f"softtact fit: WARNING: {warning}", file=sys.stderr)


def _elastic(options, config, shape, prony):
    """(card, curves, cyclic tests): fitted to the files of shape or to a material, read from --card, or of the modulus alone."""
    from softtact.materials.card_making import card_of_modulus, make_card
    from softtact.materials.cards import load_card
    from softtact.materials.making import curves_of
    from softtact.materials.readers import read_curves, read_cycles

    if config is None and not shape and options.card is not None:
        return load_card(options.card), [], []
    if config is None and not shape:
        stated = {name: getattr(options, name) for name in ("material", "bulk_over_shear") if getattr(options, name) is not None}
        modulus = _known_modulus(options, prony)
        return card_of_modulus(modulus, sources=[test.source for test in prony.tests], **stated), [], []
    tests, settings = [], {}
    if config is not None:
        curves, settings = curves_of(config.curve_settings), config.fit_settings
    elif options.cycles:
        curves, tests = read_cycles(shape, cycles=options.cycles, window=_windows(options), **_reading(options))
    else:
        curves = read_curves(shape, window=_windows(options), **_reading(options))
    _refuse_idle(options, curves, settings)
    return make_card(curves, **settings | _fit_settings(options)), curves, tests


def _parted(options):
    """(files of shape, [(file, mode)] of tests over time). Options that have no effect on these are refused."""
    modes = [_time_mode(text) for text in options.curves]
    timed = [(text.removeprefix(f"{mode}="), mode) for text, mode in zip(options.curves, modes, strict=True) if mode]
    shape = [text for text, mode in zip(options.curves, modes, strict=True) if mode is None]
    idle = next((name for name in ("prony", "moduli", "card") if getattr(options, name) is not None), None)
    if not timed and idle:
        raise InputError(f"--{idle}: it has no effect without a test over time; add relaxation=FILE or frequency=FILE, or leave it "
                         "out.")
    if not timed:
        return shape, []
    if shape and options.card is not None:
        raise InputError(f"--card {options.card}: a new card is fitted to {shape[0]}; leave one of the two out.")
    if not shape:
        _refuse_without_shape(options)
    return shape, timed


def _time_mode(text):
    """The mode of a test over time, stated as MODE=FILE or by the file's name; None for other arguments."""
    from softtact.materials.time_tests import TIME_MODES

    head, equals, _ = text.partition("=")
    return next((mode for mode in TIME_MODES if (head if equals else Path(text).stem) == mode), None)


def _refuse_without_shape(options):
    """Refuse options of laws and curves that have no effect on tests over time alone."""
    free = ("columns", "decimal", "skip_rows", "sheet")
    idle = [name for name, value in _READING.items() if name not in free and getattr(options, name) != value]
    idle += [name for name in ("cycles", "law", "choose", "poisson", "window", "residual", "weight", "nonnegative", "small_strain",
                               *(("material", "bulk_over_shear") if options.card else ("moduli",)))
             if getattr(options, name) is not None]
    if idle:
        raise InputError(f"--{idle[0].replace('_', '-')}: it has no effect on tests over time without a curve of shape; leave it "
                         "out.")


def _known_modulus(options, prony):
    """The instantaneous shear modulus, MPa, that the tests over time tell; refused where none does."""
    if prony.shear_modulus_mpa is None:
        raise InputError(f"{options.curves[0]}: its column tells no shear modulus, so there is no law; add a curve such as "
                         "uniaxial=FILE, name the card to which the Prony series belongs (--card), or name the column "
                         "shear_modulus_mpa, young_modulus_mpa or shear_storage_modulus_mpa, if it is one.")
    return prony.shear_modulus_mpa


def _prony_fit(options, timed):
    """`PronyFit` of the tests over time; None without any."""
    from softtact.materials.prony_fitting import fit_prony
    from softtact.materials.time_tests import read_time_tests

    if not timed:
        return None
    if options.holds is not None and options.moduli not in (None, options.holds):
        raise InputError(f"--moduli {options.moduli}: the curve is the {options.holds} one by --holds; state the same in both.")
    tests = read_time_tests(timed, columns=dict(pairs("--column", options.column)), decimal=options.decimal,
                            skip_rows=options.skip_rows, sheet=options.sheet)
    return fit_prony(tests, terms=options.prony, moduli=options.moduli or options.holds or "instantaneous")


def _mullins_fit(options, card, tests):
    """`MullinsFit` of the chosen law; None unless asked for."""
    from softtact.materials.cards import law_of_entry
    from softtact.materials.cycles import fit_mullins

    if options.cycles != "mullins":
        return None
    return fit_mullins(law_of_entry(card["chosen"], card["laws"][card["chosen"]]), tests, window=_windows(options))


def _material(options):
    """The `MaterialConfig` of a material's YAML, if the argument is one; None for files of curves."""
    from softtact.materials.config import load_material
    from softtact.sensors.library import YAML, known_names, material_file

    name = options.curves[0]
    if Path(name).suffix not in YAML and (name not in known_names("materials") or Path(name).exists()):
        return None
    if len(options.curves) > 1 or _reading(options) != _READING or options.cycles is not None:
        raise InputError(f"{name}: a material's YAML names its files and options; give it without others.")
    return load_material(material_file(name))


def _inputs(options, config, shape, timed):
    """The input files."""
    from softtact.materials.readers import stated_files
    from softtact.sensors.library import material_file

    if config is not None:
        return [material_file(options.curves[0]), *config.measured_files]
    found = [path for path, _ in [*stated_files(shape, mode=options.mode, layout=options.layout), *timed]]
    return [*found, *([options.card] if options.card else [])]


_READING: dict[str, Any] = {"mode": None, "layout": "plain", "columns": {}, "sort": False, "compression": False, "decimal": ".",
                            "skip_rows": 0, "sheet": None, "area_mm2": None, "length_mm": None, "holds": None}


def _reading(options):
    """The arguments of `read_curves`."""
    of_time = _of_time_tests() if any(_time_mode(text) for text in options.curves) else set()
    columns = {name: header for name, header in pairs("--column", options.column) if name not in of_time}
    return {name: getattr(options, name) for name in _READING if name != "columns"} | {"columns": columns}


def _of_time_tests():
    """Names of columns that only tests over time have."""
    from softtact.materials.columns import FREQUENCIES, LOSS, STORAGE, TIMES

    return {*TIMES, *FREQUENCIES, *STORAGE, *LOSS, "time", "frequency", "storage_modulus", "loss_modulus",
            "shear_storage_modulus", "shear_loss_modulus"}


def _refuse_idle(options, curves, settings):
    """Refuse an option without effect, because the curve or constant that it acts on is missing."""
    volumetric = any(curve.mode == "volumetric" for curve in curves)
    if options.bulk_over_shear is not None and volumetric:
        raise InputError(f"--bulk-over-shear {options.bulk_over_shear:g}: it has no effect beside a volumetric curve, which gives "
                         "K; leave one of the two out.")
    if options.small_strain is not None and options.poisson is None and "poisson" not in settings and not volumetric:
        raise InputError(f"--small-strain {options.small_strain:g}: it has no effect without --poisson or a volumetric curve, for "
                         "then there are no linear constants; give one, or leave it out.")


def _fit_settings(options):
    """The settings of `make_card` on the command line."""
    stated = {name: getattr(options, name) for name in ("choose", "material", "poisson", "bulk_over_shear", "residual",
                                                        "nonnegative", "small_strain")}
    stated["laws"] = options.law if options.law in (None, "all") else options.law.split(",")
    stated["window"] = _windows(options) or None
    stated["weights"] = {mode: numbers("--weight", text, 1)[0] for mode, text in pairs("--weight", options.weight)} or None
    return {name: value for name, value in stated.items() if value is not None}


def _windows(options):
    """{mode: [from, to]} of --window."""
    return {mode: numbers("--window", text, 2) for mode, text in pairs("--window", options.window)}


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
    yield from _inelastic_lines(card)
    yield from card["warnings"]


def _modulus_lines(card):
    """The line on the chosen law of a card without curves of shape."""
    constants = ", ".join(f"{name} {value:.4g}" for name, value in card["laws"][card["chosen"]]["parameters"].items())
    yield f"{card['chosen']}: {constants}"


def _inelastic_lines(card):
    """Lines on the Mullins effect and the Prony series of a card."""
    if mullins := card.get("mullins"):
        yield (f"Mullins effect of {mullins['law']}: r {mullins['r']:.4g}, m {mullins['m_mpa']:.4g} MPa, beta "
               f"{mullins['beta']:.4g}; relative error {mullins['relative_error']:.1%}")
    if prony := card.get("prony"):
        yield (f"Prony series: g {', '.join(f'{g:.4g}' for g in prony['g'])} of the instantaneous modulus, tau "
               f"{', '.join(f'{tau:.4g}' for tau in prony['tau_s'])} s; relative error {prony['relative_error']:.1%}; the laws' "
               f"constants are {prony['moduli']}")


def _left_out(law):
    """The largest relative error on a mode that was left out of the fit."""
    errors = [entry["relative_error"] if entry else float("inf") for entry in law["left_out"].values()]
    return f"{max(errors):.0%}" if errors else "-"
