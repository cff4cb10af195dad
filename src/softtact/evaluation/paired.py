"""Paired comparisons over objects: what a difference of scores is worth, and whether a study can see it at all.

A table of differences (object, seed) has one value for each object and each seed of a training; a seed is the same for all objects.
Objects and seeds are drawn with replacement, independently of each other (crossed): maps of one object are alike, and so are
all scores of one training. With few objects plain percentiles are too narrow; they are taken farther out, to where
Student's interval of a normal sample ends (expanded percentiles, Hesterberg 2015). The p-value is the level at which that
interval reaches the bound. Several tests of one claim share its level by Holm's rule (Holm 1979).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from softtact.evaluation.decisions import UNDECIDED

HOLDS, FAILS = "holds", "fails"
DRAWS = 4000
_FEWEST = 10      # draws on one side of a bound from which its share is read


@dataclass(frozen=True)
class Comparison:
    """The mean of a paired difference against a bound."""

    mean: float
    """Over objects and seeds."""
    low: float
    """Of the two-sided interval of the mean; nan with fewer than two objects."""
    high: float
    """Upper end of the interval."""
    p_above: float
    """Of the hypothesis that the mean is at most the bound; 1 with fewer than two objects."""
    p_below: float
    """Of the hypothesis that it is at least the bound; 1 with fewer than two objects."""
    objects: int
    """How many there are."""
    seeds: int
    """How many trainings; 1 where nothing is trained."""


def compare(differences: np.ndarray, *, bound: float = 0.0, level: float = 0.95, draws: int = DRAWS, seed: int = 0) -> Comparison:
    """`Comparison` of the mean of differences (object, seed) with a bound, by a crossed bootstrap.

    Without any scatter the mean is certain: then p is 0 on the side of the bound where it lies, and 1 on both where it is the
    bound.
    """
    table = np.atleast_2d(np.asarray(differences, dtype=float).T).T
    objects, seeds = table.shape
    mean = float(table.mean())
    if objects < 2:
        return Comparison(mean, np.nan, np.nan, 1.0, 1.0, objects, seeds)
    if np.ptp(table) == 0:
        return Comparison(mean, mean, mean, float(mean <= bound), float(mean >= bound), objects, seeds)
    return _compared(mean, bootstrap_means(table, draws=draws, seed=seed), bound, objects, seeds, level)


def _compared(mean, means, bound, objects, seeds, level):
    """The `Comparison` of a mean whose bootstrap gave `means` (draws,)."""
    if np.ptp(means) == 0:
        return Comparison(mean, mean, mean, float(mean <= bound), float(mean >= bound), objects, seeds)
    tail = stats.norm.cdf(-np.sqrt(objects / (objects - 1)) * stats.t.ppf(0.5 * (1 + level), objects - 1))
    low, high = np.quantile(means, [tail, 1 - tail])
    above, below = (_p_value(sign * (means - bound), objects) for sign in (1, -1))
    return Comparison(mean, float(low), float(high), above, below, objects, seeds)


def compare_groups(first: np.ndarray, second: np.ndarray, *, level: float = 0.95, draws: int = DRAWS, seed: int = 0) -> Comparison:
    """`Comparison` with 0 of how much larger the mean of the first differences (object, seed) is than that of the second ones.

    Objects of the two are others and are drawn independently; seeds are the same. Student's interval has the degrees of freedom of
    the smaller group.
    """
    tables = [np.atleast_2d(np.asarray(one, dtype=float).T).T for one in (first, second)]
    objects, seeds = min(len(one) for one in tables), tables[0].shape[1]
    mean = float(tables[0].mean() - tables[1].mean())
    if objects < 2:
        return Comparison(mean, np.nan, np.nan, 1.0, 1.0, objects, seeds)
    rng = np.random.default_rng(seed)
    columns = _weights(rng, seeds, draws)
    one, other = (np.einsum("do,os,ds->d", _weights(rng, len(table), draws), table, columns, optimize=True) for table in tables)
    return _compared(mean, one - other, 0.0, objects, seeds, level)


def bootstrap_means(table: np.ndarray, *, draws: int, seed: int) -> np.ndarray:
    """Means (draws,) of a table (object, seed), rows and columns drawn with replacement and independently of each other."""
    rng = np.random.default_rng(seed)
    rows, columns = (_weights(rng, count, draws) for count in table.shape)
    return np.einsum("do,os,ds->d", rows, table, columns, optimize=True)


def _weights(rng, count, draws):
    """Shares (draws, count) with which each of `count` things is drawn, `count` times."""
    return rng.multinomial(count, np.full(count, 1 / count), size=draws) / count


def _p_value(means, objects):
    """The level whose expanded percentile of the means (draws,) is 0; beyond the last draws as if the means were normal."""
    share = (means <= 0).mean()
    quantile = stats.norm.ppf(share) if _FEWEST <= share * len(means) <= len(means) - _FEWEST else -means.mean() / means.std()
    return float(stats.t.cdf(quantile * np.sqrt((objects - 1) / objects), objects - 1))


def holm(p_values: Sequence[float] | np.ndarray) -> np.ndarray:
    """Holm's adjusted p-values (n,): each is compared with the level itself, and all are right together with its probability."""
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate((len(p) - np.arange(len(p))) * p[order]))
    return adjusted


def permutation_p(gains: np.ndarray, shares: np.ndarray, *, draws: int = DRAWS, seed: int = 0) -> float:
    """How probable it is that a choice by chance, of the same shares, gains as much as the given one.

    gains (object,): what the dearer model scores more;  shares (object,): how often, of several remeshings, it was taken
    1 where all shares are equal: then nothing was chosen.
    """
    gains, shares = np.asarray(gains, dtype=float), np.asarray(shares, dtype=float)
    if len(gains) < 2 or np.ptp(shares) == 0:
        return 1.0
    rng = np.random.default_rng(seed)
    seen = float(gains @ shares)
    by_chance = rng.permuted(np.tile(gains, (draws, 1)), axis=1) @ shares
    return float((1 + (by_chance >= seen - 1e-12 * np.abs(gains).sum()).sum()) / (1 + draws))


def verdict(p_above: float, p_below: float, *, objects: int, least_objects: int, level: float = 0.05) -> str:
    """Of adjusted p-values: `holds` or `fails` where one side is excluded, else, and with few objects always, `undecided`."""
    if objects < least_objects:
        return UNDECIDED
    return HOLDS if p_above < level else FAILS if p_below < level else UNDECIDED


def power(effect: float, *, objects: int, seeds: int, object_sd: float, seed_sd: float, level: float) -> float:
    """Chance that Student's test tells a mean above 0 at a level, of normal differences with this mean and these spreads.

    object_sd: standard deviation between objects;  seed_sd: of one training against another, the same for all objects
    By the noncentral t distribution; the trainings' spread counts to that of the mean.
    """
    if objects < 2:
        return 0.0
    spread = np.sqrt(object_sd**2 / objects + seed_sd**2 / seeds)
    return float(stats.nct.sf(stats.t.isf(level, objects - 1), objects - 1, effect / spread))
