"""The foundation model on a small sensor: the slab's blocks against the whole slab, and presses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from foundation_study import BOX, PUNCH, SMALL, TILTED, assert_close, force_of, points_of
from support.laws import LAWS

from softtact.contact.node_grid import NodeGrid, pressure_weights
from softtact.errors import ConvergenceError, InputError
from softtact.models.foundation import active_system
from softtact.models.foundation.compliance import FoundationCompliance, foundation_compliance
from softtact.models.foundation.dof_maps import Places, Sideways, SoftEdges, lattice_places
from softtact.models.foundation.solve import (
    FoundationMaps,
    FoundationSettings,
    _Press,
    membrane_loads,
    press_foundation,
    settled_contacts,
)
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.sensor import Sensor
from softtact.sensors.fields import Edge

# --- the slab's blocks ---


def test_every_frustum_is_found_from_its_number_in_the_quarter_and_its_signs():
    numbers, signs = lattice_places((6, 4))
    x, y = (np.arange(count // 2) + 0.5 for count in (6, 4))
    quarter = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    whole = np.stack(np.meshgrid(np.arange(6) - 2.5, np.arange(4) - 1.5), axis=-1).reshape(-1, 2)
    np.testing.assert_array_equal(quarter[numbers] * signs, whole)


@pytest.fixture(scope="module")
def loaded(compliance, whole):
    """A press' places, loads without symmetry on nodes and frusta, lateral ones on roots, and the whole slab's displacement under
    both and under the first alone.
    """
    points = points_of(BOX, compliance, TILTED)
    load = np.random.default_rng(3).uniform(0.0, 1.0, len(points.nodes) + 36)
    load[-36:] *= -0.3
    lateral = np.random.default_rng(4).uniform(-0.1, 0.1, 4 * 36)
    moved = whole.displacement(whole.forces(points.nodes, load, lateral))
    return Places(compliance, points), load, lateral, moved, whole.displacement(whole.forces(points.nodes, load))


# Blocks are kept in single precision, and the springs that tie the frusta's descents, 20 N/mm, are taken off again.


@pytest.mark.slow
def test_maps_and_compressions_are_those_of_the_whole_slab(loaded, whole):
    places, load, lateral, moved, _ = loaded
    assert_close(places.maps(load[:, None], lateral[:, None])[0, 1:-1, 1:-1], -moved[3 * whole.electrode + 2], 1e-5)
    assert_close((places.surface() @ load + lateral @ places.lateral())[-36:], -(whole.descents @ moved), 1e-5)


@pytest.mark.slow
def test_movements_sideways_are_those_of_the_whole_slab(loaded, whole, compliance):
    places, load, _, _, moved = loaded
    coarse = compliance.grid.every_second
    got = (places.sideways(np.arange(coarse.count)) @ load).reshape(2, *coarse.shape)
    for axis in (0, 1):
        assert_close(got[axis], moved[3 * whole.top_at_map + axis], 1e-5)


@pytest.mark.slow
def test_membrane_forces_are_those_of_the_whole_slab(loaded, whole):
    places, load, _, _, moved = loaded
    assert_close((places.membrane() @ load).reshape(3, -1), whole.membrane(moved), 1e-5)


@pytest.mark.slow
def test_movements_and_tilts_of_the_roots_are_those_of_the_whole_slab(loaded, whole):
    places, load, lateral, moved, _ = loaded
    assert_close(places.lateral() @ load + places.lateral_self() @ lateral, whole.lateral @ moved, 1e-5)


def test_membrane_loads_are_the_gradient_of_their_energy():
    """1/2 sum N_ab w_a w_b with slopes over two pitches, w = 0 beyond the lattice: by central differences."""
    rng = np.random.default_rng(1)
    down, forces = rng.standard_normal((5, 7)), rng.standard_normal((3, 5, 7))

    def energy(down):
        padded = np.pad(down, 1)
        x, y = 0.5 * (padded[1:-1, 2:] - padded[1:-1, :-2]), 0.5 * (padded[2:, 1:-1] - padded[:-2, 1:-1])
        return 0.5 * (forces[0] * x**2 + forces[1] * y**2 + 2 * forces[2] * x * y).sum()

    loads = membrane_loads(down, forces)
    for place_ in [(0, 0), (2, 3), (4, 6), (1, 5)]:
        step = np.zeros_like(down)
        step[place_] = 1e-4
        # the energy is quadratic, so only round-off is left
        assert loads[place_] == pytest.approx((energy(down + step) - energy(down - step)) / 2e-4, abs=1e-9)


def test_a_compliance_is_read_as_it_was_written(compliance, tmp_path):
    compliance.save(tmp_path / "foundation.npz")
    again = FoundationCompliance.load(tmp_path / "foundation.npz")
    assert (tuple(again.counts), again.foundation_modulus) == (compliance.counts, compliance.foundation_modulus)
    points = points_of(PUNCH, compliance)
    first, second = (FoundationMaps(f, points)(list(press_foundation(f, points, [0.5, 2.0]))) for f in (compliance, again))
    np.testing.assert_array_equal(first, second)


def test_a_lattice_with_a_row_in_the_middle_is_refused(law):
    odd = SMALL.model_copy(update={"footprint_mm": (6.0, 7.2)})
    with pytest.raises(InputError, match="lattice of 5 x 6 frusta has a row in the middle"):
        foundation_compliance(odd, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], frustum=law)


# --- presses ---

POSES = {"punch": (PUNCH, (0, 0, 0, 0, 0, 0)), "tilted box": (BOX, TILTED),
         "sphere": (trimesh.creation.icosphere(subdivisions=4, radius=6.0), (0.4, 0.1, 0, 0, 0, 0))}


def test_the_conditions_of_contact_hold_for_object_and_frusta(compliance):
    for name in POSES:
        for follow in [False, True]:
            mesh, values = POSES[name]
            points = points_of(mesh, compliance, values)
            for load_step in press_foundation(compliance, points, [0.3, 1.5, 4.0], settings=FoundationSettings(follow=follow)):
                nodes = load_step.load[:-36]
                assert nodes.min() >= 0
                assert nodes.sum() == pytest.approx(load_step.force_n, rel=1e-6)      # weights in single precision
                assert load_step.penetration <= 3e-5
                assert load_step.touching.any() and load_step.iterations > 0


@pytest.mark.slow
def test_the_frusta_and_the_held_sides_carry_the_objects_force(compliance, whole):
    """The whole slab under the press' loads comes down on the frusta as the press says, and these push back by their law."""
    for name in POSES:
        mesh, values = POSES[name]
        points = points_of(mesh, compliance, values)
        load_step, = press_foundation(compliance, points, [3.0], settings=FoundationSettings(follow=False))
        forces = whole.forces(points.nodes, load_step.load)
        moved = whole.displacement(forces)
        pushed = -load_step.load[-36:]
        assert_close(load_step.compression, -(whole.descents @ moved), 1e-4)
        assert_close(pushed, force_of(compliance.law, load_step.compression), 1e-4)
        assert pushed.min() >= 0
        assert pushed.sum() + whole.sides_carry(moved, forces) == pytest.approx(3.0, rel=1e-4)
        assert 0.9 * 3.0 < pushed.sum() < 1.1 * 3.0      # the held sides push or hold down only a little


def test_rocking_frusta_push_where_the_rims_of_their_tips_meet_the_board(compliance):
    """With tips thirty times as stiff against being held flat, so that some rock on so small a sensor; nothing else followed."""
    law = replace(compliance.law, upright=30 * compliance.law.upright)
    points = points_of(PUNCH, compliance)
    load_step, = press_foundation(replace(compliance, law=law), points, [3.0], settings=FoundationSettings(follow=False))
    sideways = np.hypot(*(Places(compliance, points).lateral() @ load_step.load).reshape(2, 2, -1)[:, 0])
    q = -load_step.load[-36:]
    rise = law.rise(sideways, q)
    assert ((rise > 0) & (q > 0)).any() and (rise == 0).any()
    short = load_step.compression + rise
    np.testing.assert_allclose(law.extension(q)[q > 0], short[q > 0], atol=2e-4 * short.max())     # what an iteration may leave
    assert (short[q == 0] < 1e-5).all()


@pytest.mark.slow
def test_with_all_that_finite_displacement_adds_frusta_and_whole_slab_are_in_balance(compliance, whole):
    """The whole slab moves under the press' loads; what these should be by the movement, law and formulas is what they are."""
    for name in POSES:
        mesh, values = POSES[name]
        points, law = points_of(mesh, compliance, values), compliance.law
        load_step, = press_foundation(compliance, points, [3.0], settings=FoundationSettings(rocking=False, tolerance=1e-6))
        moved = whole.displacement(whole.forces(points.nodes, load_step.load, load_step.lateral.ravel()))
        down, roots = -(whole.descents @ moved), (whole.lateral @ moved).reshape(2, 2, -1).transpose(2, 0, 1)
        assert_close(load_step.compression, down, 1e-4)
        # Membrane forces are followed without those of the lateral loads, which are of second order themselves.
        linear = whole.displacement(whole.forces(points.nodes, load_step.load))
        q = force_of(law, down)
        more, growth = law.stiffening(q)
        by_slope = membrane_loads(down.reshape(6, 6), whole.membrane(linear).reshape(3, 6, 6)).ravel()
        pushed = q + by_slope + 0.5 * np.einsum("bai,bij,baj->b", roots, growth, roots)
        assert_close(-load_step.load[-36:], pushed, 2e-3)      # forces turn steep: a frusta's 1e-4 mm are 1e-3 of its force
        by_movement = -np.einsum("bij,baj->aib", more, roots).reshape(4, -1)
        by_pressure = np.stack([q * roots[:, 0, 1], q * roots[:, 0, 0], q * roots[:, 1, 1], q * roots[:, 1, 0]])
        assert_close(load_step.lateral, by_movement + by_pressure, 2e-3)
        assert np.abs(load_step.lateral).max() > 1e-3


def test_a_force_that_is_not_reached_at_once_is_reached_by_way_of_smaller_ones(compliance):
    """With few iterations allowed a tilted box does not reach 4 N from rest; the map is the same as if it had."""
    points = points_of(BOX, compliance, TILTED)
    at_once, in_steps = (next(press_foundation(compliance, points, [4.0], settings=FoundationSettings(max_iterations=count)))
                         for count in (60, 5))
    assert at_once.iterations > 5 and in_steps.iterations > at_once.iterations
    maps = FoundationMaps(compliance, points)([at_once, in_steps])
    assert_close(maps[1], maps[0], 1e-2)      # edges are looked at again only where points moved by 3 % of a step


def test_a_force_that_is_not_reached_says_from_which_one_on(compliance):
    points = points_of(BOX, compliance, TILTED)
    load_steps = press_foundation(compliance, points, [4.0], settings=FoundationSettings(max_iterations=1))
    with pytest.raises(ConvergenceError, match="did not reach 4 N: from 0 N on .* use smaller forces, or the hyperelastic"):
        next(load_steps)


@pytest.mark.parametrize("force_n", [0.5, 3.0])
def test_a_press_begins_with_little_more_contact_than_it_ends_with(compliance, force_n):
    for mesh, values in POSES.values():
        points = points_of(mesh, compliance, values)
        begun = _Press(compliance, points, FoundationSettings()).first(force_n)
        ended, = settled_contacts(compliance, points, [force_n])
        assert begun.touching[ended.touching].all()
        assert begun.touching.sum() < 1.6 * ended.touching.sum()


@pytest.mark.parametrize("values", [(0, 0, 0, 0, 0, 0), TILTED])
def test_a_press_whose_steps_share_factors_gives_the_map_of_steps_with_their_own(compliance, monkeypatch, values):
    made, points = [], points_of(BOX, compliance, values)

    class Counted(active_system._Factor):
        def __init__(self, *what):
            made.append(self)
            super().__init__(*what)

    monkeypatch.setattr(active_system, "_Factor", Counted)
    load_steps, counts = [], []
    for border in (-1.0, active_system._BORDER):
        made.clear()
        monkeypatch.setattr(active_system, "_BORDER", border)
        load_steps.append(list(press_foundation(compliance, points, [0.3, 0.6, 0.9])))
        counts.append(len(made))
    assert counts[1] < counts[0] / 2
    own, kept = (FoundationMaps(compliance, points)(each) for each in load_steps)
    assert_close(kept, own, 1e-3)      # the tolerance's 0.03 % in the root mean square


@pytest.mark.filterwarnings("error")
def test_a_load_step_whose_patches_have_all_let_go_is_not_reached_and_nothing_is_divided_by_zero(compliance):
    press = _Press(compliance, points_of(BOX, compliance), FoundationSettings())
    state = press.first(1.0)
    assert state.touching.any()
    state.touching[:] = False
    assert press.load_step(state, 1.0) == (None, 1)


@pytest.mark.slow
def test_the_object_holds_nodes_beside_its_edge_as_softly_as_its_edge_reaches_where_they_have_moved_to(compliance, whole):
    """Depth less gap and softness times force is how far the whole slab comes down there; the softness by the movement found."""
    points = points_of(PUNCH, compliance)
    load_step, = press_foundation(compliance, points, [10.0], settings=FoundationSettings(rocking=False))
    down = -whole.displacement(whole.forces(points.nodes, load_step.load,
                                            load_step.lateral.ravel()))[3 * whole.top[points.nodes] + 2]
    moved = Sideways(compliance, points, Places(compliance, points))(load_step.load.astype(np.float32))
    contact_compliance, force = SoftEdges(compliance)(points, moved, load_step.depth), load_step.load[:-36]
    held = (force > 0) & np.isfinite(contact_compliance)
    assert (contact_compliance[held] > 0).sum() > 20 and np.abs(moved).max() > 0.02
    # edges are looked at again only where points moved by 3 % of a step: a mean over the nodes held softly
    soft = held & (contact_compliance > 0)
    missing = np.abs(down + contact_compliance * force - load_step.depth)[soft].mean()
    assert missing < 0.03 * load_step.depth
    assert missing < 0.3 * np.abs(down + SoftEdges(compliance)(points, 0 * moved,
                                                               load_step.depth) * force - load_step.depth)[soft].mean()


def test_small_forces_give_a_map_in_proportion(compliance):
    """A flat punch, nothing followed; the first 1e-3 N of 36 frusta lie where their law is straight."""
    points = points_of(PUNCH, compliance)
    load_steps = list(press_foundation(compliance, points, [1e-3, 2e-3], settings=FoundationSettings(follow=False, gap_mm=1e-10)))
    small, large = FoundationMaps(compliance, points)(load_steps)
    assert_close(large, 2 * small, 2e-3)
    assert load_steps[1].depth == pytest.approx(2 * load_steps[0].depth, rel=2e-3)


def test_what_follows_the_deformation_vanishes_with_the_force(compliance):
    """Membrane forces times slopes, and movements times slopes, are of second order: a tenth of the force, a tenth of the share."""
    points, shares = points_of(PUNCH, compliance), []
    for force in (0.05, 0.5):
        maps = [FoundationMaps(compliance, points)(list(press_foundation(compliance, points, [force],
                settings=FoundationSettings(follow=follow))))[0] for follow in (False, True)]
        shares.append(np.abs(maps[1] - maps[0]).max() / maps[0].max())
    assert shares[0] < 0.2 * shares[1]
    assert 1e-4 < shares[1] < 0.1


def test_a_centred_object_of_two_symmetries_gives_a_map_that_has_them(compliance):
    for name in ["punch", "sphere"]:
        points = points_of(POSES[name][0], compliance)
        map_, = FoundationMaps(compliance, points)(list(press_foundation(compliance, points, [1.0])))
        for mirrored in (map_[::-1], map_[:, ::-1]):
            assert_close(map_, mirrored, 1e-3)


def test_without_patches_a_centred_object_of_two_symmetries_gives_a_map_that_has_them(compliance):
    for name in ["punch", "sphere"]:
        points = points_of(POSES[name][0], compliance)
        load_steps = list(press_foundation(compliance, points, [1.0], settings=FoundationSettings(patches=False)))
        map_, = FoundationMaps(compliance, points)(load_steps)
        for mirrored in (map_[::-1], map_[:, ::-1]):
            assert_close(map_, mirrored, 1e-3)


def test_at_a_small_force_the_foundation_gives_the_hyperelastic_models_map(compliance):
    """Both start from the same cell and laws; at 1 N strains are a few per cent.

    What is left is the punch's edge, where the pressure is singular, and the fine mesh's own 1 to 2 %: 3.1 % measured.
    """
    sensor = Sensor(SMALL, LAWS, prepared_models={"foundation": compliance}, mesh=MeshSettings.fine())
    punch = trimesh.creation.cylinder(radius=1.7, height=3.0, sections=96)
    fast, full = (sensor.press(punch, force_n=1.0, model=model, threads=1) for model in ("foundation", "hyperelastic"))
    difference, largest = np.abs(fast.deformation_map_mm - full.deformation_map_mm), full.deformation_map_mm.max()
    assert difference.max() < 0.035 * largest and difference.mean() < 0.01 * largest
    assert fast.indentation_mm[0] == pytest.approx(full.indentation_mm[0], rel=0.02)


def test_on_free_sides_the_frusta_carry_the_whole_force(law):
    """A plate over all of a free pad: the frusta's own law at the compressions found, all together, is the force.

    A five-hundredth of their stiffness stands in the slab's compliance, which their law is freed from: left in, it would be 0.2 %.
    What single precision leaves of compressions of 30 um is below 1e-4 of them.
    """
    free = foundation_compliance(SMALL.model_copy(update={"edge": Edge(held="free")}), dielectric_law=LAWS["dielectric"],
                                 cover_law=LAWS["cover"], frustum=law)
    points = points_of(trimesh.creation.box((12.0, 12.0, 2.0)), free)
    for load_step in press_foundation(free, points, [0.5, 4.0], settings=FoundationSettings(follow=False, rocking=False)):
        assert (load_step.compression > 0).all()
        assert force_of(law, load_step.compression).sum() == pytest.approx(load_step.force_n, rel=3e-4)


def test_points_on_free_sides_count_with_the_part_of_their_surroundings_that_is_there():
    """Simpson's weights of a uniform pressure on quadratic elements, to the sides; and areas that add up to the surface's."""
    grid = NodeGrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9), sides=True)
    nodes = np.arange(grid.count)
    weights = pressure_weights(SimpleNamespace(nodes=nodes), grid)
    simpson = np.array([1, 4, 2, 4, 2, 4, 2, 4, 1])
    np.testing.assert_allclose(weights, np.outer(simpson, simpson).ravel() / 4)
    assert grid.areas(nodes).sum() == pytest.approx(4.0)
