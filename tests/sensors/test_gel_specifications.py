"""Sensors of plain layers without taxels, whose sides are far: what their files say, and what is refused."""

import jsonschema
import numpy as np
import pytest
import yaml

import softtact
from softtact.errors import InputError
from softtact.press.kinds import KINDS
from softtact.readout.registry import make_readout
from softtact.sensors.base import ReadoutEntry
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import read_spec, sensor_schema, spec_from_dict

GELS = ("gelsight_mini", "gelsight_wonkdim", "digit")


def values_of(name, **changes):
    return yaml.safe_load(sensor_file(name).read_text()) | changes


@pytest.mark.parametrize("name", GELS)
def test_a_shipped_gel_has_points_an_eighth_of_a_millimetre_apart_and_no_taxels(name):
    spec = read_spec(sensor_file(name))
    for line in (spec.map_x_mm, spec.map_y_mm):
        np.testing.assert_allclose(np.diff(line), 0.125, rtol=1e-12)
    assert spec.edge.far and spec.taxels is None and "taxels" not in spec.stated_readouts and "no taxels" in spec.in_words
    jsonschema.validate(values_of(name), sensor_schema())


def test_the_moduli_of_the_gels_layer_are_those_of_its_law():
    """E = 3 mu, mu = 2 C10, of an incompressible neo-Hookean law; the law's own K makes it 9 K mu / (3 K + mu), 0.7 % less."""
    sensor = softtact.load_sensor("gelsight_mini")
    law, layer = sensor.laws["dielectric"], sensor.spec.elastic_layer
    assert layer.young_mpa == pytest.approx(3 * law.mu0, rel=1e-12)
    assert 9 * law.bulk_modulus * law.mu0 / (3 * law.bulk_modulus + law.mu0) == pytest.approx(layer.young_mpa, rel=0.01)
    assert layer.poisson == pytest.approx((3 * 50 - 2) / (6 * 50 + 2), abs=1e-3)


def test_a_gel_at_rest_is_plane_without_an_object_above():
    sensor = softtact.load_sensor("digit")
    plane = KINDS["layers"].at_rest(sensor).plane
    assert plane.displacement_mm.shape == plane.traction_mpa.shape == (1, *sensor.spec.map_shape, 3)
    assert not plane.displacement_mm.any() and not plane.traction_mpa.any() and not plane.slip.any()
    assert np.isinf(plane.gap_mm).all()


def test_what_needs_taxels_refuses_a_sensor_without():
    sensor = softtact.load_sensor("digit")
    with pytest.raises(InputError, match="digit has no taxels, which the readout 'capacitance' needs; add 'taxels: {rows, "):
        make_readout("taxels", ReadoutEntry(kind="capacitance")).read(KINDS["layers"].at_rest(sensor))
    with pytest.raises(InputError, match="digit has no taxels, which a calibration needs"):
        spec_from_dict(values_of("digit", calibration={"gain": [[1.0]], "zero_counts": [[0.0]], "counts_per_relative_change": 1.0,
                                                       "source": "none"}))


def test_sides_that_are_far_are_for_plain_layers_on_a_base():
    with pytest.raises(InputError, match="at 'edge.held': 'far' is for plain layers on a base"):
        spec_from_dict(values_of("coro", edge={"held": "far"}))
    with pytest.raises(InputError, match="with support 'none' and free sides nothing holds the sensor"):
        spec_from_dict(values_of("digit", support="none"))


def test_an_assumed_number_without_a_reason_is_refused():
    layer = {"young_mpa": {"value": 0.4, "assumed": True}, "poisson": 0.49}
    with pytest.raises(InputError, match=r"'elastic_layer.young_mpa' is not usable: .*an assumed value needs a reason"):
        spec_from_dict(values_of("digit", elastic_layer=layer))


@pytest.mark.parametrize("name", ["digit", "sheet"])
@pytest.mark.parametrize("shape", [[1, 1], [1, 41]])
def test_a_map_of_a_single_point_along_a_side_is_refused(name, shape):
    with pytest.raises(InputError, match=r"at 'map_shape': \[1, .* has a side with a single point"):
        spec_from_dict(values_of(name, map_shape=shape))
