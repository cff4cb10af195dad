"""A stiff lump hidden in the tissue: its place, depth and stiffness from the films, with their uncertainty, and its detection.

The solver makes a table of the films' forces over (x, depth, log of the stiffness ratio). A cubic spline between its points gives
the forces f(p) and their derivatives. Readings are fitted by least squares, weighted with the films' noise s; the covariance of the
estimate is s^2 (J^T J)^-1. A lump is detected where its forces differ from those of plain tissue f_0 by more than noise:
chi2 = |f(p) - f_0|^2/s^2 beyond the 95 % point, with a probability of 95 % (non-central chi2 with |f(p) - f_0|^2/s^2). The forces
of plain tissue are taken as known.

The sensor may press several times, moved along the tissue between the presses. One press hardly distinguishes a deep stiff lump
from a soft one near the jaw. The other presses show the width over which the lump's forces spread, which grows with its depth. A
move is modelled as a lump at another place in the same tissue.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pandas as pd
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2, ncx2

from softtact.errors import InputError
from softtact.probe.design import LumpSearch, PalpationDesign, refuse_search
from softtact.probe.sweep import palpate

PARAMETERS = ("x_mm", "depth_mm", "log_ratio")
_SURE = 0.95
_STEP = 1e-3      # of a parameter's range, for differences of the spline
_STARTS = 12      # best points of the table as starts of the least squares, because two lumps may give almost the same readings
_AS_GOOD = chi2.ppf(_SURE, 1)      # largest excess in chi2 of another minimum that counts
_LEAST_CHANGE = 1e-3      # smallest rise of stiffness in the map of detection
_RATIOS = 200     # stiffness ratios tried in the map of detection


@dataclass(frozen=True)
class LumpTable:
    """Film forces over lumps of one size."""

    x_mm: np.ndarray
    depth_mm: np.ndarray
    stiffness_ratio: np.ndarray
    """Rising values along the axes of the table; the ratios begin with 1, plain tissue."""
    force_n: np.ndarray
    """(x, depth, stiffness, readings) in N of one press: all films at each of the jaw's displacements."""
    unladen_n: np.ndarray
    """(readings of a press,) of plain tissue."""
    noise_n: float
    """Standard deviation of a reading."""
    move_mm: np.ndarray = field(default_factory=lambda: np.zeros(1))
    """(presses,) added to a lump's x in each press; the readings are those of all presses in turn."""

    def __post_init__(self) -> None:
        axes = (self.x_mm, self.depth_mm, np.log(self.stiffness_ratio))
        object.__setattr__(self, "_spline", RegularGridInterpolator(axes, self.force_n, method="cubic"))
        low, high = (np.array([axis[end] for axis in axes]) for end in (0, -1))
        object.__setattr__(self, "low", low - [self.move_mm.min(), 0, 0])
        object.__setattr__(self, "high", high - [self.move_mm.max(), 0, 0])

    @property
    def plain_n(self) -> np.ndarray:
        """(readings,) of plain tissue."""
        return np.tile(self.unladen_n, len(self.move_mm))

    def forces(self, lump: np.ndarray) -> np.ndarray:
        """(readings,) in N of a lump (3,): x, depth in mm and the logarithm of the stiffness ratio; or of several."""
        within = np.clip(lump, self.low, self.high)     # type: ignore[attr-defined]
        ends = self.x_mm[[0, -1]]
        presses = []
        for move in self.move_mm:
            at = within.copy()
            at[..., 0] = np.clip(at[..., 0] + move, *ends)      # round-off must not leave the table
            presses.append(self._spline(at))     # type: ignore[attr-defined]
        found = np.concatenate(presses, axis=-1)
        return found if lump.ndim > 1 else found[0]

    def jacobian(self, lump: np.ndarray) -> np.ndarray:
        """(readings, 3) derivatives of `forces` by the lump, from differences within the table."""
        columns = []
        for k, span in enumerate(self.high - self.low):     # type: ignore[attr-defined]
            step = np.zeros(3)
            step[k] = _STEP * span
            ahead, behind = np.minimum(lump + step, self.high), np.maximum(lump - step, self.low)     # type: ignore[attr-defined]
            columns.append((self.forces(ahead) - self.forces(behind)) / (ahead - behind)[k])
        return np.column_stack(columns)

    def points(self) -> np.ndarray:
        """(m, 3) lumps at the table's points that lie within it in every press, and at the ends in x."""
        low, high = self.low[0], self.high[0]     # type: ignore[attr-defined]
        x = np.unique(np.clip(self.x_mm, low, high))
        axes = np.meshgrid(x, self.depth_mm, np.log(self.stiffness_ratio), indexing="ij")
        return np.column_stack([axis.ravel() for axis in axes])


@dataclass(frozen=True)
class FoundLump:
    """A lump estimated from the films' readings."""

    x_mm: float
    depth_mm: float
    stiffness_ratio: float
    deviation: np.ndarray
    """(3,) standard deviations at this lump: mm, mm, and of the logarithm of the ratio; inf where no reading depends on it."""
    interval: np.ndarray
    """(3, 2) 95 % intervals of the same, within the table: all lumps that fit as well within noise, with 1.96 deviations."""
    chi2: float
    """Squared misfit over the noise; about the number of readings less 3 where the table's model holds."""
    detected: bool
    """Whether the readings differ from plain tissue's beyond the 95 % point of noise."""


def lump_table(design: PalpationDesign, search: LumpSearch, *, threads: int = 1,
               report: Callable[[str], None] = lambda text: None) -> LumpTable:
    """Solve all lumps of a search. The right half of the table is the mirror image, left and right film exchanged.

    A lump's forces are those of plain tissue plus the change by the lump on one mesh, which removes the effect of the mesh.
    Raises InputError as `refuse_search`.
    """
    refuse_search(design, search)
    mirror, middle = design.mirrored_films(), design.geometry.middle
    plain = _solved(design, search, None, 0.0, 1.0, threads)
    rows: list[np.ndarray] = []
    ratios = [1.0, *search.stiffness_ratio]
    for number, (x, depth) in enumerate(product(search.x, search.depth), start=1):
        report(f"place {number} of {len(search.x) * len(search.depth)} of a lump")
        forces = np.array([_solved(design, search, x, depth, ratio, threads) for ratio in ratios])
        rows.append(plain + forces - forces[0])
    shape = (len(search.x), len(search.depth), len(ratios), len(search.jaw_mm), len(mirror))
    left = np.array(rows).reshape(shape)
    mirrored = search.x if search.x[-1] < middle - 1e-9 else search.x[:-1]
    right = left[:len(mirrored)][::-1][..., mirror]
    places = np.concatenate([search.x, 2 * middle - np.array(mirrored)[::-1]])
    return LumpTable(places, np.array(search.depth), np.array(ratios),
                     np.concatenate([left, right]).reshape(len(places), *shape[1:3], -1), plain, search.noise_n,
                     np.array(search.moves))


def find_lump(table: LumpTable, readings_n: np.ndarray) -> FoundLump:
    """The lump that fits readings (readings,) in N best, from several starts. Raises InputError for a wrong number of readings."""
    if readings_n.shape != table.plain_n.shape:
        raise InputError(f"There are {readings_n.size} readings, and the table has {table.plain_n.size}; give one for each "
                         "press, displacement and film.")
    low, high = table.low, table.high     # type: ignore[attr-defined]

    def misfit(lump):
        return (table.forces(lump) - readings_n) / table.noise_n

    points = table.points()
    starts = points[np.argsort(((table.forces(points) - readings_n)**2).sum(axis=1))[:_STARTS]]
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
    """Standard deviations (3,) of an estimate at a lump (3,) by noise; inf where the readings do not depend on it."""
    J = table.jacobian(lump) / table.noise_n
    information = J.T @ J
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    with np.errstate(divide="ignore"):
        variance = (vectors**2 / np.maximum(values, 0.0)).sum(axis=1) / scale**2
    return np.sqrt(variance)


def detection_map(table: LumpTable) -> pd.DataFrame:
    """The least stiffness ratio that is detected for each x and depth; inf where none of the table's is."""
    needed = _noncentrality(len(table.plain_n)) * table.noise_n**2
    rows = []
    for x in np.unique(table.points()[:, 0]):
        for depth in table.depth_mm:
            logs = np.log1p(np.geomspace(_LEAST_CHANGE, table.stiffness_ratio[-1] - 1, _RATIOS))
            forces = table.forces(np.column_stack([np.full(_RATIOS, x), np.full(_RATIOS, depth), logs]))
            seen = ((forces - table.plain_n)**2).sum(axis=1) >= needed
            ratio = float(np.exp(logs[np.argmax(seen)])) if seen.any() else float("inf")
            rows.append({"x_mm": x, "depth_mm": depth, "least_stiffness_ratio": ratio})
    return pd.DataFrame(rows)


def _noncentrality(readings):
    """|f(p) - f_0|^2/s^2 at which a lump is detected with the probability `_SURE`."""
    bound = chi2.ppf(_SURE, readings)
    return float(brentq(lambda value: ncx2.sf(bound, readings, value) - _SURE, 1e-3, 1e4))


def recovery(design: PalpationDesign, search: LumpSearch, table: LumpTable, *, threads: int = 1,
             report: Callable[[str], None] = lambda text: None) -> pd.DataFrame:
    """Random lumps within the table, solved, read with noise and estimated: the true and the found values of each.

    The readings come from the solver, not from the table, so they include the table's error. `alone_...`: found by the first press.
    """
    first = replace(table, move_mm=table.move_mm[:1])
    rng, rows = np.random.default_rng(search.seed), []
    low, high = table.low.copy(), table.high     # type: ignore[attr-defined]
    low[2] = np.log(search.stiffness_ratio[0])
    for number in range(search.trials):
        report(f"hidden lump {number + 1} of {search.trials}")
        lump = low + rng.uniform(0.1, 0.9, 3) * (high - low)
        changes = [_changed(design, search, lump + [move, 0, 0], threads) for move in search.moves]
        forces = table.plain_n + np.concatenate(changes)
        readings = forces + search.noise_n * rng.normal(size=forces.size)
        found, alone = find_lump(table, readings), find_lump(first, readings[:len(first.plain_n)])
        rows.append({"x_mm": lump[0], "depth_mm": lump[1], "stiffness_ratio": np.exp(lump[2]), **_named("found", found),
                     **_named("alone", alone), **_intervals(found, lump), "chi2": found.chi2, "detected": found.detected,
                     "table_error_n": float(np.abs(forces - table.forces(lump)).max())})
    return pd.DataFrame(rows)


def _named(how, found):
    return {f"{how}_{name}": getattr(found, name) for name in ("x_mm", "depth_mm", "stiffness_ratio")}


def _intervals(found, lump):
    """The intervals' ends, and whether the true lump (3,) lies in them."""
    columns = {}
    for name, (low, high), true in zip(PARAMETERS, found.interval, lump, strict=True):
        columns |= {f"{name}_low": low, f"{name}_high": high, f"{name}_within": bool(low <= true <= high)}
    return columns


def _changed(design, search, lump, threads):
    """Change (readings,) in N of a press by a lump (3,)."""
    x, depth, log_ratio = lump
    with_lump, without = (_solved(design, search, x, depth, ratio, threads) for ratio in (np.exp(log_ratio), 1.0))
    return with_lump - without


def _solved(design, search, x, depth, ratio, threads):
    """Readings (displacements x films,) in N of a press on a lump, or on plain tissue where x is None."""
    lump = None if x is None else {"x": float(x), "depth": float(depth), "width": search.width, "height": search.height,
                                   "stiffness_ratio": float(ratio)}
    changed = design.with_(lump=lump, search=None)
    return palpate(changed, search.tissue, "displacement", values=np.array(search.jaw_mm), threads=threads).film_force_n.ravel()
