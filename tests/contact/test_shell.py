"""The shell around a pad: where an object comes to rest on it, and what force the pad then carries."""

import numpy as np
import pytest
import trimesh

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.shell import Shell, pad_forces
from softtact.errors import ConvergenceError

PAD = (10.0, 6.0)


def shell(below_mm=0.5, width_mm=2.0):
    return Shell(PAD, below_mm, width_mm)


def block(x, y, *, at=(0.0, 0.0), lowest=0.0):
    box = trimesh.creation.box((x, y, 2.0))
    box.apply_translation([*at, 1.0 + lowest])
    return box


def surface_of(*parts):
    return HeightField(trimesh.util.concatenate(parts))


def test_a_flat_object_rests_after_the_height_by_which_the_pad_stands_out():
    assert shell().stop_mm(surface_of(block(14.0, 4.0, lowest=0.3))) == pytest.approx(0.8)


@pytest.mark.parametrize("parts", [[block(9.0, 5.0)], [block(10.0, 6.0)], [block(9.0, 5.0), block(2.0, 2.0, at=(9.0, 0.0))]],
                         ids=["inside", "as large as the pad", "beyond the shell"])
def test_an_object_that_is_not_over_the_shell_never_rests(parts):
    assert np.isinf(shell().stop_mm(surface_of(*parts)))


@pytest.mark.parametrize("at", [(6, 0), (-6, 0), (0, 4), (0, -4), (4, 4), (-4, 4), (4, -4), (-4, -4), (6, 4), (-6, -4)])
def test_each_side_of_the_shell_holds_along_its_whole_length(at):
    assert shell().stop_mm(surface_of(block(1.0, 1.0, at=at, lowest=0.2))) == pytest.approx(0.7)


def test_without_a_shell_nothing_rests():
    assert np.isinf(shell(below_mm=np.inf).stop_mm(surface_of(block(14.0, 4.0))))


def test_a_ball_rests_where_its_cap_meets_the_inner_edge_of_the_shell():
    """At x = 5 mm, y = 0 a sphere of R 20 mm is 20 - sqrt(20^2 - 3^2) mm high over the nearer side, y = 3 mm."""
    ball = trimesh.creation.icosphere(subdivisions=6, radius=20.0)
    ball.apply_translation([0, 0, 20.0])
    assert shell().stop_mm(HeightField(ball)) == pytest.approx(20.0 - np.sqrt(400.0 - 9.0) + 0.5, abs=2e-3)     # its facets


def test_an_object_that_has_moved_aside_rests_where_it_is_then():
    surface = surface_of(block(4.0, 4.0))
    assert np.isinf(shell().stop_mm(surface)) and shell().stop_mm(surface, [4.0, 0.0]) == pytest.approx(0.5)


def test_the_lowest_point_over_a_rectangle_is_exact_on_slopes():
    """A roof z = |x| over 1 < x < 2: its lowest point is at the rectangle's own side, between all corners."""
    roof = trimesh.Trimesh([[-5, -5, 5], [0, -5, 0], [5, -5, 5], [-5, 5, 5], [0, 5, 0], [5, 5, 5]],
                           [[0, 4, 1], [0, 3, 4], [1, 5, 2], [1, 4, 5]], process=False)
    surface = HeightField(roof)
    assert surface.lowest_over(np.array([1.0, -1.0]), np.array([2.0, 1.0])) == pytest.approx(1.0, abs=1e-12)
    assert surface.lowest_over(np.array([6.0, -1.0]), np.array([7.0, 1.0])) == NO_CONTACT_MM


# --- forces ---


def depth_of(force):
    return 0.1 + 0.02 * force     # a spring of 50 N/mm that is touched after 0.1 mm


def test_the_pad_carries_all_until_the_object_rests_and_no_more_after():
    forces = np.array([5.0, 10.0, 20.0])
    np.testing.assert_allclose(pad_forces(forces, stop_mm=0.4, touch_mm=0.1, depth_of=depth_of), [5.0, 10.0, 15.0], atol=1e-6)
    np.testing.assert_array_equal(pad_forces(forces, stop_mm=0.6, touch_mm=0.1, depth_of=depth_of), forces)


def test_the_pad_carries_nothing_where_the_object_rests_before_it_touches():
    np.testing.assert_array_equal(pad_forces(np.array([5.0]), stop_mm=0.1, touch_mm=0.1, depth_of=depth_of), [0.0])


def test_an_object_that_stays_above_the_shell_where_its_descent_is_no_longer_found_does_not_rest_on_it():
    def found_up_to_3_n(force):
        if force > 3.0:
            raise ConvergenceError("not settled")
        return 0.1 * force

    with pytest.raises(ConvergenceError, match="3 N, where the object is still above the shell"):
        pad_forces(np.array([1.0, 50.0]), stop_mm=0.6, touch_mm=0.0, depth_of=found_up_to_3_n)
    assert pad_forces(np.array([50.0]), stop_mm=0.2, touch_mm=0.0, depth_of=found_up_to_3_n) == pytest.approx(2.0)


def test_a_motion_that_goes_below_the_shell_is_refused_with_both_depths():
    with pytest.raises(ConvergenceError, match=r"Step 2 .* 0\.6 mm deep, but rests on the shell beside the pad after 0\.5 mm"):
        shell().refuse_motion(surface_of(block(14.0, 4.0)), np.zeros(2), 0.6, 0.0, step=2)


def test_the_top_of_a_shell_is_a_ring_around_the_pad_that_looks_up():
    """14 x 10 mm less 10.002 x 6.002: the shell of 2 mm begins a micrometre beside the pad."""
    triangles = shell().top_mm(3.0)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert (normals[:, 2] > 0).all() and np.abs(normals[:, :2]).max() == 0 and (triangles[..., 2] == 2.5).all()
    assert 0.5 * normals[:, 2].sum() == pytest.approx(14.002 * 10.002 - 10.002 * 6.002)


def test_points_over_a_shell_are_beside_the_pad_and_within_its_width():
    points = np.array([[0, 0, 9], [5.0, 0, 0], [5.1, 0, 0], [0, -3.1, 0], [7.1, 0, 0], [6, 4, 0], [6, 5.2, 0]])
    assert shell().beneath(points).tolist() == [False, False, True, True, False, True, False]
    assert not shell(below_mm=np.inf).beneath(points).any()
