"""Test curves: nominal stress against stretch, or pressure against volume; their CSV form, and windows of stretch."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.materials.laws.base import TEST_PATHS, Law
from softtact.unknown_names import unknown

VOLUMETRIC = "volumetric"
MODES = (*TEST_PATHS, VOLUMETRIC)


@dataclass(frozen=True)
class Curve:
    """One test of shape at constant volume.

    mode: "uniaxial", "equibiaxial" or "planar"
    stretch: (n,) stretch of the loaded direction, below 1 in compression
    nominal_stress: (n,) force over undeformed area in MPa, negative in compression
    kind: "measured" or "synthetic"
    source: file, or how it was computed, for the record
    remarks: sentences on its oddities, for the card's warnings
    """

    mode: str
    stretch: np.ndarray
    nominal_stress: np.ndarray
    kind: str = "measured"
    source: str = ""
    remarks: tuple = ()

    @property
    def window(self) -> tuple[float, float]:
        """Smallest and largest stretch."""
        return float(self.stretch.min()), float(self.stretch.max())

    def within(self, window: Sequence[float]) -> Self:
        """The part of the curve inside a window [min, max] of stretch."""
        keep = (self.stretch >= window[0]) & (self.stretch <= window[1])
        return replace(self, stretch=self.stretch[keep], nominal_stress=self.nominal_stress[keep])

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """{name in a file: values (n,)}"""
        return {"stretch": self.stretch, "nominal_stress_mpa": self.nominal_stress}


@dataclass(frozen=True)
class VolumetricCurve:
    """One test of volume under pressure from all sides.

    volume_ratio: (n,) J, volume over undeformed volume, below 1 in compression
    pressure: (n,) in MPa, positive in compression
    kind, source, remarks: as of a `Curve`
    """

    volume_ratio: np.ndarray
    pressure: np.ndarray
    kind: str = "measured"
    source: str = ""
    remarks: tuple = ()
    mode = VOLUMETRIC

    @property
    def window(self) -> tuple[float, float]:
        """Smallest and largest volume ratio."""
        return float(self.volume_ratio.min()), float(self.volume_ratio.max())

    def within(self, window: Sequence[float]) -> Self:
        """The part of the curve inside a window [min, max] of the volume ratio."""
        keep = (self.volume_ratio >= window[0]) & (self.volume_ratio <= window[1])
        return replace(self, volume_ratio=self.volume_ratio[keep], pressure=self.pressure[keep])

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """{name in a file: values (n,)}"""
        return {"volume_ratio": self.volume_ratio, "pressure_mpa": self.pressure}


def join_by_mode(curves: Sequence[Curve | VolumetricCurve]) -> list[Curve | VolumetricCurve]:
    """One curve per mode, its points sorted; for example from a tension and a compression test of the same material."""
    return [_join([curve for curve in curves if curve.mode == mode]) for mode in dict.fromkeys(c.mode for c in curves)]


def _join(curves):
    names = list(curves[0].columns)
    x, y = (np.concatenate([curve.columns[name] for curve in curves]) for name in names)
    order = np.argsort(x, kind="stable")
    fields = ("volume_ratio", "pressure") if curves[0].mode == VOLUMETRIC else ("stretch", "nominal_stress")
    return replace(curves[0], **dict(zip(fields, (x[order], y[order]), strict=True)), kind=common_kind(curves),
                   source="; ".join(curve.source for curve in curves),
                   remarks=tuple(remark for curve in curves for remark in curve.remarks))


def common_kind(curves: Sequence[Curve | VolumetricCurve]) -> str:
    """`measured` only if every curve is."""
    return "measured" if all(curve.kind == "measured" for curve in curves) else "synthetic"


def synthetic_curve(law: Law, mode: str, window: tuple[float, float], *, points: int, noise: float,
                    seed: int | Sequence[int]) -> Curve | VolumetricCurve:
    """A `Curve` (or `VolumetricCurve`) of `law` at `points` even stretches (volume ratios) in `window`, with normal noise.

    noise: standard deviation as a share of the curve's largest stress, like a load cell's share of full scale
    seed: int or sequence of int for numpy's generator
    """
    x = np.linspace(*window, points)
    stress = -law.volumetric.pressure(x - 1) if mode == VOLUMETRIC else law.nominal_stress(mode, x)
    error = noise * np.abs(stress).max() * np.random.default_rng(seed).standard_normal(points)
    values = ", ".join(f"{name} {value:g}" for name, value in law.parameters.items())
    volume = f"bulk modulus {law.bulk_modulus:g}" if mode == VOLUMETRIC else "incompressible"
    making = f"{law.name} ({values}), {volume}, normal noise of {noise:.3g} of the largest stress, seed {seed}"
    if mode == VOLUMETRIC:
        return VolumetricCurve(x, stress + error, "synthetic", making)
    return Curve(mode, x, stress + error, "synthetic", making)


def write_curve(path: str | Path, curve: Curve | VolumetricCurve) -> None:
    """Write a curve as CSV: `# key: value` lines with mode, kind, source and remarks, then its two columns."""
    lines = [f"# mode: {curve.mode}", f"# kind: {curve.kind}", f"# source: {curve.source}"]
    lines += [f"# remark: {remark}" for remark in curve.remarks]
    lines.append(",".join(curve.columns))
    lines += [f"{x:.6g},{y:.6g}" for x, y in zip(*curve.columns.values(), strict=True)]
    with atomic_path(path) as temporary:
        Path(temporary).write_text("\n".join(lines) + "\n", encoding="utf-8")


def refuse_idle(window: Mapping[str, Sequence[float]], weights: Mapping[str, float], *, modes: Collection[str]) -> None:
    """Refuse a window or a weight {mode: ...} that would change nothing in a fit to curves of these modes."""
    for name, what in (("window", window), ("weight", weights)):
        for mode in what:
            if mode not in MODES:
                fault = unknown(mode, MODES, kind="test mode")
                raise InputError(f"The {name} of {mode!r}: {fault}{'' if fault.endswith('?') else '.'}")
            if mode not in modes:
                raise InputError(f"The {name} of {mode} has no effect, as there is no {mode} curve; leave it out.")
    if VOLUMETRIC in weights:
        raise InputError("The weight of volumetric has no effect, as K is fitted to that curve alone; leave it out.")
    if weights and len(set(modes) - {VOLUMETRIC}) == 1:
        raise InputError("The weight of the only mode has no effect; leave it out, or give a second test.")


def principal_window(windows: Mapping[str, Sequence[float]]) -> tuple[float, float] | None:
    """Lowest and highest principal stretch over {mode: [min, max] stretch along the loading}; None without a test of shape."""
    stretches = [stretch**exponent for mode, window in windows.items() if mode in TEST_PATHS
                 for stretch in window for exponent in TEST_PATHS[mode]]
    return (min(stretches), max(stretches)) if stretches else None


def path_window(principal: tuple[float, float], mode: str) -> tuple[float, float]:
    """(min, max) stretch on the path of a mode along which every principal stretch stays in the window `principal`."""
    low, high = principal
    ends = [sorted((low ** (1 / e), high ** (1 / e))) for e in TEST_PATHS[mode] if e]
    return max(end[0] for end in ends), min(end[1] for end in ends)
