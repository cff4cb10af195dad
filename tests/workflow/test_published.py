"""The study on the published archive: what is planned, and what its front door refuses."""

import json

import pytest
from project import Project
from small_archive import Archive

pytestmark = pytest.mark.slow     # each test plans a whole study with Snakemake, which takes seconds


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """The published study with a generated archive where the configuration expects it."""
    made = Project.of_sources(tmp_path_factory.mktemp("published"))
    made.configfile = "config/published.yaml"
    Archive(flat=("CircleG", "DonutM", "EchoX", "DiagonalInver"), tests=1, frames=2).write(made.folder / "dataset")
    return made


def test_no_press_and_no_virtual_sensor_is_planned(project):
    plan = project.plan()
    assert {"import_published", "build_dataset", "search_hyperparameters", "train_cnn", "evaluate", "make_tables",
            "report"} <= set(plan)
    assert not {"simulate_press", "read_virtual_sensor", "mesh_sensor", "precompute_compliance", "compare_policies",
                "draw_fig7_maps", "draw_fig8_policies"} & set(plan)
    assert {job["model"] for job in plan["train_cnn"]} == {"elastic", "hyperelastic"}


def test_another_folder_is_one_option_and_models_without_simulations_are_not_trained(project, tmp_path):
    Archive(models=("hyperelastic",), tests=1, frames=2).write(tmp_path)
    plan = project.plan("--config", f"data={json.dumps({'folder': str(tmp_path)})}")
    assert plan["train_cnn"] == [{"model": "hyperelastic"}]


def test_a_missing_archive_is_refused_with_where_to_get_it(project):
    done = project.snakemake("--dry-run", "--config", "data={folder: elsewhere}", check=False)
    assert done.returncode != 0 and "Traceback" not in done.stdout
    assert "softtact: elsewhere: there is no such folder; put the archive's CSV files there" in done.stdout


@pytest.mark.slow
def test_a_changed_file_of_the_archive_reruns_the_import_and_all_after(project, tmp_path):
    finished = project.copy(tmp_path / "project")
    finished.configfile = project.configfile
    finished.snakemake()
    assert finished.plan() == {}
    with (finished.folder / "dataset/Flat_Real_Abaqus.csv").open("a") as lines:
        lines.write("\n")
    plan = finished.plan()
    assert {"import_published", "build_dataset", "train_cnn", "evaluate", "report"} <= set(plan)
    assert not {"fit_material", "press_on_glass", "score_complexity"} & set(plan)
