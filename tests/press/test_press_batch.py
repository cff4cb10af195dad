"""A batch of presses has, row by row, what each press alone has; one that fails leaves the others; warnings are counted."""

import warnings

import numpy as np
import pytest
import trimesh
from support.sensors import CORO

from softtact.contact.undersides import ObjectSurface
from softtact.errors import InputError, ShellWarning
from softtact.models.elastic.compliance import elastic_compliance
from softtact.press.batch import press_batch
from softtact.press.sensor import Sensor, load_sensor
from softtact.sensors.layers import LayersSpec

SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)})
BALL, PUNCH, BOX, LOW = (trimesh.creation.icosphere(radius=4.0), trimesh.creation.cylinder(radius=1.5, height=2.0),
                         trimesh.creation.box((2, 3, 2)), trimesh.creation.cylinder(radius=1.0, height=0.3))
PLATE, WALL = trimesh.creation.box((12.0, 2.0, 2.0)), trimesh.creation.box((0.25, 4.0, 4.0))
JOBS = [(PUNCH, (0.3, 0, 1.0, 0, 0, 0), 4.0), (BALL, (0, 0, 0, 0, 0, 0), 1.0), (BOX, (0, -0.5, 1.2, 3, 0, 20), 4.0),
        (BALL, (3.2, 3.2, 4, 0, 0, 0), 2.0), (PLATE, (0.5, 0, 1, 0, 1, 0), 20.0), (WALL, (0.1, 0, 2, 0, 0, 4), 3.0),
        (LOW, (0.5, 0.5, 0, 0, 0, 0), 8.0)]
SAME_MM = 2e-6      # a press is within 1e-6 of its equations
NUMBERS = {"indentation_mm": SAME_MM, "penetration_mm": SAME_MM, "expected_error_mm": SAME_MM, "pad_force_n": 2e-4,
           "normal_force_n": 1e-12}


@pytest.fixture(scope="module")
def sensor():
    return Sensor(SMALL, {}, prepared_models={"elastic": elastic_compliance(SMALL)})


def pressed(sensor, jobs=JOBS, **options):
    surfaces = {id(mesh): ObjectSurface(mesh) for mesh, _, _ in jobs}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ShellWarning)
        return press_batch(sensor, [surfaces[id(mesh)] for mesh, _, _ in jobs], [pose for _, pose, _ in jobs],
                           np.array([force for *_, force in jobs]), **options)


def alone(sensor, mesh, pose, force):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ShellWarning)
        return sensor.press(mesh, pose=pose, force_n=force, model="elastic", label="")


def test_each_row_is_the_press_alone(sensor):
    batch = pressed(sensor)
    assert batch.converged.all() and not batch.errors
    for row, job in enumerate(JOBS):
        result = alone(sensor, *job)
        for name in ("deformation_map_mm", "thinning_map_mm"):
            np.testing.assert_allclose(getattr(batch, name)[row], getattr(result, name)[0], rtol=0, atol=SAME_MM)
        np.testing.assert_allclose(batch.tactile_map[row], result.tactile_map[0], rtol=0, atol=0.1)      # counts of 2,400
        for name, error in NUMBERS.items():
            assert getattr(batch, name)[row] == pytest.approx(getattr(result, name)[0], abs=error, nan_ok=True)
        assert batch.contact_area_mm2[row] == pytest.approx(result.contact_area_mm2[0], rel=0.02)      # a node hardly touches
        assert (bool(result.within_validity[0]), str(result.validity_reason[0])) == (
            batch.within_validity[row], batch.validity_reason[row])


def test_the_rows_cover_the_shell_a_thin_wall_and_a_buried_top(sensor):
    """The cases that a press treats apart are among those that are compared above."""
    batch = pressed(sensor)
    assert batch.pad_force_n[4] < 0.99 * batch.normal_force_n[4]
    assert "narrower than three points" in batch.validity_reason[5] and "its top is below the surface" in batch.validity_reason[6]


def test_rows_do_not_depend_on_the_others_of_their_batch(sensor, monkeypatch):
    together = pressed(sensor)
    monkeypatch.setattr("softtact.press.batch._AT_ONCE", {"cpu": 3})
    np.testing.assert_allclose(pressed(sensor).deformation_map_mm, together.deformation_map_mm, rtol=0, atol=SAME_MM)
    monkeypatch.setattr("softtact.press.batch._AT_ONCE", {"cpu": 64})
    monkeypatch.setattr("softtact.models.elastic.batch._GROUP", 2)      # rectangles of nodes for two or three presses each
    np.testing.assert_allclose(pressed(sensor).deformation_map_mm, together.deformation_map_mm, rtol=0, atol=SAME_MM)


def test_a_press_that_cannot_be_made_has_its_sentence_and_leaves_the_others(sensor):
    jobs = [JOBS[0], (PUNCH, (50, 0, 1, 0, 0, 0), 4.0), (PUNCH, (0, 0, 1, np.nan, 0, 0), 4.0), JOBS[1]]
    batch = pressed(sensor, jobs)
    assert sorted(batch.errors) == [1, 2] and (batch.converged == [True, False, False, True]).all()
    assert "misses the sensor" in batch.validity_reason[1] and "not six finite numbers" in batch.validity_reason[2]
    assert not batch.deformation_map_mm[1:3].any() and not batch.within_validity[1:3].any()
    np.testing.assert_allclose(batch.deformation_map_mm[[0, 3]], pressed(sensor, JOBS[:2]).deformation_map_mm, rtol=0, atol=SAME_MM)


def test_a_batch_of_failures_is_a_batch(sensor):
    assert pressed(sensor, [(PUNCH, (50, 0, 1, 0, 0, 0), 4.0)] * 2).errors.keys() == {0, 1}


def test_presses_on_the_shell_are_counted_in_one_warning(sensor):
    with pytest.warns(ShellWarning, match="In 2 of 3 presses the object rests on the shell") as found:
        press_batch(sensor, ObjectSurface(PLATE), [JOBS[4][1]] * 3, np.array([0.5, 20.0, 30.0]))
    assert len(found) == 1
    with pytest.warns(ShellWarning, match="In 2 of 2 presses") as found:
        sensor.press_many(PLATE, [JOBS[4][1]] * 2, force_n=[0.5, 20.0], model="elastic", workers=1)
    assert len(found) == 1


def test_wrong_counts_forces_and_models_are_refused(sensor):
    surface, poses = ObjectSurface(PUNCH), [JOBS[0][1]] * 2
    with pytest.raises(InputError, match="3 objects and 2 poses"):
        press_batch(sensor, [surface] * 3, poses, 4.0)
    with pytest.raises(InputError, match="3 forces and 2 poses"):
        press_batch(sensor, surface, poses, np.ones(3))
    with pytest.raises(InputError, match="The force -1 N is out of the range of coro"):
        press_batch(sensor, surface, poses, [1.0, -1.0])
    with pytest.raises(InputError, match="model='hyperelastic': a batch is pressed by the elastic or the foundation model"):
        press_batch(sensor, surface, poses, 4.0, model="hyperelastic")


def test_a_sensor_whose_lower_side_is_free_is_pressed_one_by_one_with_the_same_rows():
    stated = load_sensor("sheet").spec.model_dump() | {"support": "none", "edge": {"held": "sides"}, "footprint_mm": (7.2, 7.2),
                                                       "map_shape": (13, 13)}
    free = LayersSpec.model_validate(stated)
    sensor = Sensor(free, {}, prepared_models={"elastic": elastic_compliance(free)})
    batch = pressed(sensor, JOBS[:2])
    for row, job in enumerate(JOBS[:2]):
        np.testing.assert_array_equal(batch.thinning_map_mm[row], alone(sensor, *job).thinning_map_mm[0])
