"""Rendered frames: exact coverage, blur that crosses the border, and a signal-to-noise that follows from the settings."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softtact.imaging.frames import BACKGROUND, BRIGHTNESS, Camera, coverage, render_frame

CAMERA = Camera(pixel_mm=1.0, blur_mm=1.0, noise=0.0, falloff=0.0)
VIEW = {"footprint_mm": (60.0, 40.0), "seed": 0}
part = st.floats(-0.5, 0.5)


@settings(max_examples=30, deadline=None)
@given(radius=st.floats(1.5, 15.0), x=part, y=part)
def test_the_area_of_a_disc_is_exact_wherever_it_lies_in_a_pixel(radius, x, y):
    cover = coverage([x], [y], [np.pi * radius**2], shape=(40, 41), pixel_mm=1.0)
    assert cover.sum() == pytest.approx(np.pi * radius**2, rel=3e-3)   # strips of a sixteenth of a pixel


def test_a_disc_of_six_pixels_radius_is_exact_to_a_thousandth():
    areas = [coverage([x], [x / 3], [36 * np.pi], shape=(20, 20), pixel_mm=1.0).sum() for x in np.linspace(0, 1, 20)]
    assert np.abs(np.array(areas) / (36 * np.pi) - 1).max() < 1e-3


def test_touching_discs_share_the_pixel_between_them():
    cover = coverage([-5.3, 5.3], [0, 0], np.full(2, np.pi * 5.3**2), shape=(21, 41), pixel_mm=1.0)
    assert cover.sum() == pytest.approx(2 * np.pi * 5.3**2, rel=1e-3)


def test_half_of_a_disc_on_the_border_is_seen_and_blurred_as_if_the_frame_went_on():
    edge = render_frame([-30.0], [0.0], [200.0], CAMERA, **VIEW)
    wide = render_frame([-30.0], [0.0], [200.0], CAMERA, **VIEW | {"footprint_mm": (100.0, 40.0)})
    assert np.array_equal(edge, wide[:, 20:80])


def test_discs_beyond_the_frame_are_not_seen():
    frame = render_frame([-80.0, 0.0], [0.0, -60.0], [50.0, 50.0], CAMERA, **VIEW)
    assert np.ptp(frame) == 0


def test_the_centre_of_a_frame_is_the_origin_also_where_pixels_do_not_divide_it():
    frame = render_frame([0.0], [0.0], [100.0], CAMERA, **VIEW | {"footprint_mm": (60.4, 40.4)}).astype(float)
    assert np.allclose(frame, frame[::-1, ::-1])


def test_signal_to_noise_is_what_the_pixels_show():
    for noise in [0.02, 0.05]:
        camera = replace(CAMERA, noise=noise, background=0.3, brightness=0.7)
        frame = render_frame([0.0], [0.0], [700.0], camera, footprint_mm=(90.0, 60.0), seed=0) / 255.0
        r, c = np.mgrid[-29.5:30, -44.5:45]
        inner, outer = frame[r**2 + c**2 < 100], frame[r**2 + c**2 > 500]
        measured = (inner.mean() - outer.mean()) / outer.std()
        assert measured == pytest.approx(camera.signal_to_noise, rel=0.05), noise


def test_light_falls_off_to_the_corners_by_the_stated_share():
    frame = render_frame([], [], [], replace(CAMERA, falloff=0.3, background=0.8), **VIEW).astype(float)
    assert frame[0, 0] / frame[20, 30] == pytest.approx(0.7, abs=0.01)


def test_the_same_seed_gives_the_same_frame_and_another_seed_another():
    frames = [render_frame([0], [0], [50], replace(CAMERA, noise=0.05), **VIEW | {"seed": seed}) for seed in (1, 1, [1, 2])]
    assert np.array_equal(frames[0], frames[1]) and not np.array_equal(frames[0], frames[2])


def test_without_noise_glass_and_contact_have_their_brightness():
    frame = render_frame([0.0], [0.0], [700.0], CAMERA, **VIEW)
    assert (frame.min(), frame.max()) == (round(255 * BACKGROUND), round(255 * BRIGHTNESS))
