"""Maps of a state: those of the command line and Python lines that the page shows, coarse ones near the whole ones."""

import shlex
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from softtact.cli import main
from softtact.errors import InputError
from softtact.models.elastic.compliance import draft_cells, draft_of, elastic_compliance
from softtact.play.solver import Solver
from softtact.play.state import Object
from softtact.press.result import read_press

MOVED = {"x_mm": 2.0, "y_mm": -3.0, "rotation_deg": (20.0, 90.0, 40.0), "slide_mm": (1.5, 0.5), "twist_deg": 15.0}


@pytest.mark.parametrize("change", [{}, MOVED, {"load_by": "depth", "depth_mm": 0.4}], ids=["centred", "moved", "by depth"])
def test_the_command_line_and_the_python_lines_give_the_press_that_is_shown(state, solver, tmp_path, change):
    shown = solver.solve(replace(state, **change))
    assert main([*shown.press.arguments, "--out", str(tmp_path / "press.nc")]) == 0
    assert shlex.split(shown.press.command) == ["softtact", *shown.press.arguments, "--out", "press.nc"]
    assert shlex.split(shown.press.command_lines.replace("\\\n", "")) == shlex.split(shown.press.command)
    names = {}
    exec(shown.press.python, names)
    for result in (read_press(tmp_path / "press.nc"), names["result"]):
        np.testing.assert_allclose(result.deformation_map_mm, shown.result.deformation_map_mm, atol=1e-9)
        assert result.normal_force_n == shown.result.normal_force_n and result.expected_error_mm == shown.result.expected_error_mm


def test_a_mesh_that_had_to_be_repaired_has_lines_that_repair_it(state, solver, tmp_path):
    ball = trimesh.load(state.object.path)
    trimesh.Trimesh(ball.vertices, [*ball.faces, ball.faces[0]], process=False).export(tmp_path / "doubled.stl")
    shown = solver.solve(replace(state, object=Object(tmp_path / "doubled.stl", "mm")), draft=False)
    names = {}
    exec(shown.press.python, names)
    np.testing.assert_allclose(names["result"].deformation_map_mm, shown.result.deformation_map_mm, atol=1e-9)
    assert "read_mended" in shown.press.python


def test_on_a_gel_slide_and_twist_are_a_motion_with_friction(state, folder, tmp_path):
    solver, moved = Solver(), replace(state, sensor=str(folder / "gel.yaml"), force_n=2.0, slide_mm=(0.5, 0.0), twist_deg=5.0)
    shown = solver.solve(moved)
    assert shown.press.load == "fz -2; x 0.5 in 5; rz 5 in 3" and np.nanmax(shown.result.slip) > 0
    names = {}
    exec(shown.press.python, names)
    np.testing.assert_allclose(names["result"].displacement_mm, shown.result.displacement_mm, atol=1e-9)
    np.testing.assert_array_equal(shown.clearance_mm < 0, shown.result.traction_mpa[-1, ..., 2] < 0)
    by_depth = solver.solve(replace(moved, load_by="depth", depth_mm=0.3))
    assert by_depth.press.load == "z -0.3; x 0.5 in 5; rz 5 in 3" and by_depth.result.indentation_mm[-1] == pytest.approx(0.3)


def test_an_object_that_rests_on_the_shell_is_remarked(state, solver, tmp_path):
    trimesh.creation.box((40.0, 60.0, 5.0)).export(tmp_path / "plate.stl")
    shown = solver.solve(replace(state, object=Object(tmp_path / "plate.stl", "mm"), rotation_deg=(0.0, 20.0, 0.0), force_n=20.0))
    assert "rests on the shell" in shown.remarks[0] and len(shown.remarks) == 1


def test_the_coarse_map_is_near_the_whole_one(state, solver):
    coarse, whole = solver.solve(state, draft=True), solver.solve(state)
    assert coarse.draft and not whole.draft
    apart = coarse.result.deformation_map_mm - whole.result.deformation_map_mm
    assert 0 < np.sqrt((apart**2).mean()) < 0.04 * whole.result.deformation_map_mm.max()


def test_a_coarse_field_has_the_values_of_its_own_grid_at_the_maps_points(solver, state):
    spec = solver.bench(state.sensor).sensor.spec
    plain = elastic_compliance(spec, cells=draft_cells(spec))
    draft, force = draft_of(spec, plain), np.zeros((3, 1))
    force[1] = 2.0

    class Points:
        nodes = np.array([5, plain.grid.count // 2, 9])

    fields = draft.fields(Points, force)
    assert fields.shape[1:] == tuple(2 * count - 1 for count in spec.map_shape)
    np.testing.assert_allclose(fields[:, ::2, ::2], plain.fields(Points, force), atol=1e-12)


@pytest.mark.parametrize("depth", [0.005, 0.2, 0.7])
def test_a_depth_is_reached(state, solver, depth):
    shown = solver.solve(replace(state, load_by="depth", depth_mm=depth), draft=True)
    assert shown.result.indentation_mm[-1] == pytest.approx(depth, rel=5e-3)


def test_a_depth_beyond_the_largest_force_ends_at_that_force(state, solver):
    shown = solver.solve(replace(state, load_by="depth", depth_mm=9.0), draft=True)
    assert shown.result.normal_force_n[-1] == pytest.approx(50.0)
    assert "50 N, the sensor's largest force, is too little for the depth of 9 mm" in shown.result.validity_reason[-1]
    assert not shown.result.within_validity[-1]
    reached = solver.solve(replace(state, load_by="depth", depth_mm=0.2), draft=True).result
    assert "largest force" not in reached.validity_reason[-1]


def test_an_object_that_only_moved_keeps_its_underside_and_has_the_map_of_a_new_one(state):
    solver, there = Solver(), replace(state, x_mm=1.7, y_mm=2.2)
    solver.solve(state, draft=True)
    kept = solver.bench(state.sensor)._underside[1]
    moved = solver.solve(there, draft=True)
    assert solver.bench(state.sensor)._underside[1] is kept
    np.testing.assert_allclose(moved.result.deformation_map_mm, Solver().solve(there, draft=True).result.deformation_map_mm,
                               atol=1e-9)


def test_the_mesh_is_shown_where_it_presses_and_touches_within_the_outline(state, solver):
    shown = solver.solve(replace(state, x_mm=1.0, force_n=20.0))
    translation, quaternion = shown.end
    lowest = solver.mesh(state.object).vertices[:, 2].min() + translation[2]
    assert lowest == pytest.approx(-shown.result.indentation_mm[-1], abs=1e-3) and quaternion == pytest.approx([1, 0, 0, 0])
    y, x = np.nonzero(shown.clearance_mm < 0)
    assert shown.result.x_mm[x].mean() == pytest.approx(1.0, abs=0.4) and shown.result.y_mm[y].mean() == pytest.approx(0, abs=0.4)


def test_what_has_no_map_is_refused_in_a_sentence(state, solver, tmp_path):
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    for wrong, words in ((replace(state, x_mm=80.0), "misses the sensor"), (replace(state, force_n=500.0), "out of the range"),
                         (replace(state, object=Object(tmp_path / "broken.stl", "mm")), "broken.stl"),
                         (replace(state, sensor="nowhere"), "no sensor")):
        with pytest.raises(InputError, match=words):
            solver.solve(wrong, draft=True)
