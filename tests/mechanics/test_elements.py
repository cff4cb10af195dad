"""The 20-node hexahedron, its meshes and its block: interpolation, volumes, patch test, tangent."""

import numpy as np
import pytest

from softtact.mechanics.hex_mesh import disc_plan, extrude, grid_plan
from softtact.materials.laws.registry import make_law
from softtact.mechanics.blocks import HexBlock
from softtact.mechanics.elements import HEX20_NODES, gauss, hex20, reference_gradients

LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})


def distorted_element(seed=0):
    rng = np.random.default_rng(seed)
    return (HEX20_NODES + 0.05 * rng.standard_normal((20, 3)))[None]


def test_shape_functions_are_one_at_their_node_and_sum_to_one():
    values, derivatives = hex20(HEX20_NODES)
    assert values == pytest.approx(np.eye(20), abs=1e-14)
    assert derivatives.sum(axis=1) == pytest.approx(np.zeros((20, 3)), abs=1e-13)


def test_derivatives_agree_with_finite_differences():
    point, step = np.array([[0.3, -0.2, 0.6]]), 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = (hex20(point + shift)[0] - hex20(point - shift)[0]) / (2 * step)
        assert hex20(point)[1][..., axis] == pytest.approx(slope, abs=1e-9)


def test_the_disc_of_quadratic_quads_has_the_area_of_a_circle():
    mesh = extrude(disc_plan(), [0.0, 1.0])
    points, weights = gauss(3, 3)
    _, volumes = reference_gradients(mesh.points[mesh.hexes], hex20(points)[1], weights)
    assert volumes.sum() == pytest.approx(np.pi, rel=1e-12)   # exact by the choice of DISC_CORNER_RADIUS


def test_a_frustum_has_the_volume_of_a_truncated_cone():
    mesh = extrude(disc_plan(), [0.0, 0.2, 0.5], scale=lambda z: 0.3 + 0.6 * z)
    points, weights = gauss(3, 3)
    _, volumes = reference_gradients(mesh.points[mesh.hexes], hex20(points)[1], weights)
    assert volumes.sum() == pytest.approx(np.pi * 0.5 / 3 * (0.3**2 + 0.3 * 0.6 + 0.6**2), rel=1e-10)


@pytest.mark.parametrize("points", [2, 3])
def test_an_affine_deformation_gives_constant_stress_in_every_element(points):
    """Patch test: energy of an affine map is volume times energy density, whatever the elements' shape.

    The volumetric density of the element is (K - k)/2 (J-1)^2 + k/4 (J^2 - 1 - 2 ln J).
    """
    plan = grid_plan(np.array([0, 0.7, 2.0]), np.array([0, 1.1, 1.9]))
    mesh = extrude(plan, [0, 0.4, 1.0])
    gradient = np.array([[0.05, 0.1, 0.0], [-0.02, -0.1, 0.03], [0.04, 0.0, 0.08]])
    displacement = mesh.points @ gradient.T
    block = HexBlock(mesh.points[mesh.hexes], LAW, points_per_side=points, local_over_shear=0.5)
    state = block.evaluate(displacement[mesh.hexes])
    F = np.eye(3) + gradient
    C = F.T @ F
    density = LAW.isochoric(np.array([[C[0, 0], C[1, 1], C[2, 2], C[0, 1], C[1, 2], C[0, 2]]])).energy[0]
    J = np.linalg.det(F)
    local = block.local_modulus
    volumetric = 0.5 * (LAW.bulk_modulus - local) * (J - 1) ** 2 + 0.25 * local * (J**2 - 1 - 2 * np.log(J))
    assert state.energy == pytest.approx(2.0 * 1.9 * 1.0 * (density + volumetric), rel=1e-12)
    force = np.zeros_like(mesh.points)
    np.add.at(force, mesh.hexes.ravel(), state.force.reshape(-1, 3))
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    inside = ((mesh.points > low + 1e-9) & (mesh.points < high - 1e-9)).all(axis=1)
    assert np.abs(force[inside]).max() < 1e-13


@pytest.mark.parametrize("points", [2, 3])
def test_force_is_the_slope_of_energy_and_tangent_the_slope_of_force(points):
    rng = np.random.default_rng(1)
    block = HexBlock(distorted_element(), LAW, points_per_side=points, local_over_shear=0.5)
    displacement = 0.05 * rng.standard_normal((1, 20, 3))
    direction, step = rng.standard_normal((1, 20, 3)), 1e-6
    plus, minus = (block.evaluate(displacement + sign * step * direction) for sign in (1, -1))
    force = block.evaluate(displacement).force.ravel()
    # central differences: error of order step^2 relative to the third derivative, about 1e-9
    assert force @ direction.ravel() == pytest.approx((plus.energy - minus.energy) / (2 * step), rel=1e-7)
    product = block.tangent(displacement)[0] @ direction.ravel()
    difference = ((plus.force - minus.force) / (2 * step)).ravel()
    assert np.linalg.norm(product - difference) <= 1e-7 * np.linalg.norm(difference)


def test_an_element_turned_inside_out_is_reported():
    block = HexBlock(HEX20_NODES[None].copy(), LAW)
    assert block.evaluate((-2.0 * HEX20_NODES * np.array([1, 0, 0]))[None]) is None


def test_confined_compression_has_the_oedometer_modulus():
    """Small strain: stress = (K + 4 mu / 3) strain (theory of elasticity)."""
    plan = grid_plan(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    mesh = extrude(plan, [0.0, 1.0])
    strain = 1e-5
    displacement = mesh.points * np.array([0, 0, -strain])
    state = HexBlock(mesh.points[mesh.hexes], LAW).evaluate(displacement[mesh.hexes])
    top = mesh.planes[-1]
    force = np.zeros_like(mesh.points)
    np.add.at(force, mesh.hexes.ravel(), state.force.reshape(-1, 3))
    expected = (LAW.bulk_modulus + 4 * LAW.mu0 / 3) * strain
    assert -force[top, 2].sum() == pytest.approx(expected, rel=1e-4)   # second order in the strain
