"""Fit of a Prony series to tests over time, with uncertainty.

Symbols       of test k the data y_kj > 0 and its scale a_k, the instantaneous modulus in its measure; g_i, tau_i as in `prony.py`
Residual      a_k model_kj(g, tau)/y_kj - 1: each value counts by its relative error, as small loss moduli need it
Start         the moduli c_i = a g_i and c_inf = a g_inf enter linearly; non-negative least squares finds them on log-spaced times
Refinement    of c, ln tau and the other tests' scales, by bounded least squares
Terms         the number with the least corrected Akaike criterion (AICc); none is tried after two more that do not lower it
Consistency   storage and loss modulus of a passive solid have one spectrum of times without negative moduli (Kramers and Kronig);
              the series with 12 times per decade that follows both best tells how far they disagree
References    Baumgaertel and Winter, Rheol. Acta 28 (1989) 511-519; Ferry, Viscoelastic Properties of Polymers (1980);
              Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23 (non-negative least squares)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import least_squares, nnls

from softtact.errors import InputError
from softtact.materials.checks import MODULI_APART
from softtact.materials.prony import INSTANTANEOUS, PronySeries
from softtact.materials.time_tests import FREQUENCY, TimeTest
from softtact.materials.uncertainty import corrected_aic, covariance_of, unseen

MOST_TERMS = 10
_PER_DECADE = 1.5       # terms; more follow noise
_REACH = 10.0           # times may lie beyond the tested window by this factor
_DENSE = 12             # times per decade that stand for a spectrum
_LEAST_RELAXED = 1e-4   # share of the modulus that a solid keeps
_APART = 1.5            # ratio of two tests' shear moduli from which that is said; specimens differ by some 10 to 20 %
_INCONSISTENT = 0.1     # relative error of the best spectrum from which storage and loss modulus are said to disagree


@dataclass(frozen=True)
class PronyFit:
    """A fitted series.

    scales: (k,) instantaneous modulus in the measure of each test;  relative_error: root mean square over all values
    standard_error: {"g": (n,), "tau_s": (n,)}, None where the data do not determine the constants together
    not_identifiable: names of constants that the data do not determine, such as g2 or tau2
    window_s: shortest and longest time that the tests resolve;  aicc: {terms tried: criterion};  stated: the number was stated
    """

    series: PronySeries
    scales: np.ndarray
    relative_error: float
    standard_error: dict | None
    not_identifiable: list
    window_s: tuple[float, float]
    aicc: dict = field(default_factory=dict)
    stated: bool = False
    tests: tuple = ()

    @property
    def shear_modulus_mpa(self) -> float | None:
        """Instantaneous shear modulus by the tests whose measure tells it; None without one."""
        known = [modulus for modulus, _ in _shear_moduli(self.tests, self.scales)]
        return float(np.mean(known)) if known else None

    @property
    def warnings(self) -> Iterator[str]:
        """Sentences on what the data do not determine, and on data that contradict each other."""
        yield from (remark for test in self.tests for remark in test.remarks)
        low, high = self.window_s
        for k, tau in enumerate(self.series.tau_s, 1):
            if not low <= tau <= high:
                yield (f"prony: the relaxation time tau{k} of {tau:.3g} s lies outside of the tested {low:.3g} to {high:.3g} s; "
                       "test longer, or at other frequencies, or ask for fewer terms (--prony).")
        if self.not_identifiable:
            yield f"prony: these tests do not determine {', '.join(self.not_identifiable)} (standard error above 100 %)."
        if self.series.relaxed_share < 2 * _LEAST_RELAXED:
            yield "prony: the modulus relaxes to nothing within the tests, so the relaxed modulus is not known; test longer."
        for test in self.tests:
            yield from _disagreement(test)
        if (apart := _apart(self.tests, self.scales)) and apart[0] > _APART:
            yield f"prony: the {apart[1]}; check their units, temperatures and specimens."

    def entry(self) -> dict[str, Any]:
        """The card's block `prony`."""
        return {
            "g": list(self.series.g), "tau_s": list(self.series.tau_s), "moduli": self.series.moduli,
            "standard_error": self.standard_error, "not_identifiable": self.not_identifiable,
            "relative_error": self.relative_error, "window_s": list(self.window_s),
            "terms_by": "stated" if self.stated else "least AICc",
            "aicc": {str(terms): value for terms, value in self.aicc.items()},
            "tests": [{"mode": test.mode, "source": test.source, "points": len(test.at), "instantaneous_modulus": float(scale)}
                      for test, scale in zip(self.tests, self.scales, strict=True)],
        }  # fmt: skip


def fit_prony(tests: Sequence[TimeTest], *, terms: int | None = None, moduli: str = INSTANTANEOUS) -> PronyFit:
    """The series that follows all tests best, with a number of terms that is stated, or found by the corrected Akaike criterion.

    moduli: which moduli the constants of the material's law are, for the record
    Raises InputError for too many terms, and for tests whose shear moduli are as far apart as those in different units.
    """
    low, high = (pick(test.times_s[k] for test in tests) for k, pick in enumerate((min, max)))
    values = sum(test.values.size for test in tests)
    largest = min(MOST_TERMS, 1 + int(np.ceil(_PER_DECADE * np.log10(high / low))), (values - len(tests) - 2) // 3)
    if terms is not None and not 1 <= terms <= (values - len(tests) - 1) // 2:
        raise InputError(f"{terms} terms of a Prony series have {2 * terms + len(tests)} constants, and the tests {values} values; "
                         "give fewer terms, but one at least (--prony).")
    tried, aicc, best = {}, {}, terms or 1
    for count in [terms] if terms else range(1, max(largest, 1) + 1):
        tried[count] = _refined(tests, count, (low, high))
        aicc[count] = corrected_aic(_residual(tests, *tried[count]), 2 * count + len(tests))
        best = min(aicc, key=lambda count: aicc[count])
        if count > best + 1:
            break
    return _report(tests, *tried[best], moduli=moduli, window=(low, high), aicc=aicc, stated=terms is not None)


def _refined(tests, count, window):
    """(c (1 + n,), tau (n,), scales (k,)) of the best fit with n terms: the first test's scale is 1."""
    low, high = np.log(window[0] / _REACH), np.log(window[1] * _REACH)
    spread = np.linspace(*np.log(window), 2 * count + 1)[1::2]
    unit = _solved(tests, np.exp(spread), _scales(tests))[0].sum()

    def parts(x):
        return np.exp(x[:count + 1]) * unit, np.exp(x[count + 1:2 * count + 1]), np.concatenate([[1.0], np.exp(x[2 * count + 1:])])

    def run(start):
        scales = _scales(tests)
        c = np.maximum(_solved(tests, np.exp(start), scales)[0] / unit, 1e-6)
        x = np.concatenate([np.log(c), start, np.log(scales[1:])])
        wide = np.full(len(tests) - 1, 5.0)
        bounds = (np.concatenate([[np.log(_LEAST_RELAXED)], np.full(count, -16.0), np.full(count, low), x[2 * count + 1:] - wide]),
                  np.concatenate([np.full(count + 1, 5.0), np.full(count, high), x[2 * count + 1:] + wide]))
        x = np.clip(x, bounds[0] + 1e-9, bounds[1] - 1e-9)
        return least_squares(lambda x: _residual(tests, *parts(x)), x, bounds=bounds, x_scale="jac", max_nfev=200)

    best = min((run(start) for start in (spread, _clustered(tests, count, (low, high), spread))), key=lambda found: found.cost)
    c, tau, scales = parts(best.x)
    order = np.argsort(tau)
    return np.concatenate([c[:1], c[1:][order]]), tau[order], scales


def _scales(tests):
    """(k,) rough scales of the tests' measures over that of the first."""
    sizes = np.array([test.values[0].max() for test in tests])
    return sizes / sizes[0]


def _solved(tests, tau, scales):
    """(c (1 + n,) without negative ones, relative residual) of given times and scales."""
    rows = [(scale * test.terms(tau) / test.values[..., None]).reshape(-1, len(tau) + 1)
            for test, scale in zip(tests, scales, strict=True)]
    matrix = np.concatenate(rows)
    c, _ = nnls(matrix, np.ones(len(matrix)))
    return c, matrix @ c - 1


def _dense(tests):
    """Log-spaced times (m,) from well below the tested window to well above."""
    low, high = (pick(test.times_s[k] for test in tests) for k, pick in enumerate((min, max)))
    decades = np.log10(high / low) + 2 * np.log10(_REACH)
    return np.geomspace(low / _REACH, high * _REACH, int(_DENSE * decades) + 1)


def _clustered(tests, count, bounds, spread):
    """Starting ln tau (n,): the spectrum of log-spaced times in groups that relax by equal shares."""
    tau = _dense(tests)
    c = _solved(tests, tau, _scales(tests))[0][1:]
    if not c.any():
        return spread
    at = np.interp((np.arange(count) + 0.5) / count, (np.cumsum(c) - c / 2) / c.sum(), np.log(tau))
    return np.clip(at + 1e-3 * np.arange(count), *bounds)


def _residual(tests, c, tau, scales):
    """(n,) relative errors of all values."""
    return np.concatenate([(scale * (test.terms(tau) @ c) / test.values - 1).ravel()
                           for test, scale in zip(tests, scales, strict=True)])


def _report(tests, c, tau, scales, *, moduli, window, aicc, stated):
    total, terms = c.sum(), len(tau)
    series = PronySeries(tuple(c[1:] / total), tuple(tau), moduli)
    x = np.concatenate([c[1:] / total, np.log(tau), total * scales])

    def residual(x):
        """Of g, ln tau and the scales: the constants that are reported."""
        g = x[:terms]
        return _residual(tests, np.concatenate([[1 - g.sum()], g]), np.exp(x[terms:2 * terms]), x[2 * terms:])

    steps = np.diag(1e-6 * np.maximum(np.abs(x), 1e-3))
    jacobian = np.stack([(residual(x + step) - residual(x - step)) / (2 * step.sum()) for step in steps], axis=1)
    error = residual(x)
    covariance = covariance_of(jacobian, float(error @ error) / max(len(error) - len(x), 1))
    names = [*(f"g{k}" for k in range(1, terms + 1)), *(f"tau{k}" for k in range(1, terms + 1))]
    if covariance is None:
        loose, errors = unseen(jacobian)[:2 * terms], None
    else:
        deviation = np.sqrt(np.diag(covariance))[:2 * terms]
        loose = deviation > np.concatenate([series.g, np.ones(terms)])
        errors = {"g": deviation[:terms].tolist(), "tau_s": (deviation[terms:] * tau).tolist()}
    if (apart := _apart(tests, total * scales)) and apart[0] > MODULI_APART:
        raise InputError(f"The {apart[1]}: one of them is in another unit; name its columns with its unit.")
    return PronyFit(series, total * scales, float(np.sqrt(np.mean(error**2))), errors,
                    [name for name, bad in zip(names, loose, strict=True) if bad], window, aicc, stated, tuple(tests))


def _shear_moduli(tests, scales):
    """[(instantaneous shear modulus in MPa, source and mode)] of the tests whose measure tells it."""
    return [(float(scale * test.shear_over), f"{test.source} ({test.mode})")
            for scale, test in zip(scales, tests, strict=True) if test.shear_over]


def _apart(tests, scales):
    """(ratio of the largest shear modulus to the smallest, words on both); None for fewer than two tests that tell it."""
    moduli = _shear_moduli(tests, scales)
    if len(moduli) < 2:
        return None
    (low, soft), (high, stiff) = min(moduli), max(moduli)
    return high / low, (f"instantaneous shear modulus of {stiff}, {high:.3g} MPa, is {high / low:.3g} times that of {soft}, "
                        f"{low:.3g} MPa")


def _disagreement(test):
    """A sentence on storage and loss moduli that no spectrum of times gives together, in a generator that is empty otherwise."""
    if test.mode != FREQUENCY:
        return
    _, error = _solved([test], _dense([test]), np.ones(1))
    storage, loss = np.sqrt(np.mean(error.reshape(2, -1) ** 2, axis=1))
    if max(storage, loss) > _INCONSISTENT:
        yield (f"prony: storage and loss modulus of {test.source} contradict each other (Kramers and Kronig): no spectrum of "
               f"relaxation times comes closer than {storage:.0%} and {loss:.0%}; check their units, and that both "
               "are of one temperature.")
