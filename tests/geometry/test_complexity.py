"""Complexity counts and the choice of model."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from softtact.errors import InputError
from softtact.geometry.complexity import choose_model, hull_edges, overlap_points, score, score_file, score_objects
from softtact.geometry.pose import Pose
from softtact.studies.hybrid.stages import score_complexity

FOOTPRINT = (22.0, 37.0)
OBJECTS = Path(__file__).parents[2] / "config" / "objects"
# The paper, table 2: NPt, CHt, NPo, CHo, chosen model
PRINTED = {
    1: (1356, 231, 51, 36, "elastic"),
    2: (13830, 15537, 1205, 3444, "elastic"),
    3: (1932, 1348, 64, 105, "elastic"),
    4: (5472, 1449, 164, 141, "elastic"),
    5: (5628, 426, 242, 90, "hyperelastic"),
    6: (28524, 1353, 984, 102, "hyperelastic"),
}


def test_the_rule_any_gives_every_printed_choice():
    for row in PRINTED:
        *counts, chosen = PRINTED[row]
        assert choose_model(*counts, rule="any") == chosen, row


def test_the_rule_all_of_the_papers_text_contradicts_its_table_at_object_5_only():
    wrong = [row for row, (*counts, chosen) in PRINTED.items() if choose_model(*counts, rule="all") != chosen]
    assert wrong == [5]


def test_thresholds_are_inclusive_and_settable():
    assert choose_model(100, 10, 0, 0) == "hyperelastic"
    assert choose_model(99, 10, 0, 0) == "elastic"
    assert choose_model(99, 10, 0, 0, total=9) == "hyperelastic"
    assert choose_model(0, 10, 79, 10) == "elastic"
    assert choose_model(0, 10, 79, 10, overlap=7) == "hyperelastic"


def test_an_empty_overlap_is_no_detail():
    assert choose_model(99, 10, 0, 0, rule="any") == "elastic"


def test_an_unknown_rule_is_refused():
    with pytest.raises(InputError, match="'some'.*'any' or 'all'"):
        choose_model(1, 1, 1, 1, rule="some")


def test_a_sphere_keeps_all_points_on_its_hull():
    triangles = trimesh.creation.icosphere(subdivisions=2, radius=10).triangles
    corners = 162  # 10 * 4**2 + 2
    assert len(triangles) * 3 == 960 and hull_edges(triangles.reshape(-1, 3)) == 3 * corners - 6
    assert score(triangles, footprint_mm=FOOTPRINT).ratio_total == 2.0


def test_hull_edges_of_flat_and_empty_point_sets():
    rotate = Pose.parse("0,0,0,20,30,40").apply
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])
    assert hull_edges(square) == hull_edges(rotate(square)) == 5
    assert hull_edges(line) == hull_edges(rotate(line)) == 1
    assert hull_edges(np.zeros((3, 3))) == hull_edges(np.empty((0, 3))) == 0


def test_the_overlap_is_bounded_by_footprint_and_reach():
    box = trimesh.creation.box(extents=(10, 10, 10)).triangles + [0, 0, 5]
    assert len(overlap_points(box, footprint_mm=FOOTPRINT)) == np.sum(box[..., 2] == 0)
    assert len(overlap_points(box, footprint_mm=FOOTPRINT, reach_mm=10)) == 36
    assert len(overlap_points(box, footprint_mm=(9, 9))) == 0, "corners lie beside the footprint"
    assert len(overlap_points(box + [30, 0, 0], footprint_mm=FOOTPRINT)) == 0


def test_the_overlap_reaches_up_from_the_lowest_facet_over_the_footprint_not_from_a_lower_one_beside_it():
    box, pin = trimesh.creation.box(extents=(10, 10, 2)).triangles, trimesh.creation.box(extents=(2, 2, 2)).triangles
    both = np.concatenate([box, pin + [30, 0, -50]])
    np.testing.assert_array_equal(overlap_points(both, footprint_mm=FOOTPRINT, reach_mm=2.5),
                                  overlap_points(box, footprint_mm=FOOTPRINT, reach_mm=2.5))
    assert len(overlap_points(box, footprint_mm=FOOTPRINT, reach_mm=2.5)) == 36


def test_points_are_counted_as_stored_not_merged(tmp_path):
    file = tmp_path / "box.stl"
    trimesh.creation.box(extents=(10, 10, 10)).export(file)
    counts = score_file(file, unit="mm", footprint_mm=FOOTPRINT)
    assert (counts.NPt, counts.CHt) == (36, 18)


def test_a_pose_moves_what_overlaps():
    ball = OBJECTS / "grasped" / "object_2.stl"
    away = score_file(ball, unit="mm", footprint_mm=FOOTPRINT, pose=Pose.parse("60,0,0,0,0,0"))
    assert (away.NPo, away.CHo, away.ratio_overlap) == (0, 0, 0.0)


def grasped():
    entries = [entry for entry in yaml.safe_load((OBJECTS / "catalogue.yaml").read_text()) if entry["name"].startswith("object_")]
    return [OBJECTS / entry["file"] for entry in entries], entries


def test_our_six_objects_fall_as_the_papers_do():
    table = score_objects(*grasped(), footprint_mm=FOOTPRINT)
    assert table["model"].tolist() == [chosen for *_, chosen in PRINTED.values()]


def test_the_stage_writes_the_contracted_columns(tmp_path):
    paths, entries = grasped()
    settings = {"objects": [{"name": entries[4]["name"], "unit": "mm"}], "footprint_mm": list(FOOTPRINT),
                "rule": "all", "thresholds": {"total": 10, "overlap": 8}}
    score_complexity.run(inputs={"meshes": paths[4]}, outputs={"table": tmp_path / "complexity.csv"}, settings=settings)
    header, row = (tmp_path / "complexity.csv").read_text().splitlines()
    assert header == "object,NPt,CHt,NPo,CHo,model,ratio_total,ratio_overlap"
    assert row.startswith("object_5,9000,498,") and ",elastic," in row
