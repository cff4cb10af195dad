"""Discs rendered with known areas are found again, with the camera's faults."""

import numpy as np
import pytest

from softtact.mechanics.layered_body import lattice
from softtact.optics.discs import detect_discs
from softtact.optics.frames import render_frame

CAMERA = {"pixel_mm": 0.03, "blur_mm": 0.03, "noise": 0.02, "falloff": 0.3}


def frame(area, *, counts=(6, 8), **camera):
    centres, _ = lattice(counts, 1.2)
    areas = np.broadcast_to(area, len(centres))
    size = (1.2 * counts[0] + 0.5, 1.2 * counts[1] + 0.5)
    return render_frame(*centres.T, areas, footprint_mm=size, seed=0, **(CAMERA | camera)), centres


@pytest.mark.parametrize("area", [0.15, 0.283, 0.45])
def test_area_is_found_within_two_percent_under_uneven_light_and_noise(area):
    discs = detect_discs(frame(area)[0], pixel_mm=CAMERA["pixel_mm"])
    assert len(discs) == 48
    assert discs.area_mm2.mean() == pytest.approx(area, rel=0.02)


def test_every_frustum_of_the_sensor_is_found():
    assert len(detect_discs(frame(0.283, counts=(18, 30))[0], pixel_mm=CAMERA["pixel_mm"])) == 540


def test_centres_are_found_to_half_a_pixel():
    picture, centres = frame(0.283)
    discs = detect_discs(picture, pixel_mm=CAMERA["pixel_mm"])
    found = discs[["x_mm", "y_mm"]].to_numpy()
    nearest = np.linalg.norm(found[:, None] - centres[None], axis=2).min(axis=1)
    assert nearest.max() < 0.5 * CAMERA["pixel_mm"]


def test_an_empty_frame_has_no_discs():
    assert len(detect_discs(frame(0.0)[0], pixel_mm=CAMERA["pixel_mm"])) == 0
