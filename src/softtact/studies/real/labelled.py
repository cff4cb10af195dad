"""Labelled presses of a set: splits, circles found again, colours by each model, and their scores in the contact."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from softtact.evaluation.image_scores import image_scores
from softtact.files import read_arrays
from softtact.imaging.ball_presses import BallPress, Gel, ball_slopes, refined_circle
from softtact.imaging.ball_shadows import AROUND, press_dimming, with_lamps
from softtact.imaging.shading import (
    PhongShading,
    QuadraticShading,
    Shading,
    ShadingSamples,
    SlopeTable,
    normal_error_deg,
    slopes_of_colours,
)

REACH = 1.5             # contact radii: how far from the centre pixels are fitted
WHEEL = "the wheel's table"
SMALL = "quadratic in tilt"
SHADOWS = "table with shadows"
AROUND_SCORED = 3.0     # labelled radii: the end of the ring around the circle that is scored
_PIXELS = 40_000        # samples of a fit, about
_LARGEST = 0.985        # of a contact's radius over the ball's
_BINS = 125             # of the wheel's table, along each axis
_NORMALS = 250          # pixels of a press whose normal is recovered, about


@dataclass(frozen=True)
class LabelledSet:
    """The presses of a set."""

    presses: list[BallPress]
    """With the circles of their labels."""
    gel: Gel
    """Ball and gel, in px."""
    wheel: np.ndarray | None
    """(3, tilt, direction, 6) coefficients of the wheel's table, None of other sets."""

    @property
    def pixels(self) -> tuple[int, int]:
        """Columns and rows of the images."""
        rows, columns = self.presses[0].image.shape[:2]
        return columns, rows

    @property
    def largest_px(self) -> float:
        """Radius of the largest labelled circle."""
        return max(press.radius_px for press in self.presses)


def read_set(path: str | Path, gel: Gel) -> LabelledSet:
    """The presses of a gathered file."""
    with read_arrays(path) as data:
        background = data["background"].astype(float)
        presses = [BallPress(image.astype(float), background, (float(x), float(y)), float(radius), str(number)) for number, (
            image, (x, y), radius) in enumerate(zip(data["images"], data["centre_px"], data["radius_px"], strict=True))]
        wheel = np.stack([data[name] for name in ("grad_r", "grad_g", "grad_b")]).astype(float) if "grad_r" in data else None
    return LabelledSet(presses, gel, wheel)


def split(count: int, held_out: float, seed: int) -> tuple[list[int], list[int]]:
    """Numbers of the presses to fit and of those held out, drawn with a seed."""
    order = np.random.default_rng(seed).permutation(count)
    held = max(1, round(held_out * count))
    return sorted(map(int, order[held:])), sorted(map(int, order[:held]))


def fitted(kind: str, own: LabelledSet, presses: Sequence[BallPress], gel: Gel, options: dict[str, Any], *,
           reach: Sequence[float]) -> Shading:
    """A shading of a kind fitted to presses.  reach (press,): contact radii up to which pixels are used"""
    radius = float(np.mean([press.radius_px * far for press, far in zip(presses, reach, strict=True)]))
    step = max(1, round(np.sqrt(len(presses) * np.pi * radius**2 / _PIXELS)))
    samples = ShadingSamples.joined([press.samples(gel, reach=far, step=step) for press, far in zip(presses, reach, strict=True)])
    kinds: dict[str, tuple[type[Shading], dict[str, Any]]] = {
        "table": (SlopeTable, options), "polynomial": (QuadraticShading, options), "phong": (PhongShading, {}),
        SMALL: (QuadraticShading, {"tilt_degree": 2, "place_degree": 0})}
    shading, own_options = kinds[kind]
    return shading.fit(samples, own.pixels, presses[0].background, **own_options)


def with_shadows(shading: Shading, presses: Sequence[BallPress], gel: Gel, *, reach: Sequence[float]) -> Shading:
    """The shading with lamps whose shadows explain what it leaves around the presses, if shadows explain anything.

    reach: (press,) contact radii that are a labelled one
    """
    return replace(shading, lamps=with_lamps(shading, presses, gel, reach=[AROUND * one for one in reach]))


def circles_found(own: LabelledSet, numbers: Sequence[int], gel: Gel, options: dict[str, Any], rounds: int,
                  ) -> tuple[list[BallPress], Shading]:
    """The presses with circles found from their colours, and the polynomial that they were found with.

    Circles and shading are fitted in turn; pixels within REACH labelled radii take part.
    """
    labelled = [clipped(own.presses[number], gel) for number in numbers]
    found, step = labelled, max(2, round(own.largest_px / 9))
    shading = fitted("polynomial", own, found, gel, options, reach=[REACH] * len(found))
    for _ in range(rounds):
        found = [refined_circle(one, gel, shading, reach=REACH * label.radius_px / one.radius_px, step=step,
                                most_px=0.5 * label.radius_px) for one, label in zip(found, labelled, strict=True)]
        shading = fitted("polynomial", own, found, gel, options, reach=[
            REACH * label.radius_px / one.radius_px for one, label in zip(found, labelled, strict=True)])
    return found, shading


def found_again(press: BallPress, own: LabelledSet, gel: Gel, shading: Shading) -> BallPress:
    """A press that was held out, with its circle found by a shading that has not seen it."""
    label = clipped(press, gel)
    step = max(2, round(own.largest_px / 9))
    first = refined_circle(label, gel, shading, reach=REACH, step=step, most_px=0.5 * label.radius_px)
    return refined_circle(first, gel, shading, reach=REACH * label.radius_px / first.radius_px, step=step,
                          most_px=0.5 * label.radius_px)


def clipped(press: BallPress, gel: Gel) -> BallPress:
    """The press with a circle that is not larger than the ball allows."""
    return replace(press, radius_px=min(press.radius_px, _LARGEST * gel.ball_px))


def drawn(model: Shading | np.ndarray, press: BallPress, gel: Gel, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Colours (row, column, 3) of a press at pixels (row, column); model: a shading, or the wheel's table."""
    slopes = ball_slopes(x - press.centre_px[0], y - press.centre_px[1], press.radius_px, gel)
    background = press.background[y, x]
    if isinstance(model, Shading):
        dimming = None if model.lamps is None else press_dimming(press, gel, model.lamps, x, y)
        return model.colours(slopes[..., 0], slopes[..., 1], x, y, background, dimming)
    return np.clip(background + wheel_difference(model, slopes, x, y), 0, 255)


def wheel_difference(table: np.ndarray, slopes: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Colour minus background (..., 3) by the wheel's table: for each tilt and direction a quadratic polynomial in the place.

    Its axes and signs are those, of all that are possible, with which it describes its own presses best.
    """
    angle, direction = np.arctan(np.hypot(*np.moveaxis(slopes, -1, 0))), np.arctan2(-slopes[..., 1], -slopes[..., 0]) + np.pi
    cell = [np.floor(value / width).astype(int) for value, width in ((angle, 0.5 * np.pi / (_BINS - 1)),
                                                                     (direction, 2 * np.pi / (_BINS - 1)))]
    terms = np.stack([x * x, y * y, x * y, x, y, np.ones_like(x)], axis=-1)
    return np.moveaxis(np.sum(table[:, cell[0], cell[1]] * terms, axis=-1), 0, -1)


def scores(model: Shading | np.ndarray, press: BallPress, label: BallPress, gel: Gel) -> dict[str, float]:
    """MAE, MSE, SSIM, PSNR in the labelled circle, of a press drawn with the circle that it has."""
    return scores_of(label, lambda x, y: drawn(model, press, gel, x, y), 0.0, 1.0)


def scores_around(model: Shading, press: BallPress, label: BallPress, gel: Gel) -> dict[str, float]:
    """The same in the ring around the labelled circle."""
    found = scores_of(label, lambda x, y: drawn(model, press, gel, x, y), 1.0, AROUND_SCORED)
    return {f"around_{name}": value for name, value in found.items()}


def scores_of(label: BallPress, colours: Callable[[np.ndarray, np.ndarray], np.ndarray], inner: float, outer: float,
              ) -> dict[str, float]:
    """MAE, MSE, SSIM, PSNR of colours(columns, rows) between two distances from a labelled centre, in labelled radii."""
    x, y = label.square(outer * label.radius_px)
    distance = np.hypot(x - label.centre_px[0], y - label.centre_px[1])
    inside = (distance >= inner * label.radius_px) & (distance <= outer * label.radius_px)
    found = image_scores(colours(x, y), label.image[y, x], counted=inside)
    return {"mae": found.mae, "mse": found.mse, "ssim": found.ssim, "psnr_db": found.psnr}


def normal_errors(model: Shading, press: BallPress, gel: Gel) -> np.ndarray:
    """Angles (pixel,) in degrees between the ball's normals and those recovered from the colours, in the press's circle."""
    step = max(1, round(np.sqrt(np.pi * press.radius_px**2 / _NORMALS)))
    samples = press.samples(gel, reach=0.98, step=step)
    edge = press.radius_px / np.sqrt(gel.ball_px**2 - press.radius_px**2)
    found = slopes_of_colours(model, samples.difference, samples.x_px, samples.y_px, np.zeros(3), steepest=1.2 * edge, rounds=4)
    return normal_error_deg(found, np.column_stack([samples.slope_x, samples.slope_y]))


def per_press_mae(model: Shading | np.ndarray, presses: Sequence[BallPress], gel: Gel, *, reach: Sequence[float]) -> np.ndarray:
    """MAE (press,) in grey levels of pixels up to `reach` contact radii."""
    errors = []
    for press, far in zip(presses, reach, strict=True):
        samples = press.samples(gel, reach=far, step=3)
        at = samples.slope_x, samples.slope_y, samples.x_px, samples.y_px
        made = model.difference(*at) if isinstance(model, Shading) else wheel_difference(model, np.column_stack(at[:2]), *at[2:])
        errors.append(float(np.abs(made - samples.difference).mean()))
    return np.array(errors)


