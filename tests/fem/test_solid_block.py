"""Blocks of elements: joined ones and single precision give what each alone gives in double precision."""

import numpy as np
import pytest
from scipy.optimize import brentq

from softtact.fem.elements import HEX27
from softtact.fem.extruded_mesh import extrude, sheet_mesh_2d
from softtact.fem.solid_block import HexBlock, WedgeBlock, hanging_node_constraints, joined
from softtact.materials.laws.registry import make_law
from softtact.materials.laws.volumetric import VOLUMETRIC_FUNCTIONS

LAWS = [make_law("mooney_rivlin", {"c10": 0.17, "c01": 0.004}, bulk_modulus=7.0),
        make_law("neo_hooke", {"c10": 0.3}, bulk_modulus=9.0)]


def parts():
    """Elements of a frustum's cell: two laws, hexahedra and wedges, some that hang on nodes of larger ones."""
    mesh = extrude(sheet_mesh_2d(np.zeros((1, 2)), (1, 1), 1.2, 0.9, (1.2, 1.2)).mesh_2d, np.array([0.0, 0.2, 0.5]))
    lower, upper = (mesh.layer(k) for k in (0, 1))
    found = [(lower, HexBlock(mesh.points[lower], LAWS[0])), (upper, HexBlock(mesh.points[upper], LAWS[0])),
             (upper[:2], HexBlock(mesh.points[upper[:2]], LAWS[1]))]
    wedges = mesh.wedge_layer(0)
    if len(wedges):
        found.append((wedges, WedgeBlock(mesh.points[wedges], LAWS[0])))
    masters, weights = np.arange(len(mesh.points))[:, None].repeat(2, axis=1), np.tile([1.0, 0.0], (len(mesh.points), 1))
    masters[0], weights[0] = (1, 2), (0.5, 0.5)
    hanging = lower[:1]
    found.append(hanging_node_constraints(masters, weights, hanging, HexBlock(mesh.points[hanging], LAWS[0])))
    return mesh.points, found


def total(field, solids):
    """Energy and nodal forces (n, 3) of all."""
    states = [(nodes, block.evaluate(field[nodes])) for nodes, block in solids]
    force = np.zeros_like(field)
    for nodes, state in states:
        np.add.at(force, nodes.ravel(), state.force.reshape(-1, 3))
    return sum(state.energy for _, state in states), force


def test_joined_blocks_have_the_energy_and_the_forces_of_their_parts():
    points, solids = parts()
    field = 0.002 * np.random.default_rng(0).normal(size=points.shape)
    energy, force = total(field, solids)
    whole = joined(solids)
    assert len(whole) < len(solids)
    together, forces = total(field, whole)
    assert together == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(forces, force, atol=1e-12 * np.abs(force).max())
    again, _ = total(field, solids)          # the parts live on, in the new arrays
    assert again == pytest.approx(energy, rel=1e-12)


def test_tangents_in_single_precision_are_those_in_double_precision_to_seven_digits():
    for options in [{}, {"unprojected_penalty_ratio": 0.5}, {"quartic_penalty_ratio": 100.0, "trilinear": True}]:
        block = HexBlock(0.5 * HEX27.nodes[None], LAWS[0], **options)
        field = 0.02 * np.random.default_rng(1).normal(size=(1, 27, 3))
        exact, rough = block.tangent(field), block.tangent(field, precision=np.float32)
        assert rough.dtype == np.float32
        assert np.abs(rough - exact).max() < 2e-6 * np.abs(exact).max()      # sums of 81 products of seven digits


def test_elements_with_hanging_nodes_take_the_displacement_of_their_masters():
    """Up to three masters a node, some twice in an element, some without weight."""
    rng, points = np.random.default_rng(4), 0.5 * HEX27.nodes + np.zeros((4, 1, 1))
    masters, weights = rng.integers(0, 40, size=(60, 3)), rng.normal(size=(60, 3)) * rng.integers(0, 2, size=(60, 3))
    weights[:, 0] = 1.0
    elements, field = rng.integers(0, 60, size=(4, 27)), 0.002 * rng.normal(size=(40, 3))
    own = np.einsum("nw,nwi->ni", weights, field[masters])
    expected = HexBlock(points, LAWS[0]).evaluate(own[elements])
    nodes, block = hanging_node_constraints(masters, weights, elements, HexBlock(points, LAWS[0]))
    found = block.evaluate(field[nodes])
    np.testing.assert_allclose(found.energies, expected.energies, rtol=1e-11)
    passed_on, force = np.zeros((40, 3)), np.zeros((40, 3))
    each = expected.force.reshape(-1, 1, 3) * weights[elements].reshape(-1, 3, 1)
    np.add.at(passed_on, masters[elements].ravel(), each.reshape(-1, 3))
    np.add.at(force, nodes.ravel(), found.force.reshape(-1, 3))
    np.testing.assert_allclose(force, passed_on, atol=1e-11 * np.abs(passed_on).max())


def projected(block, field):
    """A field (e, g) at all elements' points, projected on the pressure's functions: a least-squares fit, points by volume."""
    rows = []
    for values, volumes in zip(field, block.at_rest.volumes[block.at_rest.shapes], strict=True):
        root, basis = np.sqrt(volumes), block.at_rest.basis
        rows.append(basis @ np.linalg.lstsq(root[:, None] * basis, root * values, rcond=None)[0])
    return np.array(rows)


def test_the_energy_of_volume_changes_is_that_of_the_formulas_written_down_plainly():
    for options in [{}, {"unprojected_penalty_ratio": 0.5}, {"quartic_penalty_ratio": 100.0},
                    {"unprojected_penalty_ratio": 4.0, "quartic_penalty_ratio": 100.0, "trilinear": True}]:
        points = 0.5 * HEX27.nodes + 0.02 * np.random.default_rng(2).normal(size=(3, 27, 3))
        block = HexBlock(points, LAWS[0], **options)
        J = 1 + 0.2 * np.random.default_rng(3).normal(size=(3, 27)).clip(-2, 2)
        K, k, q = block.law.bulk_modulus, block.unprojected_modulus, block.quartic_modulus
        seen = projected(block, J - 1)
        density = (K - k) / 2 * seen**2 + k / 4 * (J**2 - 1 - 2 * np.log(J)) + q / 4 * (J - 1 - seen) ** 4
        held = q * (J - 1 - seen) ** 3
        pressure = (K - k) * seen + k / 2 * (J - 1 / J) + held - projected(block, held)
        found = block._volumetric(J, block.at_rest)
        np.testing.assert_allclose(found.energies, (block.at_rest.volumes[block.at_rest.shapes] * density).sum(axis=1), rtol=1e-12)
        np.testing.assert_allclose(found.pressure, pressure, rtol=1e-11, atol=1e-12 * np.abs(pressure).max())
        assert found.quartic.shape == ((3, 27) if q else (0, 0))
        if q:
            np.testing.assert_allclose(found.quartic, 3 * q * (J - 1 - seen) ** 2, rtol=1e-9, atol=1e-12 * (q + 1))


VOLUMES = [make_law("mooney_rivlin", {"c10": 0.17, "c01": 0.004}, bulk_modulus=7.0, volumetric=name)
           for name in VOLUMETRIC_FUNCTIONS]


@pytest.mark.parametrize("law", VOLUMES, ids=list(VOLUMETRIC_FUNCTIONS))
@pytest.mark.parametrize("options", [{}, {"unprojected_penalty_ratio": 0.5, "quartic_penalty_ratio": 100.0, "trilinear": True}])
def test_forces_and_tangents_are_the_energys_derivatives_for_every_volumetric_function(law, options):
    """Central differences: errors of step^2 and of rounding over step, both below 1e-8 of the largest entry."""
    rng = np.random.default_rng(6)
    points = 0.5 * HEX27.nodes[None] + 0.02 * rng.normal(size=(1, 27, 3))
    block, field, step = HexBlock(points, law, **options), 0.03 * rng.normal(size=(1, 27, 3)), 1e-5
    state, K = block.evaluate(field), block.tangent(field)[0]
    for way in rng.normal(size=(4, 1, 27, 3)):
        ahead, behind = (block.evaluate(field + sign * step * way) for sign in (1, -1))
        assert (ahead.energy - behind.energy) / (2 * step) == pytest.approx(state.force.ravel() @ way.ravel(), rel=1e-6, abs=1e-8)
        slope = (ahead.force - behind.force)[0] / (2 * step)
        np.testing.assert_allclose(K @ way.ravel(), slope, atol=1e-7 * np.abs(slope).max())
    assert np.abs(K - K.T).max() < 1e-12 * np.abs(K).max()


@pytest.mark.parametrize("law", VOLUMES, ids=list(VOLUMETRIC_FUNCTIONS))
def test_an_element_pressed_between_free_sides_has_the_stress_of_the_uniaxial_test(law):
    points, stretch = 0.5 * HEX27.nodes[None], 0.6
    block = HexBlock(points, law, trilinear=True)

    def forces(lateral):
        force = block.evaluate(points * (np.array([lateral, lateral, stretch]) - 1)).force.reshape(27, 3)
        return [force[points[0, :, axis] > 0.49, axis].sum() for axis in (0, 2)]

    lateral = brentq(lambda value: forces(value)[0], 1.0, 1.5, xtol=1e-13)
    assert forces(lateral)[1] == pytest.approx(law.uniaxial_compressible(stretch), rel=1e-9)     # on a face of 1 mm2


def test_volumetric_functions_differ_where_an_element_is_pressed_in_a_rigid_box():
    """Height 0.8 of what it was, sides held: U' is -1.4 MPa against K/2 (J - 1/J) = -1.575 MPa, the shape's part is the same."""
    points = 0.5 * HEX27.nodes[None]
    forces = [HexBlock(points, law).evaluate(points * np.array([0.0, 0.0, -0.2])).force.reshape(27, 3) for law in VOLUMES]
    top = [force[points[0, :, 2] > 0.49, 2].sum() for force in forces]
    assert top[1] - top[0] == pytest.approx(-1.575 + 1.4, rel=1e-10)


def test_an_element_whose_projected_volume_vanishes_has_no_logarithmic_energy():
    """J > 0 at every point and yet a projection below 0: what the linear functions make of a strong bend."""
    block = HexBlock(0.5 * HEX27.nodes[None], VOLUMES[1])
    J = np.full((1, 27), 0.01)
    J[0, :9] = 3.0
    assert block._volumetric(J, block.at_rest) is None
