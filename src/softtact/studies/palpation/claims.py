"""The claims of the palpation sensor's paper, each with a verdict computed by the rule beside it.

Our numbers are known to the mesh's error alone (the sweep again on a mesh half as fine). A claim is decided where that interval
lies on one side of its limit; where it holds the limit, or is wider than the tolerance, the claim is undecided.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import COLUMNS, UNDECIDED, interval_inside, row
from softtact.probe.sweep import at_largest_displacement

PRINTED_N_MM = {"ecoflex_00_30": 55.218, "dragon_skin_20": 79.204}     # sec. IV, the slopes of figure 4
_SOFT_FIRST = tuple(PRINTED_N_MM)
_MEASURED = "_tension"      # ends the name of a tissue that has the same rubber's measured curve in place of table II
_NEAR, _CONSTANT = 0.10, 0.05
NOT_JUDGED = (f"The paper's claims are on {' and '.join(name.replace('_', ' ') for name in PRINTED_N_MM)}. None of these tissues "
              "is pressed here, so that no claim is judged.")


def of_the_paper(tissues: Iterable[str]) -> bool:
    """Whether any of the tissues is one that the paper's claims are on."""
    return any(name in PRINTED_N_MM or name.removesuffix(_MEASURED) in PRINTED_N_MM for name in tissues)


def claims_of_probe(curves: pd.DataFrame, slopes: pd.DataFrame, hardness: pd.DataFrame | None, *,
                    mesh_error: float) -> pd.DataFrame:
    """Data frame with `decisions.COLUMNS` from the tables of `softtact palpate`; empty for tissues that are not the paper's.

    curves: a row for each step;  slopes: for each tissue and scenario;  hardness: over load and height, or None
    mesh_error: the largest relative change of a slope between this mesh and one half as fine
    """
    if not of_the_paper(slopes.tissue):
        return pd.DataFrame(columns=COLUMNS)
    rows = [_slope(slopes, tissue, printed, mesh_error) for tissue, printed in PRINTED_N_MM.items()]
    rows += [_slope(slopes, f"{tissue}{_MEASURED}", printed, mesh_error) for tissue, printed in PRINTED_N_MM.items()
             if f"{tissue}{_MEASURED}" in set(slopes.tissue)]
    rows += [_larger_deflection(curves, mesh_error), _order(slopes, mesh_error), _property(slopes, mesh_error),
             _one_load(curves, mesh_error)]
    if hardness is not None and hardness.tissue_height_mm.nunique() > 1:
        rows.append(_height(hardness, mesh_error))
    return pd.DataFrame(rows, columns=COLUMNS)


def _around(value, error):
    """The interval of a number above 0 with a relative error."""
    return value * (1 - error), value * (1 + error)


def _in_words(error, *, of_two=False):
    return f"{error:.1%} between this mesh and one half as fine{', of each of the two' if of_two else ''}"


def _moved(slopes, tissue):
    """The row of a tissue under the moved jaw, or None."""
    found = slopes[(slopes.tissue == tissue) & (slopes.scenario == "displacement")]
    return found.iloc[0] if len(found) else None


def _slope(slopes, tissue, printed, mesh_error):
    fit = _moved(slopes, tissue)
    rule = f"slope of the trend line within {_NEAR:.0%} of the printed one, both sides, with its mesh's error"
    if fit is None:
        return row(f"F/d of {tissue}", "sec. IV, fig. 4", f"{printed} N/mm", "not run", UNDECIDED, rule, "tables/slopes.csv")
    off = fit.line_n_mm / printed - 1
    ours = (f"{fit.line_n_mm:.2f} N/mm ({off:+.1%}); F/d from {fit.secant_least_n_mm:.2f} to {fit.secant_largest_n_mm:.2f}, "
            f"tangent at rest {fit.initial_n_mm:.2f}")
    verdict = interval_inside(_around(fit.line_n_mm, mesh_error), (1 - _NEAR) * printed, (1 + _NEAR) * printed)
    return row(f"F/d of {tissue}", "sec. IV, fig. 4", f"{printed} N/mm", ours, verdict, rule, "tables/slopes.csv",
               uncertainty=_in_words(mesh_error))


def _larger_deflection(curves, mesh_error):
    claim, rule = "The softer tissue bends the beam more at the same load", "at every load, by more than the meshes' errors"
    pair = [curves[(curves.tissue == name) & (curves.scenario == "load")] for name in _SOFT_FIRST]
    if any(part.empty for part in pair):
        return row(claim, "fig. 3", "larger deflection", "not run", UNDECIDED, rule, "tables/curves.csv")
    ratio = pair[0].beam_deflection_mm.to_numpy() / pair[1].beam_deflection_mm.to_numpy()
    return row(claim, "fig. 3", "larger deflection",
               f"by {ratio.min() - 1:.1%} to {ratio.max() - 1:.1%} up to {pair[0].force_n.max():g} N",
               interval_inside(_around(ratio.min(), 2 * mesh_error), 1.0, np.inf), rule, "tables/curves.csv",
               uncertainty=_in_words(mesh_error, of_two=True))


def _order(slopes, mesh_error):
    fits = [_moved(slopes, name) for name in _SOFT_FIRST]
    claim, paper = "F/d ranks the rubbers by hardness", "Ecoflex 00-30 below Dragon Skin 20"
    rule = "slope of the trend line of the harder rubber larger, by more than the meshes' errors"
    if any(part is None for part in fits):
        return row(claim, "sec. IV", paper, "not run", UNDECIDED, rule, "tables/slopes.csv")
    soft, hard = (part.line_n_mm for part in fits)
    return row(claim, "sec. IV", paper, f"{soft:.2f} and {hard:.2f} N/mm",
               interval_inside(_around(hard / soft, 2 * mesh_error), 1.0, np.inf), rule, "tables/slopes.csv",
               uncertainty=_in_words(mesh_error, of_two=True))


def _property(slopes, mesh_error):
    moved = slopes[(slopes.scenario == "displacement") & slopes.tissue.isin(_SOFT_FIRST)]
    change = (moved.secant_largest_n_mm / moved.secant_least_n_mm - 1).max()
    ranges = "; ".join(f"{one.tissue}: {one.secant_least_n_mm:.2f} to {one.secant_largest_n_mm:.2f} N/mm"
                       for one in moved.itertuples()) or "not run"
    return row("F/d is a property of the tissue, whatever the load", "eq. 3, 4", "a constant of the material", ranges,
               UNDECIDED if moved.empty else _unchanged(change, mesh_error),
               f"F/d of a tissue changes by {_CONSTANT:.0%} at most over the sweep, with the mesh's error", "tables/slopes.csv",
               uncertainty=_in_words(mesh_error))


def _unchanged(change, error):
    """The verdict on a relative change that is known to an error: by at most `_CONSTANT`?"""
    return interval_inside((change - error, change + error), -np.inf, _CONSTANT)


def _one_load(curves, mesh_error):
    """How much of the printed contrast is left where both tissues bear the same load."""
    moved = [curves[(curves.tissue == name) & (curves.scenario == "load")] for name in _SOFT_FIRST]
    printed = PRINTED_N_MM[_SOFT_FIRST[1]] / PRINTED_N_MM[_SOFT_FIRST[0]]
    rule = f"contrast at the largest common load within {_NEAR:.0%} of the printed one, with the meshes' errors"
    claim = "The contrast of F/d is the tissues', not that of two ranges of load"
    if any(part.empty for part in moved):
        return row(claim, "sec. IV", f"{printed:.3f}", "not run", UNDECIDED, rule, "tables/curves.csv")
    soft, hard = ((part.force_n / part.beam_deflection_mm).iloc[-1] for part in moved)
    return row(claim, "sec. IV", f"{printed:.3f}", f"{hard / soft:.3f} at {moved[0].force_n.iloc[-1]:g} N for both",
               interval_inside(_around(hard / soft, 2 * mesh_error), (1 - _NEAR) * printed, (1 + _NEAR) * printed), rule,
               "tables/curves.csv", uncertainty=_in_words(mesh_error, of_two=True))


def _height(hardness, mesh_error):
    last = at_largest_displacement(hardness)
    change = last.groupby("tissue").relative_hardness_n_mm.agg(lambda values: values.max() / values.min() - 1)
    changes = "; ".join(f"{name}: changes by {value:.1%}" for name, value in change.items())
    return row("F/d does not depend on the tissue's height", "eq. 3", "not claimed: C is for one geometry", changes,
               _unchanged(change.max(), 2 * mesh_error),
               f"F/d at the same jaw displacement changes by {_CONSTANT:.0%} at most over the heights, with the meshes' errors",
               "tables/hardness.csv", uncertainty=_in_words(mesh_error, of_two=True))
