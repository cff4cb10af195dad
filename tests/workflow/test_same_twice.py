"""The same study twice, with 1 and with 2 cores: what is compared, and (gold, a quarter of an hour) that nothing differs."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import xarray

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def same_twice():
    """benchmarks/same_twice.py as a module."""
    spec = importlib.util.spec_from_file_location("same_twice", ROOT / "benchmarks/same_twice.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.gold
def test_one_and_two_cores_give_the_same_tables_and_maps(same_twice):
    same, timed, different = same_twice.compare(*(same_twice.run(cores) for cores in (1, 2)))
    assert not different
    assert len(same) > 100 and len(timed) < len(same) / 3


def write_press(folder, *, seconds, deepest=0.3):
    (folder / "presses").mkdir(parents=True)
    maps = np.linspace(0, deepest, 24).reshape(1, 4, 6)
    dataset = xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), maps)}, attrs={"wall_time_s": [seconds]})
    dataset.to_netcdf(folder / "presses/a.nc", engine="h5netcdf")


def test_presses_that_took_other_times_are_the_same_and_other_maps_differ(same_twice, tmp_path):
    write_press(tmp_path / "one", seconds=1.0)
    write_press(tmp_path / "two", seconds=2.0)
    write_press(tmp_path / "three", seconds=1.0, deepest=0.3 + 1e-15)
    assert same_twice.compare(tmp_path / "one", tmp_path / "two") == (["presses/a.nc"], [], [])
    assert same_twice.compare(tmp_path / "one", tmp_path / "three") == ([], [], ["presses/a.nc"])


def test_a_table_of_times_is_left_out_another_table_and_a_missing_one_are_not(same_twice, tmp_path):
    for folder, number in (("one", 1), ("two", 2)):
        (tmp_path / folder / "tables").mkdir(parents=True)
        for name in ("run.csv", "table1.csv"):
            (tmp_path / folder / "tables" / name).write_text(f"n\n{number}\n")
    (tmp_path / "one/tables/extra.csv").write_text("n\n")
    assert same_twice.compare(tmp_path / "one", tmp_path / "two") == (
        [], ["tables/run.csv"], ["tables/extra.csv: in one only", "tables/table1.csv"])
