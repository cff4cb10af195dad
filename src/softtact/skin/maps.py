"""Maps of a patch: smallest detectable force, error of localisation, crosstalk against pitch.

All follow from the taxels' responses to a small force at any place (`Skin.influence`), to first order in the force.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from softtact.skin.analysis import Converter, LayerMeshSizes, Skin
from softtact.skin.layout import Layout
from softtact.skin.loads import ellipse

_STEP_MM = 0.25  # of the central differences for the slopes
_SINGULAR = 1e-12  # smallest eigenvalue of a scaled information matrix below which the readings do not give the place


@dataclass(frozen=True)
class PatchMaps:
    """Maps over the places where a finger lies on the elastomer as a whole."""

    places_mm: np.ndarray
    """(place, 2)"""
    gain_ff_per_n: np.ndarray
    """(place, taxel): rise of the capacitances per N of the finger."""
    smallest_force_n: np.ndarray
    """(place,): the force at which the most sensitive taxel rises by the counts that are detected above noise."""
    localisation_mm: np.ndarray
    """(place,): Cramer-Rao bound of the place's standard error at the finger's force; inf where readings do not give it."""
    centroid_error_mm: np.ndarray
    """(place,): distance of the readings' centroid from the place, without noise."""
    force_n: float
    """Of the finger for the error of localisation."""

    def table(self) -> pd.DataFrame:
        """A row a place."""
        return pd.DataFrame({
            "x_mm": self.places_mm[:, 0], "y_mm": self.places_mm[:, 1], "smallest_force_n": self.smallest_force_n,
            "localisation_mm": self.localisation_mm, "centroid_error_mm": self.centroid_error_mm})


def patch_maps(skin: Skin, *, finger_mm2: float, pressure_mpa: float, young_mpa: float, converter: Converter,
               detected_counts: float, spacing_mm: float = 1.0) -> PatchMaps:
    """`PatchMaps` of a round finger of an area that presses with a uniform pressure.

    Places lie `spacing_mm` apart, with the whole finger on the elastomer.
    """
    places = finger_places(skin.layout, finger_mm2=finger_mm2, spacing_mm=spacing_mm)
    force = pressure_mpa * finger_mm2
    gains = {shift: _gain(skin, places + _STEP_MM * np.array(shift), finger_mm2) / young_mpa
             for shift in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))}
    gain = gains[0, 0]
    slopes = [force * (gains[tuple(axis)] - gains[tuple(-axis)]) / (2 * _STEP_MM) for axis in np.eye(2, dtype=int)]
    above = np.maximum(force * gain, 0.0)
    centroid = above @ skin.layout.centres_mm / np.maximum(above.sum(axis=1), 1e-300)[:, None]
    return PatchMaps(places, gain, detected_counts * converter.step_ff / np.maximum(gain.max(axis=1), 1e-12),
                     _standard_error(np.stack([*slopes, gain], axis=2), converter.noise_ff),
                     np.linalg.norm(centroid - places, axis=1), force)


def finger_places(layout: Layout, *, finger_mm2: float, spacing_mm: float) -> np.ndarray:
    """Places (place, 2) in mm, `spacing_mm` apart, where a round finger of an area lies on the elastomer as a whole."""
    low, high = layout.outline_mm.min(axis=0), layout.outline_mm.max(axis=0)
    lines = (np.arange(a, b, spacing_mm) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 2)
    return grid[layout.inside(grid, margin_mm=np.sqrt(finger_mm2 / np.pi) + _STEP_MM)]


@dataclass(frozen=True)
class TaxelLayer:
    """Taxels of one size under a layer of elastomer, whatever their pitch."""

    radius_mm: float
    """Of a taxel."""
    guard_radius_mm: float
    """Where the guard around a taxel begins."""
    thickness_mm: float
    """Of the elastomer."""
    poisson: float
    permittivity: float
    young_mpa: float


def crosstalk(pitches_mm: Sequence[float], layer: TaxelLayer, *, probe_mm: float, pressure_mpa: float, converter: Converter,
              spacing_mm: float = 1.0) -> pd.DataFrame:
    """A row for each pitch: rise of a neighbour as a share of that of the pressed taxel, and the error of localisation.

    A taxel and its six neighbours lie on a triangle that is large enough for them; the probe is a disc of a diameter.
    """
    area = np.pi * probe_mm**2 / 4
    rows = []
    for pitch in pitches_mm:
        skin = Skin(_seven_taxels(pitch, layer.radius_mm, layer.guard_radius_mm, margin_mm=3 * layer.thickness_mm),
                    thickness_mm=layer.thickness_mm, poisson=layer.poisson, permittivity=layer.permittivity,
                    mesh=LayerMeshSizes(spacing_mm=1.5 * spacing_mm, layers=3, field_spacing_mm=2.5))
        gain = _gain(skin, np.zeros((1, 2)), area)[0] / layer.young_mpa
        between = _gain_and_slopes(skin, np.array([pitch / 2, 0.0]), area, force_n=pressure_mpa * area) / layer.young_mpa
        rows.append({"pitch_mm": pitch, "own_ff_per_n": gain[0], "neighbour_ff_per_n": gain[1:].mean(),
                     "crosstalk": gain[1:].mean() / gain[0],
                     "localisation_mm": _standard_error(between[None], converter.noise_ff)[0],
                     "taxels_per_cm2": 200 / (np.sqrt(3) * pitch**2)})
    return pd.DataFrame(rows)


def _seven_taxels(pitch, radius, guard_radius, *, margin_mm):
    """Layout of a taxel and its six neighbours on a triangle, with a margin around them."""
    angle, upright = np.pi / 3 * np.arange(6), np.pi / 2 + 2 * np.pi / 3 * np.arange(3)
    centres = np.vstack([[0.0, 0.0], pitch * np.column_stack([np.cos(angle), np.sin(angle)])])
    corners = 2 * (pitch + guard_radius + margin_mm) * np.column_stack([np.cos(upright), np.sin(upright)])
    return Layout(corners, centres, np.zeros(7, dtype=int), corners[None], radius, guard_radius)


def _gain_and_slopes(skin, place, area, *, force_n):
    """Derivatives (taxels, 3) of the readings at a force: by its place along x and y (fF/mm) and by the force (fF/N), times E."""
    ahead, behind = (
        np.stack([_gain(skin, (place + step * axis)[None], area)[0] for axis in np.eye(2)], axis=1)
        for step in (_STEP_MM, -_STEP_MM)
    )
    at = _gain(skin, place[None], area)[0]
    return np.column_stack([force_n * (ahead - behind) / (2 * _STEP_MM), at])


def _gain(skin, places, area_mm2):
    """Rise (place, taxel) per N of a uniform pressure on a disc, for a modulus of 1 MPa."""
    unit = ellipse((0.0, 0.0), area_mm2=area_mm2, pressure_mpa=1.0, ratio=1.0)
    few = slice(0, None, 6)  # every sixth point around: 16 of 96, of 24 radii
    points, weight = unit.points_mm[few], unit.force_n[few] / unit.force_n[few].sum()
    values = skin.layer.under((places[:, None] + points).reshape(-1, 2)) @ skin.influence
    return np.einsum("pkt,k->pt", values.reshape(len(places), len(points), -1), weight)


def _standard_error(slopes, noise):
    """Standard error of the place (n,), from the slopes (n, taxel, 3) of the readings by x, y and force, all three unknown.

    noise: of a reading, 0 or more; where readings do not give the place the error is infinite, without noise, too
    """
    information = np.einsum("nti,ntj->nij", slopes, slopes)     # for a noise of 1, by which the error is in proportion to it
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", information), 1e-300))
    scaled = information / (scale[:, :, None] * scale[:, None, :])
    error = np.full(len(slopes), np.inf)
    regular = np.linalg.eigvalsh(scaled)[:, 0] > _SINGULAR
    variance = np.einsum("nii->ni", np.linalg.inv(scaled[regular])) / scale[regular] ** 2
    error[regular] = noise * np.sqrt(variance[:, :2].sum(axis=1))
    return error
