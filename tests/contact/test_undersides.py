"""Undersides of many poses: those of `HeightField`, `Underside` and `Shell`, pose by pose."""

import numpy as np
import pytest
import trimesh

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.node_grid import NodeGrid
from softtact.contact.shell import Shell
from softtact.contact.underside import Underside
from softtact.contact.undersides import ObjectSurface, Target
from softtact.errors import InputError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose

X_MM, Y_MM = np.linspace(-5, 5, 21), np.linspace(-7, 7, 29)
REACH_MM = 2.0
SHELL = Shell((10.0, 14.0), 0.8, 2.0)
MESHES = {"ball": trimesh.creation.icosphere(subdivisions=3, radius=4.0), "plate": trimesh.creation.box((16.0, 9.0, 2.0)),
          "wall": trimesh.creation.box((0.2, 6.0, 3.0)), "pin": trimesh.creation.cylinder(radius=0.1, height=3.0, sections=8),
          "cylinder": trimesh.creation.cylinder(radius=2.5, height=4.0)}


def target(grid):
    return Target(grid, X_MM, Y_MM, (10.0, 14.0), SHELL, REACH_MM)


def poses():
    rng = np.random.default_rng(4)
    places = [Pose.from_values((*rng.uniform(-4, 4, 2), 3.0, *rng.uniform(-20, 20, 2), rng.uniform(0, 360))) for _ in range(5)]
    return [None, Pose.from_values((0.25, 0.5, 0, 0, 0, 0)), *places]


@pytest.mark.parametrize("sides", [True, False])
@pytest.mark.parametrize("name", MESHES)
def test_an_underside_is_that_of_the_object_placed_in_its_pose(name, sides):
    lines = (np.linspace(line[0], line[-1], 2 * len(line) - 1) for line in (X_MM, Y_MM))
    grid = NodeGrid(*(line if sides else line[1:-1] for line in lines), sides=sides)
    surface, aim = ObjectSurface(MESHES[name]), target(grid)
    for pose in poses():
        placed = place(MESHES[name], pose=pose)
        field = HeightField(placed)
        points, touch = Underside(field, grid).nodes(REACH_MM), field.first_touch_mm(X_MM, Y_MM)
        expected = np.full(grid.count, NO_CONTACT_MM)
        expected[points.nodes] = points.gap
        found = surface.over(aim, pose)
        near = np.minimum(expected, found.height_mm) < touch + REACH_MM - 0.1     # heights end at slightly different reaches
        np.testing.assert_allclose(found.height_mm[near], expected[near], rtol=0, atol=1e-12)
        assert found.touch_mm == pytest.approx(touch, abs=1e-12)
        assert found.stop_mm == pytest.approx(SHELL.stop_mm(field), abs=1e-9)
        assert found.top_mm == pytest.approx(placed.bounds[1, 2] - touch, abs=1e-12)


def test_a_sensor_without_a_shell_stops_no_object():
    grid, shell = NodeGrid(X_MM, Y_MM, True), Shell((10.0, 14.0), np.inf, 2.0)
    assert ObjectSurface(MESHES["plate"]).over(Target(grid, X_MM, Y_MM, (10.0, 14.0), shell, REACH_MM), None).stop_mm == np.inf


def test_an_object_beside_the_sensor_is_refused_with_where_it_is():
    with pytest.raises(InputError, match="misses the sensor: it spans x 46 to 54 mm"):
        ObjectSurface(MESHES["ball"]).over(target(NodeGrid(X_MM, Y_MM, True)), Pose.from_values((50, 0, 0, 0, 0, 0)))
