"""Paired comparisons over objects: what a difference of scores is worth, and whether a study can see it at all.

A table of differences (object, seed) has one value for each object and each seed of a training; a seed is the same for all objects.
Objects and seeds are drawn with replacement, independently of each other (crossed): maps of one object are alike, and so are
all scores of one training. Drawn so, the mean of n scatters too little, by the root of (n - 1) / n: of three seeds by a fifth.
So what belongs to an object, and what to a seed, is enlarged by as much before. With few of either percentiles are too narrow,
besides; they are taken farther out, to where Student's interval of a normal sample ends (expanded percentiles, Hesterberg 2015),
with the degrees of freedom of both scatters together (Satterthwaite 1946). The p-value is the level at which that interval
reaches the bound. Several tests of one claim share its level by Holm's rule (Holm 1979).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from softtact.evaluation.decisions import UNDECIDED
from softtact.evaluation.percentiles import FEWEST, expanded_interval

HOLDS, FAILS = "holds", "fails"
DRAWS = 4000
_ROUND_OFF = 1e-12     # of the largest value: a smaller difference is none


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
    least = _ROUND_OFF * max(np.abs(table).max(), abs(bound))
    if np.ptp(table) <= least:
        return _certain(mean, bound, (objects, seeds), least)
    freedom = _freedom([(_variance(table.mean(axis=1)), objects), (_variance(table.mean(axis=0)), seeds)])
    means = bootstrap_means(_enlarged(table), draws=draws, seed=seed)
    return _compared(mean, means, bound, (objects, seeds), freedom, level, least)


def _enlarged(table):
    """The table with what belongs to its objects, and to its seeds, enlarged by what drawing with replacement takes from it."""
    of_objects, of_seeds = (table.mean(axis=axis, keepdims=True) - table.mean() for axis in (1, 0))
    objects, seeds = table.shape
    grown = [np.sqrt(count / (count - 1)) - 1 if count > 1 else 0.0 for count in (objects, seeds)]
    return table + grown[0] * of_objects + grown[1] * of_seeds


def _variance(means):
    """Of the mean of some means."""
    return float(means.var(ddof=1) / len(means)) if len(means) > 1 else 0.0


def _freedom(parts):
    """Degrees of freedom of a sum of variances of means, [(variance, number of means)]; inf of one that is 0."""
    whole = sum(variance for variance, _ in parts)
    return whole**2 / sum(variance**2 / (count - 1) for variance, count in parts if count > 1) if whole > 0 else np.inf


def _certain(mean, bound, counts, least):
    """The `Comparison` of a mean without scatter, of counts (objects, seeds); it is the bound where they differ by `least`."""
    off = mean - bound
    return Comparison(mean, mean, mean, float(off <= least), float(off >= -least), *counts)


def _compared(mean, means, bound, counts, freedom, level, least):
    """The `Comparison` of a mean whose bootstrap gave `means` (draws,), of counts (objects, seeds); no scatter is below `least`."""
    if np.ptp(means) <= least:
        return _certain(mean, bound, counts, least)
    low, high = expanded_interval(means, stats.t.ppf(0.5 * (1 + level), freedom))
    above, below = (_p_value(sign * (means - bound), freedom) for sign in (1, -1))
    return Comparison(mean, low, high, above, below, *counts)


def compare_groups(first: np.ndarray, second: np.ndarray, *, level: float = 0.95, draws: int = DRAWS, seed: int = 0) -> Comparison:
    """`Comparison` with 0 of how much larger the mean of the first differences (object, seed) is than that of the second ones.

    Objects of the two are others and are drawn independently; seeds are the same.
    """
    tables = [np.atleast_2d(np.asarray(one, dtype=float).T).T for one in (first, second)]
    objects, seeds = min(len(one) for one in tables), tables[0].shape[1]
    mean = float(tables[0].mean() - tables[1].mean())
    if objects < 2:
        return Comparison(mean, np.nan, np.nan, 1.0, 1.0, objects, seeds)
    rng = np.random.default_rng(seed)
    columns = _weights(rng, seeds, draws)
    one, other = (np.einsum("do,os,ds->d", _weights(rng, len(table), draws), _enlarged(table), columns, optimize=True)
                  for table in tables)
    parts = [(_variance(table.mean(axis=1)), len(table)) for table in tables]
    of_seeds = tables[0].mean(axis=0) - tables[1].mean(axis=0)
    least = _ROUND_OFF * max(np.abs(table).max() for table in tables)
    return _compared(mean, one - other, 0.0, (objects, seeds), _freedom([*parts, (_variance(of_seeds), seeds)]), level, least)


def bootstrap_means(table: np.ndarray, *, draws: int, seed: int) -> np.ndarray:
    """Means (draws,) of a table (object, seed), rows and columns drawn with replacement and independently of each other."""
    rng = np.random.default_rng(seed)
    rows, columns = (_weights(rng, count, draws) for count in table.shape)
    return np.einsum("do,os,ds->d", rows, table, columns, optimize=True)


def _weights(rng, count, draws):
    """Shares (draws, count) with which each of `count` things is drawn, `count` times."""
    return rng.multinomial(count, np.full(count, 1 / count), size=draws) / count


def _p_value(means, freedom):
    """The level whose expanded percentile of the means (draws,) is 0; beyond the last draws as if the means were normal."""
    share = (means <= 0).mean()
    quantile = stats.norm.ppf(share) if FEWEST <= share * len(means) <= len(means) - FEWEST else -means.mean() / means.std()
    return float(stats.t.cdf(quantile, freedom))


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
    """`holds` or `fails` where one side is excluded, else, and with few objects always, `undecided`.

    level: of both sides together, half of it for each: the chance of a verdict where there is no difference
    """
    if objects < least_objects:
        return UNDECIDED
    return HOLDS if p_above < 0.5 * level else FAILS if p_below < 0.5 * level else UNDECIDED


def power(effect: float, *, objects: int | Sequence[int], seeds: int, object_sd: float, seed_sd: float, level: float) -> float:
    """Chance that Student's test tells a mean above 0, one side of it, at a level, of normal differences with these spreads.

    objects: their number, or those of two groups whose means are compared;  object_sd: standard deviation between objects
    seed_sd: of one training against another, the same for all objects; nothing where there is a single seed, of a formula
    By the noncentral t distribution, with degrees of freedom as in `compare`; without any spread 1 for an effect above 0, else 0.
    """
    sizes = np.atleast_1d(objects).tolist()
    if min(sizes) < 2:
        return 0.0
    parts = [(object_sd**2 / size, size) for size in sizes] + ([(seed_sd**2 / seeds, seeds)] if seeds > 1 else [])
    spread, freedom = np.sqrt(sum(variance for variance, _ in parts)), _freedom(parts)
    if spread == 0:
        return float(effect > 0)
    return float(stats.nct.sf(stats.t.isf(level, freedom), freedom, effect / spread))
