"""`PressBatch.gradient`: the rows of presses alone, differences of batches nearby, and presses that have none."""

import pickle
import warnings

import numpy as np
import pytest
import trimesh
from support.small_sensors import small_gel
from test_gradient import ARRAYS, POSE, SMALL, TIGHT, ellipsoid, sensor_in_double

from softtact.contact.undersides import ObjectSurface
from softtact.contact.unilateral import press_elastic
from softtact.errors import ConvergenceError, InputError, ShellWarning
from softtact.models.elastic import compliance as elastic
from softtact.models.elastic.compliance import touch_object
from softtact.press import gradient
from softtact.press.batch import press_batch
from softtact.press.sensor import Sensor, load_sensor

ELLIPSOID, BALL, PLATE = ellipsoid(), trimesh.creation.icosphere(radius=4.0), trimesh.creation.box((12.0, 2.0, 2.0))
WALL = trimesh.creation.box((0.08, 3.0, 2.0))
JOBS = [(ELLIPSOID, POSE, 2.0), (BALL, np.array([3.2, 3.2, 4, 0, 0, 0]), 0.5), (WALL, np.array([0.06, 0.2, 1.0, 1.5, 0, 0]), 1.0),
        (ELLIPSOID, POSE * [-1, 1, 1, -1, 1, 3], 5.0)]
MISSED, ON_SHELL = (BALL, np.array([50.0, 0, 0, 0, 0, 0]), 1.0), (PLATE, np.array([0.5, 0, 1, 0, 1, 0]), 20.0)
BY = ["pose", "force", "young"]


@pytest.fixture(scope="module")
def sensor():
    return sensor_in_double(SMALL)


def pressed(sensor, jobs=JOBS, aside=0.0):
    surfaces = {id(mesh): ObjectSurface(mesh) for mesh, _, _ in jobs}
    with warnings.catch_warnings(action="ignore", category=ShellWarning):
        return press_batch(sensor, [surfaces[id(mesh)] for mesh, _, _ in jobs], np.array([pose + aside for _, pose, _ in jobs]),
                           np.array([force for *_, force in jobs]))


def apart(found, wanted):
    """Distance of rows in their norm, relative to those wanted."""
    found, wanted = (values.reshape(len(wanted), -1) for values in (found, wanted))
    return np.linalg.norm(found - wanted, axis=1) / np.linalg.norm(wanted, axis=1)


@pytest.mark.parametrize("of", ARRAYS)
def test_each_row_is_the_gradient_of_the_press_alone(sensor, of):
    found = pressed(sensor).gradient(of, BY)
    for row, (mesh, pose, force) in enumerate(JOBS):
        alone = sensor.press(mesh, pose=pose, force_n=force, model="elastic", label="").gradient(of, BY)
        assert apart(found.values[[row]], alone.values) < 1e-9
        np.testing.assert_allclose(found.active_set_margin[[row]], alone.active_set_margin, rtol=1e-6)
    assert (found.parameters, found.units, found.errors) == (alone.parameters, alone.units, {})


@pytest.mark.parametrize(("name", "axis", "step"), [("x", 0, 1e-6), ("ry", 4, 1e-5)])
def test_a_gradient_is_the_difference_of_batches_nearby(sensor, monkeypatch, name, axis, step):
    monkeypatch.setattr(elastic, "press_elastic", lambda *args, **options: press_elastic(*args, **options, settings=TIGHT))
    jobs = [JOBS[0], JOBS[3]]      # the others' derivatives jump from facet to facet, or are nearly zero by x
    batch = pressed(sensor, jobs)
    upper, lower = (pressed(sensor, jobs, sign * step * np.eye(6)[axis]) for sign in (1, -1))
    for of, array in ARRAYS.items():
        wanted = (getattr(upper, array) - getattr(lower, array)) / (2 * step)
        assert (apart(batch.gradient(of, name)[name], wanted) < 1e-5).all(), of


def test_presses_without_a_gradient_say_so_and_leave_the_others(sensor):
    batch = pressed(sensor, [MISSED, JOBS[0], ON_SHELL, JOBS[1]])
    found = batch.gradient("tactile_map", ["x", "force"])
    assert list(found.errors) == [0, 2] and found.errors[0] is batch.errors[0] and batch.errors.keys() == {0}
    assert "At 20 N the object rests on the shell" in str(found.errors[2])
    assert np.isnan(found.values[[0, 2]]).all() and np.isnan(found.active_set_margin[[0, 2]]).all()
    np.testing.assert_allclose(found.values[[1, 3]], pressed(sensor, JOBS[:2]).gradient("tactile_map", ["x", "force"]).values,
                               rtol=1e-9, atol=1e-9)


def test_a_press_that_does_not_settle_again_says_so_and_leaves_the_others(sensor, monkeypatch):
    def touch_or_fail(compliance, underside, forces_n):
        if forces_n[-1] == JOBS[1][2]:
            raise ConvergenceError("not settled")
        return touch_object(compliance, underside, forces_n)

    batch = pressed(sensor, JOBS[:2])
    monkeypatch.setattr(gradient, "touch_object", touch_or_fail)
    found = batch.gradient("depth", "force")
    assert isinstance(found.errors[1], ConvergenceError) and (np.isnan(found["force"]) == [False, True]).all()


def test_a_batch_of_failures_has_a_gradient_without_numbers(sensor):
    found = pressed(sensor, [MISSED] * 2).gradient("deformation_map", "rz")
    assert list(found.errors) == [0, 1] and found.values.shape == (2, *SMALL.map_shape, 1) and np.isnan(found.values).all()


def test_poses_that_are_changed_in_place_after_the_press_do_not_count(sensor):
    """As steps of a search do."""
    poses, surface = np.array([JOBS[0][1]]), ObjectSurface(ELLIPSOID)
    batch = press_batch(sensor, surface, poses, 2.0)
    before = batch.gradient("depth").values
    poses += 0.5
    np.testing.assert_array_equal(batch.gradient("depth").values, before)


def test_an_object_without_a_pose_is_differentiated_where_it_was_pressed(sensor):
    batch = press_batch(sensor, ObjectSurface(ELLIPSOID), [None], 2.0)
    alone = sensor.press(ELLIPSOID, force_n=2.0, model="elastic", label="")
    assert apart(batch.gradient("tactile_map").values, alone.gradient("tactile_map").values) < 1e-9


def test_a_vector_for_each_press_gives_a_row_for_each(sensor):
    found = pressed(sensor, JOBS[:2]).gradient("tactile_map", ["x", "force"])
    weights = np.random.default_rng(1).standard_normal(found.values.shape[:-1])
    np.testing.assert_allclose(found.vjp(weights)[:, 1], (weights * found["force"]).sum(axis=(1, 2)))
    with pytest.raises(InputError, match=r"the cotangent has the shape \(2, 2\); give \(2, 7, 4\)"):
        found.vjp(weights[0, :2, :2])


def test_a_batch_that_cannot_be_differentiated_is_refused_in_a_sentence(sensor, tmp_path):
    batch = pressed(sensor, JOBS[:1])
    with pytest.raises(InputError, match="there is no parameter with a gradient 'posse'"):
        batch.gradient("depth", "posse")
    with pytest.raises(InputError, match="This batch does not know its sensor and objects"):
        pickle.loads(pickle.dumps(batch)).gradient("depth", "pose")
    with pytest.raises(InputError, match="or was pressed on a gel, whose presses have none"):
        pressed(load_sensor(small_gel(tmp_path)), [JOBS[1]]).gradient("depth", "pose")
    blind = Sensor(SMALL.model_copy(update={"taxels": None}), {}, prepared_models=sensor.prepared_models)
    with pytest.raises(InputError, match="has no readout 'taxels' of kind capacitance"):
        pressed(blind, JOBS[:1]).gradient("tactile_map", "x")
