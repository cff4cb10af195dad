"""The detector of markers, on images drawn with known places, and on a real gel's picture where it is at hand."""

import os
import sys
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
import tifffile
from PIL import Image
from scipy.ndimage import gaussian_filter

from softtact.errors import InputError
from softtact.imaging.markers import find_markers, read_image, track

FAINTEST = 0.37     # contrast of the faintest of 99 markers on a real gel (FOTS' marker_dilate.png, measured here below)
REAL = Path(os.environ.get("SOFTTACT_TEST_DATA", "nowhere")) / "gel/fots"
FINE = 16           # parts of a pixel's side in a drawn image: it is drawn by counting, by no formula of the package


def drawn(places, *, radius=5.8, contrast=0.68, noise=0.0, shape=(240, 320), blur=0.8, seed=1):
    """An image (rows, columns, 3) with dark discs at places (n, 2) px over a coloured light that changes across it."""
    light = np.ones(shape)
    part = (np.arange(FINE) + 0.5) / FINE - 0.5
    for x, y in places:
        left, top = int(x - radius) - 2, int(y - radius) - 2
        columns, rows = np.arange(left, left + 2 * int(radius) + 6), np.arange(top, top + 2 * int(radius) + 6)
        columns, rows = columns[(columns >= 0) & (columns < shape[1])], rows[(rows >= 0) & (rows < shape[0])]
        fine_x, fine_y = (columns[:, None] + part).ravel() - x, (rows[:, None] + part).ravel() - y
        inside = (fine_x**2 + fine_y[:, None]**2 < radius**2).reshape(len(rows), FINE, len(columns), FINE).mean(axis=(1, 3))
        light[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1] -= contrast * inside
    light = gaussian_filter(light, blur, mode="nearest")
    y, x = np.mgrid[:shape[0], :shape[1]] / 320.0
    colours = np.stack([230 - 60 * x, 150 + 40 * y, 160 + 50 * x], axis=-1) * light[..., None]
    colours += noise * 255 * np.random.default_rng(seed).standard_normal(colours.shape)
    return np.clip(np.round(colours), 0, 255).astype(np.uint8)


def grid(pitch=28.7, shape=(240, 320), margin=14.0, scatter=0.5, seed=3):
    """Places (n, 2) of a grid whose markers lie off the middles of pixels by all fractions."""
    x, y = np.meshgrid(np.arange(margin, shape[1] - margin, pitch), np.arange(margin, shape[0] - margin, pitch))
    places = np.column_stack([x.ravel(), y.ravel()])
    return places + np.random.default_rng(seed).uniform(-scatter, scatter, places.shape)


def errors(places, found):
    near = track(places, found.px, limit_px=5.0)
    assert not np.isnan(near).any(), "a marker was not found"
    return near - places


def test_drawn_markers_are_found_within_a_twentieth_of_a_pixel_each():
    places = grid()
    off = errors(places, find_markers(drawn(places)))
    assert np.abs(off).max() < 0.05 and np.abs(off.mean(axis=0)).max() < 0.01


def test_the_bias_stays_below_a_twentieth_of_a_pixel_at_the_faintest_real_contrast_and_noise():
    """0.008 of the light: the noise between the markers of the real picture."""
    places = grid()
    off = errors(places, find_markers(drawn(places, contrast=FAINTEST, noise=0.008)))
    assert np.abs(off.mean(axis=0)).max() < 0.05 and off.std() < 0.1


def test_nothing_but_markers_is_found():
    places = grid()
    assert len(find_markers(drawn(places, noise=0.008)).px) == len(places)


@pytest.mark.parametrize("radius", [2.5, 4.0, 9.0])
def test_the_radius_is_found_from_the_image(radius):
    found = find_markers(drawn(grid(pitch=6 * radius), radius=radius))
    assert found.radius_px == pytest.approx(radius, rel=0.12)


def test_a_marker_that_the_border_cuts_to_a_sliver_is_left_out_and_one_cut_slightly_is_told():
    places = np.array([[-3.0, 100.0], [100.0, 100.0], [200.0, 237.0]])
    found = find_markers(drawn(places), radius_px=5.8)
    assert len(found.px) == 2
    assert found.inside[0] == 1.0 and 0.6 < found.inside[1] < 1.0


def test_markers_are_followed_to_the_nearest_and_lost_beyond_the_limit():
    rest = np.array([[10.0, 10.0], [40.0, 10.0], [70.0, 10.0]])
    now = np.array([[41.0, 12.0], [13.0, 10.0], [85.0, 10.0]])
    places = track(rest, now, limit_px=8.0)
    assert np.array_equal(places[:2], [[13.0, 10.0], [41.0, 12.0]]) and np.isnan(places[2]).all()


def test_two_markers_never_take_the_same_place():
    places = track(np.array([[0.0, 0.0], [6.0, 0.0]]), np.array([[5.0, 0.0]]), limit_px=10.0)
    assert np.isnan(places[0]).all() and np.array_equal(places[1], [5.0, 0.0])


def test_an_image_without_markers_is_refused_in_a_sentence():
    with pytest.raises(InputError, match="shows no marker of radius"):
        find_markers(drawn(np.zeros((0, 2)), noise=0.008), radius_px=5.8)


def test_a_limit_that_is_no_length_is_refused():
    with pytest.raises(InputError, match="limit_px is 0"):
        track(np.zeros((1, 2)), np.zeros((1, 2)), limit_px=0)


@pytest.mark.parametrize(("image", "radius", "said"), [
    (np.full((12, 12), 200.0), None, r"shape \(12, 12\) shows no markers; .* 17 pixels a side at least"),
    (np.zeros((40, 40, 5)), None, r"shape \(40, 40, 5\) shows no markers"),
    (np.where(np.arange(1600).reshape(40, 40) == 83, np.nan, 200.0), None, r"not finite numbers, the first at .* \(2, 3\)"),
    *((np.full((40, 40), 200.0), radius, "radius_px is .*; give that of a marker in px, from 1 to half")
      for radius in (0.0, -3.0, np.nan, np.inf, 21.0))])
def test_an_image_or_a_radius_that_no_marker_has_is_refused_in_a_sentence(image, radius, said):
    with pytest.raises(InputError, match=said):
        find_markers(image, radius_px=radius)


def test_the_smallest_image_is_searched():
    assert len(find_markers(drawn([(8.0, 8.0)], radius=2.5, shape=(17, 17))).px) == 1


@pytest.mark.parametrize("colours", [1, 3])
def test_alpha_is_no_light(colours):
    image = drawn(grid())[..., :colours]
    alpha = np.full((*image.shape[:2], 1), 255, dtype=np.uint8)
    assert np.array_equal(find_markers(np.dstack([image, alpha])).contrast, find_markers(image).contrast)


@pytest.mark.parametrize("channels", [0, slice(None)])
def test_a_picture_of_16_bits_has_the_grey_levels_of_that_of_8(channels, tmp_path):
    levels = drawn(grid())[..., channels]
    (tmp_path / "a.png").write_bytes(imagecodecs.png_encode(levels.astype(np.uint16) * 257))
    tifffile.imwrite(tmp_path / "a.tif", levels.astype(np.uint16) * 257)
    for name in ("a.png", "a.tif"):
        read = read_image(tmp_path / name)
        assert read.dtype == np.uint8 and np.array_equal(read, np.dstack([levels] * 3) if levels.ndim == 2 else levels)


def test_a_picture_is_read_upright_without_alpha_and_as_it_is_stored(tmp_path):
    levels, exif = drawn(grid()), Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.dstack([levels, levels[..., :1]])).save(tmp_path / "a.png", exif=exif)
    Image.fromarray(levels[..., 0]).convert("LA").save(tmp_path / "la.png")
    Image.fromarray(levels[..., 0] > 100).save(tmp_path / "mask.png")
    assert np.array_equal(read_image(tmp_path / "a.png"), np.rot90(levels, -1))
    assert np.array_equal(read_image(tmp_path / "la.png"), np.dstack([levels[..., 0]] * 3))
    assert np.array_equal(read_image(tmp_path / "mask.png")[..., 1], np.where(levels[..., 0] > 100, 255, 0))


def test_a_picture_of_8_bits_needs_pillow_alone_and_others_name_what_they_need(tmp_path, monkeypatch):
    levels = drawn(grid())
    Image.fromarray(levels).save(tmp_path / "a.png")
    Image.fromarray(levels).save(tmp_path / "a.tif")
    (tmp_path / "deep.png").write_bytes(imagecodecs.png_encode(levels.astype(np.uint16) * 257))
    for package in ("tifffile", "imagecodecs"):
        monkeypatch.setitem(sys.modules, package, None)
    assert np.array_equal(read_image(tmp_path / "a.png"), levels)
    for name, package in (("a.tif", "tifffile"), ("deep.png", "imagecodecs")):
        with pytest.raises(InputError, match=rf"{name}: This needs {package}, .*pip install 'softtact\[optics\]'"):
            read_image(tmp_path / name)


@pytest.mark.parametrize(("values", "said"), [(np.full((40, 40), 1000, np.uint16), "a.tif: its values end at 1000 of the 65535"),
                                              (np.full((40, 40), 0.5, np.float32), "a.tif: its values are float32, not grey")])
def test_a_picture_whose_grey_levels_eight_bits_do_not_hold_is_refused(values, said, tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", values)
    with pytest.raises(InputError, match=said):
        read_image(tmp_path / "a.tif")


def test_a_file_that_is_no_image_is_named(tmp_path):
    (tmp_path / "a.png").write_text("no picture")
    with pytest.raises(InputError, match="a.png: not a readable image"):
        read_image(tmp_path / "a.png")


@pytest.mark.skipif(not REAL.exists(), reason="the real gel's picture is not at hand")
def test_all_99_markers_of_a_real_gel_are_found_and_no_other():
    labelled = np.loadtxt(REAL / "marker_dilate.csv", delimiter=",", skiprows=1)
    found = find_markers(read_image(REAL / "marker_dilate.png"))
    near = track(labelled[:, :2] + labelled[:, 2:], found.px, limit_px=8.0)
    assert len(found.px) == 99 and not np.isnan(near).any()
    assert found.contrast.min() > FAINTEST
