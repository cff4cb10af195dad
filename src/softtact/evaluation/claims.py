"""The paper's claims, each with its number, ours, and a verdict computed by the rule that stands beside it."""

import numpy as np
import pandas as pd

REPRODUCED, NOT, CONTRADICTION, ARCHIVE = "reproduced", "not reproduced", "contradicts itself", "needs the archive"
COLUMNS = ["claim", "where", "paper", "ours", "verdict", "rule", "evidence"]


def claims(*, cards, complexity, ftir, ssim, timing, choose, printed_counts):
    """Data frame with COLUMNS; the arguments are what the study's files hold."""
    rows = [*_materials(cards), _ftir(ftir), *_complexity(complexity, choose, printed_counts), *_agreement(ssim),
            *_scores(ssim), *_times(timing)]
    return pd.DataFrame(rows, columns=COLUMNS)


def _row(claim, where, paper, ours, verdict, rule, evidence):
    return dict(zip(COLUMNS, (claim, where, str(paper), str(ours), verdict, rule, evidence), strict=True))


def _verdict(condition):
    return REPRODUCED if condition else NOT


def _materials(cards):
    for card in cards:
        stable = sorted(law for law, fit in card["laws"].items() if fit.get("stable_over_data"))
        yield _row(f"For {card['material']} only Ogden and Mooney-Rivlin were stable", "sec. 4.1", "Ogden, Mooney-Rivlin",
                   ", ".join(stable), _verdict({law.rstrip('123') for law in stable} <= {"ogden", "mooney_rivlin", "linear"}),
                   "no other law of the family is stable over the data", "tables/table1_materials.csv")
        chosen = card["laws"][card["chosen"]]
        yield _row(f"{card['material']}: the fit's RMSE is below 0.01 (unit read as MPa)", "table 1", "0.0077 to 0.0091",
                   f"{chosen['rmse_mpa']:.4f} MPa ({card['chosen']}, {card['kind']} curves)",
                   _verdict(chosen["rmse_mpa"] < 0.01), "RMSE < 0.01 MPa", "tables/table1_materials.csv")
        if card.get("warnings"):
            yield _row(f"{card['material']}: the printed models describe one material", "table 1", "two fits of one test",
                       " ".join(card["warnings"])[:400], CONTRADICTION,
                       "printed constants disagree beyond the threshold of the consistency check",
                       f"materials/{card['material']}.json")


def _ftir(ftir):
    rmse, virtual = ftir["rmse_mm2_per_frustum"], ftir["source"].startswith("virtual")
    verdict = ARCHIVE if virtual else _verdict(rmse <= 0.008)
    return _row("Simulated and measured contact area of the dielectric agree", "sec. 4.1, fig. 5", "RMSE 0.008 mm2",
                f"{rmse:.4f} mm2 per frustum against the {ftir['source']}", verdict,
                "RMSE per frustum <= 0.008 mm2 against a measured curve", "ftir/summary.json")


def _complexity(complexity, choose, printed):
    any_rule = all(choose(*row[:4], rule="any") == row[4] for row in printed.values())
    all_rule = all(choose(*row[:4], rule="all") == row[4] for row in printed.values())
    yield _row("Hyperelastic where NPt >= 10 CHt and NPo >= 8 CHo", "sec. 3.3.1, table 2", "six choices",
               f"'and' gives all six: {all_rule}; 'or' gives all six: {any_rule}",
               REPRODUCED if all_rule else CONTRADICTION, "the rule as worded gives the six printed choices",
               "tables/table2_complexity.csv")
    ours = complexity.set_index("object").model
    known = [name for name in printed if name in ours.index]
    agree = [ours[name] == printed[name][4] for name in known]
    yield _row("The objects of figure 7 are sent to the printed models", "table 2", "1-4 elastic, 5-6 hyperelastic",
               f"{sum(agree)} of {len(known)} (our own objects of the printed kinds)", _verdict(all(agree)),
               "all choices equal", "tables/table2_complexity.csv")


def _mean(ssim, model, set_name, items=None):
    rows = ssim[(ssim.model == model) & (ssim.set == set_name)]
    rows = rows if items is None else rows[rows.item.isin(items)]
    return float(rows.ssim.mean()) if len(rows) else np.nan


def _agreement(ssim):
    for items, text, close in ((["object_1", "object_2", "object_3"], "On smooth objects both models do alike", True),
                               (["object_5", "object_6"], "On objects 5 and 6 the elastic model loses detail", False)):
        a, b = (_mean(ssim, model, "grasps", items) for model in ("hyperelastic", "elastic"))
        if np.isnan(a) or np.isnan(b):
            yield _row(text, "sec. 4.2, fig. 7", "by eye", "these objects are not in this study", ARCHIVE,
                       "needs presses of these objects", "evaluation/ssim.csv")
            continue
        holds = abs(a - b) <= 0.05 if close else a - b > 0.05
        yield _row(text, "sec. 4.2, fig. 7", "by eye", f"SSIM {a:.2f} hyperelastic, {b:.2f} elastic (virtual sensor)",
                   _verdict(holds), f"mean SSIM differs by {'at most' if close else 'more than'} 0.05", "evaluation/ssim.csv")


def _scores(ssim):
    printed = {"validation": (0.87, 0.86), "unseen": (0.81, 0.82), "grasps": (0.72, 0.63)}
    for set_name, values in printed.items():
        for model, value in zip(("hyperelastic", "elastic"), values, strict=True):
            count = len(ssim[(ssim.model == model) & (ssim.set == set_name)])
            yield _row(f"SSIM of the {model} model on {set_name}", "sec. 4.2", value,
                       f"{_mean(ssim, model, set_name):.2f} over {count} maps, virtual sensor", ARCHIVE,
                       "the paper's readings are not here: no verdict on its number", "evaluation/ssim.csv")
    grasps = ssim[ssim.set == "grasps"].groupby(["model", "item"]).ssim.mean()
    for model, value in (("hyperelastic", 0.97), ("elastic", 0.90)):
        best = grasps.loc[model]
        yield _row(f"Best object of the {model} model", "abstract", value,
                   f"{best.max():.2f} ({best.idxmax()}), virtual sensor", ARCHIVE,
                   "the paper's readings are not here: no verdict on its number", "evaluation/ssim.csv")
    a, b = (_mean(ssim, model, "grasps") for model in ("hyperelastic", "elastic"))
    yield _row("On grasped objects the hyperelastic model reads better than the elastic one", "sec. 4.2, fig. 6", "0.72 > 0.63",
               f"{a:.2f} against {b:.2f} (virtual sensor)", _verdict(a > b), "mean SSIM hyperelastic > elastic",
               "evaluation/ssim.csv")


def _times(timing):
    mean = timing.assign(total=timing.solver_s + timing.network_s).groupby("model").total.mean()
    ratio = mean["hyperelastic"] / mean["elastic"]
    yield _row("The hyperelastic model costs several times the elastic one", "table 3", "162.1 s / 37.4 s = 4.3",
               f"{mean['hyperelastic']:.2f} s / {mean['elastic']:.3f} s = {ratio:.0f}", _verdict(ratio > 2),
               "ratio of mean times per map > 2", "tables/table3_timing.csv")
    yield _row("A hyperelastic map takes minutes", "table 3", "162.1 s", f"{mean['hyperelastic']:.2f} s",
               _verdict(mean["hyperelastic"] > 60), "mean time per map > 60 s", "tables/table3_timing.csv")
