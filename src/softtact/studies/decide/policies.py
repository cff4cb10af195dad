"""Policies that choose a model for an object, as contestants: the paper's rule, chance, the expected error, the better one."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from softtact.press.choice import INTERVALS, cheapest, expected_errors
from softtact.press.result import wall_time_s
from softtact.sensors.frusta import SensorSpec
from softtact.studies.decide.config import ELASTIC, FOUNDATION, HYPERELASTIC
from softtact.studies.decide.scoring import COLUMNS, SCORES

HYBRID, RANDOM, ERROR, ORACLE = POLICIES = ("hybrid", "random", "error", "oracle")
_BY = ["truth", "readout", "seed", "object"]


def choice_table(facts: list[dict[str, Any]], presses: Mapping[str, list[Any]], spec: SensorSpec, *,
                 tolerance_mm: float) -> pd.DataFrame:
    """A row for each object: what policies choose, and what its presses take.

    facts: of `draw_object`;  presses: {model: data sets}
    Columns: object, step_mm, rule (the model in the mesh that was pressed), share_hyperelastic (of all its meshes), rules (the
    models, joined by spaces), by_error, time_MODEL_s, load_per_core (the system's, over its cores, as the hyperelastic press began)
    """
    rows = []
    for number, one in enumerate(facts):
        rules = [mesh["model"] for mesh in one["meshes"]]
        own = {model: of[number] for model, of in presses.items()}
        row = {"object": one["name"], "step_mm": one["step_mm"], "rule": rules[0],
               "share_hyperelastic": float(np.mean([model == HYPERELASTIC for model in rules])), "rules": " ".join(rules),
               "by_error": by_expected_error(own, spec, tolerance_mm)}
        times = {f"time_{model}_s": float(np.nansum(wall_time_s(own[model]))) for model in (ELASTIC, FOUNDATION, HYPERELASTIC)}
        rows.append(row | times | {"load_per_core": float(own[HYPERELASTIC].attrs["load_per_core"])})
    return pd.DataFrame(rows)


def by_expected_error(presses: Mapping[str, Any], spec: SensorSpec, tolerance_mm: float) -> str:
    """The model that `press_auto` would take: the cheapest whose error is within the tolerance in nine of ten presses."""
    errors = expected_errors(presses[ELASTIC], presses[FOUNDATION], height_mm=spec.frustum_height_mm,
                             thickness_mm=spec.thickness_mm)
    mostly = {model: np.where(presses[model].within_validity.values == 1, INTERVALS[model][1] * np.asarray(values), np.inf)
              for model, values in errors.items()}
    return cheapest(mostly, tolerance_mm)


def policy_scores(scores: pd.DataFrame, choices: pd.DataFrame) -> pd.DataFrame:
    """The scores (COLUMNS) of the policies, from those of the models that they choose.

    The hybrid chooses by the mesh that was pressed. Chance takes the hyperelastic model as often as it, and has the expected score.
    The oracle takes the model with the smaller error of each object, in the mean over the seeds.
    """
    named = choices.set_index("object")
    means = scores.groupby(["truth", "readout", "object", "model"]).error_share.mean().unstack("model")
    best = means[[ELASTIC, HYPERELASTIC]].idxmin(axis=1)
    chosen = {HYBRID: lambda row: named.rule[row.object], ERROR: lambda row: named.by_error[row.object],
              ORACLE: lambda row: best[(row.truth, row.readout, row.object)]}
    frames = [_chosen(scores, policy, choose) for policy, choose in chosen.items()]
    share = float((named.rule == HYPERELASTIC).mean())
    return pd.concat([*frames, _by_chance(scores, share)], ignore_index=True)[COLUMNS]


def _chosen(scores, policy, choose):
    """The rows of the model that is chosen for their object; none of a truth's readout that lacks a chosen model."""
    taken, by = scores[scores.model == scores.apply(choose, axis=1)], ["truth", "readout"]
    objects = scores.groupby(by).object.transform("nunique")
    return taken[taken.groupby(by).object.transform("nunique") == objects[taken.index]].assign(model=policy)


def _by_chance(scores, share):
    """The expected scores of a choice by chance."""
    elastic, hyperelastic = (scores[scores.model == model].set_index(_BY).sort_index() for model in (ELASTIC, HYPERELASTIC))
    mixed = hyperelastic.copy()
    mixed[SCORES] = share * hyperelastic[SCORES] + (1 - share) * elastic[SCORES]
    return mixed.assign(model=RANDOM).reset_index()


def remeshed_choices(choices: pd.DataFrame) -> Iterator[np.ndarray]:
    """Of each number of a mesh, which objects (object,) the rule gives to the hyperelastic model in it."""
    rules = np.array([text.split() for text in choices.rules])
    return iter((rules == HYPERELASTIC).T.astype(float))
