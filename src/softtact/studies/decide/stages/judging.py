"""Power, the table of scores, the hypotheses, the claims."""

from typing import Any

import numpy as np
import pandas as pd

from softtact.files import read_csv, read_dataset, read_json, write_csv
from softtact.sensors.frusta import SensorSpec
from softtact.studies.decide.config import MODELS
from softtact.studies.decide.scoring import MEAN_READING

_FLAT = 0.05     # of the error: what the last step of a learning curve may fall by and count as flat


def state_power(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the chance that each hypothesis is found, of an assumed effect and assumed spreads; no score is read.

    outputs: power (CSV: claim, objects, seeds, tests, effect, object_sd, seed_sd, level, power, power_of_first, enough)
    settings: statistics, smooth, stepped, seeds, tests (that share a claim's level)
    power: at the level itself;  power_of_first: at the level over the number of tests, as Holm's rule asks of the first one
    enough: whether the power is what the statistics ask for. Differences of two groups scatter more, by the root of 2.
    """
    from softtact.evaluation.paired import power

    assumed, level = settings["statistics"]["assumed"], settings["statistics"]["level"]
    everything = settings["smooth"] + settings["stepped"]
    sizes = {"detail": settings["stepped"], "not_stiffness": settings["stepped"], "balance": everything, "choice": everything,
             "detail_more": min(settings["smooth"], settings["stepped"])}
    rows = []
    for claim, objects in sizes.items():
        spread = assumed["object_sd"] * (np.sqrt(2) if claim == "detail_more" else 1.0)
        case = {"objects": objects, "seeds": settings["seeds"], "object_sd": float(spread), "seed_sd": assumed["seed_sd"]}
        alone, first = (power(assumed["effect"], level=one, **case) for one in (level, level / settings["tests"]))
        rows.append({"claim": claim, "effect": assumed["effect"], **case, "tests": settings["tests"], "level": level,
                     "power": alone,
                     "power_of_first": first, "enough": alone >= settings["statistics"]["power"]})
    write_csv(outputs["power"], pd.DataFrame(rows))


def gather_scores(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Join the scores of all truths, models and readouts, and add those of the policies and of the mean reading.

    inputs: formulas, networks, curves (lists of CSV), facts (JSON of the objects), presses_MODEL (lists, of the objects), sensor
    outputs: scores, choices (a row for each object), learning_curve (CSV)
    settings: seed, ssim_window, tolerance_mm
    """
    from softtact.studies.decide.policies import choice_table, policy_scores

    presses = {model: [read_dataset(path) for path in inputs[f"presses_{model}"]] for model in MODELS}
    choices = choice_table([read_json(path) for path in inputs["facts"]], presses, SensorSpec.from_yaml(inputs["sensor"]),
                           tolerance_mm=settings["tolerance_mm"])
    scores = pd.concat([read_csv(path) for path in [*inputs["formulas"], *inputs["networks"]]], ignore_index=True)
    models = scores[scores.model != MEAN_READING]
    write_csv(outputs["scores"], pd.concat([models, policy_scores(models, choices), baseline_of_readouts(scores)],
                                           ignore_index=True))
    write_csv(outputs["choices"], choices)
    curves = pd.concat([read_csv(path) for path in inputs["curves"]], ignore_index=True)
    write_csv(outputs["learning_curve"], with_flatness(curves))


def baseline_of_readouts(scores: pd.DataFrame) -> pd.DataFrame:
    """The rows of the mean reading, once for each readout of their truth, so that it stands beside each."""
    read = scores[scores.model != MEAN_READING][["truth", "readout"]].drop_duplicates()
    return scores[scores.model == MEAN_READING].drop(columns="readout").merge(read, on="truth")[scores.columns]


def with_flatness(curve: pd.DataFrame) -> pd.DataFrame:
    """The rows with `last_fall`, the share by which the error fell in the last step of its curve, and whether its end is `flat`."""
    falls = {}
    for key, own in curve.groupby(["truth", "model"], sort=False):
        errors = own.sort_values("share").error_share.to_numpy()
        falls[key] = 1 - errors[-1] / errors[-2] if len(errors) > 1 else np.nan
    fall = np.array([falls[key] for key in zip(curve.truth, curve.model, strict=True)], dtype=float)
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
