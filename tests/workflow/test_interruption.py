"""A run that is killed in the middle of the presses, and started again."""

import os
import signal

import pytest
from project import PRESSES, Project

from softtact.studies.jobs import stages_of

SLOW_PRESSES = {"SOFTTACT_STUB_WAIT_S": "0.4"}


def results(project):
    """{path: bytes} of all results; logs and benchmarks tell of the run, not of the study."""
    folder = project.folder / "results/tiny"
    skipped = ("logs", "benchmarks", ".running")
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    named = {str(path.relative_to(folder)): path.read_bytes() for path in paths if not path.name.startswith(".")}
    return {name: content for name, content in named.items() if not name.startswith(skipped)}


@pytest.fixture
def killed(tmp_path):
    """A study whose Snakemake and stages all got SIGKILL among the presses."""
    project = Project.of_sources(tmp_path)
    run = project.start(environment=SLOW_PRESSES)
    project.wait_for(3, PRESSES)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    return project


@pytest.mark.slow
def test_a_killed_run_resumes_and_gives_the_files_of_an_undisturbed_one(killed, finished_once):
    assert 3 <= len(killed.presses()) < len(finished_once.presses())
    resumed = killed.snakemake()
    assert "Missing output files" in resumed.stdout
    assert results(killed) == results(finished_once)


@pytest.mark.slow
def test_sigkill_in_every_stage_is_survived_and_ends_with_the_same_files(finished, tmp_path):
    """The first job of each stage dies after its first output; a job that is tried again is what the next run would run.

    One object gets a second place, for a job that presses several.
    """
    project, killed = Project.of_sources(tmp_path / "shot"), tmp_path / "killed"
    killed.mkdir()
    for each in (project, finished):
        each.edit("config/tiny.yaml", "donut_m], presses: null", "donut_m], presses: 4")
    finished.snakemake()
    project.snakemake("--retries", "1", environment={"SOFTTACT_STUB_KILLED": str(killed)})
    elsewhere = {"hybrid.import_published", "hybrid.read_recordings"}      # of studies with readings of a real sensor
    stages = set(stages_of("hybrid", source=project.folder / "src")) - elsewhere
    assert {path.name for path in killed.iterdir()} == stages
    assert results(project) == results(finished)


@pytest.mark.slow
def test_a_damaged_file_is_reported_and_once_deleted_made_again_with_all_that_depends_on_it(finished, finished_once):
    damaged = finished.folder / "results/tiny/presses/grasps/object_5/elastic.nc"
    damaged.write_text("half of a f")
    refused = finished.snakemake(check=False)
    assert refused.returncode != 0
    assert "presses/grasps/object_5/elastic.nc: damaged" in refused.stdout
    damaged.unlink()
    finished.snakemake()
    assert results(finished) == results(finished_once)


def test_results_that_cannot_be_written_are_reported_in_one_sentence(tmp_path):
    project = Project.of_sources(tmp_path)
    (project.folder / "results").write_text("a file, where a folder is wanted")
    done = project.snakemake(check=False)
    assert done.returncode != 0 and "Traceback" not in done.stdout
    assert "results/tiny: cannot be written to" in done.stdout


@pytest.mark.slow
def test_a_second_run_beside_a_running_one_is_refused(tmp_path):
    project = Project.of_sources(tmp_path)
    run = project.start(environment=SLOW_PRESSES)
    try:
        project.wait_for(1, PRESSES)
        os.killpg(run.pid, signal.SIGSTOP)         # at work, however long the second run takes to start
        refused = project.snakemake(check=False)
        assert refused.returncode != 0
        assert "another run of this study is in progress" in refused.stdout
    finally:
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
