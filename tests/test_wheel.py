"""What the installed package does with the packages of its core alone: run against the wheel of a release, too (`-m wheel`)."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact.sensors.library import known_names, sensor_file

pytestmark = pytest.mark.wheel


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A small sensor of the shipped materials."""
    values = yaml.safe_load(sensor_file("coro").read_text()) | {"name": "small", "footprint_mm": [4.8, 7.2], "map_shape": [13, 9]}
    path = tmp_path_factory.mktemp("sensor") / "small.yaml"
    path.write_text(yaml.safe_dump(values))
    return softtact.load_sensor(path)


@pytest.mark.parametrize("model", ["elastic", "foundation"])
def test_a_fast_press_carries_the_force_that_was_asked_for_and_is_read_back(small, model, tmp_path):
    result = small.press(trimesh.creation.box((4.0, 4.0, 3.0)), force_n=[1.0, 2.0], model=model)
    assert result.model == model and result.normal_force_n == pytest.approx([1.0, 2.0])
    result.write(tmp_path / "press.nc")
    again = softtact.read_press(tmp_path / "press.nc")
    assert np.array_equal(again.deformation_map_mm, result.deformation_map_mm)
    assert again.readings["taxels"].identical(result.readings["taxels"])


def test_every_sensor_that_ships_loads():
    assert all(softtact.load_sensor(name).spec.name for name in known_names("sensors"))


def test_the_command_says_its_version_and_refuses_a_missing_file_in_one_sentence(tmp_path):
    def command(*arguments):
        return subprocess.run([sys.executable, "-m", "softtact", *arguments], capture_output=True, text=True, check=False,
                              cwd=tmp_path)

    assert command("--version").stdout == f"softtact {softtact.__version__}\n"
    refused = command("press", "none.stl", "--unit", "mm", "--force", "5")
    assert refused.returncode == 1 and refused.stderr.count("\n") == 1 and "none.stl" in refused.stderr
