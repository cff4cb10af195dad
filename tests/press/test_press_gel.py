"""`softtact press` on a gel with a camera: image, movie, what is printed, and what is refused."""

import json

import numpy as np
import pytest
import trimesh
import yaml
from PIL import Image
from support.gels import gel_values

import softtact
from softtact.cli import main

MOTION = "z -0.4; x 0.5 in 3"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A ball, and a gel of few points and pixels."""
    path = tmp_path_factory.mktemp("gel")
    trimesh.creation.icosphere(subdivisions=3, radius=4.0).export(path / "ball.stl")
    values = gel_values(pixels=[64, 64], mm_per_px=0.25, markers={"rows": 5, "columns": 5, "pitch_mm": 2.5, "radius_mm": 0.5})
    (path / "gel.yaml").write_text(yaml.safe_dump(values | {"name": "gel", "map_shape": [65, 65]}))
    return path


@pytest.fixture(scope="module")
def summary(folder):
    """Of one press that wrote all files."""
    import contextlib
    import io

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert press(folder, "--json", "--image", folder / "out.png", "--movie", folder / "out.gif", "--plot", folder / "plot.png",
                     "--out", folder / "press.nc") == 0
    return json.loads(printed.getvalue())


def press(folder, *options, sensor="gel.yaml"):
    sensor = str(folder / sensor) if sensor.endswith(".yaml") else sensor
    return main(["press", str(folder / "ball.stl"), "--unit", "mm", "--sensor", sensor, "--motion", MOTION, *map(str, options)])


def test_the_image_is_that_of_the_last_step(folder, summary):
    result = softtact.read_press(folder / "press.nc")
    image = np.asarray(Image.open(folder / "out.png"))
    assert image.shape == (64, 64, 3) and np.array_equal(image, result.readings["camera"].values[-1])


def test_the_movie_begins_with_the_untouched_gel_and_has_a_frame_for_each_step(folder, summary):
    with Image.open(folder / "out.gif") as movie:
        assert movie.n_frames == 5
        first = np.asarray(movie.convert("RGB")).astype(int)
    markers_of_rest = softtact.read_press(folder / "press.nc").readings["markers"]
    x, y = (int(round(float(markers_of_rest[name].values[12]))) for name in ("rest_x_px", "rest_y_px"))
    assert first[y, x].max() < 60 and np.abs(first[2, 2] - [130, 135, 140]).max() < 12


def test_numbers_for_people_hold_slip_and_motion_of_markers_and_no_images(folder, summary):
    result = softtact.read_press(folder / "press.nc")
    moved = result.readings["markers"]
    rest = np.column_stack([moved.rest_x_px, moved.rest_y_px])
    assert summary["marker_motion_most_px"] == pytest.approx(np.linalg.norm(moved.values - rest, axis=2).max(axis=1))
    assert summary["slipping_share"] == pytest.approx(list(result.slipping_share))
    assert set(summary["readings"]) == {"markers"}
    assert {str(folder / name) for name in ("out.png", "out.gif", "plot.png", "press.nc")} == set(summary["written"])


def test_more_of_the_contact_slips_the_farther_the_ball_is_moved(summary):
    shares = summary["slipping_share"]
    assert shares[0] < 0.2 < shares[1] < shares[2] and shares[3] == 1.0


def test_the_table_shows_force_depth_slip_and_markers(folder, capsys):
    assert press(folder) == 0
    printed = capsys.readouterr().out
    assert "slipping" in printed and "markers moved, px (mean, most)" in printed and "counts" not in printed
    rows = [line.split() for line in printed.splitlines() if line.lstrip()[:2] in ("0.", "-0") or line.strip().endswith("%")]
    assert len(rows) == 4 and rows[-1][5] == "100%" and float(rows[-1][3]) == pytest.approx(0.4)


def test_the_picture_of_a_press_shows_image_and_depth(folder, summary):
    with Image.open(folder / "plot.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    yellow = (pixels[:, 0] > 200) & (pixels[:, 1] > 200) & (pixels[:, 2] < 90)
    assert yellow.sum() > 100      # the arrows


@pytest.mark.parametrize(("options", "sensor", "sentence"), [
    (["--image", "out.png"], "sheet", "--image out.png: sheet has no readout of the kind camera; take a gel such as gelsight_mini"),
    (["--image", "out.jpg"], "gel.yaml", "out.jpg: the file is written as .png"),
    (["--movie", "out.avi"], "gel.yaml", "out.avi: the file is written as .mp4 or .gif"),
    (["--image", "missing/out.png"], "gel.yaml", "missing/out.png: there is no folder missing")])
def test_images_that_cannot_be_written_are_refused_before_the_press(folder, capsys, options, sensor, sentence):
    assert press(folder, *options, sensor=sensor) == 1
    complained = capsys.readouterr().err
    assert sentence in complained and complained.count("\n") == 1
