import pytest
from project import Project


@pytest.fixture(scope="session")
def finished_once(tmp_path_factory):
    """The tiny study, finished with stubs in place of the stages."""
    project = Project.of_sources(tmp_path_factory.mktemp("finished"))
    project.snakemake()
    return project


@pytest.fixture
def finished(finished_once, tmp_path):
    """A finished tiny study that a test may change."""
    return finished_once.copy(tmp_path / "project")
