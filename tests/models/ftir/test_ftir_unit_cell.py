"""The dielectric between a plate and glass: how its contact area grows, and how its frusta share the force."""

from dataclasses import replace

import numpy as np
import pytest
from support.laws import POLYURETHANE as LAW
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.errors import ConvergenceError, InputError
from softtact.models.ftir.specimen import (
    GLASS_MESH,
    SETTINGS,
    Specimen,
    cell_family,
    contact_area,
    plate_over,
    press_cell_on_glass,
    press_specimen,
    scattered_specimen,
)
from softtact.models.hyperelastic.build import build_patch, build_unit_cell
from softtact.models.hyperelastic.frusta import SHEET
from softtact.models.hyperelastic.path import press_load_steps

COARSE = replace(GLASS_MESH, frustum_heights=(0.0, 0.1, 0.2, 0.35, 1.0), frustum_rings=1)
TIP_MM2 = np.pi * 0.3**2


@pytest.fixture(scope="module")
def specimen():
    return scattered_specimen(CORO, height_scatter=0.01, tip_scatter=0.02, seed=3)


@pytest.fixture(scope="module")
def family(specimen):
    return cell_family(CORO, LAW, specimen, largest_n=60.0, mesh=COARSE)


@pytest.mark.slow
def test_the_contact_area_starts_as_the_tip_and_grows_without_jumps():
    """Up to the paper's 140 N on 540 frusta. A side that snaps onto the glass at once would add 0.05 mm2 from step to step.

    With one ring of elements the steps' differences reach 0.01 mm2 and change their sign from step to step.
    """
    curve = press_cell_on_glass(CORO, LAW, np.arange(10.0, 141.0, 10.0) / 540)
    assert curve.area_mm2[0] == pytest.approx(TIP_MM2, rel=0.01)
    assert (np.diff(curve.area_mm2) > 0).all() and (np.diff(curve.compression_mm) > 0).all()
    assert np.abs(np.diff(curve.area_mm2, 2)).max() < 0.0075


def test_no_force_is_no_contact_and_a_light_one_is_the_tip():
    curve = press_cell_on_glass(CORO, LAW, np.array([0.0, 1.0]) / 540, mesh=COARSE)
    assert curve.area_mm2[0] == curve.compression_mm[0] == 0.0
    assert curve.area_mm2[1] == pytest.approx(TIP_MM2, rel=0.005)


def test_a_wide_tip_stands_on_the_same_disc_under_every_force():
    """The held rim cannot spread and the side leans inwards: nothing comes down onto the glass."""
    curve = press_cell_on_glass(CORO.with_frustum_orientation("as_printed"), LAW, np.array([10.0, 60.0, 110.0]) / 540)
    assert curve.area_mm2 == pytest.approx(np.pi * 0.6**2, rel=2e-3)
    assert np.ptp(curve.area_mm2) < 1e-6


def test_a_wide_tip_s_side_faces_the_sheet_and_a_narrow_one_s_does_not():
    wide, narrow = (build_unit_cell(CORO.with_frustum_orientation(reading), dielectric_law=LAW).support
                    for reading in ("as_printed", "default"))
    towards = wide.point_neighbour == SHEET
    assert towards.any() and not (narrow.point_neighbour == SHEET).any()
    lifted = np.zeros((1, wide.nodes, 3))
    lifted[:, wide.root, 2] = 0.1          # the root, and the load step sheet with it
    inner = towards & ~np.isin(wide.point_nodes[:, :9], wide.root).any(axis=1)
    change = wide.evaluate(lifted).gaps - wide.gap0
    assert wide.gap0[:, towards].min() > 0
    assert change[:, inner] == pytest.approx(0.1)


def test_frusta_of_a_specimen_carry_the_force_together(family, specimen):
    """The taller and the wider ones more of it; with 0 N nothing touches."""
    forces = np.array([0.0, 0.5, 5.0, 60.0])
    pressed = press_specimen(family, specimen, forces)
    assert pressed.force_n.sum(axis=1) == pytest.approx(forces, rel=1e-6, abs=1e-9)
    assert not pressed.area_mm2[0].any() and pressed.area_mm2[-1].all()
    assert 0 < (pressed.area_mm2[1] > 0).sum() < len(specimen.centres)
    assert (pressed.area_mm2[1] > 0).sum() == (pressed.force_n[1] > 0).sum()
    assert np.corrcoef(specimen.height_factor, pressed.force_n[-1])[0, 1] > 0.8
    assert (np.diff(pressed.descent_mm) > 0).all()


def test_like_frusta_share_the_force_equally(family):
    like = Specimen(np.zeros((540, 2)), np.ones(540), np.ones(540))
    pressed = press_specimen(family, like, np.array([30.0]))
    alone = press_cell_on_glass(CORO, LAW, np.array([10.0, 30.0]) / 540, mesh=COARSE)
    assert pressed.force_n == pytest.approx(30 / 540)
    assert pressed.descent_mm[0] == pytest.approx(alone.compression_mm[1], rel=2e-3)
    assert pressed.area_mm2[0] == pytest.approx(alone.area_mm2[1], rel=0.01)


def test_interpolated_frusta_behave_as_ones_that_are_solved(family):
    """Off the cells that were solved, with height and tip changed together: force 0.2 %; the area steps by rows of elements."""
    shape = {"height_factor": 0.985, "tip_factor": 1.03}
    solved = press_cell_on_glass(CORO, LAW, np.array([0.02, 0.05, 0.08, 0.1]), mesh=COARSE, **shape)
    same = {name: np.full(4, value) for name, value in shape.items()}
    assert family.force(solved.compression_mm, **same) == pytest.approx(solved.force_n, rel=2e-3)
    assert family.area(solved.compression_mm, **same) == pytest.approx(solved.area_mm2, rel=0.02)


def test_a_force_beyond_the_solved_cells_is_refused(family, specimen):
    with pytest.raises(ConvergenceError, match="not to 120 N; ask for smaller forces or for less scatter"):
        press_specimen(family, specimen, np.array([120.0]))


def test_a_specimen_has_the_scatter_that_is_asked_for_and_comes_back_with_its_seed():
    specimen, again = (scattered_specimen(CORO, height_scatter=0.01, tip_scatter=0.02, seed=5) for _ in range(2))
    assert specimen.height_factor.std() == pytest.approx(0.01, rel=0.1)
    assert specimen.tip_factor.std() == pytest.approx(0.02, rel=0.1)
    assert (specimen.tip_factor == again.tip_factor).all()
    assert len(specimen.centres) == 540


def test_four_frusta_with_free_borders_share_a_plate_alike_and_spread():
    """A patch of 2 x 2 has two mirrors: four equal shares of the force. Its free sheet is softer than the endless lattice's."""
    forces = 4 * np.array([20.0, 60.0]) / 540
    body = build_patch(CORO, (2, 2), dielectric_law=LAW, mesh=COARSE)
    exact = replace(SETTINGS, relative_tolerance=1e-6)     # a node may else carry more than what shares are compared to
    load_steps = list(press_load_steps(body, HeightField(plate_over(CORO)), forces, settings=exact))
    areas = np.array([[contact_area(body.support, load_step.state.support.displacement, frustum=k) for k in range(4)]
                      for load_step in load_steps])
    carried = load_steps[-1].state.support.force[:, body.support.root, 2].sum(axis=1)
    body.close()
    assert np.ptp(areas, axis=1).max() < 1e-4 * areas.mean()
    assert np.abs(carried) == pytest.approx(forces[-1] / 4, rel=1e-4)
    endless = press_cell_on_glass(CORO, LAW, forces / 4, mesh=COARSE)
    assert (np.array([load_step.state.indentation for load_step in load_steps]) > 1.2 * endless.compression_mm).all()


@pytest.mark.parametrize("forces", [[50.0, 5.0], [-1.0], [], [1.0, float("nan")]])
def test_forces_on_a_specimen_that_fall_or_pull_are_refused_in_a_sentence(forces):
    with pytest.raises(InputError, match="give finite ones from 0 on that do not fall"):
        press_specimen(None, None, forces)
