"""Claims that deformation maps decide by themselves: features seen and lost, and how far the rubber is strained."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softtact.evaluation.claim_rows import UNDECIDED, row, verdict_of

if TYPE_CHECKING:
    import pandas as pd

SMOOTH, RELIEF, STEPPED = ("object_1", "object_2", "object_3"), "object_4", ("object_5", "object_6")
TENFOLD = 10.0              # NPt over CHt: from here on objects show "more detailed deformation patterns"
LOST, KEPT = 0.1, 0.3       # of the raised features' deformation: a lower one below is lost, above is seen; assumed
LARGE_STRAIN = 0.1          # from which on a rubber's law is not a line
_FEATURES, _PRESSES = "evaluation/features.csv", "needs presses of these objects"
_COUNTED = "counts; a feature is a part of the map above half of its maximum"


def claims_of_maps(features: "pd.DataFrame | None", complexity: "pd.DataFrame") -> Iterator[dict[str, str]]:
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
    told = ", ".join(f"{model} {one.lower_share:.2f} ({one.lower_mm:.3f} of {one.raised_mm:.3f} mm)"
                     for model, one in (("elastic", elastic), ("hyperelastic", hyper)))
    spread = [one.lower_sd_mm / one.raised_mm for one in (elastic, hyper)]
    return row(claim, "sec. 4.2, fig. 7", "by eye", f"share of the raised features at {hyper.force_n:g} N: {told}",
               verdict_of(elastic.lower_share < LOST and hyper.lower_share > KEPT), rule, _FEATURES,
               uncertainty=f"sd over {elastic.lower_points:.0f} points of the map: {spread[0]:.2f} and {spread[1]:.2f}")


def _reliefs(table):
    claim = "object 4: both models show the object's reliefs"
    rule = "as many features in both models' maps, and more than one"
    if not _known(table, [RELIEF]):
        return row(claim, "sec. 4.2, fig. 7", "by eye", "not pressed here", UNDECIDED, _PRESSES, _FEATURES)
    counts = {model: int(table.loc[(RELIEF, model)].features) for model in ("elastic", "hyperelastic")}
    return row(claim, "sec. 4.2, fig. 7", "by eye", _told(counts), verdict_of(len(set(counts.values())) == 1 < counts["elastic"]),
               rule, _FEATURES, uncertainty=_COUNTED)


def _fewer_details(table, complexity):
    claim = "On detailed objects the elastic model captures fewer details"
    detailed = [name for name in complexity[complexity.model == "hyperelastic"].object if _known(table, [name])]
    rule = "fewer features in the elastic map of every object that the rule sends to the hyperelastic model, of two at least"
    if len(detailed) < 2:
        return row(claim, "sec. 4.2, fig. 7", "by eye", f"such objects in this study: {len(detailed)}", UNDECIDED, rule, _FEATURES)
    counts = {name: tuple(int(table.loc[(name, model)].features) for model in ("elastic", "hyperelastic")) for name in detailed}
    return row(claim, "sec. 4.2, fig. 7", "by eye", "features, elastic and hyperelastic: " + _told(counts),
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
    return row(claim, "sec. 4.2, table 2", "by eye", f"features above: {_told(above)}; below: {_told(below)}",
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


def _told(counts):
    return ", ".join(f"{name.replace('_', ' ')} {value[0]} and {value[1]}" if isinstance(value, tuple)
                     else f"{name.replace('_', ' ')} {value}" for name, value in counts.items())
