"""Loads on a skin: pressure on a disc, an ellipse or a mask, as forces on many points whose sum is exact."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softtact.errors import FrameWarning, InputError
from softtact.inputs import check_input, check_limit, in_one_sentence
from softtact.skin.layout import Layout

RATIO = 1.5  # of a fingertip's axes, the longer one along y: the authors' published toolbox
_RADII, _ANGLES = 24, 96  # points of a disc


@dataclass(frozen=True)
class Load:
    """Forces on points of the upper side, straight down."""

    points_mm: np.ndarray
    """(point, 2)"""
    force_n: np.ndarray
    """(point,): downwards, above 0."""
    pressure_mpa: float
    """At which the elastomer's modulus is taken."""
    words: str
    """Description for messages and tables."""
    displacement_mm: np.ndarray | None = None
    """(node, 3) of the layer under the load, where it was solved with it, at finite strains."""
    indentation_mm: float = np.nan
    """Of an object below first touch; nan of a pressure."""
    beyond_tests: float = np.nan
    """Share of the volume that is strained beyond the elastomer's tests, at finite strains."""

    @property
    def total_n(self) -> float:
        """The whole force."""
        return float(self.force_n.sum())


def ellipse(centre_mm: tuple[float, float], *, area_mm2: float, pressure_mpa: float, ratio: float = RATIO,
            angle_deg: float = 0.0) -> Load:
    """Uniform pressure on an ellipse.

    ratio: of its axis along y to that along x, before it is turned by angle_deg, counter-clockwise; 1 for a disc
    """
    half = np.sqrt(area_mm2 / (np.pi * ratio)) * np.array([1.0, ratio])
    share, weight = np.polynomial.legendre.leggauss(_RADII)
    radius, weight = np.sqrt(0.5 * (share + 1)), 0.5 * weight  # Gauss points in the squared radius, for equal areas
    angle = 2 * np.pi * (np.arange(_ANGLES) + 0.5) / _ANGLES
    x, y = (radius[:, None] * half[0] * np.cos(angle)).ravel(), (radius[:, None] * half[1] * np.sin(angle)).ravel()
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    points = np.column_stack([cos * x - sin * y, sin * x + cos * y]) + centre_mm
    force = pressure_mpa * area_mm2 * np.repeat(weight / _ANGLES, _ANGLES)
    shape = f"disc of {2 * half[0]:.3g} mm" if ratio == 1 else f"ellipse of {area_mm2:.4g} mm2"
    return Load(points, force, pressure_mpa, f"{1e3 * pressure_mpa:g} kPa on a {shape} at ({centre_mm[0]:g}, {centre_mm[1]:g}) mm")


def disc(centre_mm: tuple[float, float], *, diameter_mm: float, pressure_mpa: float) -> Load:
    """Uniform pressure on a disc, as under the papers' cylindrical probes."""
    return ellipse(centre_mm, area_mm2=np.pi * diameter_mm**2 / 4, pressure_mpa=pressure_mpa, ratio=1.0)


def mask(path: str | Path, centre_mm: tuple[float, float], *, pixel_mm: float, pressure_mpa: float) -> Load:
    """Uniform pressure where a picture is dark, as a fingerprint in ink on white paper; what is transparent does not press.

    The mean of the dark pixels lies at centre_mm; rows of the picture run downwards, y upwards.
    Raises InputError where the file is no picture, or has no dark pixel.
    """
    from PIL import Image

    check_input(path, "picture", missing="there is no such picture; correct the load's `mask`.")
    with in_one_sentence(path, "not a readable picture", "save the mask as PNG"), Image.open(path) as picture:
        check_limit(path, "pixels", picture.width * picture.height)
        grey, partly = _on_white(picture)
    dark = grey < 128
    row, column = np.nonzero(dark)
    if not dark.all() and np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]]).all():
        warnings.warn(f"{path}: its whole edge is dark and presses; if the print is white on black, invert the picture.",
                      FrameWarning, stacklevel=2)
    if not len(row):
        light = "no pixel that is seen is dark, and what is transparent does not press" if partly else "no pixel is dark"
        raise InputError(f"{path}: {light}, so that nothing presses; draw the contact area in black on white.")
    points = pixel_mm * np.column_stack([column, -row])
    area = len(row) * pixel_mm**2
    return Load(
        points - points.mean(axis=0) + centre_mm,
        np.full(len(row), pressure_mpa * pixel_mm**2),
        pressure_mpa,
        f"{1e3 * pressure_mpa:g} kPa on the mask {Path(path).name} ({area:.4g} mm2{', without what is transparent' * partly}) at "
        f"({centre_mm[0]:g}, {centre_mm[1]:g}) mm",
    )


def _on_white(picture):
    """Grey values (row, column), 0 to 255, of a picture on white paper, and whether a part of it is transparent.

    White is 255, or the lightest pixel of a picture of more than 8 bits.
    """
    from PIL import Image

    if picture.mode.startswith(("I", "F")):     # 12, 16 or 32 bits a pixel, or 0 to 1: Pillow would cut them off at 255
        values = np.asarray(picture, dtype=float)
        return 255 * values / values.max() if values.max() > 0 else 0 * values, False
    if not picture.has_transparency_data:
        return np.asarray(picture.convert("L")), False
    coloured = picture.convert("RGBA")
    paper = Image.new("RGBA", picture.size, "white")
    return np.asarray(Image.alpha_composite(paper, coloured).convert("L")), coloured.getextrema()[3][0] < 255


def refuse_beside(load: Load, layout: Layout, *, where: str) -> None:
    """Refuse a load of which a part lies beside the elastomer."""
    beside = ~layout.inside(load.points_mm)
    if beside.any():
        share = load.force_n[beside].sum() / load.total_n
        raise InputError(f"{where}: {share:.0%} of the load ({load.words}) lies beside the elastomer; move it inwards or make it "
                         "smaller.")
