"""`PressResult.gradient` against central differences of whole presses, and what it refuses.

The presses of the differences run in double precision with a tight tolerance, so that a step may be far below the distance to the
next change of the active set. Errors are in the norm over a load step's map, relative to the difference's.
"""

import pickle
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import trimesh
from support.sensors import CORO
from threadpoolctl import threadpool_info

from softtact.contact.height_field import HeightField
from softtact.contact.undersides import underside_of
from softtact.contact.unilateral import ContactSettings, press_elastic
from softtact.errors import InputError, ShellWarning
from softtact.linalg.workers import threads_of_blas
from softtact.models.elastic import compliance as elastic
from softtact.models.elastic.gradient import PressedLayer
from softtact.models.quarter_symmetry import ParityBlocks
from softtact.press import fast, gradient
from softtact.press.batch import ObjectSurface, press_batch
from softtact.press.objects import target_of
from softtact.press.sensor import Sensor
from softtact.sensors.fields import CalibrationBlock
from softtact.sensors.specification import spec_from_dict

SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (9, 9)})
FORCES = [0.5, 2.0]
POSE = np.array([0.31, -0.23, 1.1, 4.0, -3.0, 25.0])
POSE_NAMES = {"x": 0, "y": 1, "rx": 3, "ry": 4, "rz": 5}
STEPS = {"x": 1e-6, "y": 1e-6, "rz": 1e-4}     # in mm and degrees: about as large a change of the map for each, far above rounding
ARRAYS = {"tactile_map": "tactile_map", "deformation_map": "deformation_map_mm", "depth": "indentation_mm"}
TIGHT = ContactSettings(tolerance_mm=1e-12, max_iterations=200, inner_tolerance=1e-4, inner_iterations=100)
TOLERANCE = 1e-5


def ellipsoid():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    mesh.apply_scale([5.0, 3.0, 4.0])
    return mesh


def sensor_in_double(spec):
    made = elastic.elastic_compliance(spec)
    lower = None if made.lower is None else ParityBlocks(made.lower.blocks.astype(float))
    return Sensor(spec, {}, prepared_models={"elastic": replace(made, blocks=ParityBlocks(made.blocks.blocks.astype(float)),
                                                                lower=lower)})


@pytest.fixture(scope="module")
def sensor():
    return sensor_in_double(SMALL)


@pytest.fixture
def tight(monkeypatch):
    """Settle contacts in double precision."""
    monkeypatch.setattr(elastic, "press_elastic", partial(press_elastic, settings=TIGHT))


def pressed(sensor, pose=POSE, forces=FORCES, mesh=None):
    with warnings.catch_warnings(action="ignore", category=ShellWarning):
        return sensor.press(mesh or ellipsoid(), pose=pose, force_n=forces, model="elastic", label="")


def difference(press, step):
    """Central differences of the arrays of a result by a number."""
    upper, lower = press(step), press(-step)
    return {of: (getattr(upper, name) - getattr(lower, name)) / (2 * step) for of, name in ARRAYS.items()}


def blas_threads():
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def error(found, wanted):
    """Relative error of each load step in the norm over its map."""
    found, wanted = (values.reshape(len(FORCES), -1) for values in (found, wanted))
    return np.linalg.norm(found - wanted, axis=1) / np.linalg.norm(wanted, axis=1)


@pytest.mark.parametrize("name", POSE_NAMES)
def test_a_gradient_by_the_pose_is_the_difference_of_presses_nearby(sensor, tight, name):
    result, aside = pressed(sensor), np.eye(6)[POSE_NAMES[name]]
    wanted = difference(lambda by: pressed(sensor, POSE + by * aside), STEPS.get(name, 1e-5))
    for of in ARRAYS:
        assert (error(result.gradient(of, "pose")[name], wanted[of]) < TOLERANCE).all(), of


def test_a_gradient_by_the_force_is_the_difference_of_presses_nearby(sensor, tight):
    wanted = difference(lambda by: pressed(sensor, forces=np.add(FORCES, by)), 1e-6)
    for of in ARRAYS:
        assert (error(pressed(sensor).gradient(of, "force")["force"], wanted[of]) < TOLERANCE).all(), of


def test_a_gradient_by_young_is_the_difference_of_stiffer_and_softer_sensors(sensor, tight):
    wanted = difference(lambda by: pressed(stiffer(sensor, by)), 1e-6)
    for of in ARRAYS:
        assert (error(pressed(sensor).gradient(of, "young")["young"], wanted[of]) < TOLERANCE).all(), of


PLAIN = {"name": "plain", "kind": "layers", "support": "base", "footprint_mm": [7.2, 7.2], "map_shape": [9, 9],
         "force_range_n": [0, 50], "taxels": {"rows": 2, "columns": 2}, "layers": [{"material": "silicone", "thickness_mm": 2.0}],
         "elastic_layer": {"young_mpa": 0.8, "poisson": 0.4}}


@pytest.fixture
def uncached(monkeypatch):
    """Compute the compliances of thinner and thicker sensors without the user's cache."""
    monkeypatch.setattr(gradient, "cached_compliance", elastic.elastic_compliance)


@pytest.mark.parametrize("spec", [SMALL, spec_from_dict(PLAIN), spec_from_dict(PLAIN | {"support": "none"})],
                         ids=["cover", "only layer", "free below"])
def test_a_gradient_by_thickness_is_the_difference_of_thicker_and_thinner_sensors(tight, uncached, spec):
    """Differences of second order: counts of a single layer hardly depend on its thickness, and have the largest relative error."""
    def thicker(by):
        return pressed(sensor_in_double(spec.with_upper_layer(spec.upper_layer_mm + by)))

    result, wanted = thicker(0.0), difference(thicker, 0.005 * spec.upper_layer_mm)
    for of, tolerance in {"deformation_map": 5e-4, "depth": 5e-4, "tactile_map": 3e-3}.items():
        assert (error(result.gradient(of, "thickness")["thickness"], wanted[of]) < tolerance).all(), of


@pytest.mark.parametrize("changes", [{"support": "none"}, {"edge": {"held": "free"}}], ids=["free below", "free sides"])
def test_a_gradient_follows_a_layer_with_a_free_side(tight, changes):
    sensor = sensor_in_double(spec_from_dict(PLAIN | changes))
    result, wanted = pressed(sensor), difference(lambda by: pressed(sensor, POSE + by * np.eye(6)[1]), 3e-6)
    for of in ARRAYS:
        assert (error(result.gradient(of, "pose")["y"], wanted[of]) < TOLERANCE).all(), of


def test_a_gradient_follows_a_wall_between_the_surfaces_points(sensor, tight):
    wall = trimesh.creation.box((0.08, 3.0, 2.0))
    pose = np.array([0.06, 0.2, 1.0, 1.5, 0.0, 0.0])
    result, wanted = (pressed(sensor, pose, mesh=wall),
                      difference(lambda by: pressed(sensor, pose + by * np.eye(6)[3], mesh=wall), 1e-5))
    for of in ARRAYS:
        assert (error(result.gradient(of, "pose")["rx"], wanted[of]) < TOLERANCE).all(), of


def test_a_gradient_follows_a_calibrated_readout(sensor, tight):
    taxels = SMALL.taxels
    block = CalibrationBlock(gain=((1.1,) * taxels.columns,) * taxels.rows, zero_counts=((3.0,) * taxels.columns,) * taxels.rows,
                             counts_per_relative_change=900.0, noise_counts=1.0, source="a test")
    known = replace(sensor, spec=SMALL.model_copy(update={"calibration": block}))
    wanted = difference(lambda by: pressed(known, POSE + by * np.eye(6)[0]), 1e-6)
    assert (error(pressed(known).gradient("tactile_map", "pose")["x"], wanted["tactile_map"]) < TOLERANCE).all()


def stiffer(sensor, by):
    """The sensor with a Young's modulus that is larger by a number of MPa."""
    made, young = sensor.prepared_models["elastic"], SMALL.elastic_layer.young_mpa
    softer = ParityBlocks(made.blocks.blocks * young / (young + by))
    return replace(sensor, prepared_models={"elastic": replace(made, blocks=softer)})


@pytest.mark.parametrize("name", ["x", "y", "force", "young"])
def test_the_active_set_stays_within_the_margin_and_changes_beyond_it(sensor, tight, name):
    result = pressed(sensor)
    margin = result.gradient("depth", name).active_set_margin[0, 0]

    def changed(by):
        if name == "force":
            return pressed(sensor, forces=np.add(FORCES, by))
        return pressed(stiffer(sensor, by)) if name == "young" else pressed(sensor, POSE + by * np.eye(6)[POSE_NAMES[name]])

    def area(by):
        return [changed(sign * by).contact_area_mm2[0] for sign in (-1, 1)]

    assert area(0.98 * margin) == [result.contact_area_mm2[0]] * 2
    assert area(1.02 * margin) != [result.contact_area_mm2[0]] * 2


def test_the_margin_by_young_ends_where_a_point_loses_its_force_too(sensor, tight):
    """Forces and gaps change with the modulus as those of stiffer and softer layers do, and the margin is the nearest point's."""
    result, compliance, young = pressed(sensor), sensor.prepared_models["elastic"], SMALL.elastic_layer.young_mpa
    surface = underside_of(result.origin.underside.triangles, target_of(sensor, compliance.grid))
    points, contact = elastic.touch_object(compliance, surface, np.array(FORCES))
    layer, by = PressedLayer(compliance, points, contact), 1e-6 * young
    found = layer.by_young(young, layer.by_force())
    upper, lower = (elastic.press_layer(stiffer(sensor, sign * by).prepared_models["elastic"], points, FORCES).contact
                    for sign in (1, -1))
    force, gap = ((getattr(upper, name) - getattr(lower, name)) / (2 * by) for name in ("force", "gap"))
    np.testing.assert_allclose(found.force[0], force, rtol=0, atol=1e-5 * np.abs(force).max())
    touching = contact.force > 0
    nearest = (np.where(touching, contact.force, contact.gap) / np.abs(np.where(touching, force, gap))).min(axis=0)
    assert found.margin[0] == pytest.approx(nearest, rel=1e-3)


@pytest.mark.parametrize("run", [lambda sensor: pressed(sensor),
                                 lambda sensor: press_batch(sensor, ObjectSurface(ellipsoid()), [POSE], 2.0),
                                 lambda sensor: fast.press_underside(sensor, HeightField(ellipsoid()), np.array(FORCES))],
                         ids=["press", "batch", "underside"])
def test_a_contact_takes_one_thread_of_blas_and_leaves_the_others(sensor, monkeypatch, run):
    seen, contact_among = [], elastic._contact_among
    monkeypatch.setattr(elastic, "_contact_among", lambda *given: seen.append(blas_threads()) or contact_among(*given))
    with threads_of_blas(2):
        before = blas_threads()     # a library that another test loaded later keeps its own
        run(sensor)
        assert 2 in before and seen and all(one == {1} for one in seen) and blas_threads() == before


def test_a_slide_takes_one_thread_of_blas(sensor, monkeypatch):
    class Begun(Exception):
        pass

    def begin(*_, **__):
        raise Begun(blas_threads())

    monkeypatch.setattr(fast, "_moved_elastic", begin)
    with threads_of_blas(2), pytest.raises(Begun) as begun:
        sensor.press(ellipsoid(), pose=POSE, motion="fz -1; x 0.1 in 1", model="elastic", label="")
    assert begun.value.args == ({1},)


def test_a_gradient_takes_one_thread_of_blas(sensor, monkeypatch):
    seen, of_elastic, press = [], gradient._DIFFERENTIATED["elastic"], pressed(sensor)
    monkeypatch.setitem(gradient._DIFFERENTIATED, "elastic", lambda *given: seen.append(blas_threads()) or of_elastic(*given))
    with threads_of_blas(2):
        press.gradient("depth", "force")
    assert seen == [{1}]


def test_a_vector_times_the_gradient_is_the_gradient_of_the_product(sensor):
    found = pressed(sensor).gradient("tactile_map", ["pose", "force"])
    weights = np.random.default_rng(1).standard_normal(found.values.shape[:-1])
    assert found.parameters == ("x", "y", "rx", "ry", "rz", "force") and found.units == (
        "counts/mm", "counts/mm", *["counts/degree"] * 3, "counts/N")
    np.testing.assert_allclose(found.vjp(weights)[:, 5], (weights * found["force"]).sum(axis=(1, 2)))


@pytest.mark.parametrize("shape", [(), (1, 2, 2), (2, 2), (3, 2, 2, 2)])
def test_a_vector_of_another_shape_is_refused_instead_of_broadcast(shape):
    found = gradient.Gradient("tactile_map", np.ones((2, 2, 2, 1)), ("x",), ("counts/mm",), np.ones((2, 1)))
    with pytest.raises(InputError, match="vjp: the cotangent has the shape .*; give .2, 2, 2., that of tactile_map"):
        found.vjp(np.ones(shape))


def test_an_object_that_was_changed_after_its_press_is_refused(sensor):
    """Its contact is found again for the gradient."""
    mesh = ellipsoid()
    result = pressed(sensor, mesh=mesh)
    mesh.apply_scale(0.5)
    with pytest.raises(InputError, match="mesh was changed after the press"):
        result.gradient("depth", "x")


def test_a_result_refers_to_its_sensor_and_object_in_this_process_only(sensor):
    """It copies neither: many results of one object would take more memory than they hold numbers."""
    mesh = ellipsoid()
    result = pressed(sensor, mesh=mesh)
    assert result.origin.sensor is sensor and result.origin.mesh is mesh
    assert pickle.loads(pickle.dumps(result)).origin is None


@pytest.mark.parametrize(("of", "by", "sentence"), [
    ("force", "pose", "there is no quantity with a gradient 'force'"),
    ("depth", "posse", "there is no parameter with a gradient 'posse'; did you mean 'pose'"),
    (["depth"], "x", "there is no quantity with a gradient"), ("depth", [], "name at least one parameter of: pose, x"),
    ("depth", None, "name at least one parameter"),
    ("depth", ["x", "friction"], "a press with friction depends on its whole path")])
def test_unknown_names_are_refused(sensor, of, by, sentence):
    with pytest.raises(InputError, match=sentence):
        pressed(sensor).gradient(of, by)


def test_presses_without_a_settled_contact_of_known_origin_are_refused(sensor):
    result = pressed(sensor)
    for other, sentence in ((replace(result, model="hyperelastic"), "The hyperelastic model has no gradients"),
                            (replace(result, origin=None), "does not know its sensor and object"),
                            (replace(result, pad_force_n=0 * result.pad_force_n), "touches nothing of the pad"),
                            (replace(result, shell_force_n=0.1 * result.normal_force_n), "At 0.5 N the object rests on the shell")):
        with pytest.raises(InputError, match=sentence):
            other.gradient("depth", "pose")
