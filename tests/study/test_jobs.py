"""A study's jobs in one process: what is made again, and what is kept."""

import pytest
import yaml

from softtact.errors import InputError
from softtact.outputs import held
from softtact.studies import jobs as module
from softtact.studies.code_closure import code_closure, code_digest
from softtact.studies.jobs import Job, run_jobs, stage_source, stages_of
from softtact.studies.registry import KINDS, open_study


class Study:
    """Two jobs in a row whose stages only count; an edit of the source is a word here."""

    def __init__(self, folder, monkeypatch):
        self.folder, self.ran, self.code, self.value = folder, [], {"one": "a", "two": "a"}, 1
        (folder / "mesh").write_text("mesh")
        monkeypatch.setattr(module, "stage_source", lambda stage: stage)
        monkeypatch.setattr(module, "code_digest", lambda stage, source: self.code[stage.removeprefix("k.")])
        monkeypatch.setattr(module, "find_stage", lambda stage: lambda **job: self._make(stage.removeprefix("k."), **job))
        self.failing = None

    def _make(self, stage, *, inputs, outputs, settings, threads):
        if stage == self.failing:
            raise InputError("broken")
        self.ran.append(stage)
        paths = list(inputs.values())
        outputs["made"].write_text(f"{stage} {settings} {[path.read_text() for path in paths]}")

    def run(self):
        self.ran.clear()
        first, second = str(self.folder / "first.txt"), str(self.folder / "second.txt")
        run_jobs("k", [Job("one", {"mesh": str(self.folder / "mesh")}, {"made": first}, {"value": self.value}),
                       Job("two", {"first": first}, {"made": second})], self.folder)
        return list(self.ran)


@pytest.fixture
def study(tmp_path, monkeypatch):
    made = Study(tmp_path, monkeypatch)
    assert made.run() == ["one", "two"]
    return made


def test_a_second_run_does_nothing(study):
    assert study.run() == []


def test_a_changed_value_a_changed_object_and_an_edit_of_the_source_run_what_depends_on_them(study):
    study.value = 2
    assert study.run() == ["one", "two"]
    (study.folder / "mesh").write_text("another mesh")
    assert study.run() == ["one", "two"]
    study.code["two"] = "b"
    assert study.run() == ["two"]


def test_what_comes_out_the_same_reruns_nothing_after_it(study):
    study.code["one"] = "b"
    assert study.run() == ["one"]


def test_a_missing_or_a_half_kept_file_is_made_again(study):
    (study.folder / "second.txt").unlink()
    assert study.run() == ["two"]
    (study.folder / module.RECORD).write_text("{")
    assert study.run() == ["one", "two"]


def test_a_run_that_failed_goes_on_where_it_stopped(study):
    study.value, study.failing = 2, "two"
    with pytest.raises(InputError, match="broken"):
        study.run()
    study.failing = None
    assert study.run() == ["two"]


def test_a_second_run_beside_one_at_work_is_refused(tmp_path):
    with held(tmp_path), pytest.raises(InputError, match="another run of this study is in progress"), held(tmp_path):
        pass


def test_a_figures_function_ties_a_stage_to_its_own_imports_alone(tmp_path):
    (tmp_path / "p/stages").mkdir(parents=True)
    for name in ("one", "two", "help", "never"):
        (tmp_path / f"p/{name}.py").write_text("")
    (tmp_path / "p/stages/draw.py").write_text(
        "import p.help\ndef draw_one():\n    from p import one\n    _shared()\ndef draw_two():\n    from p.two import x\n"
        "def _shared():\n    import p.never\n")

    def closure(name):
        return [path.removeprefix(f"{tmp_path}/p/") for path in code_closure(f"p.stages.draw:{name}", source=tmp_path)]

    assert closure("draw_one") == ["help.py", "never.py", "one.py", "stages/draw.py"]
    assert closure("draw_two") == ["help.py", "stages/draw.py", "two.py"]


def test_the_hash_of_a_stages_code_changes_with_what_it_imports_and_with_nothing_else(tmp_path):
    def digest(name, *, imported="", other=""):
        folder = tmp_path / name / "p"
        folder.mkdir(parents=True)
        for file, text in (("a", "import p.b\n"), ("b", imported), ("c", other)):
            (folder / f"{file}.py").write_text(text)
        return code_digest("p.a", source=tmp_path / name)

    assert digest("one") == digest("two", other="# edited") != digest("three", imported="# edited")


@pytest.mark.parametrize("kind", KINDS)
def test_every_stage_of_a_kind_is_found(kind):
    assert all(stage_source(stage).startswith(f"softtact.studies.{kind}.stages") for stage in stages_of(kind))
    with pytest.raises(InputError, match="there is no stage"):
        stage_source(f"{kind}.no_such_stage")


def test_an_unknown_kind_is_answered_with_the_nearest_one(tmp_path):
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"study": "a", "kind": "grasp"}))
    with pytest.raises(InputError, match="'grasp'.*'grasps'"):
        open_study(tmp_path / "a.yaml")


def test_a_stage_is_told_of_an_empty_list_too(monkeypatch):
    from softtact.studies import __main__ as runner

    told = {}
    monkeypatch.setattr(module, "find_stage", lambda stage: lambda **job: told.update(job["inputs"]))
    assert runner.main(["real.judge_markers", "--in", "gel=gel.json", "--in", "others[]=", "--in", "more[]=a.csv"]) == 0
    assert told["others"] == [] and [path.name for path in told["more"]] == ["a.csv"]
    assert runner.main(["real.judge_markers", "--in", "gel="]) == 1     # a single path is never empty
