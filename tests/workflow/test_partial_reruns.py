"""What reruns after a change, read from Snakemake's own plan."""

import pytest

from softtact.studies.code_closure import code_closure
from softtact.studies.jobs import stage_source, stages_of

pytestmark = pytest.mark.slow     # each test plans a whole study with Snakemake, which takes seconds

FIGURES = [stage.partition(".")[2] for stage in stages_of("hybrid") if stage.startswith("hybrid.draw_")]
SIMULATION = {"make_curves", "fit_material", "mesh_sensor", "precompute_compliance", "simulate_press"}
LEARNING = {"search_hyperparameters", "train_cnn", "evaluate"}


def test_a_second_run_has_nothing_to_do(finished):
    assert finished.plan() == {}


def test_a_new_indenter_is_the_only_one_simulated(finished):
    mesh = finished.folder / "config/objects/indenters/new_form.stl"
    mesh.write_bytes((finished.folder / "config/objects/indenters/circle_s.stl").read_bytes())
    with (finished.folder / "config/objects/catalogue.yaml").open("a") as catalogue:
        catalogue.write("- {name: new_form, file: indenters/new_form.stl, unit: mm, set: indenters, label: New Form}\n")
    finished.edit("config/tiny.yaml", "names: [circle_m,", "names: [new_form, circle_m,")
    plan = finished.plan()
    assert {job["item"] for job in plan["simulate_press"]} == {"new_form"}
    assert {job["model"] for job in plan["simulate_press"]} == {"elastic", "foundation", "hyperelastic", "reference"}
    assert plan["read_virtual_sensor"] == [{"item": "new_form", "set": "indenters"}]
    assert not {"fit_material", "mesh_sensor", "precompute_compliance", "press_on_glass"} & set(plan)
    assert LEARNING <= set(plan)


@pytest.mark.slow
def test_more_places_of_an_object_press_it_again_with_the_fast_models_and_no_other(finished):
    """Three indenters in five presses: the first two get a second place. A fast model presses both places in one job."""
    finished.edit("config/tiny.yaml", "donut_m], presses: null", "donut_m], presses: 5")
    plan = finished.plan()
    assert {job["item"] for job in plan["simulate_press"]} == {"circle_m-1", "square-1"}
    assert {job["model"] for job in plan["simulate_press"]} == {"hyperelastic", "reference"}
    together = {rule for rule in plan if rule.startswith("simulate_presses")}
    assert together == {f"simulate_presses_{model}_indenters_{item}" for model in ("elastic", "foundation")
                        for item in ("circle_m", "square")}
    finished.snakemake("--until", "simulate_presses_elastic_indenters_square")
    left = {rule for rule in finished.plan() if rule.startswith("simulate_presses")}
    assert together - left == {"simulate_presses_elastic_indenters_square"}


def test_a_comment_in_the_sensors_file_reruns_nothing(finished):
    finished.edit("src/softtact/sensors/data/sensors/coro.yaml", "name: coro", "name: coro   # the paper's")
    assert finished.plan() == {}


def test_the_covers_thickness_reruns_from_the_meshes_on_but_no_fit(finished):
    finished.edit("src/softtact/sensors/data/sensors/coro.yaml", "value: 1.5", "value: 1.2")
    plan = finished.plan()
    assert {"mesh_sensor", "precompute_compliance", "simulate_press"} | LEARNING <= set(plan)
    assert len(plan["simulate_press"]) == len(finished.presses())
    assert not {"make_curves", "fit_material"} & set(plan)


def test_more_epochs_rerun_the_training_and_no_simulation(finished):
    finished.edit("config/tiny.yaml", "epochs: 2, patience", "epochs: 3, patience")
    plan = finished.plan()
    assert {"train_cnn", "evaluate", "report"} <= set(plan)
    assert not (SIMULATION | {"build_dataset", "search_hyperparameters"}) & set(plan)


def test_an_edit_of_a_materials_law_reruns_the_fits_and_after(finished):
    edit_source(finished, "src/softtact/materials/laws/yeoh.py")
    plan = finished.plan()
    assert {"fit_material", "press_on_glass", "simulate_press", "report"} <= set(plan)
    assert "score_complexity" not in plan


def test_an_edit_of_how_laws_are_fitted_plans_the_fits_again(finished):
    """Snakemake plans what depends on them, too; where the cards come out the same their bytes stop it."""
    edit_source(finished, "src/softtact/materials/card_making.py")
    plan = finished.plan()
    assert "fit_material" in plan and "mesh_sensor" not in plan


def test_an_edit_of_the_networks_code_reruns_learning_and_no_simulation(finished):
    stage = "train_cnn"
    for path in own_files(finished, stage, but_not=["build_dataset", "simulate_press"]):
        edit_source(finished, path)
    plan = finished.plan()
    assert {stage, "evaluate", "report"} <= set(plan)
    assert not (SIMULATION | {"read_virtual_sensor", "build_dataset", "detect_discs"}) & set(plan)


def test_an_edit_of_one_figures_code_redraws_that_figure_only(finished):
    edit_figure(finished, "draw_fig5_ftir")
    assert set(finished.plan()) == {"draw_fig5_ftir", "report"}


def test_an_edit_of_all_figures_code_redraws_each_figure_and_nothing_else(finished):
    for stage in FIGURES:
        edit_figure(finished, stage)
    assert set(finished.plan()) == {*FIGURES, "report"}


def edit_figure(project, stage):
    """Change the source files that a figure alone imports."""
    others = [figure for figure in FIGURES if figure != stage]
    shared = ["report", "make_tables", "fit_material", "simulate_press", "compare_policies"]
    own = own_files(project, stage, but_not=[*others, *shared])
    assert own, stage
    for path in own:
        edit_source(project, path)


def edit_source(project, path):
    """Change a source file's bytes; a new time alone is no edit."""
    with (project.folder / path).open("a") as source:
        source.write("\n# edited\n")


def own_files(project, stage, *, but_not):
    """Source files that a stage imports and the named other stages do not."""
    folder = project.folder / "src"
    stages = [stage_source(f"hybrid.{name}", source=folder) for name in [stage, *but_not]]
    closures = [set(code_closure(name, source=folder)) for name in stages]
    return sorted(closures[0].difference(*closures[1:]))
