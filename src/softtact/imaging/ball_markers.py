"""Motion of markers on a gel under a ball that is pressed in and moved aside, as a camera behind the gel sees it.

    motion = camera's shift + perspective of the lowered surface + press (finite strain, friction) + shear (stick and slip)

The press is a path of the solid model (`models/solid/ball_on_disc.py`), with the gel's thickness as unit. The sideways motion is
that of a bonded layer with Mindlin's traction: the stuck circle is c / a = sqrt(1 - motion / motion at which all slides), and the
motion at which all slides follows from friction and the press's force. Lengths are in px; `MarkerGel` belongs to a sensor with its
ball and is the same for all images, `MarkerLoad` belongs to an image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from softtact.imaging.marker_motion import (
    REGISTRATIONS,
    MarkerMotion,
    MotionFit,
    dilate,
    fit_motion,
    registration,
    shear,
    twist,
)
from softtact.models.elastic.ball_on_layer import BallOnLayer
from softtact.models.elastic.layer_shear import ShearedContact, outward
from softtact.models.solid.ball_on_disc import DiscPress

_TOUCHES = 2e-3     # of the ball's radius: a smaller gap counts as contact
_NEAR = 60.0        # px around the stated centre, within which a contact is searched
_CONTACT_POINTS = 15    # across the contact, of FOTS' sum


@dataclass(frozen=True)
class MarkerGel:
    """What all images of a sensor under the same ball share."""

    press: DiscPress
    """The press of the ball, all lengths over the gel's thickness."""
    ball_px: float
    """Radius of the ball."""
    ball_over_thickness: float
    """Ratio of the press's path."""
    friction: float
    """Coulomb's coefficient of the press's path."""
    distance_px: float
    """From the camera's pinhole to the surface at rest, over px of the surface."""
    poisson: float = 0.49
    """Of the gel, for its shear."""

    @property
    def thickness_px(self) -> float:
        """Thickness of the gel."""
        return self.ball_px / self.ball_over_thickness

    def contact_px(self, depth_px: float) -> float:
        """Radius of the contact at a depth."""
        x, low = self.press.surface_at(depth_px / self.thickness_px)
        ball, depth = self.ball_over_thickness, depth_px / self.thickness_px
        gap = low - depth + ball - np.sqrt(np.maximum(ball**2 - x**2, 0))
        touching = np.flatnonzero(gap < _TOUCHES * ball)
        return float(x[touching[-1]] if len(touching) and touching[-1] else np.sqrt(ball * depth)) * self.thickness_px

    def sliding_px(self, depth_px: float) -> float:
        """Sideways motion of the contact's centre at which all of the contact slides."""
        h = self.thickness_px
        force = float(self.press.at(depth_px / h)) * h**2       # over G
        slid = ShearedContact(self.contact_px(depth_px), 0.0, h, self.poisson)
        return self.friction * force * slid.motion_per_force


@dataclass(frozen=True)
class MarkerLoad:
    """How the ball stands in one image."""

    centre_px: tuple[float, float]
    """Where it was put down, column and row."""
    depth_px: float
    """Of its lowest point below the surface at rest."""
    aside_px: tuple[float, float] = (0.0, 0.0)
    """Motion of the ball along the surface after it was pressed in."""
    camera: tuple[float, ...] = ()
    """Shift x, y (px), zoom, rotation of the camera between the two images; those that are left out are 0."""
    stick_share: float | None = None
    """Radius of the stuck circle over the contact's; None: as the friction has it."""


def predicted_motion(px: np.ndarray, gel: MarkerGel, load: MarkerLoad, middle_px: Sequence[float]) -> np.ndarray:
    """Motion (marker, 2) in px of markers at rest at px (marker, 2).  middle_px: where the camera looks straight down"""
    away = np.asarray(px, dtype=float) - load.centre_px
    radius, h = np.hypot(*away.T), gel.thickness_px
    at = radius / h
    out, low = gel.press.motion_at(load.depth_px / h, at)
    moved = away * (out / np.maximum(at, 1e-9))[:, None] + _sheared(away, gel, load)
    low = low * h
    seen = moved + (px - np.asarray(middle_px) + moved) * (low / (gel.distance_px - low))[:, None]
    return seen + registration("similarity", px, middle_px, load.camera)


def _sheared(away, gel, load):
    """Motion (marker, 2) by the ball's motion aside; beyond the sliding distance the ball slides over the gel."""
    aside = float(np.hypot(*load.aside_px))
    if aside < 1e-6:
        return np.zeros_like(away)
    direction = np.asarray(load.aside_px) / aside
    turned = np.array([-direction[1], direction[0]])
    limit = gel.sliding_px(load.depth_px)
    share = np.sqrt(max(1 - aside / limit, 0.0)) if limit > 0 else 0.0
    share, most = (share, limit) if load.stick_share is None else (load.stick_share, np.inf)
    contact = ShearedContact(gel.contact_px(load.depth_px), share, gel.thickness_px, gel.poisson)
    motion = min(aside, most) * contact.motion(away @ direction, away @ turned)
    return motion[:, :1] * direction + motion[:, 1:] * turned


def fit_load(markers: MarkerMotion, gel: MarkerGel, middle_px: Sequence[float], *, centre_px: Sequence[float],
             sheared: bool, camera: str = "shift", free_distance: bool = False,
             free_share: bool = False) -> tuple[MarkerLoad, MarkerGel, MotionFit]:
    """The load of one image, fitted to its markers with the gel's parameters as they are.

    free_distance: the camera's distance is fitted, too;  free_share: so is the share that sticks, which else follows from friction
    camera: what of the camera's motion is fitted, a key of REGISTRATIONS
    """
    deepest = 0.999 * float(gel.press.depth_mm[-1])       # over the thickness
    free = REGISTRATIONS[camera]

    def parts(values):
        one = replace(gel, distance_px=values[-1]) if free_distance else gel
        aside = tuple(values[3:5]) if sheared else (0.0, 0.0)
        start = 5 if sheared else 3
        share = float(values[start + free]) if free_share else None
        depth, seen = values[2] * deepest * one.thickness_px, tuple(values[start:start + free])
        return MarkerLoad(tuple(values[:2]), depth, aside, seen, share), one

    lower, upper = [centre_px[0] - _NEAR, centre_px[1] - _NEAR, 0.05], [centre_px[0] + _NEAR, centre_px[1] + _NEAR, 1.0]
    start = [*centre_px, 0.7]
    if sheared:
        mean = np.median(markers.motion_px, axis=0)
        lower, upper, start = lower + [-60, -60], upper + [60, 60], start + [2 * mean[0], 2 * mean[1]]
    lower, upper = lower + [-10, -10, -0.05, -0.05][:free], upper + [10, 10, 0.05, 0.05][:free]
    start = start + [0.0] * free
    if free_share:
        lower, upper, start = [*lower, 0.0], [*upper, 1.0], [*start, 0.7]
    if free_distance:
        lower, upper, start = [*lower, 0.5 * gel.distance_px], [*upper, 3 * gel.distance_px], [*start, gel.distance_px]
    starts = [start, [*start[:2], 0.35, *start[3:]]]
    starts += [[*middle_px, *start[2:]]] if sheared else []
    fit = fit_motion(lambda values: predicted_motion(markers.px, parts(values)[1], parts(values)[0], middle_px), markers, starts,
                     (lower, upper))
    return (*parts(fit.values), fit)


# --- what the field uses, fitted to the same image


def fit_formulas(markers: MarkerMotion, middle_px: Sequence[float], *, ball_px: float, contact_px: float,
                 centre_px: Sequence[float], sheared: bool, camera: str) -> MotionFit:
    """FOTS' formulas: centre, scale, width of the spreading; with `sheared` also shift, turn and their widths; the camera."""
    half = np.linspace(-contact_px, contact_px, _CONTACT_POINTS)
    places = np.stack(np.meshgrid(half, half), axis=-1).reshape(-1, 2)
    places = places[np.hypot(*places.T) <= contact_px]
    heights = np.sqrt(np.maximum(ball_px**2 - np.sum(places**2, axis=1), 0))
    heights = heights - np.sqrt(max(ball_px**2 - contact_px**2, 0.0))
    heights = heights / heights.sum()
    free = REGISTRATIONS[camera]

    def model(values):
        motion = dilate(markers.px, values[:2], heights, places, values[2], values[3])
        if sheared:
            motion = motion + shear(markers.px, values[:2], values[4:6], values[6])
            motion = motion + twist(markers.px, values[:2], values[7], values[8])
        camera_values = values[-free:] if free else []
        return motion + registration("similarity", markers.px, middle_px, camera_values)

    mean = 2 * np.median(markers.motion_px, axis=0)
    more = [(-60, 60, mean[0]), (-60, 60, mean[1]), (20, 600, 80), (-0.5, 0.5, 0.0), (20, 600, 80)] if sheared else []
    ranges = [*((place - _NEAR, place + _NEAR, place) for place in centre_px),
              (-2, 2, 0.1), (15, 600, 40), *more, *[(-10, 10, 0.0), (-10, 10, 0.0), (-0.05, 0.05, 0.0), (-0.05, 0.05, 0.0)][:free]]
    lower, upper, start = (list(column) for column in zip(*ranges, strict=True))
    return fit_motion(model, markers, [start, [*start[:3], 150, *start[4:]]], (lower, upper))


def fit_linear_layer(markers: MarkerMotion, middle_px: Sequence[float], *, ball_px: float, contact_px: float, thickness_px: float,
                     centre_px: Sequence[float], sheared: bool, camera: str) -> MotionFit:
    """One linear bonded layer without friction, pressed by the ball; with `sheared` its contact is stuck and moved aside.

    Fitted: centre, scale of the press, the motion aside, and the camera.
    """
    ball = BallOnLayer(contact_px, max(ball_px, 1.01 * contact_px), thickness_px)
    grid = np.linspace(0, 12 * contact_px, 200)
    profile = outward(ball, grid)
    contact = ShearedContact(contact_px, 1.0, thickness_px)
    free = REGISTRATIONS[camera]

    def model(values):
        away = markers.px - values[:2]
        radius = np.hypot(*away.T)
        motion = values[2] * away * (np.interp(radius, grid, profile) / np.maximum(radius, 1e-9))[:, None]
        if sheared and (size := float(np.hypot(*values[3:5]))) > 1e-6:
            direction = values[3:5] / size
            turned = np.array([-direction[1], direction[0]])
            moved = size * contact.motion(away @ direction, away @ turned)
            motion = motion + moved[:, :1] * direction + moved[:, 1:] * turned
        return motion + registration("similarity", markers.px, middle_px, values[-free:] if free else [])

    mean = 2 * np.median(markers.motion_px, axis=0)
    more = [(-60, 60, mean[0]), (-60, 60, mean[1])] if sheared else []
    ranges = [*((place - _NEAR, place + _NEAR, place) for place in centre_px),
              (0, 20, 1.0), *more, *[(-10, 10, 0.0), (-10, 10, 0.0), (-0.05, 0.05, 0.0), (-0.05, 0.05, 0.0)][:free]]
    lower, upper, start = (list(column) for column in zip(*ranges, strict=True))
    return fit_motion(model, markers, [start], (lower, upper))
