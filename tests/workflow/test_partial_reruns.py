"""What reruns after a change, read from Snakemake's own plan."""

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
    assert {job["model"] for job in plan["simulate_press"]} == {"elastic", "hyperelastic", "reference"}
    assert plan["read_virtual_sensor"] == [{"item": "new_form", "set": "indenters"}]
    assert not {"fit_material", "mesh_sensor", "precompute_compliance", "press_on_glass"} & set(plan)
    assert LEARNING <= set(plan)


def test_a_comment_in_the_sensors_file_reruns_nothing(finished):
    finished.edit("config/sensors/coro.yaml", "name: coro", "name: coro   # the paper's")
    assert finished.plan() == {}


def test_the_covers_thickness_reruns_from_the_meshes_on_but_no_fit(finished):
    finished.edit("config/sensors/coro.yaml", "value: 1.5", "value: 1.2")
    plan = finished.plan()
    assert {"mesh_sensor", "precompute_compliance", "simulate_press"} | LEARNING <= set(plan)
    assert len(plan["simulate_press"]) == 21
    assert not {"make_curves", "fit_material"} & set(plan)


def test_more_epochs_rerun_the_training_and_no_simulation(finished):
    finished.edit("config/tiny.yaml", "epochs: 2, patience", "epochs: 3, patience")
    plan = finished.plan()
    assert {"train_cnn", "evaluate", "report"} <= set(plan)
    assert not (SIMULATION | {"build_dataset", "search_hyperparameters"}) & set(plan)
