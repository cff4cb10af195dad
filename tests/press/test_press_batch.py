"""A batch of presses has, row by row, what each press alone has; one that fails leaves the others; warnings are counted."""

import warnings

import numpy as np
import pytest
import trimesh
from support.sensors import CORO
from support.small_sensors import small_block

from softtact.contact.undersides import ObjectSurface
from softtact.errors import ConvergenceError, InputError, ShellWarning
from softtact.models.elastic.compliance import elastic_compliance, touch_object
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


def test_a_press_is_read_as_if_it_were_alone_whatever_presses_beside_it(sensor):
    """The readout inverts by a table down to the highest point of the bulge: that of a deep pin is another one."""
    ball, pin = (BALL, (0, 0, 0, 0, 0, 0), 0.003), (trimesh.creation.cylinder(radius=0.4, height=12.0), (0, 0, 6, 0, 0, 0), 50.0)
    one, beside = (pressed(sensor, jobs) for jobs in ([ball], [ball, pin]))
    np.testing.assert_allclose(beside.thinning_map_mm[0], one.thinning_map_mm[0], rtol=0, atol=5e-9)     # else 3e-8
    several = [sensor.press_many([BALL, *others], [ball[1]] * (1 + len(others)), force_n=[0.003, 50.0], model="elastic", workers=1,
                                 label="")[0] for others in ([], [pin[0]])]
    np.testing.assert_allclose(several[1].thinning_map_mm[0], several[0].thinning_map_mm[0], rtol=0, atol=5e-9)


@pytest.mark.parametrize("side_mm", [SMALL.footprint_mm[0], 40.0])
@pytest.mark.parametrize("z_mm", [-2.0, 0.0, 2.4, 2.5, 6.0])
def test_an_object_over_the_whole_pad_is_pressed_from_any_height(sensor, side_mm, z_mm):
    """All nodes are under it, so that no height says that there is none."""
    plate = trimesh.creation.box((side_mm, side_mm, 5.0))
    batch, wanted = pressed(sensor, [(plate, (0, 0, z_mm, 0, 0, 0), 4.0)]), alone(sensor, plate, (0, 0, z_mm, 0, 0, 0), 4.0)
    assert wanted.deformation_map_mm[0].max() > 0.01
    np.testing.assert_allclose(batch.deformation_map_mm[0], wanted.deformation_map_mm[0], rtol=0, atol=SAME_MM)
    assert batch.pad_force_n[0] == pytest.approx(wanted.pad_force_n[0], rel=1e-6)


def test_a_part_just_beside_the_pad_presses_nothing_of_it(sensor):
    """A pin over the shell, 0.07 mm beside the pad's side and deeper than the ball on its middle."""
    pin = trimesh.creation.box((0.1, 0.1, 4.0)).apply_translation((3.72, 0.15, -2.2))
    ball, both = ((mesh, (0, 0, 0, 0, 0, 0), 0.5) for mesh in (BALL, trimesh.util.concatenate([BALL, pin])))
    wanted = alone(sensor, *ball).deformation_map_mm[0]
    for found in (alone(sensor, *both).deformation_map_mm[0], pressed(sensor, [both]).deformation_map_mm[0]):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=SAME_MM)


def test_a_press_that_cannot_be_made_has_its_sentence_and_leaves_the_others(sensor):
    jobs = [JOBS[0], (PUNCH, (50, 0, 1, 0, 0, 0), 4.0), (PUNCH, (0, 0, 1, np.nan, 0, 0), 4.0), (PUNCH, (0, 0, "x", 0, 0, 0), 4.0),
            JOBS[1]]
    batch = pressed(sensor, jobs)
    assert sorted(batch.errors) == [1, 2, 3] and (batch.converged == [True, False, False, False, True]).all()
    assert "misses the sensor" in batch.validity_reason[1] and "not six finite numbers" in batch.validity_reason[2]
    assert "not six numbers" in batch.validity_reason[3]
    assert not batch.deformation_map_mm[1:4].any() and not batch.within_validity[1:4].any()
    np.testing.assert_allclose(batch.deformation_map_mm[[0, 4]], pressed(sensor, JOBS[:2]).deformation_map_mm, rtol=0, atol=SAME_MM)


def test_a_press_that_does_not_settle_says_so_and_leaves_the_others(sensor, monkeypatch):
    def touch_or_fail(compliance, underside, forces_n, **options):
        if forces_n[-1] == JOBS[1][2]:
            raise ConvergenceError(f"not settled at {forces_n[-1]:g} N")
        return touch_object(compliance, underside, forces_n, **options)

    wanted = pressed(sensor, JOBS[:3])
    monkeypatch.setattr("softtact.models.elastic.batch.touch_object", touch_or_fail)
    batch = pressed(sensor, JOBS[:3])
    assert batch.errors.keys() == {1} and isinstance(batch.errors[1], ConvergenceError)
    assert "1 N" in batch.validity_reason[1] and not batch.deformation_map_mm[1].any()
    np.testing.assert_allclose(batch.deformation_map_mm[[0, 2]], wanted.deformation_map_mm[[0, 2]], rtol=0, atol=SAME_MM)


def test_a_batch_of_failures_is_a_batch(sensor):
    assert pressed(sensor, [(PUNCH, (50, 0, 1, 0, 0, 0), 4.0)] * 2).errors.keys() == {0, 1}


def test_presses_on_the_shell_are_counted_in_one_warning(sensor):
    with pytest.warns(ShellWarning, match="In 2 of 3 presses the object rests on the shell") as found:
        press_batch(sensor, ObjectSurface(PLATE), [JOBS[4][1]] * 3, np.array([0.5, 20.0, 30.0]))
    assert len(found) == 1
    with pytest.warns(ShellWarning, match="In 2 of 2 presses") as found:
        sensor.press_many(PLATE, [JOBS[4][1]] * 2, force_n=[0.5, 20.0], model="elastic", workers=1)
    assert len(found) == 1


def test_wrong_counts_forces_models_and_sensors_are_refused(sensor, tmp_path):
    surface, poses = ObjectSurface(PUNCH), [JOBS[0][1]] * 2
    with pytest.raises(InputError, match="block, a sensor of kind solid: a solid has no layers and no taxels"):
        press_batch(load_sensor(small_block(tmp_path)), surface, poses, 4.0)
    with pytest.raises(InputError, match=r"'coro' is a name; give softtact.load_sensor\('coro'\)"):
        press_batch("coro", surface, poses, 4.0)
    with pytest.raises(InputError, match="3 objects and 2 poses"):
        press_batch(sensor, [surface] * 3, poses, 4.0)
    with pytest.raises(InputError, match="3 forces and 2 poses"):
        press_batch(sensor, surface, poses, np.ones(3))
    with pytest.raises(InputError, match="The force -1 N is out of the range of coro"):
        press_batch(sensor, surface, poses, [1.0, -1.0])
    with pytest.raises(InputError, match="model='hyperelastic': a batch is pressed by the elastic or the foundation model"):
        press_batch(sensor, surface, poses, 4.0, model="hyperelastic")
    with pytest.raises(InputError, match="device=None is unknown"):
        press_batch(sensor, surface, poses, 4.0, device=None)
    with pytest.raises(InputError, match="device='cuda': only the elastic model presses on a GPU"):
        press_batch(sensor, surface, poses, 4.0, model="foundation", device="cuda")


@pytest.mark.parametrize(("surface", "poses", "force", "sentence"), [
    (ObjectSurface(PUNCH), [0.0] * 6, 4.0, "the poses are not a list of poses"),
    (ObjectSurface(PUNCH), np.zeros((2, 7)), 4.0, r"the poses have the shape \(2, 7\); give an array \(n, 6\)"),
    (ObjectSurface(PUNCH), np.zeros(6), 4.0, r"the poses have the shape \(6,\)"),
    (ObjectSurface(PUNCH), None, 4.0, "the poses are not a list of poses"),
    (ObjectSurface(PUNCH), "0,0,0,0,0,0", 4.0, "the poses are not a list of poses"),
    (ObjectSurface(PUNCH), np.zeros((2, 6)), "much", "force_n='much' is no number"),
    (ObjectSurface(PUNCH), np.zeros((2, 6)), np.ones((2, 1)), r"The forces have the shape \(2, 1\) and 2 poses"),
    (PUNCH, np.zeros((2, 6)), 4.0, "an object is a Trimesh; give ObjectSurface"),
    ([PUNCH] * 2, np.zeros((2, 6)), 4.0, "an object is a Trimesh; give ObjectSurface"),
    (None, np.zeros((2, 6)), 4.0, "an object is a NoneType; give ObjectSurface")])
def test_arguments_of_another_kind_are_refused_in_a_sentence(sensor, surface, poses, force, sentence):
    with pytest.raises(InputError, match=sentence):
        press_batch(sensor, surface, poses, force)


def changed(change):
    mesh = BALL.copy()
    change(mesh)
    return mesh


@pytest.mark.parametrize(("mesh", "sentence"), [
    (trimesh.Trimesh(), "has no facets"), (changed(trimesh.Trimesh.invert), "is inside out"),
    (changed(lambda mesh: mesh.vertices.__setitem__(0, np.nan)), "corners that are not finite")])
def test_a_mesh_that_is_no_body_is_refused_alone_and_in_a_batch(sensor, mesh, sentence):
    with pytest.raises(InputError, match=sentence):
        ObjectSurface(mesh)
    with pytest.raises(InputError, match=sentence):
        alone(sensor, mesh, (0, 0, 0, 0, 0, 0), 4.0)


def test_a_surface_of_anything_but_a_mesh_is_refused():
    with pytest.raises(InputError, match="'part.stl' is no mesh; read one with softtact.read_mesh"):
        ObjectSurface("part.stl")


def test_a_sensor_whose_lower_side_is_free_is_pressed_one_by_one_with_the_same_rows():
    stated = load_sensor("sheet").spec.model_dump() | {"support": "none", "edge": {"held": "sides"}, "footprint_mm": (7.2, 7.2),
                                                       "map_shape": (13, 13)}
    free = LayersSpec.model_validate(stated)
    sensor = Sensor(free, {}, prepared_models={"elastic": elastic_compliance(free)})
    batch = pressed(sensor, JOBS[:2])
    for row, job in enumerate(JOBS[:2]):
        np.testing.assert_array_equal(batch.thinning_map_mm[row], alone(sensor, *job).thinning_map_mm[0])
