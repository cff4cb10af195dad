"""The paper's claims, each with its number, ours, and a verdict computed by the rule that stands beside it.

`reproduced` is a verdict on numbers of ours alone. Rows that hold the paper's numbers against each other are `consistent in print`
or `contradicts itself`. A rule on a number has two sides: too large is as wrong as too small. A claim on objects is decided by one
rule for all (`evaluation.decisions`): few objects, or an interval that holds the limit, leave it `undecided`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from softtact.evaluation.decisions import ARCHIVE, COLUMNS, MEASUREMENTS
from softtact.evaluation.score_tables import untrained
from softtact.published.archive import SOURCE as PUBLISHED
from softtact.studies.hybrid.claims.in_print import claims_in_print
from softtact.studies.hybrid.claims.of_choice import claims_of_choice
from softtact.studies.hybrid.claims.of_maps import claims_of_maps
from softtact.studies.hybrid.claims.of_readings import VIRTUAL, claims_of_scores
from softtact.studies.hybrid.claims.of_study import PAPERS_SENSOR, claims_of_study
from softtact.studies.hybrid.claims.of_tests import claims_of_dielectric, claims_of_materials
from softtact.studies.hybrid.claims.of_times import claims_of_times

if TYPE_CHECKING:
    from softtact.studies.hybrid.tables import Counts, Times


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What the claims are judged on: the contents of the study's files, and the paper's printed numbers.

    The claims on a table that is None are left open.
    """

    cards: Sequence[dict[str, Any]]
    """A material card for each material."""
    complexity: pd.DataFrame
    """A row for each object: its counts of points and hulls, and the chosen model."""
    ftir: dict[str, Any]
    """The summary of the dielectric's contact area on glass."""
    ssim: pd.DataFrame
    """A row for each map: SSIM and errors of its predicted reading."""
    timing: pd.DataFrame
    """A row for each map: seconds of solver and network."""
    choose: Callable[..., str]
    """The rule: the model for the counts (NPt, CHt, NPo, CHo)."""
    printed_counts: "dict[str, Counts]"
    """Of table 2, by object."""
    printed_times: "dict[str, Times]"
    """Of table 3, by model, in s."""
    source: str = VIRTUAL
    """Of the readings; a verdict on the paper's numbers needs the published archive's."""
    sensor: str = PAPERS_SENSOR
    """The sensor's name."""
    reference: str = "reference"
    """Name of the model that the virtual sensor reads: in `features` the truth beside the tested models."""
    summary: pd.DataFrame | None = None
    """Mean SSIM of each model and set, with intervals."""
    per_item: pd.DataFrame | None = None
    """Mean SSIM of each model, set and item, with intervals."""
    ceiling: pd.DataFrame | None = None
    """SSIM of repeated readings of one press against each other."""
    features: pd.DataFrame | None = None
    """Features of each object's deformation map, by model; of the reference, too, where readings are the virtual sensor's."""
    scores: pd.DataFrame | None = None
    """The `score_table` of networks and trivial predictors."""
    searches: dict[str, dict[str, Any]] | None = None
    """The best trial of each model's search."""
    repeated: dict[str, float] | None = None
    """Largest difference in mm of the maps of a press done twice, by model."""
    taxels: pd.DataFrame | None = None
    """The largest reading of each taxel under the indenters."""


def claims(evidence: Evidence) -> pd.DataFrame:
    """Data frame with `decisions.COLUMNS`, a row for each claim."""
    bad = None if evidence.scores is None else untrained(evidence.scores)
    rows = [*claims_of_materials(evidence.cards), *claims_of_dielectric(evidence.ftir),
            *claims_of_choice(evidence.complexity, choose=evidence.choose, printed_counts=evidence.printed_counts,
                              ssim=evidence.ssim, timing=evidence.timing, source=evidence.source),
            *claims_of_maps(evidence.features, evidence.complexity, reference=evidence.reference, source=evidence.source),
            *claims_of_scores(evidence.ssim, source=evidence.source, summary=evidence.summary, per_item=evidence.per_item,
                              ceiling=evidence.ceiling, untrained=bad, scores=evidence.scores),
            *claims_of_times(evidence.timing, evidence.printed_times),
            *claims_of_study(searches=evidence.searches, repeated=evidence.repeated, taxels=evidence.taxels,
                             sensor=evidence.sensor, untrained=bad, source=evidence.source),
            *claims_in_print(printed_counts=evidence.printed_counts, printed_times=evidence.printed_times)]
    frame = pd.DataFrame(rows, columns=COLUMNS)
    # The archive has maps and readings; stress-strain curves and camera frames of the paper are not in it.
    return frame.replace({"verdict": {ARCHIVE: MEASUREMENTS}}) if evidence.source == PUBLISHED else frame
