"""Tables 1 to 3, with the paper's numbers: fitted laws, chosen models, times."""

from collections.abc import Callable, Iterable
from typing import Any

import pandas as pd

from softtact.materials.consistency import PRINTED
from softtact.reporting.run_record import machine

Counts = tuple[int, int, int, int, str]
Times = tuple[float, float, float, float]

# Table 2 of the paper: NPt, CHt, NPo, CHo, and the chosen pipeline.
PRINTED_COUNTS: dict[str, Counts] = {
    "object_1": (1356, 231, 51, 36, "elastic"), "object_2": (13830, 15537, 1205, 3444, "elastic"),
    "object_3": (1932, 1348, 64, 105, "elastic"), "object_4": (5472, 1449, 164, 141, "elastic"),
    "object_5": (5628, 426, 242, 90, "hyperelastic"), "object_6": (28524, 1353, 984, 102, "hyperelastic")}
# Table 3 of the paper, s: mean, min, max, sd.
PRINTED_TIMES: dict[str, Times] = {"hyperelastic": (162.1, 48.0, 1863.0, 110.9), "elastic": (37.4, 2.46, 157.6, 32.44)}


def table1_materials(cards: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """A row per material and law: parameters, errors, stability, undetermined parameters, the paper's constants and RMSE."""
    rows = []
    for card in cards:
        for law, fit in card["laws"].items():
            printed = card.get("printed", {}).get(law, {})
            ranges = {f"stable_{mode}": f"{low:.3g} to {high:.3g}" for mode, (low, high) in fit.get("stable_range", {}).items()}
            rows.append({"material": card["material"], "law": law, "chosen": law == card["chosen"],
                         "parameters": _listing(fit["parameters"]), "rmse_mpa": fit.get("rmse_mpa"),
                         "relative_error": fit.get("relative_error"), "mu0_mpa": fit.get("mu0_mpa"),
                         "bulk_modulus_mpa": fit.get("bulk_modulus_mpa"), "stable_over_data": fit.get("stable_over_data"), **ranges,
                         "not_identifiable": " ".join(fit.get("not_identifiable", ())),
                         "printed_parameters": _listing(printed.get("parameters", {})),
                         "printed_rmse": printed.get("rmse_mpa"), "data": card["kind"]})
    return pd.DataFrame(rows)


def contradictions(cards: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """A row per contradiction among the printed constants of a publication, with its numbers."""
    rows = [{"material": card["material"], "contradiction": text.removeprefix(PRINTED)}
            for card in cards for text in card["warnings"] if text.startswith(PRINTED)]
    return pd.DataFrame(rows, columns=["material", "contradiction"])


def table2_complexity(complexity: pd.DataFrame, choose: Callable[..., str]) -> pd.DataFrame:
    """Counts and choice per object, ours and the six printed rows; `choose(NPt, CHt, NPo, CHo)` is the rule."""
    ours = complexity.assign(source="ours")
    printed = pd.DataFrame([{"object": name, "NPt": a, "CHt": b, "NPo": c, "CHo": d, "model": choose(a, b, c, d),
                             "model_in_paper": model, "source": "paper"}
                            for name, (a, b, c, d, model) in PRINTED_COUNTS.items()])
    return pd.concat([ours, printed], ignore_index=True)


def table3_timing(timing: pd.DataFrame) -> pd.DataFrame:
    """Seconds per map and model: ours (if objects were pressed) with its machine, and the paper's."""
    rows = []
    timing = timing.assign(total_s=timing.solver_s + timing.network_s)
    for model in sorted(set(timing.model)) or sorted(PRINTED_TIMES):
        t = timing[timing.model == model].total_s
        if len(t):
            rows.append({"model": model, "source": "ours", "maps": len(t), "mean_s": t.mean(), "min_s": t.min(), "max_s": t.max(),
                         "sd_s": t.std(ddof=1), "machine": machine()})
        if model in PRINTED_TIMES:
            rows.append({"model": model, "source": "paper", "machine": "not printed",
                         **dict(zip(("mean_s", "min_s", "max_s", "sd_s"), PRINTED_TIMES[model], strict=True))})
    return pd.DataFrame(rows)


def _listing(parameters):
    return " ".join(f"{name}={value:.4g}" for name, value in parameters.items())
