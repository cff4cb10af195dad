"""Shading of a gel with a camera behind it: from the slope of the reflective surface to the colour of a pixel, and back.

    colour = background(x, y) + difference(slope_x, slope_y, x, y)          grey levels 0 ... 255, three channels

Slopes are d height / d x and d height / d y of the surface, without unit, in the image's axes: x to the right, y down. The height
points out of the gel, so it is below zero where the gel is pressed. A model sees slopes as the surface's tilt,
t = (slope_x, slope_y) / sqrt(1 + slope^2), the sine of its angle: the light of a matt surface changes linearly with it.

Three models have one interface: `QuadraticShading` (polynomials in tilt and place, the idea of Taxim, written anew), `SlopeTable`
(the same, and what a table over the tilt adds to it) and `PhongShading` (one light for each channel). They are fitted to presses of
a ball (`imaging/ball_presses.py`), or have assumed numbers.
References: Z. Si and W. Yuan, Taxim, IEEE RA-L 7 (2022) 2361; B. T. Phong, CACM 18 (1975) 311.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import yaml
from scipy.ndimage import gaussian_filter
from scipy.optimize import least_squares

from softtact.errors import InputError
from softtact.files import atomic_path, digest, read_yaml
from softtact.imaging.shadows import Lamps

CHANNELS = 3
SHIPPED = Path(str(resources.files("softtact.imaging"))) / "data"
_STEEPEST = 0.999      # quantile of the samples' tilts that counts as the largest fitted
_DIGITS = 6             # of the numbers in a file


@dataclass(frozen=True)
class ShadingSamples:
    """Pixels whose slope is known."""

    slope_x: np.ndarray
    """(sample,) d height / d x."""
    slope_y: np.ndarray
    """(sample,) d height / d y."""
    x_px: np.ndarray
    """(sample,) column."""
    y_px: np.ndarray
    """(sample,) row."""
    difference: np.ndarray
    """(sample, 3) colour minus background, grey levels."""

    @classmethod
    def joined(cls, parts: Sequence[ShadingSamples]) -> Self:
        """The samples of several presses."""
        names = ("slope_x", "slope_y", "x_px", "y_px", "difference")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class Shading(ABC):
    """A model of the colours; its kinds differ in `difference_at`."""

    kind: ClassVar[str]
    pixels: tuple[int, int]
    """Columns and rows of the images that it belongs to."""
    background_terms: np.ndarray
    """(term, 3) background as a polynomial in the place, for drawing without an image of the untouched gel."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """Where the numbers come from: fitted or assumed, to what, with which error."""
    lamps: Lamps | None = field(default=None, kw_only=True)
    """What throws shadows; None: no shadows."""

    def difference(self, slope_x: np.ndarray, slope_y: np.ndarray, x_px: np.ndarray, y_px: np.ndarray) -> np.ndarray:
        """Colour minus background (..., 3) in grey levels, not cut; all arguments are of one shape or broadcast."""
        return self.difference_at(slope_x, slope_y, self.at_places(x_px, y_px))

    @classmethod
    @abstractmethod
    def fit(cls, samples: ShadingSamples, pixels: tuple[int, int], background: np.ndarray, **options: Any) -> Self:
        """The model that fits some samples best.  background: (rows, columns, 3), the image of the untouched gel."""

    def colours(self, slope_x: np.ndarray, slope_y: np.ndarray, x_px: np.ndarray, y_px: np.ndarray,
                background: np.ndarray | None = None, dimming: np.ndarray | None = None) -> np.ndarray:
        """Colours (..., 3) as floats 0 ... 255 at places (...) of the image, where the surface has slopes (...).

        background: (..., 3) colours there without contact; by default the model's smooth background
        dimming: (..., 3) share that cast shadows take, see `softtact.imaging.shadows`; by default none
        """
        known = self.background(x_px, y_px) if background is None else background
        lit = np.clip(known + self.difference(slope_x, slope_y, x_px, y_px), 0.0, 255.0)
        return lit if dimming is None else lit * (1 - dimming)

    def on_grid(self, pixels: tuple[int, int], background: np.ndarray | None = None) -> ShadedGrid:
        """The model at all pixels of an image, prepared once for many frames.  background: as for `colours`"""
        model = self.scaled(pixels)
        y, x = np.mgrid[:pixels[1], :pixels[0]]
        known = model.background(x, y) if background is None else np.asarray(background)
        return ShadedGrid(model, np.asarray(model.at_places(x, y), dtype=np.float32), known.astype(np.float32))

    def at_places(self, x_px: np.ndarray, y_px: np.ndarray) -> np.ndarray:
        """What depends on the place alone, for `difference_at`: computed once for many slopes."""
        return np.zeros(np.shape(x_px))

    @abstractmethod
    def difference_at(self, slope_x: np.ndarray, slope_y: np.ndarray, prepared: np.ndarray) -> np.ndarray:
        """Colour minus background (..., 3) at the places that `at_places` prepared."""

    def background(self, x_px: np.ndarray, y_px: np.ndarray) -> np.ndarray:
        """Colours (..., 3) of the untouched gel, smooth."""
        degree = _degree_of(len(self.background_terms))
        x, y = self._place(x_px, y_px)
        return np.stack(_powers(x, y, degree), axis=-1) @ self.background_terms

    def scaled(self, pixels: tuple[int, int]) -> Self:
        """The same for images of another resolution; raises InputError if their sides have another ratio."""
        if abs(pixels[0] * self.pixels[1] - pixels[1] * self.pixels[0]) > 0.01 * pixels[1] * self.pixels[0]:
            raise InputError(f"the shading was calibrated on images of {self.pixels[0]} x {self.pixels[1]} px, the camera has "
                             f"{pixels[0]} x {pixels[1]} px, of another ratio; calibrate with images of this camera.")
        return replace(self, pixels=pixels)

    def _place(self, x_px, y_px):
        """Place in -1 ... 1 along the columns, in the same unit along the rows."""
        half = 0.5 * self.pixels[0]
        return ((np.asarray(x_px, dtype=float) - 0.5 * (self.pixels[0] - 1)) / half,
                (np.asarray(y_px, dtype=float) - 0.5 * (self.pixels[1] - 1)) / half)

    # --- files

    def values(self) -> dict[str, Any]:
        """The model as plain values, for a file."""
        own = {name: _rounded(getattr(self, name)) for name in _fields(type(self))}
        lamps = {} if self.lamps is None else {"lamps": {name: _rounded(value) for name, value in vars(self.lamps).items()}}
        return {"kind": self.kind} | own | lamps

    def save(self, path: str | Path) -> None:
        """Write the model as YAML with its provenance and a digest of its numbers."""
        values = self.values()
        content = values | {"digest": digest(values), "provenance": dict(self.provenance)}
        with atomic_path(path) as temporary:
            temporary.write_text(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=132), encoding="utf-8")

    @staticmethod
    def load(name: str | Path) -> Shading:
        """The model of a file, or one that ships with the package, by its name (`gelsight_mini`)."""
        path = Path(name)
        shipped = SHIPPED / f"{name}.yaml"
        path = shipped if not path.is_file() and shipped.is_file() else path
        known = ", ".join(sorted(one.stem for one in SHIPPED.glob("*.yaml")))
        values = read_yaml(path, missing=f"there is no such shading; give the path of a file, or one of: {known}.")
        return _from_values(values, path)


@dataclass(frozen=True)
class ShadedGrid:
    """A shading at all pixels of an image, in single precision."""

    shading: Shading
    """Of these pixels."""
    prepared: np.ndarray
    """(term, row, column, 3) what depends on the place alone."""
    background: np.ndarray
    """(row, column, 3) grey levels."""

    def colours(self, slope_x: np.ndarray, slope_y: np.ndarray) -> np.ndarray:
        """The image (row, column, 3) as uint8, of slopes (row, column)."""
        found = self.background + self.shading.difference_at(slope_x, slope_y, self.prepared)
        return np.clip(np.rint(found), 0, 255).astype(np.uint8)


def _from_values(values, path):
    """The model of a file's content; raises InputError with the field and the remedy."""
    if not isinstance(values, dict) or str(values.get("kind")) not in KINDS:
        raise InputError(f"{path}, field 'kind': it is none of {', '.join(KINDS)}; write it with `softtact calibrate-camera`.")
    provenance, stated = values.pop("provenance", {}), values.pop("digest", None)
    if stated is not None and stated != digest(values):
        raise InputError(f"{path}, field 'digest': the numbers are not those that were written; delete the field if you edited "
                         "them on purpose.")
    kind, lamps = KINDS[values.pop("kind")], values.pop("lamps", None)
    wanted = set(_fields(kind))
    if set(values) != wanted:
        raise InputError(f"{path}, field {sorted(set(values) ^ wanted)[0]!r}: a shading of kind {kind.kind} has the fields "
                         f"{', '.join(sorted(wanted))}; write the file anew.")
    try:
        arrays = {name: np.array(value, dtype=float) for name, value in values.items()}
        _check(arrays)
        arrays = {name: value if value.ndim else value.item() for name, value in arrays.items()}
        return kind(pixels=tuple(map(int, arrays.pop("pixels"))), provenance=provenance,
                    lamps=None if lamps is None else Lamps.of(lamps), **arrays)
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: a field holds no such numbers ({error}); write the file anew.") from None


def _check(arrays):
    """Raise ValueError for numbers {field: array} that are no model: of another shape, not finite, or outside their range."""
    for name, value in arrays.items():
        wanted = _SHAPES[name]
        if value.ndim != len(wanted) or any(size not in (None, found) for size, found in zip(wanted, value.shape, strict=True)):
            sides = " x ".join("n" if size is None else str(size) for size in wanted) or "a single one"
            raise ValueError(f"{name} has numbers of shape {value.shape} in place of {sides}")
        if not np.isfinite(value).all():
            raise ValueError(f"{name} holds {value[~np.isfinite(value)][0]:g}")
    terms = arrays.get("terms", np.zeros((2, 1)))
    for count in (len(arrays["background_terms"]), len(terms) + 1, terms.shape[1]):
        _degree_of(count)
    for name in ("pixels", "largest_tilt", "exponent"):
        if name in arrays and (arrays[name] <= 0).any():
            raise ValueError(f"{name} holds {arrays[name].min():g}, which is not above 0")
    if (arrays["pixels"] % 1).any():
        raise ValueError(f"pixels are {arrays['pixels'].tolist()}, not whole numbers")
    if "table" in arrays and not 2 <= len(arrays["table"]) == arrays["table"].shape[1] == len(arrays["counts"]):
        raise ValueError("table has not as many cells along y as along x, and as counts has")


def _fields(kind):
    return [one.name for one in fields(kind) if one.name not in ("provenance", "lamps")]


@dataclass(frozen=True)
class QuadraticShading(Shading):
    """Polynomials in the tilt, whose coefficients are polynomials in the place."""

    kind: ClassVar[str] = "quadratic"
    terms: np.ndarray = field(kw_only=True)
    """(tilt term, place term, 3); the tilt's terms start with the linear ones, so no tilt means no difference."""
    largest_tilt: float = field(default=1.0, kw_only=True)
    """Largest tilt that was fitted; a steeper surface has the colours of that tilt in its direction."""

    def at_places(self, x_px: np.ndarray, y_px: np.ndarray) -> np.ndarray:
        """Coefficients of the tilt's powers at some places, (tilt term, ..., 3)."""
        return np.stack([self._place_powers(x_px, y_px) @ term for term in self.terms])

    def difference_at(self, slope_x: np.ndarray, slope_y: np.ndarray, prepared: np.ndarray) -> np.ndarray:
        """See `Shading.difference_at`."""
        tilt_x, tilt_y = self._tilt(slope_x, slope_y, prepared.dtype)
        tilts = _powers(tilt_x, tilt_y, _degree_of(len(self.terms) + 1))[1:]
        total = tilts[0][..., None] * prepared[0]
        for tilt, coefficient in zip(tilts[1:], prepared[1:], strict=True):
            total = total + tilt[..., None] * coefficient
        return total

    def _place_powers(self, x_px, y_px):
        return np.stack(_powers(*self._place(x_px, y_px), _degree_of(self.terms.shape[1])), axis=-1)

    @classmethod
    def fit(cls, samples: ShadingSamples, pixels: tuple[int, int], background: np.ndarray, **options: Any) -> Self:
        """See `Shading.fit`.  options: tilt_degree (2), place_degree (1), ridge (1e-6): weight of small coefficients"""
        degree, place_degree = options.get("tilt_degree", 2), options.get("place_degree", 1)
        empty = np.zeros((_count(degree) - 1, _count(place_degree), CHANNELS))
        model = cls(pixels=pixels, background_terms=smooth_background(background), terms=empty)
        tilt_x, tilt_y = _tilt(samples.slope_x, samples.slope_y)
        tilt = np.stack(_powers(tilt_x, tilt_y, degree)[1:], axis=-1)
        place = model._place_powers(samples.x_px, samples.y_px)
        matrix = (tilt[:, :, None] * place[:, None, :]).reshape(len(tilt), -1)
        normal = matrix.T @ matrix
        normal += options.get("ridge", 1e-6) * np.trace(normal) / len(normal) * np.eye(len(normal))
        terms = np.linalg.solve(normal, matrix.T @ samples.difference).reshape(empty.shape)
        return replace(model, terms=terms, largest_tilt=float(np.quantile(np.hypot(tilt_x, tilt_y), _STEEPEST)))

    def _tilt(self, slope_x, slope_y, dtype):
        """Tilt along x and y, not beyond the largest."""
        slopes = np.broadcast_arrays(slope_x, slope_y)
        x, y = _tilt(*(one.astype(dtype, copy=False) for one in slopes))
        over = np.minimum(1.0, self.largest_tilt / np.maximum(np.hypot(x, y), 1e-9)).astype(dtype)
        return x * over, y * over


@dataclass(frozen=True)
class SlopeTable(QuadraticShading):
    """A polynomial, and a table over the tilt of what it leaves; an empty cell adds nothing."""

    kind: ClassVar[str] = "table"
    table: np.ndarray = field(kw_only=True)
    """(cell along y, cell along x, 3) grey levels over tilts from -1 to 1, linear between the cells' centres."""
    counts: np.ndarray = field(kw_only=True)
    """(cell along y, cell along x) samples in a cell."""

    def difference_at(self, slope_x: np.ndarray, slope_y: np.ndarray, prepared: np.ndarray) -> np.ndarray:
        """See `Shading.difference_at`."""
        added = _between(self.table.astype(prepared.dtype), *self._tilt(slope_x, slope_y, prepared.dtype))
        return super().difference_at(slope_x, slope_y, prepared) + added

    @classmethod
    def fit(cls, samples: ShadingSamples, pixels: tuple[int, int], background: np.ndarray, **options: Any) -> Self:
        """See `Shading.fit`.  options: the quadratic one's, cells (41, odd), smooth (0.8 cells), prior (20 samples)"""
        poly = QuadraticShading.fit(samples, pixels, background, **options)
        size = options.get("cells", 41)
        left = samples.difference - poly.difference(samples.slope_x, samples.slope_y, samples.x_px, samples.y_px)
        column, row = (np.rint(0.5 * (t + 1) * (size - 1)).astype(int) for t in _tilt(samples.slope_x, samples.slope_y))
        counts, sums = np.zeros((size, size)), np.zeros((size, size, CHANNELS))
        np.add.at(counts, (row, column), 1)
        np.add.at(sums, (row, column), left)
        width = options.get("smooth", 0.8)
        weight = gaussian_filter(counts, width, mode="constant")[..., None] + options.get("prior", 20)
        table = gaussian_filter(sums, (width, width, 0), mode="constant") / weight
        table[size // 2, size // 2] = 0      # no tilt, no difference
        return cls(pixels=poly.pixels, background_terms=poly.background_terms, terms=poly.terms, largest_tilt=poly.largest_tilt,
                   table=table, counts=counts)


@dataclass(frozen=True)
class PhongShading(Shading):
    """Phong's model with one distant light for each channel: matt part linear in the normal, gloss as a power."""

    kind: ClassVar[str] = "phong"
    azimuth_rad: np.ndarray = field(kw_only=True)
    """(3,) of the light, from the image's x axis towards its y axis."""
    elevation_rad: np.ndarray = field(kw_only=True)
    """(3,) of the light above the gel's plane, on the camera's side."""
    diffuse: np.ndarray = field(kw_only=True)
    """(3,) grey levels of a matt surface that faces the light."""
    specular: np.ndarray = field(kw_only=True)
    """(3,) grey levels of the gloss seen from straight above."""
    exponent: np.ndarray = field(kw_only=True)
    """(3,) of the gloss."""

    def difference_at(self, slope_x: np.ndarray, slope_y: np.ndarray, prepared: np.ndarray) -> np.ndarray:
        """See `Shading.difference_at`."""
        tilt_x, tilt_y = _tilt(*np.broadcast_arrays(slope_x, slope_y))
        lit = self._light(tilt_x, tilt_y) - self._light(np.zeros(()), np.zeros(()))
        return np.broadcast_to(lit, (*np.broadcast_shapes(np.shape(tilt_x), np.shape(prepared)), CHANNELS))

    def _light(self, tilt_x, tilt_y):
        """Grey levels (..., 3) of ambient-free light."""
        light_x, light_y = (part(self.azimuth_rad) * np.cos(self.elevation_rad) for part in (np.cos, np.sin))
        light_z = np.sin(self.elevation_rad)
        x, y = tilt_x[..., None], tilt_y[..., None]
        z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
        facing = np.maximum(x * light_x + y * light_y + z * light_z, 0)      # the camera sees the inner side: its normal is (t, z)
        mirrored = np.maximum(2 * facing * z - light_z, 1e-9)
        return self.diffuse * facing + self.specular * mirrored**self.exponent

    @classmethod
    def fit(cls, samples: ShadingSamples, pixels: tuple[int, int], background: np.ndarray, **options: Any) -> Self:
        """See `Shading.fit`.  options: most (20000): samples used, evenly chosen"""
        step = max(1, len(samples.slope_x) // options.get("most", 20000))
        thin = ShadingSamples(*(getattr(samples, name)[::step] for name in ShadingSamples.__dataclass_fields__))
        tilt = np.column_stack(_tilt(thin.slope_x, thin.slope_y))
        found = np.column_stack([_fit_light(tilt, thin.difference[:, channel]) for channel in range(CHANNELS)])
        return cls(pixels, smooth_background(background), {}, **dict(zip(_LIGHT, found, strict=True)))


_LIGHT = ("azimuth_rad", "elevation_rad", "diffuse", "specular", "exponent")
_SHAPES: dict[str, tuple[int | None, ...]] = {      # of the fields, None: any number
    "pixels": (2,), "background_terms": (None, CHANNELS), "terms": (None, None, CHANNELS), "largest_tilt": (),
    "table": (None, None, CHANNELS), "counts": (None, None), **dict.fromkeys(_LIGHT, (CHANNELS,))}
KINDS = {one.kind: one for one in (QuadraticShading, SlopeTable, PhongShading)}


def _fit_light(tilt, difference):
    """Azimuth, elevation, diffuse, specular, exponent of one channel's light; starts where a plane of grey levels points."""
    plane = np.linalg.lstsq(tilt, difference, rcond=None)[0]
    azimuth = np.arctan2(plane[1], plane[0])

    def residual(p):
        one = PhongShading((1, 1), np.zeros((1, 1)), {}, **{name: np.array([value]) for name, value in zip(_LIGHT, p, strict=True)})
        return (one._light(tilt[:, 0], tilt[:, 1]) - one._light(np.zeros(1), np.zeros(1)))[:, 0] - difference

    size = max(float(np.hypot(*plane)), 1.0)
    starts = [(azimuth, elevation, size / np.cos(elevation), 0.2 * size, 5.0) for elevation in (0.3, 0.9)]
    lower, upper = (azimuth - np.pi, 0.0, 0.0, 0.0, 1.0), (azimuth + np.pi, 1.5, 1e3, 1e3, 100.0)
    fits = [least_squares(residual, np.clip(start, lower, upper), bounds=(lower, upper)) for start in starts]
    return min(fits, key=lambda fit: fit.cost).x


def slopes_of_colours(shading: Shading, colours: np.ndarray, x_px: np.ndarray, y_px: np.ndarray, background: np.ndarray, *,
                      steepest: float = 2.0, first: int = 17, rounds: int = 5) -> np.ndarray:
    """Slopes (pixel, 2) whose colours are closest to those of some pixels (pixel, 3): photometric stereo, pixel by pixel.

    Two slopes can have one colour, above all where a light does not reach; `steepest` excludes the larger one where it is known.
    Searched on a grid of `first` x `first` tilts up to that of the slope `steepest`, then `rounds` times on a finer grid of 5 x 5
    around the best.
    """
    reach = steepest / np.hypot(1, steepest)
    wanted = np.asarray(colours, dtype=float) - background
    best, width, places = np.zeros((len(wanted), 2)), reach, shading.at_places(x_px, y_px)
    for count in [first] + [5] * rounds:
        steps = np.linspace(-width, width, count)
        tried = best[None] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2)
        error, kept = np.full(len(wanted), np.inf), best.copy()
        for tilt in tried:
            size = np.hypot(*tilt.T)
            slope = tilt / np.sqrt(1 - np.minimum(size, 0.99)**2)[:, None]
            off = np.sum((shading.difference_at(slope[:, 0], slope[:, 1], places) - wanted)**2, axis=1)
            better = (off < error) & (size <= reach * 1.0001)
            error[better], kept[better] = off[better], tilt[better]
        best, width = kept, steps[1] - steps[0]
    return best / np.sqrt(1 - np.sum(best**2, axis=1))[:, None]


def normal_error_deg(slopes: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angle (pixel,) in degrees between the normals of two slopes (pixel, 2)."""
    one, other = (np.column_stack([-np.asarray(s), np.ones(len(s))]) for s in (slopes, true))
    cosine = np.sum(one * other, axis=1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def smooth_background(image: np.ndarray, *, degree: int = 4) -> np.ndarray:
    """Coefficients (term, 3) of the background's polynomial, fitted to an image (rows, columns, 3)."""
    rows, columns = image.shape[:2]
    step = max(1, columns // 80)
    y, x = (axis.ravel() for axis in np.mgrid[0:rows:step, 0:columns:step])
    half = 0.5 * columns
    matrix = np.stack(_powers((x - 0.5 * (columns - 1)) / half, (y - 0.5 * (rows - 1)) / half, degree), axis=-1)
    return np.linalg.lstsq(matrix, np.asarray(image, dtype=float)[y, x], rcond=None)[0]


def _tilt(slope_x, slope_y):
    """Sine of the surface's angle along x and y."""
    over = 1 / np.sqrt(1 + np.square(slope_x) + np.square(slope_y))
    return slope_x * over, slope_y * over


def _powers(x, y, degree):
    """1, x, y, x^2, x y, y^2, ... up to a degree, as a list of arrays; each from one before it, by one multiplication."""
    found = [np.ones_like(x)]
    for total in range(1, degree + 1):
        before = found[-total:]
        found += [one * x for one in before] + [before[-1] * y]
    return found


def _count(degree):
    """How many terms a polynomial in two variables has."""
    return (degree + 1) * (degree + 2) // 2


def _degree_of(count):
    degree = int(round((np.sqrt(8 * count + 1) - 3) / 2))
    if _count(degree) != count:
        raise ValueError(f"{count} coefficients are those of no polynomial in two variables")
    return degree


def _between(table, x, y):
    """Values (..., 3) of a table over -1 ... 1, bilinear."""
    size = len(table) - 1
    column, row = (np.clip(0.5 * (t + 1) * size, 0, size - 1e-9) for t in (x, y))
    left, top = column.astype(int), row.astype(int)
    right, below = (column - left)[..., None], (row - top)[..., None]
    upper = table[top, left] * (1 - right) + table[top, left + 1] * right
    lower = table[top + 1, left] * (1 - right) + table[top + 1, left + 1] * right
    return upper * (1 - below) + lower * below


def _rounded(value):
    """Plain lists of numbers for a file, with few digits; whole numbers stay whole."""
    if np.ndim(value):
        return [_rounded(one) for one in value]
    return int(value) if float(value).is_integer() else float(f"{value:.{_DIGITS}g}")
