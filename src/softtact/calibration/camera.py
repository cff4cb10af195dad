"""Calibration of a gel's camera from presses of a ball: where the contacts are, the size of a pixel, the shading.

A ball's image minus that of the untouched gel is nearly odd about the contact's middle: opposite sides of the ball tilt in opposite
directions, and colours change nearly in proportion to the tilt. So the middle x0 is where the autoconvolution

    A(x0) = sum over r of  c(x0 + r) . c(x0 - r),        c: the image's difference, three channels,

is least. The tilt grows to the contact's edge and falls beyond it: the circle's radius is where the mean size of the difference is
largest. Both are then refined with the fitted shading (`imaging.ball_presses`), whose edge is that of the elastic layer.
The scale, if it is not stated, is the one with which all presses, of different depths, agree best with one shading.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.signal import fftconvolve

from softtact.errors import InputError
from softtact.imaging.ball_presses import BallPress, Gel, joined_samples, refined_circle
from softtact.imaging.ball_shadows import AROUND, with_lamps
from softtact.imaging.markers import read_image
from softtact.imaging.reading import image_files
from softtact.imaging.shading import KINDS, QuadraticShading, Shading
from softtact.tables import read_table

_SMOOTH = 0.007           # of the image's longer side: width of the bell that removes noise
_LEAST_LEVELS = 8.0       # grey levels of the smoothed difference that a contact has at least
_OVER_USUAL = 2.5         # the same over the difference's median
_LEAST_ODD = 0.4          # share of the difference that is odd about its middle; 0.69 to 0.81 on 28 presses of a real gel
_SECTORS = 8              # of half a turn
_ROUND = 0.05             # scatter of the difference's reach over the sectors: 0.024 at most on these, 0.052 for an ellipse 1.2 : 1
_NEAR, _ALONE = 2.5, 0.85   # radii from the middle, and share of the squared difference within; 0.91 at least on these
_ROUNDS = 2               # of fitting the shading and refining the circles
_SIZES, _FINER = 14, 9    # sizes of the ball tried, from a little more than the largest contact on
_OUTSIDE = 1.5            # contact radii up to which the search for the ball's size looks
_COARSE = 160             # pixels of the longer side in the search for the middle
_EVERY = 4                # pixels from one to the next that searches look at
_FEWEST = 3               # presses
_SPREAD = 0.5             # of the image that contacts must spread over for colours that differ from place to place
_MANY = 12                # presses that determine how colours differ from place to place
_CLEAN = 5                # images from which a background can be made by their median


@dataclass(frozen=True)
class CameraCalibration:
    """A camera's shading with its errors."""

    presses: list[BallPress]
    """The presses with their circles."""
    found: bool
    """Whether the circles were found in the images, not stated."""
    shading: Shading
    """Fitted to all presses, with lamps where their shadows are seen around the contacts."""
    background: np.ndarray
    """(rows, columns, 3) uint8, the untouched gel."""
    ball_px: float
    """Radius of the ball in px."""
    mm_per_px: float
    """Side of a pixel on the gel in mm."""
    scale_found: bool
    """Whether mm_per_px was found from the presses, not stated."""
    error_levels: float
    """Mean absolute error in the contacts in grey levels, of presses that a shading was not fitted to."""


def read_presses(images: Sequence[Path], background: Path | None, circles: Path | None) -> tuple[list[BallPress], np.ndarray]:
    """The `BallPress` of each image, and the background (rows, columns, 3).

    images: files, or folders of them;  background: of the untouched gel, by default the median of five images or more
    circles: CSV with the columns image, centre_x_px, centre_y_px, radius_px; by default found
    Raises InputError for images of different size, too few, without a contact, and of what is no round ball.
    """
    files = [file for path in images for file in image_files(path) if background is None or file.resolve() != background.resolve()]
    if len(files) < _FEWEST:
        raise InputError(f"{len(files)} images are too few to fit a shading; give {_FEWEST} presses or more, in different places.")
    pictures = {file: read_image(file) for file in files}
    if background is None and len(files) < _CLEAN:
        raise InputError(f"--background is missing: {len(files)} images are too few to make one of; give an image of the untouched "
                         f"gel, or {_CLEAN} presses in different places.")
    clean = read_image(background) if background else np.median(np.stack(_of_one_size(pictures)), axis=0).astype(np.uint8)
    for file, picture in pictures.items():
        if picture.shape != clean.shape:
            other = background or "the others"
            raise InputError(f"{file}: it has {picture.shape[1]} x {picture.shape[0]} px, and {other} {clean.shape[1]} x "
                             f"{clean.shape[0]} px; take all images with one camera.")
    known = {} if circles is None else _read_circles(circles, files)
    return [_press(file, picture, clean, known.get(file.name)) for file, picture in pictures.items()], clean


def _of_one_size(pictures):
    """The pictures, whose first odd one out is refused."""
    shapes = [picture.shape for picture in pictures.values()]
    usual = max(set(shapes), key=shapes.count)
    for file, picture in pictures.items():
        if picture.shape != usual:
            raise InputError(f"{file}: it has {picture.shape[1]} x {picture.shape[0]} px, and the others {usual[1]} x "
                             f"{usual[0]} px; take all images with one camera.")
    return list(pictures.values())


def _read_circles(path, files):
    """{name of an image: (x, y, radius)} of a table."""
    table = read_table(path, what="table of circles")
    values = np.column_stack(table.numbers(("centre_x_px", "centre_y_px", "radius_px")))
    places = table.positions("image")
    if len(places) != 1:
        raise InputError(f"{path}: it has no single column named 'image' among {', '.join(table.header)}; name one so.")
    names = [str(cells[places[0]]) for _, cells in table.rows]
    for given, of in ((names, path), ([file.name for file in files], "--circles")):
        if twice := [name for name in given if given.count(name) > 1]:
            raise InputError(f"{of}: {twice[0]} stands twice, so it is not known whose circle one is; give each image a name "
                             "of its own.")
    missing = [file.name for file in files if file.name not in names]
    if missing:
        raise InputError(f"{path}: it has no row for {missing[0]}; give the circle of each image, or leave --circles out.")
    return dict(zip(names, values, strict=True))


def _press(file, picture, clean, circle):
    if circle is None:
        x, y, radius = find_contact(picture, clean, name=str(file))
    else:
        x, y, radius = map(float, circle)
    drift = np.median(picture.astype(float) - clean, axis=(0, 1))      # of the light, from image to image
    return BallPress(picture, clean + drift, (x, y), radius, str(file))


def find_contact(image: np.ndarray, background: np.ndarray, *, name: str = "the image") -> tuple[float, float, float]:
    """Column, row and radius in px of the contact of a ball, from its image and that of the untouched gel (rows, columns, 3).

    Within 10 px (middle) and 7 px (radius) of circles by hand on 28 presses of 41 px on a real gel, before any refinement. Raises
    InputError where the image shows no contact, or none of a round ball.
    """
    change = image.astype(float) - background
    change -= np.median(change, axis=(0, 1))
    width = _SMOOTH * max(change.shape[:2])
    change = ndimage.gaussian_filter(change, (width, width, 0))
    size = np.sqrt((change**2).sum(axis=2))
    if size.max() < max(_LEAST_LEVELS, _OVER_USUAL * float(np.median(size))):
        raise InputError(f"{name}: it shows no contact: it differs from the untouched gel by {size.max():.1f} grey levels at most, "
                         f"by {np.median(size):.1f} usually; leave the image out, or press harder.")
    thin = max(1, max(size.shape) // _COARSE)
    x, y, odd = _odd_middle(change[::thin, ::thin])
    x, y = thin * x, thin * y
    rows, columns = np.mgrid[:size.shape[0], :size.shape[1]]
    distance = np.hypot(columns - x, rows - y)
    rings = np.minimum(distance.astype(int), int(distance.max()) - 1)
    radius = float(np.argmax(ndimage.mean(size, rings, np.arange(rings.max() + 1)))) + 0.5
    alone = (size[distance < _NEAR * radius]**2).sum() / (size**2).sum()
    if odd < _LEAST_ODD or alone < _ALONE or _unevenness(size, columns - x, rows - y, radius) > _ROUND:
        raise InputError(f"{name}: its contact is not that of a round ball; press with a ball, one contact in each image, or leave "
                         "the image out.")
    return float(x), float(y), radius


def _odd_middle(change, allowed=None):
    """Column, row of the point about which a difference is most odd, in halves, and the share of it that is.

    allowed: where the point may lie, for each half column and row
    """
    folded = sum(fftconvolve(change[..., k], change[..., k]) for k in range(3))
    row, column = np.unravel_index(int(np.argmin(folded if allowed is None else np.where(allowed, folded, np.inf))), folded.shape)
    return 0.5 * column, 0.5 * row, -float(folded[row, column]) / float((change**2).sum())


def odd_middle(change: np.ndarray, *, near_px: tuple[float, float], within_px: float) -> tuple[float, float]:
    """Column and row of the point about which a difference (rows, columns, 3) from the untouched gel is most odd: a ball's middle.

    near_px, within_px: the point lies within so many px of a place, and pixels up to three times as far take part
    """
    first = [max(0, int(place - 3 * within_px)) for place in near_px]
    last = [int(place + 3 * within_px) + 1 for place in near_px]
    part = change[first[1]:last[1], first[0]:last[0]].astype(float)
    part = ndimage.gaussian_filter(part - np.median(part, axis=(0, 1)), (1, 1, 0))
    half_y, half_x = np.mgrid[:2 * part.shape[0] - 1, :2 * part.shape[1] - 1]
    allowed = np.hypot(0.5 * half_x + first[0] - near_px[0], 0.5 * half_y + first[1] - near_px[1]) <= within_px
    x, y, _ = _odd_middle(part, allowed)
    return first[0] + x, first[1] + y


def _unevenness(size, x, y, radius):
    """Scatter over sectors of how far the difference reaches from the middle, as a share of the mean."""
    distance, sector = np.hypot(x, y), (np.arctan2(y, x) % np.pi * _SECTORS / np.pi).astype(int) % _SECTORS
    weight = np.where(distance < 1.6 * radius, size**2, 0.0)
    reach = ndimage.sum(weight * distance, sector, np.arange(_SECTORS)) / ndimage.sum(weight, sector, np.arange(_SECTORS))
    return float(reach.std() / reach.mean())


def calibrate_camera(presses: Sequence[BallPress], background: np.ndarray, *, ball_mm: float, mm_per_px: float | None = None,
                     thickness_mm: float, poisson: float = 0.49, kind: str = "table", found: bool = True) -> CameraCalibration:
    """Fit a shading to presses of a ball of a diameter in mm; find mm_per_px where it is not stated.

    kind: of the shading: table, quadratic or phong;  found: whether the circles are to be refined
    Raises InputError where a contact is as large as the ball, which a wrong size or scale makes.
    """
    options: dict[str, Any] = {"ball_mm": ball_mm, "thickness_mm": thickness_mm, "poisson": poisson}
    scale_found, moved = mm_per_px is None, list(presses)
    for number in range(_ROUNDS if found else 1):
        scale = find_scale(moved, **options) if mm_per_px is None else mm_per_px
        gel = _gel(scale, **options)
        _refuse_large(moved, gel, scale)
        if found:
            rough = _fit("quadratic", moved, gel, background)
            most = 0.3 if number == 0 else 0.1
            moved = [refined_circle(press, gel, rough, step=_EVERY, most_px=most * press.radius_px) for press in moved]
    if mm_per_px is None:
        scale = find_scale(moved, **options)
        gel = _gel(scale, **options)
    shading = _fit(kind, moved, gel, background)
    shading = replace(shading, lamps=with_lamps(shading, moved, gel, reach=[AROUND] * len(moved)))
    error = _error_on_others(kind, moved, gel, background)
    facts = {"made_by": "softtact calibrate-camera", "presses": len(moved), "ball_mm": ball_mm, "mm_per_px": round(scale, 6),
             "thickness_mm": thickness_mm, "error_levels": round(error, 3)}
    return CameraCalibration(moved, found, replace(shading, provenance=facts), background, gel.ball_px, scale, scale_found, error)


def find_scale(presses: Sequence[BallPress], *, ball_mm: float, thickness_mm: float, poisson: float) -> float:
    """Side of a pixel in mm with which presses of different depths, and what surrounds their contacts, fit one shading best."""
    largest = max(press.radius_px for press in presses)
    sizes = largest * np.geomspace(1.03, 5.0, _SIZES)

    def misfit(ball_px):
        gel = _gel(0.5 * ball_mm / ball_px, ball_mm=ball_mm, thickness_mm=thickness_mm, poisson=poisson)
        samples = joined_samples(presses, gel, reach=_OUTSIDE, step=_EVERY)
        shading = QuadraticShading.fit(samples, _pixels(presses), presses[0].background)
        drawn = shading.difference(samples.slope_x, samples.slope_y, samples.x_px, samples.y_px)
        return float(np.sqrt(np.mean((drawn - samples.difference)**2)))

    errors = np.array([misfit(size) for size in sizes])
    best = int(np.clip(errors.argmin(), 1, _SIZES - 2))
    fine = np.geomspace(sizes[best - 1], sizes[best + 1], _FINER)
    return 0.5 * ball_mm / float(fine[np.argmin([misfit(size) for size in fine])])


def covered_share(presses: Sequence[BallPress]) -> float:
    """Share of the image's side, the smaller one of both, that the contacts spread over."""
    circles = np.array([[*press.centre_px, press.radius_px] for press in presses])
    spread = np.ptp(circles[:, :2], axis=0) + 2 * circles[:, 2].mean()
    return float((spread / _pixels(presses)).min())


def _gel(mm_per_px, *, ball_mm, thickness_mm, poisson):
    return Gel(0.5 * ball_mm / mm_per_px, thickness_mm / mm_per_px, poisson)


def _pixels(presses):
    rows, columns = presses[0].image.shape[:2]
    return columns, rows


def _refuse_large(presses, gel, scale):
    for press in presses:
        if press.radius_px >= gel.ball_px:
            raise InputError(f"{press.name}: its contact has a radius of {press.radius_px * scale:.3g} mm at {scale:.4g} mm/px, "
                             f"and the ball one of {gel.ball_px * scale:.3g} mm; correct --ball-mm, --mm-per-px or the circle.")


def _fit(kind, presses, gel, background):
    """A shading; of polynomials of a higher degree where many presses determine them, alike everywhere where these lie close by."""
    many = len(presses) >= _MANY
    place_degree = 0 if covered_share(presses) < _SPREAD else 2 if many else 1
    options = {"tilt_degree": 4 if many else 2, "place_degree": place_degree}
    return KINDS[kind].fit(joined_samples(presses, gel, reach=1.2, step=2), _pixels(presses), background, **options)


def _error_on_others(kind, presses, gel, background):
    """Mean absolute error in the contacts, each third of the presses by a shading of the others."""
    errors = []
    for third in range(3):
        others = [press for number, press in enumerate(presses) if number % 3 != third]
        shading, samples = _fit(kind, others, gel, background), joined_samples(presses[third::3], gel)
        drawn = shading.difference(samples.slope_x, samples.slope_y, samples.x_px, samples.y_px)
        errors.append(np.abs(drawn - samples.difference).mean())
    return float(np.mean(errors))
