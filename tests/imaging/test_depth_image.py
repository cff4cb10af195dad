"""Depth images against what a pinhole sees, by hand."""

import numpy as np
import pytest
import trimesh

from softtact.imaging.depth_image import DepthCamera, MovedObject
from softtact.imaging.pinhole import Pinhole
from softtact.press.objects import PlacedObject

PINHOLE = Pinhole(64, 64, 0.25, 35.0)      # 16 mm
X = (np.arange(64) - 31.5) * 0.25          # of the pixels on the surface at rest


def _box(width, height=5.0):
    return trimesh.creation.box((width, width, height), transform=trimesh.transformations.translation_matrix((0, 0, height / 2)))


def test_a_flat_punch_has_its_depth_inside_a_square_that_nearness_enlarges():
    """Its lower face, 1.5 mm below the surface, is seen larger by 35 / 33.5; half a pixel is the resolution."""
    depth = DepthCamera(_box(8.0), PINHOLE, deepest_mm=3.0, reach_mm=1.0).image(1.5, np.zeros(2))
    inside = np.abs(X) < 4.0 * 35 / 33.5 - 0.13
    outside = np.abs(X) > 4.0 * 35 / 33.5 + 0.13
    assert depth[np.ix_(inside, inside)] == pytest.approx(1.5, abs=1e-3)
    assert (depth[outside] == 0).all() and (depth[:, outside] == 0).all()


@pytest.mark.parametrize("down", [0.3, 1.5, 3.0])
def test_rays_that_pass_beside_a_box_at_the_surface_meet_its_lower_face_below(down):
    """A side of 8 mm is seen 8 (35 / (35 - down)) mm wide, up to 175 px in place of 160."""
    fine = Pinhole(241, 241, 0.05, 35.0)
    depth = DepthCamera(_box(8.0), fine, deepest_mm=3.0, reach_mm=1.0).image(down, np.zeros(2))
    for line in (depth[120], depth[:, 120]):
        assert (line > 0).sum() == pytest.approx(8 * 35 / (35 - down) / 0.05, abs=1)
        assert line[line > 0] == pytest.approx(down, abs=1e-3)


def test_a_ray_sees_the_nearer_of_two_faces():
    """A plate over a pin of 2 mm: beside the pin, whose lower face hides a rim of it, the plate is seen."""
    pin, plate = _box(2.0, 1.0), trimesh.creation.box((8.0, 8.0, 2.0))
    plate.apply_translation([0, 0, 2.0])
    depth = DepthCamera(trimesh.util.concatenate(pin, plate), PINHOLE, deepest_mm=3.0, reach_mm=0.0).image(2.0, np.zeros(2))[31]
    assert depth[np.abs(X) < 35 / 33 - 0.13] == pytest.approx(2.0, abs=1e-3)
    assert depth[(np.abs(X) > 35 / 33 + 0.13) & (np.abs(X) < 4 * 35 / 34 - 0.13)] == pytest.approx(1.0, abs=1e-3)


def test_a_ball_has_the_depth_of_its_cap():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=4.0)
    ball.apply_translation([0, 0, 4.0])
    depth = DepthCamera(ball, PINHOLE, deepest_mm=3.0, reach_mm=1.0).image(1.0, np.zeros(2))
    row = depth[31]
    r = np.abs(X) * (35 - row) / 35      # where the ray meets the ball
    near = np.hypot(r, 0.125) < 2.4
    cap = 1.0 - (4.0 - np.sqrt(16 - r[near]**2 - (0.125 * (35 - row[near]) / 35) ** 2))
    assert row[near] == pytest.approx(cap, abs=0.06)      # half a pixel at the cap's slope
    assert depth.max() == pytest.approx(1.0, abs=0.01)


def test_the_object_moves_in_the_image_as_it_moves():
    camera = DepthCamera(_box(4.0), PINHOLE, deepest_mm=3.0, reach_mm=1.0)
    still, moved = camera.image(1.0, np.zeros(2)), camera.image(1.0, np.array([1.0, 0.0]))
    assert (moved > 0).sum(axis=0).argmax() - (still > 0).sum(axis=0).argmax() == pytest.approx(4, abs=1)
    weight = np.array([(X * one.sum(axis=0)).sum() / one.sum() for one in (still, moved)])
    assert np.diff(weight)[0] == pytest.approx(35 / 34, abs=0.1)


def test_an_object_that_is_not_pressed_in_leaves_no_depth():
    assert DepthCamera(_box(8.0), PINHOLE, deepest_mm=3.0, reach_mm=0.0).image(0.0, np.zeros(2)).max() == 0


def test_a_depth_below_the_image_ends_at_its_deepest():
    assert DepthCamera(_box(8.0), PINHOLE, deepest_mm=1.0, reach_mm=0.0).image(2.0, np.zeros(2)).max() == 1.0


def test_an_inner_wall_is_seen_from_the_side():
    """Of a ring with a hole of 4 mm: between the lower and the upper edge a ray meets the wall where u (35 - depth) = 4."""
    ring = trimesh.creation.annulus(r_min=4.0, r_max=7.0, height=5.0, sections=256)
    ring.apply_translation([0, 0, 2.5])
    fine = Pinhole(257, 257, 0.05, 35.0)
    depth = DepthCamera(ring, fine, deepest_mm=3.0, reach_mm=0.0).image(2.0, np.zeros(2))[128]
    u = np.arange(257) * 0.05 / 35 - 128 * 0.05 / 35
    wall = (u > 4.0 / 35 * 1.006) & (u < 4.0 / 33 * 0.994)
    assert wall.sum() > 2
    assert depth[wall] == pytest.approx(35 - 4.0 / u[wall], abs=0.25)      # half a pixel of 0.05 mm at this steep ray


def test_an_object_of_the_solid_model_is_seen_where_it_moves_and_turns():
    """Turned about the vertical it is that of the elastic model; tilted by 5 degrees its face is a plane of that slope."""
    box = _box(6.0)
    turn = trimesh.transformations.rotation_matrix(np.radians(20), (0, 0, 1))[:3, :3]
    placed = PlacedObject(box.vertices, box.faces, np.array([[0.5, 0.0, -1.0]]), turn[None], np.array([0.0, 0.0, 2.5]))
    moved = MovedObject(box, 0.0, np.array([[0.5, 0.0]]), np.array([1.0]), np.array([20.0]))
    assert np.abs(placed.depths_mm(PINHOLE, deepest_mm=3.0) - moved.depths_mm(PINHOLE, deepest_mm=3.0)).max() < 1e-3

    tilt = trimesh.transformations.rotation_matrix(np.radians(5), (0, 1, 0))[:3, :3]
    depth = PlacedObject(box.vertices, box.faces, np.array([[0.0, 0.0, -1.0]]), tilt[None],
                         np.zeros(3)).depths_mm(PINHOLE, deepest_mm=3.0)[0, 31]
    x = X * (35 - depth) / 35
    assert np.polyfit(x[22:42], depth[22:42], 1) == pytest.approx([np.tan(np.radians(5)), 1.0], abs=5e-3)
