"""Calibration of a gel's camera, on images drawn with a known shading, scale and circles; what is refused; the command."""

import json

import numpy as np
import pytest
import yaml
from PIL import Image

import softtact
from softtact.calibration.camera import calibrate_camera, find_contact, read_presses
from softtact.cli import main
from softtact.errors import InputError
from softtact.imaging.ball_presses import Gel, ball_slopes
from softtact.imaging.shading import PhongShading

ROWS, COLUMNS = 120, 160
BALL_PX, SCALE = 40.0, 0.1       # a ball of 8 mm in diameter
GEL = Gel(BALL_PX, thickness_px=40.0)
TRUTH = PhongShading((COLUMNS, ROWS), np.array([[120.0, 130.0, 140.0]]), azimuth_rad=np.array([0.0, 2.1, 4.2]),
                     elevation_rad=np.full(3, 0.4), diffuse=np.full(3, 110.0), specular=np.full(3, 10.0), exponent=np.full(3, 3.0))
CIRCLES = [(50.0, 45.0, 16.0), (105.0, 48.5, 20.0), (60.5, 78.0, 22.0), (110.0, 75.0, 14.0), (80.0, 60.0, 18.0), (95.0, 66.0, 12.0)]
Y, X = np.mgrid[:ROWS, :COLUMNS]


def drawn(circle=None, seed=0, squeeze=1.0):
    """An image (rows, columns, 3) uint8 of a ball, squeezed along x to a body that is not round, or of the untouched gel."""
    slopes = np.zeros((ROWS, COLUMNS, 2))
    if circle is not None:
        slopes = ball_slopes((X - circle[0]) * squeeze, Y - circle[1], circle[2], GEL) * [squeeze, 1.0]
    noise = np.random.default_rng(seed).standard_normal((ROWS, COLUMNS, 3))
    return np.clip(np.round(TRUTH.colours(slopes[..., 0], slopes[..., 1], X, Y) + noise), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("presses")
    Image.fromarray(drawn(seed=99)).save(path / "untouched.png")
    for number, circle in enumerate(CIRCLES):
        Image.fromarray(drawn(circle, seed=number)).save(path / f"press_{number}.png")
    return path


@pytest.fixture(scope="module")
def presses(folder):
    return read_presses([folder], folder / "untouched.png", None)


@pytest.mark.parametrize("circle", CIRCLES[:3])
def test_a_contact_is_found_within_two_pixels(circle):
    assert find_contact(drawn(circle), drawn(seed=1)) == pytest.approx(circle, abs=2.0)


def test_the_shading_draws_the_contacts_within_two_grey_levels(presses):
    """The noise of the images alone is 0.8 in the mean of its absolute value, and rounding 0.25."""
    found = calibrate_camera(presses[0][:5], presses[1], ball_mm=8.0, mm_per_px=SCALE, thickness_mm=4.0, kind="quadratic")
    assert found.error_levels < 2.0 and found.ball_px == pytest.approx(BALL_PX) and not found.scale_found
    circles = np.array([[*press.centre_px, press.radius_px] for press in found.presses])
    assert np.abs(circles - CIRCLES[:5]).max() < 1.0


def test_the_scale_is_found_within_a_tenth_from_stated_circles(presses):
    from dataclasses import replace

    stated = [replace(press, centre_px=circle[:2], radius_px=circle[2])
              for press, circle in list(zip(presses[0], CIRCLES, strict=True))[1:4]]
    found = calibrate_camera(stated, presses[1], ball_mm=8.0, thickness_mm=4.0, kind="quadratic", found=False)
    assert found.scale_found and found.mm_per_px == pytest.approx(SCALE, rel=0.1)


def test_of_five_images_the_untouched_gel_is_their_median(folder):
    _, clean = read_presses([folder / f"press_{number}.png" for number in range(6)], None, None)
    assert np.abs(clean.astype(float) - [120, 130, 140]).mean() < 8.0


def test_the_command_writes_a_gel_that_can_be_loaded_and_names_its_files(folder, tmp_path, capsys):
    lines = ["image,centre_x_px,centre_y_px,radius_px"]
    lines += [f"press_{number}.png,{x},{y},{radius}" for number, (x, y, radius) in enumerate(CIRCLES)]
    (tmp_path / "circles.csv").write_text("\n".join(lines))
    status = main(["calibrate-camera", str(folder), "--ball-mm", "8", "--mm-per-px", "0.1", "--shading", "quadratic", "--json",
                   "--background", str(folder / "untouched.png"), "--circles", str(tmp_path / "circles.csv"),
                   "--out", str(tmp_path / "mine.yaml")])
    summary = json.loads(capsys.readouterr().out)
    assert status == 0 and summary["presses"] == 6 and not summary["circles_found"] and summary["error_levels"] < 2.0
    camera = yaml.safe_load((tmp_path / "mine.yaml").read_text())["readouts"]["camera"]
    assert camera["pixels"] == [COLUMNS, ROWS] and camera["shading"] == "mine_shading.yaml" and camera["mm_per_px"] == 0.1
    assert len((tmp_path / "mine.yaml").read_text().splitlines()) < 30
    mine = softtact.load_sensor(tmp_path / "mine.yaml")
    assert mine.spec.name == "mine" and {path.name for path in mine.spec.paths} == {"mine_shading.yaml", "mine_background.png"}


def test_an_image_without_a_contact_is_named(folder, tmp_path):
    Image.fromarray(drawn(seed=7)).save(tmp_path / "nothing.png")
    with pytest.raises(InputError, match="nothing.png: it shows no contact: it differs from the untouched gel by"):
        read_presses([folder, tmp_path / "nothing.png"], folder / "untouched.png", None)


@pytest.mark.parametrize("squeeze", [1.3, 0.75])
def test_a_ball_that_is_not_round_is_refused(squeeze):
    with pytest.raises(InputError, match="is not that of a round ball; press with a ball"):
        find_contact(drawn((80.0, 60.0, 20.0), squeeze=squeeze), drawn(seed=1))


def test_two_contacts_in_one_image_are_refused():
    two = drawn((45.0, 45.0, 14.0)).astype(int) + drawn((115.0, 70.0, 20.0)) - drawn(seed=3)
    with pytest.raises(InputError, match="is not that of a round ball"):
        find_contact(np.clip(two, 0, 255).astype(np.uint8), drawn(seed=1))


def test_images_of_different_size_are_refused(folder, tmp_path):
    Image.fromarray(drawn(CIRCLES[0])[:100]).save(tmp_path / "short.png")
    with pytest.raises(InputError, match=r"short.png: it has 160 x 100 px, and .* 160 x 120 px; take all images with one camera"):
        read_presses([folder, tmp_path / "short.png"], folder / "untouched.png", None)
    with pytest.raises(InputError, match="short.png: it has 160 x 100 px, and the others 160 x 120"):
        read_presses([folder, tmp_path / "short.png"], None, None)


def test_too_few_images_and_a_missing_background_are_told(folder):
    two = [folder / "press_0.png", folder / "press_1.png"]
    with pytest.raises(InputError, match="2 images are too few to fit a shading; give 3 presses or more"):
        read_presses(two, folder / "untouched.png", None)
    with pytest.raises(InputError, match="--background is missing: 3 images are too few to make one of"):
        read_presses([*two, folder / "press_2.png"], None, None)


def test_a_table_without_a_circle_of_an_image_is_refused(folder, tmp_path):
    (tmp_path / "circles.csv").write_text("image,centre_x_px,centre_y_px,radius_px\npress_0.png,50,45,16\n")
    with pytest.raises(InputError, match="circles.csv: it has no row for press_1.png"):
        read_presses([folder], folder / "untouched.png", tmp_path / "circles.csv")


def test_circles_whose_image_is_not_known_are_refused(folder, tmp_path):
    table = tmp_path / "circles.csv"
    table.write_text("image,centre_x_px,centre_y_px,radius_px\n" + "".join(f"press_{k}.png,50,45,16\n" for k in (0, 1, 2, 3, 4, 0)))
    with pytest.raises(InputError, match="circles.csv: press_0.png stands twice, so it is not known whose circle one is"):
        read_presses([folder], folder / "untouched.png", table)
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "press_0.png").write_bytes((folder / "press_0.png").read_bytes())
    with pytest.raises(InputError, match="--circles: press_0.png stands twice"):
        read_presses([folder / "press_0.png", folder / "press_1.png", tmp_path / "more" / "press_0.png"], folder / "untouched.png",
                     circles(tmp_path, 2))


def circles(folder, count):
    path = folder / "circles_of_each.csv"
    path.write_text("image,centre_x_px,centre_y_px,radius_px\n" + "".join(f"press_{k}.png,50,45,16\n" for k in range(count)))
    return path


def test_a_contact_larger_than_the_ball_is_refused_and_nothing_is_written(folder, tmp_path, capsys):
    out = tmp_path / "mine.yaml"
    status = main(["calibrate-camera", str(folder), "--ball-mm", "2", "--mm-per-px", "0.1", "--background",
                   str(folder / "untouched.png"), "--out", str(out)])
    complained = capsys.readouterr().err
    assert status == 1 and "its contact has a radius of" in complained and "correct --ball-mm, --mm-per-px" in complained
    assert complained.count("\n") == 1 and not list(tmp_path.iterdir())


@pytest.mark.parametrize(("arguments", "sentence"), [
    (["--ball-mm", "0"], "--ball-mm 0: a length must be above 0"),
    (["--ball-mm", "8", "--mm-per-px", "-1"], "--mm-per-px -1: a length must be above 0"),
    (["--ball-mm", "8", "--sensor", "sheet"], "--sensor sheet: it is no gel with a readout 'camera'")])
def test_unusable_options_are_refused_before_any_image_is_read(tmp_path, capsys, arguments, sentence):
    status = main(["calibrate-camera", str(tmp_path), "--out", str(tmp_path / "mine.yaml"),
                   *(f"{arguments[k]}={arguments[k + 1]}" for k in range(0, len(arguments), 2))])
    assert status == 1 and sentence in capsys.readouterr().err
