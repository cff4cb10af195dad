"""Claims on the models: the choice between them, features that their maps show and lose, and the time that a map takes."""

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import trimesh

from softtact.evaluation.claim_rows import CONSISTENT, CONTRADICTION, FACTOR, UNDECIDED, row, verdict_of, within
from softtact.geometry.complexity import score
from softtact.learning.dataset import object_of

if TYPE_CHECKING:
    from softtact.studies.hybrid.tables import Counts, Times

ALIKE = 0.1            # relative: counts of an object of ours that stands for a printed one
FAMILY = (1, 3, 5, 9)  # pits along each side of the plates of rising detail
FEW = 3                # objects below which a comparison says nothing
LEVEL = 0.01           # of mean SSIM: below, a difference is no more than another seed may make; assumed
_COUNTS = ("NPt", "CHt", "NPo", "CHo")

RELIEF, STEPPED = "object_4", ("object_5", "object_6")
TENFOLD = 10.0              # NPt over CHt: from here on objects show "more detailed deformation patterns"
LOST, KEPT = 0.1, 0.3       # of the raised features' deformation: a lower one below is lost, above is seen; assumed
LARGE_STRAIN = 0.1          # from which on a rubber's law is not a line
_FEATURES, _PRESSES = "evaluation/features.csv", "needs presses of these objects"
_COUNTED = "counts; a feature is a part of the map above half of its maximum"

_EVIDENCE = "tables/table3_timing.csv"
_COSTS = "The hyperelastic model costs several times the elastic one"
_MINUTES = "A hyperelastic map takes minutes"
_HARDEST = "The hardest maps take many times the mean"
_LONGEST = "Our longest elastic time is near our mean hyperelastic one"


def claims_of_choice(complexity: pd.DataFrame, *, choose: Callable[..., str], printed_counts: "dict[str, Counts]",
                     ssim: pd.DataFrame, timing: pd.DataFrame, source: str,
                     footprint_mm: Sequence[float] = (22.0, 37.0)) -> Iterator[dict[str, str]]:
    """A row for each; the tables as the study's files hold them, source: of the readings."""
    any_rule, all_rule = (all(choose(*counts[:4], rule=rule) == counts[4] for counts in printed_counts.values())
                          for rule in ("any", "all"))
    yield row("Hyperelastic where NPt >= 10 CHt and NPo >= 8 CHo", "sec. 3.3.1, table 2", "six choices",
              f"'and' gives all six: {all_rule}; 'or' gives all six: {any_rule}", CONSISTENT if all_rule else CONTRADICTION,
              "the rule as worded gives the six printed choices", "tables/table2_complexity.csv", uncertainty="none: counts")
    yield _sent_to_the_printed_models(complexity, printed_counts)
    yield _rising_detail(tuple(footprint_mm))
    yield from _hybrid(complexity, ssim, timing, source)


def _sent_to_the_printed_models(complexity, printed_counts):
    """Only objects whose counts are those of table 2 test the claim; others are objects of this study with the same names."""
    ours = complexity.set_index("object")
    known = [name for name in printed_counts if name in ours.index]
    alike = [name for name in known if set(_COUNTS) <= set(ours) and
             np.allclose(ours.loc[name, list(_COUNTS)].to_numpy(dtype=float), printed_counts[name][:4], rtol=ALIKE, atol=0)]
    agree = {name: ours.model[name] == printed_counts[name][4] for name in known}
    claim = "The objects of figure 7 are sent to the printed models"
    rule = f"at least {FEW} objects with table 2's four counts within {ALIKE:.0%}, all choices equal"
    shown = (f"objects with the printed counts: {len(alike)}; of our own objects of the printed kinds, with other meshes, "
            f"{sum(agree.values())} of {len(known)} get the printed model")
    verdict = verdict_of(all(agree[name] for name in alike)) if len(alike) >= FEW else UNDECIDED
    return row(claim, "table 2", "1-4 elastic, 5-6 hyperelastic", shown, verdict, rule, "tables/table2_complexity.csv",
               uncertainty="none: counts")


def _rising_detail(footprint_mm):
    family = detail_family(footprint_mm=footprint_mm)
    growth = {name: family[name].iloc[-1] / family[name].iloc[0] for name in _COUNTS}
    shown = ", ".join(f"{name} {family[name].iloc[0]} to {family[name].iloc[-1]}" for name in _COUNTS)
    holds = max(growth["CHt"], growth["CHo"]) < 1.5 and min(growth["NPt"], growth["NPo"]) > 3
    return row("With rising detail NPt and NPo grow, while CHt and CHo stay", "sec. 3.3.1, fig. 4", "two objects",
               f"plates with {FAMILY[0]}, then up to {FAMILY[-1]} pits along a side: {shown}", verdict_of(holds),
               "over our family of plates NPt and NPo grow more than threefold, CHt and CHo by less than half", "tables/claims.csv",
               uncertainty="none: counts")


@functools.cache
def detail_family(*, footprint_mm: tuple[float, float]) -> pd.DataFrame:
    """Rows pits, NPt, CHt, NPo, CHo of plates of 16 x 16 mm with FAMILY pits, 0.5 mm deep, along each side of their underside."""
    counts = [score(_pitted_plate(pits), footprint_mm=footprint_mm) for pits in FAMILY]
    return pd.DataFrame([{"pits": pits, **{name: getattr(count, name) for name in _COUNTS}}
                         for pits, count in zip(FAMILY, counts, strict=True)])


def _pitted_plate(pits, *, side=16.0, height=5.0, depth=0.5):
    """Facets (n, 3, 3) of a plate whose underside has pits x pits square pits between walls of the same width."""
    cell = side / (2 * pits + 1)
    blocks = [trimesh.creation.box((side, side, height - depth))]
    blocks[0].apply_translation((0, 0, depth + 0.5 * (height - depth)))
    for i in range(2 * pits + 1):
        for j in range(2 * pits + 1):
            if not (i % 2 and j % 2):      # a wall, or a crossing of two
                block = trimesh.creation.box((cell, cell, depth))
                block.apply_translation(((i + 0.5) * cell - side / 2, (j + 0.5) * cell - side / 2, 0.5 * depth))
                blocks.append(block)
    return np.concatenate([block.triangles for block in blocks])


def _hybrid(complexity, ssim, timing, source):
    """The title's claim, on accuracy and on time: the model that the rule chooses for each object, against either alone."""
    claim = "The hybrid of both models balances accuracy and time"
    rule = (f"mean SSIM on grasps at most {LEVEL:g} below the better model's and more than {LEVEL:g} above the worse one's; "
            "mean time below the hyperelastic model's; undecided where the models read alike, with fewer than "
            f"{FEW} objects, and where the rule takes one model for all")
    chosen = complexity.set_index("object").model.to_dict()
    scores = _hybrid_mean(ssim[ssim.set == "grasps"], chosen, "ssim")
    times = _hybrid_mean(timing[timing.set == "grasps"].assign(total=lambda rows: rows.solver_s + rows.network_s), chosen, "total")
    if scores is None or times is None:
        return [row(claim, "title, sec. 5", "a trade-off", f"no press of both models, {source}", UNDECIDED, rule,
                    "evaluation/ssim.csv")]
    shown = ", ".join(f"{name} SSIM {scores[name]:.3f} in {times[name]:.2f} s a map" for name in ("hybrid", "hyperelastic",
                                                                                                 "elastic"))
    better, worse = max(scores["hyperelastic"], scores["elastic"]), min(scores["hyperelastic"], scores["elastic"])
    level = better - worse <= LEVEL
    holds = scores["hybrid"] >= better - LEVEL and (level
                                                    or scores["hybrid"] > worse + LEVEL) and times["hybrid"] < times["hyperelastic"]
    open_ = level or scores["objects"] < FEW or not 0 < scores["hyper_objects"] < scores["objects"]
    alike = " Both models read alike here, so that accuracy decides nothing." if level else ""
    return [row(claim, "title, sec. 5", "a trade-off", f"{shown}, {source}.{alike}",
                UNDECIDED if open_ else verdict_of(holds), rule, "evaluation/ssim.csv",
                uncertainty=f"{scores['objects']} objects, {scores['hyper_objects']} of them sent to the hyperelastic model")]


def _hybrid_mean(rows, chosen, quantity):
    """{hybrid, hyperelastic, elastic, objects, hyper_objects}: means over objects of each choice; None without both models."""
    if not {"hyperelastic", "elastic"} <= set(rows.model) or "item" not in rows:
        return None
    means = rows.assign(item=rows["item"].map(object_of)).groupby(["item", "model"])[quantity].mean().unstack()
    means = means[[item in chosen for item in means.index]]
    if not len(means):
        return None
    hybrid = [means.loc[item, chosen[item]] for item in means.index]
    return {"hybrid": float(np.mean(hybrid)), "hyperelastic": float(means["hyperelastic"].mean()),
            "elastic": float(means["elastic"].mean()),
            "objects": len(means), "hyper_objects": sum(chosen[item] == "hyperelastic" for item in means.index)}


def claims_of_maps(features: pd.DataFrame | None, complexity: pd.DataFrame) -> Iterator[dict[str, str]]:
    """A row for each; features as of `evaluation.features`, or None where nothing was pressed."""
    table = features.set_index(["item", "model"]) if features is not None else None
    yield from (_lower_feature(table, name) for name in STEPPED)
    yield _reliefs(table)
    yield _fewer_details(table, complexity)
    yield _tenfold(table, complexity)
    yield _large_strain(features)


def _known(table, items, models=("hyperelastic", "elastic")):
    return table is not None and all((item, model) in table.index for item in items for model in models)


def _lower_feature(table, name):
    claim = f"{name.replace('_', ' ')}: the elastic model loses a feature 0.5 mm lower, the hyperelastic one sees it"
    rule = f"deformation there below {LOST:g} of the raised features' with the elastic model, above {KEPT:g} with the other"
    if not _known(table, [name]):
        return row(claim, "sec. 4.2, fig. 7", "by eye", "not pressed here", UNDECIDED, _PRESSES, _FEATURES)
    elastic, hyper = (table.loc[(name, model)] for model in ("elastic", "hyperelastic"))
    if not elastic.lower_points:
        return row(claim, "sec. 4.2, fig. 7", "by eye", "this object has no feature 0.5 mm lower", UNDECIDED, rule, _FEATURES)
    shown = ", ".join(f"{model} {one.lower_share:.2f} ({one.lower_mm:.3f} of {one.raised_mm:.3f} mm)"
                     for model, one in (("elastic", elastic), ("hyperelastic", hyper)))
    spread = [one.lower_sd_mm / one.raised_mm for one in (elastic, hyper)]
    return row(claim, "sec. 4.2, fig. 7", "by eye", f"share of the raised features at {hyper.force_n:g} N: {shown}",
               verdict_of(elastic.lower_share < LOST and hyper.lower_share > KEPT), rule, _FEATURES,
               uncertainty=f"sd over {elastic.lower_points:.0f} points of the map: {spread[0]:.2f} and {spread[1]:.2f}")


def _reliefs(table):
    claim = "object 4: both models show the object's reliefs"
    rule = "as many features in both models' maps, and more than one"
    if not _known(table, [RELIEF]):
        return row(claim, "sec. 4.2, fig. 7", "by eye", "not pressed here", UNDECIDED, _PRESSES, _FEATURES)
    counts = {model: int(table.loc[(RELIEF, model)].features) for model in ("elastic", "hyperelastic")}
    return row(claim, "sec. 4.2, fig. 7", "by eye", _counted(counts),
               verdict_of(len(set(counts.values())) == 1 < counts["elastic"]), rule, _FEATURES, uncertainty=_COUNTED)


def _fewer_details(table, complexity):
    claim = "On detailed objects the elastic model captures fewer details"
    detailed = [name for name in complexity[complexity.model == "hyperelastic"].object if _known(table, [name])]
    rule = "fewer features in the elastic map of every object that the rule sends to the hyperelastic model, of two at least"
    if len(detailed) < 2:
        return row(claim, "sec. 4.2, fig. 7", "by eye", f"such objects in this study: {len(detailed)}", UNDECIDED, rule, _FEATURES)
    counts = {name: tuple(int(table.loc[(name, model)].features) for model in ("elastic", "hyperelastic")) for name in detailed}
    return row(claim, "sec. 4.2, fig. 7", "by eye", "features, elastic and hyperelastic: " + _counted(counts),
               verdict_of(all(few < many for few, many in counts.values())), rule, _FEATURES, uncertainty=_COUNTED)


def _tenfold(table, complexity):
    claim = "Objects with NPt of ten times CHt or more show more detailed deformation"
    rule = "every such object has more features in the hyperelastic map than every other; at least two of each"
    ratio = complexity.set_index("object").pipe(lambda frame: frame.NPt / frame.CHt) if "NPt" in complexity else {}
    known = [name for name in complexity.object if _known(table, [name], ["hyperelastic"])] if len(ratio) else []
    above, below = ({name: int(table.loc[(name, "hyperelastic")].features) for name in known if (ratio[name] >= TENFOLD) == side}
                    for side in (True, False))
    if min(len(above), len(below)) < 2:
        return row(claim, "sec. 4.2, table 2", "by eye", f"objects above: {len(above)}, below: {len(below)}", UNDECIDED, rule,
                   _FEATURES)
    return row(claim, "sec. 4.2, table 2", "by eye", f"features above: {_counted(above)}; below: {_counted(below)}",
               verdict_of(min(above.values()) > max(below.values())), rule, _FEATURES, uncertainty=_COUNTED)


def _large_strain(features):
    claim = "The dielectric is strained so much that its law is not linear"
    rule = f"the most compressed frustum is shortened by more than {LARGE_STRAIN:.0%} of its height on every grasped object"
    shares = features[features.model == "hyperelastic"].frustum_share if features is not None else np.zeros(0)
    if not len(shares):
        return row(claim, "sec. 3.1", "large elastic deformations", "not pressed here", UNDECIDED, _PRESSES, _FEATURES)
    return row(claim, "sec. 3.1", "large elastic deformations",
               f"{shares.min():.0%} to {shares.max():.0%} of the height at {features.force_n.max():g} N",
               verdict_of(shares.min() > LARGE_STRAIN), rule, _FEATURES, uncertainty=f"range over {len(shares)} objects")


def _counted(counts):
    """Counts of features by object or model, in words."""
    return ", ".join(f"{name.replace('_', ' ')} {value[0]} and {value[1]}" if isinstance(value, tuple)
                     else f"{name.replace('_', ' ')} {value}" for name, value in counts.items())


def claims_of_times(timing: pd.DataFrame, printed: "dict[str, Times]") -> Iterator[dict[str, str]]:
    """A row for each; timing: rows of `time_presses`;  printed: {model: (mean, min, max, sd)} in s."""
    hyper, elastic = (printed[model] for model in ("hyperelastic", "elastic"))
    values = {_COSTS: f"{hyper[0]:g} s / {elastic[0]:g} s = {hyper[0] / elastic[0]:.1f}", _MINUTES: f"{hyper[0]:g} s",
              _HARDEST: "4 times (elastic), 11 times (hyperelastic)", _LONGEST: f"{elastic[2]:g} s and {hyper[0]:g} s"}
    total = timing.assign(total=timing.solver_s + timing.network_s).groupby("model").total
    if not {"hyperelastic", "elastic"} <= set(timing.model):
        for claim, value in values.items():
            yield row(claim, "table 3", value, "no press of both models in this study", UNDECIDED, "needs presses of both models",
                      _EVIDENCE)
        return
    mean, error, count, longest = total.mean(), total.sem(), total.count(), total.max()
    ratio = mean["hyperelastic"] / mean["elastic"]
    relative = float(np.hypot(*(error[model] / mean[model] for model in ("hyperelastic", "elastic"))))
    yield row(_COSTS, "table 3", values[_COSTS], f"{mean['hyperelastic']:.2f} s / {mean['elastic']:.3f} s = {ratio:.0f}",
              verdict_of(within(ratio,
                                hyper[0] / elastic[0])), f"ratio of mean times per map within a factor of {FACTOR:g} of table 3's",
              _EVIDENCE, uncertainty=f"standard error {ratio * relative:.0f}")
    yield row(_MINUTES, "table 3", values[_MINUTES], f"{mean['hyperelastic']:.2f} s", verdict_of(within(mean["hyperelastic"],
                                                                                                        hyper[0])),
              f"mean time per map within a factor of {FACTOR:g} of table 3's", _EVIDENCE,
              uncertainty=f"standard error {error['hyperelastic']:.2f} s, {count['hyperelastic']} maps; another machine and solver")
    ours = longest / mean
    yield row(_HARDEST, "sec. 4.2, table 3", values[_HARDEST],
              f"{ours['elastic']:.1f} times (elastic), {ours['hyperelastic']:.1f} times (hyperelastic)",
              verdict_of(all(within(ours[model], times[2] / times[0]) for model, times in (("elastic", elastic), ("hyperelastic",
                                                                                                                  hyper)))),
              f"both ratios of longest to mean within a factor of {FACTOR:g} of table 3's", _EVIDENCE,
              uncertainty=f"longest of {count['elastic']} and {count['hyperelastic']} maps")
    yield row(_LONGEST, "sec. 4.2", values[_LONGEST], f"{longest['elastic']:.2f} s and {mean['hyperelastic']:.2f} s",
              verdict_of(within(longest["elastic"],
                                mean["hyperelastic"])), f"within a factor of {FACTOR:g} of each other", _EVIDENCE,
              uncertainty=f"longest of {count['elastic']} maps")
