"""The choice of a model: the paper's rule, the error to expect, and what a result tells of it."""

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from softtact.errors import ConvergenceError, InputError
from softtact.press.choice import (
    ELASTIC_RELATIVE,
    INTERVALS,
    FoundationError,
    calibrate,
    cheapest,
    expected_errors,
    foundation_error,
    models_to_prepare,
    rms,
)
from softtact.press.sensor import load_sensor


def maps(*amplitudes):
    """A map for each amplitude: a bump of so many mm."""
    x = np.linspace(-1, 1, 9)
    return np.array(amplitudes)[:, None, None] * np.exp(-4 * (x[:, None] ** 2 + x**2))


def press(amplitudes, compression):
    return SimpleNamespace(deformation_map_mm=maps(*amplitudes), frustum_compression_mm=np.array(compression),
                           indentation_mm=np.array(amplitudes))


def test_calibration_finds_the_constants_that_errors_were_made_with():
    true = FoundationError(at_rest=0.02, growth=0.1, deep=0.3)
    compression, depth = np.linspace(0.04, 0.4, 12), np.tile([0.1, 0.2, 0.4], 4)
    relative = true(maps(*np.ones(12)), compression, depth) / rms(maps(1.0))
    found = calibrate(relative, compression, depth)
    assert (found.at_rest, found.growth, found.deep) == pytest.approx((0.02, 0.1, 0.3), rel=1e-9)


def test_the_constants_that_presses_state_their_errors_by_are_those_of_the_record():
    record = json.loads((Path(__file__).parents[2] / "benchmarks" / "results" / "expected_error.json").read_text())
    assert asdict(FoundationError()) == pytest.approx(record["coefficients"], rel=2e-3)      # given with three digits
    assert INTERVALS["foundation"] == pytest.approx(record["interval"], abs=0.006)
    assert INTERVALS["elastic"] == pytest.approx(record["elastic_interval"], abs=0.006)
    alone = record["elastic_relative"]
    assert ELASTIC_RELATIVE == pytest.approx(alone[2], abs=0.006)
    assert INTERVALS["elastic alone"] == pytest.approx([alone[0] / alone[2], alone[4] / alone[2]], abs=0.02)


def test_no_error_is_told_where_frusta_are_compressed_beyond_half_of_their_height():
    foundation = press([0.1, 0.1, 0.1], [0.1, 0.29, 0.31])
    told = foundation_error(foundation, height_mm=0.6, thickness_mm=2.5, model=FoundationError(at_rest=0.0, growth=1.0, deep=0.0))
    assert np.isfinite(told[:2]).all() and np.isinf(told[2])
    assert told[1] / told[0] == pytest.approx(2.9**3) and told[0] == pytest.approx((0.1 / 0.6) ** 3 * rms(maps(0.1)).item())


def test_an_error_grows_with_the_cube_of_the_compression_and_the_square_of_the_depth():
    grown = FoundationError(at_rest=0.0, growth=1.0, deep=0.0)(maps(1.0, 1.0), np.array([0.1, 0.3]))
    assert grown[1] / grown[0] == pytest.approx(27.0)
    deeper = FoundationError(at_rest=0.0, growth=0.0, deep=1.0)(maps(1.0, 1.0), np.zeros(2), np.array([0.1, 0.3]))
    assert deeper[1] / deeper[0] == pytest.approx(9.0)


def test_constants_never_promise_less_than_no_error():
    compression = np.linspace(0.04, 0.4, 12)
    found = calibrate(0.05 - 0.1 * compression, compression)
    assert found.growth == 0.0 and found.at_rest > 0


def test_the_elastic_models_error_is_what_the_cheap_models_disagree_by():
    errors = expected_errors(press([0.3], [0.1]), press([0.2], [0.1]), height_mm=0.5, thickness_mm=2.5,
                             model=FoundationError(0.0, 0.0, 0.0))
    assert errors["foundation"] == pytest.approx([0.0])
    assert errors["elastic"] == pytest.approx(rms(maps(0.1)))


@pytest.mark.parametrize(("tolerance", "model"), [(0.2, "elastic"), (0.05, "foundation"), (0.001, "hyperelastic")])
def test_the_cheapest_model_within_the_tolerance_is_taken(tolerance, model):
    errors = {"elastic": np.array([0.05, 0.1]), "foundation": np.array([0.001, 0.004])}
    assert cheapest(errors, tolerance) == model


def test_beyond_the_presses_it_is_known_of_no_error_is_promised():
    errors = expected_errors(press([0.3], [0.3]), press([0.3], [0.3]), height_mm=0.5, thickness_mm=2.5)
    assert np.isinf(errors["foundation"]).all() and cheapest(errors, 10.0) == "hyperelastic"


def test_a_policy_or_tolerance_that_makes_no_sense_is_refused():
    sensor, ball = load_sensor("coro"), trimesh.creation.icosphere(radius=5.0)
    with pytest.raises(InputError, match="policy 'cheap' is unknown"):
        sensor.press(ball, force_n=1.0, policy="cheap")
    with pytest.raises(InputError, match="tolerance -1 mm is not positive"):
        sensor.press(ball, force_n=1.0, policy="error", tolerance_mm=-1.0)


@pytest.mark.parametrize(("seconds", "fast"), [(130.0, ()), (110.0, ("elastic", "foundation"))])
def test_no_preparation_of_more_than_two_minutes_is_begun_unasked(seconds, fast, monkeypatch):
    sensor, pressed = load_sensor("coro"), []

    def failing(name, *_):
        pressed.append(name)
        raise ConvergenceError("a stub")      # falls through to the next model

    monkeypatch.setattr("softtact.press.sensor.seconds_to_prepare_foundation", lambda spec, laws: seconds)
    monkeypatch.setattr("softtact.press.choice.PRESSES", {name: partial(failing, name) for name in
                                                          ("elastic", "foundation", "hyperelastic")})
    with pytest.raises(ConvergenceError):
        sensor.press(trimesh.creation.icosphere(radius=4.0), force_n=[5.0], label="")
    assert pressed == [*fast, "hyperelastic"]
    assert models_to_prepare(sensor, policy="error") == fast


def test_many_presses_need_as_many_poses_as_meshes():
    import trimesh

    ball = trimesh.creation.icosphere(radius=5.0)
    with pytest.raises(InputError, match="2 meshes and 1 poses"):
        load_sensor("coro").press_many([ball, ball], [None], force_n=1.0, model="elastic")
