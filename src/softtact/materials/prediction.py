"""How well a law fitted to some tests predicts one that it has not seen."""

from collections.abc import Sequence
from typing import Any

from softtact.errors import InputError
from softtact.materials.curves import Curve
from softtact.materials.fitting import errors_of, fit_law


def predict_left_out(name: str, curves: Sequence[Curve], **options: Any) -> dict[str, dict[str, float] | None]:
    """{mode: {"rmse_mpa", "relative_error"}} of the law fitted to all curves but that mode's; {} with fewer than two.

    options: those of `FitOptions`. A law that the other curves have too few points for, or that does not exist where the one
    left out goes, has None.
    """
    if len(curves) < 2:
        return {}
    return {curve.mode: _error(name, curve, [other for other in curves if other is not curve], options) for curve in curves}


def _error(name, left_out, others, options):
    try:
        rmse, relative = errors_of(fit_law(name, others, **options).make(), [left_out])
    except InputError:
        return None
    return {"rmse_mpa": rmse, "relative_error": relative} if rmse == rmse else None
