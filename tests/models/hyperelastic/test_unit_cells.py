"""Steps of single cells: cut where they go too far on their own, damped where a soft mode throws them; always downhill."""

import numpy as np
import pytest
from support import six_frusta

from softtact.models.hyperelastic import newton_step

DEPTH_MM = 0.05


@pytest.fixture
def body():
    return six_frusta.six_frusta()


def bent(body, *, by):
    """The body under a plate held at DEPTH_MM, the first frustum bent sideways by so many mm in its middle."""
    return six_frusta.bent(body, by_mm={0: by}, depth_mm=DEPTH_MM)


def change_of_energy(body, state, step, share=1e-4):
    """Of the energy (mJ) by a small share of the step."""
    trial = body.evaluate(state.slab.displacement + share * step.slab, state.support.displacement + share * step.support,
                          state.indentation + share * step.indentation, step.projection)
    return trial.energy - state.energy


def farthest(step):
    """How far (f,) in mm each frustum's nodes go."""
    return np.abs(step.support.reshape(len(step.support), -1)).max(axis=1)


def test_a_cell_far_from_balance_goes_a_bounded_way_and_the_energy_falls(body, monkeypatch):
    monkeypatch.setattr(body.cells, "damp", lambda *step: False)     # damping alone would shorten the step, too
    slightly, far = (body.newton_step(bent(body, by=by), None) for by in (0.002, 0.12))
    assert farthest(far)[0] < farthest(slightly)[0] + 0.05     # the sheet's movement, and 0.05 towards its own balance
    np.testing.assert_allclose(farthest(far)[1:], farthest(slightly)[1:], rtol=0.2, atol=1e-3)     # the others go as they would
    assert change_of_energy(body, bent(body, by=0.12), far) < 0


def test_a_cell_that_moved_less_than_allowed_keeps_its_tangent(body):
    at_rest, bent_by_10_um = (bent(body, by=by) for by in (0.0, 0.01))
    assert body.cells.refresh(at_rest, kept_mm=0.03) == body.cells.count     # the first tangents are those of all
    assert body.cells.refresh(bent_by_10_um, kept_mm=0.03) == 0
    assert body.cells.refresh(bent_by_10_um, kept_mm=0.004) == 1             # only the first frustum was bent
    assert body.cells.refresh(bent_by_10_um, kept_mm=0.004) == 0


def test_cells_that_are_forgotten_get_the_tangents_of_their_place_to_the_last_digit(body):
    at_rest, bent_by_1_um = (bent(body, by=by) for by in (0.0, 0.001))
    new = six_frusta.six_frusta()
    new.cells.refresh(bent_by_1_um)
    exact = new.cells.outer
    body.cells.refresh(at_rest, kept_mm=0.03)
    body.cells._tangent_at[:] = np.inf                        # all cells stale, but for what their elements keep
    body.cells.refresh(bent_by_1_um, kept_mm=0.03)
    assert any((found != expected).any() for found, expected in zip(body.cells.outer, exact, strict=True))
    body.cells.forget()
    body.cells.refresh(bent_by_1_um, kept_mm=0.03)
    for found, expected in zip(body.cells.outer, exact, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_a_cell_that_was_thrown_too_far_is_damped_until_it_is_not(body, monkeypatch):
    monkeypatch.setattr(newton_step, "_INNER_TOLERANCE", 1e-6)     # from so deep in the plate a tenth of the forces is much
    state = bent(body, by=0.02)
    free = body.newton_step(state, None)
    thrown = np.zeros_like(free.support)
    thrown[0] = 1.0
    for _ in range(3):
        assert body.cells.damp(np.zeros_like(free.slab), thrown)
    damped = body.newton_step(state, None)
    assert farthest(damped)[0] < 0.8 * farthest(free)[0] and change_of_energy(body, state, damped) < 0
    for _ in range(4):     # steps that throw nothing take the damping off again
        last = body.newton_step(state, None)
    np.testing.assert_allclose(last.support, free.support, atol=1e-3 * farthest(free)[0])     # conjugate gradients are not exact
