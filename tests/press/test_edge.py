"""Objects wider than the pad: closed forms on free sides, the shell's share, and that all models agree."""

import numpy as np
import pytest
import trimesh
from support.bodies import COARSE, SMALL
from support.laws import LAWS

from softtact.errors import InputError, ShellWarning
from softtact.materials.laws.registry import make_law
from softtact.press.result import read_press
from softtact.press.sensor import Sensor, load_sensor
from softtact.sensors.fields import Edge, SidesBelow
from softtact.sensors.frusta import SensorSpec
from softtact.sensors.layers import LayersSpec

PLATE = trimesh.creation.box((30.0, 30.0, 2.0))


def with_edge(held, **changes):
    return Sensor(SMALL.model_copy(update={"edge": Edge(held=held), **changes}), LAWS, mesh=COARSE)


@pytest.mark.parametrize("model", ["elastic", "hyperelastic"])
def test_a_plate_over_a_whole_free_pad_compresses_it_as_hookes_law_says(model):
    """Poisson's ratio 0: nothing moves sideways, so bonding at the base changes nothing and F = E A d / h, uniform.

    Tolerance: at a strain of 0.4 % the law's second order is about as much; the elastic model is linear, in single precision.
    """
    sheet = load_sensor("sheet")
    young = 0.6
    spec = sheet.spec.model_copy(update={"footprint_mm": (6.0, 4.0), "map_shape": (9, 13), "element_mm": 1.0, "elastic_layer":
                                         sheet.spec.elastic_layer.model_copy(update={"young_mpa": young, "poisson": 0.0})})
    law = make_law("neo_hooke", {"c10": young / 4}, bulk_modulus=young / 3)     # mu = E / 2, K = E / 3
    result = Sensor(spec, {"dielectric": law}).press(PLATE, force_n=[0.03], model=model, label="")
    depth = 0.03 * 2.0 / (young * 24.0)
    assert result.indentation_mm[0] == pytest.approx(depth, rel=1e-5 if model == "elastic" else 8e-3)
    assert result.contact_area_mm2[0] == pytest.approx(24.0, rel=1e-6)
    np.testing.assert_allclose(result.deformation_map_mm[0], depth, rtol=1e-4 if model == "elastic" else 0.02)


@pytest.mark.parametrize("model", ["elastic", "hyperelastic"])
def test_a_plate_wider_than_a_pad_whose_shell_is_flush_presses_the_shell_alone(model):
    with pytest.warns(ShellWarning, match=r"At 1 N the object rests on the shell .* carries 0 N"):
        result = with_edge("sides").press(PLATE, force_n=[1.0, 2.0], model=model, label="")
    np.testing.assert_array_equal(result.shell_force_n, [1.0, 2.0])
    np.testing.assert_array_equal(result.pad_force_n, 0.0)
    assert not result.deformation_map_mm.any() and not result.indentation_mm.any() and result.within_validity.all()
    np.testing.assert_array_equal(result.force_n[:, 2], [-1.0, -2.0])
    assert np.isnan(result.torque_nmm).all()


def test_an_object_on_the_shell_that_no_point_of_the_pad_beside_it_carries_is_flagged():
    """Its border overlaps the pad's by 0.01 mm, less than the outermost points are inside; 0.05 mm deep it must press the pad."""
    beside = (15.0 + 0.5 * SMALL.footprint_mm[0] - 0.01, 0.0, 1.0, 0.0, 0.0, 0.0)
    with pytest.warns(ShellWarning, match="which carries 0 N of it"):
        result = with_edge(SidesBelow(sides_below_mm=0.05)).press(PLATE, pose=beside, force_n=1.0, model="hyperelastic", label="")
    assert result.pad_force_n[0] <= 0 and result.within_validity.tolist() == [0]
    assert "fewer than 9 points of the cover" in result.validity_reason[0]


@pytest.mark.parametrize("model", ["elastic", pytest.param("hyperelastic", marks=pytest.mark.slow)])
def test_a_plate_sinks_until_it_rests_and_the_shell_carries_what_is_added(model):
    sensor = with_edge(SidesBelow(sides_below_mm=0.05))
    with pytest.warns(ShellWarning, match="sides held from 0.05 mm below the surface on"):
        result = sensor.press(PLATE, force_n=[0.2, 30.0, 40.0], model=model, label="")
    assert result.indentation_mm[0] < 0.05
    np.testing.assert_allclose(result.indentation_mm[1:], 0.05, rtol=1e-6)
    np.testing.assert_allclose(result.pad_force_n + result.shell_force_n, [0.2, 30.0, 40.0], rtol=1e-12)
    assert result.shell_force_n[0] == 0 and result.pad_force_n[1] == result.pad_force_n[2] < 30.0
    np.testing.assert_array_equal(result.deformation_map_mm[1], result.deformation_map_mm[2])
    # The same press to that force alone ends at that depth.
    alone = sensor.press(PLATE, force_n=result.pad_force_n[1] * 0.999, model=model, label="")
    assert alone.indentation_mm[0] == pytest.approx(0.05, rel=5e-3)


def test_forces_on_pad_and_shell_are_written_and_read_back(tmp_path):
    with pytest.warns(ShellWarning):
        result = with_edge("sides").press(PLATE, force_n=1.0, model="elastic", label="")
    result.write(tmp_path / "press.nc")
    again = read_press(tmp_path / "press.nc")
    assert (again.shell_force_n == 1.0).all() and again.attributes["edge"] == "sides held up to the surface"


@pytest.mark.parametrize(("edge", "message"), [
    ({"held": "side"}, "field 'edge.held' is not usable: .*write sides, free, far, or {sides_below_mm: h}"),
    ({"held": {"sides_below_mm": -1}}, "its sides_below_mm is -1; give a height in mm above 0"),
    ({"sides_below_mm": 5.0}, "5 mm is not less than the height of the layers, 2 mm"),
    ({"hold": "free"}, "at 'edge': there is no key 'hold'")])
def test_an_edge_that_makes_no_sense_is_refused_in_one_sentence(edge, message):
    values = load_sensor("coro").spec.model_dump() | {"edge": edge}
    with pytest.raises(InputError, match=message):
        SensorSpec.from_dict(values)


def test_a_sensor_that_nothing_holds_is_refused():
    values = load_sensor("sheet").spec.model_dump() | {"support": "none"}
    with pytest.raises(InputError, match="with support 'none' and free sides nothing holds the sensor"):
        LayersSpec.from_dict(values)


@pytest.mark.parametrize("short", ["free", {"held": "free"}])
def test_an_edge_may_be_written_short(short):
    spec = SensorSpec.from_dict(load_sensor("coro").spec.model_dump() | {"edge": short})
    assert np.isinf(spec.edge.held_below_mm)
