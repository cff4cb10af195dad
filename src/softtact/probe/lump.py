"""A stiff lump hidden in the tissue: its place, depth and stiffness from the films, with their uncertainty, and its detection.

The solver makes a table of the films' forces over (x, depth, log of the stiffness ratio); between its points a cubic spline gives
the forces f(p) and their derivatives. Readings are compared with it by least squares, weighted with the films' noise s; the
covariance of the estimate is s^2 (J^T J)^-1. A lump is seen where its forces differ from plain tissue's by more than noise does:
chi2 = |f(p) - f_0|^2/s^2 beyond the 95 % point, with a probability of 95 % (non-central chi2 with |df|^2/s^2). The plain tissue is
taken as known: it was read before.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2, ncx2

from softtact.errors import InputError
from softtact.probe.design import Design, LumpSearch
from softtact.probe.sweep import palpate

PARAMETERS = ("x_mm", "depth_mm", "log_ratio")
_SURE = 0.95
_STEP = 1e-3      # of a parameter's range, for derivatives of the table's spline
_STARTS = 12      # best points of the table from which least squares set out, for two lumps may read alike
_AS_GOOD = chi2.ppf(_SURE, 1)      # by how much the chi2 of another minimum may be larger for it to count
_LEAST_CHANGE = 1e-3      # of the stiffness, and the number of ratios, that the map of detection tries
_RATIOS = 200


@dataclass(frozen=True)
class LumpTable:
    """Film forces over lumps of one size."""

    x_mm: np.ndarray
    depth_mm: np.ndarray
    stiffness_ratio: np.ndarray
    """Rising values along each side of the table; the ratios begin with 1, tissue without a lump."""
    force_n: np.ndarray
    """(x, depth, stiffness, readings) in N; readings are jaw's ways times films."""
    plain_n: np.ndarray
    """(readings,) of tissue without a lump."""
    noise_n: float
    """Standard deviation of a reading."""

    def __post_init__(self) -> None:
        axes = (self.x_mm, self.depth_mm, np.log(self.stiffness_ratio))
        object.__setattr__(self, "_spline", RegularGridInterpolator(axes, self.force_n, method="cubic"))
        object.__setattr__(self, "low", np.array([axis[0] for axis in axes]))
        object.__setattr__(self, "high", np.array([axis[-1] for axis in axes]))

    def forces(self, lump: np.ndarray) -> np.ndarray:
        """(readings,) in N of a lump (3,): x, depth in mm and the logarithm of the stiffness ratio; or of several."""
        found = self._spline(np.clip(lump, self.low, self.high))     # type: ignore[attr-defined]
        return found if lump.ndim > 1 else found[0]

    def jacobian(self, lump: np.ndarray) -> np.ndarray:
        """(readings, 3) derivatives of `forces`, by differences within the table."""
        columns = []
        for k, span in enumerate(self.high - self.low):     # type: ignore[attr-defined]
            step = np.zeros(3)
            step[k] = _STEP * span
            ahead, behind = np.minimum(lump + step, self.high), np.maximum(lump - step, self.low)     # type: ignore[attr-defined]
            columns.append((self.forces(ahead) - self.forces(behind)) / (ahead - behind)[k])
        return np.column_stack(columns)


@dataclass(frozen=True)
class FoundLump:
    """A lump read off the films."""

    x_mm: float
    depth_mm: float
    stiffness_ratio: float
    deviation: np.ndarray
    """(3,) standard deviations at this lump: mm, mm, and of the logarithm of the ratio; inf where the films do not tell."""
    interval: np.ndarray
    """(3, 2) 95 % intervals of the same: all lumps that fit as well within noise, each with 1.96 deviations, within the table."""
    chi2: float
    """Squared misfit over the noise; about the number of readings less 3 where lump and table are of one kind."""
    detected: bool
    """Whether the readings differ from those of plain tissue beyond the 95 % point of noise."""


def lump_table(design: Design, search: LumpSearch, *, threads: int = 1,
               tell: Callable[[str], None] = lambda text: None) -> LumpTable:
    """Solve all lumps of a search. The table is mirrored to the right half, left and right film exchanged.

    A lump's forces are those of plain tissue plus what the lump changes on its own mesh, so that the mesh's change leaves no trace.
    Raises InputError where the films are not symmetric about the middle, or a lump does not fit into the tissue.
    """
    mirror, middle = _mirror(design), design.geometry.middle
    if search.x[-1] > middle + 1e-9:
        raise InputError(f"search.x reaches {search.x[-1]:g} mm, beyond the beam's middle at {middle:g} mm; give the "
                         "left half alone.")
    plain = _solved(design, search, None, 0.0, 1.0, threads)
    rows: list[np.ndarray] = []
    ratios = [1.0, *search.stiffness_ratio]
    for number, (x, depth) in enumerate(product(search.x, search.depth), start=1):
        tell(f"place {number} of {len(search.x) * len(search.depth)} of a lump")
        own = np.array([_solved(design, search, x, depth, ratio, threads) for ratio in ratios])
        rows.append(plain + own - own[0])
    shape = (len(search.x), len(search.depth), len(ratios), len(search.jaw_mm), len(mirror))
    left = np.array(rows).reshape(shape)
    mirrored = search.x if search.x[-1] < middle - 1e-9 else search.x[:-1]
    right = left[:len(mirrored)][::-1][..., mirror]
    places = np.concatenate([search.x, 2 * middle - np.array(mirrored)[::-1]])
    return LumpTable(places, np.array(search.depth), np.array(ratios),
                     np.concatenate([left, right]).reshape(len(places), *shape[1:3], -1), plain, search.noise_n)


def _mirror(design):
    """For each film the number of its mirror image."""
    films, length, found = list(design.films.values()), design.geometry.length, []
    for film in films:
        on = {"left support": "right support", "right support": "left support"}.get(film.on, film.on)
        places = [k for k, other in enumerate(films) if other.on == on and other.side == film.side
                  and np.allclose([other.start, other.end], [length - film.end, length - film.start])]
        if not places:
            raise InputError(f"{design.name}: the film on the {film.on} from {film.start:g} to {film.end:g} mm has no mirror "
                             "image; the search for a lump needs films that are symmetric about the beam's middle.")
        found.append(places[0])
    return np.array(found)


def find_lump(table: LumpTable, readings_n: np.ndarray) -> FoundLump:
    """The lump that fits readings (readings,) in N best, from several starts. Raises InputError for another number of readings."""
    if readings_n.shape != table.plain_n.shape:
        raise InputError(f"There are {readings_n.size} readings, and the table has {table.plain_n.size}; give one for each "
                         "way and film.")
    low, high = table.low, table.high     # type: ignore[attr-defined]

    def misfit(lump):
        return (table.forces(lump) - readings_n) / table.noise_n

    every = table.force_n.reshape(-1, table.plain_n.size)
    order = np.argsort(((every - readings_n)**2).sum(axis=1))[:_STARTS]
    axes = np.meshgrid(table.x_mm, table.depth_mm, np.log(table.stiffness_ratio), indexing="ij")
    starts = np.column_stack([axis.ravel() for axis in axes])[order]
    margin = 1e-6 * (high - low)
    fits = [least_squares(misfit, np.clip(start, low + margin, high - margin), bounds=(low, high), x_scale=high - low,
                          jac=lambda lump: table.jacobian(lump) / table.noise_n) for start in starts]
    best = min(fits, key=lambda fit: fit.cost)
    off = float((((readings_n - table.plain_n) / table.noise_n)**2).sum())
    return FoundLump(float(best.x[0]), float(best.x[1]), float(np.exp(best.x[2])), deviations(table, best.x),
                     _interval(table, fits), 2 * float(best.cost), off > chi2.ppf(_SURE, len(readings_n)))


def _interval(table, fits):
    """(3, 2) from all minima that fit as well as the best within noise."""
    low, high, least = table.low, table.high, min(fit.cost for fit in fits)
    near = [fit.x for fit in fits if 2 * (fit.cost - least) <= _AS_GOOD]
    wide = [np.minimum(1.96 * deviations(table, x), high - low) for x in near]
    return np.column_stack([np.maximum(np.min(np.array(near) - wide, axis=0), low),
                            np.minimum(np.max(np.array(near) + wide, axis=0), high)])


def deviations(table: LumpTable, lump: np.ndarray) -> np.ndarray:
    """Standard deviations (3,) of an estimate at a lump (3,), from the noise; inf where the readings do not tell."""
    J = table.jacobian(lump) / table.noise_n
    information = J.T @ J
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    with np.errstate(divide="ignore"):
        variance = (vectors**2 / np.maximum(values, 0.0)).sum(axis=1) / scale**2
    return np.sqrt(variance)


def detection_map(table: LumpTable) -> pd.DataFrame:
    """For each x and depth of the table the least stiffness ratio that is seen, inf where none of the table's is."""
    needed = _noncentrality(len(table.plain_n)) * table.noise_n**2
    rows = []
    for x in table.x_mm:
        for depth in table.depth_mm:
            logs = np.log1p(np.geomspace(_LEAST_CHANGE, table.stiffness_ratio[-1] - 1, _RATIOS))
            forces = table.forces(np.column_stack([np.full(_RATIOS, x), np.full(_RATIOS, depth), logs]))
            seen = ((forces - table.plain_n)**2).sum(axis=1) >= needed
            ratio = float(np.exp(logs[np.argmax(seen)])) if seen.any() else float("inf")
            rows.append({"x_mm": x, "depth_mm": depth, "least_stiffness_ratio": ratio})
    return pd.DataFrame(rows)


def _noncentrality(readings):
    """|df|^2/s^2 at which a lump is seen with the probability `_SURE`."""
    bound = chi2.ppf(_SURE, readings)
    return float(brentq(lambda value: ncx2.sf(bound, readings, value) - _SURE, 1e-3, 1e4))


def recovery(design: Design, search: LumpSearch, table: LumpTable, *, threads: int = 1,
             tell: Callable[[str], None] = lambda text: None) -> pd.DataFrame:
    """Lumps drawn within the table, solved, read with noise and found again: true, found and stated deviation of each.

    The solver gives the readings, not the table, so that the table's own error counts.
    """
    rng, rows = np.random.default_rng(search.seed), []
    low, high = table.low.copy(), table.high     # type: ignore[attr-defined]
    low[2] = np.log(search.stiffness_ratio[0])
    for number in range(search.trials):
        tell(f"hidden lump {number + 1} of {search.trials}")
        lump = low + rng.uniform(0.1, 0.9, 3) * (high - low)
        with_lump, without = (_solved(design, search, lump[0], lump[1], ratio, threads) for ratio in (np.exp(lump[2]), 1.0))
        forces = table.plain_n + with_lump - without
        found = find_lump(table, forces + search.noise_n * rng.normal(size=forces.size))
        rows.append({"x_mm": lump[0], "depth_mm": lump[1], "stiffness_ratio": np.exp(lump[2]), "found_x_mm": found.x_mm,
                     "found_depth_mm": found.depth_mm, "found_stiffness_ratio": found.stiffness_ratio,
                     **_intervals(found, lump), "chi2": found.chi2, "detected": found.detected,
                     "table_error_n": float(np.abs(forces - table.forces(lump)).max())})
    return pd.DataFrame(rows)


def _intervals(found, lump):
    """The intervals' ends, and whether the true lump (3,) lies in them."""
    columns = {}
    for name, (low, high), true in zip(PARAMETERS, found.interval, lump, strict=True):
        columns |= {f"{name}_low": low, f"{name}_high": high, f"{name}_within": bool(low <= true <= high)}
    return columns


def _solved(design, search, x, depth, ratio, threads):
    """Readings (ways x films,) in N of a lump, or of plain tissue where its x is None."""
    lump = None if x is None else {"x": float(x), "depth": float(depth), "width": search.width, "height": search.height,
                                   "stiffness_ratio": float(ratio)}
    own = design.with_(lump=lump, search=None)
    return palpate(own, search.tissue, "displacement", values=np.array(search.jaw_mm), threads=threads).film_force_n.ravel()
