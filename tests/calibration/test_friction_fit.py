"""The object's friction from presses straight down: found where it is small, and a gain's error that it would else be."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from simulated_recordings import HiddenConstants
from support.calibration import Bench, small_sensor_file

from softtact.calibration.fit import calibrate
from softtact.calibration.ladder import FRICTIONS, Presses, friction_weights
from softtact.calibration.problem import Problem
from softtact.models.hyperelastic.mesh_settings import PRESETS
from softtact.press.sensor import load_sensor

PUNCH = trimesh.creation.cylinder(radius=2.6, height=3)
BALL = trimesh.creation.icosphere(subdivisions=3, radius=3.0)


def test_what_friction_changes_is_that_of_the_two_nearest_coefficients():
    for friction in (0.0, 0.03, 0.1, 0.45, 0.6):
        weights = friction_weights(friction)
        assert sum(weights.values()) == pytest.approx(1.0)
        assert sum(share * one for one, share in weights.items()) == pytest.approx(friction)
        assert np.count_nonzero(list(weights.values())) <= 2 and set(weights) == set(FRICTIONS)


@pytest.mark.slow
def test_friction_of_an_object_comes_back_and_gains_are_nearer_with_it(tmp_path):
    """Recordings are of hyperelastic presses with a friction of 0.08 at other forces than the fit's. Measured: 0.087."""
    sensor = load_sensor(small_sensor_file(tmp_path))
    sensor.mesh, sensor.solver = (make() for make in PRESETS["draft"])
    rubbed = sensor.with_friction(0.08).spec
    drawn = HiddenConstants.drawn(sensor, seed=1)
    hidden = replace(drawn, modulus_scale=1.0, relaxation=(), relaxation_s=(), sheet_excess_mm=0 * drawn.sheet_excess_mm)
    real = Bench(Presses(replace(sensor, spec=rubbed, prepared_models={}), model="hyperelastic"), hidden)
    experiments = [real.experiment(mesh, (0, 0, 0), seed=k, file=f"press {k}.csv") for k, mesh in enumerate((PUNCH, BALL))]
    presses, off = Presses(sensor, model="hyperelastic"), {}
    for fitted in ((), ("friction",)):
        found = calibrate(Problem(presses, experiments, fitted), label="")
        off[fitted] = np.abs(found.linear.gain / hidden.effective_gain(sensor) - 1).max()
    assert found.problem.value(found.vector, "friction", 0.0) == pytest.approx(0.08, abs=0.02)
    assert off[("friction",)] < 0.02 < off[()]
    assert 0.9 < found.misfit < 1.2
