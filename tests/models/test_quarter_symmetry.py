"""The quarter of a slab: its parities against the whole body, its interpolation and forces, and condensed inverses."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from softtact.fem.elements import HEX27
from softtact.fem.solid_block import HexBlock
from softtact.materials.laws.registry import make_law
from softtact.models.elastic.compliance import surface_grid
from softtact.models.quarter_symmetry import (
    PARITIES,
    LinearLayer,
    ParityBlocks,
    ParityProduct,
    QuarterSlab,
    SignedPlaces,
    element_stiffness,
)

SOFT = LinearLayer(1.0, bulk_modulus=4.0, shear_modulus=0.3)
STIFF = LinearLayer(1.5, bulk_modulus=0.8, shear_modulus=0.5, shares=(0.6, 0.4))
FOOTPRINT, CELLS = (6.0, 4.0), (3, 2)
ROUND_OFF = 1e-9      # relative, of two direct solutions whose conditions are some 1e5


def dofs(nodes, axis):
    return 3 * np.asarray(nodes).ravel() + axis


def blocks_of(slab, kept):
    return ParityBlocks(np.stack([slab.compliance(slab.stiffness, kept, parity) for parity in PARITIES]))


class WholeSlab:
    """The same slab without symmetry: of one twice as large the quarter is the whole. Held at four sides, and the base or not."""

    def __init__(self, footprint_mm, layers, cells, *, base_held, held_below_mm=0.0):
        slab = QuarterSlab([2 * side for side in footprint_mm], layers, [2 * count for count in cells], base_held=base_held,
                           held_below_mm=held_below_mm)
        free = np.ones((*slab.numbers.shape, 3), dtype=bool)
        below = slab.points[:, 2].reshape(slab.numbers.shape) <= 1e-9 - held_below_mm
        sides = np.zeros(slab.numbers.shape, dtype=bool)
        sides[:, [0, -1]] = sides[:, :, [0, -1]] = True
        free[below & sides] = False
        if base_held:
            free[0] = False
        self.free, self.stiffness, self.unknowns = np.flatnonzero(free), slab.stiffness, slab.unknowns
        inner = slice(1, -1) if held_below_mm == 0 else slice(None)
        self.top = slab.numbers[-1, inner, inner].ravel()      # in the order of `surface_grid`'s nodes

    def displacement(self, force):
        """Displacement (unknowns,) under forces (unknowns,) at the nodes."""
        moved = np.zeros(self.unknowns)
        moved[self.free] = spsolve(self.stiffness[self.free][:, self.free].tocsc(), force[self.free])
        return moved


# --- symmetry ---


@pytest.mark.parametrize(("base_held", "held_below_mm"), [(True, 0.0), (False, 0.0), (False, 1.5), (True, 0.7), (True, np.inf)])
def test_the_parities_give_the_displacements_of_the_whole_slab(base_held, held_below_mm):
    how = {"base_held": base_held, "held_below_mm": held_below_mm}
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, **how)
    whole, grid = WholeSlab(FOOTPRINT, [SOFT, STIFF], CELLS, **how), surface_grid(slab)
    compliance, nodes = blocks_of(slab, dofs(slab.top, 2)), np.arange(grid.count)
    middle = grid.count // 2                                 # where both lines of symmetry cross
    for loaded in (middle, middle + 2, middle - 2 * grid.shape[1], 0, grid.shape[1] + 3, grid.count - 2):
        force = np.zeros(whole.unknowns)
        force[dofs(whole.top[loaded], 2)] = -1.0
        expected = -whole.displacement(force)[dofs(whole.top, 2)]
        got = compliance.between(*grid.quarter(nodes), *grid.quarter(np.array([loaded])))[:, 0]
        np.testing.assert_allclose(got, expected, atol=ROUND_OFF * expected.max())


def test_movement_sideways_turns_its_sign_with_the_place():
    """Of x-displacement under vertical forces, the quarter's blocks take the sign of x once more."""
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=True)
    whole, grid = WholeSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=True), surface_grid(slab)
    blocks, count = blocks_of(slab, np.concatenate([dofs(slab.top, 2), dofs(slab.top, 0)])), slab.top.size
    sideways, loaded = ParityBlocks(blocks.blocks[:, count:, :count]), grid.shape[1] + 3
    numbers, signs = grid.quarter(np.arange(grid.count))
    got = sideways.between(numbers, signs, *grid.quarter(np.array([loaded])))[:, 0] * signs[:, 0]
    force = np.zeros(whole.unknowns)
    force[dofs(whole.top[loaded], 2)] = 1.0
    expected = whole.displacement(force)[dofs(whole.top, 0)]
    np.testing.assert_allclose(got, expected, atol=ROUND_OFF * np.abs(expected).max())


def test_the_compliance_is_symmetric_and_positive():
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=True)
    grid, blocks = surface_grid(slab), blocks_of(slab, dofs(slab.top, 2))
    np.testing.assert_allclose(blocks.blocks, blocks.blocks.transpose(0, 2, 1), atol=ROUND_OFF * blocks.blocks.max())
    places = grid.quarter(np.arange(grid.count))
    whole = blocks.between(*places, *places)
    assert np.linalg.eigvalsh(whole).min() > 0
    np.testing.assert_allclose(whole, whole[::-1, ::-1], atol=ROUND_OFF * whole.max())      # turned by half a turn


def test_products_by_parity_are_those_with_the_matrix_between_the_places():
    rng = np.random.default_rng(4)
    blocks = ParityBlocks(rng.normal(size=(4, 7, 9)))
    rows, columns = (SignedPlaces(rng.integers(0, count, many), rng.choice([-1, 1], (many, 2)), rng.uniform(-2, 2, many))
                     for count, many in ((7, 20), (9, 30)))
    matrix = blocks.between(rows.numbers, rows.signs, columns.numbers, columns.signs) * np.outer(rows.factors, columns.factors)
    product, loads, forces = ParityProduct(blocks, rows, columns), rng.normal(size=(30, 3)), rng.normal(size=(3, 20))
    for got, expected in ((product @ loads, matrix @ loads), (product @ loads[:, 0], matrix @ loads[:, 0]),
                          (forces @ product, forces @ matrix), (forces[0] @ product, forces[0] @ matrix)):
        np.testing.assert_allclose(got, expected, atol=1e-12)


# --- mechanics ---


@pytest.mark.parametrize("layer", [SOFT, STIFF])
def test_an_element_is_as_stiff_as_the_nonlinear_one_at_rest(layer):
    law = make_law("neo_hooke", {"c10": 0.5 * layer.shear_modulus}, bulk_modulus=layer.bulk_modulus)
    size = np.array([0.5, 0.7, 0.2])
    nonlinear = HexBlock(0.5 * HEX27.nodes[None] * size, law).tangent(np.zeros((1, 27, 3)))[0]
    np.testing.assert_allclose(element_stiffness(layer, size), nonlinear, rtol=0, atol=1e-14 * nonlinear.max())


def test_a_wide_thin_layer_yields_to_even_pressure_as_if_confined():
    """Depth = p t / (K + 4 mu / 3), the oedometer modulus: stress over strain where no strain is sideways (Hooke)."""
    for bulk, shear in [(4.0, 0.3), (0.66, 0.55), (0.1, 0.5)]:
        thickness, pressure = 1.0, 1e-3
        slab = QuarterSlab((24.0, 24.0), [LinearLayer(thickness, bulk, shear, (0.5, 0.5))], (8, 8), base_held=True)
        load = np.zeros(slab.unknowns)
        load[dofs(slab.numbers[-1], 2)] = pressure * np.outer(*(_simpson(line) for line in (slab.y, slab.x))).ravel()
        free = slab.free((0, 0))
        moved = np.zeros(slab.unknowns)
        moved[free] = spsolve(slab.stiffness[free][:, free].tocsc(), load[free])
        middle = moved[dofs(slab.numbers[-1, :5, :5], 2)]      # 3 mm: the held sides are nine thicknesses away
        np.testing.assert_allclose(middle, pressure * thickness / (bulk + 4 / 3 * shear), rtol=0.01)


def _simpson(line):
    """Integration weights of quadratic elements on a line."""
    weights = np.zeros(len(line))
    for first in range(0, len(line) - 1, 2):
        weights[first:first + 3] += line[2] * np.array([1, 4, 1]) / 6
    return weights


def test_an_even_strain_leaves_the_inner_nodes_of_one_material_in_balance():
    slab = QuarterSlab(FOOTPRINT, [STIFF], CELLS, base_held=False)
    gradient = np.array([[0.1, 0.2, 0.0], [0.0, -0.1, 0.3], [0.2, 0.0, 0.1]])
    force = (slab.stiffness @ (slab.points @ gradient.T).ravel()).reshape(*slab.numbers.shape, 3)
    assert np.abs(force[1:-1, 1:-1, 1:-1]).max() < 1e-12 * np.abs(force).max() * 100      # round-off of 27 nodes


def test_the_layers_lie_at_their_heights_below_the_top():
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=True)
    np.testing.assert_allclose(np.unique(slab.points[:, 2].round(12)), [-2.5, -2.0, -1.5, -1.05, -0.6, -0.3, 0.0], atol=1e-12)
    assert (slab.points[slab.below_top(slab.boundary_over(SOFT)).ravel(), 2] == -1.5).all()      # the border of the two materials
    assert (slab.points[slab.top.ravel(), 2] == 0.0).all()
    assert slab.points[:, :2].max(axis=0) == pytest.approx([3.0, 2.0])


@pytest.mark.parametrize(("held_below_mm", "levels"), [
    (1.4, [-2.5, -1.5, -1.4, -0.6, 0.0]), (0.5, [-2.5, -1.5, -0.5, 0.0]), (2.0, [-2.5, -2.0, -1.5, -0.6, 0.0])])
def test_a_boundary_between_elements_lies_where_sides_begin_to_be_held(held_below_mm, levels):
    """The nearest inner one, or a new one where none is near, or none may move."""
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=True, held_below_mm=held_below_mm)
    np.testing.assert_allclose(slab.heights[::2], levels, atol=1e-12)
    np.testing.assert_array_equal(slab.side_held, slab.heights <= -held_below_mm + 1e-9)


def test_the_mean_forces_of_an_even_strain_are_hookes():
    """Integrals of s_xx, s_yy, s_xy over two cells of the plan, by hand from strain and moduli."""
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=False)
    gradient = np.array([[0.02, 0.05, -0.01], [0.01, -0.03, 0.02], [0.04, 0.0, 0.015]])
    moved = (slab.points @ gradient.T).ravel()
    strain = 0.5 * (gradient + gradient.T)
    stresses = [2 * layer.shear_modulus * strain + (layer.bulk_modulus - 2 / 3 * layer.shear_modulus) * np.trace(strain) * np.eye(3)
                for layer in (SOFT, STIFF)]
    through = sum(layer.thickness * stress for layer, stress in zip((SOFT, STIFF), stresses, strict=True))
    expected = np.array([through[0, 0], through[1, 1], through[0, 1]])
    forces = slab.mean_forces(lambda x, y: np.where(y < 1.0, np.where(x < 2.0, 0, -1), 1), 2)
    got = np.array([matrix @ moved for matrix in forces])
    np.testing.assert_allclose(got, np.outer(expected, [2.0 * 1.0, 3.0 * 1.0]), rtol=1e-10)


def test_interpolation_is_exact_for_quadratic_fields():
    slab = QuarterSlab(FOOTPRINT, [SOFT], CELLS, base_held=True)
    points = np.random.default_rng(0).uniform(0, 1, (40, 2)) * [3.0, 2.0]
    points[:2] = [[0, 0], [3.0, 2.0]]

    def field(x, y):
        return 1 + x - 2 * y + 0.5 * x * y - x**2 + 0.3 * x**2 * y**2

    nodes = field(*(grid.ravel() for grid in np.meshgrid(slab.x, slab.y)))
    np.testing.assert_allclose(slab.interpolation(points) @ nodes, field(*points.T), atol=1e-11)


@pytest.mark.parametrize("held_below_mm", [0.0, np.inf])
def test_fields_of_the_whole_top_are_what_the_compliance_between_places_gives(held_below_mm):
    slab = QuarterSlab(FOOTPRINT, [SOFT, STIFF], CELLS, base_held=True, held_below_mm=held_below_mm)
    compliance, grid = blocks_of(slab, dofs(slab.top, 2)), surface_grid(slab)
    loaded, loads = np.array([0, 3, 7, grid.count // 2, grid.count - 2]), np.arange(10.0).reshape(5, 2)
    for every, nodes in ((1, np.arange(grid.count)), (2, grid.second_nodes)):
        fields = compliance.fields(slab.top.shape, *grid.quarter(loaded), loads, every=every)
        assert fields.reshape(2, -1).T == pytest.approx(compliance.between(*grid.quarter(nodes), *grid.quarter(loaded)) @ loads)
