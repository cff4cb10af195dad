"""Options that would change nothing, outputs that would take the place of inputs, and keys that stand twice are refused."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from softtact.cli import _parser, main
from softtact.commands.common import show
from softtact.errors import InputError
from softtact.files import parse_json, read_yaml
from softtact.outputs import refuse_overwriting
from softtact.sensors.library import material_file, sensor_file
from softtact.sensors.specification import read_spec
from softtact.studies.__main__ import main as stage_main
from softtact.studies.hybrid.config import read_values
from softtact.studies.hybrid.objects import read_catalogue

ROOT = Path(__file__).resolve().parents[1]
OBJECT = ROOT / "config/objects/grasped/object_5.stl"
STRETCH = np.linspace(1, 2, 21)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working folder with a curve of each kind, a mesh, a network that is none, and two links."""
    rubber = 0.35 * (STRETCH - STRETCH**-2)
    write_rows(tmp_path / "plain.csv", "stretch,nominal_stress_mpa", STRETCH, rubber)
    strain = np.linspace(0, 0.5, 21)
    pressed = -0.35 * (1 - strain - (1 - strain) ** -2)
    write_rows(tmp_path / "compression.csv", "engineering_strain,nominal_stress_mpa", strain, pressed)
    ratio = np.linspace(1, 0.97, 13)
    write_rows(tmp_path / "volume.csv", "volume_ratio,pressure_mpa", ratio, 500 * (1 - ratio))
    write_rows(tmp_path / "slack.csv", "stretch,nominal_stress_mpa", STRETCH + 0.3, rubber)
    (tmp_path / "slack.csv").write_text((tmp_path / "slack.csv").read_text().replace("a\n", "a\n1.0,0\n1.1,0\n1.2,0\n"))
    (tmp_path / "part.stl").write_bytes(OBJECT.read_bytes())
    (tmp_path / "map.csv").write_text("1,2\n3,4\n")
    (tmp_path / "link.csv").symlink_to("plain.csv")
    os.link(tmp_path / "plain.csv", tmp_path / "hard.csv")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_rows(path, header, *columns):
    path.write_text(header + "\n" + "".join(f"{x:.6f},{y:.6f}\n" for x, y in zip(*columns, strict=True)))


def said_by(capsys, line):
    """(status, stdout, stderr) of a command line."""
    status = main(line.split())
    return status, *capsys.readouterr()


FIT = "fit --law neo_hooke --out card.json uniaxial=plain.csv"
PRESS = "press part.stl --unit mm --force 5"


@pytest.mark.parametrize(("line", "sentence"), [
    (f"{FIT} --weight planr=5", "The weight of 'planr': there is no test mode 'planr'; did you mean 'planar'?"),
    (f"{FIT} --weight planar=5", "The weight of planar has no effect, as there is no planar curve"),
    (f"{FIT} --weight uniaxial=5", "The weight of the only mode has no effect"),
    (f"{FIT} volumetric=volume.csv --weight volumetric=5", "The weight of volumetric has no effect"),
    (f"{FIT} --window planar=1:1.2", "The window of planar has no effect, as there is no planar curve"),
    (f"{FIT} --window uniaxial=1:1.2 --window uniaxial=1:1.5", "uniaxial was already given as 1:1.2; give it once"),
    (f"{FIT} --small-strain 0.2", "--small-strain 0.2: it has no effect without --poisson or a volumetric curve"),
    (f"{FIT} volumetric=volume.csv --bulk-over-shear 20", "--bulk-over-shear 20: it has no effect beside a volumetric curve"),
    (f"{FIT} --mode planar", "the mode planar for all files has no effect, as each states one"),
    (f"{FIT} --layout soro_db --column stretch=x", "`columns` has no effect on the layout soro_db"),
    (f"{FIT} --poisson 0.5", "poisson is 0.5; give a value above -1 and below 0.5"),
    ("fit neoprene --decimal , --out card.json", "names its files and options; give it without others"),
    ("fit neoprene --layout soro_db --out card.json", "names its files and options; give it without others"),
    (f"{PRESS} --model elastic --policy paper", "--policy paper: it has no effect on the elastic model"),
    (f"{PRESS} --model hyperelastic --tolerance 0.1", "--tolerance 0.1: it has no effect on the hyperelastic model"),
    (f"{PRESS} --policy paper --tolerance 0.1", "--tolerance 0.1: it has no effect on the policy paper"),
    (f"{PRESS} --model elastic --full-scale", "--full-scale: it has no effect without --plot"),
    (f"{PRESS} --sensor gelsight_mini --full-scale --plot p.png", "--full-scale: it has no effect on a sensor without taxels"),
    (f"{PRESS} --sensor gelsight_mini --mesh-quality fine", "--mesh-quality fine: it has no effect on a gel"),
    (f"{PRESS} --sensor gelsight_mini --tolerance 0.1", "--tolerance 0.1: it has no effect on a gel"),
    (f"{PRESS} --sensor gelsight_mini --policy paper", "--policy paper: it has no effect on a gel"),
    (f"{PRESS} --model solid --device cuda", "--device cuda: it has no effect on the solid model"),
    (f"{PRESS} --object-law card.json --object-size 1 --tolerance 0.05", "--tolerance 0.05: it has no effect on a soft object"),
    (f"{PRESS} --model hyperelastic --card cover=a.json --card cover=b.json", "cover was already given as a.json"),
    ("detect-discs a.png --pixel-mm 1 --out d.csv --picture p --no-picture", "--picture p: it has no effect with --no-picture"),
    ("stage make_tables --out card=c.json", "PATH is missing; this stage needs it"),
])
def test_an_option_without_effect_is_refused(folder, capsys, line, sentence):
    before = set(folder.iterdir())
    status, out, said = said_by(capsys, line)
    assert (status, out, said.count("\n")) == (1, "", 1) and sentence in said
    assert set(folder.iterdir()) == before


def test_policy_and_tolerance_are_refused_for_a_motion_that_none_chooses_for(folder, capsys):
    assert main(["press", "part.stl", "--unit", "mm", "--motion", "z -0.1", "--tolerance", "0.1"]) == 1
    assert "--tolerance 0.1: it has no effect on a motion other than straight down" in capsys.readouterr().err


@pytest.mark.parametrize("motion", ["fz -10; rz 15", "z -0.2; fx 1"])
def test_a_mesh_quality_is_refused_for_a_motion_for_which_auto_takes_another_model(folder, capsys, motion):
    assert main(["press", "part.stl", "--unit", "mm", "--motion", motion, "--mesh-quality", "fine"]) == 1
    assert "--mesh-quality fine: it has no effect on this motion, for which auto is not the hyper" in capsys.readouterr().err


@pytest.mark.parametrize(("line", "sentence"), [
    ("fit uniaxial=plain.csv --out plain.csv", "--out plain.csv: it is the input plain.csv, which would be lost"),
    ("fit uniaxial=plain.csv --out link.csv", "--out link.csv: it is the input plain.csv"),
    ("fit uniaxial=link.csv --out ../{here}/plain.csv", "it is the input link.csv"),
    ("fit uniaxial=plain.csv --out hard.csv", "--out hard.csv: it is the input plain.csv"),
    ("fit uniaxial=plain.csv --out card.json --plot plain.csv", "--plot plain.csv: it is the input plain.csv"),
    ("fit uniaxial=plain.csv --out card.json --plot ./card.json", "--plot card.json: --out writes the same file"),
    ("fit mine.yaml --out mine.yaml", "--out mine.yaml: it is the input mine.yaml"),
    ("fit mine.yaml --out plain.csv", "--out plain.csv: it is the input plain.csv"),
    ("export-deck part.stl --unit mm --force 5 --format calculix --out part.stl", "--out part.stl: it is the input part.stl"),
    ("press part.stl --unit mm --force 5 --sensor s.yaml --out part.nc --plot s.yaml", "--plot s.yaml: it is the input s.yaml"),
    ("view press.nc --page press.nc", "--page press.nc: it is the input press.nc"),
    ("predict map.csv --network map.pt --out map.csv", "--out map.csv: it is the input map.csv"),
    ("stage fit_material --in curves=plain.csv --out card=link.csv", "--out card link.csv: it is the input plain.csv"),
])
def test_an_output_that_is_an_input_is_refused_by_whatever_path(folder, capsys, line, sentence):
    (folder / "mine.yaml").write_text("material: mine\ncurves: {kind: measured, files: [{file: plain.csv, mode: uniaxial}]}\n")
    (folder / "s.yaml").write_bytes(sensor_file("coro").read_bytes())
    before = {path: path.read_bytes() for path in folder.iterdir()}
    status, out, said = said_by(capsys, line.format(here=folder.name))
    assert (status, out) == (1, "") and sentence in said
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(("line", "sentence"), [
    ("cost --cores 0", "--cores 0: give 1 or more"), ("grasps tiny.yaml --workers -2 --cost", "--workers -2: give 1 or more"),
    ("dataset part.stl --unit mm --presses 1 --out d.nc --workers 0", "--workers 0: give 1 or more"),
    ("fit uniaxial=plain.csv --out card.json --skip-rows -1", "--skip-rows -1: give the number of lines above the header, 0 or"),
    ("export-deck part.stl --unit mm --force 5 --format calculix --out d.inp --sensor tiny_skin.yaml",
     "is a sensor of kind skin, of which there is no deck; name one of layers, or of kind solid")])
def test_numbers_and_sensors_that_make_no_sense_are_refused(folder, capsys, line, sentence):
    (folder / "tiny.yaml").write_bytes((ROOT / "config/tiny_grasps.yaml").read_bytes())
    (folder / "tiny_skin.yaml").write_bytes((ROOT / "config/tiny_skin.yaml").read_bytes())
    status, out, said = said_by(capsys, line)
    assert (status, out) == (1, "") and sentence in said


def test_json_holds_null_for_what_is_not_finite(capsys):
    show({"a": [1.0, float("nan")], "b": (float("inf"), np.float64("nan"))}, as_json=True, lines=[])
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {"a": [1.0, None], "b": [None, None]}


def test_a_catalogue_that_is_no_list_is_refused(tmp_path):
    (tmp_path / "objects.yaml").write_text("5\n")
    with pytest.raises(InputError, match="objects.yaml: it holds 5; write a list of objects"):
        read_catalogue(tmp_path / "objects.yaml")


def test_a_command_mends_turned_facets_where_trimesh_came_without_all_its_packages(tmp_path):
    """In a process of its own, as packages that are there already are not hidden."""
    box = trimesh.creation.box((4, 4, 2))
    box.faces[3] = box.faces[3][::-1]
    box.export(tmp_path / "turned.stl")
    code = ("from softtact.commands.common import import_trimesh; import_trimesh(); "
            "from softtact.geometry.repair import read_mended; import sys; "
            "found = read_mended(sys.argv[1], unit='mm'); print(found.repairs, found.mesh.volume)")
    ended = subprocess.run([sys.executable, "-c", code, str(tmp_path / "turned.stl")], capture_output=True, text=True, check=False)
    assert ended.returncode == 0 and "turned 1 facet that faced against the neighbours" in ended.stdout, ended.stderr


def test_a_card_that_the_chosen_model_does_not_use_is_told(folder, capsys):
    assert said_by(capsys, FIT)[0] == 0
    trimesh.creation.box((8, 8, 4)).export(folder / "part.stl")
    status, _, said = said_by(capsys, f"{PRESS} --sensor pad4x4 --policy paper --card cover=card.json")
    assert status == 0 and "WARNING: --card cover=card.json has no effect on the elastic model, which was chosen" in said


def test_pictures_of_discs_do_not_take_the_place_of_frames(folder, capsys):
    import imageio.v3 as iio

    frame = np.zeros((40, 40), np.uint8)
    frame[10:30, 10:30] = 200
    (folder / "frames").mkdir()
    for name in ("shot.png", "frames/a.png", "frames/b.png"):
        iio.imwrite(folder / name, frame)
    for line, sentence in [("detect-discs shot.png --pixel-mm 1 --out shot.csv", "--picture shot.png: it is the input shot.png"),
                           ("detect-discs frames --pixel-mm 1 --out d.csv --picture frames", "it is the folder of the frames")]:
        status, out, said = said_by(capsys, line)
        assert (status, out) == (1, "") and sentence in said, line


@pytest.mark.parametrize(("line", "sentence"), [
    (f"{FIT} --law yeoh", "argument --law: it is given twice, neo_hooke and yeoh; write its values with commas"),
    (f"{PRESS} --unit cm", "argument --unit: it is given twice, mm and cm; give it once"),
    (f"{PRESS} --model elastic --mod=foundation", "argument --model: it is given twice, elastic and foundation; give it once"),
    (f"{PRESS} --repair --no-repair", "argument --repair/--no-repair: it is given twice; give it once")])
def test_an_option_of_one_value_that_is_given_twice_is_refused(folder, capsys, line, sentence):
    with pytest.raises(SystemExit) as stopped:
        main(line.split())
    assert stopped.value.code == 2 and sentence in capsys.readouterr().err


def test_options_of_several_values_may_be_repeated():
    options = _parser().parse_args(f"{PRESS} --force 10 --json --json".split())
    assert options.force == [5.0, 10.0]


@pytest.mark.parametrize("line", [f"{FIT} uniaxial=plain.csv", f"{FIT} planar=./plain.csv",
                                  "calibrate plain.csv plain.csv --press part.stl --unit mm --force 5 --out mine.yaml"])
def test_a_file_that_is_given_twice_is_refused(folder, capsys, line):
    status, _, err = said_by(capsys, line)
    assert status == 1 and "plain.csv: the file is given twice, and would weigh twice; give it once" in err


def test_outputs_that_are_no_inputs_pass(tmp_path):
    (tmp_path / "a").write_text("")
    refuse_overwriting([tmp_path / "a", None], {"--out": tmp_path / "b", "--plot": None})


def test_a_fit_takes_a_volumetric_test_beside_compression_without_a_minus(folder, capsys):
    line = "fit uniaxial=compression.csv volumetric=volume.csv --compression --law neo_hooke --json --out card.json"
    status, out, _ = said_by(capsys, line)
    law = json.loads(out)["laws"]["neo_hooke"]
    assert status == 0 and (law["mu0_mpa"], law["bulk_modulus_mpa"]) == pytest.approx((0.35, 500), rel=1e-4)


def test_a_card_that_misses_its_curves_says_so_on_stderr(folder, capsys):
    status, out, said = said_by(capsys, "fit uniaxial=slack.csv --law neo_hooke --json --out card.json")
    assert status == 0 and "WARNING: The chosen law, neo_hooke, misses these curves by" in said
    assert "WARNING: slack.csv: its stress hardly rises over the first strains" in said
    assert json.loads(out)["warnings"][0] in said
    assert said_by(capsys, FIT)[2] == ""


NAMES = st.text("abc", min_size=1, max_size=3)
MAPPINGS = st.dictionaries(NAMES, st.integers(), min_size=1, max_size=4)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.one_of(MAPPINGS, st.dictionaries(NAMES, MAPPINGS, min_size=1, max_size=3)), st.data())
def test_a_key_that_stands_twice_is_refused_wherever_it_is(tmp_path_factory, values, data):
    path = tmp_path_factory.getbasetemp() / "random.yaml"
    text = yaml.safe_dump(values, default_flow_style=False)
    path.write_text(text)
    assert read_yaml(path, missing="") == values
    lines = text.splitlines()
    leaf = data.draw(st.sampled_from([line for line in lines if not line.endswith(":")]))
    path.write_text("\n".join([*lines[:lines.index(leaf)], leaf, *lines[lines.index(leaf):]]))
    with pytest.raises(InputError, match="random.yaml: not valid YAML .*the key .* stands in line .* and again in line .*; keep"):
        read_yaml(path, missing="")


def test_keys_of_a_merge_may_be_overridden(tmp_path):
    (tmp_path / "a.yaml").write_text("a: &a {x: 1}\nb: {<<: *a, x: 2}\nc: &c {<<: *a, y: 1}\nd: {<<: *c, x: 3}\n")
    assert read_yaml(tmp_path / "a.yaml", missing="")["d"] == {"x": 3, "y": 1}


@pytest.mark.parametrize(("read", "text"), [
    (read_values, "study: mine\nforces_n: [10]\nforces_n: [5]\n"),
    (read_values, "training: {epochs: 3}\n'training': {patience: 2}\n"),
    (read_spec, sensor_file("coro").read_text() + "name: twice\n"),
    (lambda path: main(["fit", str(path), "--out", "card.json"]), material_file("neoprene").read_text() + "material: twice\n")])
def test_each_yaml_of_the_project_refuses_a_key_that_stands_twice(folder, capsys, read, text):
    (folder / "twice.yaml").write_text(text)
    try:
        assert read(folder / "twice.yaml") == 1
        said = capsys.readouterr().err
    except InputError as error:
        said = str(error)
    assert "twice.yaml: not valid YAML (the key" in said


def test_an_object_that_stands_twice_in_the_catalogue_is_refused(tmp_path):
    line = "- {name: a, file: a.stl, unit: mm, set: grasps, label: A}\n"
    (tmp_path / "catalogue.yaml").write_text(2 * line)
    with pytest.raises(InputError, match="the object 'a' is listed twice"):
        read_catalogue(tmp_path / "catalogue.yaml")


def test_a_key_that_stands_twice_in_json_is_refused(capsys):
    with pytest.raises(ValueError, match="'a' stands twice"):
        parse_json('{"b": {"a": 1, "a": 2}}')
    assert stage_main(["fit_material", "--settings", '{"a": 1, "a": 2}']) == 1
    assert "--settings is not valid JSON (the key 'a' stands twice in one object)" in capsys.readouterr().err
