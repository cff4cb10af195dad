"""Recesses of an object, into which a nearly incompressible layer bulges far above the object's depth: their points touch, too."""

import numpy as np
import pytest
import trimesh
from support.sensors import CORO

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.contact.underside import Underside
from softtact.contact.undersides import underside_of
from softtact.models.elastic.batch import press_layers
from softtact.models.elastic.compliance import elastic_compliance, press_layer, touch_object
from softtact.models.elastic.sliding import move_on_layer
from softtact.models.elastic.tangential import surface_compliance
from softtact.press.objects import target_of
from softtact.press.sensor import Sensor
from softtact.sensors.fields import Edge

RUBBER = CORO.model_copy(update={"footprint_mm": (14.0, 14.0), "map_shape": (15, 15), "edge": Edge(held="sides"),
                                 "elastic_layer": CORO.elastic_layer.model_copy(update={"poisson": 0.499})})
FORCES = np.array([10.0, 25.0])
RECESS_MM = 0.3


def recessed():
    """A cylinder of 5.5 mm on its side with the recess, 3.5 mm wide in radius, its lowest point at z = 0."""
    profile = np.array([[0, RECESS_MM], [3.5, RECESS_MM], [3.5, 0], [5.5, 0], [5.5, 4], [0, 4]])
    mesh = trimesh.creation.revolve(profile, sections=64)
    mesh.process(validate=True)
    return mesh


@pytest.fixture(scope="module")
def sensor():
    return Sensor(RUBBER, {}, prepared_models={"elastic": elastic_compliance(RUBBER)})


@pytest.fixture(scope="module")
def expected(sensor):
    """The press among all points under the object, those of the recess in contact."""
    compliance = sensor.prepared("elastic")
    points = Underside(HeightField(recessed()), compliance.grid).nodes(RUBBER.thickness_mm)
    press = press_layer(compliance, points, FORCES)
    assert (press.contact.force[points.gap > 0.5 * RECESS_MM, -1] > 0).sum() > 30
    return press


def underside(sensor):
    return underside_of(HeightField(recessed()).triangles, target_of(sensor, sensor.prepared("elastic").grid))


def test_a_layer_that_bulges_into_a_recess_carries_there_too(sensor, expected):
    """The press agrees with that among all points, and the surface penetrates the object nowhere."""
    result = sensor.press(recessed(), pose=[0, 0, 0, 0, 0, 0], force_n=FORCES, model="elastic", label="")
    np.testing.assert_allclose(result.deformation_map_mm, expected.maps, rtol=0, atol=1e-5 * expected.maps.max())
    np.testing.assert_allclose(result.indentation_mm, expected.contact.depth, rtol=0, atol=1e-6)
    compliance, below = sensor.prepared("elastic"), underside(sensor)
    points, contact = touch_object(compliance, below, FORCES)
    gap = below.height_mm + compliance.top(points, contact.force).reshape(len(FORCES), -1) - contact.depth[:, None]
    assert gap.min() > -1e-5


def test_presses_in_turn_press_once_more_where_the_surface_bulges(sensor, expected):
    press, errors = press_layers(sensor.prepared("elastic"), [underside(sensor)] * 2, np.stack([FORCES, 0.1 * FORCES]))
    assert not errors
    np.testing.assert_allclose(press.maps[:2], expected.maps, rtol=0, atol=1e-5 * expected.maps.max())
    np.testing.assert_allclose(press.contact.depth[:2], expected.contact.depth, rtol=0, atol=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_motion_finds_the_contact_in_a_recess(expected, friction):
    """At the points of the map the surface penetrates the object nowhere; without friction the press is the elastic model's."""
    found = move_on_layer(surface_compliance(RUBBER), HeightField(recessed()), Motion().press(force_n=FORCES),
                          first_touch_mm=0.0, friction=friction, deepest_mm=RUBBER.thickness_mm)
    assert found.gap_mm.min() > -1e-5
    assert found.depth_mm == pytest.approx(expected.contact.depth, abs=1e-6 if friction == 0 else 0.01)
