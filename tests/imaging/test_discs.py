"""Discs rendered with known areas are found again, with the camera's faults; what is no disc is not found."""

from dataclasses import replace

import imageio.v3 as iio
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from softtact.errors import InputError
from softtact.imaging.discs import COLUMNS, DTYPES, detect_discs
from softtact.imaging.frames import BACKGROUND, BRIGHTNESS, Camera, expose, render_frame
from softtact.models.hyperelastic.build import lattice

CAMERA = Camera(pixel_mm=0.03, blur_mm=0.03, noise=0.02, falloff=0.3)
NOISE_AT_FIVE = (BRIGHTNESS - BACKGROUND) / 5   # signal-to-noise 5
BOUND = {12: 0.0205, 16: 0.0133, 24: 0.0072}    # of the area, at the centre's signal-to-noise of 5: Cramer and Rao
DARKER = 1.12   # root mean square of the centre's light over a disc's, where 30 % is lost to the corners


def frame(area, *, counts=(6, 8), seed=0, pitch=1.2, **camera):
    centres, _ = lattice(counts, pitch)
    areas = np.broadcast_to(area, len(centres))
    size = tuple(pitch * count + 0.5 for count in counts)
    return render_frame(*centres.T, areas, replace(CAMERA, **camera), footprint_mm=size, seed=seed), centres


def shapes(inside, *, noise=NOISE_AT_FIVE, side=160, seed=0):
    """(frame, area) of contacts where inside(x, y) in pixels from the centre; 30 % fall-off, blur of a pixel."""
    points = (np.arange(side * 8) + 0.5) / 8 - 0.5 * side
    cover = inside(*np.meshgrid(points, points)).astype(float).reshape(side, 8, side, 8).mean(axis=(1, 3))
    return expose(gaussian_filter(cover, 1.0), Camera(1.0, 1.0, noise=noise, falloff=0.3), seed=seed), cover.sum()


def repeated(inside, *, pitch=32):
    """`inside` again and again over the frame, at other parts of a pixel each time."""
    return lambda x, y: inside((x + 0.013 * y + pitch / 2) % pitch - pitch / 2, (y - 0.013 * x + pitch / 2) % pitch - pitch / 2)


def errors(diameter, *, frames=2, **camera):
    """(relative errors of the areas, the same over the stated standard deviation) of 96 discs, in a camera of 0.03 mm."""
    area = np.pi * (0.015 * diameter) ** 2
    tables = [detect_discs(frame(area, pitch=max(0.06 * diameter, 0.8), seed=seed, noise=NOISE_AT_FIVE, **camera)[0], pixel_mm=0.03)
              for seed in range(frames)]
    off = np.concatenate([table.area_mm2 - area for table in tables])
    return off / area, off / np.concatenate([table.area_sd_mm2 for table in tables])


@pytest.mark.slow
def test_areas_at_signal_to_noise_five_and_a_third_less_light_are_as_good_as_noise_lets_them():
    for diameter in [12, 16, 24]:
        relative, _ = errors(diameter)
        assert len(relative) == 96, diameter
        assert abs(relative.mean()) < 0.01, diameter                                     # scatter of the mean: 0.0024
        assert np.sqrt((relative**2).mean()) < 1.3 * DARKER * BOUND[diameter], diameter   # sd of that of 96: 7 %


def test_a_disc_of_sixteen_pixels_is_within_two_percent_root_mean_square():
    assert np.sqrt((errors(16)[0] ** 2).mean()) < 0.02


def test_the_stated_uncertainty_is_the_scatter():
    for diameter in [12, 20]:
        assert errors(diameter)[1].std() == pytest.approx(1.0, abs=0.25), diameter   # sd of that of 96: 7 %


def test_area_is_found_within_half_a_percent_in_a_good_light():
    for area in [0.15, 0.283, 0.45]:
        discs = detect_discs(frame(area)[0], pixel_mm=CAMERA.pixel_mm)
        assert len(discs) == 48, area
        assert np.abs(discs.area_mm2 / area - 1).max() < 0.03, area
        assert discs.area_mm2.mean() == pytest.approx(area, rel=0.005), area


def test_area_does_not_depend_on_blur():
    for blur_mm in [0.0, 0.06, 0.09]:
        discs = detect_discs(frame(0.283, counts=(5, 5), blur_mm=blur_mm)[0], pixel_mm=CAMERA.pixel_mm)
        assert discs.area_mm2.mean() == pytest.approx(0.283, rel=0.006), blur_mm


def test_every_frustum_of_the_sensor_is_found():
    assert len(detect_discs(frame(0.283, counts=(18, 30), pixel_mm=0.06)[0], pixel_mm=0.06)) == 540


def test_centres_are_found_to_a_tenth_of_a_pixel():
    picture, centres = frame(0.283, counts=(3, 5))
    found = detect_discs(picture, pixel_mm=CAMERA.pixel_mm)[["x_mm", "y_mm"]].to_numpy()
    nearest = np.linalg.norm(found[:, None] - centres[None], axis=2).min(axis=1)
    assert nearest.max() < 0.1 * CAMERA.pixel_mm   # light that falls off within a disc moves it by 0.05


@settings(max_examples=10, deadline=None)
@given(x=st.floats(-1, 1), y=st.floats(-1, 1))
@example(x=0.58984375, y=0.0)     # whole steps of Gauss and Newton lead away from it
def test_a_disc_moves_with_its_contact_and_keeps_its_area(x, y):
    pixel = CAMERA.pixel_mm
    picture = render_frame([x * pixel], [y * pixel], [0.283], replace(CAMERA, noise=0.0), footprint_mm=(2, 2), seed=0)
    disc = detect_discs(picture, pixel_mm=pixel).iloc[0]
    assert (disc.x_mm / pixel, disc.y_mm / pixel) == (pytest.approx(x, abs=0.03), pytest.approx(y, abs=0.03))
    assert disc.area_mm2 == pytest.approx(0.283, rel=0.005)


def test_light_over_all_the_frame_and_the_seed_of_the_noise_do_not_matter_but_the_scale_does():
    picture, _ = frame(0.283, counts=(3, 5))
    discs, darker = (detect_discs(each, pixel_mm=0.03) for each in (picture, (0.5 * picture + 20).astype(np.uint8)))
    assert darker.area_mm2.to_numpy() == pytest.approx(discs.area_mm2.to_numpy(), rel=0.02)
    assert detect_discs(picture, pixel_mm=0.06).area_mm2.to_numpy() == pytest.approx(4 * discs.area_mm2.to_numpy())


@pytest.mark.filterwarnings("error")     # such as that of contrast without a disc
@settings(max_examples=25, deadline=None, derandomize=True)
@given(noise=st.floats(0, 0.5), falloff=st.floats(0, 0.95), background=st.floats(0, 1), seed=st.integers(0, 10**6))
def test_an_empty_frame_has_no_discs_whatever_its_noise_and_light(noise, falloff, background, seed):
    empty = render_frame([], [], [], Camera(1.0, 1.0, noise=noise, falloff=falloff, background=background),
                         footprint_mm=(200, 150), seed=seed)
    assume(len(np.unique(empty)) != 2)      # of two values it is read as a mask, in which the higher one is a contact
    assert detect_discs(empty, pixel_mm=1.0).empty


def test_the_blotches_of_a_compressed_empty_frame_are_no_discs():
    for quality in [75, 95]:
        for noise in [0.02, 0.1]:
            empty = render_frame([], [], [], Camera(1.0, 1.0, noise=noise, falloff=0.5), footprint_mm=(320, 240), seed=[0, 0])
            packed = iio.imwrite("<bytes>", empty, extension=".jpg", quality=quality)
            assert detect_discs(iio.imread(packed, extension=".jpg"), pixel_mm=1.0).empty, noise


def test_a_lamps_reflection_is_no_disc():
    for noise in [0.0, 0.02]:
        r, c = np.mgrid[0:200, 0:260]
        light = 0.1 + 0.7 * np.exp(-((r - 80) ** 2 + (c - 100) ** 2) / (2 * 40**2))
        light += noise * np.random.default_rng(0).normal(size=r.shape)
        assert detect_discs((255 * light.clip(0, 1)).astype(np.uint8), pixel_mm=1.0).empty, noise


def test_the_table_of_an_empty_frame_has_the_columns_and_kinds_of_a_full_one():
    empty, full = (detect_discs(frame(area, counts=(2, 2))[0], pixel_mm=0.03) for area in (0.0, 0.283))
    assert list(empty.columns) == list(full.columns) == COLUMNS == list(DTYPES)
    assert (empty.dtypes == full.dtypes).all()


def test_an_ellipse_is_not_taken_for_the_circle_of_its_width():
    relative = []
    for seed in range(4):
        picture, _ = shapes(repeated(lambda x, y: x**2 / 1.3 + y**2 * 1.3 < 64), seed=seed)
        table = detect_discs(picture, pixel_mm=1.0)
        relative.extend(table[~table.clipped].area_mm2 / (64 * np.pi) - 1)
    assert len(relative) >= 36
    assert abs(np.mean(relative)) < 0.01 and np.sqrt(np.mean(np.square(relative))) < 0.022


def test_a_long_ellipse_has_an_outline_of_its_own():
    picture, area = shapes(lambda x, y: (x + 0.3 * y) ** 2 / 1.7 + y**2 * 1.7 < 144, noise=0.02)
    disc = detect_discs(picture, pixel_mm=1.0).iloc[0]
    assert disc.measured_by == "outline" and disc.area_mm2 == pytest.approx(area, rel=0.01)


@pytest.mark.parametrize("corner", [0, 3])
def test_a_square_contact_has_its_own_area(corner):
    def square(x, y):
        return np.maximum(abs(x) - 7 + corner, 0) ** 2 + np.maximum(abs(y) - 7 + corner, 0) ** 2 <= max(corner, 1e-9) ** 2

    picture, _ = shapes(square, noise=0.02)
    assert detect_discs(picture, pixel_mm=1.0).area_mm2.tolist() == [pytest.approx(196 - (4 - np.pi) * corner**2, rel=0.015)]


def test_a_ring_is_measured_by_its_light_without_its_hole():
    picture, area = shapes(lambda x, y: (x**2 + y**2 < 144) & (x**2 + y**2 > 25), noise=0.02)
    discs = detect_discs(picture, pixel_mm=1.0)
    assert discs.measured_by.tolist() == ["light"] and discs.area_mm2[0] == pytest.approx(area, rel=0.03)


def test_touching_discs_are_split_and_keep_their_areas():
    picture, area = shapes(lambda x, y: np.minimum((x - 10) ** 2, (x + 10) ** 2) + y**2 < 100)
    discs = detect_discs(picture, pixel_mm=1.0)
    assert discs.touching.tolist() == [True, True]
    assert discs.area_mm2.to_numpy() == pytest.approx(area / 2, rel=0.04)


def test_overlapping_discs_share_what_lies_in_both():
    picture, area = shapes(lambda x, y: np.minimum((x - 8.5) ** 2, (x + 8.5) ** 2) + y**2 < 100, noise=0.02)
    discs = detect_discs(picture, pixel_mm=1.0)
    assert len(discs) == 2 and discs.area_mm2.sum() == pytest.approx(area, rel=0.015)


def test_a_sheet_of_discs_as_wide_as_their_pitch_is_found_disc_by_disc():
    area = np.pi * 0.6**2
    picture, _ = frame(area, counts=(5, 6), pixel_mm=0.04, blur_mm=0.04, noise=0.08)
    discs = detect_discs(picture, pixel_mm=0.04)
    assert len(discs) == 30 and discs.touching.all()
    assert discs.area_mm2.mean() == pytest.approx(area, rel=0.02)


def test_a_disc_cut_by_the_border_is_flagged_and_has_the_area_that_is_seen():
    for x in [60, 64, 68]:
        picture, area = shapes(lambda a, b, x=x: (a - x) ** 2 + b**2 < 400, side=128, noise=0.04)
        disc = detect_discs(picture, pixel_mm=1.0).iloc[0]
        assert disc.clipped and disc.x_mm == pytest.approx(x, abs=2.5), x   # what lies beyond the border is only guessed
        assert disc.area_mm2 == pytest.approx(area, abs=max(4 * disc.area_sd_mm2, 0.01 * area)), x


def test_dim_discs_beside_bright_ones_keep_their_own_brightness():
    picture, _ = shapes(repeated(lambda x, y: x**2 + y**2 < 64), noise=0.0)
    light = np.where((np.arange(160) // 32 % 2)[None, :], 0.5, 1.0) * picture / 255
    table = detect_discs(light + 0.02 * np.random.default_rng(0).normal(size=light.shape), pixel_mm=1.0)
    whole = table[~table.clipped]
    assert len(whole) >= 9 and whole.area_mm2.to_numpy() == pytest.approx(64 * np.pi, rel=0.05)


def test_smaller_discs_are_left_out_on_demand():
    picture = render_frame([-1, 1], [0, 0], [0.1, 0.4], CAMERA, footprint_mm=(4, 2), seed=0)
    assert detect_discs(picture, pixel_mm=0.03, smallest_mm=0.5).area_mm2.tolist() == [pytest.approx(0.4, rel=0.01)]


def test_a_frames_depth_and_channels_do_not_matter():
    picture, _ = frame(0.283, counts=(3, 3))
    plain = detect_discs(picture, pixel_mm=0.03)
    for change in [
        lambda f: f.astype(np.uint16) * 16,                       # 12 bits in 16
        lambda f: f.astype(np.uint16) * 257,
        lambda f: f / 255.0,
        lambda f: f.astype(np.float32),                           # 0 ... 255 in floating point
        lambda f: np.repeat(f[..., None], 3, axis=2),
        lambda f: np.dstack([f, f, f, np.full_like(f, 255)]),
        lambda f: f[..., None],
    ]:
        other = detect_discs(change(picture), pixel_mm=0.03)
        assert other.area_mm2.to_numpy() == pytest.approx(plain.area_mm2.to_numpy(), rel=0.003), change


def test_an_array_that_is_no_picture_is_refused():
    for picture, said in ((np.zeros(9), r"shape \(9,\) is not a picture"),
                          (np.zeros((3, 100)), r"shape \(3, 100\) is not a picture"),
                          (np.full((50, 50), np.nan), r"2500 values that are not finite numbers, the first at .* \(0, 0\)"),
                          (np.zeros((50, 50, 5)), "5 channels"), (np.zeros((50, 50), dtype=complex), "complex128")):
        with pytest.raises(InputError, match=said):
            detect_discs(picture, pixel_mm=1.0)
