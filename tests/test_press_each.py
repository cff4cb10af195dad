"""`softtact press` of several meshes: a folder for each, a table of all, and none lost to one that fails."""

import json

import pandas as pd
import pytest
import trimesh

import softtact
from softtact.cli import main
from softtact.commands.press_each import ON_LAYERS, _lines

HOW = ["--unit", "mm", "--force", "5", "--model", "elastic"]


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """A folder with two bodies, a file that is none, and notes."""
    folder = tmp_path_factory.mktemp("parts")
    trimesh.creation.box((8, 8, 4)).export(folder / "block.stl")
    trimesh.creation.icosphere(radius=6).export(folder / "ball.obj")
    (folder / "broken.ply").write_text("nothing")
    (folder / "notes.txt").write_text("not a mesh")
    return folder


def test_each_object_gets_its_folder_and_one_that_fails_is_told_and_loses_no_other(parts, tmp_path, capsys):
    out = tmp_path / "results"
    assert main(["press", str(parts), *HOW, "--out", str(out), "--plot", "map.png", "--json"]) == 1
    said = capsys.readouterr()
    rows = {row["object"]: row for row in json.loads(said.out)["objects"]}
    assert {name: row["status"] for name, row in rows.items()} == {"ball": "done", "block": "done", "broken": "failed"}
    assert "1 of 3 objects failed, broken" in said.err and "3 of 3: " in said.err
    assert sorted(path.name for path in out.iterdir()) == ["ball", "block", "summary.csv"]
    assert (out / "ball/map.png").stat().st_size > 1000
    assert softtact.read_press(out / "block/press.nc").indentation_mm[-1] == rows["block"]["indentation_mm"]
    table = pd.read_csv(out / "summary.csv").set_index("object")
    assert table.force_n["ball"] == 5 and "broken.ply" in table.message["broken"]


def test_results_of_an_earlier_run_do_not_stand_for_an_object_that_fails_now(parts, tmp_path, capsys):
    old = tmp_path / "broken/press.nc"
    old.parent.mkdir()
    old.write_text("of another day")
    line = ["press", str(parts / "broken.ply"), str(parts / "block.stl"), *HOW, "--out", str(tmp_path)]
    assert main(line) == 1 and not old.exists() and (tmp_path / "block/press.nc").exists()
    table = capsys.readouterr().out.splitlines()
    assert table[0].split()[:3] == ["object", "status", "model"] and table[1].split() == ["broken", "failed"]
    assert table[2].split()[:3] == ["block", "done", "elastic"]


def test_objects_of_one_name_are_told_apart_by_their_endings_or_refused(parts, tmp_path, capsys):
    for name in ("one/part.stl", "one/part.obj", "two/part.stl"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        trimesh.creation.box((8, 8, 4)).export(tmp_path / name)
    assert main(["press", str(tmp_path / "one"), *HOW, "--out", str(tmp_path / "r")]) == 0
    assert {path.name for path in (tmp_path / "r").iterdir()} == {"part.stl", "part.obj", "summary.csv"}
    assert main(["press", str(tmp_path / "one"), str(tmp_path / "two"), *HOW, "--out", str(tmp_path / "s")]) == 1
    assert "two objects have the file name part.stl" in capsys.readouterr().err and not (tmp_path / "s").exists()


@pytest.mark.parametrize(("more", "said"), [
    ([], "--out is missing"), (["--out", "a.nc"], "--out a.nc: each of several objects gets a folder"),
    (["--out", "a", "--vtu", "b/c.vtu"], "--vtu b/c.vtu: each of several"),
])
def test_where_several_results_go_must_be_a_folder(more, said, parts, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["press", str(parts), *HOW, *more]) == 1
    assert said in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_folder_without_meshes_is_refused(tmp_path, capsys):
    assert main(["press", str(tmp_path), *HOW, "--out", str(tmp_path / "r")]) == 1
    assert "the folder holds no file of STL, OBJ, PLY" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--pose", "-1,0,0,0,0,0"], ["--motion", "-.5z"], ["--force", "-5e0"], ["--pos", "-1,0"]])
def test_a_value_that_begins_with_a_minus_and_reads_as_an_option_gets_a_hint(words, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["press", "part.stl", "--unit", "mm", *words])
    assert stopped.value.code == 2
    assert f"{words[1]}: a value that begins with a minus reads as an option; write --" in capsys.readouterr().err


def test_the_tables_headings_stand_apart_over_short_names_too():
    row = {"object": "a", "status": "failed", "model": None}
    assert next(_lines([row], "results")).split()[:2] == ["object", "status"]


@pytest.mark.parametrize(("valid", "word"), [(1.0, "yes"), (0.0, "no")])
def test_the_table_says_yes_or_no_to_validity_as_a_single_press_does(valid, word):
    row = {"object": "a", "status": "done", "model": "elastic", **{column.name: 1.0 for column in ON_LAYERS}, "valid": valid}
    heading, line, _ = _lines([row], "results")
    assert line.split()[-1] == word and len(line) == len(heading)
