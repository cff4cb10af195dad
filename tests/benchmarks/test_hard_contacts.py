"""The random contacts of benchmarks/hard_contacts.py: those that its words promise, and what its record counts."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.sensors import CORO

from softtact.geometry.meshes import place


@pytest.fixture(scope="module")
def benchmark():
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    import hard_contacts

    yield hard_contacts
    sys.path.pop(0)


def test_a_contact_is_drawn_again_from_its_number_and_set(benchmark):
    (mesh, pose, bodies), (again, _, _), (other, _, _) = (benchmark.contact(seed, 3, CORO) for seed in (1, 1, 2))
    np.testing.assert_array_equal(mesh.vertices, again.vertices)
    assert mesh.vertices.shape != other.vertices.shape or not np.allclose(mesh.vertices, other.vertices)
    assert place(mesh, pose=pose).bounds[0, 2] == pytest.approx(0.0, abs=1e-9) and 1 <= len(bodies) <= 3


def test_the_contacts_are_of_all_kinds_and_tilts_and_their_first_body_stands_over_the_sensor(benchmark):
    drawn = [benchmark.contact(1, number, CORO) for number in range(60)]
    words = [body.split() for _, _, bodies in drawn for body in bodies]
    assert {name for name, _ in words} == {"plug", "wall", "box", "rod"}
    assert {len(bodies) for _, _, bodies in drawn} == {1, 2, 3}
    tilts = [float(tilt) for _, tilt in words]
    assert min(tilts) < 5 and 40 < max(tilts) <= 45
    places = np.array([pose.translation_mm[:2] for _, pose, _ in drawn]) / CORO.footprint_mm
    assert (np.abs(places) <= 0.5).all() and (np.ptp(places, axis=0) > 0.9).all()


def test_the_interval_of_a_share_is_wilsons(benchmark):
    """Wilson, J. Am. Stat. Assoc. 22 (1927) 209: for none of n the upper end is z^2 / (n + z^2)."""
    assert benchmark.interval(0, 20) == [0.0, pytest.approx(1.96**2 / (20 + 1.96**2), abs=1e-3)]
    assert benchmark.interval(10, 20) == pytest.approx([0.299, 0.701], abs=1e-3)


def test_the_record_counts_a_flagged_press_as_not_reached(benchmark):
    rows = [{"outcome": "reached", "told": False}, {"outcome": "flagged", "told": True}, {"outcome": "late", "told": False}]
    found = benchmark.summary(rows)
    assert found["reached"] == 1 and found["share"] == 0.333 and found["told_of_the_rest"] == 1


@pytest.mark.parametrize(("valid", "reasons", "crushed"), [
    ([1, 1, 0], ["", "", "a frustum is compressed by 90 %, when its pocket is full; frusta fold on under the same force"], True),
    ([1, 0, 0], ["", "a frustum is compressed by 85 %, when its pocket is full", "a frustum, when its pocket is full"], True),
    ([1, 0, 1], ["", "a frustum is compressed by 85 %, when its pocket is full", ""], False),
    ([1, 0, 0], ["", "surfaces overlap", "a frustum is compressed by 90 %, when its pocket is full"], False),
    ([1, 1, 0], ["", "", "a frustum is compressed by 90 %, when its pocket is full; an element of the cover is folded"], False),
    ([1, 1, 0], ["", "", "frusta fold on under the same force"], False)])
def test_frusta_are_crushed_where_the_last_load_steps_are_flagged_for_nothing_else(benchmark, valid, reasons, crushed):
    assert benchmark.crushed_last(SimpleNamespace(within_validity=np.array(valid), validity_reason=np.array(reasons))) is crushed
