"""What makes a test curve unfit for a fit: refused with row and remedy, or, where it may be right, said in a remark."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.materials.curves import VOLUMETRIC, Curve, VolumetricCurve
from softtact.materials.plausibility import remarks, secant_modulus

# No elastomer goes beyond these; values beyond are percent or another unit.
LARGEST_STRETCH = 25.0
LARGEST_STRESS_MPA = 200.0
LARGEST_PRESSURE_MPA = 2000.0
# Stress may have the wrong sign by this share of the largest one (zero drift of a load cell) before it is refused.
SIGN_TOLERANCE = 0.05
# kPa among MPa is a factor of 1000; the modes of one rubber, over whatever range, are within ten of each other.
UNIT_JUMP = (200.0, 5000.0)
MODULI_APART = 50.0
SMALLEST_SOLID = 0.7    # volume ratio; a foam's goes below


def checked(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str, raw: np.ndarray,
            compression: bool) -> tuple[str, ...]:
    """Remarks (a tuple of sentences) on a curve; what cannot be right is refused.

    rows: (n,) numbers of the file's rows;  x, y: (n,) stretch and nominal stress, or volume ratio and pressure, in MPa
    raw: (2, n) the same two columns as the file has them;  compression: the test was said to be written without a minus
    """
    _check_magnitude(path, rows, x, y, mode, raw)
    _check_sign(path, rows, x, y, mode, raw, compression)
    _check_units_within(path, rows, x, y)
    if mode == VOLUMETRIC:
        return tuple(f"{path}: {remark}" for remark in _of_volume(x))
    return tuple(f"{path}: {remark}" for remark in remarks(x, y, mode=mode, compression=compression))


def refuse_mixed_units(curves: Sequence[Curve | VolumetricCurve]) -> None:
    """Refuse curves of one material whose stiffnesses are so far apart that one must be in another unit."""
    moduli = [(secant_modulus(curve.mode, curve.stretch, curve.nominal_stress), curve) for curve in curves
              if isinstance(curve, Curve)]
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
    """What to add to a refusal where the two columns, taken the other way round, would be a curve of stress and stretch."""
    y, x = raw
    plausible = mode != VOLUMETRIC and (x > 0.05).all() and np.abs(x - 1).min() < 0.3 and (
        (y * np.sign(x - 1)) >= -SIGN_TOLERANCE * np.abs(y).max()).all()
    return " (the other way round the columns would make sense: are they swapped?)" if plausible else ""


def _check_magnitude(path, rows, x, y, mode, raw):
    name = "volume ratio" if mode == VOLUMETRIC else "stretch"
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
    wrong = y * np.sign(x - 1) * (-1 if mode == VOLUMETRIC else 1) < -SIGN_TOLERANCE * np.abs(y).max()
    if mode == VOLUMETRIC:
        refuse_first(path, rows, y, wrong, "the pressure {value} MPa has the wrong sign for its volume ratio;"
                                            " a pressure that compresses is positive, with a volume ratio below 1.")
    remedy = ("leave `compression` out, for it is no compression test written without a minus" if compression
              else "say `compression: true` for a compression test written without a minus")
    refuse_first(
        path, rows, y, wrong,
        "the stress {value} MPa has the wrong sign for its stretch; tension is positive and compression negative, in strain"
        f" and in stress; {remedy}{_swapped(raw, mode)}.",
    )  # fmt: skip


def _check_units_within(path, rows, x, y):
    """A stress that changes by a factor of about 1000 from one row to the next, and stays so, has changed its unit."""
    strain = np.abs(x - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        growth = np.abs(y[1:] / y[:-1]) / (strain[1:] / strain[:-1])
        growth = np.maximum(growth, 1 / growth)
    jump = (growth > UNIT_JUMP[0]) & (growth < UNIT_JUMP[1])
    # Noise about zero jumps too, but back again: on both sides of a change of unit two rows agree.
    calm = np.concatenate([[False], growth[:-1] < 10]) & np.concatenate([growth[1:] < 10, [False]])
    refuse_first(path, rows[1:], y[1:], jump & calm,
                  "the stress jumps to {value} MPa, some 1000 times what the row before leads to: are units mixed? Give the whole"
                  " column in one unit.")


def _of_volume(ratio):
    """Remarks on volume ratios."""
    if ratio.min() < SMALLEST_SOLID:
        yield (f"the volume falls to {ratio.min():.3g} of what it was, as a foam's does; if the column holds percent, name it "
               "volumetric_strain_percent")
