"""A material's curve files in one form: computed from a law, or read from the user's files."""

import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from softtact.errors import InputError
from softtact.materials.config import MeasuredCurves, SyntheticCurves, validated
from softtact.materials.curves import AnyCurve, join_by_mode, synthetic_curve, write_curve
from softtact.materials.laws.registry import make_law
from softtact.materials.readers import read_curve


def make_curves(measured: str | Path | Sequence[str | Path], curves: str | Path | Sequence[str | Path],
                settings: dict[str, Any]) -> None:
    """Write one CSV per mode to the paths `curves`, whose names are the modes.

    measured: paths of the user's files in the order of settings["files"], for kind "measured"
    settings: `MaterialConfig.curve_settings`
    """
    by_mode = {curve.mode: curve for curve in curves_of(settings, measured=measured)}
    for path in _paths(curves):
        if path.stem not in by_mode:
            raise InputError(f"{path}: material {settings['material']} has no {path.stem} curve, only {', '.join(by_mode)}.")
        write_curve(path, by_mode[path.stem])


def curves_of(settings: dict[str, Any], *, measured: str | Path | Sequence[str | Path] = ()) -> list[AnyCurve]:
    """The curves, one per mode, that `MaterialConfig.curve_settings` describe; `measured`: current paths of the user's files."""
    settings = dict(settings)
    material = settings.pop("material", None)
    if material is None:
        raise InputError("settings of make_curves: the key material is missing; add it.")
    if settings.get("kind") == "measured":
        window = settings.pop("window", {})
        return _measured(material, _paths(measured), settings, window)
    return _synthetic(material, settings)


def _synthetic(material, settings):
    """Curves from a law; each mode of each material has other noise under the same seed."""
    options = validated(SyntheticCurves, settings, where=f"material {material}, curves")
    law = make_law(options.law, options.parameters or {}, bulk_over_shear=options.bulk_over_shear)
    return [
        synthetic_curve(
            law, mode, window, points=options.points, noise=options.noise, seed=[options.seed, _number(material + mode)]
        )
        for mode, window in options.modes.items()
    ]


def _measured(material, paths, settings, window):
    """Curves from the user's files, those of one mode joined."""
    files = validated(MeasuredCurves, settings, where=f"material {material}, curves").files
    paths = paths or [Path(file.file) for file in files]
    options = [file.model_dump(exclude={"file"}) for file in files]
    return join_by_mode([read_curve(path, window=window, **option) for path, option in zip(paths, options, strict=True)])


def _number(text):
    """A number for a text, the same in every process (Python's `hash` is not)."""
    return zlib.crc32(text.encode())


def _paths(paths):
    """A list of paths from one or several."""
    return [Path(path) for path in ([paths] if isinstance(paths, (str, Path)) else paths)]
