"""Frusta as items: force, tangent, energy and history are one law, whose slip obeys Coulomb's bound and takes up energy."""

import numpy as np
import pytest
from support.frustum_laws import made_up

from softtact.models.solid.frusta import FrustumItem
from softtact.press.solid_pad import _shapes_over


def three_frusta(parts=(1, 1), **options):
    """An item of frusta under separate nodes, and displacements: all pressed, moved aside and tilted, one hardly."""
    n, rng = (2 * parts[0] + 1) * (2 * parts[1] + 1), np.random.default_rng(0)
    item = FrustumItem(np.arange(3 * n).reshape(3, n), _shapes_over(made_up().root_xy, 1.2, parts), made_up(), **options)
    at_rest = rng.standard_normal((3 * n, 3))
    moved = 0.004 * rng.standard_normal((3, n, 3))
    moved += np.array([[0.05, 0, -0.1], [0.001, 0.002, -0.06], [0.02, -0.03, -0.15]])[:, None]
    return item, at_rest, moved.reshape(-1, 3), 0.002 * rng.standard_normal((3, 2))


def forces(item, at_rest, history, displacement):
    response, force = item.evaluate(history, at_rest + displacement), np.zeros_like(displacement)
    item.add_forces(history, response, force)
    return force, response


@pytest.mark.parametrize("parts", [(1, 1), (2, 1)])
@pytest.mark.parametrize("options", [{"bonded": True}, {"bonded": False, "friction": 0.1}, {"bonded": False}],
                         ids=["bonded", "rough", "smooth"])
def test_the_tangent_with_its_coupling_is_the_derivative_of_the_force(parts, options):
    item, at_rest, u, slip = three_frusta(parts, **options)
    item.first(at_rest)
    (_, response), v, h = forces(item, at_rest, slip, u), np.random.default_rng(1).standard_normal(u.shape), 1e-6
    expected = (forces(item, at_rest, slip, u + h * v)[0] - forces(item, at_rest, slip, u - h * v)[0]) / (2 * h)
    if options.get("friction"):
        assert response.sliding.any() and not response.sliding.all()
    ((nodes, matrices),) = item.tangents(slip, response, at_rest + u)
    np.testing.assert_allclose(matrices, matrices.transpose(0, 2, 1), atol=1e-12)
    found = np.zeros_like(u)
    np.add.at(found, nodes, np.einsum("kij,kj->ki", matrices, v[nodes].reshape(len(nodes), -1)).reshape(*nodes.shape, 3))
    item.add_coupling(slip, response, v, found)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("options", [{"bonded": True}, {"bonded": False}], ids=["bonded", "smooth"])
def test_without_friction_the_force_is_the_derivative_of_the_energy(options):
    item, at_rest, u, slip = three_frusta(**options)
    item.first(at_rest)
    v, h = np.random.default_rng(1).standard_normal(u.shape), 1e-6
    ahead, behind = (item.totals(slip, forces(item, at_rest, slip, u + sign * h * v)[1]).strain_energy for sign in (1, -1))
    assert (forces(item, at_rest, slip, u)[0] * v).sum() == pytest.approx((ahead - behind) / (2 * h), rel=1e-7)


def test_a_descent_of_all_nodes_meets_the_force_of_the_cell_and_a_movement_its_stiffness():
    """Expected: the law's own force at 0.1 mm, 1.2 * 0.1 + 40 * 0.001 = 0.16 N, and 0.33 N/mm at rest."""
    item, at_rest, u, _ = three_frusta()
    none = item.first(at_rest)
    assert forces(item, at_rest, none, np.tile([0, 0, -0.1], (len(u), 1)))[0][:, 2].sum() == pytest.approx(-3 * 0.16)
    assert forces(item, at_rest, none, np.tile([1e-3, 0, 0], (len(u), 1)))[0][:, 0].sum() == pytest.approx(3 * 0.33e-3)


def test_a_tip_slides_at_coulombs_bound_takes_up_energy_and_goes_on_from_there():
    """Pressed by 0.1 mm (0.16 N each) and drawn to and fro: mu p = 0.016 N aside; work is stored or dissipated."""
    item, at_rest, u, _ = three_frusta(bonded=False, friction=0.1)
    history, places = item.first(at_rest), np.concatenate([np.linspace(0, 0.2, 81), np.linspace(0.2, -0.1, 121)[1:]])
    work, dissipated, before, last, start = 0.0, 0.0, 0.0, 0.0, None
    for x in places:
        force, response = forces(item, at_rest, history, np.tile([x, 0, -0.1], (len(u), 1)))
        aside = force[:, 0].sum()
        assert abs(aside) <= 3 * 0.016 * (1 + 1e-9)
        start = item.totals(history, response).strain_energy if start is None else start
        work += 0.5 * (aside + before) * (x - last)
        dissipated += item.dissipated_mj(history, response)
        history, before, last = item.begin_step(history, response, at_rest, at_rest), aside, x
    assert response.sliding.all() and aside == pytest.approx(-3 * 0.016)
    stored = item.totals(history, response).strain_energy - start
    assert dissipated > 0.9 * work and work == pytest.approx(stored + dissipated, rel=0.02)     # 0.0025 mm a step


def test_a_frustum_that_is_lifted_bears_nothing_aside_on_a_free_tip():
    item, at_rest, u, _ = three_frusta(bonded=False, friction=0.5)
    force, response = forces(item, at_rest, item.first(at_rest), np.tile([0.05, 0, 0.02], (len(u), 1)))
    assert np.abs(force[:, :2].sum(axis=0)).max() < 1e-12 and response.bound.max() == 0.0
