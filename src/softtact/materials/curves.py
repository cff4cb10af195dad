"""Test curves: nominal stress against stretch in one test mode, and the project's own CSV form of them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softtact.files import atomic_path


@dataclass(frozen=True)
class Curve:
    """One test.

    mode: "uniaxial", "equibiaxial" or "planar"
    stretch: (n,) stretch of the loaded direction, below 1 in compression
    nominal_stress: (n,) force over undeformed area in MPa, negative in compression
    kind: "measured" or "synthetic"
    source: file or making, for the record
    """

    mode: str
    stretch: np.ndarray
    nominal_stress: np.ndarray
    kind: str = "measured"
    source: str = ""

    @property
    def window(self):
        """Smallest and largest stretch."""
        return float(self.stretch.min()), float(self.stretch.max())

    def within(self, window):
        """The part of the curve inside a window [min, max] of stretch."""
        keep = (self.stretch >= window[0]) & (self.stretch <= window[1])
        return Curve(self.mode, self.stretch[keep], self.nominal_stress[keep], self.kind, self.source)


def join_by_mode(curves):
    """One curve per mode, its points sorted by stretch: say, a tension and a compression test of the same material."""
    return [_join([curve for curve in curves if curve.mode == mode]) for mode in dict.fromkeys(c.mode for c in curves)]


def _join(curves):
    stretch = np.concatenate([curve.stretch for curve in curves])
    stress = np.concatenate([curve.nominal_stress for curve in curves])
    order = np.argsort(stretch, kind="stable")
    source = "; ".join(curve.source for curve in curves)
    return Curve(curves[0].mode, stretch[order], stress[order], common_kind(curves), source)


def common_kind(curves):
    """`measured` only if every curve is."""
    return "measured" if all(curve.kind == "measured" for curve in curves) else "synthetic"


def synthetic_curve(law, mode, window, *, points, noise, seed):
    """A `Curve` of `law` at `points` even stretches in `window`, with normal noise.

    noise: standard deviation as a share of the curve's largest stress, like a load cell's share of full scale
    seed: int or sequence of int for numpy's generator
    """
    stretch = np.linspace(*window, points)
    stress = law.nominal_stress(mode, stretch)
    error = noise * np.abs(stress).max() * np.random.default_rng(seed).standard_normal(points)
    values = ", ".join(f"{name} {value:g}" for name, value in law.parameters.items())
    making = f"{law.name} ({values}), incompressible, normal noise of {noise:.3g} of the largest stress, seed {seed}"
    return Curve(mode, stretch, stress + error, "synthetic", making)


def write_curve(path, curve):
    """Write a curve as CSV: `# key: value` lines with mode, kind and source, then stretch, nominal_stress_mpa."""
    lines = [f"# mode: {curve.mode}", f"# kind: {curve.kind}", f"# source: {curve.source}"]
    lines.append("stretch,nominal_stress_mpa")
    lines += [f"{x:.6g},{y:.6g}" for x, y in zip(curve.stretch, curve.nominal_stress, strict=True)]
    with atomic_path(path) as temporary:
        Path(temporary).write_text("\n".join(lines) + "\n", encoding="utf-8")
