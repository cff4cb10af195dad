"""Bodies of one material: homogeneous tests, Cook's membrane, bonded rubber.

All by the naive solver of `fe.py` with the sensor's element.
"""

import numpy as np
import pytest
from fe import equilibrium, face_load, fine_disc, mapped, small_strain, solid

from softtact.fem.elements import HEX20
from softtact.fem.extruded_mesh import extrude, grid_mesh_2d
from softtact.materials.laws.registry import make_law

UNIAXIAL = {   # one CalculiX 2.20 element, K = 20 mu0, stretches 0.7 and 1.5, printed to six digits
    "mooney_rivlin": ({"c10": 0.1706, "c01": 0.0040}, {0.7: -0.466273, 1.5: 0.356118}),
    "ogden2": ({"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910}, {0.7: -0.847201, 1.5: 0.281311}),
}


def linear_material(young, poisson):
    """A law whose small-strain constants are E (MPa) and nu."""
    mu = young / (2 * (1 + poisson))
    return make_law("neo_hooke", {"c10": 0.5 * mu}, bulk_modulus=young / (3 * (1 - 2 * poisson)))


def box(cells, sizes, law, **options):
    """A box with a corner at the origin, of cells (3,) equal hexahedra."""
    x, y, z = (np.linspace(0, size, count + 1) for size, count in zip(sizes, cells, strict=True))
    return solid(extrude(grid_mesh_2d(x, y), z), law, **options)


def on_symmetry_planes(points):
    """Mask (n, 3) of the displacements that vanish on the planes x = 0, y = 0, z = 0."""
    return np.abs(points) < 1e-9


@pytest.mark.parametrize("stretch", [0.7, 1.5])
@pytest.mark.parametrize("name", UNIAXIAL)
def test_a_pulled_block_carries_the_stress_that_another_program_found(name, stretch, record):
    constants, gold = UNIAXIAL[name]
    expected, source = gold[stretch], "CalculiX 2.20, one element"
    body = box((2, 2, 2), (1.0, 1.0, 1.0), make_law(name, constants))
    held = on_symmetry_planes(body.points)
    top = body.points[:, 2] > 1 - 1e-9
    held[top, 2] = True
    displacement = np.zeros_like(body.points)
    for part in np.linspace(1.0, stretch, 5)[1:]:       # in steps: Newton's method with whole steps has a limited reach
        displacement = equilibrium(body, held, (part - 1) * body.points * [0, 0, 1], start=displacement)
    got = body.energy_and_force(displacement)[1][top, 2].sum()
    error = record(f"uniaxial nominal stress, {name}, K = 20 mu0, stretch {stretch}", expected=expected, source=source, got=got)
    assert error < 5e-7 / abs(expected) * 1.2       # half a unit of the sixth printed digit, and CalculiX's own tolerance


def test_confined_compression_has_the_oedometer_modulus(record):
    law = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})
    expected, source = law.bulk_modulus + 4 * law.mu0 / 3, "K + 4 mu/3"
    body = box((2, 2, 2), (1.0, 1.0, 1.0), law)
    low, high = body.points == 0, body.points == 1
    held = low | high
    displacement = small_strain(body, held, -body.points * [0, 0, 1])
    force = (body.stiffness(np.zeros_like(body.points)) @ displacement.ravel()).reshape(-1, 3)
    got = -force[high[:, 2], 2].sum()
    assert record("modulus of confined compression", expected=expected, source=source, got=got) < 1e-12   # round-off


def cooks_membrane(cells, law, *, thickness, plane_strain, **options):
    """Vertical displacement of the right side's middle and upper corner under a unit shear force (per unit thickness)."""
    lines = np.linspace(0, 1, cells + 1)

    def to_membrane(p):
        x, y = 48 * p[:, 0], p[:, 1]
        return np.column_stack([x, (44 / 48) * x + y * (44 - 28 / 48 * x), p[:, 2]])

    body = solid(mapped(extrude(grid_mesh_2d(lines, lines), [0.0, thickness]), to_membrane), law, **options)
    held = np.repeat((body.points[:, 0] < 1e-9)[:, None], 3, axis=1)
    held[:, 2] = plane_strain | (body.points[:, 2] < 1e-9)       # plane stress: free to thin, symmetric about z = 0
    right = body.hexes[:, HEX20.sides[1]]
    right = right[(body.points[right][..., 0] > 48 - 1e-9).all(axis=1)]
    load = face_load(body.points, right, [0.0, 1 / 16, 0.0])
    displacement = small_strain(body, held, 0.0, load)

    def at(x, y):
        return displacement[np.argmin(np.abs(body.points - [x, y, 0]).sum(axis=1)), 1]

    return at(48, 52), at(48, 60)


def test_cooks_membrane_bends_as_published(record):
    expected, source = 23.96, "literature, converged (plane stress, E = 1, nu = 1/3, unit load; middle of the loaded side)"
    # A plate as thin as 1/160 of its side is in plane stress.
    law = linear_material(1.0, 1 / 3)
    coarse, got = (cooks_membrane(cells, law, thickness=0.1, plane_strain=False)[0] for cells in (8, 32))
    error = record("Cook's membrane, plane stress, 32 x 32 elements", expected=expected, source=source, got=got)
    assert error < 2e-4           # half a unit of the last printed digit
    assert coarse < got and coarse / got > 0.995


def test_cooks_membrane_in_plane_strain_agrees_with_three_programs(record):
    expected, source = 32.27, "CalculiX 32.27, Elmer 32.27, Code_Aster 32.20 (CoFEA's collection; E = 70, nu = 0.33, 6.25 MPa)"
    got = 100 / 70 * cooks_membrane(32, linear_material(1.0, 0.33), thickness=1.0, plane_strain=True)[1]
    error = record("Cook's membrane, plane strain, upper corner", expected=expected, source=source, got=got)
    assert error < 2e-3           # the three programs differ by 0.2 %


def limit_of(values):
    """The limit of three values on meshes halved twice (Aitken)."""
    first, second, third = values
    return third - (third - second) ** 2 / (third - 2 * second + first)


def test_cooks_membrane_tends_to_the_same_limit_as_an_element_without_projection(record):
    """nu = 0.4995, plane strain. The plain displacement element locks, but in the limit of refinement it is right too."""
    source = "limit of the displacement element (J at every point, no projection), 8 to 32 elements a side"
    law = linear_material(1.0, 0.4995)
    plain = [cooks_membrane(cells, law, thickness=1.0, plane_strain=True, unprojected_penalty_ratio=1e9)[1]
             for cells in (8, 16, 32)]
    expected = limit_of(plain)
    projected = [cooks_membrane(cells, law, thickness=1.0, plane_strain=True)[1] for cells in (8, 16, 32)]
    error = record("Cook's membrane, nu = 0.4995, limit of refinement", expected=expected, source=source,
                   got=limit_of(projected))
    assert error < 2e-3           # what the extrapolation of a corner singularity is good for
    assert plain[0] < projected[0] < projected[1] < projected[2] < expected      # both from below, ours nearer


def test_cooks_membrane_does_not_lock_as_poissons_ratio_tends_to_one_half(record):
    """Volumetric locking would make the displacement on one mesh fall with K; the plain element's falls to a third."""
    expected, source = 1.0, "absence of locking: the coarse mesh's share of the limit does not depend on K"
    coarse = [cooks_membrane(4, linear_material(1.0, nu), thickness=1.0, plane_strain=True)[1] for nu in (0.4995, 0.4999995)]
    got = coarse[1] / coarse[0]
    error = record("Cook's membrane, 4 x 4 elements: displacement at nu = 0.4999995 over that at 0.4995", expected=expected,
                   source=source, got=got)
    assert error < 2e-3           # the exact displacement itself falls by 0.1 %
    plain = [cooks_membrane(4, linear_material(1.0, nu), thickness=1.0, plane_strain=True, unprojected_penalty_ratio=1e9)[1]
             for nu in (0.4995, 0.4999995)]
    assert plain[1] / plain[0] < 0.95      # the test can tell a locking element from one that does not


def bonded_compression(mesh_2d, half_height, law, *, layers, plane_strain):
    """Mean stress over strain (MPa) of a block between bonded rigid plates, at small strain; plan of a unit cross-section."""
    load_steps = half_height * (1 - np.linspace(1, 0, layers + 1) ** 2)       # finer at the plate, where shear is greatest
    body = solid(extrude(mesh_2d, load_steps), law)
    z = body.points[:, 2]
    plate, middle = z > half_height - 1e-9, z < 1e-9
    held = np.zeros(body.points.shape, dtype=bool)
    held[plate] = True
    held[middle, 2] = True
    if plane_strain:
        held[:, 1] = True
        held[np.abs(body.points[:, 0]) < 1e-9, 0] = True
    displacement = small_strain(body, held, np.where(plate, -half_height, 0.0)[:, None] * [0, 0, 1.0])
    force = (body.stiffness(np.zeros_like(body.points)) @ displacement.ravel()).reshape(-1, 3)
    return -force[plate, 2].sum()


@pytest.mark.parametrize("shape", [2.0, 8.0, 32.0])
def test_a_bonded_disc_is_stiffened_as_gent_and_lindley_say(shape, record):
    """The formula leaves out the edge, a zone as wide as the disc is high: an error of the order of 1/S."""
    expected, source = 1 + 2 * shape**2, "Gent and Lindley: E (1 + 2 S^2), E = 1 MPa"
    law = linear_material(1.0, 0.5 - 1e-8)
    got = bonded_compression(fine_disc(6), 1 / (4 * shape), law, layers=6, plane_strain=False) / np.pi
    error = record(f"bonded disc, S = {shape:g}: apparent modulus", expected=expected, source=source, got=got)
    assert error < 0.04 / shape + 0.001       # the edge; the mesh


@pytest.mark.parametrize("shape", [2.0, 8.0, 32.0])
def test_a_bonded_strip_is_stiffened_as_gent_and_lindley_say(shape, record):
    """Here the edge takes about 0.13/S, in proportion to its width, whatever the mesh."""
    expected, source = 4 / 3 * (1 + shape**2), "Gent and Lindley: 4/3 E (1 + S^2), E = 1 MPa"
    x = 1 - np.linspace(1, 0, 25) ** 2
    law = linear_material(1.0, 0.5 - 1e-8)
    got = bonded_compression(grid_mesh_2d(x, np.array([0.0, 1.0])), 1 / (2 * shape), law, layers=6, plane_strain=True)
    error = record(f"bonded strip, S = {shape:g}: apparent modulus", expected=expected, source=source, got=got)
    assert error < 0.15 / shape
