"""The anchors of the study `decide`: where objects lie over the piece, which nodes are compared, what counts as met."""

import sys
from pathlib import Path

import numpy as np
import pytest

from softtact.contact.height_field import HeightField
from softtact.decks.model import body_mesh


@pytest.fixture(scope="module")
def anchors():
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    import decide_anchors
    yield decide_anchors
    sys.path.pop(0)


@pytest.fixture(scope="module")
def pieces(anchors):
    return anchors.pieces()


@pytest.mark.parametrize("name", ["stepped_01", "stepped_03", "stepped_05"])
def test_a_stepped_object_lies_with_the_gap_beside_its_lower_feature_over_the_middle(anchors, pieces, name):
    made = pieces[1][name]
    below, gap, above = HeightField(anchors.placed(made))(np.zeros(3), np.array([-2.0, 0.0, 2.0]))[0]
    assert abs(above - below) == pytest.approx(made.step_mm, abs=1e-6) and gap > max(below, above) + 1


def test_a_smooth_object_lies_with_its_lowest_point_over_the_middle(anchors, pieces):
    heights = HeightField(anchors.placed(pieces[1]["smooth_02"]))(np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 3.0]))[0]
    assert heights[0] == 0 and (heights[1:] > 0.03).all()


def test_the_compared_nodes_are_those_of_the_deck_in_its_order(anchors, pieces):
    body = pieces[0]["a"].body(surface=HeightField(anchors.placed(pieces[1]["stepped_01"])))
    nodes, mesh = anchors.interface(body), body_mesh(body)
    assert (np.diff(mesh.slab[nodes]) > 0).all()
    assert mesh.points[mesh.slab[nodes]] == pytest.approx(body.slab.points[nodes])
    assert len(np.unique(body.slab.points[nodes, 2])) == 1


@pytest.mark.parametrize(("changed", "missed"), [
    ({}, set()), ({"force": [-0.07]}, {"force"}), ({"map_rms": [0.031]}, {"map_rms"}),
    ({"lower_share": [[0.5], [0.54]]}, {"lower_share"})])
def test_each_tolerance_is_judged_by_itself(anchors, changed, missed):
    row = {"force": [0.05], "map_rms": [0.02], "lower_share": [[0.5], [0.52]]} | changed
    assert {key for key, met in anchors.within(row).items() if not met} == missed
