"""Time and error of policies that choose a model: by the paper's rule, by the expected error, or always the same model.

The error of a press is the root mean square difference in mm of its map from the hyperelastic model's, at the worst load step; in
counts, the largest difference of the sums over all taxels, which is what users read. Its time is that of all load steps; the
`error` policy also pays for both fast models, which it presses first. The expected error is calibrated on one set of presses (the
indenters) and tested on the others. A model is chosen if nine of ten such presses are within the tolerance, as by default.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.press.choice import INTERVALS, FoundationError, calibrate, cheapest, expected_errors, rms
from softtact.press.result import wall_time_s

if TYPE_CHECKING:
    import xarray

MODELS = ("elastic", "foundation", "hyperelastic")
CALIBRATION_SET = "indenters"
CHANCE = "random, the paper's share"


def press_table(presses: "Sequence[dict[str, xarray.Dataset]]", paper_choice: dict[str, str], *,
                height_mm: float) -> tuple[pd.DataFrame, FoundationError]:
    """A row per press and its worst load step: set, item, paper's model, time, error and expected error of each model.

    presses: list of {model: data set of `simulate_press`};  paper_choice: {item: model};  height_mm: of a frustum
    Returns the table and the calibrated `FoundationError`.
    """
    calibrated = _calibrated([press for press in presses if press["elastic"].attrs["set"] == CALIBRATION_SET], height_mm)
    return pd.DataFrame([_row(press, paper_choice, calibrated, height_mm) for press in presses]), calibrated


def _calibrated(presses, height_mm):
    maps = np.concatenate([press["foundation"].deformation_map_mm.values for press in presses])
    compression = np.concatenate([press["foundation"].frustum_compression_mm.values for press in presses])
    errors = np.concatenate([_errors(press)["foundation"] for press in presses])
    return calibrate(errors / rms(maps), compression / height_mm)


def _errors(press):
    """{model: true errors (load steps,) in mm}."""
    truth = press["hyperelastic"].deformation_map_mm.values
    return {model: rms(press[model].deformation_map_mm.values - truth) for model in MODELS}


def _count_errors(press):
    """{model: largest difference of the counts of all taxels from the hyperelastic model's}; nan for presses without readings."""
    if not all("tactile_map" in press[model] for model in MODELS):
        return dict.fromkeys(MODELS, np.nan)
    counts = {model: press[model].tactile_map.values.sum(axis=(1, 2)) for model in MODELS}
    return {model: float(np.abs(counts[model] - counts["hyperelastic"]).max()) for model in MODELS}


def _row(press, paper_choice, calibrated, height_mm):
    errors = _errors(press)
    expected = expected_errors(press["elastic"], press["foundation"], height_mm=height_mm,
                           thickness_mm=press["foundation"].attrs["thickness_mm"], model=calibrated)
    name = press["elastic"].attrs["item"]
    row = {"set": press["elastic"].attrs["set"], "item": name, "paper_model": paper_choice[name],
           "largest_mm": float(press["hyperelastic"].deformation_map_mm.max()),
           "foundation_valid": bool(press["foundation"].within_validity.values.all())}
    in_counts = _count_errors(press)
    for model in MODELS:
        row[f"{model}_error_mm"], row[f"{model}_error_counts"] = float(errors[model].max()), in_counts[model]
        row[f"{model}_time_s"] = float(wall_time_s(press[model]).sum())
    return row | {f"{model}_expected_mm": float(values.max()) for model, values in expected.items()}


def choices(table: pd.DataFrame, tolerance_mm: float) -> dict[str, pd.Series]:
    """{policy: series of models} over the presses of a table; the `error` policy chooses as `press_auto` does, by `INTERVALS`."""
    def by_error(row):
        mostly = {model: INTERVALS[model][1] * row[f"{model}_expected_mm"] for model in MODELS[:2]}
        return cheapest({model: np.array([error]) for model, error in mostly.items()}, tolerance_mm)

    return {**{f"always {model}": pd.Series(model, index=table.index) for model in MODELS}, "paper": table.paper_model,
            f"error, {1e3 * tolerance_mm:g} um": table.apply(by_error, axis=1)}


def policy_table(table: pd.DataFrame, tolerances_mm: Iterable[float], *, sets: Sequence[str]) -> pd.DataFrame:
    """A row per policy over the presses of some sets: shares of the models, errors, times, share of presses over the tolerance."""
    table = table[table.set.isin(sets)]
    rows: dict[str, dict[str, Any]] = {}
    for tolerance in tolerances_mm:
        for policy, chosen in choices(table, tolerance).items():
            rows.setdefault(policy, _summary(table, policy, chosen, tolerance))
    return with_chance(pd.DataFrame(rows.values()))


def with_chance(policies: pd.DataFrame) -> pd.DataFrame:
    """A `policy_table` with a row behind the paper's: what its rule would have if it drew its presses.

    As many presses of each model, each press as likely as any other, so the means are those of the models by the paper's shares.
    The table as it is where it has that row, or lacks the paper's or a model's.
    """
    by_name = policies.set_index("policy")
    models = [f"always {model}" for model in MODELS]
    if CHANCE in by_name.index or not {"paper", *models} <= set(by_name.index):
        return policies
    shares = by_name.loc["paper", [f"share_{model}" for model in MODELS]]
    means = {name: float(shares.to_numpy(dtype=float) @ by_name.loc[models, name].to_numpy(dtype=float))
             for name in ("mean_error_mm", "mean_error_counts", "time_per_press_s", "time_in_all_s") if name in policies}
    row = {"policy": CHANCE, "presses": by_name.presses["paper"], **shares, **means}
    place = list(policies.policy).index("paper") + 1
    return pd.concat([policies.iloc[:place], pd.DataFrame([row]), policies.iloc[place:]], ignore_index=True)


def _summary(table, policy, chosen, tolerance):
    error = _of_chosen(table, chosen, "error_mm")
    time = _of_chosen(table, chosen, "time_s")
    by_error = policy.startswith("error")
    if by_error:     # both fast models are pressed first
        time = table.elastic_time_s + table.foundation_time_s + np.where(chosen == "hyperelastic", table.hyperelastic_time_s, 0.0)
    summary = {"policy": policy, "presses": len(table)}
    summary |= {f"share_{model}": float((chosen == model).mean()) for model in MODELS}
    in_counts = _of_chosen(table, chosen, "error_counts")
    summary |= {"mean_error_mm": error.mean(), "largest_error_mm": error.max(), "mean_error_counts": in_counts.mean(),
                "largest_error_counts": in_counts.max(), "time_per_press_s": time.mean(),
                "time_in_all_s": time.sum()}
    return summary | {"over_tolerance": float((error > tolerance).mean()) if by_error else np.nan}


def _of_chosen(table, chosen, quantity):
    return pd.Series([row[f"{model}_{quantity}"] for (_, row), model in zip(table.iterrows(), chosen, strict=True)],
                     index=table.index)


def expected_over_true(table: pd.DataFrame, model: str) -> dict[str, float]:
    """Ratio of expected to true error over a model's presses: median, lowest and highest."""
    ratio = table[f"{model}_expected_mm"] / table[f"{model}_error_mm"]
    return {"median": ratio.median(), "lowest": ratio.min(), "highest": ratio.max()}
