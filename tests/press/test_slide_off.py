"""A loaded object that is slid off what it presses ends the press in a sentence; the steps before are kept."""

import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact.cli import main
from softtact.errors import ConvergenceError
from softtact.fem.files.solids import write_mesh
from softtact.fem.structured_meshes import box
from softtact.models.solid.newton import _solved

CUBE = {"name": "cube", "kind": "solid", "mesh": {"file": "cube.vtu"},
        "regions": {"gel": {"law": "neo_hooke", "parameters": {"c10": 0.1}, "bulk_over_shear": 20}}, "held": {"z0": "xyz"},
        "readings": {"points_mm": [[1, 1, 2]], "radius_mm": 0.8}, "force_range_n": [0, 20]}
SLIDE = ["--unit", "mm", "--motion", "fz -0.1; x 0.5; x 4", "--pose=1,1,0,0,0,0"]


@pytest.fixture
def folder(tmp_path):
    """A cube of 2 mm, and a ball."""
    write_mesh(box((0, 0, 0), (2, 2, 2), (1, 1, 1), region="gel"), tmp_path / "cube.vtu")
    trimesh.creation.icosphere(2, radius=4.0).export(tmp_path / "ball.stl")
    return tmp_path


def sensor_of(folder, friction):
    (folder / "cube.yaml").write_text(yaml.safe_dump(CUBE | {"contact": {"face": "z1", "friction": friction}}))
    return folder / "cube.yaml"


def test_an_object_that_slides_off_under_its_load_ends_with_the_steps_before(folder, capsys):
    out = folder / "slid.nc"
    assert main(["press", str(folder / "ball.stl"), "--sensor", str(sensor_of(folder, 0.0)), *SLIDE, "--out", str(out)]) == 3
    said = capsys.readouterr()
    assert "Step 3 of 3 was not reached: at " in said.err
    assert "the object leaves the surface, and nothing stands against its load of fz -0.1 N" in said.err
    assert "prescribe its depth (z) in place of its load" in said.err and "Traceback" not in said.err
    kept = softtact.read_press(out)
    np.testing.assert_allclose(kept.normal_force_n, [0.1, 0.1], rtol=1e-4)
    assert [line.split()[2] for line in said.out.splitlines()[2:4]] == ["-0.1", "-0.1"]     # the table of the steps reached


@pytest.mark.parametrize("friction", [0.3, 0.0])
def test_in_python_the_error_holds_the_steps_before(folder, friction):
    sensor = softtact.load_solid_sensor(sensor_of(folder, friction))
    with pytest.raises(ConvergenceError, match="the object leaves the surface") as caught:
        sensor.press(folder / "ball.stl", unit="mm", motion="fz -0.1; x 5", pose=[1, 1, 0, 0, 0, 0], label="")
    assert len(caught.value.result.force_n) == 1


def test_a_freedom_that_nothing_resists_is_moved_along_its_load():
    schur = np.array([[2.0, 0.0], [0.0, 0.0]])
    moved = _solved(schur, np.array([1.0, -0.5]))
    assert moved[0] == pytest.approx(0.5) and moved[1] < -1e3 and np.isfinite(moved).all()
