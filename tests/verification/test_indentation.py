"""Contact: Hertz, flat punch, thin layer, layered half-space, and both models on the same layer.

A block of half-width and depth L stands for the half-space; its depth of indentation is off by a term in a/L, which two sizes
remove (Richardson). Contact radius and pressure depend on the force and need no such correction.
"""

import numpy as np
import pytest
from slabs import HeldSlab, flat_punch, graded, interpolate, mirrored, paraboloid
from tetrahedral_layer import layer_compliance

from softtact.contact.penalty import penalty
from softtact.contact.unilateral import active_set
from softtact.materials.laws.registry import make_law
from softtact.models.quarter_symmetry import LinearLayer, QuarterSlab

YOUNG, POISSON = 1.0, 0.3
MODULUS = YOUNG / (1 - POISSON**2)      # E*, MPa
A, RADIUS = 1.0, 100.0                  # contact radius and ball's radius in mm: strains of A / RADIUS are small
DEPTH = A**2 / RADIUS
FORCE = 4 * MODULUS * A**3 / (3 * RADIUS)
PEAK = (6 * FORCE * MODULUS**2 / (np.pi**3 * RADIUS**2)) ** (1 / 3)
HERTZ = "Hertz; Johnson, Contact Mechanics, sec. 4.2"
PUNCH = "F = 2 a E* depth; Johnson, sec. 3.8"


def linear_law(young, poisson=POISSON):
    """A law whose small-strain constants are E (MPa) and nu."""
    return make_law("neo_hooke", {"c10": young / (4 * (1 + poisson))}, bulk_modulus=young / (3 * (1 - 2 * poisson)))


# --- unilateral contact by active sets, on a half-space and on tetrahedra ---

CELLS = 3      # along the contact radius


def tetrahedral_block(cells, far, growing):
    """Compliance of a block of half-width and depth `far`, with `cells` along A near the contact."""
    equal = round(4 / 3 * cells)
    lines = graded(equal * A / cells, equal, far, growing)
    return layer_compliance(mirrored(lines), mirrored(lines), -lines[::-1], young=YOUNG, poisson=POISSON)


@pytest.fixture(scope="module")
def tetrahedral_blocks():
    return [tetrahedral_block(CELLS, 8.0, 6), tetrahedral_block(CELLS, 16.0, 9)]


def tetrahedral_depth(compliance, surface):
    load_step, = active_set(compliance.compliance, surface(*compliance.points.T)[0], [FORCE])
    return load_step.indentation


def test_a_sphere_on_boussinesqs_half_space_indents_as_hertz_says_and_better_on_a_finer_grid(record):
    """The contact solver alone: the closed compliance of a half-space in place of a mesh."""
    expected, source = DEPTH, HERTZ
    depths, radii = zip(*(boussinesq_press(cells) for cells in (5, 10, 20)), strict=True)
    for cells, depth in zip((5, 10, 20), depths, strict=True):
        record(f"active sets on Boussinesq's half-space, {cells} cells along a: depth", expected=expected, source=source,
               got=depth)
    errors = np.abs(np.array(depths) / expected - 1)
    assert errors[2] < 0.01 and (errors[1:] < 0.7 * errors[:-1]).all()      # first order: constant pressure in each cell
    assert record("the same, 20 cells: contact radius", expected=A, source=HERTZ, got=radii[2]) < 0.05      # one cell


def boussinesq_press(cells):
    """Depth and contact radius under FORCE; nodes at the centres of squares of uniform pressure."""
    h = A / cells
    side = np.arange(-round(1.2 * cells), round(1.2 * cells) + 1) * h
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(distance, h / (4 * np.log(1 + np.sqrt(2))))      # the mean of 1/r over the square, from its centre
    load_step, = active_set(1 / (np.pi * MODULUS * distance), paraboloid(RADIUS)(*points.T)[0], [FORCE])
    return load_step.indentation, np.sqrt((load_step.nodal_force > 0).sum() * h * h / np.pi)


@pytest.mark.slow
def test_a_sphere_on_a_block_of_tetrahedra_indents_as_hertz_says(tetrahedral_blocks, record):
    expected, source = DEPTH, HERTZ
    small, large = (tetrahedral_depth(block, paraboloid(RADIUS)) for block in tetrahedral_blocks)
    got = 2 * large - small                                           # the term in a/L removed
    assert small < large < expected                                   # tetrahedra and held sides can only stiffen
    # Linear tetrahedra of a/3 and a term in (a/L)^2, each 1 to 1.5 %.
    assert record("tetrahedra, sphere: depth", expected=expected, source=source, got=got) < 0.03


def test_contact_radius_and_pressure_on_tetrahedra_converge_to_hertz(tetrahedral_blocks, record):
    blocks = {CELLS: tetrahedral_blocks[0], 5: tetrahedral_block(5, 8.0, 5)}
    errors = []
    for cells, compliance in blocks.items():
        load_step, = active_set(compliance.compliance, paraboloid(RADIUS)(*compliance.points.T)[0], [FORCE])
        area = (A / cells) ** 2
        radius = np.sqrt((load_step.nodal_force > 0).sum() * area / np.pi)
        # the contact's edge lies between two nodes: half a cell at most
        assert record(f"tetrahedra, {cells} cells along a: contact radius", expected=A, source=HERTZ, got=radius) < 0.5 / cells
        shape = np.sqrt(np.maximum(1 - (compliance.points**2).sum(axis=1) / A**2, 0.0))
        peak = (load_step.nodal_force @ shape) / (shape @ shape * area)       # of the nearest Hertzian distribution
        errors.append(record(f"tetrahedra, {cells} cells along a: greatest pressure", expected=PEAK, source=HERTZ, got=peak))
    assert errors[1] < errors[0] < 0.2 / CELLS and errors[1] < 0.2 / 5      # first order: lumped at nodes, edge between them


def test_a_flat_punch_on_a_block_of_tetrahedra_follows_the_closed_form(tetrahedral_blocks, record):
    nodes = (np.hypot(*tetrahedral_blocks[0].points.T) <= A).sum()
    a = np.sqrt(nodes / np.pi) * A / CELLS                            # the circle with the area of the pressed nodes
    expected, source = FORCE / (2 * a * MODULUS), PUNCH
    small, large = (tetrahedral_depth(block, flat_punch(A * 1.0001)) for block in tetrahedral_blocks)
    # As for the sphere; the pressure's singular edge costs another per cent.
    assert record("tetrahedra, flat punch: depth", expected=expected, source=source, got=2 * large - small) < 0.04


def test_the_work_on_a_block_of_tetrahedra_is_its_stored_energy(tetrahedral_blocks, record):
    """Stored: half of nodal forces times displacements. Work: of the whole force on the depth, in steps from half the load."""
    source, errors, compliance = "conservation of energy, half of force times displacement", [], tetrahedral_blocks[0]
    for steps in (4, 16):
        forces = np.linspace(0.5 * FORCE, FORCE, steps + 1)
        load_steps = list(active_set(compliance.compliance, paraboloid(RADIUS)(*compliance.points.T)[0], forces))
        first, last = (0.5 * load_step.nodal_force @ load_step.displacement for load_step in (load_steps[0], load_steps[-1]))
        work = np.trapezoid(forces, [load_step.indentation for load_step in load_steps])
        errors.append(record(f"tetrahedra: work in {steps} steps", expected=last - first, source=source, got=work))
    assert errors[1] < errors[0] / 8      # second order would be a sixteenth; nodes that come into touch make kinks
    assert errors[1] < 1e-4


# --- the elastic model ---


def elastic_depth(far):
    """Depth under FORCE of a ball on the elastic model's hexahedra, half as wide as A, in a block of half-width and depth `far`.

    The load is even in x and y, so one parity's block is all there is: forces of a node and its images together, a quarter each.
    """
    cells = round(2 * far / A)
    z = graded(1.5 * A, 3, far, round(np.log(far / (1.5 * A)) / np.log(1.35)) + 1)
    layer = LinearLayer(far, YOUNG / (3 * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON)), tuple(np.diff(z)[::-1] / far))
    slab = QuarterSlab((2 * far, 2 * far), [layer], (cells, cells), base_held=True)
    x, y = np.meshgrid(slab.x[:-1], slab.y[:-1])
    near = np.hypot(x, y) < 1.3 * A
    compliance = slab.compliance(slab.stiffness, 3 * slab.top[near] + 2, (0, 0)) / 4
    load_step, = active_set(compliance, paraboloid(RADIUS)(x[near], y[near])[0], [FORCE])
    return load_step.indentation


@pytest.mark.slow
def test_a_sphere_on_the_elastic_models_block_indents_as_hertz_says(record):
    expected, source = DEPTH, HERTZ
    small, large = elastic_depth(4.0), elastic_depth(8.0)
    got = 2 * large - small                                           # the term in a/L removed
    assert small < large < expected
    # What is left is of the order of (a/L)^2, 1.6 % for the large block, times a factor under 1.
    assert record("elastic model, sphere: depth", expected=expected, source=source, got=got) < 0.015


# --- the hyperelastic model's slab ---


def block_of(laws_of, *, cells, far, growing, stiffness=300.0):
    """A quarter of a block; laws_of(heights of the layers' middles, mm) gives one law per layer."""
    x = graded(1.5 * A, round(1.5 * cells), far, growing)
    z = -graded(1.5 * A, round(1.5 * cells), far, growing)[::-1]
    laws = laws_of(0.5 * (z[:-1] + z[1:]))
    return HeldSlab(x, x, z, laws, sides="symmetric", stiffness=stiffness * YOUNG / A)


def uniform(law):
    return lambda heights: [law] * len(heights)


def on_a_half_space(value_of_block, laws_of, *, cells):
    """A quantity on two blocks, the term in a/L removed."""
    small, large = (value_of_block(block_of(laws_of, cells=cells, far=far, growing=growing))
                    for far, growing in ((12.0, 4), (24.0, 5)))
    return 2 * large - small


def sphere_force(block):
    return 4 * block.press(paraboloid(RADIUS), DEPTH, tolerance=1e-6).force      # four quarters


def test_a_sphere_on_the_slab_needs_hertzs_force(record):
    expected, source = FORCE, HERTZ
    for cells in (2, 3):
        got = on_a_half_space(sphere_force, uniform(linear_law(YOUNG)), cells=cells)
        error = record(f"slab, sphere, {cells} cells along a: force at given depth", expected=expected, source=source, got=got)
        # penalty: mean pressure / stiffness = 0.2 % of the depth, so 0.3 % of the force; a term in (a/L)^2
        assert error < 0.015


@pytest.mark.slow
def test_the_slabs_contact_radius_and_pressure_are_hertzs(record):
    """At the force that the block carries; pressures are means over element faces, for the penalty's own points ripple."""
    block = block_of(uniform(linear_law(YOUNG)), cells=4, far=12.0, growing=4)
    press = block.press(paraboloid(RADIUS), DEPTH, tolerance=1e-6)
    a = (3 * 4 * press.force * RADIUS / (4 * MODULUS)) ** (1 / 3)
    area = block.slab.top.area.reshape(len(block.slab.top.faces), -1)
    r = np.hypot(*block.slab.top.reference[:, :2].T)
    hertz = 2 * MODULUS / (np.pi * RADIUS) * np.sqrt(np.maximum(a**2 - r**2, 0)).reshape(area.shape)
    expected, got = ((p * area).sum(axis=1)[0] / area[0].sum() for p in (hertz, press.pressure.reshape(area.shape)))
    assert record("slab, sphere: mean pressure on the innermost face", expected=expected, source=HERTZ, got=got) < 0.02
    got = np.sqrt(4 * block.slab.top.area[press.pressure > 0].sum() / np.pi)
    assert record("slab, sphere: contact radius", expected=a, source=HERTZ, got=got) < 0.05      # a point every a/12


@pytest.mark.slow
def test_a_flat_punch_on_the_slab_follows_the_closed_form_and_better_on_a_finer_grid(record):
    source, errors = PUNCH, []
    for cells in (2, 4):
        expected = 2 * A * MODULUS * DEPTH

        def force(block):
            return 4 * block.press(flat_punch(A), DEPTH, tolerance=1e-6).force

        got = on_a_half_space(force, uniform(linear_law(YOUNG)), cells=cells)
        errors.append(record(f"slab, flat punch, {cells} cells along a: force", expected=expected, source=source, got=got))
    assert errors[1] < 0.6 * errors[0] and errors[1] < 0.05      # first order: the stress is singular at the punch's edge


@pytest.mark.slow
def test_a_layered_half_space_lies_between_its_materials_and_equals_each_in_its_limit(record):
    soft, hard = linear_law(YOUNG), linear_law(3 * YOUNG)
    source = "Hertz with the one material; in between, bounds"

    def layered(thickness):
        return lambda heights: [soft if z > -thickness else hard for z in heights]

    forces = [on_a_half_space(sphere_force, layered(t), cells=2) for t in (0.0, 0.5, 1.5, 100.0)]
    assert record("layered half-space, no layer", expected=3 * FORCE, source=source, got=forces[0]) < 0.015
    assert record("layered half-space, layer as thick as the block", expected=FORCE, source=source, got=forces[-1]) < 0.015
    assert (np.diff(forces) < -0.1 * FORCE).all()      # the thicker the soft layer, the softer: all lie between the limits


def test_the_contact_pressure_is_the_slope_of_its_energy_and_its_slope_that_of_the_pressure(record):
    gap, step, k = np.array([-3.3e-3, -1.7e-3, -0.6e-3, -0.1e-3, 0.2e-3]), 1e-7, {"stiffness": 500.0, "smoothing": 1e-3}
    (above, p_above, _), (below, p_below, _) = penalty(gap + step, **k), penalty(gap - step, **k)
    _, pressure, slope = penalty(gap, **k)
    source = "central differences"
    for name, got, expected in (("pressure", pressure, (below - above) / (2 * step)),
                                ("stiffness", slope, (p_below - p_above) / (2 * step))):
        deviation = np.abs(got - expected).max() / np.abs(expected).max()
        record(f"contact {name}: relative deviation", expected=0.0, source=source, got=deviation)
        assert deviation < 1e-8      # the law is piecewise cubic: differences err by step^2 and round-off over step


# --- thin layers ---


def test_a_wide_smooth_punch_on_a_thin_layer_compresses_it_as_if_confined(record):
    """Radius 8 times the thickness; the middle does not know of the edge, whose influence decays over one thickness."""
    young, poisson, thickness = 1.289, 0.1729, 1.0
    expected = young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))      # K + 4 mu/3
    source = "confined compression: pressure = (K + 4 mu/3) depth / thickness"
    lines, z = np.arange(-5.0, 5.5, 0.5), np.linspace(-thickness, 0, 5)
    compliance = layer_compliance(lines, lines, z, young=young, poisson=poisson)
    load_step, = active_set(compliance.compliance, np.where(np.abs(compliance.points).max(axis=1) < 4.1, 0.0, 1e3), [0.1])
    middle = np.abs(compliance.points).max(axis=1) < 1.1
    got = load_step.nodal_force[middle].sum() / (middle.sum() * 0.25) / (load_step.indentation / thickness)
    error = record("tetrahedra, wide punch on a thin layer: modulus in the middle", expected=expected, source=source, got=got)
    assert error < 5e-3      # three thicknesses from the edge its influence has died away
    error = record("tetrahedra, wide punch on a thin layer: contact area", expected=17**2 * 0.5**2,
                   source="17 x 17 pressed nodes, 0.5 mm apart", got=compliance.area[load_step.nodal_force > 0].sum())
    assert error < 0.03      # the triangles' diagonals share out the cells of the rim unevenly
    quarter = lines[lines >= 0]
    slab = HeldSlab(quarter, quarter, z, [linear_law(young, poisson)] * 4, sides="symmetric", stiffness=1e5)
    press = slab.press(flat_punch(4.0), 1e-4, tolerance=1e-6)
    middle = slab.slab.top.reference[:, :2].max(axis=1) < 1.0
    area = slab.slab.top.area[middle]
    got = (press.pressure[middle] @ area) / area.sum() / (press.depth / thickness)
    error = record("slab, wide punch on a thin layer: modulus in the middle", expected=expected, source=source, got=got)
    assert error < 5e-3


@pytest.mark.slow
def test_slab_and_tetrahedra_agree_on_the_same_layer_at_small_load(record):
    """One box of one material, base and sides held, no frusta: the slab's hexahedra against linear tetrahedra."""
    young, poisson, surface, depth = 1.289, 0.1729, paraboloid(1000.0), 2e-3
    source = "tetrahedra of the same box, E and nu, two meshes extrapolated"
    lines = np.linspace(-3, 3, 13)
    slab = HeldSlab(lines, lines, np.linspace(-2, 0, 5), [linear_law(young, poisson)] * 4, sides="held", stiffness=2000.0)
    press = slab.press(surface, depth, tolerance=1e-7)
    meshes = [tetrahedral_press(young, poisson, surface, press.force, cells) for cells in (12, 24)]
    expected_depth, expected_middle = meshes[1] + (meshes[1] - meshes[0]) / 3      # second order in the cell
    middle = -interpolate(slab.slab, press.displacement, np.zeros((1, 2)))[0, 2]
    # the slab's own grid of 0.5 mm under a contact of radius 1.4 mm, and what is left after the extrapolation
    assert record("slab and tetrahedra, sphere on one layer: depth", expected=expected_depth, source=source, got=depth) < 0.01
    assert record("slab and tetrahedra, sphere on one layer: displacement in the middle", expected=expected_middle, source=source,
                  got=middle) < 0.01


def tetrahedral_press(young, poisson, surface, force, cells):
    """Depth, and displacement in the middle, of a layer of tetrahedra of 6 x 6 x 2 mm: (2,) in mm."""
    lines = np.linspace(-3, 3, cells + 1)
    compliance = layer_compliance(lines, lines, np.linspace(-2, 0, cells // 3 + 1), young=young, poisson=poisson)
    load_step, = active_set(compliance.compliance, surface(*compliance.points.T)[0], [force])
    return np.array([load_step.indentation, load_step.displacement[np.hypot(*compliance.points.T) < 1e-9][0]])
