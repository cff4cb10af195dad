"""An object on a skin at finite strains: its law, an even squeeze in closed form, and small forces against small strains."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError
from scipy.optimize import brentq
from support.skins import small_skin

from softtact.errors import InputError
from softtact.files import read_dataset, read_json
from softtact.skin.analysis import CONVERTERS, LayerMeshSizes, Skin, analyse
from softtact.skin.contact import compression_law, contact_load, press_at_finite_strains, solid_layer
from softtact.skin.design import LoadChoice, SkinDesign
from softtact.skin.elastomers import Elastomer, read_elastomers
from softtact.skin.layout import module_layout
from softtact.skin.loads import Load
from softtact.studies.skin.stages.readings import press_object, read_taxels
from softtact.studies.skin.stages.summary import _facts


def linear(poisson, *, young_mpa=0.2):
    """An elastomer whose strain is its stress over a modulus: 30 % at 60 kPa, so that its test ends at 55 kPa and 27.5 %."""
    return Elastomer(name="linear", strain_percent=(0.0, 100 / young_mpa, 0.0, 0.0), density_g_cm3=1.0, poisson=poisson,
                     permittivity=1.0, permittivity_fe=1.0)  # fmt: skip


def test_the_law_follows_the_curve_and_tells_by_how_much_it_does_not():
    """Of a straight line with nu = 0 the shear modulus is half of Young's; the foam's curve bends, by 2.8e-3 at best."""
    law, off = compression_law(linear(0.0))
    assert off < 0.003 and law.mu0 == pytest.approx(0.1, rel=0.03)
    assert law.stretch_window == pytest.approx((0.725, 1.0))
    for elastomer in read_elastomers().values():
        law, off = compression_law(elastomer)
        stress = np.linspace(*elastomer.tested_mpa, 200)
        departs = -law.nominal_stress("uniaxial", 1 - elastomer.fit(stress)) - stress
        assert np.abs(departs).max() / stress[-1] == pytest.approx(off, abs=2e-3) and off < 0.12, elastomer.name


def test_the_layer_as_a_solid_has_the_skins_volume_and_nodes():
    skin = small_skin(poisson=0.0)
    layer = solid_layer(skin.layer.mesh)
    assert layer.volume_mm3() == pytest.approx(2 * skin.layout.area_mm2, rel=1e-12)  # no element is inside out
    assert layer.points is skin.layer.mesh.nodes_mm or (layer.points == skin.layer.mesh.nodes_mm).all()


@pytest.mark.slow
def test_a_plate_squeezes_a_layer_that_does_not_widen_as_its_test_says_and_capacitances_grow_as_the_gap_falls():
    """nu = 0, floor bonded: every column is a uniaxial test. 40 kPa on E = 200 kPa is a strain of 0.2, C is 1/0.8 of that at rest.

    The plate's penalty lets it in by 40 kPa h/(20 E), which displacements of nodes do not hold.
    """
    elastomer, skin = linear(0.0), small_skin(poisson=0.0)
    area = skin.layout.area_mm2
    load = press_at_finite_strains(skin, trimesh.creation.box((60, 60, 5)), (10.0, 5.8), force_n=0.04 * area, elastomer=elastomer)
    law, _ = compression_law(elastomer)
    stretch = brentq(lambda value: -float(law.nominal_stress("uniaxial", value)) - 0.04, 0.73, 0.95)
    height = skin.layer.mesh.nodes_mm[:, 2]
    assert stretch == pytest.approx(0.8, abs=1e-3)
    assert load.displacement_mm[:, 2] == pytest.approx((stretch - 1) * height, abs=2e-6)
    assert np.abs(load.displacement_mm[:, :2]).max() < 1e-6
    assert load.total_n == pytest.approx(0.04 * area) and load.pressure_mpa == pytest.approx(0.04, rel=1e-6)
    readings = analyse(skin, [load], elastomer=elastomer, converter=CONVERTERS["paper"])
    gain = readings.capacitance_ff[0] / readings.at_rest_ff
    assert gain == pytest.approx(1 / stretch, rel=0.05)  # the field's fringe at gap and guard does not scale
    assert readings.remarks == [] or all("coarse" not in remark for remark in readings.remarks)


def test_a_small_force_gives_what_small_strains_give():
    """A ball on a linear elastomer, 1.2 % of strain: second order in it, and nodes that touch against points that touch."""
    elastomer, skin = linear(0.3), small_skin(poisson=0.3, spacing_mm=1.0, layers=3)
    ball = trimesh.creation.icosphere(subdivisions=5, radius=20.0)
    small = contact_load(skin, ball, (10.0, 5.5), force_n=0.02, elastomer=elastomer)
    finite = press_at_finite_strains(skin, ball, (10.0, 5.5), force_n=0.02, elastomer=elastomer)
    expected = skin.layer.displacement(small, young_mpa=0.2)[:, 2].min()
    assert finite.displacement_mm[:, 2].min() == pytest.approx(expected, rel=0.05)


def test_finite_strains_are_for_objects_and_friction_is_for_finite_strains():
    for keys, sentence in (
        ({"diameter_mm": 6, "pressure_kpa": 40, "strains": "finite"}, "strains: finite is for a mesh that presses"),
        ({"mesh": "ball.stl", "force_n": 1, "friction": 0.5}, "friction is for strains: finite"),
    ):
        with pytest.raises(ValidationError, match=sentence):
            LoadChoice(name="one", at_taxel=1, **keys)


@pytest.mark.parametrize("pressure_mpa", [1e-4, 1.0])
def test_a_load_at_finite_strains_has_no_secant_modulus_whatever_its_pressure(pressure_mpa):
    """Below the tests the modulus is held, with a remark; beyond twice their largest stress it is refused."""
    skin = small_skin()
    load = Load(np.array([[10.0, 5.0]]), np.ones(1), pressure_mpa, "1 N", np.zeros_like(skin.layer.mesh.nodes_mm))
    readings = analyse(skin, [load], elastomer=read_elastomers()["SomaFoama"], converter=CONVERTERS["paper"])
    assert readings.remarks == [] and np.isnan(readings.young_mpa).all()
    assert readings.delta_ff == pytest.approx(0.0, abs=1e-6)


def finite_and_small(strains):
    """A design with a load for each of the strains, in the words of the report."""
    loads = [{"name": f"load {number}", "mesh": "ball.stl", "at_taxel": 1, "force_n": 1.0, "strains": one}
             for number, one in enumerate(strains)]
    return _facts(SkinDesign.model_validate({"skin": "s", "module": {"centres_mm": [[15, 9]]}, "loads": loads}))


def test_the_report_says_which_strains_are_finite_and_that_taxels_have_places_of_their_own():
    small, both, finite = (finite_and_small(strains) for strains in (["small"], ["small", "finite"], ["finite", "finite"]))
    assert "at places of their own" in small and "pitch" not in small
    assert "Small strains" in small and "finite" not in small
    assert "Small strains" in both and "of load 1 finite strains, with the law of a foam" in both
    assert "Small strains" not in finite and "Finite strains, with the law of a foam" in finite


def test_the_stages_of_a_study_say_where_the_law_is_extrapolated(monkeypatch, tmp_path):
    """The press is made up: a study presses in one job, and reads what that kept in another one."""
    def pressed(skin, *_, **__):
        still = np.zeros_like(skin.layer.mesh.nodes_mm)
        return Load(np.array([[15.0, 5.66]]), np.ones(1), 0.02, "1 N by a ball", still, indentation_mm=0.3, beyond_tests=0.2)

    monkeypatch.setattr("softtact.skin.contact.press_at_finite_strains", pressed)
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "ball.stl")
    load = {"name": "ball", "mesh": "ball.stl", "at_taxel": 7, "force_n": 1.0, "strains": "finite"}
    settings = {"mesh": {"spacing_mm": 5.0, "layers": 1, "field_spacing_mm": 5.0, "field_layers": 1},
                "elastomer": linear(0.3).model_dump(mode="json")}
    press_object(inputs={"mesh": tmp_path / "ball.stl"}, outputs={"load": tmp_path / "load.nc"}, settings=settings | {"load": load})
    made = {name: tmp_path / file for name, file in (("readings", "readings.nc"), ("table", "loads.csv"), ("facts", "loads.json"))}
    read_taxels(inputs={"pressed": [tmp_path / "load.nc"]}, outputs=made,
                settings=settings | {"loads": [load], "converter": dataclasses.asdict(CONVERTERS["paper"])})
    facts = read_json(made["facts"])
    assert "1 N by a ball: the law of the elastomer is extrapolated there." in facts["remarks"]
    assert facts["loads"][0]["young_mpa"] is None      # NaN is no JSON
    assert read_dataset(tmp_path / "load.nc").attrs["indentation_mm"] == 0.3


@pytest.mark.slow
def test_friction_is_balanced_under_a_cap_whose_pole_is_a_fan_of_needles_and_keeps_it_from_coming_down_as_far():
    """From the guess without friction points that stick in truth overshoot in turns, whatever the increment.

    Free points are pushed aside under the cap; the more of them friction keeps, the less it comes down, by some percent.
    """
    cap = trimesh.load(Path(__file__).resolve().parents[2] / "config/objects/indenters/sphere_m.stl")
    skin = Skin(module_layout(), thickness_mm=3.0, poisson=0.4, permittivity=1.0, mesh=LayerMeshSizes(spacing_mm=2.0, layers=2))
    ecoflex, deepest = read_elastomers()["Ecoflex 00-30"], []
    for friction in (0.0, 0.1, 0.5):
        load = press_at_finite_strains(skin, cap, (15.0, 5.66), force_n=1.0, elastomer=ecoflex, friction=friction)
        deepest.append(-load.displacement_mm[:, 2].min())
    assert deepest[0] > deepest[1] > deepest[2] > 0.95 * deepest[0]


def test_an_object_beside_the_skin_is_refused_at_finite_strains_too():
    with pytest.raises(InputError, match="lies beside the elastomer"):
        press_at_finite_strains(small_skin(), trimesh.creation.box((2, 2, 2)), (40.0, 0.0), force_n=1.0, elastomer=linear(0.3))
