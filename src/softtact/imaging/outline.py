"""The outline of one disc, fitted to the light of its pixels, and priors of light and blur from all discs of a frame.

Symbols (lengths in pixels)
    rho, phi     polar coordinates of a pixel about the disc's centre
    r(phi)       outline: R + sum over m = 2 ... 4 of c_m cos(m phi) + s_m sin(m phi); m = 1 is the centre
    b, a         brightness of the glass, and contrast of the disc above it
    s            standard deviation of the blur
Light            b + a P(r / s, rho / s), P the share of a disc of radius r that the blur leaves at rho: a noncentral
                 chi-square distribution; cut off at the camera's black and white as the noise is
Area             integral of r^2 / 2 = pi (R^2 + sum (c_m^2 + s_m^2) / 2)
Fit              Gauss-Newton on the squared residuals over the noise, plus what is known beforehand (`Prior`)

The harmonics cost a disc's area nothing: to first order its error does not depend on theirs.

Light and blur change slowly over a frame. Each fit's posterior precision less its prior's is the information in its pixels. Summed
over the discs it gives the contrast, the brightness of the glass and the blur as polynomials of the place, also where one disc
alone does not distinguish a small bright contact from a larger dim one. Discs that differ by more than their errors keep their
values: the prior is as wide as they scatter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chndtr, i0e, i1e, ndtr

from softtact.imaging.regions import terms

HARMONICS = (2, 3, 4)
NAMES = ("a", "b", "s", "row", "column", "R", *(f"{part}{m}" for m in HARMONICS for part in "cs"))
A, B, S, ROW, COLUMN, R = range(6)
SHAPE = slice(6, 6 + 2 * len(HARMONICS))
STEPS = 12
_STILL = 0.004  # pixels; a tenth of the smallest error due to noise
_HALVINGS, _WORSE = 8, 4.0      # halvings of a step that makes the misfit more than so many times larger; less mostly recovers
_FAR = 5.0     # blurs from the outline, beyond which the light is that of the glass or of the disc's middle
_FLAT = 8.0    # blurs: the outline of a larger radius is locally straight, to 1e-3 of the contrast
SHAPE_SD = np.repeat([0.15, 0.08, 0.08], 2)   # of the radius: harmonics 2 (an ellipse of 1.3 has 0.13), 3, 4
FEWEST = 4            # discs; fewer give each other no prior
UNKNOWN = 1e6         # standard deviation of an unknown parameter
_SHARED = slice(0, 3)  # contrast, glass, blur
_CERTAIN = 0.2        # relative error of the contrast up to which a disc counts for the scatter between discs
_CHANGE = 0.3         # prior standard deviation of each term of the polynomial, over contrast and blur


@dataclass(frozen=True)
class Prior:
    """Means and standard deviations (parameters,) of the parameters before a fit; `UNKNOWN` is the deviation of an unknown one."""

    mean: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class Outline:
    """A fitted disc."""

    values: np.ndarray       # (parameters,) in the order of NAMES
    covariance: np.ndarray   # (parameters, parameters)
    misfit: float            # rms of the residual over the noise of a pixel
    residual: float          # rms of the residual over the contrast

    @property
    def area(self) -> float:
        """Area in pixels, corrected for the mean square that noise adds to each squared parameter."""
        squares = self.values**2 - np.diag(self.covariance)
        return np.pi * (squares[R] + 0.5 * squares[SHAPE].sum())

    @property
    def area_sd(self) -> float:
        """Standard deviation of the area in pixels."""
        slope = np.zeros(len(self.values))
        slope[R], slope[SHAPE] = 2 * np.pi * self.values[R], np.pi * self.values[SHAPE]
        return float(np.sqrt(max(slope @ self.covariance @ slope, 0.0)))

    def sd_of(self, measure: Callable[[np.ndarray], float]) -> float:
        """Standard deviation of `measure`, a function of the parameters, by linear error propagation."""
        slope = np.zeros(len(self.values))
        for k in range(ROW, len(slope)):
            ends = [self.values.copy() for _ in range(2)]
            ends[0][k] -= 0.05
            ends[1][k] += 0.05
            slope[k] = (measure(ends[1]) - measure(ends[0])) / 0.1
        return float(np.sqrt(max(slope @ self.covariance @ slope, 0.0)))


def fit_outline(rows: np.ndarray, columns: np.ndarray, light: np.ndarray, *, start: np.ndarray, prior: Prior, noise: float,
                other: float | np.ndarray = 0.0, limits: tuple[float, float] = (-1e6, 1e6)) -> Outline:
    """Fit the `Outline` of a disc to pixels (n,) of brightness `light` (n,); `other` (n,): light of its neighbours."""
    weight = 1.0 / prior.sd**2

    def evaluate(values):
        """Values, their brightness and slopes, and the objective: squared misfit plus squared distance from the prior."""
        model, slopes = _light(values, rows, columns, other)
        model, passed = clipped(model, noise=noise, limits=limits)
        return values, model, slopes * passed, ((light - model) ** 2).sum() / noise**2 + weight @ (prior.mean - values) ** 2

    values, model, slopes, misfit = evaluate(start.copy())
    for _ in range(STEPS):
        normal = slopes @ slopes.T / noise**2 + np.diag(weight)
        step = np.linalg.lstsq(normal, slopes @ (light - model) / noise**2 + weight * (prior.mean - values), rcond=1e-12)[0]
        # A full Gauss-Newton step can diverge if the start is slightly off the disc's centre.
        trials = (evaluate(_bounded(values, 0.5**halving * step)) for halving in range(_HALVINGS))
        found = next((trial for trial in trials if trial[-1] < _WORSE * misfit), None)
        if found is None:
            break
        values, model, slopes, misfit = found
        if np.abs(step[S:]).max() < _STILL:
            break
    residual = float(np.sqrt(np.mean((light - model) ** 2)))
    normal = slopes @ slopes.T / noise**2 + np.diag(weight)
    return Outline(values, np.linalg.pinv(normal), residual / noise, residual / max(abs(values[A]), 1e-9))


def _bounded(values, step):
    """The values after a step of at most a quarter of the radius; radius and blur stay above zero."""
    most = 0.25 * values[R]
    moved = values + np.concatenate([step[:S], np.clip(step[S:], -most, most)])
    moved[S], moved[R] = np.clip(moved[S], 0.3, 20.0), max(moved[R], 0.3)
    return moved


def _light(values, rows, columns, other):
    """Brightness (n,) and its slopes (parameters, n)."""
    share, by_radius, by_rho, angles, (dr, dc, rho) = _share(values, rows, columns)
    a, s = values[A], values[S]
    slopes = np.empty((len(values), len(rows)))
    slopes[A], slopes[B] = share, 1.0
    slopes[S] = -a * (values[R] * by_radius + rho * by_rho) / s
    slopes[ROW], slopes[COLUMN] = -a * by_rho * dr / rho, -a * by_rho * dc / rho
    slopes[R] = a * by_radius
    slopes[SHAPE] = a * by_radius * angles
    return values[B] + a * share + other, slopes


def _share(values, rows, columns):
    """P (n,), its slopes along r and rho, the harmonics (2 len(HARMONICS), n), and (rows, columns, rho) from the centre."""
    radius, angles, (dr, dc, rho) = _polar(values, rows, columns)
    return *blurred_disc(radius, rho, values[S]), angles, (dr, dc, rho)


def _polar(values, rows, columns):
    """Radius (n,) of the outline towards each pixel, the harmonics, and (rows, columns, rho) from the centre."""
    dr, dc = rows - values[ROW], columns - values[COLUMN]
    rho = np.maximum(np.hypot(dr, dc), 1e-6)
    turn = (dc + 1j * dr) / rho
    angles = np.stack([part for m in HARMONICS for part in ((turn**m).real, (turn**m).imag)])   # cos(m phi), sin(m phi)
    radius = np.maximum(values[R] + np.tensordot(values[SHAPE], angles, axes=1), 0.2)
    return radius, angles, (dr, dc, rho)


def blurred_disc(radius: np.ndarray, rho: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share of light at distance rho (n,) from the centre of a disc of radius (n,), and its slopes along radius and rho."""
    share, by_radius, by_rho = (rho < radius).astype(float), np.zeros_like(rho), np.zeros_like(rho)
    near = np.abs(rho - radius) < _FAR * s
    r, d = radius[near] / s, rho[near] / s
    share[near] = chndtr(r * r, 2.0, d * d) if r.size and r.min() < _FLAT else ndtr(np.sqrt(np.maximum(r * r - 1, 0)) - d)
    bell = np.exp(-0.5 * (r - d) ** 2) * r / s
    by_radius[near], by_rho[near] = bell * i0e(r * d), -bell * i1e(r * d)
    return share, by_radius, by_rho


def clipped(light: np.ndarray, *, noise: float, limits: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n,) of brightness plus noise after clipping at a camera's limits, and its slope along the brightness."""
    low, high = ((limit - light) / noise for limit in limits)
    passed = ndtr(high) - ndtr(low)
    return light + noise * (_excess(low) - _excess(-high)), passed


def _excess(z):
    """Mean of max(z - n, 0) over normal n."""
    return z * ndtr(z) + np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)


def box(values: np.ndarray, *, shape: tuple[int, int], margin: float) -> tuple[slice, ...]:
    """Slices of the pixels around an outline, within the frame."""
    reach = values[R] + np.abs(values[SHAPE]).sum() + margin
    return tuple(slice(int(np.clip(np.floor(m - reach), 0, n)), int(np.clip(np.ceil(m + reach) + 1, 0, n)))
                 for m, n in zip(values[[ROW, COLUMN]], shape, strict=True))


def contrast_light(values: np.ndarray, window: tuple[slice, ...]) -> np.ndarray:
    """Light (rows, columns) of a disc above the glass in a window of the frame."""
    rows, columns = np.mgrid[window].astype(float)
    radius, _, (_, _, rho) = _polar(values, rows, columns)
    return values[A] * blurred_disc(radius, rho, values[S])[0]


def inside(values: np.ndarray, window: tuple[slice, ...]) -> np.ndarray:
    """Share (rows, columns) of each pixel that lies in the outline, without blur."""
    radius, _, (_, _, rho) = _polar(values, *np.mgrid[window].astype(float))
    return np.clip(radius - rho + 0.5, 0.0, 1.0)


def corners(values: np.ndarray, *, count: int = 72) -> np.ndarray:
    """Points (count + 1, 2) in rows and columns along an outline, closed."""
    phi = np.linspace(0, 2 * np.pi, count + 1)
    angles = np.stack([f(m * phi) for m in HARMONICS for f in (np.cos, np.sin)])
    radius = values[R] + values[SHAPE] @ angles
    return np.stack([values[ROW] + radius * np.sin(phi), values[COLUMN] + radius * np.cos(phi)], axis=1)


def first_priors(start: np.ndarray) -> list[Prior]:
    """`Prior` of each disc (discs, parameters) before any fit: regions give contrast and blur to within about a half."""
    sd = np.full(start.shape, UNKNOWN)
    sd[:, 0], sd[:, 2] = 0.5 * start[:, 0], 0.3 + 0.5 * start[:, 2]
    return _with_shape(start, sd)


def pooled_priors(fits: Sequence[Outline], priors: Sequence[Prior], *, shape: tuple[int, int]) -> list[Prior]:
    """`Prior` of each disc from the fits of all discs, which used `priors`."""
    values = np.array([fit.values for fit in fits])
    if len(fits) < FEWEST:
        return [Prior(one.mean, one.sd) for one in priors]
    precision, pull = _information(fits, priors)
    basis = terms(values[:, ROW], values[:, COLUMN], shape)
    shared = _solve(precision, pull, basis, scale=np.median(values[:, _SHARED], axis=0))
    sd = np.full(values.shape, UNKNOWN)
    sd[:, _SHARED] = _spread_over(precision, pull, shared) + 1e-3 * np.abs(shared)
    mean = values.copy()
    mean[:, _SHARED] = shared
    return _with_shape(mean, sd)


def _with_shape(mean, sd):
    """The priors, with harmonics about zero: an outline is round unless the light shows another shape."""
    mean = mean.copy()
    sd[:, R + 1:] = np.maximum(mean[:, [R]], 1.0) * SHAPE_SD
    mean[:, R + 1:] = 0.0
    return [Prior(*pair) for pair in zip(mean, sd, strict=True)]


def _information(fits, priors):
    """Information in each disc's pixels without its prior: precision (discs, 3, 3) and precision times value (discs, 3)."""
    before = np.array([np.diag(prior.sd[_SHARED] ** -2.0) for prior in priors])
    after = np.array([np.linalg.pinv(fit.covariance[_SHARED, _SHARED]) for fit in fits])
    pull = np.einsum("kij,kj->ki", after, [fit.values[_SHARED] for fit in fits])
    return after - before, pull - np.einsum("kij,kj->ki", before, [prior.mean[_SHARED] for prior in priors])


def _solve(precision, pull, basis, *, scale):
    """Values at the discs (discs, 3) of the polynomials that best fit all discs."""
    count = len(basis)
    normal = np.einsum("tk,uk,kij->tiuj", basis, basis, precision).reshape(3 * count, -1)
    change = _CHANGE * scale[[0, 0, 2]]
    normal += np.diag(np.concatenate([np.zeros(3), np.tile(change**-2.0, count - 1)]))
    factors = np.linalg.solve(normal, np.einsum("tk,ki->ti", basis, pull).ravel()).reshape(count, 3)
    return basis.T @ factors


def _spread_over(precision, pull, shared):
    """Standard deviation (3,) of the discs from the polynomials beyond their errors."""
    covariance = np.linalg.pinv(precision, hermitian=True)
    variance = np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 1e-12)
    certain = np.sqrt(variance[:, 0]) < _CERTAIN * np.abs(shared[:, 0])
    if certain.sum() < FEWEST:
        return np.zeros(3)   # too small for a known contrast
    z = (np.einsum("kij,kj->ki", covariance, pull) - shared)[certain] / np.sqrt(variance[certain])
    spread = (1.4826 * np.median(np.abs(z), axis=0)) ** 2
    by_chance = 1 + 2.3 / np.sqrt(len(z))   # one sd of that estimate above what errors alone give
    return np.sqrt(np.maximum(spread - by_chance, 0.0) * np.median(variance[certain], axis=0))
