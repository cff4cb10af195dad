"""The light in a frame's values: any depth, sign, offset, encoding and faulty pixel gives the discs of the plain 8-bit frame."""

import imageio.v3 as iio
import numpy as np
import pytest

from softtact.errors import FrameWarning, InputError
from softtact.imaging.discs import detect_discs
from softtact.imaging.frames import Camera, render_frame
from softtact.imaging.light import grey

AREAS = [140.0, 260.0]
FRAME = render_frame([-13.2, 11.3], [4.1, -3.7], AREAS, Camera(1.0, 1.0, noise=0.01, falloff=0.1), footprint_mm=(64, 48), seed=0)
SHARE = FRAME / 255.0
MASK = SHARE > 0.4


def whole(bits, dtype=np.uint16):
    return np.round(SHARE * (2**bits - 1)).astype(dtype)


def with_faulty(frame, value, count=1):
    """The frame with `count` pixels of one value between the discs and beside them."""
    frame = frame.copy()
    frame[np.linspace(3, 44, count).astype(int), np.linspace(30, 33, count).astype(int)] = value
    return frame


def srgb(share):
    return np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)


def areas(frame, **how):
    return sorted(detect_discs(frame, pixel_mm=1.0, **how).area_mm2)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("frame", [
    pytest.param(whole(10), id="10 bits in 16"),
    pytest.param(np.dstack([whole(12)] * 3), id="12 bits in 16, RGB"),
    pytest.param(whole(12).astype(np.int16) - 2048, id="signed"),
    pytest.param(whole(10) + 64000, id="a large offset"),
    pytest.param(whole(30, np.uint32), id="32 bits"),
    pytest.param(with_faulty(whole(10), 65535), id="a hot pixel of full scale"),
    pytest.param(with_faulty(whole(10), 65535, count=20), id="hot pixels"),
    pytest.param(np.where(np.arange(64) == 45, 65535, whole(10)), id="a hot column through a disc"),
    pytest.param(with_faulty(whole(10) + 2000, 0), id="a dead pixel below the offset"),
    pytest.param(with_faulty(SHARE, 1e6), id="a hot pixel in floating point"),
    pytest.param((0.01 * SHARE).astype(np.float32), id="floating point to 0.01"),
    pytest.param(1e6 * SHARE - 3e5, id="floating point of any size and sign"),
    pytest.param(whole(10).astype(np.float32), id="counts in floating point"),
    pytest.param(np.dstack([FRAME] * 3 + [np.zeros_like(FRAME)]), id="an alpha channel that nobody filled"),
])
def test_the_numbers_that_a_frame_is_stored_in_do_not_matter(frame):
    assert areas(frame) == pytest.approx(areas(FRAME), rel=0.01) and areas(frame) == pytest.approx(AREAS, rel=0.03)


@pytest.mark.parametrize("place", [np.s_[2:5, 30:33], np.s_[44:47, 4:40]])
def test_a_blot_or_a_bar_laid_over_a_frame_is_left_out_and_said(place):
    frame = whole(10)
    frame[place] = 65535
    with pytest.warns(FrameWarning, match="times as bright as all others"):
        assert areas(frame) == pytest.approx(areas(FRAME), rel=0.02)


@pytest.mark.parametrize("frame", [MASK.astype(np.uint8), MASK, MASK.astype(np.int32) * 3 + 2, MASK.astype(float) * 1e-4])
def test_a_mask_of_any_two_values_is_one_of_0_and_1(frame):
    assert np.array_equal(grey(frame), MASK)
    assert areas(frame) == pytest.approx(AREAS, rel=0.04)     # pixels that are in or out: no light at the edge


def test_values_that_are_encoded_for_a_screen_give_the_areas_of_their_light():
    encoded = np.round(255 * srgb(SHARE)).astype(np.uint8)
    assert areas(encoded, transfer="srgb") == pytest.approx(areas(FRAME), rel=0.01)
    assert min(np.divide(areas(encoded), AREAS)) > 1.05      # what reading them as light costs
    with pytest.raises(InputError, match="transfer='gamma'"):
        grey(FRAME, transfer="gamma")


def test_light_that_alpha_holds_back_does_not_count():
    with pytest.warns(FrameWarning, match="transparent"):
        assert areas(np.dstack([np.full_like(FRAME, 255)] * 3 + [FRAME])) == pytest.approx(areas(FRAME), rel=0.01)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("transfer", ["linear", "srgb"])
@pytest.mark.parametrize(("noise", "background"), [(0.002, 0.03), (0.004, 0.0), (0.008, 0.055), (0.02, 0.1)])
def test_what_compression_leaves_in_a_dark_frame_is_neither_a_mask_nor_a_contact(noise, background, transfer):
    dark = render_frame([], [], [], Camera(1.0, 1.0, noise=noise, falloff=0.0, background=background),
                        footprint_mm=(200, 150), seed=0)
    packed = iio.imread(iio.imwrite("<bytes>", dark, extension=".jpg", quality=75), extension=".jpg")
    for frame in (packed, packed.astype(np.uint16) << 8):
        assert detect_discs(frame, pixel_mm=1.0, transfer=transfer, lossy=True).empty
        assert grey(frame, transfer=transfer, lossy=True).max() <= 1


@pytest.mark.parametrize("frame", [
    pytest.param(np.round(255 * srgb(0.04 * SHARE)).astype(np.uint8), id="8 bits"),
    pytest.param(np.round(255 * srgb(0.04 * SHARE)).astype(np.uint16), id="8 bits in 16")])
def test_a_dark_frame_encoded_for_a_screen_keeps_its_full_scale(frame):
    assert grey(frame, transfer="srgb").max() == pytest.approx(0.04 * SHARE.max(), rel=0.1)


@pytest.mark.parametrize(("frame", "said"), [
    pytest.param((SHARE * 6).astype(np.uint8), "there are edges", id="too faint"),
    pytest.param(255 - FRAME, "invert the frame", id="dark discs on bright ground"),
])
def test_a_frame_whose_discs_are_not_found_though_there_is_contrast_gives_a_warning(frame, said):
    with pytest.warns(FrameWarning, match=said):
        detect_discs(frame, pixel_mm=1.0)
