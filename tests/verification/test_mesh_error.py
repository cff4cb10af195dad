"""Error of the map on each mesh against a much finer mesh: a small press, and the record of many."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.laws import LAWS
from support.sensors import CORO

from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.press.sensor import Sensor

ROOT = Path(__file__).parents[2]
SMALL = CORO.model_copy(update={"footprint_mm": (3.6, 3.6), "map_shape": (13, 13)})      # 3 x 3 frusta, a map as dense as theirs
# No share with the fine mesh: elements split in plan, twice as many layers, two of the cover's bound, edges split five times.
FINER = MeshSettings(refinement=1, frustum_heights=(0.0, 0.1, 0.3, 0.6, 1.0), cover_heights=(0.0, 0.25, 0.5, 0.75, 1.0),
                     cover_splits=(1, 4))
LARGEST_PERCENT = {"fine": 2.0, "production": 5.1, "draft": 10.0}     # what the README promises, rounded
SMALL_PUNCH_PERCENT = 3.0      # on the fine mesh, where a frustum is a quarter of the contact; the default has 3.7


def map_under_a_punch(mesh):
    """At 1 N, under a flat punch of 1.2 mm radius."""
    punch = trimesh.creation.cylinder(radius=1.2, height=2, sections=96)
    sensor = Sensor(SMALL, LAWS, mesh=mesh, solver=NewtonSettings())
    return sensor.press(punch, force_n=1.0, model="hyperelastic").deformation_map_mm[0]


@pytest.mark.slow
def test_the_fine_mesh_is_near_to_a_finer_one_and_the_default_less(record):
    finer = map_under_a_punch(FINER)
    error = {name: 100 * np.abs(map_under_a_punch(mesh) - finer).max() / finer.max()
             for name, mesh in (("fine", MeshSettings.fine()), ("default", MeshSettings()))}
    for name, got in error.items():
        record(f"3 x 3 frusta, flat punch, 1 N: largest error of the map on the {name} mesh, % of its maximum", expected=0.0,
               source="a mesh split everywhere", got=got)
    assert error["fine"] < SMALL_PUNCH_PERCENT < error["default"]


@pytest.mark.parametrize("mesh", LARGEST_PERCENT)
def test_the_errors_of_the_long_comparison_are_what_is_promised(mesh, record):
    """The last run of `python benchmarks/mesh_error.py`, which is too long for a test."""
    kept = json.loads((ROOT / "benchmarks/results/mesh_error.json").read_text(encoding="utf-8"))
    rows = [row for row in kept["rows"] if row["mesh"] == mesh]
    assert {row["object"] for row in rows} == {"flat punch", "sphere", "ridges"} and kept["against"] == "reference"
    worst = max(max(row["largest_error_percent"]) for row in rows)
    record(f"36 frusta, three objects, three load steps: largest error of the map on the {mesh} mesh, % of its maximum",
           expected=0.0, source="benchmarks/mesh_error.py", got=worst)
    assert 0.5 < worst < LARGEST_PERCENT[mesh]
