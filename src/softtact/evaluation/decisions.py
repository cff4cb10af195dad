"""Rows and verdicts of claims, and the rule that decides each on a population: an interval over objects clear of its limit.

The unit is the object (or the indenter, tissue, recording): maps of one object are alike, so they add no evidence of their own. Two
models are compared object by object, so what objects have in common cancels. A claim is decided where there are at least
LEAST_OBJECTS of them and the 95 % interval lies on one side of the limit; it is undecided where the interval holds the limit, and
with fewer objects, whatever their mean.

Why six: of the two-sided tests that assume no distribution, the sign test has the fewest outcomes; for n objects its least
probability is 2 / 2^n, which is below 5 % from six objects on. Intervals of means are Student's, of shares Clopper and Pearson's.
Each verdict stands alone: nothing is corrected for the number of claims. Exact statements (counts, arithmetic of printed numbers,
bits of two files, a formula's range) are no samples and need no interval.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri, stdtrit

REPRODUCED, NOT, CONTRADICTION, ARCHIVE = "reproduced", "not reproduced", "contradicts itself", "needs the archive"
UNDECIDED, MEASUREMENTS = "undecided", "needs the paper's measurements"
CONSISTENT = "consistent in print"      # the paper's numbers agree with each other; nothing of ours was compared
FACTOR = 2.0                            # between times of two machines and solvers that count as equal, up or down; assumed
COLUMNS = ["claim", "where", "paper", "ours", "uncertainty", "verdict", "rule", "evidence"]
LEAST_OBJECTS = 6
LEVEL = 0.95
RULE = f"at least {LEAST_OBJECTS} objects, and the {100 * LEVEL:g} % interval over objects clear of the limit; else undecided"


@dataclass(frozen=True)
class Estimate:
    """A number that was estimated from objects."""

    mean: float
    """The estimate; nan where there is none."""
    low: float
    """Lower end of the 95 % interval; nan where it is not known."""
    high: float
    """Upper end."""
    objects: int
    """How many objects stand behind it; of two groups, those of the smaller one."""

    @property
    def decisive(self) -> bool:
        """Whether enough objects and a finite interval are there."""
        return self.objects >= LEAST_OBJECTS and bool(np.isfinite([self.low, self.high]).all())

    def in_words(self, form: str = "+.3f") -> str:
        """The interval and the number of objects, for the column `uncertainty`."""
        objects = f"{self.objects} object{'' if self.objects == 1 else 's'}"
        if not np.isfinite([self.low, self.high]).all():
            return f"{objects}: no interval"
        return f"{100 * LEVEL:g} % interval {self.low:{form}} to {self.high:{form}} over {objects}"


def mean_over_objects(values: ArrayLike) -> Estimate:
    """The mean of one value (or one paired difference) for each object, values (n,), with Student's interval."""
    known = _finite(values)
    if len(known) < 2:
        return Estimate(float(known.mean()) if len(known) else np.nan, np.nan, np.nan, len(known))
    half = _student(len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known))
    return Estimate(float(known.mean()), float(known.mean() - half), float(known.mean() + half), len(known))


def difference_of_groups(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Mean of `first` (n,) minus that of `second` (m,), of different objects, with Welch's interval."""
    groups = _finite(first), _finite(second)
    fewest = min(map(len, groups))
    gap = float(groups[0].mean() - groups[1].mean()) if fewest else np.nan
    if fewest < 2:
        return Estimate(gap, np.nan, np.nan, fewest)
    variance = np.array([group.var(ddof=1) / len(group) for group in groups])
    freedoms = np.array([len(group) - 1 for group in groups])
    total = variance.sum()
    half = _student(total**2 / (variance**2 / freedoms).sum()) * np.sqrt(total) if total > 0 else 0.0
    return Estimate(gap, float(gap - half), float(gap + half), fewest)


def share_of_objects(hits: int, objects: int) -> Estimate:
    """Share of the objects of which something holds, with the exact interval of Clopper and Pearson."""
    if not objects:
        return Estimate(np.nan, np.nan, np.nan, 0)
    from scipy.stats import binomtest  # half a second, for one kind of claim

    interval = binomtest(hits, objects).proportion_ci(LEVEL, method="exact")
    return Estimate(hits / objects, float(interval.low), float(interval.high), objects)


def wider_spread(first: ArrayLike, second: ArrayLike) -> Estimate:
    """Pitman and Morgan's measure of whether `first` (n,) scatters more over objects than `second` (n,) of the same objects.

    The correlation of their sum with their difference, by Fisher's transformation: above 0 where `first` has the larger variance.
    """
    one, other = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    known = np.isfinite(one) & np.isfinite(other)
    total, gap = (one + other)[known], (one - other)[known]
    if len(gap) < 4 or not (np.ptp(total) > 0 and np.ptp(gap) > 0):
        return Estimate(np.nan, np.nan, np.nan, len(gap))
    correlation = float(np.clip(np.corrcoef(total, gap)[0, 1], -1 + 1e-12, 1 - 1e-12))
    ends = np.tanh(np.arctanh(correlation) + np.array([-1, 1]) * ndtri(0.5 * (1 + LEVEL)) / np.sqrt(len(gap) - 3))
    return Estimate(correlation, float(ends[0]), float(ends[1]), len(gap))


def known_within(value: float, standard_error: float) -> tuple[float, float]:
    """(low, high) of the 95 % interval of a number with a stated standard error."""
    half = float(ndtri(0.5 * (1 + LEVEL))) * standard_error
    return value - half, value + half


def above(estimate: Estimate, limit: float) -> str:
    """The verdict on a claim that the number is above a limit."""
    if not estimate.decisive or estimate.low <= limit <= estimate.high:
        return UNDECIDED
    return REPRODUCED if estimate.low > limit else NOT


def below(estimate: Estimate, limit: float) -> str:
    """The verdict on a claim that the number is below a limit."""
    return above(Estimate(-estimate.mean, -estimate.high, -estimate.low, estimate.objects), -limit)


def inside(estimate: Estimate, low: float, high: float) -> str:
    """The verdict on a claim that the number lies between two limits: the whole interval does, or none of it."""
    return UNDECIDED if not estimate.decisive else interval_inside((estimate.low, estimate.high), low, high)


def interval_inside(interval: tuple[float, float], low: float, high: float) -> str:
    """As `inside` of an interval (low, high) that is not one over objects; undecided where it is not known."""
    if not np.isfinite(interval).all():
        return UNDECIDED
    if low <= interval[0] and interval[1] <= high:
        return REPRODUCED
    return NOT if interval[1] < low or interval[0] > high else UNDECIDED


def all_of(verdicts: Sequence[str]) -> str:
    """The verdict on a claim that says several things: one that does not hold refutes it, one that is open leaves it open."""
    if not verdicts:
        return UNDECIDED
    return next((verdict for verdict in (NOT, UNDECIDED) if verdict in verdicts), REPRODUCED)


def row(claim: str, where: str, paper: str | float, ours: str | float, verdict: str, rule: str, evidence: str, *,
        uncertainty: str = "not told") -> dict[str, str]:
    """One row of a table of claims, by COLUMNS; all but the verdict is text for readers."""
    values = (claim, where, str(paper), str(ours), uncertainty, verdict, rule, evidence)
    return dict(zip(COLUMNS, values, strict=True))


def verdict_of(condition: bool) -> str:
    """The verdict `reproduced` or `not reproduced`."""
    return REPRODUCED if condition else NOT


def within(ours: float, printed: float, *, factor: float = FACTOR) -> bool:
    """Whether a positive number is within a factor of the printed one, up or down."""
    return bool(printed / factor <= ours <= printed * factor)


def _finite(values):
    flat = np.asarray(values, dtype=float).ravel()
    return flat[np.isfinite(flat)]


def _student(freedoms):
    return float(stdtrit(freedoms, 0.5 * (1 + LEVEL)))
