"""Undersides of objects in many poses and of placed meshes: one way, and its specification in plain NumPy."""

import naive_underside as naive
import numpy as np
import pytest
import trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.lower_envelope import NO_CONTACT_MM
from softtact.contact.narrow_parts import lowest_missed
from softtact.contact.node_grid import NodeGrid
from softtact.contact.shell import Shell
from softtact.contact.undersides import ObjectSurface, Target
from softtact.errors import MissError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose

X_MM, Y_MM = np.linspace(-5, 5, 21), np.linspace(-7, 7, 29)
REACH_MM = 2.0
SHELL = Shell((10.0, 14.0), 0.8, 2.0)
MESHES = {"ball": trimesh.creation.icosphere(subdivisions=2, radius=4.0), "plate": trimesh.creation.box((16.0, 9.0, 2.0)),
          "wall": trimesh.creation.box((0.2, 6.0, 3.0)), "pin": trimesh.creation.cylinder(radius=0.1, height=3.0, sections=8),
          "slivers": trimesh.creation.cylinder(radius=2.5, height=4.0, sections=60),
          "tube": trimesh.creation.annulus(r_min=1.2, r_max=1.4, height=3.0, sections=16),
          "wider than the pad": trimesh.creation.box((40.0, 60.0, 5.0))}
POSES = [None, Pose.from_values((0.25, 0.5, 0, 0, 0, 0)), Pose.from_values((1.3, -2.1, -4.0, 12.0, -17.0, 40.0)),
         Pose.from_values((-0.4, 0.9, 3.0, 105.0, 30.0, 200.0))]


def grid_of(sides):
    lines = (np.linspace(line[0], line[-1], 2 * len(line) - 1) for line in (X_MM, Y_MM))
    return NodeGrid(*(line if sides else line[1:-1] for line in lines), sides=sides)


def target(grid):
    return Target(grid, X_MM, Y_MM, (10.0, 14.0), SHELL, REACH_MM)


@pytest.mark.parametrize("sides", [True, False])
@pytest.mark.parametrize("name", MESHES)
def test_an_underside_is_that_of_its_specification_in_any_pose(name, sides):
    grid, surface = grid_of(sides), ObjectSurface(MESHES[name])
    for pose in POSES:
        placed = place(MESHES[name], pose=pose)
        seen, touch = naive.over(grid.x, grid.y, placed).ravel(), naive.first_touch(X_MM, Y_MM, placed)
        below = min(seen.min(), touch) + REACH_MM
        expected = np.minimum(seen, naive.lowest_missed(HeightField(placed), grid, seen, below))
        expected[expected >= below] = NO_CONTACT_MM
        found = surface.over(target(grid), pose)
        sure = np.abs(np.minimum(expected, found.height_mm) - below) > 1e-9      # of which side of `below` they are on
        np.testing.assert_allclose(found.height_mm[sure], expected[sure], rtol=0, atol=1e-9)
        assert found.touch_mm == pytest.approx(touch, abs=1e-9)
        on_shell = min(naive.lowest_in_box(box, placed) for box in SHELL.boxes)
        assert found.stop_mm == pytest.approx(on_shell + SHELL.below_mm if on_shell < NO_CONTACT_MM else np.inf, abs=1e-9)
        assert found.top_mm == pytest.approx(placed.bounds[1, 2] - touch, abs=1e-9)


def test_a_mesh_that_is_moved_afterwards_leaves_the_surface_as_it_was():
    mesh = MESHES["ball"].copy()
    surface, grid = ObjectSurface(mesh), grid_of(True)
    mesh.apply_translation((2.0, 0.0, 0.0))
    for pose in POSES:
        found, expected = (one.over(target(grid), pose).height_mm for one in (surface, ObjectSurface(MESHES["ball"])))
        assert (found == expected).all()
    assert surface.mesh.bounds[0, 0] == MESHES["ball"].bounds[0, 0]


def odd(name):
    """A mesh without its lower side, or with all facets inside out, tilted."""
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=4.0)
    if name == "open":
        mesh.update_faces(mesh.triangles_center[:, 2] > -3.0)
    else:
        mesh.invert()
    return mesh


@pytest.mark.parametrize("mesh", [odd("open"), odd("inside out"), *(
    place(MESHES[name], pose=POSES[2]) for name in ("ball", "slivers", "tube", "wider than the pad"))])
def test_lines_and_single_points_find_the_same_bits_and_normals(mesh):
    surface = HeightField(mesh)
    x = np.sort(np.concatenate([X_MM, X_MM[3:5] + 1e-9, [0.123]]))      # uneven, and on edges of the meshes
    heights, triangles = surface.over_lines(x, Y_MM)
    expected, normals = surface(*(places.ravel() for places in np.meshgrid(x, Y_MM)))
    assert np.array_equal(heights.ravel(), expected) and np.array_equal(surface.normals_of(triangles).reshape(-1, 3), normals)
    assert (heights < NO_CONTACT_MM).any()


@pytest.mark.parametrize("name", ["wall", "pin", "tube"])
def test_thin_parts_between_nodes_are_those_that_no_node_around_them_sees(name):
    grid = grid_of(True)
    surface = HeightField(place(MESHES[name], pose=Pose.from_values((0.13, 0.11, 0, 0, 0, 20.0))))
    seen = surface.over_lines(grid.x, grid.y)[0].ravel()
    found = lowest_missed(surface, grid, seen, 1.0)
    np.testing.assert_allclose(found, naive.lowest_missed(surface, grid, seen, 1.0), rtol=0, atol=1e-12)
    assert (found < NO_CONTACT_MM).any()


def test_a_sensor_without_a_shell_stops_no_object():
    grid, shell = NodeGrid(X_MM, Y_MM, True), Shell((10.0, 14.0), np.inf, 2.0)
    assert ObjectSurface(MESHES["plate"]).over(Target(grid, X_MM, Y_MM, (10.0, 14.0), shell, REACH_MM), None).stop_mm == np.inf


def test_an_object_beside_the_sensor_is_refused_with_where_it_is():
    with pytest.raises(MissError, match="misses the sensor: it spans x 46 to 54 mm"):
        ObjectSurface(MESHES["ball"]).over(target(NodeGrid(X_MM, Y_MM, True)), Pose.from_values((50, 0, 0, 0, 0, 0)))
