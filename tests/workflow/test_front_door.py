"""What the front door takes and what it refuses before any work."""

import pytest
from project import Project


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """The project without results."""
    return Project.of_sources(tmp_path_factory.mktemp("fresh"))


def refusal(project, *arguments):
    """What Snakemake says of a configuration that it refuses."""
    done = project.snakemake("--dry-run", *arguments, check=False)
    assert done.returncode != 0
    assert "Traceback" not in done.stdout
    assert not (project.folder / "results").exists()
    return done.stdout


@pytest.mark.slow
def test_the_papers_study_is_planned_whole(fresh):
    paper = Project(fresh.folder, configfile="config/paper.yaml")
    plan = paper.plan()
    items = len(plan["read_virtual_sensor"])
    assert len(plan["simulate_press"]) == 2 * items > 200     # hyperelastic and reference: each press a job
    together = [rule for rule in plan if rule.startswith("simulate_presses_")]
    assert len(together) == 2 * 71     # the fast models: a job for each object
    assert {job["model"] for job in plan["train_cnn"]} == {"elastic", "hyperelastic"}


@pytest.mark.slow
def test_a_tested_foundation_model_asks_for_its_frustum_law_first(fresh):
    plan = Project(fresh.folder).plan("--config", "tested=[foundation,hyperelastic]")
    assert plan["frustum_law"] == [{"model": "foundation"}]
    for rule in ("precompute_compliance", "simulate_press", "train_cnn"):
        assert "foundation" in {job["model"] for job in plan[rule]}


@pytest.mark.slow
def test_a_study_without_a_learning_curve_and_repeated_seeds_plans_neither(fresh):
    plan = Project(fresh.folder).plan("--config", "learning={seeds: 1}", "learning_curve={shares: []}")
    assert not {"learning_curve", "find_limits", "draw_fig10_learning_curve", "repeat_learning", "gather_seeds"} & set(plan)
    assert {"compare_networks", "report"} <= set(plan)


def test_a_misspelt_key_is_answered_with_the_nearest_right_one(fresh):
    said = refusal(fresh, "--config", "forces_nn=[5]")
    assert "softtact: the configuration: there is no key 'forces_nn'; did you mean 'forces_n'?" in said


@pytest.mark.slow
def test_an_unknown_material_is_refused(fresh):
    said = refusal(fresh, "--config", "materials=[polyurethane,neoprene,neopren]")
    assert "there is no material 'neopren' (did you mean 'neoprene'?); known are gel_silicone, neoprene, polyurethane, " in said


@pytest.mark.slow
def test_a_mesh_that_is_not_there_is_refused(fresh, tmp_path):
    project = Project.of_sources(tmp_path)
    (project.folder / "config/objects/indenters/square.stl").unlink()
    assert "config/objects/indenters/square.stl: there is no such mesh" in refusal(project)
