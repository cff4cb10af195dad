"""Claims on what the deformation maps of the grasped objects show, and which features of an object a model loses."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import (
    ARCHIVE,
    LEAST_OBJECTS,
    RULE,
    UNDECIDED,
    above,
    all_of,
    below,
    difference_of_groups,
    mean_over_objects,
    row,
)
from softtact.published.archive import SOURCE as PUBLISHED

RELIEF, STEPPED = "object_4", ("object_5", "object_6")
TENFOLD = 10.0  # NPt over CHt: from here on objects show "more detailed deformation patterns"
LOST, KEPT = 0.1, 0.3  # of the raised features' deformation: a lower one below is lost, above is seen; assumed
LARGE_STRAIN = 0.1  # from which on a rubber's law is not a line
_FEATURES, _PRESSES = "evaluation/features.csv", "needs presses of these objects"
_COUNTED = "counts; a feature is a part of the map above half of its maximum"
_SURFACES = "the elastic map is of the layer's top, the hyperelastic one of the electrodes' plane below cover and sheet"
_MODELS = ("elastic", "hyperelastic")
_FIGURE = ("sec. 4.2, fig. 7", "by eye")
LOWER_RULE = (
    f"of objects whose lower feature the virtual sensor's own map shows above {KEPT:g} of the raised ones: below {LOST:g} with "
    f"the elastic model, above {KEPT:g} with the hyperelastic one; {RULE}"
)


def claims_of_maps(
    features: pd.DataFrame | None, complexity: pd.DataFrame, *, reference: str, source: str
) -> Iterator[dict[str, str]]:
    """A row for each; features as of `evaluation.curve_shape`, or None where nothing was pressed.

    reference: name of the model that the virtual sensor reads, whose maps are the truth here;  source: of the readings
    """
    table = features.set_index(["item", "model"]) if features is not None else None
    yield _lower_features(table, reference)
    yield _real_maps(table, reference, source)
    yield _reliefs(table)
    yield _fewer_details(table, complexity)
    yield _tenfold(table, complexity)
    yield _large_strain(features)


def judge_lower_features(elastic: Sequence[float], hyperelastic: Sequence[float]) -> str:
    """The verdict on lost lower features by their shares of the raised ones with both models, of objects whose truth shows them."""
    return all_of([below(mean_over_objects(elastic), LOST), above(mean_over_objects(hyperelastic), KEPT)])


def _known(table, items, models=_MODELS):
    return table is not None and all((item, model) in table.index for item in items for model in models)


def _with_lower_feature(table):
    """Objects that both models pressed and that have a feature 0.5 mm lower, in the order of the table."""
    if table is None:
        return []
    items = dict.fromkeys(item for item, _ in table.index)
    return [item for item in items if _known(table, [item]) and table.loc[(item, "hyperelastic")].lower_points > 0]


def _lower_features(table, reference):
    claim = "A feature 0.5 mm lower: the elastic model loses it, the hyperelastic one sees it (objects 5 and 6)"
    items = _with_lower_feature(table)
    if not items:
        return row(claim, *_FIGURE, "no object with such a feature was pressed by both models", UNDECIDED, _PRESSES, _FEATURES)
    share = {
        model: {item: float(table.loc[(item, model)].lower_share) for item in items if (item, model) in table.index}
        for model in (*_MODELS, reference)
    }
    seen = [item for item in items if share[reference].get(item, 0.0) > KEPT]
    force = max(float(table.loc[(item, "hyperelastic")].force_n) for item in items)
    listed = "; ".join(
        f"{item.replace('_', ' ')} "
        + ", ".join(f"{share[model][item]:z.2f}" if item in share[model] else "not pressed" for model in share)
        for item in items
    )
    return row(
        claim,
        *_FIGURE,
        f"share of the raised features at {force:g} N, elastic, hyperelastic, virtual sensor's own map: {listed}",
        judge_lower_features(*([share[model][item] for item in seen] for model in _MODELS)),
        LOWER_RULE,
        _FEATURES,
        uncertainty=f"the truth shows the feature on {len(seen)} of {len(items)} objects",
    )


def _real_maps(table, reference, source):
    """The paper's truth: its sensor shows both features. Ours is a simulation, so it cannot tell."""
    claim = "The real maps of objects 5 and 6 show both features"
    rule = "the real readings above the lower features; those of a virtual sensor are no evidence"
    found = [
        f"{item.replace('_', ' ')} {float(table.loc[(item, reference)].lower_share):z.2f} of the raised ones"
        for item in STEPPED
        if _known(table, [item], [reference])
    ]
    verdict = UNDECIDED if source == PUBLISHED else ARCHIVE
    shown = (
        f"lower features in the virtual sensor's own deformation: {', '.join(found)}"
        if found
        else ("the archive holds no mesh that says where a reading's features lie" if source == PUBLISHED else "not pressed here")
    )
    return row(claim, *_FIGURE, shown, verdict, rule, _FEATURES, uncertainty="of the virtual sensor: one law, one specimen")


def _reliefs(table):
    claim = "object 4: both models show the object's reliefs"
    rule = (
        f"as many features in both models' maps, and more than one, on at least {LEAST_OBJECTS} objects with reliefs; one object, "
        "which is ours and not the paper's, decides nothing"
    )
    if not _known(table, [RELIEF]):
        return row(claim, *_FIGURE, "not pressed here", UNDECIDED, _PRESSES, _FEATURES)
    counts = {model: int(table.loc[(RELIEF, model)].features) for model in _MODELS}
    return row(claim, *_FIGURE, _counted(counts), UNDECIDED, rule, _FEATURES, uncertainty=f"1 object; {_COUNTED}")


def _fewer_details(table, complexity):
    claim = "On detailed objects the elastic model captures fewer details"
    detailed = [name for name in complexity[complexity.model == "hyperelastic"].object if _known(table, [name])]
    rule = (
        "hyperelastic minus elastic features above 0, over the objects that the rule sends to the hyperelastic model; undecided as "
        "long as both maps are of different surfaces, whatever the counts"
    )
    if not detailed:
        return row(claim, *_FIGURE, "such objects in this study: 0", UNDECIDED, rule, _FEATURES)
    counts = {name: tuple(int(table.loc[(name, model)].features) for model in _MODELS) for name in detailed}
    gap = mean_over_objects([many - few for few, many in counts.values()])
    return row(
        claim,
        *_FIGURE,
        "features, elastic and hyperelastic: " + _counted(counts),
        UNDECIDED,
        rule,
        _FEATURES,
        uncertainty=f"{gap.in_words('+.1f')}; {_COUNTED}; {_SURFACES}",
    )


def _tenfold(table, complexity):
    claim, place = "Objects with NPt of ten times CHt or more show more detailed deformation", ("sec. 4.2, table 2", "by eye")
    rule = f"mean number of features in the hyperelastic map above that of the other objects; in each group {RULE}"
    ratio = complexity.set_index("object").pipe(lambda frame: frame.NPt / frame.CHt) if "NPt" in complexity else {}
    known = [name for name in complexity.object if _known(table, [name], ["hyperelastic"])] if len(ratio) else []
    many, few = (
        {name: int(table.loc[(name, "hyperelastic")].features) for name in known if (ratio[name] >= TENFOLD) == side}
        for side in (True, False)
    )
    if not many or not few:
        return row(claim, *place, f"objects above: {len(many)}, below: {len(few)}", UNDECIDED, rule, _FEATURES)
    gap = difference_of_groups(list(many.values()), list(few.values()))
    return row(
        claim,
        *place,
        f"features above: {_counted(many)}; below: {_counted(few)}",
        above(gap, 0.0),
        rule,
        _FEATURES,
        uncertainty=f"{gap.in_words('+.1f')} in the smaller group; {_COUNTED}; of the electrodes' plane, while the paper speaks of "
        "the sensor's surface, too, which shows more",
    )


def _large_strain(features):
    claim = "The dielectric is strained so much that its law is not linear"
    rule = f"the most compressed frustum is shortened by more than {LARGE_STRAIN:.0%} of its height; {RULE}"
    shares = features[features.model == "hyperelastic"].frustum_share if features is not None else np.zeros(0)
    if not len(shares):
        return row(claim, "sec. 3.1", "large elastic deformations", "not pressed here", UNDECIDED, _PRESSES, _FEATURES)
    mean = mean_over_objects(shares)
    return row(
        claim,
        "sec. 3.1",
        "large elastic deformations",
        f"{shares.min():.0%} to {shares.max():.0%} of the height at {features.force_n.max():g} N",
        above(mean, LARGE_STRAIN),
        rule,
        _FEATURES,
        uncertainty=mean.in_words(".2f"),
    )


def _counted(counts):
    """Counts of features by object or model, in words."""
    return ", ".join(
        f"{name.replace('_', ' ')} {value[0]} and {value[1]}" if isinstance(value, tuple) else f"{name.replace('_', ' ')} {value}"
        for name, value in counts.items()
    )
