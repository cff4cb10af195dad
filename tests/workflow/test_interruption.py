"""A run that is killed in the middle of the presses, and started again."""

import os
import signal
import time

import pytest
from project import Project

SLOW_PRESSES = {"SOFTTACT_STUB_WAIT_S": "0.4"}


def results(project):
    """{path: bytes} of all results; logs and benchmarks tell of the run, not of the study."""
    folder = project.folder / "results/tiny"
    skipped = ("logs", "benchmarks", ".running")
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    named = {str(path.relative_to(folder)): path.read_bytes() for path in paths}
    return {name: content for name, content in named.items() if not name.startswith(skipped)}


def wait_for_presses(project, count, *, within_s=60):
    end = time.monotonic() + within_s
    while len(project.presses()) < count:
        assert time.monotonic() < end, f"fewer than {count} presses after {within_s} s"
        time.sleep(0.05)


@pytest.fixture
def killed(tmp_path):
    """A study whose Snakemake and stages all got SIGKILL among the presses."""
    project = Project.of_sources(tmp_path)
    run = project.start(environment=SLOW_PRESSES)
    wait_for_presses(project, 3)
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    return project


def test_a_killed_run_resumes_and_gives_the_files_of_an_undisturbed_one(killed, finished_once):
    assert 3 <= len(killed.presses()) < len(finished_once.presses())
    resumed = killed.snakemake()
    assert "Missing output files" in resumed.stdout
    assert results(killed) == results(finished_once)


def test_a_second_run_beside_a_running_one_is_refused(tmp_path):
    project = Project.of_sources(tmp_path)
    run = project.start(environment=SLOW_PRESSES)
    try:
        wait_for_presses(project, 1)
        os.killpg(run.pid, signal.SIGSTOP)         # at work, however long the second run takes to start
        refused = project.snakemake(check=False)
        assert refused.returncode != 0
        assert "another run of this study is at work" in refused.stdout
    finally:
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
