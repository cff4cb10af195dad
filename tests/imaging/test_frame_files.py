"""What a file of frames holds: stacks without directories, several series, turned pictures, deep videos; what is refused."""

import warnings

import numpy as np
import pytest
import tifffile
from PIL import Image

from softtact.cli import main
from softtact.errors import FrameWarning, InputError
from softtact.imaging.reading import is_lossy, read_frames

STACK = np.random.default_rng(0).integers(0, 1023, (5, 32, 48), dtype=np.uint16)
TINY = (STACK >> 2).astype(np.uint8)
TURNED = {1: lambda a: a, 2: np.fliplr, 3: lambda a: np.rot90(a, 2), 4: np.flipud, 5: np.transpose, 6: lambda a: np.rot90(a, -1),
          7: lambda a: np.rot90(a, 2).T, 8: np.rot90}


def frames_of(file):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return list(read_frames(file))


def refusal(file):
    with pytest.raises(InputError) as raised:
        frames_of(file)
    assert str(raised.value).startswith(f"{file}: ") and "\n" not in str(raised.value)
    return str(raised.value)


@pytest.mark.parametrize("how", [
    pytest.param({"imagej": True, "truncate": True}, id="ImageJ, one directory"),
    pytest.param({"imagej": True, "metadata": {"axes": "ZYX"}}, id="ImageJ"),
    pytest.param({"truncate": True, "byteorder": ">", "photometric": "minisblack"}, id="one directory, large end first"),
    pytest.param({"ome": True, "metadata": {"axes": "TYX"}}, id="OME"),
    pytest.param({"bigtiff": True, "photometric": "minisblack", "compression": "zlib", "tile": (16, 16)}, id="BigTIFF in tiles"),
])
def test_all_frames_of_a_stack_are_read_however_its_directories_are_kept(how, tmp_path):
    tifffile.imwrite(tmp_path / "stack.tif", STACK, **how)
    names, frames = zip(*frames_of(tmp_path / "stack.tif"), strict=True)
    assert names == tuple(f"stack.tif:{k:05d}" for k in range(5)) and np.array_equal(frames, STACK)


def test_the_series_of_a_file_follow_each_other_and_reduced_copies_are_no_frames(tmp_path):
    with tifffile.TiffWriter(tmp_path / "series.tif") as file:
        file.write(TINY[0, ::2, ::2], subfiletype=1)
        file.write(TINY[:2], photometric="minisblack")
        file.write(STACK[:2], subifds=1, photometric="minisblack")
        file.write(STACK[:2, ::2, ::2], subfiletype=1, photometric="minisblack")
    frames = [frame for _, frame in frames_of(tmp_path / "series.tif")]
    assert [frame.dtype for frame in frames] == ["u1", "u1", "u2", "u2"] and np.array_equal(frames[3], STACK[1])


@pytest.mark.parametrize(("name", "lossy"), [
    ("frame_2024-01-01T12:00:00.jpg", True), ("frame_12:00:00.png", False), ("clip.mp4:00012", True), ("clip.MP4:123456", True),
    ("12:00.avi:00003", True), ("stack.tif:00001", False)])
def test_a_frame_is_known_as_compressed_by_the_ending_of_its_file_whatever_colons_its_name_has(name, lossy):
    assert is_lossy(name) == lossy


@pytest.mark.parametrize("orientation", TURNED)
def test_a_picture_is_turned_as_its_file_says(orientation, tmp_path):
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(TINY[0]).save(tmp_path / "a.png", exif=exif)
    tifffile.imwrite(tmp_path / "a.tif", TINY[0], extratags=[(274, "H", 1, orientation, True)])
    for name in ("a.png", "a.tif"):
        assert np.array_equal(frames_of(tmp_path / name)[0][1], TURNED[orientation](TINY[0])), name


def test_every_frame_of_an_animated_png_is_one_and_a_phones_second_picture_is_none(tmp_path):
    pictures = [Image.fromarray(frame) for frame in TINY]
    pictures[0].save(tmp_path / "a.png", save_all=True, append_images=pictures[1:])
    assert np.array_equal([frame for _, frame in frames_of(tmp_path / "a.png")], TINY)
    pictures[0].save(tmp_path / "a.jpg", format="MPO", save_all=True, append_images=pictures[1:])
    assert [name for name, _ in frames_of(tmp_path / "a.jpg")] == ["a.jpg"]


def video(path, codec, pixels, frames, form):
    """A video without loss of `frames` in PyAV's format `form`."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=10)
        stream.height, stream.width, stream.pix_fmt = *frames[0].shape[:2], pixels
        for packet in [p for frame in frames for p in stream.encode(av.VideoFrame.from_ndarray(frame, format=form))]:
            container.mux(packet)
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize(("pixels", "frames"), [
    ("gray16le", list(STACK << 6)), ("rgb48le", [np.dstack([frame] * 3) << 6 for frame in STACK]),
    ("gray", list(TINY)),
])
def test_a_video_keeps_its_depth(pixels, frames, tmp_path):
    read = [frame for _, frame in frames_of(video(tmp_path / "v.mkv", "ffv1", pixels, frames, pixels))]
    wanted = [np.dstack([frame] * 3) if pixels == "gray" else frame for frame in frames]
    assert np.array_equal(read, wanted)


@pytest.mark.parametrize(("name", "codec"), [("v.mkv", "ffv1"), ("v.avi", "ffv1"), ("v.avi", "rawvideo")])
def test_a_video_that_was_cut_off_is_refused_and_not_read_up_to_there(name, codec, tmp_path):
    file = video(tmp_path / name, codec, "gray", list(np.tile(TINY, (8, 1, 1))), "gray")
    content = file.read_bytes()
    file.write_bytes(content[:len(content) * 6 // 10])
    assert "not a readable video" in refusal(file)


@pytest.mark.parametrize(("values", "how", "said"), [
    pytest.param(np.dstack([TINY[0]] * 5), {"photometric": "minisblack", "planarconfig": "contig"}, "no stated meaning",
                 id="bands"),
    pytest.param(np.dstack([TINY[0]] * 3), {"photometric": "ycbcr"}, "its photometric interpretation YCBCR", id="YCbCr"),
    pytest.param(np.tile(TINY[:, :16, :16], (4, 1, 1))[:16], {"volumetric": True, "tile": (16, 16, 16)},
                 "in an unknown layout", id="volume"),
])
def test_a_tiff_whose_values_are_no_light_is_refused(values, how, said, tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", values, **how)
    assert said in refusal(tmp_path / "a.tif")


def test_pages_of_different_sizes_are_refused_for_they_have_no_common_scale(tmp_path):
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        file.write(TINY[0])
        file.write(TINY[0, :16])
    assert "its pages differ in size, 48 x 16, 48 x 32" in refusal(tmp_path / "a.tif")


@pytest.mark.parametrize("cut", [1, 2000])
def test_a_stack_whose_last_planes_are_missing_is_refused(cut, tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", STACK, imagej=True, truncate=True)
    (tmp_path / "a.tif").write_bytes((tmp_path / "a.tif").read_bytes()[:-cut])
    assert "invalid or corrupted" in refusal(tmp_path / "a.tif")


def test_a_frame_too_large_for_the_memory_is_refused_before_it_is_read(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", shape=(20000, 20000), dtype=np.uint8)
    Image.new("1", (11000, 11000)).save(tmp_path / "a.png")
    for name in ("a.tif", "a.png"):
        assert "larger than 100 million pixels; crop it" in refusal(tmp_path / name), name


def test_a_file_that_says_that_it_is_encoded_for_a_screen_gives_a_warning_until_the_user_decides(tmp_path, capsys):
    Image.fromarray(TINY[0]).save(tmp_path / "a.png", icc_profile=b"a profile")
    with pytest.warns(FrameWarning, match="--transfer srgb"):
        list(read_frames(tmp_path / "a.png"))
    line = ["detect-discs", str(tmp_path / "a.png"), "--pixel-mm", "1", "--out", str(tmp_path / "d.csv"), "--no-picture"]
    for choice, warned in (([], True), (["--transfer", "srgb"], False), (["--transfer", "linear"], False)):
        assert main([*line, *choice]) == 0
        assert ("a.png: the file says that its values are encoded" in capsys.readouterr().err) == warned
