"""The paper's claims on the robot scene, each with its number, ours, and a verdict by the rule beside it."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import ARCHIVE, COLUMNS, UNDECIDED, row, verdict_of
from softtact.studies.hybrid.claims.of_maps import LOWER_RULE

if TYPE_CHECKING:
    import xarray

OBJECTS, TRIALS, FORCE_N = 12, 2000, 50.0
_FORCE_SHARE = 0.01  # of the force asked for, within which pads press as asked


def claims_of_grasps(
    grasps: pd.DataFrame, compared: Mapping[str, "xarray.Dataset"], *, force_n: float, policy: str, model: str
) -> pd.DataFrame:
    """Data frame with `decisions.COLUMNS`.

    grasps: rows of grasps.csv;  compared: {object: data set of one_event};  model, policy: how the study takes a model
    """
    done = grasps[grasps.status == "done"]
    rows = [_triggered(done, model, policy), _held(done, force_n), _missed(compared), _counted(done, force_n), *_scores()]
    return pd.DataFrame(rows, columns=COLUMNS)


def _triggered(done, model, policy):
    claim = "A collision of sensor and object starts the chosen model, from the object's pose and the force"
    rule = ("at each contact and each grip both fingers that touch were pressed, by the model that the paper's rule takes for the "
            "object's pose there")
    if model != "auto" or policy != "paper":
        return row(
            claim,
            "sec. 3.3",
            "described",
            f"the model is {model} and the policy {policy} in this study",
            UNDECIDED,
            "needs model: auto and policy: paper",
            "grasps.csv",
        )
    if not len(done):
        return row(claim, "sec. 3.3", "described", "no grasp was done", UNDECIDED, rule, "grasps.csv")
    places = [f"{event}_{side}" for event in ("contact", "grip") for side in ("left", "right")]
    both = [(done[f"model_{place}"], done[f"rule_{place}"]) for place in places]
    pressed = int(sum((taken != "none").sum() for taken, _ in both))
    agree = int(sum(((taken == ruled) & (taken != "none")).sum() for taken, ruled in both))
    return row(
        claim,
        "sec. 3.3",
        "described",
        f"{agree} of {pressed} presses at events took the rule's model",
        verdict_of(0 < pressed == agree),
        rule,
        "grasps.csv",
        uncertainty="none: counted",
    )


def _held(done, force_n):
    claim = "The fingers close until the object is securely held, with the force asked for"
    rule = f"both pads of every grasp press within {_FORCE_SHARE:.0%} of the force"
    if not len(done):
        return row(claim, "sec. 3.3, 4.2", "described", "no grasp was done", UNDECIDED, rule, "grasps.csv")
    away = np.abs(done[["force_left_n", "force_right_n"]].to_numpy() / force_n - 1).max()
    return row(
        claim,
        "sec. 3.3, 4.2",
        "described",
        f"{len(done)} grasps; the force is off by {away:.1e} of itself at most",
        verdict_of(away < _FORCE_SHARE),
        rule,
        "grasps.csv",
        uncertainty="none: the largest of all",
    )


def _missed(compared):
    """Undecided however the shares are: no event here has a truth beside the two models, and a study presses a few objects."""
    claim = "In one event the elastic model misses a lower protrusion that the hyperelastic one shows"
    if not compared:
        return row(claim, "fig. 1", "by eye", "no event was pressed by both models", UNDECIDED, "needs one_event", "one_event/")
    events = []
    for name, data in compared.items():
        shares = dict(zip(data.model.values.tolist(), data.lower_share.values.tolist(), strict=True))
        listed = ", ".join(
            f"{model} {share:z.2f}" if np.isfinite(share) else f"{model} no lower feature" for model, share in shares.items()
        )
        events.append(
            f"{name.replace('_', ' ')} at {data.attrs['force_n']:g} N on a cover of the printed {data.attrs['cover_law']} "
            f"constants: {listed}"
        )
    return row(
        claim,
        "fig. 1",
        "by eye",
        f"share of the raised features: {'; '.join(events)}",
        UNDECIDED,
        f"{LOWER_RULE}; an event is pressed by both models and by no virtual sensor",
        "one_event/",
        uncertainty=f"{len(events)} events, one mesh of the model, no truth",
    )


def _counted(done, force_n):
    objects, trials = done.object.nunique(), int(done.trials.sum()) if len(done) else 0
    return row(
        "Twelve objects, 2,000 trials at 50 N",
        "sec. 4.2",
        f"{OBJECTS} objects, {TRIALS:,} trials, {FORCE_N:g} N",
        f"{objects} objects, {len(done)} positions, {trials:,} trials at {force_n:g} N, virtual sensor",
        verdict_of(objects == OBJECTS and trials >= TRIALS and force_n == FORCE_N),
        "as many objects, at least as many trials, the same force",
        "grasps.csv",
        uncertainty="none: counted",
    )


def _scores() -> Iterator[dict[str, str]]:
    for model, value in (("hyperelastic", 0.72), ("elastic", 0.63)):
        yield row(
            f"SSIM on grasped objects, {model} model",
            "sec. 4.2",
            value,
            "readings here are the virtual sensor's",
            ARCHIVE,
            "the authors' readings; softtact's study of their archive scores them",
            "docs/how-to/published_archive.md",
        )
