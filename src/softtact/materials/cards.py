"""Material cards: everything known of a material after its fit, as JSON, and the laws made from it."""

import numpy as np

from softtact.errors import InputError
from softtact.files import read_json
from softtact.materials.consistency import disagreements
from softtact.materials.curves import common_kind, join_by_mode
from softtact.materials.fitting import STARTS, fit_family
from softtact.materials.laws.base import TEST_PATHS
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants, young_modulus
from softtact.materials.stability import stable_ranges


def make_card(
    curves,
    *,
    material="material",
    laws="all",
    choose="best",
    bulk_over_shear=20.0,
    poisson=None,
    small_strain=0.1,
    window=None,
    nonnegative=False,
    starts=STARTS,
    seed=0,
    printed=None,
):
    """Fit the laws to the curves and return the card as a dict, ready for `write_json`.

    laws: list of names, or "all"
    choose: the law that the solvers take, or "best": the first of the ranking
    bulk_over_shear: K / mu0, which curves of stress against stretch do not determine
    poisson: Poisson's ratio of the linear constants; without it the card has none
    small_strain: strain up to which E is the slope of the uniaxial curve
    window: {mode: [min, max]} stretch to use, all by default
    nonnegative, starts, seed: see `fit_law`
    printed: constants published for the material, {law: {"parameters": {...}}}, checked against each other
    """
    curves = _windowed(join_by_mode(curves), window or {})
    fits = fit_family(curves, laws=laws, nonnegative=nonnegative, starts=starts, seed=seed)
    entries = {name: _law_entry(fit, curves, bulk_over_shear) for name, fit in fits.items()}
    ranking = sorted(entries, key=lambda name: (not entries[name]["stable_over_data"], entries[name]["aicc"]))
    warnings = [sentence for name, fit in fits.items() for sentence in _fit_warnings(fit, entries[name])]
    linear, linear_warnings = _linear_entry(curves, poisson, small_strain)
    card = {
        "material": material,
        "kind": common_kind(curves),
        "curves": [_curve_entry(curve) for curve in curves],
        "strain_window": {curve.mode: list(curve.window) for curve in curves},
        "chosen": _choose(choose, ranking),
        "ranking": ranking,
        "laws": entries | linear,
        "warnings": warnings + linear_warnings,
    }
    card["warnings"] += _consistency_warnings(card)
    if printed:
        card["printed"] = printed
        card["warnings"] += printed_warnings(printed, bulk_over_shear=bulk_over_shear)
    return card


def load_card(path):
    """Read a card; a file that is none is refused."""
    card = read_json(path)
    missing = [key for key in ("material", "kind", "chosen", "laws") if key not in card]
    if missing:
        raise InputError(f"{path}: not a material card, it lacks {', '.join(missing)}; write it with `softtact fit`.")
    return card


def law_from_card(card, law=None):
    """The `Law` of a card: the chosen one, or the one named."""
    name = law or card["chosen"]
    available = [key for key in card["laws"] if key != "linear"]
    if name not in available:
        raise InputError(
            f"The card of material {card['material']} has no hyperelastic law {name!r}; it has {', '.join(available)}."
        )
    entry = card["laws"][name]
    law = make_law(name, entry["parameters"], bulk_modulus=entry["bulk_modulus_mpa"])
    law.stretch_window = principal_window(card.get("strain_window", {}))
    return law


def principal_window(windows):
    """Lowest and highest principal stretch over {mode: [min, max] stretch along the loading}; None without a known mode."""
    stretches = [stretch**exponent for mode, window in windows.items() if mode in TEST_PATHS
                 for stretch in window for exponent in TEST_PATHS[mode]]
    return (min(stretches), max(stretches)) if stretches else None


def linear_from_card(card):
    """The `LinearConstants` (E, nu) of a card."""
    if "linear" not in card["laws"]:
        raise InputError(
            f"The card of material {card['material']} has no linear constants;"
            " fit it with a uniaxial curve and a stated poisson."
        )
    return LinearConstants(**card["laws"]["linear"]["parameters"])


def printed_warnings(printed, *, bulk_over_shear=20.0):
    """Sentences on where published constants {law: {"parameters": {...}}} contradict each other."""
    laws = {
        name: make_law(name, entry["parameters"], bulk_over_shear=bulk_over_shear)
        for name, entry in printed.items()
        if name != "linear"
    }
    linear = LinearConstants(**printed["linear"]["parameters"]) if "linear" in printed else None
    return [f"Printed constants: {sentence}" for sentence in disagreements(laws, linear=linear)]


def _windowed(curves, window):
    """The curves cut to the windows of their modes."""
    kept = [curve.within(window[curve.mode]) if curve.mode in window else curve for curve in curves]
    for curve in kept:
        if len(curve.stretch) < 2:
            raise InputError(f"The window {window[curve.mode]} leaves no {curve.mode} curve; widen it.")
    return kept


def _choose(choose, ranking):
    if choose == "best":
        return ranking[0]
    if choose not in ranking:
        raise InputError(f"Law {choose!r} is to be chosen but is not fitted; choose one of {', '.join(ranking)}.")
    return choose


def _curve_entry(curve):
    return {"mode": curve.mode, "kind": curve.kind, "source": curve.source, "points": len(curve.stretch)}


def _law_entry(fit, curves, bulk_over_shear):
    law = fit.make()
    bulk_modulus = bulk_over_shear * law.mu0
    stable = stable_ranges(law)
    return {
        "parameters": fit.parameters,
        "parameter_names": list(fit.parameters),
        "covariance": None if fit.covariance is None else fit.covariance.tolist(),
        "rmse_mpa": fit.rmse_mpa,
        "rmse_by_mode_mpa": fit.rmse_by_mode_mpa,
        "aicc": fit.aicc,
        "mu0_mpa": law.mu0,
        "bulk_modulus_mpa": bulk_modulus,
        "d_per_mpa": [2 / bulk_modulus] if bulk_modulus else [],
        "stable_range": stable,
        "stable_over_data": all(_covers(stable[curve.mode], curve.window) for curve in curves),
        "fit": fit.record,
    }


def _covers(outer, inner):
    """Whether a range covers another, up to the 1 % steps of the stability scan."""
    return outer[0] <= inner[0] * 1.01 and outer[1] >= inner[1] / 1.01


def _linear_entry(curves, poisson, small_strain):
    """({"linear": entry}, warnings), or ({}, why there is none)."""
    if poisson is None:
        return {}, ["No linear constants: curves do not hold Poisson's ratio, and none was stated (`poisson`)."]
    try:
        young, error, rmse = young_modulus(curves, small_strain=small_strain)
    except InputError as refusal:
        return {}, [f"No linear constants: {refusal}"]
    linear = LinearConstants(young, poisson)
    entry = {
        "parameters": {"young_mpa": young, "poisson": poisson},
        "young_standard_error_mpa": error,
        "rmse_mpa": rmse,
        "mu0_mpa": linear.mu_mpa,
        "bulk_modulus_mpa": linear.bulk_modulus_mpa,
        "small_strain": small_strain,
        "poisson_source": "stated in the settings, not fitted: curves of stress against stretch do not hold it",
    }
    return {"linear": entry}, []


def _fit_warnings(fit, entry):
    """Sentences on constants that the curves do not determine and on instability within the data."""
    if not entry["mu0_mpa"] > 0:
        yield f"{fit.law}: the initial shear modulus is {entry['mu0_mpa']:.3g} MPa; do not use this law."
    if not entry["stable_over_data"]:
        ranges = ", ".join(f"{mode} {low:.2f} to {high:.2f}" for mode, (low, high) in entry["stable_range"].items())
        yield f"{fit.law}: not stable over the whole range of the curves, only at stretches {ranges}."
    loose = _undetermined(fit)
    if loose:
        yield f"{fit.law}: these curves do not determine {', '.join(loose)} (standard error above 100 %)."
    if fit.at_bound:
        yield f"{fit.law}: {', '.join(fit.at_bound)} ended on a bound of the search."


def _undetermined(fit):
    """Names of the constants whose standard error exceeds them; all where the covariance does not exist."""
    if fit.covariance is None:
        return list(fit.parameters)
    error = np.sqrt(np.diag(fit.covariance))
    return [name for name, e in zip(fit.parameters, error, strict=True) if e > abs(fit.parameters[name])]


def _consistency_warnings(card):
    """Disagreements among the laws of the card that are stable over its data."""
    usable = [name for name in card["ranking"] if card["laws"][name]["stable_over_data"]]
    laws = {name: law_from_card(card, name) for name in usable}
    linear = linear_from_card(card) if "linear" in card["laws"] else None
    return disagreements(laws, linear=linear)
