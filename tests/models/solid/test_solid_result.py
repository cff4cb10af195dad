"""A press of solids gives labelled arrays that files give back; its fields have closed forms where the strain is even."""

import json

import numpy as np
import pytest
import trimesh

from softtact.cli import main
from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.errors import ConvergenceError, InputError
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.newton import SolidSettings
from softtact.models.solid.path import SolidPath
from softtact.models.solid.result import SolidFields
from softtact.press.result import read_press
from softtact.press.solid import solid_result

RUBBER = make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=20)


@pytest.fixture(scope="module")
def pressed():
    """A rubber block under a rigid plate that its frame brings down by 0.2 mm, in two steps, without friction: an even strain."""
    plate = trimesh.creation.box((4, 4, 1), transform=trimesh.transformations.translation_matrix([1, 1, 1.5]))
    mesh = box((0, 0, 0), (2, 2, 1), (2, 2, 1), region="rubber")
    body = SolidBody(mesh, {"rubber": RUBBER}, held={"z0": "z", "x0": "x", "y0": "y"},
                     rigid={"plate": ((1, 1, 1.5), np.array(plate.triangles))})
    body.add(ContactPair(Surface.of(mesh.face("z1")), Surface.of({"triangle": body.surface_nodes("plate")}), stiffness=10.0,
                              reach_mm=0.5, rigid=True, name="top"))
    return solid_result(SolidPath(body, {"plate": Motion().step(ways={"z": -0.1}).step(ways={"z": -0.1})}))


def test_an_even_compression_has_the_stress_of_the_uniaxial_test(pressed):
    # lambda = 0.9, 0.8, up to the overlap of at most 1 um, which is 0.5 % of the way of the second step
    for step, stretch in enumerate((0.9, 0.8)):
        nominal = float(RUBBER.uniaxial_compressible(stretch))
        assert pressed.load("plate")[step, 2] == pytest.approx(4 * nominal, rel=1e-2)
        across = np.sqrt(pressed.volume_ratio[step] / stretch)
        assert pressed.von_mises_mpa[step] == pytest.approx(-nominal / across**2, rel=1e-2)
        assert np.ptp(pressed.volume_ratio[step]) < 1e-5 and pressed.volume_ratio[step].max() < 1
        pressure = pressed.contact_pressure_mpa[step, 0]
        top = pressed.mesh.face_nodes("z1")
        assert pressure[top] == pytest.approx(-nominal, rel=1e-2)      # per area at rest
        assert np.isnan(np.delete(pressure, top)).all()
    assert pressed.penetration_mm.max() <= 1e-3 and pressed.residual_n.max() < 1e-5
    # The trapezoidal rule adds way^3 times the curvature of the load, 12 c10 A / lambda^4, over 12 in each step: 2.1 %.
    assert pressed.work_mj[-1] == pytest.approx(1.021 * pressed.strain_energy_mj[-1], rel=5e-3)


def test_files_give_the_result_back(pressed, tmp_path):
    pressed.write(tmp_path / "press.nc")
    found = read_press(tmp_path / "press.nc")
    for field in SolidFields.__dataclass_fields__:
        if field != "mesh":
            assert np.array_equal(np.asarray(getattr(found.solid, field)), np.asarray(getattr(pressed.solid, field)),
                                  equal_nan=field not in ("frames", "pairs")), field
    assert np.array_equal(found.mesh.points, pressed.mesh.points) and found.mesh.regions == ["rubber"]
    assert np.array_equal(found.mesh.face_nodes("z1"), pressed.mesh.face_nodes("z1"))
    assert found.to_dataset().identical(pressed.to_dataset())
    with pytest.raises(InputError, match="no frame 'ball'"):
        pressed.load("ball")
    with pytest.raises(InputError, match="written as .nc"):
        pressed.write(tmp_path / "press.csv")
    np.savez(tmp_path / "other.npz", a=1)
    with pytest.raises(InputError, match="no press of solids"):
        read_press(tmp_path / "other.npz")


def test_it_is_shown_from_each_of_its_files(pressed, tmp_path, capsys):
    pressed.write(tmp_path / "press.nc")
    pressed.write_vtu(tmp_path / "press.vtu")
    for name, objects in (("press.nc", 12), ("press.vtu", 0)):
        page = tmp_path / f"{name}.html"
        assert main(["view", str(tmp_path / name), "--page", str(page), "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["triangles"] == 8 * (2 * 4 + 8)      # eight triangles a facet of nine nodes: 4 above, 4 below, 2 on each side
        assert "displacement (mm)" in page.read_text()
        assert f'"seeThrough":{objects}' in page.read_text().replace(" ", "")


def test_a_step_that_is_not_reached_gives_the_steps_before():
    mesh = box((0, 0, 0), (1, 1, 1), (1, 1, 1))
    body = SolidBody(mesh, {"body": RUBBER}, held={"z0": "xyz"}, carried={"top": ((0, 0, 1), ["z1"])})
    motion = Motion().step(ways={"z": -0.1}).step(ways={"z": -2.0})
    with pytest.raises(ConvergenceError, match="Step 2 of 2 was not reached") as stopped:
        solid_result(SolidPath(body, {"top": motion}, settings=SolidSettings(smallest_increment=0.5)))
    assert stopped.value.result.steps == 1 and stopped.value.result.load("top")[0, 2] < 0
