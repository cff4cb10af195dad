"""Making a material card: the laws are fitted, judged and compared (docs/reference/materials.md).

A card reports how its laws differ within the data and just outside, and how well a law that is fitted to some tests predicts
another. The difference of two laws on a path is the root mean square of the difference of their nominal stresses over
that of their mean.
"""

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softtact.errors import InputError
from softtact.materials.cards import law_of_entry, linear_from_card
from softtact.materials.checks import refuse_mixed_units
from softtact.materials.consistency import SCAN, against_linear, covers, printed_warnings, stable_ranges
from softtact.materials.curves import (
    VOLUMETRIC,
    AnyCurve,
    common_kind,
    join_by_mode,
    path_of,
    path_window,
    principal_window,
    refuse_idle,
)
from softtact.materials.fitting import STARTS, FitOptions, errors_of, fit_law, law_names
from softtact.materials.laws.base import SIMPLE_SHEAR, TEST_PATHS, Law
from softtact.materials.linear import LinearConstants, bulk_modulus, poisson_ratio, small_strain_constants, young_modulus
from softtact.progress import progress

_SYSTEMATIC = 0.7   # autocorrelation from which residuals are the law's misfit; noise gives 0 +- 1/sqrt(points)
_NOTABLE = 0.01     # relative error from which that is reported
# Root mean square error over stress above which a card does not describe its curves. Fits of published rubbers have 1 to 17 %, and
# 25 to 46 % only for few constants over a large range, or a coarse load cell over a small one.
LARGEST_ERROR = 0.25

_BOUNDS = {"bulk_over_shear": (2 / 3, np.inf), "poisson": (-1.0, 0.5), "small_strain": (0.0, 1.0)}
THRESHOLD = 0.2     # laws that differ by more are named
MARGIN = 0.1        # width of "just outside", as a share of the window's extent in log stretch
_POINTS = 33


@dataclass(frozen=True)
class CardOptions:
    """Options of a card.

    laws: list of names, or "all"
    choose: the law that the solvers take, or "best": the first of the ranking
    bulk_over_shear: K / mu0, without a volumetric test
    poisson: Poisson's ratio of the linear constants; without it, it follows from a volumetric test, or the card has none
    small_strain: strain up to which E is the slope of the uniaxial curve
    window: {mode: [min, max]} stretch (volume ratio) to use, all by default
    residual, weights, nonnegative, starts, seed: see `softtact.materials.fitting.FitOptions`
    predict_left_out: fit each law also to all modes but one, and report its error for that one
    disagreement: difference of two laws' stresses, as a share, beyond which they are named
    """

    laws: str | list = "all"
    choose: str = "best"
    bulk_over_shear: float = 20.0
    poisson: float | None = None
    small_strain: float = 0.1
    window: dict = field(default_factory=dict)
    residual: str = "absolute"
    weights: dict = field(default_factory=dict)
    nonnegative: bool = False
    starts: int = STARTS
    seed: int = 0
    predict_left_out: bool = True
    disagreement: float = THRESHOLD

    def __post_init__(self):
        for name, (low, high) in _BOUNDS.items():
            value = getattr(self, name)
            if value is not None and not low < value < high:
                raise InputError(f"{name} is {value:g}; give a value above {low:.3g} and below {high:g}.")
        if not self.laws:
            raise InputError(f"laws is {self.laws!r}; name one law at least, or all of them (\"all\").")

    @property
    def fit(self) -> dict[str, Any]:
        """The part that `FitOptions` takes."""
        return {name: getattr(self, name) for name in FitOptions.__dataclass_fields__}


def make_card(curves: Sequence[AnyCurve], *, material: str = "material", printed: dict[str, Any] | None = None,
              **options: Any) -> dict[str, Any]:
    """Fit the laws to the curves and return the card as a dict, ready for `write_json`.

    curves: of the tests;  options: those of `CardOptions`
    printed: constants published for the material, {law: {"parameters": {...}}}, checked against each other
    """
    settings = CardOptions(**options)
    refuse_mixed_units(curves)
    refuse_idle(settings.window, settings.weights, modes=[curve.mode for curve in curves])
    curves = _windowed(join_by_mode(curves), settings.window)
    shape: list[Any] = [curve for curve in curves if curve.mode != VOLUMETRIC]
    volumetric: Any = next((curve for curve in curves if curve.mode == VOLUMETRIC), None)
    bulk = bulk_modulus(volumetric, bulk_over_shear=settings.bulk_over_shear)
    if not shape:
        raise InputError("There is only a volumetric curve; give a uniaxial, equibiaxial, planar or simple_shear one for shape.")
    fits, entries = {}, {}
    for name in progress(law_names(settings.laws), label="laws"):
        fits[name] = fit_law(name, shape, **settings.fit)
        entries[name] = _law_entry(fits[name], shape, bulk, settings)
    ranking = sorted(entries, key=lambda name: (not entries[name]["stable_over_data"], entries[name]["aicc"]))
    chosen = _choose(settings.choose, ranking, entries)
    linear, linear_warnings = _linear_entry(shape, bulk, settings)
    card: dict[str, Any] = {
        "material": material,
        "kind": common_kind(curves),
        "curves": [_curve_entry(curve) for curve in curves],
        "strain_window": {curve.mode: list(curve.window) for curve in curves},
        "bulk_source": bulk.source,
        "chosen": chosen,
        "ranking": ranking,
        "laws": entries | linear,
        "agreement": _agreement(entries, shape),
    }
    card["warnings"] = [*misfit_warnings(card), *(remark for curve in curves for remark in curve.remarks), *bulk.warnings]
    card["warnings"] += [sentence for name, fit in fits.items() for sentence in _fit_warnings(fit, entries[name])]
    card["warnings"] += [*_systematic(fits.values())]
    card["warnings"] += linear_warnings + _consistency_warnings(card, settings.disagreement)
    if printed:
        card["printed"] = printed
        card["warnings"] += printed_warnings(printed, bulk_over_shear=settings.bulk_over_shear)
    return card


def card_of_modulus(shear_modulus_mpa: float, *, sources: Sequence[str], material: str = "material",
                    bulk_over_shear: float = 20.0) -> dict[str, Any]:
    """The card of a material of which tests tell the shear modulus at small strain alone: neo-Hooke, with K / mu0 as stated."""
    bulk = bulk_modulus(None, bulk_over_shear=CardOptions(bulk_over_shear=bulk_over_shear).bulk_over_shear)
    modulus = bulk.of(shear_modulus_mpa)
    entry = {"parameters": {"c10": shear_modulus_mpa / 2}, "mu0_mpa": shear_modulus_mpa, "bulk_modulus_mpa": modulus,
             "d_per_mpa": [2 / modulus], "d_source": bulk.source,
             "small_strain": small_strain_constants(shear_modulus_mpa, modulus)}
    return {"material": material, "kind": "measured", "curves": [{"source": source} for source in sources], "strain_window": {},
            "bulk_source": bulk.source, "chosen": "neo_hooke", "ranking": ["neo_hooke"], "laws": {"neo_hooke": entry},
            "warnings": ["No curve of shape was given: neo_hooke has the shear modulus of small strains, and holds for these."]}


def misfit_warnings(card: dict[str, Any]) -> list[str]:
    """A sentence on a chosen law that misses its curves by more than `LARGEST_ERROR`, in a list that is empty otherwise."""
    error = card["laws"][card["chosen"]]["relative_error"]
    if error <= LARGEST_ERROR:
        return []
    return [f"The chosen law, {card['chosen']}, misses these curves by {error:.0%} of the stress (root mean square), and above "
            f"{LARGEST_ERROR:.0%} a card does not describe them: check units, signs, preload and slack, narrow the window, or fit "
            "relative errors."]


def _windowed(curves, window):
    """The curves cut to the windows of their modes."""
    kept = [curve.within(window[curve.mode]) if curve.mode in window else curve for curve in curves]
    for curve in kept:
        if len(curve.stress) < 2:
            raise InputError(f"The window {window[curve.mode]} leaves no {curve.mode} curve; widen it.")
    return kept


def _choose(choose, ranking, entries):
    """The name of the law for the solvers: never one that is unstable within its data."""
    if choose not in (*ranking, "best"):
        raise InputError(f"Law {choose!r} is to be chosen but is not fitted; choose one of {', '.join(ranking)}.")
    name = ranking[0] if choose == "best" else choose
    if not entries[name]["stable_over_data"]:
        what = "No law is" if choose == "best" else f"Law {name} is to be chosen but is not"
        raise InputError(f"{what} stable over the strains of these curves ({_ranges(entries[name])}); narrow the window, keep"
                         f" the constants from being negative (nonnegative), or choose {_stable_names(ranking, entries)}.")
    return name


def _stable_names(ranking, entries):
    return " or ".join(name for name in ranking if entries[name]["stable_over_data"]) or "other laws"


def _curve_entry(curve):
    points = len(curve.stress)
    return {"mode": curve.mode, "kind": curve.kind, "source": curve.source, "points": points}


def _law_entry(fit, curves, bulk, options):
    """The card's entry of one law."""
    law = fit.make()
    modulus = bulk.of(law.mu0)
    low, high = SCAN
    paths = [path_of(curve.mode, curve.window) for curve in curves]
    stable = stable_ranges(law, scan=(min(low, *(w[0] for _, w in paths)), max(high, *(w[1] for _, w in paths))))
    return {
        "parameters": fit.parameters,
        "parameter_names": list(fit.parameters),
        "covariance": _listed(fit.covariance),
        "correlation": _listed(fit.correlation),
        "standard_error": None if fit.covariance is None else _named_errors(fit),
        "not_identifiable": fit.not_identifiable,
        "rmse_mpa": fit.rmse_mpa,
        "rmse_by_mode_mpa": fit.rmse_by_mode_mpa,
        "relative_error": fit.relative_error,
        "relative_error_by_mode": fit.relative_error_by_mode,
        "aicc": fit.aicc,
        "autocorrelation": fit.autocorrelation,
        "left_out": predict_left_out(fit.law, curves, **options.fit) if options.predict_left_out else {},
        "mu0_mpa": law.mu0,
        "bulk_modulus_mpa": modulus,
        "d_per_mpa": [2 / modulus] if modulus else [],
        "d_source": bulk.source,
        "small_strain": small_strain_constants(law.mu0, modulus),
        "stable_range": stable,
        "stable_over_data": law.mu0 > 0 and all(covers(stable[mode], window) for mode, window in paths),
        "fit": fit.record,
    }


def _listed(matrix):
    return None if matrix is None else matrix.tolist()


def _named_errors(fit):
    return dict(zip(fit.parameters, np.sqrt(np.diag(fit.covariance)).tolist(), strict=True))


def _agreement(entries, curves):
    """Differences of the laws' stresses within the data and just outside."""
    windows = {curve.mode: curve.window for curve in curves}
    laws = {name: law_of_entry(name, entry) for name, entry in entries.items() if entry["mu0_mpa"] > 0}
    return {"inside": differences(laws, paths_inside(windows)),
            "outside": differences(laws, paths_outside(principal_window(windows)))}


def _linear_entry(curves, bulk, options):
    """({"linear": entry}, warnings), or ({}, [the reason for its absence])."""
    if options.poisson is None and bulk.modulus_mpa is None:
        return {}, ["No linear constants: curves do not hold Poisson's ratio, and none was stated (`poisson`), nor a volumetric"
                    " curve given."]
    try:
        young, error, rmse = young_modulus(curves, small_strain=options.small_strain)
    except InputError as refusal:
        return {}, [f"No linear constants: {refusal}"]
    if not young > 0:
        return {}, [f"No linear constants: Young's modulus would be {young:.3g} MPa, as the uniaxial curve falls, or begins slack, "
                    f"within a strain of {options.small_strain:g}; take the slack off, or raise small_strain."]
    stated = options.poisson is not None
    linear = LinearConstants(young, options.poisson if stated else poisson_ratio(young, bulk.modulus_mpa))
    entry = {
        "parameters": {"young_mpa": young, "poisson": linear.poisson},
        "young_standard_error_mpa": error,
        "rmse_mpa": rmse,
        "mu0_mpa": linear.mu_mpa,
        "bulk_modulus_mpa": linear.bulk_modulus_mpa,
        "small_strain": options.small_strain,
        "poisson_source": "stated in the settings, not fitted: curves of stress against stretch do not hold it" if stated
        else f"from E and K of the {bulk.source}",
    }
    return {"linear": entry}, []


def _fit_warnings(fit, entry):
    """Sentences on constants that the curves do not determine and on instability within the data."""
    if not entry["mu0_mpa"] > 0:
        yield f"{fit.law}: the initial shear modulus is {entry['mu0_mpa']:.3g} MPa; do not use this law."
    if not entry["stable_over_data"]:
        yield f"{fit.law}: not stable over the whole range of the curves, only at stretches {_ranges(entry)}."
    if fit.not_identifiable:
        yield f"{fit.law}: these curves do not determine {', '.join(fit.not_identifiable)} (standard error above 100 %)."
    if fit.at_bound:
        yield f"{fit.law}: {', '.join(fit.at_bound)} ended on a bound of the search."


def _systematic(fits):
    """One sentence on the laws with systematic errors."""
    named = [f"{fit.law} ({fit.autocorrelation:.2f})" for fit in fits
             if fit.autocorrelation > _SYSTEMATIC and fit.relative_error > _NOTABLE]
    if named:
        yield (f"The errors of {', '.join(named)} are systematic: neighbours correlate as the numbers say. Their standard errors"
               " cover noise, not that the law does not follow the material.")


def _ranges(entry):
    return ", ".join(f"{mode} {low:.2f} to {high:.2f}" for mode, (low, high) in entry["stable_range"].items())


def _consistency_warnings(card, threshold):
    """Sentences on laws that differ from the chosen one, and on linear constants that no stable law has."""
    usable = {name: law_of_entry(name, card["laws"][name]) for name in card["ranking"] if card["laws"][name]["stable_over_data"]}
    linear = linear_from_card(card) if "linear" in card["laws"] else None
    parted = partings(card["chosen"], card["agreement"], among=list(usable), threshold=threshold)
    return [*parted, *against_linear(usable, linear)]


def paths_inside(windows: Mapping[str, tuple[float, float]]) -> dict[str, np.ndarray]:
    """{mode: stretches or shear strains (n,)} over the windows {mode: (min, max)} of the tests."""
    paths = {mode: np.geomspace(*window, _POINTS) for mode, window in windows.items() if mode in TEST_PATHS}
    return paths | {mode: np.linspace(*window, _POINTS) for mode, window in windows.items() if mode == SIMPLE_SHEAR}


def paths_outside(principal: tuple[float, float]) -> dict[str, np.ndarray]:
    """{mode: stretches (n,)} just beyond the window `principal` of principal stretches, in both directions of all three paths."""
    paths = {}
    for mode in TEST_PATHS:
        low, high = path_window(principal, mode)
        reach = (high / low) ** MARGIN
        paths[mode] = np.concatenate([np.geomspace(low / reach, low, _POINTS), np.geomspace(high, high * reach, _POINTS)])
    return paths


def difference(one: Law, other: Law, paths: Mapping[str, np.ndarray]) -> tuple[float, str]:
    """(largest difference of two laws over the paths, its mode)"""
    found = [(_difference(one, other, mode, stretch), mode) for mode, stretch in paths.items()]
    return max(found)


def _difference(one, other, mode, stretch):
    a, b = one.nominal_stress(mode, stretch), other.nominal_stress(mode, stretch)
    with np.errstate(invalid="ignore"):
        value = np.sqrt(np.mean((a - b) ** 2) / np.mean((0.5 * (a + b)) ** 2))
    return float(value) if np.isfinite(value) else np.inf


def differences(laws: Mapping[str, Law], paths: Mapping[str, np.ndarray]) -> dict[str, dict[str, dict[str, Any]]]:
    """{law: {other: {"difference": share, or None where one does not exist, "mode": ...}}} of laws {name: Law}, each pair twice."""
    table: dict[str, dict[str, dict[str, Any]]] = {name: {} for name in laws}
    for one, other in itertools.combinations(laws, 2):
        value, mode = difference(laws[one], laws[other], paths)
        entry = {"difference": value if np.isfinite(value) else None, "mode": mode}
        table[one][other] = table[other][one] = entry
    return table


def partings(chosen: str, agreement: Mapping[str, Any], *, among: Collection[str], threshold: float = THRESHOLD) -> Iterator[str]:
    """Sentences on the laws of the list `among` that differ from the chosen one by more than `threshold`."""
    for place, where in (("inside", "within the data"), ("outside", "just outside the data")):
        named = [f"{name} by {_share(entry)} ({entry['mode']})" for name, entry in agreement[place].get(chosen, {}).items()
                 if name in among and (entry["difference"] is None or entry["difference"] > threshold)]
        if named:
            remedy = "the curves do not say which is right there" if place == "outside" else "the others do not fit"
            yield f"{chosen} and other laws part {where}: {', '.join(named)}; {remedy}."


def _share(entry):
    return "any amount" if entry["difference"] is None else f"{entry['difference']:.0%}"


def predict_left_out(name: str, curves: Sequence[AnyCurve], **options: Any) -> dict[str, dict[str, float] | None]:
    """{mode: {"rmse_mpa", "relative_error"}} of the law fitted to all curves but that mode's; {} with fewer than two.

    options: those of `FitOptions`. None for a law that has too few points in the other curves, or that does not exist
    at the stretches of the one left out.
    """
    if len(curves) < 2:
        return {}
    return {curve.mode: _error(name, curve, [other for other in curves if other is not curve], options) for curve in curves}


def _error(name, left_out, others, options):
    try:
        rmse, relative = errors_of(fit_law(name, others, **options).make(), [left_out])
    except InputError:
        return None
    return {"rmse_mpa": rmse, "relative_error": relative} if rmse == rmse else None
