"""What makes a test curve unfit for a fit: refused with row and remedy, or, where it may be right, said in a remark."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.materials.curves import VOLUMETRIC, Curve, VolumetricCurve
from softtact.materials.laws.base import principal_stretches

# No elastomer goes beyond these; values beyond are percent or another unit.
LARGEST_STRETCH = 25.0
LARGEST_STRESS_MPA = 200.0
LARGEST_PRESSURE_MPA = 2000.0
# Stress may have the wrong sign by this share of the largest one (zero drift of a load cell) before it is refused.
SIGN_TOLERANCE = 0.05
# kPa among MPa is a factor of 1000; the modes of one rubber, over whatever range, are within ten of each other.
UNIT_JUMP = (200.0, 5000.0)
MODULI_APART = 50.0


def checked(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str, raw: np.ndarray) -> tuple[str, ...]:
    """Remarks (a tuple of sentences) on a curve; what cannot be right is refused.

    rows: (n,) numbers of the file's rows;  x, y: (n,) stretch and nominal stress, or volume ratio and pressure, in MPa
    raw: (2, n) the same two columns as the file has them
    """
    _check_magnitude(path, rows, x, y, mode, raw)
    _check_sign(path, rows, x, y, mode, raw)
    _check_units_within(path, rows, x, y)
    if mode == VOLUMETRIC:
        return ()
    return tuple(f"{path}: {remark}" for remark in (_percent(x), _ratio_as_percent(x), _positive_compression(x, y, mode)) if remark)


def order(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str,
          sort: bool) -> tuple[np.ndarray, np.ndarray]:
    """x and y in rising or falling order: as they are, or sorted."""
    if sort:
        by_x = np.argsort(x, kind="stable")
        return x[by_x], y[by_x]
    steps, forward = np.diff(x), np.sign(x[-1] - x[0])
    name = "volume ratio" if mode == VOLUMETRIC else "stretch"
    _refuse_first(
        path, rows[1:], x[1:], steps * forward < 0 if forward else steps != 0,
        f"the {name} turns back to {{value}}; keep one loading branch, or say `sort: true` if its rows are in disorder.",
    )  # fmt: skip
    if not forward:
        raise InputError(f"{path}: every row has the {name} {x[0]:.6g}; give a curve over a range.")
    return x, y


def refuse_mixed_units(curves: Sequence[Curve | VolumetricCurve]) -> None:
    """Refuse curves of one material whose stiffnesses are so far apart that one must be in another unit."""
    moduli = [(secant_modulus(curve), curve) for curve in curves if curve.mode != VOLUMETRIC]     # type: ignore[arg-type]
    moduli = [(modulus, curve) for modulus, curve in moduli if modulus > 0]
    if len(moduli) < 2:
        return
    (low, soft), (high, stiff) = (pick(moduli, key=lambda pair: pair[0]) for pick in (min, max))
    if high > MODULI_APART * low:
        raise InputError(
            f"{stiff.source} ({stiff.mode}) is {high / low:.3g} times as stiff as {soft.source} ({soft.mode}), {high:.3g} against"
            f" {low:.3g} MPa: one of them is in another unit; name its columns with its unit, such as nominal_stress_kpa."
        )


def secant_modulus(curve: Curve) -> float:
    """Shear modulus (MPa) of the neo-Hookean law closest to the curve."""
    unit = _neo_hooke(curve.mode, curve.stretch)
    return float(unit @ curve.nominal_stress / (unit @ unit)) if unit.any() else 0.0


def _neo_hooke(mode, stretch):
    """Nominal stress (n,) over the shear modulus."""
    square = principal_stretches(mode, stretch) ** 2
    return (square[:, 0] - square[:, 2]) / stretch


def _refuse_first(path, rows, values, bad, sentence):
    """Raise for the first bad value, if there is one; `sentence` takes {value}."""
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
    _refuse_first(
        path, rows, x, x <= 0,
        f"the {name} {{value}} is not positive; if the column holds strain, name it engineering_strain, true_strain"
        f" or engineering_strain_percent{_swapped(raw, mode)}.",
    )  # fmt: skip
    if mode == VOLUMETRIC:
        _refuse_first(path, rows, x, (x < 0.3) | (x > 2),
                      "the volume ratio {value} is beyond what a solid bears; if the column holds strain or percent, name it"
                      " volumetric_strain or volumetric_strain_percent.")
    _refuse_first(
        path, rows, x, x > LARGEST_STRETCH,
        f"the stretch {{value}} is above {LARGEST_STRETCH:g}, which no elastomer reaches;"
        f" if the column holds percent, name it engineering_strain_percent{_swapped(raw, mode)}.",
    )  # fmt: skip
    what, largest = ("pressure", LARGEST_PRESSURE_MPA) if mode == VOLUMETRIC else ("stress", LARGEST_STRESS_MPA)
    prefix = "pressure" if mode == VOLUMETRIC else "nominal_stress"
    _refuse_first(
        path, rows, y, np.abs(y) > largest,
        f"the {what} {{value}} MPa is beyond {largest:g} MPa, which no elastomer bears;"
        f" if the column holds kPa or Pa, name it {prefix}_kpa or {prefix}_pa.",
    )  # fmt: skip


def _check_sign(path, rows, x, y, mode, raw):
    wrong = y * np.sign(x - 1) * (-1 if mode == VOLUMETRIC else 1) < -SIGN_TOLERANCE * np.abs(y).max()
    if mode == VOLUMETRIC:
        _refuse_first(path, rows, y, wrong, "the pressure {value} MPa has the wrong sign for its volume ratio;"
                                            " a pressure that compresses is positive, with a volume ratio below 1.")
    _refuse_first(
        path, rows, y, wrong,
        "the stress {value} MPa has the wrong sign for its stretch; tension is positive and compression negative, in strain"
        f" and in stress; say `compression: true` for a compression test written without a minus{_swapped(raw, mode)}.",
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
    _refuse_first(path, rows[1:], y[1:], jump & calm,
                  "the stress jumps to {value} MPa, some 1000 times what the row before leads to: are units mixed? Give the whole"
                  " column in one unit.")


def _percent(stretch):
    strain = np.abs(stretch - 1)
    if stretch.max() > 3 and strain[strain > 1e-9].min() >= 0.5 and np.median(np.abs(np.diff(stretch))) >= 0.3:
        return (f"the stretch starts at {1 + strain[strain > 1e-9].min():.3g} and goes to {stretch.max():.3g};"
                " if the column holds percent, name it engineering_strain_percent")
    return None


def _ratio_as_percent(stretch):
    largest = np.abs(stretch - 1).max()
    if largest < 0.02:
        return f"the largest strain is {largest:.2%}; if the column holds a ratio and not percent, name it engineering_strain"
    return None


def _positive_compression(stretch, stress, mode):
    """A tension curve that steepens from the start, as the same curve in compression would."""
    if stretch.min() < 0.999 or not 1.05 < stretch.max() < 1.95:
        return None
    as_tension = _misfit(_neo_hooke(mode, stretch), stress)
    as_compression = _misfit(_neo_hooke(mode, 2 - stretch), -stress)
    if as_compression < 0.2 * as_tension:
        return ("it steepens from the start, as a compression test written without a minus would; if it is one, say"
                " `compression: true`")
    return None


def _misfit(unit, stress):
    """Root mean square (MPa) of what the best multiple of `unit` leaves."""
    return float(np.sqrt(np.mean((stress - unit * (unit @ stress) / (unit @ unit)) ** 2)))
