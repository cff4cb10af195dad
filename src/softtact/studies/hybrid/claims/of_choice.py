"""Claims on the choice of a model: the rule and its table, objects of rising detail, and what the hybrid is worth."""

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import trimesh

from softtact.evaluation.claim_rows import CONSISTENT, CONTRADICTION, UNDECIDED, row, verdict_of
from softtact.geometry.complexity import score
from softtact.learning.dataset import object_of

if TYPE_CHECKING:
    from softtact.studies.hybrid.claims.in_print import Counts

ALIKE = 0.1            # relative: counts of an object of ours that stands for a printed one
FAMILY = (1, 3, 5, 9)  # pits along each side of the plates of rising detail
FEW = 3                # objects below which a comparison says nothing
LEVEL = 0.01           # of mean SSIM: below, a difference is no more than another seed may make; assumed
_COUNTS = ("NPt", "CHt", "NPo", "CHo")


def claims_of_choice(complexity: pd.DataFrame, *, choose: Callable[..., str], printed_counts: "dict[str, Counts]",
                     ssim: pd.DataFrame,
                     timing: pd.DataFrame, source: str, footprint_mm: Sequence[float] = (22.0, 37.0)) -> Iterator[dict[str, str]]:
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
    """Only objects whose counts are those of table 2 test the claim; others are objects of our own with the same names."""
    ours = complexity.set_index("object")
    known = [name for name in printed_counts if name in ours.index]
    alike = [name for name in known if set(_COUNTS) <= set(ours) and
             np.allclose(ours.loc[name, list(_COUNTS)].to_numpy(dtype=float), printed_counts[name][:4], rtol=ALIKE, atol=0)]
    agree = {name: ours.model[name] == printed_counts[name][4] for name in known}
    claim = "The objects of figure 7 are sent to the printed models"
    rule = f"at least {FEW} objects with table 2's four counts within {ALIKE:.0%}, all choices equal"
    told = (f"objects with the printed counts: {len(alike)}; of our own objects of the printed kinds, with other meshes, "
            f"{sum(agree.values())} of {len(known)} get the printed model")
    verdict = verdict_of(all(agree[name] for name in alike)) if len(alike) >= FEW else UNDECIDED
    return row(claim, "table 2", "1-4 elastic, 5-6 hyperelastic", told, verdict, rule, "tables/table2_complexity.csv",
               uncertainty="none: counts")


def _rising_detail(footprint_mm):
    family = detail_family(footprint_mm=footprint_mm)
    growth = {name: family[name].iloc[-1] / family[name].iloc[0] for name in _COUNTS}
    told = ", ".join(f"{name} {family[name].iloc[0]} to {family[name].iloc[-1]}" for name in _COUNTS)
    holds = max(growth["CHt"], growth["CHo"]) < 1.5 and min(growth["NPt"], growth["NPo"]) > 3
    return row("With rising detail NPt and NPo grow, while CHt and CHo stay", "sec. 3.3.1, fig. 4", "two objects",
               f"plates with {FAMILY[0]}, then up to {FAMILY[-1]} pits along a side: {told}", verdict_of(holds),
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
    told = ", ".join(f"{name} SSIM {scores[name]:.3f} in {times[name]:.2f} s a map" for name in ("hybrid", "hyperelastic",
                                                                                                 "elastic"))
    better, worse = max(scores["hyperelastic"], scores["elastic"]), min(scores["hyperelastic"], scores["elastic"])
    level = better - worse <= LEVEL
    holds = scores["hybrid"] >= better - LEVEL and (level
                                                    or scores["hybrid"] > worse + LEVEL) and times["hybrid"] < times["hyperelastic"]
    open_ = level or scores["objects"] < FEW or not 0 < scores["hyper_objects"] < scores["objects"]
    alike = " Both models read alike here, so that accuracy decides nothing." if level else ""
    return [row(claim, "title, sec. 5", "a trade-off", f"{told}, {source}.{alike}",
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
