"""The paper's claims, each with its number, ours, and a verdict computed by the rule that stands beside it."""

import numpy as np
import pandas as pd

from softtact.materials.consistency import PRINTED

REPRODUCED, NOT, CONTRADICTION, ARCHIVE = "reproduced", "not reproduced", "contradicts itself", "needs the archive"
UNDECIDED, MEASUREMENTS = "undecided", "needs the paper's measurements"
VIRTUAL = "virtual sensor"      # the source of readings on which the paper's numbers cannot be judged
CLOSE = 0.05                    # of mean SSIM: what trainings of one network from different seeds and searches may part by, assumed
# Mean SSIM that the paper prints (sec. 4.2), by set and model.
PRINTED_SSIM = {"validation": {"hyperelastic": 0.87, "elastic": 0.86}, "unseen": {"hyperelastic": 0.81, "elastic": 0.82},
                "grasps": {"hyperelastic": 0.72, "elastic": 0.63}}
COLUMNS = ["claim", "where", "paper", "ours", "verdict", "rule", "evidence"]


def claims(*, cards, complexity, ftir, ssim, timing, choose, printed_counts, source=VIRTUAL):
    """Data frame with COLUMNS; the arguments are what the study's files hold.

    source: of the readings; against the virtual sensor's no verdict is given on the paper's numbers
    """
    rows = [*_materials(cards), _ftir(ftir), *_curve_shapes(ftir), *_complexity(complexity, choose, printed_counts),
            *_agreement(ssim, source), *_scores(ssim, source), *_times(timing)]
    frame = pd.DataFrame(rows, columns=COLUMNS)
    # The archive has maps and readings; stress-strain curves and camera frames of the paper are not in it.
    return frame if source == VIRTUAL else frame.replace({"verdict": {ARCHIVE: MEASUREMENTS}})


def _row(claim, where, paper, ours, verdict, rule, evidence):
    return dict(zip(COLUMNS, (claim, where, str(paper), str(ours), verdict, rule, evidence), strict=True))


def _verdict(condition):
    return REPRODUCED if condition else NOT


def _materials(cards):
    for card in cards:
        measured, name = card["kind"] == "measured", card["material"]
        stable = sorted(law for law, fit in card["laws"].items() if fit.get("stable_over_data"))
        only = {law.rstrip("123") for law in stable} <= {"ogden", "mooney_rivlin"}
        yield _row(f"For {name} only Ogden and Mooney-Rivlin were stable", "sec. 4.1", "Ogden, Mooney-Rivlin",
                   f"stable over the {card['kind']} curves: {', '.join(stable)}", _verdict(only) if measured else ARCHIVE,
                   "on measured curves, no other law of the family is stable over their range", "tables/table1_materials.csv")
        chosen = card["laws"][card["chosen"]]
        yield _row(f"{name}: the fit's RMSE is below 0.01 (unit read as MPa)", "table 1", "0.0077 to 0.0091",
                   f"{chosen['rmse_mpa']:.4f} MPa ({card['chosen']}, {card['kind']} curves)",
                   _verdict(chosen["rmse_mpa"] < 0.01) if measured else ARCHIVE,
                   "on measured curves, RMSE < 0.01 MPa", "tables/table1_materials.csv")
        yield _printed_constants(card)


def _printed_constants(card):
    found = [text.removeprefix(PRINTED) for text in card.get("warnings", ()) if text.startswith(PRINTED)]
    return _row(f"{card['material']}: the printed laws were fitted to the same test", "table 1", "one test, three models",
                " ".join(found) or "no two laws part by more than half", CONTRADICTION if found else REPRODUCED,
                "no two printed laws part by more than a factor of 1.5 in modulus or stress",
                f"materials/{card['material']}.json")


def _ftir(ftir):
    rmse, virtual = ftir["rmse_mm2_per_frustum"], ftir["source"].startswith("virtual")
    verdict = ARCHIVE if virtual else _verdict(rmse <= 0.008)
    return _row("Simulated and measured contact area of the dielectric agree", "sec. 4.1, fig. 5", "RMSE 0.008 mm2",
                f"{rmse:.4f} mm2 per frustum against the {ftir['source']}", verdict,
                "RMSE per frustum <= 0.008 mm2 against a measured curve", "ftir/summary.json")


def _curve_shapes(ftir):
    """A row per reading of the printed frustum: does the area grow as the paper's words have it, with any law?"""
    for reading in dict.fromkeys(record["reading"] for record in ftir["readings"]):
        records = [record for record in ftir["readings"] if record["reading"] == reading]
        yield _row(f"Frusta read as {reading}: the contact area grows with the force, in discs", "sec. 4.1, fig. 5",
                   "increases, not necessarily linearly", " ".join(record["sentence"] for record in records),
                   _verdict(any(record["allowed"] for record in records)),
                   "with one law at least: rises at every force, by 0.04 mm2 or more, discs two pixels apart, no step steeper than "
                   "four times the mean", "ftir/readings.csv")


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


def _mean(ssim, model, set_name):
    return float(ssim[(ssim.model == model) & (ssim.set == set_name)].ssim.mean())


def _advantage(ssim, items=None):
    """SSIM of hyperelastic minus elastic on the grasped objects: mean, its standard error over objects (nan for one), objects.

    Maps of one object are not independent, so the objects are the sample.
    """
    rows = ssim[(ssim.set == "grasps") & (ssim.item.isin(items) if items else True)]
    means = rows.groupby(["item", "model"]).ssim.mean().unstack()
    if not {"hyperelastic", "elastic"} <= set(ssim.model):
        return np.nan, np.nan, 0
    gain = (means["hyperelastic"] - means["elastic"]) if len(means) else means.sum(axis=1)
    return float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(max(len(gain), 1))), len(gain)


def _agreement(ssim, source):
    for items, text, close in ((["object_1", "object_2", "object_3"], "On smooth objects both models do alike", True),
                               (["object_5", "object_6"], "On objects 5 and 6 the elastic model loses detail", False)):
        gain, error, count = _advantage(ssim, items)
        if count < len(items):
            yield _row(text, "sec. 4.2, fig. 7", "by eye", f"{count} of {len(items)} objects are in this study", UNDECIDED,
                       "needs presses of these objects", "evaluation/ssim.csv")
            continue
        holds = abs(gain) <= 0.05 if close else gain > 0.05
        yield _row(text, "sec. 4.2, fig. 7", "by eye",
                   f"SSIM of hyperelastic minus elastic: {_interval(gain, error, count, source)}", _verdict(holds),
                   f"mean SSIM differs by {'at most' if close else 'more than'} 0.05", "evaluation/ssim.csv")


def _interval(gain, error, count, source):
    return f"{gain:+.3f} (standard error {error:.3f}, {count} objects, {source})"


def _against_print(ours, printed, source):
    """Verdict and rule for a mean SSIM beside the paper's; nan: the archive has no simulation of that model."""
    if source == VIRTUAL:
        return ARCHIVE, "the paper's readings are not here: no verdict on its number"
    if not np.isfinite(ours):
        return UNDECIDED, "needs the archive's simulations of this model"
    return _verdict(abs(ours - printed) <= CLOSE), f"within {CLOSE:g} of the paper's, on its readings"


def _scores(ssim, source):
    for set_name, values in PRINTED_SSIM.items():
        for model, value in values.items():
            count = len(ssim[(ssim.model == model) & (ssim.set == set_name)])
            mean = _mean(ssim, model, set_name)
            yield _row(f"SSIM of the {model} model on {set_name}", "sec. 4.2", value, f"{mean:.2f} over {count} maps, {source}",
                       *_against_print(mean, value, source), "evaluation/ssim.csv")
    for model, value in (("hyperelastic", 0.97), ("elastic", 0.90)):
        best = ssim[(ssim.set == "grasps") & (ssim.model == model)].groupby("item").ssim.mean()
        ours = f"{best.max():.2f} ({best.idxmax()}), {source}" if len(best) else f"no maps of this model, {source}"
        yield _row(f"Best object of the {model} model", "abstract", value, ours, *_against_print(best.max(), value, source),
                   "evaluation/ssim.csv")
    gain, error, count = _advantage(ssim)
    clear = count >= 3 and abs(gain) > 2 * error
    yield _row("On grasped objects the hyperelastic model reads better than the elastic one", "sec. 4.2, fig. 6", "0.72 > 0.63",
               f"SSIM of hyperelastic minus elastic: {_interval(gain, error, count, source)}",
               _verdict(gain > 0) if clear else UNDECIDED,
               "at least three objects, and the mean difference exceeds twice its standard error", "evaluation/ssim.csv")


def _times(timing):
    if not {"hyperelastic", "elastic"} <= set(timing.model):
        for claim, printed in (("The hyperelastic model costs several times the elastic one", "162.1 s / 37.4 s = 4.3"),
                               ("A hyperelastic map takes minutes", "162.1 s")):
            yield _row(claim, "table 3", printed, "no press of both models in this study", UNDECIDED,
                       "needs presses of both models", "tables/table3_timing.csv")
        return
    mean = timing.assign(total=timing.solver_s + timing.network_s).groupby("model").total.mean()
    ratio = mean["hyperelastic"] / mean["elastic"]
    yield _row("The hyperelastic model costs several times the elastic one", "table 3", "162.1 s / 37.4 s = 4.3",
               f"{mean['hyperelastic']:.2f} s / {mean['elastic']:.3f} s = {ratio:.0f}", _verdict(ratio > 2),
               "ratio of mean times per map > 2", "tables/table3_timing.csv")
    yield _row("A hyperelastic map takes minutes", "table 3", "162.1 s", f"{mean['hyperelastic']:.2f} s",
               _verdict(mean["hyperelastic"] > 60), "mean time per map > 60 s", "tables/table3_timing.csv")
