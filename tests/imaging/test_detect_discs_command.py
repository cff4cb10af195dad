"""`softtact detect-discs` on a user's files: what it writes, and how it refuses."""

import json

import imageio.v3 as iio
import numpy as np
import pandas as pd
import pytest
import tifffile

from softtact.cli import main
from softtact.imaging.frames import Camera, render_frame
from softtact.imaging.reading import read_frame, read_frames

PIXEL_MM = 0.05
AREAS = (0.0, 0.2, 0.4)   # of both discs in one frame after the other


def frame(area, *, seed=0):
    return render_frame([-0.8, 0.8], [0.2, -0.2], [area, area], Camera(PIXEL_MM, blur_mm=0.05, noise=0.02, falloff=0.2),
                        footprint_mm=(4.0, 3.2), seed=seed)


@pytest.fixture
def folder(tmp_path):
    """A folder of three frames, and a file that is none."""
    frames = tmp_path / "frames"
    frames.mkdir()
    for k, area in enumerate(AREAS):
        iio.imwrite(frames / f"press_{k}.png", frame(area, seed=k))
    (frames / "notes.txt").write_text("not a frame")
    return frames


def video(path, **how):
    """The same frames as a video or a stack."""
    frames = np.stack([frame(area, seed=k) for k, area in enumerate(AREAS)])
    if path.suffix == ".tif":
        tifffile.imwrite(path, frames, photometric="minisblack")
    else:
        iio.imwrite(path, frames if not how else np.repeat(frames[..., None], 3, axis=3), **how)
    return path


def answer(capsys, *arguments):
    """Summary of a command that must succeed."""
    assert main(["detect-discs", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def refusal(capsys, *arguments):
    """The one sentence of a command that must refuse."""
    assert main(["detect-discs", *map(str, arguments)]) == 1
    said = capsys.readouterr()
    sentences = [line for line in said.err.splitlines() if not line.startswith("discs in frames:")]   # the progress
    assert said.out == "" and len(sentences) == 1
    return sentences[0]


def test_a_folder_gives_one_table_and_a_picture_of_each_frame(folder, tmp_path, capsys):
    summary = answer(capsys, folder, "--out", tmp_path / "discs.csv", "--pixel-mm", PIXEL_MM)
    table = pd.read_csv(tmp_path / "discs.csv")
    assert [row["discs"] for row in summary["frames"]] == [0, 2, 2]
    assert table.columns[0] == "frame" and set(table.frame) == {"press_1.png", "press_2.png"}
    assert table.groupby("frame").area_mm2.mean().to_numpy() == pytest.approx([0.2, 0.4], rel=0.02)
    pictures = sorted((tmp_path / "discs").iterdir())
    assert [picture.name for picture in pictures] == [f"press_{k}.png" for k in range(3)]
    assert iio.imread(pictures[1]).std() > 10


def test_a_folder_of_pictures_is_made_with_those_above_it(folder, tmp_path, capsys, monkeypatch):
    for picture in (tmp_path / "new/nested/pictures", "other/pictures"):
        monkeypatch.chdir(tmp_path)
        answer(capsys, folder, "--out", tmp_path / "discs.csv", "--pixel-mm", PIXEL_MM, "--picture", picture)
        assert len(list((tmp_path / picture).iterdir())) == 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["discs.csv", "frames", "new", "other"]


@pytest.mark.filterwarnings("error")
def test_a_frame_with_transparent_parts_is_warned_of_once(tmp_path, capsys):
    grey = frame(0.2)
    iio.imwrite(tmp_path / "a.png", np.dstack([np.full_like(grey, 255)] * 3 + [grey]))
    summary = answer(capsys, tmp_path / "a.png", "--out", tmp_path / "d.csv", "--pixel-mm", PIXEL_MM)
    assert [(names, "transparent" in sentence) for sentence, names in summary["warnings"].items()] == [(["a.png"], True)]


def test_an_empty_frame_is_an_answer_and_not_an_error(folder, tmp_path, capsys):
    summary = answer(capsys, folder / "press_0.png", "--out", tmp_path / "none.csv", "--pixel-mm", PIXEL_MM)
    assert summary["frames"] == [{"frame": "press_0.png", "discs": 0, "mean_area_mm2": None, "total_area_mm2": 0.0, "clipped": 0,
                                  "touching": 0}]
    assert len(pd.read_csv(tmp_path / "none.csv")) == 0 and (tmp_path / "none.png").is_file()


@pytest.mark.slow
def test_the_frames_of_a_video_and_the_pages_of_a_stack_are_measured_one_by_one(tmp_path, capsys):
    for name, how in [
        ("clip.mp4", {"plugin": "pyav", "codec": "libx264", "fps": 10}),
        ("clip.mkv", {"plugin": "pyav", "codec": "libx264", "fps": 10}),
        ("clip.avi", {"plugin": "pyav", "codec": "mpeg4", "fps": 10}),
        ("clip.gif", {}),
        ("clip.tif", {}),
    ]:
        summary = answer(capsys, video(tmp_path / name, **how), "--out", tmp_path / "d.csv", "--pixel-mm", PIXEL_MM, "--no-picture")
        assert [row["frame"] for row in summary["frames"]] == [f"{name}:{k:05d}" for k in range(3)], name
        assert [row["discs"] for row in summary["frames"]] == [0, 2, 2], name
        assert summary["frames"][2]["mean_area_mm2"] == pytest.approx(0.4, rel=0.03), name
        assert not (tmp_path / "d").exists(), name


def test_every_second_frame_is_taken_on_demand(tmp_path, folder):
    assert [name for name, _ in read_frames(video(tmp_path / "clip.tif"), every=2)] == ["clip.tif:00000", "clip.tif:00002"]
    assert [name for name, _ in read_frames(folder, every=2)] == ["press_0.png", "press_2.png"]


def test_a_long_stack_is_not_read_before_its_first_frame_is_asked_for(tmp_path, monkeypatch):
    read = []
    asarray = tifffile.TiffPage.asarray
    monkeypatch.setattr(tifffile.TiffPage, "asarray", lambda page: read.append(page.index) or asarray(page))
    pages = np.random.default_rng(0).integers(0, 255, (50, 32, 32), dtype=np.uint8)
    tifffile.imwrite(tmp_path / "long.tif", pages, compression="zlib")
    name, first = next(read_frames(tmp_path / "long.tif"))
    assert name == "long.tif:00000" and np.array_equal(first, pages[0]) and len(read) <= 1


def test_a_calibration_length_gives_the_same_as_the_pixel_that_follows_from_it(folder, tmp_path, capsys):
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    answer(capsys, folder / "press_2.png", "--out", one, "--pixel-mm", PIXEL_MM, "--no-picture")
    summary = answer(capsys, folder / "press_2.png", "--out", two, "--calibration-mm", 10, "--calibration-px", 200, "--no-picture")
    assert summary["pixel_mm"] == pytest.approx(PIXEL_MM)
    assert one.read_text() == two.read_text()


def test_the_summary_for_people_names_what_was_written(folder, tmp_path, capsys):
    out = tmp_path / "discs.csv"
    assert main(["detect-discs", str(folder), "--out", str(out), "--pixel-mm", "0.05"]) == 0
    said = capsys.readouterr().out
    assert "frames: 3, discs: 4" in said and f"written: {out}" in said and f"written: {tmp_path / 'discs'}" in said


def test_sixteen_bits_and_colours_are_read_as_they_are(tmp_path):
    deep = frame(0.2).astype(np.uint16) * 257
    iio.imwrite(tmp_path / "deep.png", deep)
    iio.imwrite(tmp_path / "deep.tif", deep)
    assert np.array_equal(read_frame(tmp_path / "deep.png"), deep) and np.array_equal(read_frame(tmp_path / "deep.tif"), deep)
    coloured = np.dstack([deep, deep // 2, deep // 4])
    tifffile.imwrite(tmp_path / "planes.tif", coloured.transpose(2, 0, 1), photometric="rgb", planarconfig="separate")
    assert np.array_equal(read_frame(tmp_path / "planes.tif"), coloured)


def test_the_scale_must_be_given_in_exactly_one_way(folder, tmp_path, capsys):
    for scale in [
        [], ["--calibration-mm", 3], ["--calibration-px", 3], ["--pixel-mm", 0.05, "--calibration-mm", 3],
        ["--pixel-mm", 0.05, "--calibration-mm", 3, "--calibration-px", 60],
    ]:
        assert "give either --pixel-mm, or both" in refusal(capsys, folder, "--out", tmp_path / "d.csv", *scale), scale
        assert not (tmp_path / "d.csv").exists(), scale


def test_a_setting_that_makes_no_sense_is_refused(folder, tmp_path, capsys, monkeypatch):
    for arguments, message in [
        (["--pixel-mm", 0], "--pixel-mm 0"),
        (["--pixel-mm", "nan"], "--pixel-mm nan"),
        (["--calibration-mm", 3, "--calibration-px", -60], "--calibration-px -60"),
        (["--pixel-mm", 0.05, "--every", 0], "--every 0"),
        (["--pixel-mm", 0.05, "--min-diameter-mm", -1], "--min-diameter-mm -1"),
        (["--pixel-mm", 0.05, "--picture", "one.png"], "give --picture a folder"),
    ]:
        monkeypatch.chdir(tmp_path)
        assert message in refusal(capsys, folder, "--out", "d.csv", *arguments), arguments
        assert not (tmp_path / "d.csv").exists(), arguments


def test_a_broken_or_empty_file_is_named_with_the_remedy(tmp_path, capsys):
    for name in ["text.png", "text.jpg", "text.tif", "text.mp4", "text.gif", "text.doc"]:
        for content in [b"", b"this is not a picture\n" * 20]:
            (tmp_path / name).write_bytes(content)
            said = refusal(capsys, tmp_path / name, "--out", tmp_path / "d.csv", "--pixel-mm", 0.05)
            assert f"{name}: not a readable" in said and "save it again" in said, content


def test_half_of_a_file_is_refused(folder, tmp_path, capsys):
    for whole in (folder / "press_1.png", video(tmp_path / "clip.mp4", plugin="pyav", codec="libx264", fps=10)):
        half = tmp_path / f"half{whole.suffix}"
        half.write_bytes(whole.read_bytes()[:whole.stat().st_size // 2])
        assert "half" in refusal(capsys, half, "--out", tmp_path / "d.csv", "--pixel-mm", 0.05)


def test_a_broken_file_among_good_ones_is_named_and_nothing_is_written(folder, tmp_path, capsys):
    (folder / "press_9.png").write_bytes(b"broken")
    before = set(tmp_path.rglob("*"))
    assert "press_9.png: not a readable image" in refusal(capsys, folder, "--out", tmp_path / "d.csv", "--pixel-mm", 0.05)
    assert set(tmp_path.rglob("*")) == before


def test_what_is_not_there_or_holds_no_frames_is_refused(tmp_path, capsys):
    out = ["--out", tmp_path / "d.csv", "--pixel-mm", 0.05]
    assert "no such file or folder" in refusal(capsys, tmp_path / "none.png", *out)
    assert "the folder holds no PNG" in refusal(capsys, tmp_path, *out)
    assert "there is no folder" in refusal(capsys, tmp_path, "--out", tmp_path / "no" / "d.csv", "--pixel-mm", 0.05)
