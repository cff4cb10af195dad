"""What a camera behind a gel sees: closed forms of tilted and stretched surfaces, fast loops against slow twins."""

from types import SimpleNamespace

import numpy as np
import pytest

from softtact.imaging import gel_image
from softtact.imaging.gel_image import Relief
from softtact.imaging.pinhole import Pinhole

CAMERA = Pinhole(rows=60, columns=80, mm_per_px=0.125, distance_mm=30.0)
X, Y = np.linspace(-8, 8, 129), np.linspace(-7, 7, 113)
ON_X, ON_Y = np.meshgrid(X, Y)
FLAT = np.zeros((len(Y), len(X)))
DISCS = SimpleNamespace(radius_mm=0.5, darkness=0.8, edge_px=1.0)


def relief(z=FLAT, ux=FLAT, uy=FLAT):
    return Relief(X, Y, np.stack([ux, uy, z], axis=-1))


class Plane:
    """A shading that a test can compute: linear in the slope, and in the column."""

    def difference(self, slope_x, slope_y, x_px, y_px):
        over = 1 / np.sqrt(1 + np.square(slope_x) + np.square(slope_y))
        return np.stack([100 * slope_x * over, 50 * slope_y * over, slope_x * over * np.asarray(x_px)], axis=-1)


def test_a_tilted_plane_has_its_tilt_as_slope_everywhere():
    slopes = gel_image.slopes_of(relief(0.1 * ON_X - 0.02 * ON_Y), CAMERA.turn)
    assert np.allclose(slopes, [0.1, -0.02])


def test_a_stretched_surface_is_less_steep():
    """u = 0.25 x stretches the plane by 1.25 along x, so its slope falls from 0.1 to 0.08."""
    assert np.allclose(gel_image.slopes_of(relief(0.1 * ON_X, ux=0.25 * ON_X), CAMERA.turn)[..., 0], 0.08)


def test_slopes_turn_with_the_axes_of_the_image():
    turned = Pinhole(60, 80, 0.125, 30.0, axes=("y", "-x"))
    assert np.allclose(gel_image.slopes_of(relief(0.1 * ON_X - 0.02 * ON_Y), turned.turn), [-0.02, -0.1])


def test_a_pixel_sees_the_point_that_moved_to_it():
    """Everything moves by 1 mm along x and 0.6 mm down: x + 1 = q (30 - 0.6), by hand for each pixel."""
    seen = gel_image.seen(relief(FLAT - 0.6, ux=FLAT + 1.0), CAMERA, np.dstack([ON_X, ON_Y]))
    rays = CAMERA.directions(CAMERA.pixels())
    assert np.allclose(seen, rays * 29.4 - [1.0, 0.0], atol=2e-3)


def test_the_points_that_pixels_see_project_to_these_pixels():
    bump = relief(-0.8 * np.exp(-(ON_X**2 + ON_Y**2) / 4), ux=0.2 * ON_X * np.exp(-(ON_X**2 + ON_Y**2) / 9))
    points = gel_image.seen(bump, CAMERA, np.dstack([ON_X, ON_Y])).reshape(-1, 2)
    assert np.abs(CAMERA.project(bump.places(points)) - CAMERA.pixels().reshape(-1, 2)).max() < 0.02


def test_beyond_the_map_nothing_is_seen():
    narrow = Relief(X[60:70], Y, np.ones((len(Y), 10, 3)) * [0, 0, 0])
    seen = gel_image.seen(narrow, CAMERA, np.ones((len(Y), 10, 1)))[30, :, 0]
    assert seen[0] == 0 and seen[-1] == 0 and seen.max() == 1


def test_the_table_of_a_shading_gives_the_colours_of_its_formula():
    slopes = gel_image.seen(relief(-0.8 * np.exp(-(ON_X**2 + ON_Y**2) / 4)), CAMERA, np.dstack([ON_X / 8, -ON_Y / 9]))
    background, light = np.full((60, 80, 3), 120.0, dtype=np.float32), np.ones((60, 80), dtype=np.float32)
    table = gel_image.tabulate(Plane(), CAMERA)
    fast = gel_image.colours_by_table(slopes, 1, table, background, light)
    slow = gel_image.colours_by_formula(slopes, Plane(), background, light)
    assert table.degree == 1 and np.abs(fast.astype(int) - slow).max() <= 1 and (fast != slow).mean() < 0.01


def test_a_shading_that_is_no_polynomial_of_the_place_is_not_tabulated():
    class Waves(Plane):
        def difference(self, slope_x, slope_y, x_px, y_px):
            return super().difference(slope_x, slope_y, np.sin(np.asarray(x_px)), y_px)

    assert gel_image.tabulate(Waves(), CAMERA) is None


def test_rays_of_every_second_pixel_give_nearly_the_image_of_all():
    bump = relief(-0.8 * np.exp(-(ON_X**2 + ON_Y**2) / 4))
    slopes, table = gel_image.slopes_of(bump, CAMERA.turn), gel_image.tabulate(Plane(), CAMERA)
    background, light = np.full((60, 80, 3), 120.0, dtype=np.float32), np.ones((60, 80), dtype=np.float32)
    seen = {step: gel_image.seen(bump, CAMERA, slopes, step=step) for step in (1, 2)}
    images = [gel_image.colours_by_table(seen[step], step, table, background, light).astype(int) for step in seen]
    assert np.abs(images[0] - images[1]).mean() < 0.1 and np.abs(images[0] - images[1]).max() <= 3


def test_between_every_third_pixel_a_linear_field_is_exact():
    seen = gel_image.seen(relief(), CAMERA, np.dstack([ON_X, ON_Y]), step=3)
    whole = gel_image.seen(relief(), CAMERA, np.dstack([ON_X, ON_Y]))
    assert np.abs(gel_image.between(seen, CAMERA, 3) - whole).max() < 1e-4


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.03, -2.21)])
def test_a_drawn_marker_has_its_area_and_its_middle(place):
    """A disc of 0.5 mm is 4 px in radius: pi 16 px dark by 0.8, around the place where the pinhole sees it."""
    dark = 1 - gel_image.light_past_markers(relief(), CAMERA, DISCS, np.array([place]))
    y, x = np.mgrid[:60, :80]
    middle = np.array([(dark * x).sum(), (dark * y).sum()]) / dark.sum()
    assert dark.sum() == pytest.approx(0.8 * np.pi * 16, rel=0.01)
    assert middle == pytest.approx(CAMERA.project(np.array([*place, 0.0])), abs=0.02)     # its edge is a ramp


def test_a_marker_on_a_stretched_surface_is_an_ellipse_as_long_as_the_stretch():
    dark = 1 - gel_image.light_past_markers(relief(ux=0.5 * ON_X), CAMERA, DISCS, np.zeros((1, 2)))
    y, x = np.mgrid[:60, :80] - np.array([29.5, 39.5])[:, None, None]
    along, across = (dark * x**2).sum() / dark.sum(), (dark * y**2).sum() / dark.sum()
    assert along / across == pytest.approx(1.5**2, rel=0.03)
    assert dark.sum() == pytest.approx(1.5 * 0.8 * np.pi * 16, rel=0.01)
