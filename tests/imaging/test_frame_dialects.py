"""Files of frames in every dialect: the discs are those of the frame. Damaged files are refused, or read the same."""

import io
import warnings
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from softtact.errors import FrameWarning, InputError
from softtact.imaging.discs import detect_discs
from softtact.imaging.frames import Camera, render_frame
from softtact.imaging.reading import read_frames

FOOTPRINT = (64, 48)
quick = settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])


def light(seed):
    """Light (rows, columns) from 0 to 1 of two discs of random place and size, and the frame in 8 bits."""
    rng = np.random.default_rng(seed)
    x, y = np.array([-15.0, 15.0]) + rng.uniform(-4, 4, 2), rng.uniform(-8, 8, 2)
    camera = Camera(1.0, 1.0, noise=0.01, falloff=0.1)
    frame = render_frame(x, y, rng.uniform(100, 300, 2), camera, footprint_mm=FOOTPRINT, seed=seed)
    return frame / 255.0, frame


def areas(frame):
    return sorted(detect_discs(frame, pixel_mm=1.0).area_mm2)


def pillow(picture, form, **how):
    content = io.BytesIO()
    picture.save(content, form, **how)
    return content.getvalue()


def tiff(values, **how):
    content = io.BytesIO()
    tifffile.imwrite(content, values, **({"photometric": "minisblack"} | how))
    return content.getvalue()


def deep(values):
    """A PNG with 16 bits a channel."""
    import imagecodecs

    return imagecodecs.png_encode(values)


def colours(frame, count=3):
    return np.dstack([frame] * 3 + [np.full_like(frame, np.iinfo(frame.dtype).max)] * (count - 3))


def bits(share, count):
    return np.round(share * (2**count - 1)).astype(np.uint16)


RAMP = np.tile(np.arange(256, dtype=np.uint16)[::-1] * 257, (3, 1))
DIALECTS = {
    "png": lambda s, f: [("png", pillow(Image.fromarray(f), "PNG")), ("png", pillow(Image.fromarray(colours(f, 4)), "PNG"))],
    "png16": lambda s, f: [("png", deep(bits(s, count))) for count in (10, 12, 16)],
    "png16 colours": lambda s, f: [("png", deep(colours(bits(s, 10)))), ("png", deep(colours(bits(s, 12), 4)))],
    "png palette": lambda s, f: [("png", pillow(Image.fromarray(colours(f)).quantize(256), "PNG"))],
    "bmp": lambda s, f: [("bmp", pillow(Image.fromarray(f), "BMP")), ("bmp", pillow(Image.fromarray(colours(f)), "BMP"))],
    "gif": lambda s, f: [("gif", pillow(Image.fromarray(f), "GIF"))],
    "jpeg": lambda s, f: [("jpg", pillow(Image.fromarray(colours(f)).convert(mode), "JPEG", quality=100))
                          for mode in ("L", "RGB", "CMYK")],
    "tiff": lambda s, f: [("tif", tiff(f, compression=name)) for name in (None, "lzw", "zlib", "zstd", "packbits")],
    "tiff big": lambda s, f: [("tif", tiff(f, bigtiff=True)), ("tiff", tiff(bits(s, 12), byteorder=">"))],
    "tiff signed": lambda s, f: [("tif", tiff(bits(s, 12).astype(np.int16) - 2048))],
    "tiff float": lambda s, f: [("tif", tiff((scale * s).astype(np.float32))) for scale in (0.01, 1, 255)],
    "tiff white is zero": lambda s, f: [("tif", tiff(255 - f, photometric="miniswhite")),
                                        ("tif", tiff(65535 - bits(s, 10), photometric="miniswhite"))],
    "tiff colours": lambda s, f: [("tif", tiff(colours(f, 4), photometric="rgb", extrasamples=["unassalpha"])),
                                  ("tif", tiff(colours(bits(s, 12)).transpose(2, 0, 1), photometric="rgb",
                                               planarconfig="separate"))],
    "tiff palette": lambda s, f: [("tif", tiff(255 - f, photometric="palette", colormap=RAMP))],
    "tiff inks": lambda s, f: [("tif", tiff(255 - colours(f, 4), photometric="separated"))],
}


@pytest.mark.slow
@quick
@given(name=st.sampled_from(sorted(DIALECTS)), seed=st.integers(0, 99))
@pytest.mark.filterwarnings("error")
def test_each_dialect_gives_the_discs_of_the_frame(name, seed, tmp_path):
    share, frame = light(seed)
    for ending, content in DIALECTS[name](share, frame):
        file = tmp_path / f"frame.{ending}"
        file.write_bytes(content)
        ((_, read),) = read_frames(file)
        assert areas(read) == pytest.approx(areas(frame), rel=0.02), (name, ending)


WHOLE = [(ending, content) for name in ("png", "png16 colours", "png palette", "tiff", "tiff big", "gif")
         for ending, content in DIALECTS[name](*light(0))]


@quick
@given(which=st.sampled_from(WHOLE), cut=st.floats(0, 1), tail=st.binary(max_size=8))
def test_a_file_that_was_cut_off_or_goes_on_is_refused_in_one_sentence_or_read_the_same(which, cut, tail, tmp_path):
    ending, content = which
    same, read = _frames_or_refusal(tmp_path / f"whole.{ending}", content), None
    for damaged in (content[:int(cut * len(content))], content + tail):
        read = _frames_or_refusal(tmp_path / f"damaged.{ending}", damaged)
        assert isinstance(read, str) or np.array_equal(read, same)
    assert not isinstance(read, str), "what stands behind the picture does not matter"


@quick
@given(place=st.floats(0, 1), value=st.integers(0, 255))
def test_a_png_with_a_wrong_byte_is_refused_or_read_the_same(place, value, tmp_path):
    for ending, content in WHOLE[:4]:
        damaged = bytearray(content)
        damaged[int(place * (len(content) - 1))] = value
        read = _frames_or_refusal(tmp_path / f"damaged.{ending}", bytes(damaged))
        assert isinstance(read, str) or np.array_equal(read, _frames_or_refusal(tmp_path / f"whole.{ending}", content))


def _frames_or_refusal(file: Path, content):
    """What a file's frames hold, or the sentence that refuses it."""
    file.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", FrameWarning)
            return np.stack([frame for _, frame in read_frames(file)])
    except InputError as error:
        assert str(error).startswith(f"{file}: ") and "\n" not in str(error)
        return str(error)
