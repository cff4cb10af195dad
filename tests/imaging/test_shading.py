"""Shading models: they find back what drew the images, invert it, and keep their numbers in a file."""

import numpy as np
import pytest
import yaml

from softtact.errors import InputError
from softtact.imaging.ball_presses import BallPress, Gel, joined_samples, refined_circle
from softtact.imaging.shading import PhongShading, QuadraticShading, Shading, SlopeTable, normal_error_deg, slopes_of_colours

PIXELS = (64, 48)
GEL = Gel(ball_px=20.0, thickness_px=30.0)
RNG = np.random.default_rng(3)
BACKGROUND = np.full((48, 64, 3), 120.0) + np.linspace(-20, 20, 64)[None, :, None]
TRUE = QuadraticShading(PIXELS, np.zeros((1, 3)), terms=RNG.normal(0, 1, (5, 3, 3)) * np.array([60, 60, 20, 20, 20])[:, None, None])
LIGHTS = PhongShading(PIXELS, np.zeros((1, 3)), azimuth_rad=np.array([0.0, 2.1, 4.2]), elevation_rad=np.array([0.4, 0.6, 0.5]),
                      diffuse=np.array([80.0, 70, 60]), specular=np.array([20.0, 10, 5]), exponent=np.array([4.0, 6, 8]))


def presses(shading, places=((20, 20), (40, 30), (32, 16), (24, 34)), radius=9.0):
    """Images that a shading draws of a ball at some places."""
    y, x = np.mgrid[:48, :64]
    made = []
    for place in places:
        blank = BallPress(BACKGROUND, BACKGROUND, place, radius)
        slopes = blank.slopes(GEL)
        made.append(BallPress(BACKGROUND + shading.difference(slopes[..., 0], slopes[..., 1], x, y), BACKGROUND, place, radius))
    return made


def fitted(kind, shading, **options):
    return kind.fit(joined_samples(presses(shading), GEL, reach=2.0), PIXELS, BACKGROUND, **options)


@pytest.mark.parametrize(("kind", "true", "tolerance"), [
    (QuadraticShading, TRUE, 0.01), (SlopeTable, TRUE, 0.01), (PhongShading, LIGHTS, 0.05), (SlopeTable, LIGHTS, 1.5)])
def test_a_model_predicts_the_colours_of_a_press_that_it_has_not_seen(kind, true, tolerance):
    model, (new,) = fitted(kind, true), presses(true, places=[(30, 24)])
    samples = new.samples(GEL)
    error = model.difference(samples.slope_x, samples.slope_y, samples.x_px, samples.y_px) - samples.difference
    assert np.abs(error).mean() < tolerance     # grey levels; the table's: curvature within a cell


def test_no_slope_gives_the_background():
    model = fitted(SlopeTable, TRUE)
    assert model.colours(0.0, 0.0, 10.0, 20.0, BACKGROUND[20, 10]) == pytest.approx(BACKGROUND[20, 10], abs=1e-9)
    assert model.background(np.array([10.0]), np.array([20.0]))[0] == pytest.approx(BACKGROUND[20, 10], abs=1e-6)


def test_colours_of_a_known_press_give_its_normals_back():
    (press,) = presses(LIGHTS, places=[(30, 24)])
    samples = press.samples(GEL, reach=1.5, step=2)
    found = slopes_of_colours(LIGHTS, samples.difference, samples.x_px, samples.y_px, np.zeros(3), steepest=0.6)
    error = normal_error_deg(found, np.column_stack([samples.slope_x, samples.slope_y]))
    assert error.max() < 0.5      # degrees; half a spacing of the last grid is 0.1


def test_normals_of_one_tenth_slope_are_an_arc_tangent_apart():
    assert normal_error_deg(np.array([[0.1, 0.0]]), np.zeros((1, 2))) == pytest.approx(np.degrees(np.arctan(0.1)))


def test_the_circle_of_a_press_is_found_from_its_colours():
    (press,) = presses(LIGHTS, places=[(30, 24)])
    wrong = BallPress(press.image, press.background, (32.0, 23.0), 11.0)
    found = refined_circle(wrong, GEL, LIGHTS, step=1)
    assert (*found.centre_px, found.radius_px) == pytest.approx((30, 24, 9), abs=0.05)


def test_a_count_tells_how_many_samples_a_cell_of_the_table_has():
    model = fitted(SlopeTable, TRUE, cells=21)
    assert model.counts.sum() == sum(len(press.samples(GEL, reach=2.0).x_px) for press in presses(TRUE))
    assert model.counts[0, 0] == 0 and model.table[0, 0] == pytest.approx(0)


@pytest.mark.parametrize("kind", [QuadraticShading, SlopeTable, PhongShading])
def test_a_saved_model_is_the_same_when_loaded(kind, tmp_path):
    model = fitted(kind, LIGHTS)
    model.save(tmp_path / "mine.yaml")
    loaded, (x, y) = Shading.load(tmp_path / "mine.yaml"), (np.array([5.0, 60.0]), np.array([40.0, 2.0]))
    assert type(loaded) is kind
    assert loaded.colours(x / 100, -y / 100, x, y) == pytest.approx(model.colours(x / 100, -y / 100, x, y), abs=0.01)


def test_numbers_edited_by_hand_are_noticed(tmp_path):
    file = tmp_path / "mine.yaml"
    fitted(PhongShading, LIGHTS).save(file)
    file.write_text(file.read_text().replace("pixels: [64, 48]", "pixels: [64, 49]"))
    with pytest.raises(InputError, match="field 'digest': the numbers are not those that were written"):
        Shading.load(file)


@pytest.mark.parametrize(("kind", "change", "said"), [
    (PhongShading, {"azimuth_rad": [0.1, 0.2]}, r"azimuth_rad has numbers of shape \(2,\) in place of 3"),
    (PhongShading, {"diffuse": [float("nan"), 1.0, 2.0]}, "diffuse holds nan"),
    (PhongShading, {"exponent": [4.0, 0.0, 4.0]}, "exponent holds 0, which is not above 0"),
    (PhongShading, {"pixels": [640]}, r"pixels has numbers of shape \(1,\) in place of 2"),
    (PhongShading, {"pixels": [0, 480]}, "pixels holds 0, which is not above 0"),
    (PhongShading, {"pixels": [64.5, 48]}, r"pixels are \[64.5, 48.0\], not whole numbers"),
    (PhongShading, {"background_terms": [[1.0, 2.0, 3.0]] * 14}, "14 coefficients are those of no polynomial"),
    (PhongShading, {"lamps": {"azimuth_rad": [0, 1, 2]}}, "missing 3 required positional arguments"),
    (QuadraticShading, {"terms": [[[1.0, 2.0, 3.0]]] * 4}, "5 coefficients are those of no polynomial"),
    (QuadraticShading, {"largest_tilt": [1.0, 2.0]}, r"largest_tilt has numbers of shape \(2,\) in place of a single one"),
    (SlopeTable, {"table": [[[1.0, 2.0, 3.0]] * 2] * 3}, "table has not as many cells along y as along x")])
def test_numbers_edited_by_hand_that_are_no_model_are_refused_with_their_field(kind, change, said, tmp_path):
    values = fitted(kind, LIGHTS).values() | change
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(values))
    with pytest.raises(InputError, match=f"mine.yaml: a field holds no such numbers .*{said}"):
        Shading.load(tmp_path / "mine.yaml")


def test_an_unknown_name_is_refused_with_those_that_ship():
    with pytest.raises(InputError, match="there is no such shading; give the path of a file, or one of: "):
        Shading.load("nobodys_gel")


def test_a_folder_with_the_name_of_a_shading_that_ships_does_not_hide_it(tmp_path, monkeypatch):
    (tmp_path / "digit").mkdir()
    monkeypatch.chdir(tmp_path)
    assert Shading.load("digit").pixels


def test_a_camera_of_another_ratio_is_refused_and_one_of_another_size_scaled():
    model, y_x = fitted(QuadraticShading, TRUE), (np.array([10.0]), np.array([12.0]))
    with pytest.raises(InputError, match="calibrated on images of 64 x 48 px, the camera has 64 x 64 px, of another ratio"):
        model.scaled((64, 64))
    large = model.scaled((128, 96)).difference(0.3, 0.2, 2 * y_x[0] + 0.5, 2 * y_x[1] + 0.5)
    assert large == pytest.approx(model.difference(0.3, 0.2, *y_x))


def test_a_prepared_grid_draws_the_same_image_in_single_precision():
    model, slopes = fitted(SlopeTable, LIGHTS), presses(LIGHTS)[0].slopes(GEL)
    y, x = np.mgrid[:48, :64]
    drawn = model.on_grid(PIXELS, BACKGROUND).colours(slopes[..., 0], slopes[..., 1])
    assert np.abs(drawn - model.colours(slopes[..., 0], slopes[..., 1], x, y, BACKGROUND)).max() < 0.51


def test_a_background_of_another_resolution_is_refused():
    with pytest.raises(InputError, match="its image has 64 x 48 px, the background 32 x 48 px"):
        BallPress(BACKGROUND, BACKGROUND[:, ::2], (10, 10), 5.0)


def test_a_slope_steeper_than_any_that_was_fitted_has_the_colour_of_the_steepest():
    model = fitted(QuadraticShading, TRUE)
    steep, steeper = (model.difference(slope, 0.0, 10.0, 12.0) for slope in (3.0, 30.0))
    assert model.largest_tilt < 0.6 and steep == pytest.approx(steeper)
