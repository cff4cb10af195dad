"""Every mistake in a configuration gets one sentence that names the place and the remedy."""

from pathlib import Path

import pytest
from support.studies import DEFAULT, ROOT, changed, merged

from softtact.errors import InputError
from softtact.materials.config import load_material
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.sensors.library import SHIPPED
from softtact.sensors.specification import SensorSpec
from softtact.studies.hybrid.config import load_study
from softtact.studies.hybrid.keys import Mesh


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


def refusal(values):
    with pytest.raises(InputError) as caught:
        load_study(values)
    sentence = str(caught.value)
    assert sentence.endswith((".", "?")) and "\n" not in sentence
    return sentence


def test_the_studies_are_valid():
    for name in ["tiny", "paper"]:
        assert load_study(merged(name)).name == name, name


def test_the_default_study_has_sixteen_indenters_and_the_six_objects_of_fig_7():
    fig_7 = {f"config/objects/grasped/object_{number}.stl" for number in range(1, 7)}
    study = load_study(DEFAULT)
    assert len({item.object for item in study.items_of["indenters"].values()}) >= 16
    assert len({item.file for item in study.items_of["grasps"].values()} & fig_7) == 6
    assert study.values.forces_n[-1] == study.sensor["force_range_n"][1] == 50


def test_the_paper_study_has_the_papers_numbers():
    study = load_study(merged("paper"))
    presses = {name: len(items) for name, items in study.items_of.items()}
    objects = {name: len({item.object for item in items.values()}) for name, items in study.items_of.items()}
    assert objects == {"indenters": 49, "unseen": 10, "grasps": 12}
    load_steps = len(study.values.forces_n)
    assert (presses["indenters"] * load_steps, presses["unseen"] * load_steps) == (13_000, 400)
    assert presses["grasps"] * study.trials_of("grasps") == 2_000 and study.trials_of("grasps") == 50


def test_presses_beyond_the_listed_poses_are_drawn_for_each_object_in_turn():
    study = load_study(changed("objects.unseen", {"names": ["hexagon", "ellipse"], "presses": 5}))
    items = study.items_of["unseen"]
    assert list(items) == ["hexagon", "hexagon-1", "hexagon-2", "ellipse", "ellipse-1"]
    assert [item.first for item in items.values()] == [True, False, False, True, False]
    again = load_study(changed("objects.unseen", {"names": ["ellipse", "z_form", "hexagon"], "presses": 9})).items_of["unseen"]
    assert all(again[name].pose == item.pose for name, item in items.items())
    other = load_study(changed("objects.unseen", {"names": ["hexagon"], "presses": 2}) | {"seed": 7}).items_of["unseen"]
    assert other["hexagon-1"].pose != items["hexagon-1"].pose


def test_one_mesh_under_two_names_in_two_sets_is_refused(tmp_path):
    lines = (ROOT / "config/objects/catalogue.yaml").read_text().replace("file: ", f"file: {ROOT}/config/objects/")
    catalogue = tmp_path / "catalogue.yaml"
    file = ROOT / "config/objects/indenters/square.stl"
    catalogue.write_text(lines + f"- {{name: new, file: {file}, unit: mm, set: unseen, label: New}}\n")
    values = changed("objects.catalogue", str(catalogue))
    values["objects"]["unseen"] = {"names": ["new"]}
    assert "square.stl: 'new' of the set unseen has the same mesh as 'square' of the set indenters" in refusal(values)


def test_an_item_is_named_by_its_object_and_its_pose():
    poses = {"centred": None, "left": [-4, 0, 0, 0, 0, 0]}
    study = load_study(changed("objects.indenters", {"names": ["square"], "poses": poses}))
    assert list(study.items_of["indenters"]) == ["square", "square-left"]
    assert study.items_of["indenters"]["square-left"].pose == [-4, 0, 0, 0, 0, 0]


def test_assumed_values_and_their_reasons_reach_the_stages_as_plain_numbers():
    assert load_study(DEFAULT).sensor["cover"] == {"material": "neoprene", "thickness_mm": 1.5}


def test_a_mistake_is_named_with_its_remedy():
    for path, value, said in [
        ("forces_nn", [5], "there is no key 'forces_nn'; did you mean 'forces_n'?"),
        ("data.sorce", "published", "at 'data': there is no key 'sorce'; did you mean 'source'?"),
        ("data", {"source": "published"}, "'unseen' is empty; name indenters of the archive to leave out of the training"),
        ("data", {"source": "published", "unseen": ["a"], "folder": "no/such"}, "no/such: there is no such folder; put the"),
        ("models.hyperelastic.mesh.refinement", -1, "at 'models.hyperelastic.mesh.refinement' (it is -1)"),
        ("models.elastic.friction", {"object": 0.3}, "at 'models.elastic': a model of kind 'elastic' has no friction"),
        ("models.elastic.device", "cuda", "at 'models.elastic': a model of kind 'elastic' has no 'device'; leave it out"),
        ("models.reference.friction", {"board": 0.3}, "bonded tips cannot slide with a friction of 0.3 on the board"),
        ("virtual_sensor", {"noise_counts": -1}, "virtual_sensor: noise_counts is -1.0; give one number of 0 or more."),
        ("virtual_sensor", {"dead_taxels": [3, 28]}, "virtual_sensor: dead_taxels has 28; the taxels are numbered 0 to 27."),
        ("virtual_sensor", {"noise_count": 1}, "there is no key 'noise_count'; did you mean 'noise_counts'?"),
        ("sensor", "cora", "at 'sensor': there is no sensor 'cora' (did you mean 'coro'?); known are coro, digit, "),
        ("materials", ["polyurethane", "neoprene", "rubber"], "there is no material 'rubber'; known are gel_silicone, neoprene, "),
        ("materials", ["polyurethane"], "sensor coro is made of 'neoprene', which is not in the list; add it."),
        ("objects.unseen.names", ["hexagn"], "there is no object of set unseen 'hexagn'; did you mean 'hexagon'?"),
        ("objects.catalogue", "config/none.yaml", "config/none.yaml: there is no such catalogue"),
        ("objects.indenters.poses", {"left": [1, 2]}, "at 'objects.indenters.poses.left"),
        ("objects.unseen.presses", 1, "presses is 1, and 4 objects in 1 listed poses are 4; give that many or more"),
        ("forces_n", [5, 60], "60 N is out of the range of coro, above 0 and up to 50 N"),
        ("forces_n", [10, 5], "at 'forces_n' (it is [10, 5]): the values must rise"),
        ("ftir.law", "ogden", "there is no law 'ogden'; did you mean 'ogden"),
        ("ftir.orientations", ["as_printed"],
         "orientation 'default' of the model under test is not among the orientations as_printed; add it"),
        ("ftir.forces_n", [0], "forces_n holds 0 N only; add a force above"),
        ("tested", ["elastic", "viscous"], "there is no model 'viscous'"),
        ("trials", "five", "at 'trials' (it is 'five')"),
    ]:
        assert said in refusal(changed(path, value)), path


def test_the_mesh_section_knows_the_keys_of_the_solver():
    assert set(MeshSettings.__dataclass_fields__) <= set(Mesh.model_fields)


def test_a_missing_key_is_named():
    values = {key: value for key, value in DEFAULT.items() if key != "forces_n"}
    assert refusal(values) == "the configuration: the key 'forces_n' is missing; add it."


def test_a_misspelt_key_of_a_sensor_or_a_material_is_named_with_the_right_one(tmp_path):
    for file, right, wrong, said in [
        ("sensors/coro.yaml", "tip_diameter_mm", "tip_diametre_mm",
         "at 'dielectric.frusta': there is no key 'tip_diametre_mm'; did you mean 'tip_diameter_mm'?"),
        ("sensors/coro.yaml", "name:", "nam:", "there is no key 'nam'; did you mean 'name'?"),
        ("materials/neoprene.yaml", "  points:", "  point:", "there is no key 'point'; did you mean 'points'?"),
    ]:
        text = (SHIPPED / file).read_text()
        assert right in text, file
        path = tmp_path / Path(file).name
        path.write_text(text.replace(right, wrong, 1))
        with pytest.raises(InputError) as caught:
            (SensorSpec.from_yaml if "sensor" in file else load_material)(path)
        assert said in str(caught.value) and str(caught.value).startswith(str(path)), file


def test_files_outside_the_project_are_said_and_those_inside_are_not(tmp_path, capsys):
    load_study(DEFAULT)
    assert capsys.readouterr().err == ""
    (tmp_path / "area.csv").write_text("force_n,area_mm2\n1,0.1\n")
    load_study(changed("ftir.measured", str(tmp_path / "area.csv")))
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"at 'ftir.measured': {tmp_path / 'area.csv'} lies outside this project" in said
