"""Capacitance per area: closed forms in the limits, bounds by a finite-volume field, what compression does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_cell import cell_capacitance, column_capacitance
from support.sensors import CORO

from softtact.readout.capacitance import EPSILON_0_PF_PER_MM, capacitance_per_area, ideal_counts, solid_share

MAP = (57, 33)


def changed(*, permittivity=3.5, **frusta):
    """The sensor with other frusta (mm) or another permittivity."""
    dielectric = CORO.dielectric
    update = {"relative_permittivity": permittivity, "frusta": dielectric.frusta.model_copy(update=frusta)}
    return CORO.model_copy(update={"dielectric": dielectric.model_copy(update=update)})


def plate(gap_mm, permittivity=1.0):
    return EPSILON_0_PF_PER_MM * permittivity / gap_mm


def test_a_solid_with_the_permittivity_of_air_is_an_air_plate_capacitor():
    for moved in [0.0, 0.1, 0.3, 0.45]:
        assert capacitance_per_area(changed(permittivity=1.0), moved) == pytest.approx(plate(1.0 - moved)), moved


def test_frusta_that_fill_their_cells_are_a_solid_plate_capacitor():
    for moved in [0.0, 0.1, 0.6]:
        full = changed(tip_diameter_mm=2.0, root_diameter_mm=2.0)
        assert capacitance_per_area(full, moved) == pytest.approx(plate(1.0 - moved, 3.5)), moved


def test_needles_leave_air_above_a_solid_sheet():
    needles = changed(tip_diameter_mm=1e-4, root_diameter_mm=1e-4)
    expected = 1 / (1 / plate(0.5 - 0.2) + 1 / plate(0.5, 3.5))
    assert capacitance_per_area(needles, 0.2) == pytest.approx(expected, rel=1e-6)


def test_straight_posts_become_wider_as_they_become_shorter():
    posts, moved = changed(tip_diameter_mm=0.6, root_diameter_mm=0.6), 0.2
    phi = np.pi * 0.3**2 / 1.2**2 * 0.5 / (0.5 - moved)
    expected = 1 / (1 / plate(0.5 - moved, 1 + 2.5 * phi) + 1 / plate(0.5, 3.5))
    assert capacitance_per_area(posts, moved) == pytest.approx(expected, rel=1e-5)


def test_the_solid_of_cones_at_rest_is_their_volume():
    r, R = 0.3, 0.6
    assert solid_share(CORO.dielectric.frusta).mean() == pytest.approx(np.pi / 3 * (r * r + r * R + R * R) / 1.44, rel=1e-5)


def test_once_the_pocket_is_full_solid_alone_is_compressed():
    for moved in [0.28, 0.4, 0.7]:
        assert capacitance_per_area(CORO, moved) == pytest.approx(plate(1.0 - moved, 3.5)), moved


def test_plates_that_would_meet_keep_the_capacitance_of_the_thinnest_solid():
    before, met, beyond = capacitance_per_area(CORO, np.array([0.9, 1.0, 5.0]))
    assert before < met == beyond < np.inf


def test_the_field_of_a_cell_lies_between_columns_and_slices():
    for moved in [0.0, 0.05, 0.1]:
        assert column_capacitance(CORO, moved) < cell_capacitance(CORO, moved) < capacitance_per_area(CORO, moved), moved


def test_slices_give_the_relative_change_of_the_field_to_two_per_cent_where_columns_are_off_by_five():
    changes = [model(CORO, 0.1) / model(CORO, 0.0) - 1 for model in (cell_capacitance, capacitance_per_area, column_capacitance)]
    assert changes[1] == pytest.approx(changes[0], rel=0.02)          # 1.5 % measured
    assert abs(changes[2] / changes[0] - 1) > 0.05                    # 6.9 % measured: why slices were taken


def test_the_naive_cell_is_a_plate_capacitor_where_there_is_one():
    assert cell_capacitance(changed(permittivity=1.0), 0.1, across=20, up=30) == pytest.approx(plate(0.9))


@given(st.floats(-0.3, 1.5), st.floats(0, 0.5), st.floats(0.1, 1.6), st.floats(0.1, 1.6), st.floats(1.0, 12.0))
@settings(max_examples=60, deadline=None)
def test_coming_nearer_never_lowers_the_capacitance_whatever_the_frusta(moved, more, tip, root, permittivity):
    spec = changed(tip_diameter_mm=tip, root_diameter_mm=root, permittivity=permittivity)
    near, nearer = capacitance_per_area(spec, np.array([moved, moved + more]))
    assert nearer >= near * (1 - 1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.3))
@settings(max_examples=20, deadline=None)
def test_more_displacement_never_lowers_an_ideal_count(seed, size):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 0.4, MAP)
    assert (ideal_counts(CORO, low + size * rng.random(MAP)) >= ideal_counts(CORO, low) - 1e-9).all()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_a_symmetric_map_gives_symmetric_ideal_counts(seed):
    half = np.random.default_rng(seed).uniform(0, 0.3, MAP)
    counts = ideal_counts(CORO, half + half[::-1, ::-1])
    assert counts == pytest.approx(counts[::-1, ::-1])


def test_a_uniform_displacement_gives_every_taxel_the_plate_capacitors_change():
    expected = 1000 * (capacitance_per_area(CORO, 0.2) / capacitance_per_area(CORO, 0.0) - 1)
    assert ideal_counts(CORO, np.full(MAP, 0.2)) == pytest.approx(np.full((7, 4), expected))
