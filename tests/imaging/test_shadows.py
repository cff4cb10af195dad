"""Cast shadows: horizons against closed forms and a search point by point, what they darken, and lamps found from images."""

from types import SimpleNamespace

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.imaging.ball_presses import BallPress, Gel, ball_heights, ball_slopes
from softtact.imaging.ball_shadows import press_dimming, with_lamps
from softtact.imaging.gel_image import Relief
from softtact.imaging.shading import PhongShading, Shading
from softtact.imaging.shadows import Lamps, dimming_of, horizon

X, Y = np.linspace(-6, 6, 97), np.linspace(-5, 5, 81)
ON_X, ON_Y = np.meshgrid(X, Y)
STEP = X[1] - X[0]
HILL = np.exp(-(ON_X**2 + ON_Y**2) / 1.5)


def lamps(azimuths=(0.0, 2.1, 4.2), elevation=0.3, softness=0.05, strength=0.5):
    return Lamps(np.array(azimuths), *(np.full(3, value) for value in (elevation, softness, strength)))


@pytest.mark.parametrize("direction", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_behind_a_wall_the_horizon_is_its_height_over_the_distance(direction):
    along = direction[0] * ON_X + direction[1] * ON_Y
    found, away = horizon(np.where(along > 1.0, 0.7, 0.0), np.array(direction), STEP, Y[1] - Y[0]), along < 0.9
    first = along[along > 1.0].min()
    assert np.allclose(found[away], 0.7 / (first - along[away]))


def test_oblique_horizons_are_those_of_a_search_point_by_point():
    direction = np.array([np.cos(0.7), np.sin(0.7)])

    def height(x, y):
        return np.exp(-((x - 1)**2 + y**2) / 2) + 0.4 * np.exp(-((x + 1.5)**2 + (y + 1)**2))

    found = horizon(height(ON_X, ON_Y), direction, STEP, Y[1] - Y[0])
    steps = np.linspace(0.02, 6, 600)      # the map is linear between its points: hence the tolerance
    for j, i in ((20, 20), (40, 30), (30, 48), (35, 10)):
        x, y = X[i] + steps * direction[0], Y[j] + steps * direction[1]
        assert found[j, i] == pytest.approx(((height(x, y) - height(X[i], Y[j])) / steps).max(), abs=0.01)


def test_horizons_fall_when_the_surface_is_stretched_towards_the_lamp():
    direction = np.array([1.0, 0.0])
    rest = horizon(HILL, direction, STEP, STEP)
    assert np.allclose(horizon(HILL, direction, STEP, STEP, moved=ON_X), rest / 2)
    assert np.allclose(horizon(HILL, direction, STEP, STEP, moved=np.full_like(HILL, 0.3)), rest)


def test_a_pressed_ball_darkens_the_gel_behind_it_and_not_its_own_face():
    gel, press = Gel(40.0, 60.0), BallPress(np.zeros((200, 240, 3)), np.zeros((200, 240, 3)), (120.0, 100.0), 30.0)
    y, x = np.mgrid[:200, :240]
    dark = press_dimming(press, gel, lamps(), x, y)[..., 0]
    distance = np.hypot(x - 120, y - 100)
    assert dark[distance < 29].max() < 1e-3
    assert dark[100, 65:80].min() > 0.4 and dark[100, 160:175].max() < 1e-3     # the lamp is on the right


def test_heights_under_a_ball_are_the_integral_of_its_slopes():
    gel, r = Gel(40.0, 60.0), np.linspace(0, 400, 4001)
    slopes = ball_slopes(r, 0 * r, 30.0, gel)[:, 0]
    rise = np.concatenate([[0], np.cumsum(0.5 * (slopes[1:] + slopes[:-1]) * np.diff(r))])
    heights = ball_heights(r, 30.0, gel)
    assert np.abs(heights - heights[0] - rise).max() < 0.02 and abs(ball_heights(3000.0, 30.0, gel)) < 1e-6      # px


def test_a_surface_turned_against_the_camera_has_its_shadow_turned():
    slopes = np.stack(np.gradient(-HILL, STEP, STEP)[::-1], axis=-1)
    relief = Relief(X, X[:81], np.stack([0 * HILL, 0 * HILL, -HILL], axis=-1))
    straight = dimming_of(relief, lamps(), slopes, np.eye(2))[..., 0]
    turned = dimming_of(relief, lamps(), -slopes, -np.eye(2))[..., 0]
    assert straight[40, :40].max() > 0.3 and np.allclose(turned[:, ::-1], straight, atol=1e-9)


def test_a_surface_that_is_curved_at_rest_throws_no_shadow_untouched():
    dome = -0.8 * HILL
    relief = Relief(X, Y, np.stack([0 * dome, 0 * dome, dome], axis=-1), rest_z_mm=dome)
    assert not dimming_of(relief, lamps(), np.zeros((*dome.shape, 2)), np.eye(2)).any()


# --- found from images ---

GEL = Gel(20.0, 30.0)
LIGHTS = PhongShading((96, 72), np.zeros((1, 3)), azimuth_rad=np.array([0.0, 2.1, 4.2]), elevation_rad=np.array([0.4, 0.6, 0.5]),
                      diffuse=np.array([80.0, 70, 60]), specular=np.array([20.0, 10, 5]), exponent=np.array([4.0, 6, 8]))


def images(with_shadows, noise=1.0):
    """Presses that three lights draw, with or without shadows."""
    y, x = np.mgrid[:72, :96]
    rng, background, made = np.random.default_rng(0), np.full((72, 96, 3), 120.0), []
    for place in ((40.0, 30.0), (50.0, 40.0), (45.0, 36.0), (55.0, 32.0)):
        blank = BallPress(background, background, place, 12.0)
        slopes = blank.slopes(GEL)
        dark = press_dimming(blank, GEL, with_shadows, x, y) if with_shadows else None
        seen = LIGHTS.colours(slopes[..., 0], slopes[..., 1], x, y, background, dark)
        made.append(BallPress(seen + rng.normal(0, noise, seen.shape), background, place, 12.0))
    return made


def test_the_lamps_of_drawn_shadows_are_found():
    true = lamps(elevation=0.22, softness=0.2, strength=0.2)
    found = with_lamps(LIGHTS, images(true), GEL, reach=[3.0] * 4)
    assert found is not None
    assert np.cos(found.azimuth_rad - true.azimuth_rad).min() > 0.999
    assert np.allclose(found.elevation_rad, 0.22) and np.allclose(found.softness, 0.2)       # both are among the values tried
    assert np.allclose(found.strength, 0.2, atol=0.01)


def test_images_without_shadows_have_no_lamps():
    assert with_lamps(LIGHTS, images(None), GEL, reach=[3.0] * 4) is None


# --- files ---


def test_lamps_are_kept_in_the_file_of_a_shading(tmp_path):
    kept = PhongShading(**vars(LIGHTS) | {"lamps": lamps()})
    kept.save(tmp_path / "one.yaml")
    loaded = Shading.load(tmp_path / "one.yaml").lamps
    assert loaded is not None and all(np.array_equal(getattr(loaded, name), value) for name, value in vars(lamps()).items())
    assert Shading.load("gelsight_mini").lamps is None


@pytest.mark.parametrize(("change", "words"), [({"softness": [0, 0.1, 0.1]}, "softness"), ({"strength": [0.1]}, "strength"),
                                               ({"height": [1, 1, 1]}, "height")])
def test_lamps_that_are_none_are_refused_with_their_file(tmp_path, change, words):
    import yaml

    PhongShading(**vars(LIGHTS) | {"lamps": lamps()}).save(tmp_path / "one.yaml")
    values = yaml.safe_load((tmp_path / "one.yaml").read_text())
    values.pop("digest")
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(values | {"lamps": values["lamps"] | change}))
    with pytest.raises(InputError, match=f"one.yaml.*{words}"):
        Shading.load(tmp_path / "one.yaml")


def test_a_shadow_is_as_dark_in_the_fast_image_as_by_the_formula():
    from softtact.imaging import gel_image
    from softtact.imaging.pinhole import Pinhole

    camera = Pinhole(rows=60, columns=80, mm_per_px=0.125, distance_mm=30.0)
    relief = Relief(X, Y, np.stack([0 * HILL, 0 * HILL, -HILL], axis=-1))
    slopes = gel_image.slopes_of(relief, camera.turn)
    fields = np.concatenate([slopes, dimming_of(relief, lamps(), slopes, camera.turn)], axis=2)
    background, light = np.full((60, 80, 3), 120.0, dtype=np.float32), np.ones((60, 80), dtype=np.float32)
    plain = SimpleNamespace(difference=lambda x, y, px, py: np.stack([30 * x / np.sqrt(1 + x**2 + y**2)] * 3, axis=-1))
    seen = gel_image.seen(relief, camera, fields)
    fast = gel_image.colours_by_table(seen[..., :2], 1, gel_image.tabulate(plain, camera), background, light, seen[..., 2:])
    slow = gel_image.colours_by_formula(seen[..., :2], plain, background, light, seen[..., 2:])
    assert np.abs(fast.astype(int) - slow).max() <= 1 and np.ptp(slow[..., 0]) > 60
