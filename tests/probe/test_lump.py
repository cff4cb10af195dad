"""A hidden lump from film forces, on a table that is made from formulas, and one lump by the solver."""

from dataclasses import replace

import numpy as np
import pytest
from support.probes import small_design

from softtact.errors import InputError
from softtact.probe.design import LumpSearch
from softtact.probe.lump import LumpTable, detection_map, deviations, find_lump, lump_table, recovery

X, DEPTH, RATIO = np.linspace(5, 62, 9), np.array([3.0, 6.0, 9.0, 12.0]), np.array([1.0, 2.0, 4.0, 8.0, 16.0])


def forces(x, depth, log_ratio):
    """Three artificial readings that separate x, depth and stiffness."""
    size = log_ratio / depth
    return np.stack([1 + size * np.cos(x / 40), 1 + size * np.sin(x / 40), 0.3 * log_ratio + 0.1 * depth], axis=-1)


@pytest.fixture(scope="module")
def table():
    grid = np.meshgrid(X, DEPTH, np.log(RATIO), indexing="ij")
    return LumpTable(X, DEPTH, RATIO, forces(*grid), np.array([1.0, 1.0, 0.5]), 1e-3)


def test_a_lump_between_the_tables_points_is_found(table):
    found = find_lump(table, forces(20.0, 7.0, np.log(4.0)))
    # The cubic spline between depths 3 mm apart errs by about 1 % of the forces' range.
    assert (found.x_mm, found.depth_mm, found.stiffness_ratio) == pytest.approx((20.0, 7.0, 4.0), rel=0.03)
    assert found.detected


def test_the_stated_deviation_is_the_scatter_of_many_readings(table):
    lump, rng = np.array([30.0, 6.0, np.log(6.0)]), np.random.default_rng(3)
    exact = table.forces(lump)
    found = [find_lump(table, exact + 1e-3 * rng.normal(size=3)) for _ in range(20)]
    scatter = np.std([[own.x_mm, own.depth_mm, np.log(own.stiffness_ratio)] for own in found], axis=0, ddof=1)
    assert scatter == pytest.approx(deviations(table, lump), rel=0.48)      # 20 draws: 16 % standard error, three of them


def test_two_lumps_that_read_alike_both_lie_in_the_interval():
    grid = np.meshgrid(X, DEPTH, np.log(RATIO), indexing="ij")
    twins = np.stack([grid[2], grid[2] * (grid[0] - 33.5)**2], axis=-1)      # the same for x and 67 - x
    table = LumpTable(X, DEPTH, RATIO, twins, np.zeros(2), 1e-3)
    low, high = find_lump(table, np.array([np.log(4.0), np.log(4.0) * 100.0])).interval[0]
    assert low < 23.6 and high > 43.4


def test_a_parameter_that_no_film_feels_has_no_finite_deviation(table):
    blind = LumpTable(X, DEPTH, RATIO, np.broadcast_to(table.force_n[:, :1], table.force_n.shape), table.plain_n, 1e-3)
    assert deviations(blind, np.array([30.0, 6.0, 1.0]))[1] > 1e6


def spread(x, depth, log_ratio):
    """Two made-up films: a lump's force spreads as far along the beam as the lump is deep."""
    return np.stack([log_ratio / depth * np.exp(-0.5 * ((x - film) / (2 * depth))**2) for film in (24.0, 43.0)], axis=-1)


@pytest.fixture(scope="module")
def beside():
    axes = np.linspace(5, 62, 39), np.linspace(3, 12, 19), np.geomspace(1, 16, 9)
    grid = np.meshgrid(axes[0], axes[1], np.log(axes[2]), indexing="ij")
    return LumpTable(*axes, spread(*grid), np.zeros(2), 1e-3, np.array([0.0, -8.0, 8.0]))


def test_presses_beside_a_lump_tell_its_depth_where_one_press_cannot(beside):
    lump, one = np.array([30.0, 6.0, np.log(4.0)]), replace(beside, move_mm=np.zeros(1))
    readings = np.concatenate([spread(lump[0] + move, *lump[1:]) for move in (0, -8, 8)])
    # Two readings for three unknowns, and six.
    assert deviations(one, lump)[1] > 1e3
    assert deviations(beside, lump)[1] < 0.1
    found = find_lump(beside, readings)
    assert (found.x_mm, found.depth_mm, found.stiffness_ratio) == pytest.approx((30.0, 6.0, 4.0), rel=0.01)


def test_hidden_lumps_are_read_where_the_sensor_was_moved_to(monkeypatch):
    def solved(design, search, x, depth, ratio, threads):
        # middle, left, right film
        if x is None:
            return np.zeros(3)
        return np.array([np.log(ratio) / depth * np.exp(-0.5 * ((x - film) / (2 * depth))**2) for film in (33.5, 12.0, 55.0)])

    monkeypatch.setattr("softtact.probe.lump._solved", solved)
    search = LumpSearch(tissue="rubber", width=6, height=5, x=np.linspace(5, 33.5, 20).tolist(),
                        depth=np.linspace(3.5, 12, 15).tolist(), stiffness_ratio=[1.5, 2, 3, 4, 6, 8], jaw_mm=[0.5], noise_n=1e-5,
                        moves=[0, -4, 7], trials=6, source="a test's")
    design = small_design()
    found = recovery(design, search, lump_table(design, search))
    # Spline and noise put it off by 0.001 mm; a move with the wrong sign by millimetres.
    assert (found.found_x_mm - found.x_mm).abs().max() < 0.01
    assert (found.found_depth_mm - found.depth_mm).abs().max() < 0.01


def test_a_lump_stays_within_the_table_in_every_press(beside):
    assert (beside.low[0], beside.high[0]) == (13.0, 54.0)
    assert set(detection_map(beside).x_mm) == {13.0, 54.0} | {x for x in beside.x_mm if 13 <= x <= 54}


def test_moves_beyond_the_table_are_refused():
    search = LumpSearch(tissue="rubber", width=6, height=5, x=[5, 14.5, 24, 33.5], depth=[3.5, 7, 10.5, 12],
                        stiffness_ratio=[2, 4, 8], jaw_mm=[0.5], noise_n=0.01, moves=[-30, 30], source="a test's")
    with pytest.raises(InputError, match="moves reach 60 mm, and the table of lumps 57 mm, from 5 to 62 mm"):
        lump_table(small_design(), search)


def test_more_noise_hides_more_lumps(table):
    loud = LumpTable(X, DEPTH, RATIO, table.force_n, table.plain_n, 0.05)
    quiet, noisy = (detection_map(own).least_stiffness_ratio for own in (table, loud))
    assert (quiet <= noisy).all() and (quiet < noisy).any()


def test_readings_of_another_number_are_refused(table):
    with pytest.raises(InputError, match="2 readings, and the table has 3"):
        find_lump(table, np.ones(2))


def test_the_left_half_is_mirrored_with_the_films_exchanged(monkeypatch):
    def solved(design, search, x, depth, ratio, threads):
        # middle, left, right film; 9 N are the mesh's, which are to leave no trace
        return np.zeros(3) if x is None else 9 + np.array([depth * ratio, x * ratio, (67 - x) * ratio])

    monkeypatch.setattr("softtact.probe.lump._solved", solved)
    search = LumpSearch(tissue="rubber", width=6, height=5, x=[5, 14.5, 24, 33.5], depth=[3.5, 7, 10.5, 12],
                        stiffness_ratio=[2, 4, 8], jaw_mm=[0.5], noise_n=0.01, source="a test's")
    table = lump_table(small_design(), search)
    assert table.x_mm == pytest.approx([5, 14.5, 24, 33.5, 43, 52.5, 62])
    assert table.forces(np.array([52.5, 7, np.log(4)])) == pytest.approx([21, 157.5, 43.5], rel=1e-4)


def test_films_without_mirror_images_are_refused():
    search = LumpSearch(tissue="rubber", width=6, height=5, x=[5, 14.5, 24, 33.5], depth=[3.5, 7, 10.5, 12],
                        stiffness_ratio=[2, 4, 8], jaw_mm=[0.5], noise_n=0.01, source="a test's")
    with pytest.raises(InputError, match="no mirror image"):
        lump_table(small_design(films={"left": {"end": 12}}), search)
