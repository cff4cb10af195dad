"""The elastic layer: conditions of contact, force balance; tests/verification has Hertz."""

import numpy as np
import pytest

from softtact.mechanics.elastic import layer_mesh, linear_stiffness, press_elastic, surface_compliance


@pytest.fixture(scope="module")
def layer():
    points, tets = layer_mesh((12.0, 12.0), 3.0, edge_length_mm=1.0)
    return surface_compliance(points, tets, young_mpa=1.289, poisson=0.1729, map_x_mm=np.linspace(-6, 6, 13),
                              map_y_mm=np.linspace(-6, 6, 13))


def sphere_gap(points, radius):
    return radius - np.sqrt(radius**2 - (points**2).sum(axis=1))


def test_linear_displacements_leave_inner_nodes_in_balance():
    points, tets = layer_mesh((4.0, 4.0), 2.0, edge_length_mm=1.0)
    stiffness = linear_stiffness(points, tets, young_mpa=2.0, poisson=0.3)
    gradient = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.3], [0.2, 0.0, 0.1]])
    force = (stiffness @ (points @ gradient.T).ravel()).reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    inside = ((points > low + 1e-6) & (points < high - 1e-6)).all(axis=1)
    assert inside.any() and np.abs(force[inside]).max() < 1e-12


def test_contact_conditions_hold_at_every_level(layer):
    gap0 = sphere_gap(layer.points, 20.0)
    for level in press_elastic(layer, gap0, [0.5, 2.0, 8.0]):
        gap = gap0 - level.indentation + level.displacement
        assert level.nodal_force.min() >= 0
        assert gap.min() > -1e-8
        assert np.abs(level.nodal_force * gap).max() < 1e-8
        assert level.nodal_force.sum() == pytest.approx(level.force_n, rel=1e-8)


def test_forces_in_one_go_or_one_by_one_give_the_same(layer):
    gap0 = sphere_gap(layer.points, 15.0)
    together = list(press_elastic(layer, gap0, [1.0, 5.0]))[-1]
    alone = list(press_elastic(layer, gap0, [5.0]))[-1]
    assert together.indentation == pytest.approx(alone.indentation, rel=1e-10)
