"""The studies that list their jobs, of every kind: what reruns after a change, the same bytes twice, a killed run that goes on."""

import importlib.util
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest
from project import Project

from softtact.studies.code_closure import code_closure
from softtact.studies.jobs import paths_of, stage_source
from softtact.studies.registry import KINDS, open_study

pytestmark = pytest.mark.slow     # each test plans a whole study with Snakemake, which takes seconds


@dataclass(frozen=True)
class Case:
    """A tiny study, and changes of its parts."""

    kind: str
    config: str
    value: tuple[str, str]
    """What a text of the configuration is changed to."""
    source: str
    """A file below src/softtact that some stages import, and not all."""
    slow: str
    """A stage that the stub lets wait."""
    object: str = ""
    """A mesh."""


CASES = [
    Case("grasps", "config/tiny_grasps.yaml", ("trials: 3", "trials: 4"), "robot/scene.py", "grasp",
         "config/objects/grasped/object_3.stl"),
    Case("skin", "config/tiny_skin.yaml", ("draws: 200", "draws: 201"), "skin/maps.py", "read_taxels"),
    Case("decide", "config/tiny_decide.yaml", ("epochs: 3", "epochs: 4"), "readout/virtual_sensor.py", "press"),
    Case("markers", "config/tiny_markers.yaml", ("epochs: 4", "epochs: 5"), "learning/image_training.py", "press_object"),
    Case("real", "config/tiny_real.yaml", ("rounds: 1", "rounds: 2"), "imaging/shading.py", "press_ball"),
    Case("palpation", "config/tiny_probe.yaml", ("variant_steps: 3", "variant_steps: 4"), "probe/structure.py", "sweep"),
]
# The stages that these changes rerun, by hand; those of the other kinds follow from their list of jobs.
GRASPED = {"grasp", "read_grasp", "tabulate_grasps", "draw_grasped_objects", "report"}


def listed(project):
    """The jobs that the project's configuration lists."""
    opened = open_study(project.folder / project.configfile)
    return opened.jobs(f"results/{opened.name}")


def after(jobs, changed):
    """The stages of the jobs for which `changed(job)` holds, and of all that depend on them."""
    stages, files = set(), set()
    for job in jobs:
        if changed(job) or files & set(paths_of(job.inputs)):
            stages.add(job.stage)
            files |= set(paths_of(job.made()))
    return stages


# One kind runs with the fast tests: the others go through the same list of jobs and the same rules.
@pytest.fixture(scope="module", params=[pytest.param(case, id=case.kind, marks=() if case.kind == "grasps" else pytest.mark.slow)
                                        for case in CASES])
def case(request):
    module = KINDS[request.param.kind].jobs.partition(":")[0]
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{module} is not there")
    return request.param


@pytest.fixture(scope="module")
def finished_study(case, tmp_path_factory):
    """The case's tiny study, finished with stubs in place of the stages."""
    project = Project.of_sources(tmp_path_factory.mktemp(case.kind))
    project.configfile = case.config
    project.snakemake()
    return project


@pytest.fixture
def study(case, finished_study, tmp_path):
    """The same, which a test may change."""
    project = finished_study.copy(tmp_path / "project")
    project.configfile = case.config
    return project


def files_of(project):
    """{path: bytes} of all results; logs and benchmarks tell of the run, not of the study."""
    folder = next(path for path in (project.folder / "results").iterdir() if path.is_dir())
    paths = [path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(".")]
    return {str(path): (folder / path).read_bytes() for path in paths if path.parts[0] not in ("logs", "benchmarks")}


def test_every_rule_is_a_stage_and_the_page_the_tables_and_the_claims_are_there(case, study):
    for rule in {path.name for path in (next((study.folder / "results").iterdir()) / "logs").iterdir()}:
        assert stage_source(f"{case.kind}.{rule}").startswith(f"softtact.studies.{case.kind}.stages")


def test_a_second_run_does_nothing(study):
    assert study.plan() == {}


def test_a_changed_value_reruns_what_takes_it_and_what_depends_on_that(case, study, monkeypatch):
    monkeypatch.chdir(study.folder)
    before = {job.label: job.settings for job in listed(study)}
    study.edit(case.config, *case.value)
    rerun = after(listed(study), lambda job: job.settings != before[job.label])
    assert set(study.plan()) == rerun and 0 < len(rerun) < len({job.stage for job in listed(study)})
    assert case.kind != "grasps" or rerun == GRASPED - {"grasp"}


def test_a_comment_in_the_configuration_reruns_nothing(case, study):
    with (study.folder / case.config).open("a") as config:
        config.write("# a comment\n")
    assert study.plan() == {}


def test_an_edited_line_of_the_source_reruns_the_stages_that_import_it(case, study, monkeypatch):
    monkeypatch.chdir(study.folder)
    edited = Path("src/softtact", case.source)
    with edited.open("a") as source:
        source.write("\n# edited\n")

    def imports(job):
        return str(edited) in code_closure(stage_source(f"{case.kind}.{job.stage}", source=Path("src")))

    rerun = after(listed(study), imports)
    assert set(study.plan()) == rerun and rerun
    assert case.kind != "grasps" or rerun == GRASPED | {"one_event", "draw_one_event"}


def test_a_changed_object_reruns_what_reads_it(case, study, monkeypatch):
    if not case.object:
        pytest.skip("this study presses no mesh")
    monkeypatch.chdir(study.folder)
    with Path(case.object).open("ab") as mesh:
        mesh.write(b" ")
    plan = study.plan()
    assert set(plan) == after(listed(study), lambda job: case.object in paths_of(job.inputs)) == GRASPED
    assert {job["item"] for job in plan["grasp"]} == {"object_3-0", "object_3-1"}     # its two positions, and no other object


def test_a_missing_file_is_made_again(study):
    missing = next(path for path in study.folder.glob("results/*/tables/*.csv"))
    content = missing.read_bytes()
    missing.unlink()
    study.snakemake()
    assert missing.read_bytes() == content


@pytest.mark.slow
def test_one_and_two_cores_give_the_same_files(case, finished_study, tmp_path):
    alone = Project.of_sources(tmp_path)
    alone.configfile = case.config
    alone.snakemake("--cores", "1")
    assert files_of(alone) == files_of(finished_study)


@pytest.mark.slow
def test_a_killed_run_goes_on_and_ends_with_the_same_files(case, finished_study, tmp_path):
    project = Project.of_sources(tmp_path)
    project.configfile = case.config
    run = project.start(environment={"SOFTTACT_STUB_WAIT_S": "0.5", "SOFTTACT_STUB_SLOW": f"{case.kind}.{case.slow}"})
    project.wait_for(1, "results/*/*/**/*.*")
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    project.snakemake()
    assert files_of(project) == files_of(finished_study)


def test_every_kind_has_a_case():
    assert {case.kind for case in CASES} | {"hybrid"} == set(KINDS)
