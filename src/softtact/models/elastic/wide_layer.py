"""A bonded elastic layer that is infinite in plan: what its surface does under forces at the points of a regular grid.

The layer, h thick, is linear, isotropic, and fixed below. A wave of traction exp(i k.r) moves the surface by a wave; with x = |k| h
    D      = (3 - 4 nu) cosh 2x + 2 x^2 + 5 - 12 nu + 8 nu^2
    normal = (1 - nu) / (G k) [(3 - 4 nu) sinh 2x - 2x] / D           down, under pressure
    along  = (1 - nu) / (G k) [(3 - 4 nu) sinh 2x + 2x] / D           along k, under traction along k
    across = tanh x / (G k)                                           normal to k, under traction normal to k
    coupling = [x^2 - (1 - 2 nu) (3 - 4 nu) sinh^2 x] / (G k D)       u = -i coupling p along k, and down = i coupling q
With k -> 0 they become h / (confined modulus), h / G, h / G and 0; with h -> inf they are those of a half-space. At nu = 1/2 all
are finite. They solve Navier's equations with u = 0 below; the tests hold them to finite elements through the thickness.

Tractions are bilinear between the grid's points, so a point's force spreads by hat functions, whose transform sinc^2 sinc^2 leaves
no oscillations. Displacements are taken at the points, and waves beyond the grid's shortest are folded into its own. The operator
is symmetric and positive definite. Sums over the grid are zero-padded convolutions, so no images of the forces enter.
Directions here are x, y and down, as in `tangential`.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import fft

from softtact.sensors.fields import ElasticLayer

_NEAR, _FAR = 2, 16     # folds of waves of the layer, and on along an axis of a half-space: more change the peak by less than 1e-4
_TAIL = 8.0             # thicknesses from the farthest offset to the kernels' images, which are below 1e-5 of the peak there
_PARITY = {"nn": (0, 0), "xx": (0, 0), "yy": (0, 0), "xy": (1, 1), "xn": (0, 1), "yn": (1, 0)}     # odd in (y, x)
_ORDER = tuple(_PARITY)


def surface_spectrum(wave_number: np.ndarray, *, thickness_mm: float, shear_mpa: float,
                     poisson: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """normal, along, across, coupling of the module's text, in mm/MPa, at wave numbers (any shape) in 1/mm, 0 included.

    poisson: up to 1/2.
    """
    k, nu = np.asarray(wave_number, dtype=float), poisson
    x = np.where(k > 0, k * thickness_mm, 1.0)
    over = thickness_mm / (shear_mpa * x)
    e = np.exp(-2 * x)                                    # all terms times 2 exp(-2 x), so that none overflows
    double_sinh = -np.expm1(-4 * x)
    scale = (3 - 4 * nu) * (1 + e * e) + 2 * e * (2 * x * x + 5 - 12 * nu + 8 * nu * nu)
    normal = (1 - nu) * over * ((3 - 4 * nu) * double_sinh - 4 * x * e) / scale
    along = (1 - nu) * over * ((3 - 4 * nu) * double_sinh + 4 * x * e) / scale
    across = over * double_sinh / (1 + e) ** 2
    coupling = over * (2 * e * x * x - 0.5 * (1 - 2 * nu) * (3 - 4 * nu) * np.expm1(-2 * x) ** 2) / scale
    still = k == 0
    sheared = thickness_mm / shear_mpa
    return (np.where(still, sheared * (1 - 2 * nu) / (2 * (1 - nu)), normal), np.where(still, sheared, along),
            np.where(still, sheared, across), np.where(still, 0.0, coupling))


@dataclass(frozen=True)
class WideLayer:
    """A bonded layer under a grid of points: kernels of displacement under a force at one point."""

    step_mm: tuple[float, float]
    """Distances of points along x and y."""
    thickness_mm: float
    """Of the layer."""
    shear_mpa: float
    """Shear modulus G."""
    poisson: float
    """Poisson's ratio."""
    kernels: dict[str, np.ndarray]
    """mm/N at offsets (y, x) >= 0 in steps: `nn` down by a force down, `xx`, `yy`, `xy`, and `xn`, `yn`: aside by a force down."""
    _operators: "dict[Any, GridOperator]" = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def of(cls, layer: ElasticLayer, thickness_mm: float, step_mm: tuple[float, float], shape: tuple[int, int]) -> "WideLayer":
        """The layer under a grid of shape (ny, nx), from a sensor's constants."""
        shear = layer.young_mpa / (2 * (1 + layer.poisson))
        return cls.with_constants(thickness_mm, shear, layer.poisson, step_mm, shape)

    @classmethod
    def with_constants(cls, thickness_mm: float, shear_mpa: float, poisson: float, step_mm: tuple[float, float],
                       shape: tuple[int, int]) -> "WideLayer":
        """The layer under a grid of shape (ny, nx), from G in MPa and Poisson's ratio."""
        period = [2 * fft.next_fast_len(-(-int(max(2 * count, count + _TAIL * thickness_mm / step)) // 2))
                  for count, step in zip(shape, step_mm[::-1], strict=True)]
        spectra = _folded(period, step_mm, {"thickness_mm": thickness_mm, "shear_mpa": shear_mpa, "poisson": poisson})
        kernels = {name: _in_space(spectra[name], _PARITY[name], period)[:shape[0], :shape[1]].copy() / np.prod(step_mm)
                   for name in _ORDER}
        return cls(step_mm, thickness_mm, shear_mpa, poisson, kernels)

    @property
    def foundation_modulus(self) -> float:
        """Pressure per depth in N/mm3 under a contact about as wide as the layer is thick; finite at nu = 1/2."""
        middle = surface_spectrum(np.array(np.pi / (2 * self.thickness_mm)), thickness_mm=self.thickness_mm,
                                  shear_mpa=self.shear_mpa, poisson=self.poisson)[0]
        return 1.0 / float(middle)

    def operator(self, shape: tuple[int, int], *, single: bool = False) -> "GridOperator":
        """The operator among the points of a grid of shape (ny, nx); single: in single precision."""
        key = shape, single
        if key not in self._operators:
            self._operators[key] = GridOperator(self, shape, np.float32 if single else np.float64)
        return self._operators[key]


class GridOperator:
    """The surface's compliance among the points of a grid (ny, nx): displacements in mm of forces in N, x, y and down.

    padded: shape (ny, nx) of the transforms;  spectrum_of_down: of the normal kernel, (nx / 2 + 1, ny)
    diagonal: displacements in mm/N of a point under its force down, and aside;  rounding: of its results
    largest_aside: bound of its largest eigenvalue for forces aside over the diagonal, once a solver has asked for it
    """

    def __init__(self, layer: WideLayer, shape: tuple[int, int], dtype: type[np.floating]) -> None:
        self.shape, self.dtype, self.rounding = shape, dtype, 1e-13 if dtype == np.float64 else 1e-6
        self.padded = tuple(fft.next_fast_len(2 * count - 1, real=bool(axis)) for axis, count in enumerate(shape))
        self._spectra = {name: self._spectrum(layer.kernels[name], _PARITY[name]) for name in _ORDER}
        self.spectrum_of_down = self._spectra["nn"].astype(float)
        self.diagonal = float(layer.kernels["nn"][0, 0]), float(max(layer.kernels["xx"][0, 0], layer.kernels["yy"][0, 0]))
        self.largest_aside: float | None = None

    def _spectrum(self, kernel, odd):
        """Spectrum of a kernel wrapped on the padded grid; its real part where it is even in all, else the imaginary one."""
        wrapped = np.zeros(self.padded)
        (ny, nx), (sy, sx) = self.shape, [-1.0 if one else 1.0 for one in odd]
        part = kernel[:ny, :nx]
        wrapped[:ny, :nx] = part
        wrapped[-1:-ny:-1, :nx] = sy * part[1:]
        wrapped[:ny, -1:-nx:-1] = sx * part[:, 1:]
        wrapped[-1:-ny:-1, -1:-nx:-1] = sy * sx * part[1:, 1:]
        found = fft.rfft2(wrapped)
        return np.ascontiguousarray((found.imag if sum(odd) == 1 else found.real).T, dtype=self.dtype)

    def _to_waves(self, field):
        """Waves (m, kx, ky) of fields (m, ny, nx), with zeros beyond the grid."""
        (ny, nx), (py, px) = self.shape, self.padded
        rows = np.zeros((len(field), ny, px), self.dtype)
        rows[..., :nx] = field
        along = fft.rfft(rows, axis=-1)
        columns = np.zeros((len(field), along.shape[-1], py), along.dtype)
        columns[..., :ny] = np.swapaxes(along, 1, 2)
        return fft.fft(columns, axis=-1, overwrite_x=True)

    def _from_waves(self, waves):
        ny, nx = self.shape
        rows = fft.ifft(waves, axis=-1, overwrite_x=True)[..., :ny]
        return fft.irfft(np.swapaxes(rows, 1, 2), self.padded[1], axis=-1)[..., :nx]

    def down_of_down(self, force: np.ndarray) -> np.ndarray:
        """Displacement down (ny, nx) of forces down (ny, nx)."""
        waves = self._to_waves(force[None])
        waves *= self._spectra["nn"]
        return self._from_waves(waves)[0]

    def aside_of_down(self, force: np.ndarray) -> np.ndarray:
        """Displacement aside (2, ny, nx) of forces down (ny, nx)."""
        waves = 1j * self._to_waves(force[None])[0]
        return self._from_waves(np.stack([waves * self._spectra["xn"], waves * self._spectra["yn"]]))

    def down_of_aside(self, force: np.ndarray) -> np.ndarray:
        """Displacement down (ny, nx) of forces aside (2, ny, nx)."""
        x, y = self._to_waves(force)
        return self._from_waves((-1j * (x * self._spectra["xn"] + y * self._spectra["yn"]))[None])[0]

    def aside_of_aside(self, force: np.ndarray) -> np.ndarray:
        """Displacement aside (2, ny, nx) of forces aside (2, ny, nx)."""
        waves, s = self._to_waves(force), self._spectra
        x, y = waves
        across, y_of_x = y * s["xy"], x * s["xy"]
        x *= s["xx"]
        x += across
        y *= s["yy"]
        y += y_of_x
        return self._from_waves(waves)

    def __call__(self, force: np.ndarray) -> np.ndarray:
        """Displacement (3, ny, nx) of forces (3, ny, nx)."""
        x, y, down = self._to_waves(force)
        s, turned = self._spectra, 1j * down
        return self._from_waves(np.stack([x * s["xx"] + y * s["xy"] + turned * s["xn"],
                                          x * s["xy"] + y * s["yy"] + turned * s["yn"],
                                          down * s["nn"] - 1j * (x * s["xn"] + y * s["yn"])]))


def _folded(period, step_mm, constants):
    """{name: spectrum (y, x)} at the grid's waves kx, ky >= 0, with hats and all folded waves; odd ones without their i."""
    found = dict.fromkeys(_ORDER, 0.0)
    for fold in np.ndindex(2 * _NEAR + 1, 2 * _NEAR + 1):
        k, ex, ey, hats = _waves(period, step_mm, np.array(fold) - _NEAR)
        normal, along, across, coupling = surface_spectrum(k, **constants)
        parts = {"nn": normal, "xx": along * ex**2 + across * (1 - ex**2), "yy": along * ey**2 + across * (1 - ey**2),
                 "xy": (along - across) * ex * ey, "xn": -coupling * ex, "yn": -coupling * ey}
        found = {name: found[name] + hats * part for name, part in parts.items()}
    nu, of_half_space = constants["poisson"], _far_waves(tuple(period), step_mm)
    one, xx, yy, xy, x, y = of_half_space / constants["shear_mpa"]
    far = {"nn": (1 - nu) * one, "xx": one - nu * xx, "yy": one - nu * yy, "xy": -nu * xy,
           "xn": (0.5 - nu) * x, "yn": (0.5 - nu) * y}
    return {name: found[name] + far[name] for name in _ORDER}


def _waves(period, step_mm, fold):
    """Wave numbers k (y, x), their directions along x and y, and the hat functions' transform, of waves folded (y, x) times."""
    kx, ky = (2 * np.pi * (np.arange(count // 2 + 1) / count + fold[axis]) / step
              for axis, count, step in ((1, period[1], step_mm[0]), (0, period[0], step_mm[1])))
    hats = np.sinc(ky * step_mm[1] / (2 * np.pi))[:, None] ** 2 * np.sinc(kx * step_mm[0] / (2 * np.pi))[None, :] ** 2
    k = np.hypot(kx[None, :], ky[:, None])
    inverse = 1 / np.where(k > 0, k, 1.0)
    return k, kx[None, :] * inverse, ky[:, None] * inverse, hats


@lru_cache(maxsize=8)
def _far_waves(period, step_mm):
    """Sums over far folds of hats / k times 1, ex ex, ey ey, ex ey, ex, ey: short waves do not reach the layer's base.

    Across an axis the hats fall off by the fourth power, so folds along one axis with at most one along the other are enough.
    """
    total = 0.0
    for along in [*range(-_FAR, -_NEAR), *range(_NEAR + 1, _FAR + 1)]:
        for across in (-1, 0, 1):
            for fold in ((along, across), (across, along)):
                k, ex, ey, hats = _waves(period, step_mm, fold)
                each = hats / k
                total = total + np.stack([each, each * ex * ex, each * ey * ey, each * ex * ey, each * ex, each * ey])
    return total


def _in_space(quarter, odd, period):
    """The kernel at offsets (y, x) >= 0 of a spectrum at waves >= 0; odd: along y, x."""
    ny, nx = period
    signs = [-1.0 if one else 1.0 for one in odd]
    full = np.concatenate([quarter, signs[0] * quarter[-2:0:-1]])
    if odd[0]:
        full[ny // 2] = 0.0
    if odd[1]:
        full[:, nx // 2] = 0.0
    waves = full * (1j if sum(odd) == 1 else 1.0)
    return fft.irfft2(waves, s=(ny, nx))[:ny // 2 + 1, :nx // 2 + 1]
