"""The press of any mesh: fast tetrahedra against naive ones, differences of the energy, and the ways to factor the contact."""

import numpy as np
import pytest
from free_bodies.free_body import FreeBody, RigidContact, SolidElements, flat_surface, ground
from free_bodies.free_press import FreeSettings, _least_squares, press_to_forces, press_to_indentations
from free_bodies.tetrahedra import LinearTetrahedra

from softtact.fem.solid_block import SolidBlock
from softtact.linalg.direct import PardisoSingle
from softtact.materials.laws.registry import make_law

pytestmark = pytest.mark.slow     # kernels that nothing else needs are compiled

LAWS = {
    "mooney_rivlin": make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040}, bulk_modulus=7.0),
    "yeoh": make_law("yeoh", {"c10": 0.18, "c20": -0.01, "c30": 0.004}, bulk_modulus=7.0),
}
# Six tetrahedra of a cube, by the bits of its corners (Kuhn).
_KUHN = [(0, 1, 3, 7), (0, 1, 5, 7), (0, 2, 3, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 4, 6, 7)]


def block(cells=(3, 3, 2)):
    """A brick of cells of 1 mm in tetrahedra, its top at z = 0: points (n, 3), tetrahedra (e, 4)."""
    nx, ny, nz = (n + 1 for n in cells)
    points = np.array([[i, j, k - cells[2]] for k in range(nz) for j in range(ny) for i in range(nx)], dtype=float)
    points[:, :2] -= 0.5 * np.asarray(cells[:2])
    number = np.arange(len(points)).reshape(nz, ny, nx)
    tets = [[number[k + (c >> 2), j + (c >> 1 & 1), i + (c & 1)] for c in tet]
            for k in range(cells[2]) for j in range(cells[1]) for i in range(cells[0]) for tet in _KUHN]
    tets = np.array(tets)
    x = points[tets]
    negative = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    tets[negative] = tets[negative][:, [0, 2, 1, 3]]
    return points, tets


def naive(points, tets, law, displacement):
    """Energy by the formula, one element after another."""
    total = 0.0
    for tet in tets:
        edges = (points[tet[1:]] - points[tet[0]]).T
        F = (points + displacement)[tet[1:]].T - (points + displacement)[tet[0]][:, None]
        F = F @ np.linalg.inv(edges)
        J, C = np.linalg.det(F), F.T @ F
        i1, i2 = J ** (-2 / 3) * np.trace(C), J ** (-4 / 3) * 0.5 * (np.trace(C) ** 2 - np.trace(C @ C))
        psi = law.derivatives(np.array(i1), np.array(i2)).psi
        total += np.linalg.det(edges) / 6 * (float(psi) + 0.5 * law.bulk_modulus * (J - 1) ** 2)
    return total


def shaken(points, size=0.1):
    return size * np.random.default_rng(1).normal(size=points.shape)


def test_energy_of_tetrahedra_is_the_formulas():
    for name in LAWS:
        points, tets = block()
        energy, _ = LinearTetrahedra(points, tets, LAWS[name]).add_force(shaken(points), np.zeros_like(points))
        assert energy == pytest.approx(naive(points, tets, LAWS[name], shaken(points)), rel=1e-12)


def test_forces_of_tetrahedra_are_differences_of_the_naive_energy():
    for name in LAWS:
        points, tets = block((1, 1, 2))
        force, u = np.zeros_like(points), shaken(points)
        LinearTetrahedra(points, tets, LAWS[name]).add_force(u, force)
        for node, axis in ((0, 0), (5, 1), (7, 2), (11, 0)):
            move = np.zeros_like(points)
            move[node, axis] = 1e-5
            slope = (naive(points, tets, LAWS[name], u + move) - naive(points, tets, LAWS[name], u - move)) / 2e-5
            assert force[node, axis] == pytest.approx(slope, abs=1e-8)   # central difference: rounding 1e-11, curvature 1e-10


@pytest.mark.slow
def test_tetrahedra_agree_with_solid_blocks_of_one_point():
    for name in LAWS:
        for threads in [1, 2]:
            points, tets = block()
            fast = LinearTetrahedra(points, tets, LAWS[name], threads=threads)
            gradients = np.concatenate([-fast.gradients.sum(axis=1, keepdims=True), fast.gradients], axis=1)
            slow = SolidElements(tets, SolidBlock(gradients[:, None], fast.volumes[:, None], np.ones((1, 1)), LAWS[name]))
            held = np.zeros(points.shape, dtype=bool)
            held[:7], held[9, 1] = True, True
            bodies = [FreeBody(points, [part], held=held) for part in (fast, slow)]
            states = [body.evaluate(shaken(points), 0.0) for body in bodies]
            assert np.allclose(states[0].force, states[1].force, atol=1e-13)
            for body, state in zip(bodies, states, strict=True):
                body.factor(state)
            matrices = [body._matrix.data for body in bodies]
            assert np.abs(matrices[0] - matrices[1]).max() <= 1e-12 * np.abs(matrices[1]).max()


def test_a_tangent_is_the_difference_of_the_forces():
    points, tets = block((2, 2, 1))
    held = points[:, 2] < -0.99
    body = FreeBody(points, [LinearTetrahedra(points, tets, LAWS["yeoh"])], held=np.repeat(held[:, None], 3, axis=1))
    state = body.evaluate(np.where(held[:, None], 0.0, shaken(points, 0.03)), 0.0)
    body.factor(state)
    upper = body._matrix.toarray()
    tangent = upper + np.triu(upper, 1).T
    for k in (0, 4, 17):
        move = np.zeros(len(tangent))
        move[k] = 1e-6
        slope = (body.residual(body.moved(state, move, 0.0)) - body.residual(body.moved(state, -move, 0.0))) / 2e-6
        assert np.abs(tangent[k] - slope).max() < 1e-8 * np.abs(tangent).max()


def test_tetrahedra_of_a_law_whose_volumetric_function_is_not_quadratic_are_refused():
    law = make_law("neo_hooke", {"c10": 0.2}, volumetric="logarithmic")
    with pytest.raises(ValueError, match="the volumetric function 'logarithmic' is not that of linear tetrahedra; use 'quadratic'"):
        LinearTetrahedra(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]), law)


def test_tetrahedra_turned_inside_out_are_refused_and_noticed():
    points, tets = block((1, 1, 1))
    with pytest.raises(ValueError, match="inverted"):
        LinearTetrahedra(points, tets[:, [1, 0, 2, 3]], LAWS["yeoh"])
    assert LinearTetrahedra(points, tets, LAWS["yeoh"]).add_force(-2.0 * points, np.zeros_like(points)) is None


def test_tetrahedra_know_volumes_from_a_nineteenth_to_the_nineteenfold():
    for stretch in [0.375, 0.6, 1.0, 1.7, 2.66]:
        points, tets = block()
        energy, _ = LinearTetrahedra(points, tets, LAWS["yeoh"]).add_force((stretch - 1) * points, np.zeros_like(points))
        # The energy of a change of volume; the rounding of F's other invariants is 1e-15 of K V.
        assert energy == pytest.approx(18 * 0.5 * 7.0 * (stretch**3 - 1) ** 2, rel=1e-12, abs=1e-12)


def test_tetrahedra_beyond_that_count_as_inside_out():
    for stretch in [0.36, 2.7]:
        points, tets = block()
        assert LinearTetrahedra(points, tets, LAWS["yeoh"]).add_force((stretch - 1) * points, np.zeros_like(points)) is None


def pressed_block(*, law="mooney_rivlin", glued=False, board=False, **options):
    """A brick on a board or held below, pressed by a plate or with its top glued to it."""
    points, tets = block()
    held, follows, contacts = np.zeros(points.shape, dtype=bool), np.zeros(points.shape), []
    below, above = points[:, 2] < -1.99, points[:, 2] > -0.01
    held[below, :2] = True
    held[below, 2] = not board

    def faces(nodes):
        sides = tets[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3)
        return sides[nodes[sides].all(axis=1)]

    def contact(nodes, surface, moves):
        shape, areas = np.full((1, 3), 1 / 3), np.full((len(faces(nodes)), 1), 0.5)
        return RigidContact(points, faces(nodes), shape, areas, surface, moves=moves, stiffness=200.0, smoothing=1e-3)

    if glued:
        held[above, 2], follows[above, 2] = True, 1.0
    else:
        contacts.append(contact(above, flat_surface(0.0), True))
    if board:
        contacts.append(contact(below, ground(-2.0), False))
    return FreeBody(points, [LinearTetrahedra(points, tets, LAWS[law])], held=held, follows=follows, contacts=contacts, **options)


EXACT = FreeSettings(relative_residual=1e-9, relative_correction=1.0)


def test_contact_kept_out_of_the_factor_gives_the_same_press():
    depths = [0.1, 0.2, 0.3]
    forces = [[load_step.state.object_force for load_step in press_to_indentations(pressed_block(apart=apart), depths,
                                                                                   settings=EXACT)]
              for apart in (False, True)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-8)


def test_single_precision_factors_lead_to_the_same_balance():
    bodies = [pressed_block(solver=solver) for solver in (None, PardisoSingle())]
    forces = [[load_step.state.object_force for load_step in press_to_indentations(body, [0.15, 0.3], settings=EXACT)]
              for body in bodies]
    assert forces[1] == pytest.approx(forces[0], rel=1e-8)


def test_a_force_is_reached_at_the_depth_that_gives_it():
    depth = [load_step.state for load_step in press_to_indentations(pressed_block(), [0.1, 0.2], settings=EXACT)]
    force = [load_step.state for load_step in press_to_forces(pressed_block(), [s.object_force for s in depth], settings=EXACT)]
    assert [s.indentation for s in force] == pytest.approx([s.indentation for s in depth], rel=1e-7)


def test_work_of_a_glued_plate_is_the_stored_energy():
    depths = np.linspace(0, 0.4, 9)
    states = [load_step.state for load_step in press_to_indentations(pressed_block(glued=True), depths[1:], settings=EXACT)]
    forces = np.array([0.0] + [s.object_force for s in states])
    simpson = (forces[:-2:2] + 4 * forces[1:-1:2] + forces[2::2]).sum() * (depths[1] - depths[0]) / 3
    assert simpson == pytest.approx(states[-1].energy, rel=1e-4)   # Simpson's rule over eight steps of a smooth curve


def test_a_block_on_a_board_is_pressed_as_hard_as_it_presses_the_board():
    body = pressed_block(board=True)
    state = list(press_to_indentations(body, [0.1, 0.2], settings=EXACT))[-1].state
    near = state.displacement[body.contacts[1].near_nodes]
    assert body.contacts[1].near_force(near, 0.0)[:, 2].sum() == pytest.approx(-state.object_force, rel=1e-7)


def test_earlier_steps_are_weighed_as_by_singular_values():
    rng = np.random.default_rng(3)
    rows, target = rng.normal(size=(4, 50)) * np.array([[1.0], [1e-6], [10.0], [1e-3]]), rng.normal(size=50)
    expected = np.linalg.lstsq(rows.T, target, rcond=None)[0]
    assert _least_squares(rows, target) == pytest.approx(expected, rel=1e-9)      # normal equations, condition 10: 1e-15 times 100


def test_a_step_without_change_or_made_twice_leaves_the_weighed_sum_as_it_is():
    for third in [0.0, 1.0]:
        rng = np.random.default_rng(4)
        rows, target = rng.normal(size=(2, 30)), rng.normal(size=30)
        more = np.vstack([rows, third * rows[0]])
        assert _least_squares(more, target) @ more == pytest.approx(_least_squares(rows, target) @ rows, abs=1e-12)
