"""The paper's claims on the robot scene, each with its number, ours, and a verdict by the rule beside it."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from softtact.evaluation.claim_rows import ARCHIVE, COLUMNS, UNDECIDED, row, verdict_of
from softtact.studies.hybrid.claims.of_models import KEPT, LOST

if TYPE_CHECKING:
    import xarray

OBJECTS, TRIALS, FORCE_N = 12, 2000, 50.0
_FORCE_SHARE = 0.01      # of the force asked for, within which pads press as asked


def claims_of_grasps(grasps: pd.DataFrame, compared: Mapping[str, "xarray.Dataset"], *, force_n: float, policy: str,
                     model: str) -> pd.DataFrame:
    """Data frame with `claim_rows.COLUMNS`.

    grasps: rows of grasps.csv;  compared: {object: data set of one_event};  model, policy: how the study takes a model
    """
    done = grasps[grasps.status == "done"]
    rows = [_triggered(done, model, policy), _held(done, force_n), *(_missed(name, data) for name, data in compared.items()),
            *([] if compared else [_none_compared()]), _counted(done, force_n), *_scores()]
    return pd.DataFrame(rows, columns=COLUMNS)


def _triggered(done, model, policy):
    claim = "A collision of sensor and object starts the chosen model, from the object's pose and the force"
    rule = "at each contact and each grip both fingers that touch were pressed, by the model that the paper's rule takes"
    if model != "auto" or policy != "paper":
        return row(claim, "sec. 3.3", "described", f"the model is {model} and the policy {policy} in this study", UNDECIDED,
                   "needs model: auto and policy: paper", "grasps.csv")
    both = [(done[f"model_{event}_{side}"], done[f"rule_{side}"]) for event in ("contact", "grip") for side in ("left", "right")]
    pressed = int(sum((taken != "none").sum() for taken, _ in both))
    agree = int(sum(((taken == ruled) & (taken != "none")).sum() for taken, ruled in both))
    return row(claim, "sec. 3.3", "described", f"{agree} of {pressed} presses at events took the rule's model",
               verdict_of(0 < pressed == agree), rule, "grasps.csv", uncertainty="none: counted")


def _held(done, force_n):
    claim = "The fingers close until the object is securely held, with the force asked for"
    rule = f"both pads of every grasp press within {_FORCE_SHARE:.0%} of the force"
    if not len(done):
        return row(claim, "sec. 3.3, 4.2", "described", "no grasp was done", UNDECIDED, rule, "grasps.csv")
    away = np.abs(done[["force_left_n", "force_right_n"]].to_numpy() / force_n - 1).max()
    return row(claim, "sec. 3.3, 4.2", "described", f"{len(done)} grasps; the force is off by {away:.1e} of itself at most",
               verdict_of(away < _FORCE_SHARE), rule, "grasps.csv", uncertainty="none: the largest of all")


def _missed(name, data):
    claim = f"{name.replace('_', ' ')}: in one event the elastic model misses a lower protrusion that the hyperelastic one shows"
    rule = f"deformation there below {LOST:g} of the raised features' with the elastic model, above {KEPT:g} with the other"
    shares = dict(zip(data.model.values.tolist(), data.lower_share.values.tolist(), strict=True))
    evidence = f"one_event/{name}.nc"
    shown = (f"share of the raised features at {data.attrs['force_n']:g} N on a cover of the printed {data.attrs['cover_law']} "
            f"constants: {', '.join(f'{model} {share:.2f}' for model, share in shares.items())}")
    if not {"elastic", "hyperelastic"} <= set(shares) or not np.isfinite(list(shares.values())).all():
        return row(claim, "fig. 1", "by eye", f"{shown}; needs both models, and an object with a feature 0.5 mm lower", UNDECIDED,
                   rule, evidence)
    return row(claim, "fig. 1", "by eye", shown,
               verdict_of(shares["elastic"] < LOST and shares["hyperelastic"] > KEPT), rule, evidence,
               uncertainty="none: one event, one mesh of the model")


def _none_compared():
    return row("In one event the elastic model misses a lower protrusion that the hyperelastic one shows", "fig. 1", "by eye",
               "no event was pressed by both models", UNDECIDED, "needs one_event", "one_event/")


def _counted(done, force_n):
    objects, trials = done.object.nunique(), int(done.trials.sum()) if len(done) else 0
    return row("Twelve objects, 2,000 trials at 50 N", "sec. 4.2", f"{OBJECTS} objects, {TRIALS:,} trials, {FORCE_N:g} N",
               f"{objects} objects, {len(done)} positions, {trials:,} trials at {force_n:g} N, virtual sensor",
               verdict_of(objects == OBJECTS and trials >= TRIALS and force_n == FORCE_N),
               "as many objects, at least as many trials, the same force", "grasps.csv", uncertainty="none: counted")


def _scores() -> Iterator[dict[str, str]]:
    for model, value in (("hyperelastic", 0.72), ("elastic", 0.63)):
        yield row(f"SSIM on grasped objects, {model} model", "sec. 4.2", value, "readings here are the virtual sensor's", ARCHIVE,
                  "the authors' readings; softtact's study of their archive scores them", "docs/how-to/published_archive.md")
