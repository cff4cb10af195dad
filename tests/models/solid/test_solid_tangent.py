"""The tangent is the derivative of the residual, and the residual that of the potential, with contact and pressure in them."""

from dataclasses import replace

import numpy as np
import pytest

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.errors import ConvergenceError
from softtact.fem.kernels_plain import PlainLoops
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.blocks import region_blocks
from softtact.models.solid.body import SolidBody
from softtact.models.solid.frames import FramePose
from softtact.models.solid.items import FacePressure, with_pressures

RUBBER = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=20)


def two_blocks(friction, geometry="solid", seed=1):
    """Two blocks of other divisions and distorted, curved faces that overlap by some micrometres."""
    if geometry == "solid":
        lower, upper = box((0, 0, 0), (2, 2, 1), (2, 2, 1), region="lower"), box((0.2, 0.3, 1), (1.6, 1.9, 2), (1, 2, 1))
        names = ("z1", "z0", "z0", "z1")
    else:
        lower = box((0.5, 0), (2, 1), (3, 2), region="lower", geometry=geometry)
        upper = box((0.7, 1), (1.8, 2), (2, 2), geometry=geometry)
        names = ("y1", "y0", "y0", "y1")
    rng = np.random.default_rng(seed)
    plane = [1, 1, 1] if geometry == "solid" else [1, 1, 0]
    lower, upper = (mesh.moved(lambda x: x + 0.02 * np.sin(3 * x[:, [1, 2, 0]] + 1) * plane) for mesh in (lower, upper))
    mesh = lower.joined(upper, prefix="upper ")
    body = SolidBody(mesh, {"lower": RUBBER, "upper body": RUBBER}, held={names[2]: "xyz"[:sum(plane)]},
                     carried={"top": ((0, 0, 0), ["upper " + names[3]])})
    body.add(ContactPair(Surface.of(mesh.face("upper " + names[1])), Surface.of(mesh.face(names[0])), stiffness=50.0,
                              reach_mm=0.3, friction=friction, axisymmetric=geometry == "axisymmetric"))
    body.add(FacePressure(Surface.of(mesh.boundary), body.points, axisymmetric=geometry == "axisymmetric"))
    return body, rng


def pressed_state(body, rng, ways):
    """A state that is not in balance, with deep contact."""
    displacement = 0.01 * rng.standard_normal(body.points.shape) * body.free_components
    rest = body.rest()
    pose = FramePose().moved(np.array(ways, float))
    return body.evaluate(displacement - [0, 0.03, 0.05] * body.free_components * (body.points[:, 2:] + body.points[:, 1:2] > 1.02),
                         (pose,), with_pressures(body.items, rest.item_histories, [0.02]))


def without_pressure(body, state):
    return body.with_histories(state, with_pressures(body.items, state.item_histories, [0.0]))


def rubbing(body, state):
    """The state with friction on all points under pressure, from where they met the other surface on."""
    (pair, history, contact), (_, pressure, _) = body.item_states(state)
    found = body.with_histories(state, (pair.anchored(history, contact, body.points + state.displacement), pressure))
    assert np.array_equal(np.linalg.norm(found.contacts[0].friction, axis=1) > 0, contact.pressure > 0)
    return found


def whole_matrix(body, state):
    upper = body.tangent(state).toarray()
    return np.triu(upper) + np.triu(upper, 1).T


@pytest.mark.parametrize("geometry", ["solid", "plane_strain", "axisymmetric"])
def test_the_tangent_of_bodies_in_frictionless_contact_is_the_derivative_of_the_residual(geometry):
    body, rng = two_blocks(0.0, geometry)
    state = pressed_state(body, rng, [0.01, -0.03, -0.05 if geometry == "solid" else 0, 0, 0, 0])
    assert state.contacts[0].pressure.max() > 0.5, "the blocks touch"
    state = without_pressure(body, state)
    matrix, v, h = whole_matrix(body, state), rng.standard_normal(len(body.free)), 1e-6
    ahead, behind = (body.residual(body.moved(state, s * h * v, [np.zeros(6)])) for s in (1, -1))
    expected = (ahead - behind) / (2 * h)
    np.testing.assert_allclose(matrix @ v, expected, atol=2e-6 * np.abs(expected).max())


@pytest.mark.parametrize("geometry", ["solid", "plane_strain"])
def test_the_residual_is_the_derivative_of_the_potential_with_friction_but_for_turning_normals(geometry):
    body, rng = two_blocks(0.4, geometry)
    state = pressed_state(body, rng, [0.01, -0.03, -0.05 if geometry == "solid" else 0, 0, 0, 0])
    state = rubbing(body, without_pressure(body, state))
    v, h = rng.standard_normal(len(body.free)), 1e-6
    ahead, behind = (body.moved(state, s * h * v, [np.zeros(6)]).energy for s in (1, -1))
    assert state.contacts[0].slides.any()
    assert body.residual(state) @ v == pytest.approx((ahead - behind) / (2 * h), rel=3e-2)


def test_with_its_coupling_the_tangent_of_sliding_friction_is_the_derivative_of_the_residual_but_for_turning_normals():
    body, rng = two_blocks(0.4)
    state = pressed_state(body, rng, [0.01, -0.03, -0.05, 0, 0, 0])
    state = rubbing(body, without_pressure(body, state))
    v, h = rng.standard_normal(len(body.free)), 1e-7
    ahead, behind = (body.residual(body.moved(state, s * h * v, [np.zeros(6)])) for s in (1, -1))
    change, coupling = np.zeros(body.points.size), np.zeros_like(body.points)
    change[body.free] = v
    body.pairs[0].add_coupling(state.histories[0], state.contacts[0], change.reshape(-1, 3), coupling)
    expected, symmetric = (ahead - behind) / (2 * h), whole_matrix(body, state) @ v
    error, without = (np.abs(got - expected).max() / np.abs(expected).max()
                      for got in (symmetric + coupling.ravel()[body.free], symmetric))
    assert state.contacts[0].slides.any()
    assert error < 0.02 < 0.1 < without


def test_a_solution_with_sliding_friction_is_that_of_the_matrix_and_its_coupling():
    body, rng = two_blocks(0.4)
    state = pressed_state(body, rng, [0.01, -0.03, -0.05, 0, 0, 0])
    state = rubbing(body, without_pressure(body, state))
    right = rng.standard_normal((len(body.free), 2))
    for k, found in enumerate(body.solve(state, right, turning=False).T):
        change, coupling = np.zeros(body.points.size), np.zeros_like(body.points)
        change[body.free] = found
        body.pairs[0].add_coupling(state.histories[0], state.contacts[0], change.reshape(-1, 3), coupling)
        felt = coupling.ravel()[body.free]
        assert np.linalg.norm(felt) > 0.01 * np.linalg.norm(right[:, k])
        off = body.solver.product(body._matrix, found) + felt - right[:, k]
        assert np.linalg.norm(off) < 2e-6 * np.linalg.norm(right[:, k])      # what GMRES is asked for, twice


def test_a_follower_pressure_on_a_closed_surface_has_no_resultant_and_a_symmetric_derivative():
    body, rng = two_blocks(0.0)
    x = body.points + 0.02 * rng.standard_normal(body.points.shape)
    face, force = body.pressures[0], np.zeros_like(x)
    face.add_forces(0.3, face.evaluate(0.3, x), force)
    np.testing.assert_allclose(force.sum(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0, atol=1e-12)
    ((nodes, matrices),) = face.tangents(0.3, None, x)
    whole = np.zeros((x.size, x.size))
    for own, matrix in zip(nodes, matrices, strict=True):
        dofs = (3 * own[:, None] + np.arange(3)).ravel()
        whole[np.ix_(dofs, dofs)] += matrix
    v, h, change = rng.standard_normal(x.shape), 1e-6, []
    for sign in (1, -1):
        moved = np.zeros_like(x)
        face.add_forces(0.3, face.evaluate(0.3, x + sign * h * v), moved)
        change.append(moved)
    np.testing.assert_allclose(whole @ v.ravel(), ((change[0] - change[1]) / (2 * h)).ravel(), atol=1e-7)


def test_fast_loops_of_spatial_elements_agree_with_the_plain_ones():
    mesh = box((0, 0, 0), (1, 1, 1), (2, 1, 1)).moved(lambda x: x + 0.05 * np.sin(4 * x[:, [1, 2, 0]]))
    (_, nodes, fast), = region_blocks(mesh, {"body": RUBBER})
    (_, _, plain), = region_blocks(mesh, {"body": RUBBER})
    plain.loops = PlainLoops(np.zeros((len(nodes), fast.at_rest.volumes.shape[1], nodes.shape[1])))
    moved = (0.05 * np.random.default_rng(2).standard_normal(mesh.points.shape))[nodes]
    one, other = fast.evaluate(moved), plain.evaluate(moved)
    np.testing.assert_allclose(one.force, other.force, atol=1e-13)
    np.testing.assert_allclose(fast.tangent(moved), plain.tangent(moved), atol=1e-12 * np.abs(one.force).max() + 1e-11)


@pytest.mark.parametrize("turning", [True, False])
def test_a_tangent_that_is_no_number_ends_the_increment(turning):
    mesh = box((0, 0, 0), (2, 2, 1), (2, 2, 1))
    body = SolidBody(mesh, {"body": RUBBER}, held={"z0": "xyz"})
    state = replace(body.rest(), displacement=np.where(body.points[:, 2:] > 0.9, np.nan, np.zeros_like(body.points)))
    with pytest.raises(ConvergenceError, match="no number"):
        body.solve(state, np.ones((len(body.free), 1)), turning=turning)
