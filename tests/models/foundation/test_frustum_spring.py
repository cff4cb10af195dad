"""One frustum: its law, how it rocks, and how it stiffens sideways under its force."""


import numpy as np
import pytest
from foundation_study import SMALL
from support.laws import LAWS

from softtact.models.foundation.compliance import foundation_compliance
from softtact.models.foundation.dof_maps import lattice_places
from softtact.models.foundation.frustum_spring import FrustumLaw, SingleFrustum, _root_stiffness, _stiffness_at_rest
from softtact.models.hyperelastic.build import build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings


def test_a_frustum_takes_more_force_the_more_it_is_compressed(law):
    assert law.force_n[0] == law.compression_mm[0] == 0.0
    assert (np.diff(law.force_n) > 0).all() and (np.diff(law.compression_mm) > 0).all()
    assert 0.5 < law.limit_mm / SMALL.dielectric.frusta.height_mm < 1.0
    stiffness = np.diff(law.force_n) / np.diff(law.compression_mm)
    assert stiffness[-1] > 5 * stiffness[0]      # the pocket beside it fills


def test_the_first_slope_is_the_linear_stiffness_of_a_frustum_at_rest(law):
    body = build_unit_cell(SMALL, dielectric_law=LAWS["dielectric"], mesh=MeshSettings(frustum_rings=2))
    stiffness = _root_stiffness(body.support)
    body.close()
    straight = np.tile([0.0, 0.0, 1.0], len(law.spread))
    expected = straight @ stiffness @ straight      # N/mm: the root comes down as a plane, the tip stands
    # Up to 2e-3 N the tip sinks into the board's smoothed penalty by sqrt(2 p / 3000**2 mm2/MPa), 3 % of the first load step.
    slope = (law.force_n[3] - law.force_n[1]) / (law.compression_mm[3] - law.compression_mm[1])
    assert slope == pytest.approx(expected, rel=0.02)
    assert law.force_n[1] / law.compression_mm[1] == pytest.approx(expected, rel=0.04)


def test_the_slope_is_the_derivative_of_the_extension(law):
    forces = np.concatenate([np.geomspace(1e-3, 0.99 * law.force_n[-1], 25), [1.5 * law.force_n[-1]]])
    step = 1e-6 * forces
    difference = (law.extension(forces + step) - law.extension(forces - step)) / (2 * step)
    np.testing.assert_allclose(law.slope(forces), difference, rtol=1e-6)      # cubics: step^2, and round-off over the step
    assert (law.slope(forces) > 0).all()


def test_the_extension_passes_through_the_cells_load_steps_and_goes_on_straight(law):
    np.testing.assert_allclose(law.extension(law.force_n), law.compression_mm, atol=1e-12)
    ends = law.extension(law.force_n[-1] * np.array([1.0, 1.5, 2.0]))
    assert np.diff(ends)[0] == pytest.approx(np.diff(ends)[1], rel=1e-12)
    assert law.slope(law.force_n[-1:] * 3) == pytest.approx(law.slope(law.force_n[-1:] * (1 - 1e-9)), rel=1e-4)


def test_the_rest_stiffness_takes_a_straight_descent_without_force_and_all_else_with_some(law):
    straight = np.tile([0.0, 0.0, 1.0], len(law.spread))
    size = np.abs(law.rest).max()
    np.testing.assert_allclose(law.rest, law.rest.T, atol=1e-9 * size)
    np.testing.assert_allclose(law.rest @ straight, 0.0, atol=1e-9 * size)
    eigenvalues = np.linalg.eigvalsh(law.rest)
    assert eigenvalues[0] > -1e-9 * size and eigenvalues[1] > 1e-4 * size      # the tip is held: nothing else is free
    assert law.descent @ straight == pytest.approx(1.0, rel=1e-12)
    assert law.descent.reshape(-1, 3)[:, :2].sum(axis=0) == pytest.approx([0, 0], abs=1e-9)


def test_a_frustum_rocks_only_under_a_force_too_small_to_hold_its_tip_down(law):
    """A free tip leans by s u and its rim, e from the middle, lifts the root by e s u; the force that ends it is k s u / e."""
    u = 0.02
    free = law.tip_radius_mm * law.lean * u
    enough = law.upright * law.lean * u / law.tip_radius_mm
    rises = law.rise(u, enough * np.array([0.0, 0.25, 1.0, 2.0]))
    np.testing.assert_allclose(rises, [free, 0.75 * free, 0.0, 0.0], atol=1e-12 * free)
    by_force = (rises[1] - rises[0]) / (0.25 * enough)
    np.testing.assert_allclose(law.rocking_compliance(rises), [-by_force, -by_force, 0.0, 0.0], rtol=1e-9)


def test_the_lean_of_a_free_tip_balances_the_moment_that_would_hold_it_flat(law):
    """Of the frustum held flat: the tip's moment under a root moved sideways is its stiffness times the lean."""
    support = build_unit_cell(SMALL, dielectric_law=LAWS["dielectric"], mesh=MeshSettings(frustum_rings=2)).support
    moved = np.zeros((1, support.nodes, 3))
    moved[0, support.root, 0] = 1e-5
    inner, stiffness = np.setdiff1d(support.inner, 3 * support.tip + 2), _stiffness_at_rest(support)
    flat = moved.ravel()
    flat[inner] = -np.linalg.solve(stiffness[np.ix_(inner, inner)], stiffness[inner] @ flat)
    x = support.coordinates[0][support.tip, 0] - support.geometry.centres[0][0]
    moment = (support.evaluate(flat.reshape(moved.shape)).elastic[1][0, support.tip, 2] * x).sum()
    assert abs(moment) / 1e-5 == pytest.approx(law.upright * law.lean, rel=0.1)     # free, the tip bends besides


@pytest.fixture(scope="module")
def support():
    body = build_unit_cell(SMALL, dielectric_law=LAWS["dielectric"], mesh=MeshSettings(frustum_rings=2))
    yield body.support
    body.close()


def test_a_frustum_under_a_rigid_root_answers_small_movements_with_its_linear_stiffness(support):
    """Pressed by a hundredth of its height, so that its tip stands, and by two, and continued to none: the coupling grows by as
    much as the force, 3 % at the first (P-Delta).
    """
    x = support.coordinates[0][support.root, 0] - support.geometry.centres[0][0]
    modes = np.zeros((2, len(x), 3))
    modes[0, :, 0], modes[1, :, 2] = 1.0, x
    modes = modes.reshape(2, -1)
    linear = modes @ _root_stiffness(support) @ modes.T
    frustum, found = SingleFrustum(support), []
    for descent in (0.005, 0.01):
        frustum.move(0, 0, descent)
        found.append(np.array([frustum.move(*place, descent) for place in ((1e-4, 0), (0, 1e-4))]) / 1e-4)
    np.testing.assert_allclose(2 * found[0] - found[1], linear, rtol=0.01)


def test_what_holds_a_single_frustums_root_does_not_depend_on_the_way_there(support):
    ways = [[(0.05, 0, 0), (0.05, 0.04, 0), (0.05, 0.04, 0.12)], [(0, 0, 0.12), (0, 0.04, 0.12), (0.05, 0.04, 0.12)]]
    ends = []
    for way in ways:
        frustum = SingleFrustum(support)
        ends.append([frustum.move(*place) for place in way][-1])
    np.testing.assert_allclose(*ends, rtol=1e-4)


def test_movement_tilts_a_pressed_frustum_as_much_as_tilt_moves_it(support):
    """Forces of an energy, so its second derivatives are symmetric: to the differences' error, some (0.005 / 0.5)^2."""
    frustum = SingleFrustum(support)
    frustum.move(0, 0, 0.1)
    moment = [frustum.move(u, 0, 0.1)[1] for u in (-0.005, 0.005)]
    force = [frustum.move(0, t, 0.1)[0] for t in (-0.01, 0.01)]
    assert np.diff(moment)[0] / 0.01 == pytest.approx(np.diff(force)[0] / 0.02, rel=1e-3)


def test_a_single_frustum_that_cannot_be_pressed_so_far_says_so(support):
    frustum = SingleFrustum(support)
    assert frustum.move(0, 0, 0.9 * SMALL.dielectric.frusta.height_mm) is None
    assert frustum.move(0, 0, 0.0) is None


def test_frusta_are_the_stiffer_sideways_the_more_they_are_compressed(law):
    more, growth = law.stiffening(np.array([0.0, 0.1, 0.5, 1.0]))
    np.testing.assert_allclose(more[0], 0.0, atol=1e-12)
    assert (np.diff(more[:, 0, 1]) > 0.02).all() and (np.diff(more[:, 1, 1]) > 0.01).all()
    np.testing.assert_array_equal(more[:, 0, 1], more[:, 1, 0])
    assert (growth[2:] > 0).all()


def test_the_growth_of_the_stiffness_is_its_derivative_by_the_compression(law):
    forces = np.array([0.03, 0.2, 0.7])
    step = 1e-5 * forces
    (upper, _), (lower, _) = (law.stiffening(forces + sign * step) for sign in (1, -1))
    apart = law.extension(forces + step) - law.extension(forces - step)
    np.testing.assert_allclose(law.stiffening(forces)[1], (upper - lower) / apart[:, None, None], rtol=1e-4, atol=1e-6)


def test_beyond_what_a_single_frustum_was_pressed_to_the_stiffness_stays(law):
    more, growth = law.stiffening(law.force_n[-1] * np.array([1.1, 2.0]))
    np.testing.assert_array_equal(more[0], more[1])
    assert (growth == 0).all()


def test_movement_and_tilt_of_a_root_are_those_of_the_plane_nearest_to_it(law):
    nodes = law.spread @ law.root_xy
    moved = np.zeros((len(nodes), 3))
    moved[:, 0], moved[:, 1], moved[:, 2] = 0.3, -0.2, 0.7 + 0.05 * nodes[:, 0] - 0.04 * nodes[:, 1]
    np.testing.assert_allclose(law.lateral @ moved.ravel(), [0.3, 0.05, -0.2, -0.04], atol=1e-9)


def test_a_law_is_read_as_it_was_written(law, tmp_path):
    law.save(tmp_path / "law.npz")
    loaded = FrustumLaw.load(tmp_path / "law.npz")
    for name, values in law.arrays().items():
        np.testing.assert_array_equal(getattr(loaded, name), values)


def test_a_roots_nodes_follow_any_quadratic_field_exactly_and_pass_their_forces_and_moments_on(law):
    x, y = law.root_xy.T
    nodes = law.spread @ law.root_xy                  # the places of the nodes themselves, for a linear field is reproduced
    fields = {"constant": lambda x, y: 1 + 0 * x, "linear": lambda x, y: 2 * x - y, "in the middle": lambda x, y: 1 - x**2 - y**2}
    for name, field in fields.items():
        # Sides of the outer elements are curved: what is quadratic in x and y is not quite so in their coordinates.
        tolerance = 1e-9 if name != "in the middle" else 0.01
        np.testing.assert_allclose(law.spread @ field(x, y), field(*nodes.T), atol=tolerance)
    forces = np.random.default_rng(0).standard_normal(len(nodes))
    on_slab = law.spread.T @ forces
    assert on_slab.sum() == pytest.approx(forces.sum(), rel=1e-9)
    np.testing.assert_allclose(on_slab @ law.root_xy, forces @ nodes, atol=1e-9)


@pytest.mark.slow
def test_a_frustum_sinks_hardly_deeper_into_a_slab_of_finer_elements(law):
    """Under a unit force of its own; tied to the slab at single points, frusta sank in by 6 to 8 % more each time, without end."""
    sunk = []
    for count in (9, 17, 25):      # elements of a half, a quarter and a sixth of a pitch
        spec = SMALL.model_copy(update={"footprint_mm": (4.8, 4.8), "map_shape": (count, count)})
        compliance = foundation_compliance(spec, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], frustum=law)
        places, signs = lattice_places(compliance.counts)
        nodes_of_quarter = (len(compliance.grid.x) // 2 + 1) * (len(compliance.grid.y) // 2 + 1)
        innermost = np.flatnonzero(places == 0)[:1]
        own = nodes_of_quarter + places[innermost], signs[innermost]
        sunk.append(compliance.surface.between(*own, *own)[0, 0])
    first, second = np.diff(sunk) / sunk[-1]
    assert 0 < first < 0.01 and 0 < second < 0.5 * first
