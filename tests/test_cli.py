"""The command line: what it answers, and how it refuses."""

import argparse
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact import cli
from softtact.cli import COMMANDS, main
from softtact.commands import mesh as mesh_command
from softtact.commands import press as press_command
from softtact.commands.fit import LAYOUTS as LAYOUTS_OFFERED
from softtact.errors import ConvergenceError, InputError, OutputError, WorkerError
from softtact.exits import EXIT_STATUS
from softtact.materials.prony import PronySeries
from softtact.materials.readers import LAYOUTS
from softtact.press.result import read_press
from softtact.press.sensor import MODELS, Sensor
from softtact.press.task import TOLERANCE_MM
from softtact.processes import Terminated
from softtact.sensors.library import material_file, sensor_file

ROOT = Path(__file__).resolve().parents[1]
OBJECT = ROOT / "config/objects/grasped/object_5.stl"


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.fixture
def refused(capsys):
    """Run a command that must refuse; (exit status, its one sentence)."""

    def run(*arguments):
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = stop.code
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1, captured
        return status, captured.err

    return run


@pytest.fixture
def answer(capsys):
    """Run a command that must succeed; its output."""

    def run(*arguments):
        assert main([str(argument) for argument in arguments]) == 0
        return capsys.readouterr().out

    return run


NAMES = ("press", "play", "grasp", "grasps", "skin", "palpate", "dataset", "view", "calibrate", "calibrate-camera", "predict",
         "complexity", "fit", "mesh", "export-deck", "detect-discs", "cost", "stage", "config-example", "config-schema",
         "completion")


def test_every_commands_help_has_examples_and_the_exit_statuses(capsys):
    for command in [[], *([name] for name in NAMES)]:
        with pytest.raises(SystemExit) as stop:
            main([*command, "--help"])
        assert stop.value.code == 0
        said = capsys.readouterr().out
        assert "usage: softtact" in said and "examples:" in said, command
        assert all(f"  {status:<4}{meaning}" in said for status, meaning in EXIT_STATUS.items()), command


def test_the_docs_hold_the_exit_statuses_as_they_are():
    page = (ROOT / "docs/reference/command_line.md").read_text()
    assert all(f"| {status} | {meaning} |" in page for status, meaning in EXIT_STATUS.items())


def examples():
    """Each command of the examples in the helps, as its arguments."""
    for command in COMMANDS:
        named = vars(sys.modules[command.__name__]).items()      # a module of two commands has examples of each
        text = "\n".join(value for name, value in named if name.endswith("EXAMPLES"))
        text = text.replace("\\\n", " ").replace(",\n      ", ", ")
        for line in text.splitlines():
            arguments = shlex.split(line, comments=True) if line.strip().startswith("softtact ") else []
            yield from [arguments[1:]] if arguments else []


@pytest.fixture
def example_files(tmp_path, monkeypatch):
    """What the examples name: meshes, curves, frames, a sensor, a network, in a folder of their own."""
    mesh = trimesh.load(OBJECT)
    mesh.export(tmp_path / "part.stl")
    for name, scale in (("part.obj", 1 / 25.4), ("part.ply", 1e-3)):
        mesh.copy().apply_scale(scale).export(tmp_path / name)
    neo_hooke_file(tmp_path / "tension.csv", (0.8, 0.9, 1.1, 1.3, 1.4))
    neo_hooke_file(tmp_path / "shear.csv", (1.1, 1.3, 1.5), exponents=(1, -3))
    up, down = np.linspace(1, 1.5, 12), np.linspace(1.49, 1.01, 12)
    softer = 0.4 * (down - down**-2) * (1 - 0.3 * (1.5 - down) / 0.5)
    cycles = np.column_stack([np.concatenate([up, down]), np.concatenate([0.4 * (up - up**-2), softer])])
    np.savetxt(tmp_path / "cycles.csv", cycles, delimiter=",", header="stretch,nominal_stress_mpa", comments="")
    times, series = np.geomspace(0.01, 10, 15), PronySeries((0.3,), (0.5,))
    for name, header, values in (("relaxation", "time_s,force_n", [series.relaxation(times)]),
                                 ("dma", "frequency_hz,storage_modulus_mpa,loss_modulus_mpa", series.storage_loss(times))):
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack([times, *values]), delimiter=",", header=header, comments="")
    rows = [f"{x:.2f};{400 * (x - x**-2):.3f}\n" for x in np.linspace(1, 1.8, 9)]
    (tmp_path / "machine.csv").write_text("Test 7\nOperator: X\nstretch;Spannung\n" + "".join(rows).replace(".", ","))
    (tmp_path / "my_sensor.yaml").write_text(sensor_file("coro").read_text())
    (tmp_path / "config").symlink_to(ROOT / "config")
    monkeypatch.chdir(tmp_path)


def test_the_examples_in_the_helps_are_right_command_lines():
    parser = cli._parser()
    seen = {parser.parse_args(without_redirection(arguments)).command for arguments in examples()}
    assert seen == set(NAMES)


def without_redirection(arguments):
    return arguments[:next((k for k, word in enumerate(arguments) if word in (">", ">>")), len(arguments))]


QUICK = ("complexity", "fit", "stage", "config-schema", "completion", "press part.stl --unit mm --force 5 --model elastic")


def test_the_quick_examples_run(example_files, capsys):
    """Those that need no minutes, no network and no camera's frames."""
    lines = [(" ".join(arguments), arguments) for arguments in map(without_redirection, examples())]
    quick = [arguments for line, arguments in lines if line.startswith(QUICK) and "all --out" not in line and ".yaml" not in line]
    for arguments in quick:
        assert main(arguments) == 0, arguments
    assert {arguments[0] for arguments in quick} == {line.split()[0] for line in QUICK}


def test_json_stands_alone_on_stdout_and_messages_on_stderr(capsys, tmp_path):
    """A mended mesh makes a message; so does the first use of a sensor."""
    doubled = trimesh.load(OBJECT)
    trimesh.Trimesh(doubled.vertices, [*doubled.faces, doubled.faces[0]], process=False).export(tmp_path / "part.stl")
    press = ["press", str(tmp_path / "part.stl"), "--unit", "mm", "--force", "5", "--model", "elastic", "--json"]
    assert main([*press, "--vtu", str(tmp_path / "p.vtu"), "--out", str(tmp_path / "p.nc")]) == 0
    captured = capsys.readouterr()
    told = json.loads(captured.out)
    assert told["repairs"] == ["left out 1 facet of those that were there twice"] and told["repairs"][0] in captured.err
    assert told["written"] == [str(tmp_path / "p.nc"), str(tmp_path / "p.vtu")] and np.shape(told["tactile_map"]) == (1, 7, 4)


def test_what_stops_a_command_has_its_exit_status(refused, monkeypatch):
    for fault, status in [
        (ConvergenceError("The load step of 20 N was not reached."), 3), (InputError("no."), 1), (KeyboardInterrupt(), 130),
        (OSError(28, "No space left on device", "press.nc"), 4), (OutputError("press.nc: cannot be written."), 4),
        (WorkerError("A process was killed."), 4), (Terminated(), 143), (OSError(12, "Cannot allocate memory"), 4),
        (RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 8 bytes."), 4),
    ]:
        def stop(options, fault=fault):
            raise fault

        monkeypatch.setattr(mesh_command, "_complexity", stop)
        got, sentence = refused("complexity", OBJECT, "--unit", "mm")
        assert got == status and sentence.startswith("softtact complexity: "), fault


def test_a_press_that_stops_early_writes_and_prints_the_forces_before(capsys, tmp_path, monkeypatch):
    whole = Sensor.press

    def stops(self, mesh, **options):
        result = whole(self, mesh, **options | {"force_n": [5.0]})
        raise ConvergenceError("The load step of 20 N was not reached.", result=result)

    monkeypatch.setattr(Sensor, "press", stops)
    status = main(["press", str(OBJECT), "--unit", "mm", "--force", "5", "--force", "20", "--model", "elastic", "--json",
                   "--out", str(tmp_path / "p.nc")])
    captured = capsys.readouterr()
    assert status == 3 and json.loads(captured.out)["normal_force_n"] == [5.0] and (tmp_path / "p.nc").exists()
    assert captured.err.endswith("softtact press: The load step of 20 N was not reached.\n")


def test_completion_is_a_script_of_the_shell(answer, tmp_path):
    for shell in ["bash", "zsh", "fish"]:
        script = tmp_path / "completion"
        script.write_text(answer("completion", shell))
        assert "softtact" in script.read_text(), shell
        if shutil.which(shell):
            subprocess.run([shell, "-n", script], check=True)


def test_bash_completes_commands_and_options(tmp_path):
    """As bash asks: the line so far in the environment, the answers on file descriptor 8."""
    call = "import sys; from softtact.cli import main; sys.argv[0] = 'softtact'; main()"

    def completed(line):
        environment = os.environ | {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n",
                                    "_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "answers"), "COMP_TYPE": "9"}
        subprocess.run([sys.executable, "-c", call], env=environment, check=True)
        return (tmp_path / "answers").read_text().split()

    assert completed("softtact pre") == ["press", "predict"]
    assert completed("softtact press part.stl --mod") == ["--model"]
    assert set(completed("softtact press part.stl --model ")) >= {"auto", "elastic"}


def test_the_schema_in_docs_is_that_of_the_types_and_takes_the_projects_files(answer):
    for kind in ["study", "sensor", "material"]:
        schema = json.loads((ROOT / f"docs/schemas/{kind}.schema.json").read_text())
        again = f"softtact config-schema {kind} --out docs/schemas/{kind}.schema.json"
        assert schema == json.loads(answer("config-schema", kind)), again
        files = {"study": ROOT / "config/config.yaml", "sensor": sensor_file("coro"), "material": material_file("neoprene")}
        values = yaml.safe_load(files[kind].read_text())
        jsonschema.validate(values, schema)
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(values | {"nam": 1}, schema)


def test_the_command_line_offers_what_the_package_has():
    """It keeps its own copies, so that --help loads no solver."""
    assert press_command.MODELS == MODELS
    assert LAYOUTS_OFFERED == LAYOUTS
    options = argparse.ArgumentParser().add_subparsers()
    press_command.add(options)
    assert options.choices["press"].get_default("tolerance") == TOLERANCE_MM


HEAVY = ("numpy", "torch", "scipy", "numba", "pandas", "xarray", "matplotlib", "trimesh", "pyvista", "pydantic", "meshio",
         "skimage")


def test_the_package_and_its_help_load_no_heavy_library():
    for imported in ["import softtact", "import softtact.cli; softtact.cli._parser().format_help()"]:
        listed = f"import sys; {imported}; print([name for name in {HEAVY} if name in sys.modules])"
        done = subprocess.run([sys.executable, "-c", listed], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]", imported


# What an elastic press without a file needs none of, wherever it is installed.
IDLE_IN_A_PRESS = ("torch", "pandas", "xarray", "h5py", "h5netcdf", "pyarrow", "matplotlib", "pyvista", "meshio", "rich",
                   "networkx", "cascadio", "skimage", "scipy.stats", "scipy.optimize", "scipy.interpolate", "jsonschema", "optuna",
                   "mujoco", "snakemake", "softtact.imaging", "softtact.press.gradient", "softtact.press.hyperelastic",
                   "softtact.press.many", "softtact.press.solid", "softtact.models.hyperelastic.body", "softtact.models.solid.body")


def test_an_elastic_press_loads_no_library_that_it_does_not_use(tmp_path):
    small = yaml.safe_load(sensor_file("coro").read_text()) | {"footprint_mm": [6.0, 8.4], "map_shape": [15, 11]}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(small))
    trimesh.creation.box((4.0, 4.0, 3.0)).export(tmp_path / "part.stl")
    arguments = ["press", "part.stl", "--unit", "mm", "--force", "2", "--sensor", "small.yaml", "--model", "elastic"]
    listed = ("import atexit, gc, sys; from softtact.cli import main; "
              "atexit.register(lambda: print('objects spared:', gc.get_freeze_count() > 0)); "
              f"assert main({arguments}) == 0; print([name for name in {IDLE_IN_A_PRESS} if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", listed], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("elastic model on")
    assert done.stdout.splitlines()[-2:] == ["[]", "objects spared: True"]      # by Python's search for cycles as it ends


def test_a_refusal_is_one_sentence_and_a_status(refused):
    for arguments, status, said in [
        (["press", OBJECT, "--force", 20], 1, "--unit"),
        (["press", OBJECT, "--unit", "furlong", "--force", 20], 2, "furlong"),
        (["press", OBJECT, "--unit", "mm", "--force", 0], 1, "0 N"),
        (["press", OBJECT, "--unit", "mm", "--force", 51], 1, "51 N"),
        (["press", OBJECT, "--unit", "mm", "--force", 5, "--sensor", "cora"], 1, "cora"),
        (["press", OBJECT, "--unit", "mm", "--force", 5, "--out", "no/such/folder.nc"], 1, "no/such"),
        (["press", OBJECT, "--unit", "mm", "--force", 5, "--pose", "100,0,0,0,0,0"], 1, "misses the sensor"),
        (["press", OBJECT, "--unit", "m", "--force", 5], 1, "mm"),
        (["press", "none.stl", "--unit", "mm", "--force", 5], 1, "none.stl"),
        (["export-deck", OBJECT, "--unit", "mm", "--force", 5, "--out", "deck.inp"], 2, "--format"),
        (["stage", "no_such_stage"], 1, "no_such_stage"),
        (["press", OBJECT, "--unit", "mm", "--force", 5, "--weight", 3], 2, "softtact press: --weight is no option or argument"),
        (["stage", "fit_material", "--in", "curves"], 1, "NAME=PATH"),
        (["stage", "fit_material", "--settings", "{"], 1, "JSON"),
        (["prss"], 2, "prss"),
    ]:
        got, sentence = refused(*arguments)
        assert got == status, arguments
        assert said in sentence, arguments


def test_complexity_counts_and_chooses(answer):
    told = json.loads(answer("complexity", OBJECT, "--unit", "mm", "--json"))
    assert told["NPt"] % 3 == 0 and told["model"] == "hyperelastic"
    assert "hyperelastic" in answer("complexity", OBJECT, "--unit", "mm")


def test_fit_writes_a_card_and_ranks_the_laws(answer, tmp_path):
    curve = tmp_path / "uniaxial.csv"
    rows = [f"{x},{0.4 * (x - x**-2)}\n" for x in (0.8, 0.9, 1.1, 1.3)]  # neo-Hookean, 2 C10 = 0.4 MPa
    curve.write_text("stretch,nominal_stress_mpa\n" + "".join(rows))
    card = tmp_path / "card.json"
    said = answer("fit", curve, "--law", "neo_hooke", "--out", card)
    assert json.loads(card.read_text())["laws"]["neo_hooke"]["parameters"]["c10"] == pytest.approx(0.2, rel=1e-6)
    assert "neo_hooke" in said and str(card) in said


def neo_hooke_file(path, stretches, *, header="stretch,nominal_stress_mpa", exponents=(1, -2)):
    """A test of a neo-Hookean rubber with a shear modulus of 0.4 MPa."""
    rows = [f"{x},{0.4 * (x ** exponents[0] - x ** exponents[1]):.6f}\n" for x in stretches]
    path.write_text(f"{header}\n" + "".join(rows))
    return path


def test_fit_joins_modes_and_a_volumetric_test_and_draws_the_card(answer, tmp_path):
    tension = neo_hooke_file(tmp_path / "a.csv", (0.8, 0.9, 1.1, 1.3, 1.5))
    planar = neo_hooke_file(tmp_path / "b.csv", (1.1, 1.3, 1.5), exponents=(1, -3))
    (tmp_path / "volumetric.csv").write_text("volume_ratio,pressure_mpa\n0.98,0.16\n0.99,0.08\n1,0\n")
    said = json.loads(answer("fit", f"uniaxial={tension}", f"planar={planar}", tmp_path / "volumetric.csv",
                             "--law", "neo_hooke,gent", "--window", "uniaxial=0.7:1.4", "--weight", "planar=2",
                             "--residual", "relative", "--plot", tmp_path / "card.png", "--out", tmp_path / "card.json", "--json"))
    assert said["strain_window"] == {"uniaxial": [0.8, 1.3], "planar": [1.1, 1.5], "volumetric": [0.98, 1.0]}
    assert said["laws"]["neo_hooke"]["bulk_modulus_mpa"] == pytest.approx(8.0)
    assert said["laws"]["neo_hooke"]["fit"]["residual"] == "relative"
    assert (tmp_path / "card.png").stat().st_size > 20_000


def test_fit_takes_a_materials_yaml_with_what_the_command_line_adds(answer, tmp_path):
    neo_hooke_file(tmp_path / "mine.csv", (0.8, 1.2, 1.4), header="lambda,P")
    (tmp_path / "mine.yaml").write_text("""
material: mine
curves:
  kind: measured
  files: [{file: mine.csv, mode: uniaxial, columns: {stretch: lambda, nominal_stress_mpa: P}}]
fit: {laws: [neo_hooke], poisson: 0.45, small_strain: 0.5}
""")
    said = json.loads(answer("fit", tmp_path / "mine.yaml", "--poisson", "0.4", "--out", tmp_path / "card.json", "--json"))
    assert said["material"] == "mine" and list(said["laws"]) == ["neo_hooke", "linear"]
    assert said["laws"]["linear"]["parameters"]["poisson"] == 0.4


def test_fit_refuses_options_without_meaning_and_writes_no_card(refused, tmp_path):
    for options, sentence in [
        (["--window", "uniaxial=2:1"], "'2:1' is not two rising numbers with a colon between them"),
        (["--window", "0.7:1.4"], "--window 0.7:1.4: write it as NAME=VALUE"),
        (["--column", "mass=F"], "`columns` maps 'mass', which is no quantity with a unit"),
        (["--choose", "yeoh", "--law", "gent"], "Law 'yeoh' is to be chosen but is not fitted"),
    ]:
        curve = neo_hooke_file(tmp_path / "uniaxial.csv", (0.8, 0.9, 1.1, 1.3))
        status, said = refused("fit", curve, *options, "--out", tmp_path / "card.json")
        assert status == 1 and sentence in said, options
        assert not (tmp_path / "card.json").exists(), options


def test_a_materials_yaml_is_given_alone(refused, tmp_path):
    status, said = refused("fit", material_file("neoprene"), "--mode", "uniaxial", "--out", tmp_path / "card.json")
    assert status == 1 and "names its files and options; give it without others" in said


def test_press_refuses_a_card_that_it_cannot_use(refused):
    for card, sentence in [("lid=card.json", "the layer is 'lid'; give dielectric or cover"),
                          ("cover=none.json", "none.json: there is no such file")]:
        status, said = refused("press", OBJECT, "--unit", "mm", "--force", 5, "--model", "hyperelastic", "--card", card)
        assert status == 1 and sentence in said, card


@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["calculix", "abaqus"])
def test_export_deck_writes_the_whole_sensor_with_a_step_per_force(answer, tmp_path, dialect):
    deck = tmp_path / "deck.inp"
    told = json.loads(answer("export-deck", OBJECT, "--unit", "mm", "--force", 20, "--force", 5, "--format", dialect,
                             "--out", deck, "--json"))
    assert told["steps"] == ["TOUCH", "FORCE_1", "FORCE_2"]
    # The sheet's upper side follows the cover's: 16 nodes inside each cell and 2 on each wall, more where the cover is coarse.
    assert told["tied_nodes"] > 540 * 16 + (18 * 31 + 19 * 30) * 2
    text = deck.read_text()
    assert "units: mm, N, MPa" in text and text.index(", 3, -5\n") < text.index(", 3, -20\n")


def test_the_draft_mesh_comes_with_what_counts_as_solved_on_it():
    from types import SimpleNamespace

    from softtact.commands.press import _quality
    from softtact.models.hyperelastic.mesh_settings import MeshSettings
    from softtact.models.hyperelastic.newton import NewtonSettings

    draft, fine = (_quality(SimpleNamespace(mesh_quality=name)) for name in ("draft", "fine"))
    assert draft == {"mesh": MeshSettings.draft(), "solver": NewtonSettings.draft()}
    assert fine == {"mesh": MeshSettings.fine(), "solver": NewtonSettings()}


@pytest.mark.parametrize(("options", "said"), [
    (["--model", "elastic", "--card", "cover=card.json"], "--card cover=card.json: it has no effect on the elastic model"),
    (["--model", "foundation", "--mesh-quality", "draft"], "--mesh-quality draft: it has no effect on the foundation model"),
    (["--model", "elastic", "--device", "cuda"], "--device cuda: it has no effect on the elastic model")])
def test_an_option_without_effect_on_the_chosen_model_is_refused(options, said, capsys):
    assert main(["press", str(OBJECT), "--unit", "mm", "--force", "5", *options]) == 1
    assert said in capsys.readouterr().err


def test_a_press_file_tells_what_was_pressed_how_and_by_which_command(tmp_path, capsys):
    file = tmp_path / "press.nc"
    assert main(["press", str(OBJECT), "--unit", "mm", "--force", "5", "--model", "elastic", "--sensor", "pad4x4",
                 "--out", str(file)]) == 0
    facts = read_press(file).attributes
    assert facts["mesh"] == OBJECT.name and facts["mesh_sha256"] == hashlib.sha256(OBJECT.read_bytes()).hexdigest()
    assert facts["unit"] == "mm" and facts["pose"] == "centred, touching" and facts["command"].startswith("softtact ")


def test_the_command_in_a_press_file_can_be_run_again(tmp_path):
    arguments = ["press", str(OBJECT), "--unit", "mm", "--motion", "z -0.2; x 0.1", "--model", "elastic", "--sensor", "pad4x4",
                 "--out", str(tmp_path / "a press.nc")]
    assert main(arguments) == 0
    assert shlex.split(read_press(tmp_path / "a press.nc").attributes["command"]) == ["softtact", *arguments]


def test_a_time_limit_ends_a_press_with_status_3_and_one_sentence(tmp_path, capsys):
    ball = tmp_path / "ball.stl"
    trimesh.creation.icosphere(subdivisions=3, radius=6.0).export(ball)
    assert main(["press", str(ball), "--unit", "mm", "--force", "5", "--model", "hyperelastic", "--sensor", "pad4x4",
                 "--time-limit", "0.001"]) == 3
    assert "The time limit of 0.001 s was reached" in capsys.readouterr().err


def test_a_time_limit_of_no_time_is_refused(capsys):
    assert main(["press", str(OBJECT), "--unit", "mm", "--force", "5", "--time-limit", "0"]) == 1
    assert "--time-limit 0: a press needs some time; give seconds above 0" in capsys.readouterr().err


def test_the_module_is_the_command():
    said = subprocess.run([sys.executable, "-m", "softtact", "--version"], capture_output=True, text=True, check=True).stdout
    assert said.strip() == f"softtact {softtact.__version__}"
