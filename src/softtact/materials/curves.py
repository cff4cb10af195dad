"""Test curves: nominal stress against stretch, or pressure against volume; their CSV form, and windows of stretch."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.materials.laws.base import SIMPLE_SHEAR, TEST_PATHS, Law, principal_stretches
from softtact.unknown_names import unknown

VOLUMETRIC = "volumetric"
MODES = (*TEST_PATHS, SIMPLE_SHEAR, VOLUMETRIC)
DEFORMATION = {VOLUMETRIC: "volume ratio", SIMPLE_SHEAR: "shear strain"}     # of the other modes: stretch


class AnyCurve:
    """What the curves of all test modes share.

    mode: one of `MODES`;  kind: "measured" or "synthetic"
    source: file, or how it was computed, for the record
    remarks: sentences on its oddities, for the card's warnings
    """

    fields: ClassVar[tuple[str, str]]       # of the deformation and of the stress
    names: ClassVar[tuple[str, str]]        # of their columns in a file
    mode: str
    kind: str
    source: str
    remarks: tuple

    @property
    def deformation(self) -> np.ndarray:
        """(n,) stretch, shear strain or volume ratio."""
        return getattr(self, self.fields[0])

    @property
    def stress(self) -> np.ndarray:
        """(n,) nominal stress, shear stress or pressure, MPa."""
        return getattr(self, self.fields[1])

    @property
    def window(self) -> tuple[float, float]:
        """Smallest and largest stretch, shear strain or volume ratio."""
        return float(self.deformation.min()), float(self.deformation.max())

    def taken(self, rows: np.ndarray) -> Self:
        """The curve of some of its rows: their indices, in order, or (n,) booleans."""
        return replace(self, **{name: getattr(self, name)[rows] for name in self.fields})   # type: ignore[type-var]

    def within(self, window: Sequence[float]) -> Self:
        """The part of the curve inside a window [min, max] of stretch, shear strain or volume ratio."""
        return self.taken((self.deformation >= window[0]) & (self.deformation <= window[1]))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """{name in a file: values (n,)}"""
        return dict(zip(self.names, (self.deformation, self.stress), strict=True))


@dataclass(frozen=True)
class Curve(AnyCurve):
    """One test of shape at constant volume.

    mode: "uniaxial", "equibiaxial" or "planar"
    stretch: (n,) stretch of the loaded direction, below 1 in compression
    nominal_stress: (n,) force over undeformed area in MPa, negative in compression
    """

    fields = ("stretch", "nominal_stress")
    names = ("stretch", "nominal_stress_mpa")
    mode: str
    stretch: np.ndarray
    nominal_stress: np.ndarray
    kind: str = "measured"
    source: str = ""
    remarks: tuple = ()


@dataclass(frozen=True)
class ShearCurve(AnyCurve):
    """One test of simple shear at constant volume.

    shear_strain: (n,) gamma, displacement over thickness
    shear_stress: (n,) force along the sheared face over its area in MPa, of the sign of gamma
    """

    fields = ("shear_strain", "shear_stress")
    names = ("shear_strain", "shear_stress_mpa")
    shear_strain: np.ndarray
    shear_stress: np.ndarray
    kind: str = "measured"
    source: str = ""
    remarks: tuple = ()
    mode = SIMPLE_SHEAR


@dataclass(frozen=True)
class VolumetricCurve(AnyCurve):
    """One test of volume under pressure from all sides.

    volume_ratio: (n,) J, volume over undeformed volume, below 1 in compression
    pressure: (n,) in MPa, positive in compression
    """

    fields = ("volume_ratio", "pressure")
    names = ("volume_ratio", "pressure_mpa")
    volume_ratio: np.ndarray
    pressure: np.ndarray
    kind: str = "measured"
    source: str = ""
    remarks: tuple = ()
    mode = VOLUMETRIC


def make_curve(mode: str, deformation: np.ndarray, stress: np.ndarray, **record: Any) -> AnyCurve:
    """The curve of a mode; record: kind, source and remarks."""
    if mode == SIMPLE_SHEAR:
        return ShearCurve(deformation, stress, **record)
    return VolumetricCurve(deformation, stress, **record) if mode == VOLUMETRIC else Curve(mode, deformation, stress, **record)


def join_by_mode(curves: Sequence[AnyCurve]) -> list[AnyCurve]:
    """One curve per mode, its points sorted; for example from a tension and a compression test of the same material."""
    return [_join([curve for curve in curves if curve.mode == mode]) for mode in dict.fromkeys(c.mode for c in curves)]


def _join(curves):
    x, y = (np.concatenate([getattr(curve, name) for curve in curves]) for name in curves[0].fields)
    order = np.argsort(x, kind="stable")
    return make_curve(curves[0].mode, x[order], y[order], kind=common_kind(curves), source="; ".join(c.source for c in curves),
                      remarks=tuple(remark for curve in curves for remark in curve.remarks))


def common_kind(curves: Sequence[AnyCurve]) -> str:
    """`measured` only if every curve is."""
    return "measured" if all(curve.kind == "measured" for curve in curves) else "synthetic"


def synthetic_curve(law: Law, mode: str, window: tuple[float, float], *, points: int, noise: float,
                    seed: int | Sequence[int]) -> AnyCurve:
    """The curve of `law` in a mode at `points` even stretches (shear strains, volume ratios) in `window`, with normal noise.

    noise: standard deviation as a share of the curve's largest stress, like a load cell's share of full scale
    seed: int or sequence of int for numpy's generator
    """
    x = np.linspace(*window, points)
    with np.errstate(all="ignore"):
        stress = law.pressure(x) if mode == VOLUMETRIC else law.nominal_stress(mode, x)
    if not np.isfinite(stress).all():
        raise InputError(f"The law {law.name} does not exist at the {DEFORMATION.get(mode, 'stretch')} "
                         f"{x[~np.isfinite(stress)][0]:.4g} of a {mode} curve; narrow its window.")
    error = noise * np.abs(stress).max() * np.random.default_rng(seed).standard_normal(points)
    values = ", ".join(f"{name} {value:g}" for name, value in law.parameters.items())
    volume = f"bulk modulus {law.bulk_modulus:g}" if mode == VOLUMETRIC else "incompressible"
    making = f"{law.name} ({values}), {volume}, normal noise of {noise:.3g} of the largest stress, seed {seed}"
    return make_curve(mode, x, stress + error, kind="synthetic", source=making)


def write_curve(path: str | Path, curve: AnyCurve) -> None:
    """Write a curve as CSV: `# key: value` lines with mode, kind, source and remarks, then its two columns."""
    lines = [f"# mode: {curve.mode}", f"# kind: {curve.kind}", f"# source: {curve.source}"]
    lines += [f"# remark: {remark}" for remark in curve.remarks]
    lines.append(",".join(curve.columns))
    digits = 12 if curve.mode == VOLUMETRIC else 6      # K follows from 1 - J, which is a few 1e-5 of a rubber at 0.1 MPa
    lines += [f"{x:.{digits}g},{y:.6g}" for x, y in zip(*curve.columns.values(), strict=True)]
    with atomic_path(path) as temporary:
        Path(temporary).write_text("\n".join(lines) + "\n", encoding="utf-8")


def refuse_idle(window: Mapping[str, Sequence[float]], weights: Mapping[str, float], *, modes: Collection[str]) -> None:
    """Refuse a window or a weight {mode: ...} that would change nothing in a fit to curves of these modes."""
    for name, what in (("window", window), ("weight", weights)):
        for mode in what:
            refuse_unknown_mode(name, mode)
            if mode not in modes:
                raise InputError(f"The {name} of {mode} has no effect, as there is no {mode} curve; leave it out.")
    if VOLUMETRIC in weights:
        raise InputError("The weight of volumetric has no effect, as K is fitted to that curve alone; leave it out.")
    if weights and len(set(modes) - {VOLUMETRIC}) == 1:
        raise InputError("The weight of the only mode has no effect; leave it out, or give a second test.")


def refuse_unknown_mode(name: str, mode: str) -> None:
    """Refuse a window or a weight, by its name, of what is no test mode."""
    if mode not in MODES:
        fault = unknown(mode, MODES, kind="test mode")
        raise InputError(f"The {name} of {mode!r}: {fault}{'' if fault.endswith('?') else '.'}")


def principal_window(windows: Mapping[str, Sequence[float]]) -> tuple[float, float] | None:
    """Lowest and highest principal stretch over {mode: [min, max] stretch or shear strain}; None without a test of shape."""
    stretches = [principal_stretches(mode, np.array(window)) for mode, window in windows.items()
                 if mode in (*TEST_PATHS, SIMPLE_SHEAR)]
    return (float(np.min(stretches)), float(np.max(stretches))) if stretches else None


def path_of(mode: str, window: Sequence[float]) -> tuple[str, tuple[float, float]]:
    """(mode of `TEST_PATHS`, window of its stretch) with the principal stretches of a test mode of shape over its window."""
    if mode != SIMPLE_SHEAR:
        return mode, (window[0], window[1])
    low, high = principal_stretches(mode, np.array(window))[:, 0].tolist()
    return "planar", (low, high)


def path_window(principal: tuple[float, float], mode: str) -> tuple[float, float]:
    """(min, max) stretch on the path of a mode along which every principal stretch stays in the window `principal`."""
    low, high = principal
    ends = [sorted((low ** (1 / e), high ** (1 / e))) for e in TEST_PATHS[mode] if e]
    return max(end[0] for end in ends), min(end[1] for end in ends)
