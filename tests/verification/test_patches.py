"""Elements: patch test, tangents, rigid motion, order of convergence.

The 20-node hexahedron with its projected pressure, alone and in small meshes.
"""

import numpy as np
import pytest
from fe import equilibrium, mapped, small_strain, solid
from scipy.spatial.transform import Rotation

from softtact.fem.elements import HEX20
from softtact.fem.extruded_mesh import disc_mesh_2d, extrude, grid_mesh_2d
from softtact.fem.solid_block import HexBlock
from softtact.materials.laws.registry import make_law

MOONEY = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})
FRUSTA = {"unprojected_penalty_ratio": 0.5, "quartic_penalty_ratio": 100.0, "trilinear": True}     # as in `MeshSettings`
GRADIENT = np.array([[0.05, 0.10, 0.0], [-0.02, -0.10, 0.03], [0.04, 0.0, 0.08]])
POINTS = pytest.mark.parametrize("points", [2, 3])


def distorted_mesh():
    """3 x 3 x 3 hexahedra with straight sides, inner corners moved by up to a fifth of an element."""
    lines = np.linspace(0.0, 3.0, 4)
    rng = np.random.default_rng(3)

    def moved(points):
        inside = ((points > 0) & (points < 3)).all(axis=1)
        return points + 0.2 * rng.uniform(-1, 1, points.shape) * inside[:, None]

    return mapped(extrude(grid_mesh_2d(lines, lines), lines), moved)


def on_the_faces_of_its_box(points):
    return ((points < points.min(axis=0) + 1e-9) | (points > points.max(axis=0) - 1e-9)).any(axis=1)


def bent_element(seed=0):
    """One hexahedron (1, 20, 3) whose nodes are all moved, so that sides and faces are curved."""
    return (HEX20.nodes + 0.05 * np.random.default_rng(seed).standard_normal((20, 3)))[None]


@POINTS
def test_distorted_elements_pass_the_patch_test_at_finite_strain(points, record):
    """Faces moved by an affine map, the inside off by 0.02 mm: Newton's method has to find the same map there."""
    expected, source = 0.0, "an affine map is in balance in a uniform body (Irons)"
    body = solid(distorted_mesh(), MOONEY, reduced=points == 2, unprojected_penalty_ratio=0.5)
    affine = body.points @ GRADIENT.T
    held = np.repeat(on_the_faces_of_its_box(body.points)[:, None], 3, axis=1)
    start = affine + 0.02 * np.random.default_rng(4).standard_normal(affine.shape)
    got = np.abs(equilibrium(body, held, affine, start=start) - affine).max()
    record(f"patch test, distorted hexahedra, {points}^3 points: largest deviation, displacement up to 0.4 mm",
           expected=expected, source=source, got=got)
    assert got < 1e-12      # round-off of the solution: 1e-16 times the matrix's condition of about 1e3


def test_a_frustum_passes_the_patch_test_although_its_sides_are_curved(record):
    """Inner nodal forces of an affine map vanish; 27 points integrate the curved elements' gradients exactly."""
    expected, source = 0.0, "an affine map is in balance in a uniform body (Irons)"
    mesh = extrude(disc_mesh_2d(), [0.0, 0.2, 0.5], scale=lambda z: 0.3 + 0.6 * z)
    body = solid(mesh, MOONEY, unprojected_penalty_ratio=4.0)
    force = body.energy_and_force(body.points @ GRADIENT.T)[1]
    r = np.hypot(*mesh.points[:, :2].T) / (0.3 + 0.6 * mesh.points[:, 2])
    inside = (r < 0.9) & (mesh.points[:, 2] > 1e-9) & (mesh.points[:, 2] < 0.5 - 1e-9)
    got = np.abs(force[inside]).max() / np.abs(force).max()
    record("patch test, frustum: largest inner nodal force over the largest of all", expected=expected, source=source, got=got)
    assert inside.sum() >= 8 and got < 1e-13      # round-off


@POINTS
def test_the_energy_of_an_affine_map_is_volume_times_density(points, record):
    """The element's volumetric density is (K - k)/2 (J-1)^2 + k/4 (J^2 - 1 - 2 ln J)."""
    F = np.eye(3) + GRADIENT
    C, J = F.T @ F, np.linalg.det(F)
    isochoric = MOONEY.isochoric(C[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]][None]).energy[0]
    k, K = 0.5 * MOONEY.mu0, MOONEY.bulk_modulus
    expected = 27.0 * (isochoric + 0.5 * (K - k) * (J - 1) ** 2 + 0.25 * k * (J**2 - 1 - 2 * np.log(J)))
    body = solid(distorted_mesh(), MOONEY, reduced=points == 2, unprojected_penalty_ratio=0.5)
    got = body.energy_and_force(body.points @ GRADIENT.T)[0]
    error = record(f"energy of an affine map, distorted hexahedra, {points}^3 points", expected=expected,
                   source="27 mm3 times the energy density", got=got)
    assert error < 1e-12      # round-off


@POINTS
@pytest.mark.parametrize("name", ["mooney_rivlin", "ogden2"])
@pytest.mark.parametrize("held", [{"unprojected_penalty_ratio": 0.5}, FRUSTA], ids=["linear", "frusta"])
def test_force_is_the_slope_of_energy_and_tangent_the_slope_of_force(points, name, held, record):
    law = {"mooney_rivlin": MOONEY,
           "ogden2": make_law("ogden2", {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910})}[name]
    rng = np.random.default_rng(1)
    block = HexBlock(bent_element(), law, reduced=points == 2, **held)
    displacement = 0.05 * rng.standard_normal((1, 20, 3))
    direction, step = rng.standard_normal((1, 20, 3)), 1e-5
    plus, minus = (block.evaluate(displacement + sign * step * direction) for sign in (1, -1))
    expected = (plus.energy - minus.energy) / (2 * step)
    slope = block.evaluate(displacement).force.ravel() @ direction.ravel()
    # central differences: the truncation is of order step^2 = 1e-10 times a third derivative of order 10
    assert slope == pytest.approx(expected, rel=1e-7)
    difference = ((plus.force - minus.force) / (2 * step)).ravel()
    product = block.tangent(displacement)[0] @ direction.ravel()
    got = np.linalg.norm(product - difference) / np.linalg.norm(difference)
    record(f"element tangent against differences of its forces, {name}, {points}^3 points"
           + (", as in frusta" if held is FRUSTA else "") + ": relative deviation",
           expected=0.0, source="central differences, step 1e-5 mm", got=got)
    assert got < 1e-7


def test_a_rigid_rotation_on_top_changes_no_energy_and_turns_the_forces(record):
    """x -> Q x + c after any deformation: energy stays, nodal forces and tangent turn by Q (frame indifference)."""
    block = HexBlock(bent_element(), MOONEY, **FRUSTA)
    coordinates = bent_element()
    displacement = 0.05 * np.random.default_rng(2).standard_normal((1, 20, 3))
    Q = Rotation.from_euler("xyz", [0.7, -1.1, 2.0]).as_matrix()
    turned = (coordinates + displacement) @ Q.T + np.array([3.0, -2.0, 1.0]) - coordinates
    here, there = block.evaluate(displacement), block.evaluate(turned)
    error = record("energy after a rigid motion on top of a deformation", expected=here.energy, source="frame indifference",
                   got=there.energy)
    assert error < 1e-12      # round-off
    expected = here.force.reshape(20, 3) @ Q.T
    got = np.abs(there.force.reshape(20, 3) - expected).max() / np.abs(expected).max()
    record("nodal forces after a rigid motion, turned back: relative deviation", expected=0.0, source="frame indifference",
           got=got)
    assert got < 1e-12
    whole = np.kron(np.eye(20), Q)
    expected = whole @ block.tangent(displacement)[0] @ whole.T
    assert np.abs(block.tangent(turned)[0] - expected).max() < 1e-12 * np.abs(expected).max()


def harmonic(points):
    """grad(sin x sin y sinh(sqrt(2) z)): without divergence, in balance without body forces for any K and mu."""
    x, y, z = points.T
    s = np.sqrt(2.0)
    return np.column_stack([np.cos(x) * np.sin(y) * np.sinh(s * z), np.sin(x) * np.cos(y) * np.sinh(s * z),
                            s * np.sin(x) * np.sin(y) * np.cosh(s * z)])


def error_at_nodes(cells, law, points):
    """Root mean square over the free nodes of the error in displacement, relative to the displacement's."""
    lines = np.linspace(0.0, 1.0, cells + 1)
    mesh = mapped(extrude(grid_mesh_2d(lines, lines), lines), lambda p: p + 0.08 * np.sin(np.pi * p) @ np.array(
        [[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]]) * np.sin(np.pi * p))
    body = solid(mesh, law, reduced=points == 2)
    exact = harmonic(body.points)
    held = np.repeat(on_the_faces_of_its_box(body.points)[:, None], 3, axis=1)
    free = ~held[:, 0]
    deviation = (small_strain(body, held, exact) - exact)[free]
    return np.sqrt((deviation**2).sum() / (exact[free] ** 2).sum())


@POINTS
@pytest.mark.parametrize("ratio", [20.0, 1e4])
def test_a_smooth_solution_is_approached_at_the_elements_order(ratio, points, record):
    expected, source = 3.0, "quadratic elements: error of displacement ~ h^3"
    law = make_law("neo_hooke", {"c10": 0.5}, bulk_over_shear=ratio)
    coarse, fine = (error_at_nodes(cells, law, points) for cells in (3, 6))
    got = np.log2(coarse / fine)
    record(f"observed order of convergence, K/mu = {ratio:g}, {points}^3 points", expected=expected, source=source, got=got,
           at_least=True)
    assert got > expected      # at nodes of such smooth meshes it is better than at other points
