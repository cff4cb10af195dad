"""The paper's claims by the hypotheses: each with what it rests on; `undecided` wherever a test could not tell."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from softtact.evaluation.decisions import COLUMNS, NOT, REPRODUCED, UNDECIDED, row
from softtact.evaluation.paired import FAILS, HOLDS
from softtact.studies.decide.config import CONTROLS
from softtact.studies.decide.hypotheses import shown_in_scored
from softtact.words import numbered

_CLAIMS = {
    "detail": ("The hyperelastic model shows detail that the elastic one loses", "sec. 4.2, fig. 7", "by eye",
               "on stepped objects the hyperelastic model scores more than the elastic one, by all readouts, scores and truths"),
    "detail_more": ("It does so on detailed objects, and the two agree on smooth ones", "sec. 4.2", "by eye",
                    "the difference is larger on stepped than on smooth objects, by all readouts, scores and truths"),
    "not_stiffness": ("What it shows more is hyperelastic, not a matter of stiffness", "sec. 1, 5", "implied",
                      "on stepped objects the hyperelastic model scores more than an elastic layer with a modulus matched to it"),
    "balance": ("The hybrid is as accurate as the hyperelastic model", "abstract, sec. 5", "described",
                "the hybrid's scores are within the margin of the hyperelastic model's"),
    "choice": ("An object's complexity chooses the model rightly", "sec. 3.3.1, table 2", "described",
               "the rule's choice scores more than a choice by chance of the same share (permutation)"),
    "cost": ("The hybrid takes at most half of the hyperelastic model's time", "table 3", "37.4 and 162.1 s a map",
             "presses of all objects, one thread each, as many at a time as there are cores and no more"),
}
_BY = {"choice": "permutation of the objects", "cost": "bootstrap over objects"}      # else over objects and seeds
_FEW = 4      # failing tests that are named

_CONTROLS = [("ceiling", HOLDS, "Control: where the truth is the hyperelastic model, it scores more than the elastic one"),
             ("flipped", FAILS,
              "Control: where the truth is the matched elastic layer, it scores more than the hyperelastic one")]


def claims_of_decision(tables: Mapping[str, pd.DataFrame], *, statistics: Mapping[str, Any], truths: list[str],
                       printed: bool) -> pd.DataFrame:
    """Data frame with `decisions.COLUMNS`; tables: the study's, by name;  printed: whether the paper's network was trained."""
    hypotheses = tables["hypotheses"]
    rows = [_claim(claim, hypotheses[(hypotheses.claim == claim) & ~hypotheses.truth.isin(list(CONTROLS))], tables["power"])
            for claim in _CLAIMS]
    shown = shown_in_scored(tables["scores"], tables["collapse"], share=statistics["shown_share"])
    rows += [_contains(truth, shown.get(truth, 0), statistics) for truth in truths]
    rows += [*_controls(hypotheses), _collapsed(hypotheses, truths), _curve(tables["learning_curve"], printed, statistics)]
    return pd.DataFrame(rows, columns=COLUMNS)


def _power_in_words(power):
    """The stated power of a claim's tests, and of all together; empty where none was stated."""
    if not len(power):
        return ""
    least, most, whole = power.power.min(), power.power.max(), power.power_of_claim.iloc[0]
    return f"; stated power of a test {least:.2f} to {most:.2f}, of all together {whole:.2g}"


def _claim(claim, own, power):
    """One claim from its tests: reproduced where all hold, each alone, not where one fails by Holm's rule, else undecided."""
    words, where, paper, rule = _CLAIMS[claim]
    if not len(own):
        return row(words, where, paper, "not tested", UNDECIDED, rule, "tables/hypotheses.csv")
    counts, alone = own.verdict.value_counts(), own.alone.value_counts()
    verdict = NOT if counts.get(FAILS, 0) else REPRODUCED if alone.get(HOLDS, 0) == len(own) else UNDECIDED
    said = ", ".join(f"{number} {word}" for word in (HOLDS, FAILS, UNDECIDED) if (number := counts.get(word, 0)))
    said += f" ({alone.get(HOLDS, 0)} hold alone)" if alone.get(HOLDS, 0) != counts.get(HOLDS, 0) else ""
    failing = own[(own.verdict == FAILS) & own.truth.notna()]
    if 0 < len(failing) <= _FEW:
        said += f" (fails: {'; '.join(f'{one.truth}, {one.readout}, {one.score}' for one in failing.itertuples())})"
    spans = "; ".join(f"{score}: {part['mean'].min():.3g} to {part['mean'].max():.3g}" for score, part in own.groupby("score"))
    objects, tests = numbered(int(own.objects.min()), "object"), numbered(len(own), "test")
    seeds = f"{own.seeds.min():g} to {own.seeds.max():g} seeds"
    uncertainty = f"{_BY.get(claim, f'paired bootstrap over objects and {seeds}')}, {objects}; {tests} (a failure: by Holm's rule)"
    uncertainty += _power_in_words(power[power.claim == claim])
    return row(words, where, paper, f"{tests}: {said}; mean differences {spans}", verdict, rule, "tables/hypotheses.csv",
               uncertainty=uncertainty)


def _contains(truth, count, statistics):
    """Whether a truth contains what is to be seen in it."""
    least = statistics["least_shown"]
    return row(f"Truth {truth} contains lower features that a map can show", "control", f"at least {least} objects",
               f"{count} objects whose map shows more than {statistics['shown_share']:g} of the raised features' deformation",
               REPRODUCED if count >= least else UNDECIDED, "at the largest force that is scored", "tables/collapse.csv",
               uncertainty="none: counted")


def _controls(hypotheses) -> Iterator[dict[str, str]]:
    """The two controls: a truth that is the tested model, and one for which the sign must flip."""
    for truth, side, words in _CONTROLS:
        claim = "detail" if truth == "ceiling" else "not_stiffness"
        own = hypotheses[(hypotheses.truth == truth) & (hypotheses.claim == claim)]
        wrong = FAILS if side == HOLDS else HOLDS
        verdict = NOT if (own.verdict == wrong).any() else REPRODUCED if len(own) and (own.verdict == side).all() else UNDECIDED
        means = "; ".join(f"{one.readout}, {one.score}: {one.mean:.3g}" for one in own.itertuples())
        yield row(words, "control", "must hold", means, verdict, "every test has this sign", "tables/hypotheses.csv",
                  uncertainty="; ".join(f"{one.low:.3g} to {one.high:.3g}" for one in own.itertuples()))


def _collapsed(hypotheses, truths):
    """One curve of the lower feature's share for all models, or two."""
    own = hypotheses[(hypotheses.claim == "collapse")]
    shown = "; ".join(f"{one.truth}: {one.mean:+.3f} ({one.low:+.3f} to {one.high:+.3f}), {one.verdict}"
                      for one in own.itertuples())
    verdict = NOT if (own.verdict == FAILS).any() else REPRODUCED if len(own) and (own.alone == HOLDS).all() else UNDECIDED
    return row("At equal step over indentation a hyperelastic sensor shows more of the lower feature than any elastic layer",
               "fig. 1, 7", "implied", shown or "no object shows both", verdict,
               "share of the raised features' deformation where the lower one is reached, against elastic layers of all moduli",
               "tables/collapse.csv", uncertainty="paired bootstrap over objects")


def _curve(curve, printed, statistics):
    """Whether the networks have seen enough maps."""
    ends = curve.drop_duplicates(["truth", "model", "readout"])
    enough = len(ends) and ends.flat.all() and curve.indenters.max() >= statistics["least_objects"]
    said = [f"{own.flat.sum()} of {len(own)} learning curves of the {readout} network are flat at their end"
            for readout, own in ends.groupby("readout", sort=False)]
    said += [] if printed else ["the printed network is not trained here (learning.printed)"]
    return row("The networks are trained on enough maps", "sec. 3.3.2", "13,000 maps",
               "; ".join(said),
               REPRODUCED if enough else UNDECIDED,
               "at the rate of its last step, twice as many indenters change the error by less than 5 % of itself",
               "tables/learning_curve.csv", uncertainty="one seed")
