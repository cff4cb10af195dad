"""The package as its users have it: a wheel in an environment of its own, in an empty folder, and without the extras."""

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from argparse import Namespace
from pathlib import Path

import pytest
import trimesh
import yaml

import softtact
from softtact.devices import find_device
from softtact.errors import EXTRAS, InputError, missing_extra
from softtact.sensors.library import known_names, material_file, sensor_file

ROOT = Path(__file__).resolve().parents[1]
NAMES = ["ConvergenceError", "InputError", "Motion", "Pose", "PressResult", "Sensor", "SoftObject", "SolidResult", "SolidSensor",
         "__version__", "load_sensor", "load_solid_sensor", "mesh_body", "read_mesh", "read_press"]
ALONE = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}     # no path to these sources
# pypardiso is tried where it is, and SciPy takes its place; trimesh asks for collada as it is imported.
BROUGHT_BY_EXTRAS = sorted(set(EXTRAS) - {"pypardiso", "collada"})

NOT_FOUND = """\
import sys


class NotInstalled:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)


sys.meta_path.insert(0, NotInstalled())
"""


def python(code, *, cwd=None):
    """What a program in a process of its own says: (exit status, stdout, stderr)."""
    done = subprocess.run([sys.executable, "-c", code], cwd=cwd, capture_output=True, text=True, check=False, timeout=900)
    return done.returncode, done.stdout, done.stderr


def without(package, *arguments):
    """A command where a package is not installed: (exit status, stdout, stderr)."""
    return python(f"import sys\nsys.modules[{package!r}] = None\n"
                  f"from softtact.cli import main\nsys.exit(main({list(arguments)!r}))")


# The public names

def test_the_public_names_are_those_and_no_others():
    assert sorted(softtact.__all__) == NAMES == dir(softtact)
    assert all(getattr(softtact, name) is not None for name in NAMES)
    with pytest.raises(AttributeError, match="no attribute 'numpy'"):
        softtact.numpy  # noqa: B018


def test_import_softtact_loads_nothing_heavy_and_a_sensor_none_of_the_extras():
    status, said, _ = python("import sys, softtact\nbefore = set(sys.modules)\nsofttact.load_sensor\n"
                             "print(' '.join(before)); print(' '.join(sys.modules))")
    first, then = (set(line.split()) for line in said.splitlines())
    assert status == 0
    assert not first & {"numpy", "scipy", "numba", "trimesh", "pydantic", "yaml", *EXTRAS}
    loaded_by_others = {"pyarrow", "cascadio", "PIL"}     # pandas and trimesh load them where they are
    assert "numba" in then and not then & (set(BROUGHT_BY_EXTRAS) - loaded_by_others)


# Names of sensors and materials

def test_the_products_name_is_the_same_sensor():
    assert sensor_file("tsf85") == sensor_file("coro")
    assert softtact.load_sensor("tsf85").spec == softtact.load_sensor("coro").spec


def test_a_users_own_files_come_first_and_add_to_what_ships(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = tmp_path / "config/sensors"
    own.mkdir(parents=True)
    (own / "mine.yaml").write_text(sensor_file("pad").read_text().replace("name: pad", "name: mine"))
    (own / "coro.yaml").write_text(sensor_file("coro").read_text().replace("name: coro", "name: my coro"))
    shipped = {"coro", "digit", "gelsight_mini", "gelsight_wonkdim", "pad", "pad4x4", "sheet", "skin_module", "tsf85"}
    assert known_names("sensors") == sorted([*shipped, "mine"])
    loaded = {name: softtact.load_sensor(name).spec.name for name in ("mine", "coro", "tsf85", "pad")}
    assert loaded == {"mine": "mine", "coro": "my coro", "tsf85": "my coro", "pad": "pad"}


def test_a_users_own_sensor_may_be_of_an_own_and_of_a_shipped_material(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config/materials").mkdir(parents=True)
    (tmp_path / "config/materials/gel.yaml").write_text(
        material_file("neoprene").read_text().replace("material: neoprene", "material: gel").replace("c10: 0.1786", "c10: 0.05"))
    values = yaml.safe_load(sensor_file("coro").read_text())
    values["cover"]["material"] = "gel"
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(values))
    laws = softtact.load_sensor(tmp_path / "mine.yaml").laws
    assert laws["cover"].parameters["c10"] == 0.05
    assert laws["dielectric"].parameters == softtact.load_sensor("coro").laws["dielectric"].parameters


def test_an_unknown_name_is_refused_in_one_sentence_with_the_known_ones(tmp_path, monkeypatch):
    for find, name, said in [
        (sensor_file, "cora", "There is no sensor 'cora' (did you mean 'coro'?); known are coro, digit, gelsight_mini, "
                              "gelsight_wonkdim, pad, pad4x4, sheet, skin_module, tsf85; write one of them, the path of a YAML "
                              "file, or put yours at config/sensors/cora.yaml."),
        (material_file, "xyz", "There is no material 'xyz'; known are gel_silicone, neoprene, polyurethane, silicone; write one "
                               "of them, the path of a YAML file, or put yours at config/materials/xyz.yaml."),
        (sensor_file, "../materials/neoprene", "There is no sensor '../materials/neoprene'"),
    ]:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(InputError) as caught:
            find(name)
        assert str(caught.value).startswith(said), find


def test_the_costs_of_the_shipped_studies_are_printed_in_any_folder(tmp_path, monkeypatch, capsys):
    from softtact.cli import main

    told = []
    for folder in (ROOT, tmp_path):
        monkeypatch.chdir(folder)
        assert main(["cost", "--configfile", "config/tiny.yaml", "--cores", "2"]) == 0
        captured = capsys.readouterr()
        assert captured.err == ""
        told.append([line.split()[:2] for line in captured.out.splitlines()])
    assert told[0] == told[1]


# Extras

@pytest.mark.slow
@pytest.mark.parametrize(("package", "arguments", "extra"), [
    ("torch", ["predict", "map.npy", "--network", "model.pt"], "learn"),
    ("optuna", ["stage", "search_hyperparameters"], "learn"),
    ("jinja2", ["stage", "report"], "workflow"),
    ("skimage", ["detect-discs", "frame.png", "--pixel-mm", "0.03", "--out", "discs.csv"], "optics"),
    ("skfem", ["skin", str(ROOT / "config/tiny_skin.yaml"), "--out", "results/none"], "skin"),
])
def test_a_command_whose_extra_is_missing_says_which_to_install(package, arguments, extra):
    status, said, complained = without(package, *arguments)
    assert (status, said) == (1, "")
    assert complained == (f"softtact {arguments[0]}: This needs {package}, which is not installed here; "
                          f"run: pip install 'softtact[{extra}]'.\n")


@pytest.mark.slow
def test_a_video_needs_the_extra_and_a_picture_does_not(tmp_path):
    import numpy as np
    from skimage import io

    from softtact.imaging.frames import Camera, render_frame

    (tmp_path / "press.mp4").write_bytes(b"no matter")
    arguments = ["--pixel-mm", "0.03", "--out", str(tmp_path / "discs.csv")]
    status, _, complained = without("av", "detect-discs", str(tmp_path / "press.mp4"), *arguments)
    assert status == 1 and "press.mp4: This needs av" in complained and "pip install 'softtact[optics]'." in complained
    frame = render_frame([0.0], [0.0], [0.4], Camera(0.03, blur_mm=0.05, noise=0.02, falloff=0.2), footprint_mm=(3.0, 3.0), seed=0)
    io.imsave(tmp_path / "frame.png", np.asarray(frame))
    status, said, _ = without("av", "detect-discs", str(tmp_path / "frame.png"), *arguments)
    assert status == 0 and "discs: 1" in said


def test_a_picture_needs_the_extra_and_its_lack_is_told_before_the_press(tmp_path, monkeypatch):
    from softtact.commands import common, press_gel

    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for ask in (lambda path: common.check_pictures(None, path), lambda path: press_gel.check_images(Namespace(image=path), None)):
        with pytest.raises(InputError, match=r"press\.png: This needs \w+, which is not installed here; .*softtact\[plot\]'"):
            ask(tmp_path / "press.png")
    common.check_pictures(None, None)


def test_a_missing_extra_is_told_before_the_presses_of_a_data_set_and_of_a_grasp(tmp_path):
    trimesh.creation.box((8, 8, 4)).export(tmp_path / "part.stl")
    part = [str(tmp_path / "part.stl"), "--unit", "mm", "--out", str(tmp_path / "out")]
    for package, extra, arguments in (("pyarrow", "lerobot", ["dataset", *part, "--presses", "1", "--format", "lerobot"]),
                                      ("matplotlib", "plot", ["grasp", *part, "--force", "5"])):
        status, _, complained = without(package, *arguments)
        assert status == 1
        assert f"This needs {package}, which is not installed here; run: pip install 'softtact[{extra}]'" in complained
        assert not (tmp_path / "out").exists() and not (tmp_path / "out.part").exists()


def test_a_gpu_needs_the_extra_and_auto_does_without(tmp_path):
    code = "import sys\nsys.modules['torch'] = None\nfrom softtact import devices\ndevices._has_driver = lambda: True\n"
    status, said, _ = python(f"{code}print(devices.find_device('auto'))")
    assert (status, said) == (0, "cpu\n")
    status, _, complained = python(f"{code}devices.find_device('cuda')")
    assert status == 1 and "InputError: device='cuda': This needs torch" in complained and "softtact[learn]" in complained


def test_warps_kernels_on_the_processor_need_the_extra_too(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"device='warp': This needs warp.*softtact\[device\]"):
        find_device("warp", library="warp")


def test_another_package_that_is_missing_is_no_extras_business():
    assert missing_extra(ModuleNotFoundError(name="vtkmodules.vtkCommonCore")).endswith("pip install 'softtact[view]'.")
    assert missing_extra(ModuleNotFoundError(name="numpy")) is None
    assert missing_extra(ImportError("cannot import name")) is None


# The wheel

@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy of the sources."""
    folder = tmp_path_factory.mktemp("build")
    for part in ("src", "config"):
        shutil.copytree(ROOT / part, folder / part, symlinks=True, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for file in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy2(ROOT / file, folder)
    subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-index", "--no-deps", "--no-build-isolation",
                    "--wheel-dir", str(folder / "dist"), str(folder)], check=True, timeout=900, env=ALONE)
    return next((folder / "dist").glob("*.whl"))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A fresh environment with the wheel: its own softtact, the packages of this one, and none that an extra brings."""
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True, timeout=900, env=ALONE)
    program = folder / "bin/python"
    subprocess.run([sys.executable, "-m", "pip", "--quiet", "--python", str(program), "install", "--no-index", "--no-deps",
                    str(wheel)], check=True, timeout=900, env=ALONE)
    own = next(folder.glob("lib/python*/site-packages"))
    (own / "packages.pth").write_text(sysconfig.get_path("purelib"))
    (own / "sitecustomize.py").write_text(NOT_FOUND.format(names=BROUGHT_BY_EXTRAS))
    return folder / "bin/softtact"


@pytest.fixture
def softtact_in(installed, tmp_path):
    """Run the wheel's command in an empty folder; (exit status, stdout, stderr)."""
    def run(*arguments):
        done = subprocess.run([str(installed), *map(str, arguments)], cwd=tmp_path, env=ALONE, capture_output=True, text=True,
                              check=False, timeout=900)
        return done.returncode, done.stdout, done.stderr

    return run


@pytest.fixture
def part(tmp_path):
    """A small block as the user's mesh, part.stl."""
    trimesh.creation.box((4.0, 4.0, 3.0)).export(tmp_path / "part.stl")


def test_the_wheel_holds_the_sensors_materials_studies_and_types(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    expected = {"py.typed", "sensors/data/sensors/coro.yaml", "sensors/data/materials/neoprene.yaml", "studies/data/config.yaml",
                "studies/data/costs.yaml", "studies/data/objects/catalogue.yaml", "studies/data/objects/indenters/square.stl",
                "skin/data/elastomers.yaml", "skin/data/fingertips.yaml", "studies/data/skin.yaml", "studies/data/skin_forearm.stl"}
    assert {f"softtact/{name}" for name in expected} <= names
    sources = {str(path.relative_to(ROOT / "src")) for path in (ROOT / "src").rglob("*.py")}
    assert sources <= names


@pytest.mark.slow
def test_the_wheel_presses_the_shipped_sensor_in_an_empty_folder(softtact_in, part, tmp_path):
    assert softtact_in("--version") == (0, f"softtact {softtact.__version__}\n", "")
    status, said, complained = softtact_in("press", "part.stl", "--unit", "mm", "--force", 5, "--sensor", "coro", "--model",
                                           "elastic", "--out", "press.nc")
    assert status == 0 and "elastic model on" in said, complained
    assert softtact.read_press(tmp_path / "press.nc").normal_force_n.tolist() == [5.0]


@pytest.mark.slow
def test_the_wheel_presses_a_users_own_sensor_of_shipped_materials(softtact_in, part, tmp_path):
    values = yaml.safe_load(sensor_file("coro").read_text()) | {"name": "mine", "footprint_mm": [6.0, 8.4], "map_shape": [15, 11]}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(values))
    status, said, complained = softtact_in("press", "part.stl", "--unit", "mm", "--force", 2, "--sensor", "mine.yaml", "--model",
                                           "elastic")
    assert status == 0 and "elastic model on" in said, complained


@pytest.mark.slow
def test_the_wheels_other_commands_of_the_core_run_in_an_empty_folder(softtact_in, part, tmp_path):
    for arguments in (["cost", "--configfile", "config/tiny.yaml"], ["complexity", "part.stl", "--unit", "mm"],
                      ["fit", "polyurethane", "--law", "neo_hooke", "--choose", "neo_hooke", "--out", "card.json"],
                      ["export-deck", "part.stl", "--unit", "mm", "--force", "5", "--format", "calculix", "--out", "press.inp"]):
        status, said, complained = softtact_in(*arguments)
        assert status == 0 and said, complained
    assert (tmp_path / "card.json").stat().st_size > 0 and (tmp_path / "press.inp").stat().st_size > 0
