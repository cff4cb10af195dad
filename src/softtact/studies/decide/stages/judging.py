"""Power, the table of scores, the hypotheses, the claims."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from softtact.files import read_csv, read_dataset, read_json, write_csv
from softtact.sensors.frusta import SensorSpec
from softtact.studies.decide.config import MODELS, NETWORKS
from softtact.studies.decide.scoring import MEAN_READING, SCORES

_FLAT = 0.05     # of the error: what it may fall by for twice as many maps, at the rate of the curve's last step, to count as flat


def state_power(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the chance that each hypothesis is found, of an assumed effect and assumed spreads; no score is read.

    outputs: power (CSV: claim, readout, objects, others, seeds, tests, effect, object_sd, seed_sd, level, power, power_of_first,
    power_of_claim, enough);  settings: statistics, smooth, stepped, seeds {readout: number}, tests (that share a claim's level)
    effect: the mean's distance from its bound. A hybrid that is as good as the hyperelastic model is by the margin above it. A
    choice is right where what it takes gains by the effect more than what it leaves, half of the objects each
    others: objects of the second group, where two groups are compared;  a network of one training is always undecided
    power: at half of the level, which one side has;  power_of_first: at that over the number of tests, as Holm's rule asks of
    the first one;  power_of_claim: of all tests of the claim together if they are independent;  enough: whether the power is
    what the statistics ask for
    """
    from softtact.evaluation.paired import power

    statistics, tests = settings["statistics"], settings["tests"]
    assumed, level, half = statistics["assumed"], statistics["level"], (settings["smooth"] + settings["stepped"]) // 2
    groups = {"detail": [settings["stepped"]], "detail_more": [settings["stepped"], settings["smooth"]],
              "not_stiffness": [settings["stepped"]], "balance": [2 * half], "choice": [half, half]}
    rows = []
    for (claim, sizes), (readout, seeds) in product(groups.items(), settings["seeds"].items()):
        case = {"objects": sizes, "seeds": seeds, "object_sd": assumed["object_sd"], "seed_sd": assumed["seed_sd"]}
        effect = statistics["margin"] if claim == "balance" else assumed["effect"]
        alone, first = (0.0 if readout in NETWORKS and seeds < 2 else power(effect, level=0.5 * level / count, **case)
                        for count in (1, tests))
        rows.append({"claim": claim, "readout": readout, **case, "objects": sizes[0], "others": sum(sizes[1:]), "effect": effect,
                     "tests": tests, "level": level, "power": alone, "power_of_first": first,
                     "enough": alone >= statistics["power"]})
    table = pd.DataFrame(rows)
    each = tests / len(settings["seeds"])     # as many for each readout
    write_csv(outputs["power"], table.assign(power_of_claim=table.groupby("claim").power.transform("prod") ** each))


def gather_scores(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Join the scores of all truths, models and readouts, and add those of the policies and of the mean reading.

    inputs: formulas, networks, curves (lists of CSV), facts (JSON of the objects), presses_MODEL (lists, of the objects), sensor
    outputs: scores, mean_scores, choices (a row for each object), learning_curve (CSV)
    settings: seed, ssim_window, tolerance_mm
    """
    from softtact.studies.decide.policies import choice_table, policy_scores

    presses = {model: [read_dataset(path) for path in inputs[f"presses_{model}"]] for model in MODELS}
    choices = choice_table([read_json(path) for path in inputs["facts"]], presses, SensorSpec.from_yaml(inputs["sensor"]),
                           tolerance_mm=settings["tolerance_mm"])
    scores = pd.concat([read_csv(path) for path in [*inputs["formulas"], *inputs["networks"]]], ignore_index=True)
    models = scores[scores.model != MEAN_READING]
    whole = pd.concat([models, policy_scores(models, choices), baseline_of_readouts(scores)], ignore_index=True)
    write_csv(outputs["scores"], whole)
    write_csv(outputs["mean_scores"], mean_scores(whole))
    write_csv(outputs["choices"], choices)
    curves = pd.concat([read_csv(path) for path in inputs["curves"]], ignore_index=True)
    write_csv(outputs["learning_curve"], with_flatness(curves))


def mean_scores(scores: pd.DataFrame) -> pd.DataFrame:
    """A row for each truth, readout, kind of object and contestant: means over objects and seeds."""
    return scores.groupby(["truth", "readout", "kind", "model"], sort=False)[SCORES].mean().reset_index()


def baseline_of_readouts(scores: pd.DataFrame) -> pd.DataFrame:
    """The rows of the mean reading, once for each readout of their truth, so that it stands beside each."""
    read = scores[scores.model != MEAN_READING][["truth", "readout"]].drop_duplicates()
    return scores[scores.model == MEAN_READING].drop(columns="readout").merge(read, on="truth")[scores.columns]


def with_flatness(curve: pd.DataFrame) -> pd.DataFrame:
    """The rows with `last_fall`, the share by which the error falls for twice as many indenters, and whether the curve is `flat`.

    At the rate of the curve's last step.
    """
    falls = {}
    by = ["truth", "model", "readout"]
    for key, own in curve.groupby(by, sort=False):
        end = own.sort_values("share").iloc[-2:]
        rate = np.diff(np.log(end.error_share)) / np.diff(np.log(end.share))
        falls[key] = float(1 - 2 ** rate[0]) if len(rate) else np.nan
    fall = np.array([falls[key] for key in curve[by].itertuples(index=False, name=None)], dtype=float)
    return curve.assign(last_fall=fall, flat=np.abs(fall) < _FLAT)


def judge(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Test the hypotheses.  inputs: scores, power, choices, collapse;  outputs: hypotheses;  settings: statistics, truths, seed."""
    from softtact.studies.decide.hypotheses import Tables, hypothesis_table

    tables = Tables(**{name: read_csv(inputs[name]) for name in ("scores", "choices", "collapse", "power")})
    write_csv(outputs["hypotheses"], hypothesis_table(tables, statistics=settings["statistics"], truths=settings["truths"],
                                                      seed=settings["seed"]))


def judge_claims(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the verdicts on the paper's claims.

    inputs: scores, hypotheses, learning_curve, power, robustness, collapse;  outputs: claims
    settings: statistics, truths, printed (whether the paper's network was trained)
    """
    from softtact.studies.decide.claims import claims_of_decision

    tables = {name: read_csv(path) for name, path in inputs.items()}
    write_csv(outputs["claims"], claims_of_decision(tables, statistics=settings["statistics"], truths=settings["truths"],
                                                    printed=settings["printed"]))
