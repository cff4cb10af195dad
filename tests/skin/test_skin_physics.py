"""Deformation and field of a skin against closed forms, against identities, and against another program."""

import numpy as np
import pytest
from scipy.special import j1
from support.skins import small_skin

from softtact.errors import InputError
from softtact.skin.analysis import LayerMeshSizes, Skin
from softtact.skin.electrostatics import VACUUM_FF_PER_MM, ElectricField
from softtact.skin.layer_mesh import LayerMesh, even_mesh, taxel_mesh
from softtact.skin.layout import module_layout
from softtact.skin.loads import Load, disc, ellipse


def test_readings_are_the_same_bytes_on_any_number_of_threads():
    load = disc((8.0, 4.0), diameter_mm=6.0, pressure_mpa=0.05)
    found = set()
    for threads in (1, 4):
        skin = small_skin(threads=threads)
        found.add(skin.field(skin.layer.displacement(load, young_mpa=0.3)).capacitance_ff.tobytes())
    assert len(found) == 1


def test_a_field_of_degree_two_is_interpolated_exactly_within_the_layer():
    mesh = LayerMesh(even_mesh(module_layout(), spacing_mm=5.0), np.array([0.0, 0.7, 2.0]))
    rng = np.random.default_rng(0)
    flat = rng.dirichlet([1, 1, 1], 200) @ module_layout().outline_mm
    points = np.column_stack([flat, rng.uniform(0, 2, 200)])
    quadratic = lambda x: 3 + x[:, 0] - x[:, 0] * x[:, 2] + 0.2 * x[:, 1] ** 2 + x[:, 2] ** 2  # noqa: E731
    # Points are drawn inwards by 1e-9 of the size before they are located.
    assert mesh.interpolation(points) @ quadratic(mesh.nodes_mm) == pytest.approx(quadratic(points), abs=1e-5)


def test_circles_are_followed_by_curved_edges():
    """The area of the discs of taxels, from the mesh: arcs as parabolas leave less than 2e-5, chords would leave 1.1 %."""
    layout = module_layout()
    plan = taxel_mesh(layout, spacing_mm=1.2)
    edge = (plan.circle >= 0) & np.isclose(plan.circles_mm[plan.circle, 2], layout.radius_mm)
    number = np.flatnonzero(edge & (plan.circle == plan.circle[edge][0]))
    number = number[np.argsort(plan.angle[number])]
    corners, middles = plan.points_mm[number], plan.between(number, np.roll(number, -1))
    chords = 0.5 * np.linalg.norm(
        np.cross(
            np.pad(corners - layout.centres_mm[0], ((0, 0), (0, 1))),
            np.pad(np.roll(corners, -1, axis=0) - layout.centres_mm[0], ((0, 0), (0, 1))),
        ),
        axis=1,
    )
    rise = np.linalg.norm(middles - 0.5 * (corners + np.roll(corners, -1, axis=0)), axis=1)
    segments = 2 / 3 * rise * np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    assert chords.sum() + segments.sum() == pytest.approx(np.pi * layout.radius_mm**2, rel=2e-5)
    assert chords.sum() < 0.99 * np.pi * layout.radius_mm**2


def test_a_wide_layer_under_even_pressure_takes_the_confined_modulus():
    """Far from free sides u = p t (1 + nu)(1 - 2 nu) / (E (1 - nu)): bonded and wide, no strain is left sideways."""
    skin = small_skin(thickness_mm=1.0)
    corners = skin.layout.outline_mm
    plan = even_mesh(skin.layout, spacing_mm=0.4)
    points = plan.points_mm[plan.triangles].mean(axis=1)     # of equal areas
    load = Load(points, np.full(len(points), 0.01 * skin.layout.area_mm2 / len(points)), 0.01, "all of it")
    moved = skin.layer.displacement(load, young_mpa=0.2)
    near = points[np.linalg.norm(points - corners.mean(axis=0), axis=1) < 2.0]
    there = skin.layer.at(np.column_stack([near, np.ones(len(near))]), moved)[:, 2].mean()
    nu = skin.layer.poisson
    confined = -0.01 * 1.0 * (1 + nu) * (1 - 2 * nu) / (0.2 * (1 - nu))
    assert there == pytest.approx(confined, rel=3e-3)  # the sides are 5.8 thicknesses away


def test_a_disc_on_a_bonded_layer_sinks_as_the_hankel_transform_says():
    """u(0) = p a int J1(k a) K(k) dk with the layer's kernel K = u / p of an even wave (Johnson, Contact Mechanics, sec. 5.8).

    The module's sides are 5.8 layers away; quadratic elements of 0.7 layers leave less than a percent.
    """
    nu, young, thick, radius, pressure = 0.3, 0.2, 1.0, 1.5, 0.005
    skin = small_skin(poisson=nu, thickness_mm=thick, spacing_mm=0.7, layers=3)
    middle = skin.layout.outline_mm.mean(axis=0)
    moved = skin.layer.displacement(disc(tuple(middle), diameter_mm=2 * radius, pressure_mpa=pressure), young_mpa=young)
    shear, k = young / 2 / (1 + nu), np.linspace(1e-6, 60.0, 200_001)
    x = k * thick
    top = (3 - 4 * nu) * np.sinh(2 * x) - 2 * x
    kernel = (1 - nu) / (shear * k) * top / ((3 - 4 * nu) * np.cosh(2 * x) + 2 * x**2 + 5 - 12 * nu + 8 * nu**2)
    sinks = pressure * radius * np.trapezoid(kernel * j1(k * radius), k)
    assert -skin.layer.at(np.array([[*middle, thick]]), moved)[0, 2] == pytest.approx(sinks, rel=0.01)


def test_forces_on_points_add_up_to_the_load():
    load = ellipse((10.0, 5.0), area_mm2=24.0, pressure_mpa=0.01)
    assert load.total_n == pytest.approx(0.24) and load.points_mm.mean(axis=0) == pytest.approx((10, 5))
    second = load.force_n @ (load.points_mm - (10, 5)) ** 2 / load.total_n
    half = np.sqrt(24 / (np.pi * 1.5)) * np.array([1, 1.5])
    assert second == pytest.approx(half**2 / 4)  # second moments of an even ellipse


def test_a_taxel_at_rest_is_a_plate_with_maxwells_guard_ring():
    """C = eps pi (r + g / 2)^2 / t for a gap g that is small against t (Maxwell, Treatise, art. 201); here g = t / 10."""
    skin = small_skin()
    maxwell = VACUUM_FF_PER_MM * np.pi * 2.1**2 / 2.0
    assert skin.at_rest_ff == pytest.approx(maxwell, rel=0.01)


def test_an_even_squeeze_raises_the_capacitance_as_one_over_the_thickness():
    """All nodes move straight down in proportion to their height: an affine map, and the field stays even but at the gap."""
    skin = small_skin()
    squeezed = np.zeros_like(skin.layer.mesh.nodes_mm)
    squeezed[:, 2] = -0.2 * skin.layer.mesh.nodes_mm[:, 2]
    assert skin.field(squeezed).capacitance_ff / skin.at_rest_ff == pytest.approx(1 / 0.8, rel=2e-3)  # of the gap's own share


@pytest.fixture(scope="module")
def pressed():
    skin = small_skin()
    return skin, skin.field(skin.layer.displacement(disc((8.0, 4.0), diameter_mm=4.0, pressure_mpa=0.02), young_mpa=0.2))


def test_the_maxwell_matrix_is_reciprocal_and_gives_the_driven_capacitances(pressed):
    _, field = pressed
    maxwell = field.maxwell_ff
    assert np.abs(maxwell - maxwell.T).max() < 1e-6 * np.abs(maxwell).max()
    assert maxwell.sum(axis=1)[:-1] == pytest.approx(field.capacitance_ff, rel=1e-9)
    off = maxwell - np.diag(np.diag(maxwell))
    assert (np.diag(maxwell) > 0).all() and (off < 1e-9).all()


def test_charge_and_energy_tell_the_same_capacitance(pressed):
    _, field = pressed
    assert 2 * field.energy_fj(field.driven) == pytest.approx(field.maxwell_ff.sum(), rel=1e-6)


def test_the_influence_is_the_slope_of_the_capacitance_with_the_force(pressed):
    """Against differences of whole solutions at a hundredth of the load; the influence leaves out what lies three layers away."""
    skin, _ = pressed
    load = disc((9.0, 4.5), diameter_mm=3.0, pressure_mpa=2e-4)
    rise = skin.field(skin.layer.displacement(load, young_mpa=0.2)).capacitance_ff - skin.at_rest_ff
    assert skin.first_order_ff(load, young_mpa=0.2) == pytest.approx(rise, rel=2e-3, abs=1e-5)


def test_a_load_that_folds_the_elastomer_is_refused():
    skin = small_skin()
    moved = skin.layer.displacement(disc((8.0, 4.0), diameter_mm=4.0, pressure_mpa=0.5), young_mpa=0.2)
    with pytest.raises(InputError, match="folds elements of the elastomer"):
        skin.field(moved)


@pytest.mark.slow
def test_the_authors_finite_elements_are_met():
    """Their published case: 179.452 fF within 0.1 %, 0.12925 mm within 0.2 %."""
    skin = Skin(module_layout(), thickness_mm=3.0, poisson=0.4, permittivity=4.27)
    unit = skin.layer.displacement(ellipse((15.0, 5.2), area_mm2=24.0, pressure_mpa=0.01), young_mpa=1.0)
    assert skin.field(unit / 0.126153).capacitance_ff[6] == pytest.approx(179.452, rel=1e-3)
    assert np.linalg.norm(unit / 0.150, axis=1).max() == pytest.approx(0.12925, rel=2e-3)


@pytest.mark.slow
def test_another_program_finds_the_same_capacitance_of_a_deformed_skin():
    """NGSolve with another geometry, mesh, and elements of order 3; the finest field mesh here. Within 0.2 %."""
    ngsolve = pytest.importorskip("ngsolve")
    from support.ngsolve_skin import ngsolve_capacitance

    layout = module_layout(side_mm=20.0, centres_mm=[(10.0, 5.0)])
    theirs = ngsolve_capacitance(
        ngsolve,
        layout,
        thickness_mm=2.0,
        poisson=0.3,
        young_mpa=0.2,
        permittivity=4.27,
        load_centre_mm=(10.5, 5.0),
        load_radius_mm=2.5,
        pressure_mpa=0.02,
    )
    load = disc((10.5, 5.0), diameter_mm=5.0, pressure_mpa=0.02)
    skin = Skin(layout, thickness_mm=2.0, poisson=0.3, permittivity=4.27, mesh=LayerMeshSizes(spacing_mm=0.8))
    moved = skin.layer.displacement(load, young_mpa=0.2)
    mesh = LayerMesh(taxel_mesh(layout, spacing_mm=1.2, refinement=3), 2.0 * np.array([0, 0.01, 0.03, 0.08, 0.2, 0.4, 0.7, 1.0]))
    there = skin.layer.at(mesh.nodes_mm, moved)
    ours = ElectricField(mesh, layout, permittivity=4.27, displacement_mm=there, order=4).capacitance_ff[0]
    assert ours == pytest.approx(theirs, rel=2e-3)
