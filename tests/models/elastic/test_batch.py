"""Batches of the elastic model, one press after the other and as on a GPU: a batch's contact is that of each press alone, and the
products of the GPU's surface are those of the compliance's own matrix."""

import numpy as np
import pytest
import torch
import trimesh
from support.sensors import CORO

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.underside import Underside
from softtact.contact.undersides import PosedUnderside
from softtact.contact.unilateral import active_set
from softtact.errors import ConvergenceError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.models.elastic import batch
from softtact.models.elastic.batch import BatchSettings, BatchSurface
from softtact.models.elastic.compliance import elastic_compliance

DEVICES = ["cpu", torch.device("cpu")]      # one after the other, and as on a GPU
GPU = torch.device("cpu")
FORCES = np.array([0.5, 3.0])


@pytest.fixture(scope="module", params=[(13, 13), (9, 17)])
def compliance(request):
    sides = tuple(0.6 * (count - 1) for count in request.param[::-1])
    return elastic_compliance(CORO.model_copy(update={"footprint_mm": sides, "map_shape": request.param}))


def whole(grid):
    return tuple(count // 2 + 1 for count in grid.shape)


def dense(compliance, nodes):
    places = compliance.grid.quarter(nodes)
    return compliance.blocks.between(*places, *places).astype(float)


@pytest.mark.parametrize("smaller", [0, 2])
def test_displacements_are_those_of_the_dense_compliance(compliance, smaller):
    surface = BatchSurface(compliance, GPU, tuple(count - smaller for count in whole(compliance.grid)))
    force = np.random.default_rng(1).standard_normal((len(surface.nodes), 3)) * surface.real[:, None]
    single = surface.put(force.astype(np.float32))
    everywhere = np.zeros((compliance.grid.count, 3))
    everywhere[surface.nodes[surface.real]] = force[surface.real]
    expected = (dense(compliance, np.arange(compliance.grid.count)) @ everywhere).T
    scale = np.abs(expected).max()
    np.testing.assert_allclose(surface.fields(single), expected, rtol=0, atol=1e-6 * scale)
    for product, error in ((surface.displacement, 1e-5), (surface.whole_displacement, 1e-6)):
        found = np.asarray(product(single))[surface.real].T
        np.testing.assert_allclose(found, expected[:, surface.nodes[surface.real]], rtol=0, atol=error * scale)


def test_the_preconditioner_is_the_compliances_stencil(compliance):
    surface = BatchSurface(compliance, GPU, whole(compliance.grid))
    force = np.random.default_rng(1).standard_normal((len(surface.nodes), 3)).astype(np.float32) * surface.real[:, None]
    nodes = surface.nodes[surface.real]
    expected = compliance.stencil.on(compliance.grid, nodes)(force[surface.real])
    found = np.asarray(surface.precondition(surface.put(force.astype(np.float32))))[surface.real]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def press_layers(compliance, objects, forces, **options):
    """The `LayerPress` of a batch in which all presses settle."""
    press, errors = batch.press_layers(compliance, objects, forces, **options)
    assert not errors and press.contact.settled.all()
    return press


def over(compliance, mesh, pose, *, stop_mm=np.inf):
    """A `PosedUnderside` by the functions of a press alone."""
    surface = HeightField(place(mesh, pose=Pose.from_values(pose)))
    points = Underside(surface, compliance.grid).nodes(CORO.thickness_mm)
    height = np.full(compliance.grid.count, NO_CONTACT_MM)
    height[points.nodes] = points.gap
    return PosedUnderside(height, float(points.gap.min()), stop_mm, 5.0)


def objects_over(compliance):
    """A ball, a tilted box, and a plate over a free side and a corner."""
    box, plate = trimesh.creation.box((2.0, 3.0, 2.0)), trimesh.creation.box((9.0, 9.0, 2.0))
    return [over(compliance, trimesh.creation.icosphere(radius=4.0), (0.3, -0.4, 4, 0, 0, 0)),
            over(compliance, box, (0.5, 0.2, 2, 4, 3, 30)), over(compliance, plate, (5.0, 5.0, 2, 0, 2, 10))]


@pytest.mark.parametrize("device", DEVICES)
def test_a_batch_has_the_contact_of_the_active_set_of_each_press(compliance, device):
    objects = objects_over(compliance)
    press = press_layers(compliance, objects, np.tile(FORCES, (len(objects), 1)), device=device)
    for number, one in enumerate(objects):
        nodes = np.flatnonzero(one.height_mm < NO_CONTACT_MM)
        for step, plain in enumerate(active_set(dense(compliance, nodes), one.height_mm[nodes], FORCES)):
            column = number * len(FORCES) + step
            assert press.contact.depth[column] == pytest.approx(plain.indentation, abs=1e-6)       # mm
            inner = press.fields[column] if compliance.grid.sides else press.fields[column][1:-1, 1:-1]
            np.testing.assert_allclose(inner.ravel()[nodes], plain.displacement, rtol=0, atol=1e-6)
            assert press.contact.force[:, column].sum() == pytest.approx(FORCES[step], rel=1e-6)


def test_objects_that_sink_deeper_than_on_springs_touch_beyond_the_nodes_that_were_near(compliance, monkeypatch):
    objects, forces = objects_over(compliance)[:1], np.full((1, 1), 3.0)
    expected = press_layers(compliance, objects, forces, device=GPU)
    for name, value in (("_NEAR", 0.0), ("LEAST_REACH_MM", 0.01), ("_SIDES", 50)):
        monkeypatch.setattr(f"softtact.models.elastic.batch.{name}", value)
    found = press_layers(compliance, objects, forces, device=GPU)
    np.testing.assert_allclose(found.fields, expected.fields, rtol=0, atol=2e-6)     # mm


@pytest.mark.parametrize("device", DEVICES)
def test_an_object_that_rests_on_the_shell_is_held_there_beside_presses_that_do_not(compliance, device):
    ball = trimesh.creation.icosphere(radius=4.0)
    free = over(compliance, ball, (0.3, -0.4, 4, 0, 0, 0))
    alone = press_layers(compliance, [free], np.array([[0.5, 1.0, 3.0]]), device=device).contact
    resting = PosedUnderside(free.height_mm, free.touch_mm, float(alone.depth[1]), 5.0)
    both = press_layers(compliance, [free, resting], np.array([[0.5, 3.0]] * 2), device=device).contact
    np.testing.assert_allclose(both.force.sum(axis=0), [0.5, 3.0, 0.5, 1.0], rtol=1e-4)
    np.testing.assert_allclose(both.depth, alone.depth[[0, 2, 0, 1]], rtol=0, atol=1e-6)


@pytest.mark.parametrize("device", DEVICES)
def test_an_object_on_the_shell_before_it_touches_leaves_the_layer_at_rest(compliance, device):
    ball = over(compliance, trimesh.creation.icosphere(radius=4.0), (0, 0, 4, 0, 0, 0))
    resting = PosedUnderside(ball.height_mm, ball.touch_mm, ball.touch_mm - 0.1, 5.0)
    press = press_layers(compliance, [resting], np.array([[3.0]]), device=device)
    assert not press.fields.any() and press.contact.depth[0] == ball.touch_mm - 0.1


def test_a_press_that_does_not_settle_has_an_error_and_leaves_the_others(compliance):
    objects = objects_over(compliance)
    press, errors = batch.press_layers(compliance, objects, np.full((3, 1), 3.0), device=GPU,
                                       settings=BatchSettings(max_iterations=3))
    assert errors and all("at 3 N" in str(error) for error in errors.values())
    assert list(errors) == list(np.flatnonzero(~press.contact.settled))


def test_on_the_processor_the_error_of_one_press_leaves_the_others_as_they_are(compliance, monkeypatch):
    objects, forces, touch = objects_over(compliance), np.tile(FORCES, (3, 1)), batch.touch_object
    expected = press_layers(compliance, objects, forces)

    def touch_or_fail(layer, one, forces_n, **options):
        if one is objects[1]:
            raise ConvergenceError("not at 3 N")
        return touch(layer, one, forces_n, **options)

    monkeypatch.setattr(batch, "touch_object", touch_or_fail)
    press, errors = batch.press_layers(compliance, objects, forces)
    assert list(errors) == [1] and str(errors[1]) == "not at 3 N" and not press.fields[2:4].any()
    np.testing.assert_allclose(press.fields[[0, 1, 4, 5]], expected.fields[[0, 1, 4, 5]], rtol=0, atol=1e-6)
