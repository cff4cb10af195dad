"""The field of the electrode grid: its closed limits, reciprocity, and how far the gap formula's counts lie from its."""

import numpy as np
import pytest
from naive_grid import EPSILON_0_PF_PER_MM, Fineness, GridField
from naive_plates import edge_factor
from support.sensors import CORO

from softtact.readout.capacitance import equivalent_air_gap, ideal_counts
from softtact.readout.electrodes import electrode_sides

SMALL = CORO.model_copy(update={"footprint_mm": (11.0, 10.0), "map_shape": (17, 17),
                                "taxels": CORO.taxels.model_copy(update={"rows": 2, "columns": 2})})
NINE = CORO.model_copy(update={"footprint_mm": (16.5, 15.9), "taxels": CORO.taxels.model_copy(update={"rows": 3, "columns": 3})})
COARSE = Fineness(side=7, between=2, frusta=3, sheet=2, outwards=6)


@pytest.mark.slow
def test_a_lone_square_electrode_has_the_capacitance_of_the_method_of_moments():
    """In air, 5 mm wide, 1 mm apart: 1.545 times plates without edges. Elements end 6 mm away and leave the edges' singularity."""
    air = CORO.dielectric.model_copy(update={"relative_permittivity": 1.0 + 1e-9})
    lone = SMALL.model_copy(update={"footprint_mm": (5.0, 5.0), "dielectric": air,
                                    "taxels": CORO.taxels.model_copy(update={"rows": 1, "columns": 1})})
    field = GridField(lone, np.zeros(lone.map_shape), spacing_mm=0.0, board=1.0, margin_mm=6.0,
                      fineness=Fineness(side=10, outwards=10))
    assert field.driven_together / (EPSILON_0_PF_PER_MM * 25.0) == pytest.approx(edge_factor(0.2), rel=0.02)


def test_charges_are_reciprocal_and_add_up_to_those_of_all_driven_together():
    field = GridField(SMALL, np.full(SMALL.map_shape, 0.1), fineness=COARSE)
    np.testing.assert_allclose(field.maxwell, field.maxwell.T, rtol=1e-5)
    np.testing.assert_allclose(field.maxwell.sum(axis=1).reshape(2, 2), field.driven_together, rtol=1e-5)


@pytest.mark.slow
def test_an_electrode_among_neighbours_has_the_area_of_its_whole_taxel():
    """Neighbours at the same potential guard it, and the 0.3 mm between two are closer than the gap; 0.3 % less measured."""
    inner = GridField(NINE, np.zeros(NINE.map_shape), fineness=COARSE).driven_together[1, 1]
    plates = EPSILON_0_PF_PER_MM * 5.5 * 5.3 / float(equivalent_air_gap(NINE, 0.0))
    assert inner == pytest.approx(plates, rel=0.01)
    assert np.prod(electrode_sides(NINE, spacing_mm=0.3)) < 0.9 * 5.5 * 5.3      # so its own area does not explain it


@pytest.mark.slow
def test_a_uniform_press_is_read_inside_as_the_gap_formula_says():
    """At the border field lines go around the fabric, which changes less with the gap: 6 and 11 % less, measured."""
    down = np.full(NINE.map_shape, 0.1)
    rest, pressed = (GridField(NINE, u, fineness=COARSE).driven_together for u in (0 * down, down))
    counts = 1000 * (pressed / rest - 1)
    expected = ideal_counts(NINE, down)
    assert counts[1, 1] == pytest.approx(expected[1, 1], rel=0.01)
    assert counts[0, 1] / expected[0, 1] == pytest.approx(0.94, abs=0.01)
    assert counts[0, 0] / expected[0, 0] == pytest.approx(0.89, abs=0.01)
