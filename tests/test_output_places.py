"""Places of files are checked before the work: what no file can be written to, or read from, is refused in one sentence."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from softtact import inputs, outputs
from softtact.cli import main
from softtact.errors import InputError, OutputError, SofttactError
from softtact.files import atomic_path, read_json, write_json
from softtact.outputs import check_output_folder, check_outputs, temporary_folder

ROOT = Path(__file__).parents[1]
SQUARE = str(ROOT / "config/objects/indenters/square.stl")
NULL_DEVICE = Path("/dev/null")
posix = pytest.mark.skipif(os.name != "posix", reason="needs links and devices")


def in_a_circle(folder):
    (folder / "one").symlink_to("other")
    (folder / "other").symlink_to("one")
    return folder / "one"


def below_a_file(folder):
    (folder / "file").write_text("")
    return folder / "file" / "a.json"


PLACES = [(lambda folder: folder, "it is a folder; give the name of a file"),
          (lambda folder: folder / (260 * "a"), "its name is too long; give a shorter one"),
          (lambda folder: folder / "missing" / (260 * "a"), "its name is too long; give a shorter one"),
          (lambda folder: folder / "\ud800.json", "its name has characters that this system's names cannot hold"),
          (lambda folder: folder / "a\0.json", "its name holds a zero byte"), (below_a_file, "a part of its path is a file"),
          (lambda folder: NULL_DEVICE, "it is a device or a pipe; give the name of a file"),
          (in_a_circle, "its links lead in a circle; correct them")]


@posix
@pytest.mark.parametrize("use", [check_outputs, lambda path: write_json(path, {})], ids=["checked", "written"])
@pytest.mark.parametrize(("place", "sentence"), PLACES)
def test_a_name_that_no_file_can_have_is_refused(place, sentence, use, tmp_path):
    with pytest.raises(SofttactError, match=sentence):
        use(place(tmp_path))


def test_a_missing_folder_is_refused_before_the_work(tmp_path):
    with pytest.raises(InputError, match="there is no folder .*missing; create it first"):
        check_outputs(tmp_path / "missing" / "a.json")


@pytest.mark.parametrize("check", [check_outputs, check_output_folder])
def test_a_folder_in_which_no_file_can_be_made_is_refused_before_the_work(check, tmp_path, monkeypatch):
    def refused(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(outputs.tempfile, "mkstemp", refused)
    with pytest.raises(OutputError, match=r"a.nc: cannot be written \(Read-only file system\)") as refusal:
        check(tmp_path / "a.nc")
    assert refusal.value.status == 4


def test_a_check_leaves_nothing(tmp_path):
    check_outputs(tmp_path / "a.nc", None)
    check_output_folder(tmp_path / "results/of/a/study")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_of_results_below_a_file_is_refused(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(InputError, match="results/study: .*results is a file; give another name for the folder"):
        check_output_folder(tmp_path / "results/study")


@posix
def test_an_output_through_a_link_writes_what_it_leads_to(tmp_path):
    (tmp_path / "kept").mkdir()
    for link, target in (("a.json", "kept/a.json"), ("b.json", "kept/new.json"), ("c.json", "a.json")):
        (tmp_path / link).symlink_to(target)
        write_json(tmp_path / link, {"link": link})
        assert (tmp_path / link).is_symlink() and read_json(tmp_path / link) == {"link": link}
    assert {path.name for path in (tmp_path / "kept").iterdir()} == {"a.json", "new.json"}


@posix
@pytest.mark.parametrize(("place", "sentence"), [
    (in_a_circle, "its links lead in a circle"), (lambda folder: folder, "it is a folder; give a file"),
    (lambda folder: folder / (300 * "a"), "its name is too long"), (lambda folder: folder / "a\0", "its name holds a zero byte"),
    (below_a_file, "there is no such file"), (lambda folder: Path("/dev/zero"), "it is a device or a pipe")])
def test_an_input_that_is_no_file_is_refused_by_what_it_is(place, sentence, tmp_path):
    with pytest.raises(InputError, match=sentence):
        read_json(place(tmp_path))


def test_an_input_without_permission_is_refused_with_the_status_of_files(tmp_path, monkeypatch):
    (tmp_path / "card.json").write_text("{}")
    monkeypatch.setattr(inputs.os, "access", lambda *_: False)     # as for another user: root may read all
    with pytest.raises(InputError, match=r"card.json: cannot be read \(Permission denied\)") as refusal:
        read_json(tmp_path / "card.json")
    assert refusal.value.status == 4


COMMANDS = [f"press {SQUARE} --unit mm --force 5 --out {{}}.nc", f"press {SQUARE} --unit mm --force 5 --plot {{}}.png",
            f"press {SQUARE} --unit mm --force 5 --vtu {{}}.vtu", f"mesh {SQUARE} --unit mm --size 2 --out {{}}.vtu",
            f"export-deck {SQUARE} --unit mm --force 5 --format abaqus --out {{}}.inp", "fit uniaxial=curve.csv --out {}.json",
            f"dataset {SQUARE} --unit mm --presses 1 --out {{}}.h5", "detect-discs frames --pixel-mm 1 --out {}.csv",
            "predict maps.nc --network model.pt --out {}.nc", "view press.nc --save {}.png", "config-schema sensor --out {}.json",
            f"calibrate recording.csv --press {SQUARE} --unit mm --force 5 --out {{}}.yaml",
            "calibrate-camera a.png --background b.png --ball-mm 4 --out {}.yaml"]
FOLDERS = [f"grasp {SQUARE} --unit mm --force 20 --out {{}}", f"grasps {ROOT}/config/tiny_grasps.yaml --out {{}}",
           f"palpate {ROOT}/config/tiny_probe.yaml --out {{}}", f"skin {ROOT}/config/tiny_skin.yaml --out {{}}",
           f"press {SQUARE} {SQUARE.replace('square', 'triangle')} --unit mm --force 5 --out {{}}",
           "stage make_curves --out curves={} --settings {{}}"]


@posix
@pytest.mark.parametrize("line", [*COMMANDS, *FOLDERS], ids=lambda line: line.split()[0])
def test_each_command_checks_its_outputs_before_it_reads(line, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("a file, where a folder is wanted")
    status = main(line.format("file/out").split())
    said = capsys.readouterr()
    assert status in (1, 4) and said.out == ""
    assert "file/out" in said.err and any(words in said.err for words in ("is a file", "there is no folder")), said.err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


LEFT = """
import os, signal, sys
from softtact.files import atomic_path
from softtact.outputs import temporary_folder
with temporary_folder(sys.argv[1]), atomic_path(sys.argv[1] + "/a.nc") as path:
    path.write_text("half of it")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@posix
def test_what_a_killed_run_left_is_deleted_by_the_next(tmp_path):
    with atomic_path(tmp_path / "b.json") as mine, temporary_folder(tmp_path) as folder:     # of a process that runs
        killed = subprocess.run([sys.executable, "-c", LEFT, str(tmp_path)])
        assert killed.returncode == -9 and len(list(tmp_path.iterdir())) == 4
        write_json(tmp_path / "c.json", {})
        assert {path.name for path in tmp_path.iterdir()} == {mine.name, folder.name, "c.json"}
        mine.write_text("{}")
    assert {path.name for path in tmp_path.iterdir()} == {"b.json", "c.json"}


def test_files_of_others_with_similar_names_stay(tmp_path):
    names = [".softtact-notes", ".softtact-00000000-999999999-x.nc", "softtact-press.nc"]     # the second of another machine
    for name in names:
        (tmp_path / name).write_text("")
    write_json(tmp_path / "a.json", {})
    assert {path.name for path in tmp_path.iterdir()} == {*names, "a.json"}


def test_a_name_of_the_longest_kind_can_be_written(tmp_path):
    path = tmp_path / (250 * "a" + ".npz")
    with atomic_path(path) as temporary:
        np.savez(temporary, x=np.zeros(3))
    assert path.exists()


def test_where_kernels_can_be_kept_nowhere_they_go_to_a_temporary_folder_with_a_word(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(outputs.os, "access", lambda *_: False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with outputs.place_for_kernels():
        assert "NUMBA_CACHE_DIR" not in os.environ
    (tmp_path / "file").write_text("where the cache's folder should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with outputs.place_for_kernels():
        folder = Path(os.environ["NUMBA_CACHE_DIR"])
        assert folder.is_dir()
    assert "NUMBA_CACHE_DIR" not in os.environ and not folder.exists()
    assert capsys.readouterr().err.count("WARNING: Compiled kernels can be kept neither") == 1
