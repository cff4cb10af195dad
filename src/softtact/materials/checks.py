"""Checks of a test curve: impossible data are refused with row and remedy, doubtful ones are stated in a remark.

Remarks compare with the behaviour of rubber. The reference is the neo-Hookean law, stress = mu (l_1^2 - l_3^2) / stretch: at small
strain every isotropic incompressible material follows it, a straight line through zero, and in tension rubber first softens from
there and then stiffens.
  unit of strain   the curve has the form of that law in percent, and not as a ratio, or vice versa
  modulus          from silicone gels to hard polyurethane
  zero             a preload has stress at no strain, slack has strain at no stress
  sign             a compression test without a minus steepens from the start
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import nnls

from softtact.errors import InputError
from softtact.materials.curves import DEFORMATION, VOLUMETRIC, AnyCurve
from softtact.materials.laws.base import SIMPLE_SHEAR, principal_stretches, rest_of, work_divisor

# No elastomer exceeds these; larger values are percent or in another unit.
LARGEST_STRETCH = 25.0
LARGEST_SHEAR = 10.0
LARGEST_STRESS_MPA = 200.0
LARGEST_PRESSURE_MPA = 2000.0
# Stress may have the wrong sign by this share of the largest one (zero drift of a load cell) before it is refused.
SIGN_TOLERANCE = 0.05
# kPa among MPa is a factor of 1000; the moduli of one rubber in different modes are within a factor of ten over any range.
UNIT_JUMP = (200.0, 5000.0)
MODULI_APART = 50.0
SMALLEST_SOLID = 0.7    # volume ratio; a foam's goes below
_MODULI_MPA = (0.001, 30.0)     # initial shear moduli of gels, and of hard polyurethane
_COMMON_MPA = 10.0              # in percent, a silicone's curve, which is straight up to a stretch of 2, would have 20 MPa
# Another interpretation of a curve is reported where it has less than this share of the error; for real rubbers it has half or
# more.
_MUCH_BETTER = 0.2
_FAR = 4.0                      # stretch beyond which no rubber's curve is as straight as over a few percent
_NEAR_ZERO = 0.005              # largest strain of a row that counts as unstrained
_FEWEST = 5                     # rows of which the form of a curve tells one test from another
_START = 0.2                    # strain up to which a curve is proportional to the neo-Hookean law's
_PRELOAD = (0.05, 0.3)          # of the stress at `_START`: with an unstrained row, and with an extrapolated line
_SLACK_STRAINS = (0.05, 0.1, 0.2, 0.4)      # the modulus over the first two of these against that over the last two
# Of the greatest stress before, of the greatest of all, and of the noise: a larger fall of the stress is a break.
_BREAK = (0.1, 0.03, 6.0)
_AROUND = 5                     # rows whose median tells what a row should be
_ALONE = (0.5, 0.1)             # least distance from it of a wrong row: over it, and over the greatest of all
# Fewest rows at one greatest stress, least share of the strains, and least change before them over the smallest step of the stress.
_STANDS = (8, 0.05, 5.0)
_SLACK = 0.5                    # their ratio; in twelve published curves it is 0.7 and more


def checked(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str, raw: np.ndarray,
            compression: bool, window: Sequence[float] | None = None) -> tuple[str, ...]:
    """Remarks (a tuple of sentences) on a curve; data with a wrong sign or mixed units are refused, see also `refuse_impossible`.

    rows: (n,) numbers of the file's rows;  x, y: (n,) stretch and nominal stress, or volume ratio and pressure, in MPa
    raw: (2, n) the same two columns as in the file;  compression: whether the test is stated to be written without a minus
    window: [min, max] of x that will be used, for remarks are on these rows
    """
    _check_sign(path, rows, x, y, mode, raw, compression)
    _check_units_within(path, rows, x, y, mode)
    if window is not None:
        inside = (x >= window[0]) & (x <= window[1])
        if inside.sum() > 2:
            rows, x, y = rows[inside], x[inside], y[inside]
    found = _of_volume(x) if mode == VOLUMETRIC else remarks(x, y, mode=mode, compression=compression)
    sound, alone = _rows_alone(rows, x, y, mode)
    found = (*found, *alone, *_break(rows[sound], x[sound], y[sound], mode), *_standing(rows[sound], x[sound], y[sound], mode))
    return tuple(f"{path}: {remark}" for remark in found)


def _rows_alone(rows, x, y, mode):
    """Mask (n,) of the rows that are no wrong single ones, and the remark on these, in a tuple that is empty without any."""
    order = np.argsort(x - rest_of(mode), kind="stable")
    usual = median_filter(y[order], size=_AROUND, mode="nearest")
    wrong = np.abs(y[order] - usual) > np.maximum(_ALONE[0] * np.abs(usual), _ALONE[1] * np.abs(usual).max())
    sound = np.ones(len(x), dtype=bool)
    sound[order] = ~wrong
    if not wrong.any() or wrong.sum() > len(x) // _AROUND:
        return np.ones(len(x), dtype=bool), ()
    first = int(np.flatnonzero(~sound)[0])
    more = f", and {wrong.sum() - 1} more such rows" if wrong.sum() > 1 else ""
    return sound, (f"row {rows[first]}: the stress {y[first]:.4g} MPa stands alone between rows of about "
                   f"{usual[int(np.flatnonzero(order == first)[0])]:.4g} MPa{more}; correct or remove it",)


def _standing(rows, x, y, mode):
    """The remark on a largest stress that stands while the strain grows to its end, in a tuple that is empty otherwise."""
    strain = np.abs(x - rest_of(mode))
    at = np.argsort(strain, kind="stable")
    strain, stress = strain[at], np.abs(y[at])
    steps = np.diff(stress)
    count = len(stress) - 1 - int(np.flatnonzero(steps)[-1]) if steps.any() else 0
    if count < _STANDS[0] or stress[-1] < stress.max():
        return ()
    first, span = len(stress) - count, strain[-1] - strain[-count]
    before = np.interp(strain[first] - span, strain[:first], stress[:first])
    if span < _STANDS[1] * np.ptp(strain) or stress[-1] - before < _STANDS[2] * np.abs(steps[steps != 0]).min():
        return ()
    return (f"from row {rows[at[first]]} on its stress stands at {stress[-1]:.4g} MPa while the strain grows, as at the end of a "
            "load cell's range; leave these rows out, or state the window before them",)


def _break(rows, x, y, mode):
    """The remark on a stress that falls while the strain grows, in a tuple that is empty otherwise."""
    strain = x - rest_of(mode)
    for side in (strain >= 0, strain <= 0):
        at = np.flatnonzero(side)[np.argsort(np.abs(strain[side]), kind="stable")]
        stress = np.abs(y[at])
        if len(at) < 3 or not strain[at].any():
            continue
        greatest = np.maximum.accumulate(stress)
        scale = np.maximum(stress, _BREAK[0] * stress.max())
        fallen = greatest - stress > np.maximum(np.maximum(_BREAK[0], _BREAK[2] * normal_noise(stress, scale)) * greatest,
                                                _BREAK[1] * stress.max())
        if fallen.any():
            first = int(np.argmax(fallen))
            peak = int(np.argmax(stress[:first]))
            least, ends = stress[peak:].min(), sorted((float(x[at[0]]), float(x[at[peak]])))
            return (f"from row {rows[at[peak + 1]]} on its stress falls, by {1 - least / stress[peak]:.0%} in all, while the "
                    "strain grows, as where a specimen tears or slips in its clamps; leave these rows out, or state the window "
                    f"before them (--window {mode}={ends[0]:.6g}:{ends[1]:.6g})",)
    return ()


def normal_noise(values: np.ndarray, scale: np.ndarray | float = 1.0) -> float:
    """Standard deviation of the noise of a smooth curve (n,), over its scale (n,): by the first quartile of second differences.

    Jumps and bends, which are in fewer rows, do not count. 0 for fewer than three values.
    """
    second = np.abs(np.diff(values, 2)) / np.broadcast_to(scale, np.shape(values))[1:-1]
    return float(np.quantile(second, 0.25)) / (np.sqrt(6) * 0.3186) if len(second) else 0.0


def refuse_mixed_units(curves: Sequence[AnyCurve]) -> None:
    """Refuse curves of one material whose stiffnesses are so far apart that one must be in another unit."""
    moduli = [(secant_modulus(curve.mode, curve.deformation, curve.stress), curve) for curve in curves if curve.mode != VOLUMETRIC]
    moduli = [(modulus, curve) for modulus, curve in moduli if modulus > 0]
    if len(moduli) < 2:
        return
    (low, soft), (high, stiff) = (pick(moduli, key=lambda pair: pair[0]) for pick in (min, max))
    if high > MODULI_APART * low:
        raise InputError(
            f"{stiff.source} ({stiff.mode}) is {high / low:.3g} times as stiff as {soft.source} ({soft.mode}), {high:.3g} against"
            f" {low:.3g} MPa: one of them is in another unit; name its columns with its unit, such as nominal_stress_kpa."
        )


def refuse_first(path: str | Path, rows: np.ndarray, values: np.ndarray, bad: np.ndarray, sentence: str) -> None:
    """Raise for the first bad value, if there is one: rows, values, bad (n,); `sentence` takes {value}."""
    if bad.any():
        first = int(np.argmax(bad))
        raise InputError(f"{path}, row {rows[first]}: " + sentence.format(value=f"{values[first]:.6g}"))


def _swapped(raw, mode):
    """Addition to a refusal where the two columns, swapped, would be a curve of stress and stretch."""
    y, x = raw
    plausible = mode != VOLUMETRIC and (x > 0.05).all() and np.abs(x - 1).min() < 0.3 and (
        (y * np.sign(x - 1)) >= -SIGN_TOLERANCE * np.abs(y).max()).all()
    return " (swapped, the columns would make sense: are they swapped?)" if plausible else ""


def refuse_impossible(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str, raw: np.ndarray) -> None:
    """Refuse stresses that are all 0, and the first row whose deformation or stress no elastomer has; arguments as of `checked`."""
    if not y.any():
        raise InputError(f"{path}: every {'pressure' if mode == VOLUMETRIC else 'stress'} is 0, as of a channel that was not "
                         "recorded; name the right column, or leave the file out.")
    if mode == SIMPLE_SHEAR:
        refuse_first(path, rows, x, np.abs(x) > LARGEST_SHEAR,
                     f"the shear strain {{value}} is beyond {LARGEST_SHEAR:g}, which no elastomer bears; if the column holds "
                     "percent, name it shear_strain_percent.")
        x = 1 + np.abs(x)
    name = DEFORMATION.get(mode, "stretch")
    refuse_first(
        path, rows, x, x <= 0,
        f"the {name} {{value}} is not positive; if the column holds strain, name it engineering_strain, true_strain"
        f" or engineering_strain_percent{_swapped(raw, mode)}.",
    )  # fmt: skip
    if mode == VOLUMETRIC:
        refuse_first(path, rows, x, (x < 0.3) | (x > 2),
                      "the volume ratio {value} is beyond what a solid bears; if the column holds strain or percent, name it"
                      " volumetric_strain or volumetric_strain_percent.")
    refuse_first(
        path, rows, x, x > LARGEST_STRETCH,
        f"the stretch {{value}} is above {LARGEST_STRETCH:g}, which no elastomer reaches;"
        f" if the column holds percent, name it engineering_strain_percent{_swapped(raw, mode)}.",
    )  # fmt: skip
    what, largest = ("pressure", LARGEST_PRESSURE_MPA) if mode == VOLUMETRIC else ("stress", LARGEST_STRESS_MPA)
    prefix = "pressure" if mode == VOLUMETRIC else "nominal_stress"
    refuse_first(
        path, rows, y, np.abs(y) > largest,
        f"the {what} {{value}} MPa is beyond {largest:g} MPa, which no elastomer bears;"
        f" if the column holds kPa or Pa, name it {prefix}_kpa or {prefix}_pa.",
    )  # fmt: skip


def _check_sign(path, rows, x, y, mode, raw, compression):
    wrong = y * np.sign(x - rest_of(mode)) * (-1 if mode == VOLUMETRIC else 1) < -SIGN_TOLERANCE * np.abs(y).max()
    if mode == VOLUMETRIC:
        refuse_first(path, rows, y, wrong, "the pressure {value} MPa has the wrong sign for its volume ratio;"
                                            " a pressure that compresses is positive, with a volume ratio below 1.")
    remedy = ("leave `compression` out, as it is no compression test written without a minus" if compression
              else "write `compression: true` for a compression test written without a minus")
    refuse_first(
        path, rows, y, wrong,
        "the stress {value} MPa has the wrong sign for its stretch; tension is positive and compression negative, in strain"
        f" and in stress; {remedy}{_swapped(raw, mode)}.",
    )  # fmt: skip


def _check_units_within(path, rows, x, y, mode):
    """A stress that changes by a factor of about 1000 from one row to the next, and stays so, has changed its unit."""
    strain = np.abs(x - rest_of(mode))
    with np.errstate(divide="ignore", invalid="ignore"):
        growth = np.abs(y[1:] / y[:-1]) / (strain[1:] / strain[:-1])
        growth = np.maximum(growth, 1 / growth)
    jump = (growth > UNIT_JUMP[0]) & (growth < UNIT_JUMP[1])
    # Noise about zero jumps, too, but jumps back; on each side of a change of unit two rows agree.
    calm = np.concatenate([[False], growth[:-1] < 10]) & np.concatenate([growth[1:] < 10, [False]])
    refuse_first(path, rows[1:], y[1:], jump & calm,
                  "the stress jumps to {value} MPa, some 1000 times what the row before leads to: are units mixed? Give the whole"
                  " column in one unit.")


def _of_volume(ratio):
    """Remarks on volume ratios."""
    if ratio.min() < SMALLEST_SOLID:
        yield (f"the volume falls to {ratio.min():.3g} of what it was, as a foam's does; if the column holds percent, name it "
               "volumetric_strain_percent")


def remarks(stretch: np.ndarray, stress: np.ndarray, *, mode: str, compression: bool) -> Iterator[str]:
    """Sentences on a curve of shape: stretch (n,), nominal stress (n,) in MPa; `compression`: stated to be without a minus."""
    if mode == SIMPLE_SHEAR:
        found = [_modulus(stretch, stress, mode) or _tension_as_shear(stretch, stress) or _preload(stretch, stress, mode)
                 or _slack(stretch, stress, mode)]
        yield from (remark for remark in found if remark)
        return
    unit = _unit_of_strain(stretch, stress, mode) or _modulus(stretch, stress, mode)
    found = [unit, _positive_compression(stretch, stress, mode), _negative_tension(stretch, stress, mode) if compression else None]
    if not any(found):      # for a curve in another unit or of another sign the checks of zero are meaningless
        found = [_preload(stretch, stress, mode) or _slack(stretch, stress, mode) or _bent(stretch, stress, mode)]
    yield from (remark for remark in found if remark)


def secant_modulus(mode: str, stretch: np.ndarray, stress: np.ndarray) -> float:
    """Shear modulus (MPa) of the neo-Hookean law closest to a curve."""
    unit = _neo_hooke(mode, stretch)
    return float(unit @ stress / (unit @ unit)) if unit.any() else 0.0


def _neo_hooke(mode, stretch):
    """Nominal stress (n,) over the shear modulus."""
    stretches = principal_stretches(mode, stretch)
    return (stretches[:, 0] ** 2 - stretches[:, 2] ** 2) / work_divisor(mode, stretches)


def _unit_of_strain(stretch, stress, mode):
    """Remark on percent declared as a ratio, or a ratio declared as percent."""
    strain, largest = np.abs(stretch - 1), np.abs(stretch - 1).max()
    percent = (1 + (stretch - 1) / 100, stretch**0.01)      # of engineering or true strain
    as_percent = largest > 0.5 and any(_better(stretch, stress, other, mode) or _all_but_noise(stretch, stress, other, mode)
                                       for other in percent)
    coarse = stretch.max() > 3 and strain[strain > 1e-9].min() >= 0.5 and np.median(np.abs(np.diff(stretch))) >= 0.3
    if mode == "planar" and (shear := _shear_as_tension(stretch, stress, as_percent)):
        return shear
    if as_percent or coarse:
        return (f"the stretch goes to {stretch.max():.3g}, and the curve is that of a strain in percent; if the column holds "
                "percent, name it engineering_strain_percent")
    ratio = 1 + 100 * (stretch - 1)
    as_ratio = 0 < ratio.min() and 1.2 < ratio.max() < LARGEST_STRETCH and _better(stretch, stress, ratio, mode)
    if as_ratio or largest < 0.02:
        return (f"the largest strain is {largest:.2%}{', and the curve is that of a larger one' if as_ratio else ''}; if the "
                "column holds a ratio and not percent, name it engineering_strain")
    return None


def _shear_as_tension(stretch, stress, as_percent):
    """Remark on a planar curve that is a straight line, as of neo-Hooke in simple shear, the strain taken for gamma.

    `as_percent`: whether it may also be a curve in percent, nearly as straight; one that is much closer is the right one.
    """
    gamma = stretch - 1
    line, percent = (_misfit(unit, stress) for unit in (gamma, _neo_hooke("planar", 1 + gamma / 100)))
    largest, tension = np.abs(gamma).max(), _misfit(_neo_hooke("planar", stretch), stress)
    possible = len(gamma) >= _FEWEST and _START <= largest <= LARGEST_SHEAR and _as_stiff_as_rubber(SIMPLE_SHEAR, gamma, stress)
    if not possible or line >= _MUCH_BETTER * tension or as_percent and percent < _MUCH_BETTER * line:
        return None
    either = bool(as_percent and line > _MUCH_BETTER * percent)
    return (f"the stress is a straight line in strain up to {largest:.3g}, as in simple shear, which is another test; if it is "
            f"one, give it as {SIMPLE_SHEAR}{'; if the column holds percent, name it engineering_strain_percent' * either}")


def _tension_as_shear(gamma, stress):
    """Remark on a curve of simple shear that bends as planar tension does."""
    if len(gamma) < _FEWEST or gamma.min() < -0.3 or np.abs(gamma).max() < 0.5:
        return None
    if _misfit(_neo_hooke("planar", 1 + gamma), stress) < _MUCH_BETTER * _misfit(gamma, stress):
        return "it bends as a curve of planar tension does; if it is one, give it as planar"
    return None


def _better(stretch, stress, other, mode):
    """Whether the curve follows the law much better over other stretches, with the modulus of a rubber."""
    better = _misfit(_neo_hooke(mode, other), stress) < _MUCH_BETTER * _misfit(_neo_hooke(mode, stretch), stress)
    return better and _as_stiff_as_rubber(mode, other, stress)


def _as_stiff_as_rubber(mode, stretch, stress):
    return _MODULI_MPA[0] < secant_modulus(mode, stretch, stress) < _COMMON_MPA


def _all_but_noise(stretch, stress, other, mode):
    """Whether a curve to large stretches follows the Mooney-Rivlin law up to noise over other stretches, but not over the given."""
    if stretch.max() < _FAR or not _as_stiff_as_rubber(mode, other, stress):
        return False
    measured, there = (_mooney_misfit(mode, x, stress) for x in (stretch, other))
    noise = _left(np.vander(other - 1, 5), stress)
    largest = np.abs(stress).max()
    return there <= 1.2 * noise + 0.003 * largest and measured**2 - there**2 > (0.006 * largest) ** 2


def _mooney_misfit(mode, stretch, stress):
    """Root mean square residual (MPa) of the law with two constants, neither of them negative."""
    unit = _neo_hooke(mode, stretch)
    columns = np.column_stack([unit, unit * _second(mode, stretch)])
    return nnls(columns, stress)[1] / np.sqrt(len(stress))


def _second(mode, stretch):
    """Factor of the constant c01 relative to c10: the square of the middle principal stretch."""
    return principal_stretches(mode, stretch)[:, 1] ** 2


def _left(columns, stress):
    """Root mean square residual (MPa) of a least squares fit."""
    found = np.linalg.lstsq(columns, stress, rcond=None)[0]
    return float(np.sqrt(np.mean((stress - columns @ found) ** 2)))


def _modulus(stretch, stress, mode):
    start = np.abs(stretch - rest_of(mode)) <= 0.5
    used = start if start.sum() >= 3 else np.full(len(stretch), True)
    modulus = secant_modulus(mode, stretch[used], stress[used])
    if 0 < modulus < _MODULI_MPA[0] or modulus > _MODULI_MPA[1]:
        return (f"its shear modulus is {modulus:.3g} MPa, and rubbers have {_MODULI_MPA[0]:g} to {_MODULI_MPA[1]:g} MPa; check the "
                "units of strain and stress")
    return None


def _positive_compression(stretch, stress, mode):
    """Remark on a tension curve that stiffens from the start, as in compression."""
    if stretch.min() < 0.999 or not 1.05 < stretch.max() < 1.95:
        return None
    as_tension = _misfit(_neo_hooke(mode, stretch), stress)
    as_compression = _misfit(_neo_hooke(mode, 2 - stretch), -stress)
    if as_compression < _MUCH_BETTER * as_tension:
        return ("it steepens from the start, as a compression test written without a minus would; if it is one, say"
                " `compression: true`")
    return None


def _negative_tension(stretch, stress, mode):
    """Remark on a stated compression curve that softens from the start, as in tension."""
    if stretch.max() > 1.001 or not stretch.min() < 0.95:
        return None
    as_compression = _misfit(_neo_hooke(mode, stretch), stress)
    if _misfit(_neo_hooke(mode, 2 - stretch), -stress) < _MUCH_BETTER * as_compression:
        return "it softens from the start, as a tension test would; if it is one, leave `compression` out"
    return None


def _preload(stretch, stress, mode):
    """Remark on stress without strain: of unstrained rows, else by extrapolation of the straight line of the first strains."""
    strain, unit = np.abs(stretch - rest_of(mode)), _neo_hooke(mode, stretch)
    start, none = strain <= _START, strain <= _NEAR_ZERO
    if start.sum() < 3 or strain.min() > 0.05:
        return None
    slope, at_zero = np.polyfit(unit[start], stress[start], 1)
    scale = max(slope, secant_modulus(mode, stretch, stress)) * np.abs(_neo_hooke(mode, np.array([rest_of(mode) + _START]))[0])
    noise = np.sqrt(np.mean((stress[start] - at_zero - slope * unit[start]) ** 2))
    if none.any():
        at_zero = float(np.mean(stress[none] - slope * unit[none]))
    offset = abs(at_zero) if none.any() else at_zero * _loading(stretch, mode)
    if offset > max(_PRELOAD[0 if none.any() else 1] * scale, 3 * noise) > 0:
        return (f"it has a stress of {at_zero:.3g} MPa at no strain, as a preload or an offset of the load cell gives; take it off "
                "the column")
    return None


def _slack(stretch, stress, mode):
    """Remark on strain without stress: a modulus over the first strains far below that over the next ones."""
    strain, unit = np.abs(stretch - rest_of(mode)), _neo_hooke(mode, stretch)
    if strain.min() > _SLACK_STRAINS[0]:
        return None
    scale = min(strain.max() / _SLACK_STRAINS[-1], 1.0)
    (low, high), (next_low, next_high) = scale * np.reshape(_SLACK_STRAINS, (2, 2))
    moduli = [_modulus_between(strain, stress, unit, *ends) for ends in ((low, high), (next_low, next_high))]
    if None not in moduli and (moduli[0] < _SLACK * moduli[1] or moduli[1] < 0.05 * secant_modulus(mode, stretch, stress)):
        return ("its stress hardly rises over the first strains, as that of a slack specimen or of a plate without contact; take "
                "the strain without stress off the column")
    return None


def _bent(stretch, stress, mode):
    """Remark on a curve that bends over small strains, where a rubber's is proportional to the neo-Hookean law."""
    unit, largest = _neo_hooke(mode, stretch), np.abs(stretch - 1).max()
    if largest > 0.25 or len(stretch) < 8:
        return None
    line, noise = _left(np.vander(unit, 2), stress), _left(np.vander(unit, 5), stress)
    if line > max(0.015 * np.abs(stress).max(), 3 * noise):
        return (f"it bends over strains up to {largest:.2g} as a rubber's curve does over larger ones; if the column holds a ratio "
                "and not percent, name it engineering_strain")
    return None


def _modulus_between(strain, stress, unit, low, high):
    """Shear modulus (MPa) of the points with a strain between two values; None without any."""
    used = (strain > low * (1 - 1e-9)) & (strain <= high * (1 + 1e-9)) & (unit != 0)
    return float(unit[used] @ stress[used] / (unit[used] @ unit[used])) if used.any() else None


def _loading(stretch, mode):
    """+1 in tension, -1 in compression, by the larger strain."""
    return 1.0 if stretch.max() - rest_of(mode) >= rest_of(mode) - stretch.min() else -1.0


def _misfit(unit, stress):
    """Root mean square residual (MPa) of the best multiple of `unit`."""
    return float(np.sqrt(np.mean((stress - unit * (unit @ stress) / (unit @ unit)) ** 2))) if unit.any() else np.inf
