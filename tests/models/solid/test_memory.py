"""Materials that relax and soften in the solid model, against closed forms of a bar, and with the tangent's derivative."""

import numpy as np
import pytest

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.fem.structured_meshes import box
from softtact.materials.inelastic import Inelastic
from softtact.materials.laws.registry import make_law
from softtact.materials.mullins import Mullins
from softtact.materials.prony import PronySeries
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath

SERIES, SOFT = PronySeries((0.3, 0.2), (0.1, 5.0)), Mullins(1.5, 0.02, 0.1)
NEARLY_INCOMPRESSIBLE = 1e4     # K/mu; the bar's stress misses that of the incompressible one by some 1e-4
AT_ONCE = 1e-6     # s


def bar(inelastic):
    """A cube of 1 mm under uniaxial stress along z, its law, and its frame `top`."""
    law = make_law("neo_hooke", {"c10": 0.2}, bulk_over_shear=NEARLY_INCOMPRESSIBLE)
    law.inelastic = inelastic
    mesh = box((0, 0, 0), (1, 1, 1), (1, 1, 1))
    held = {"x0": "x", "y0": "y", "z0": "z"}
    return SolidBody(mesh, {mesh.regions[0]: law}, held=held, carried={"top": ((0.5, 0.5, 1.0), ["z1"], "z")}), law


def test_the_force_of_a_bar_that_is_held_relaxes_as_its_series():
    body, law = bar(Inelastic(prony=SERIES))
    motion = Motion().step(ways={"z": 0.5}, over_s=AT_ONCE).hold(1.0, steps=2).hold(20)
    for step in SolidPath(body, {"top": motion}).run():
        assert step.loads[0, 2] == pytest.approx(law.nominal_stress("uniaxial", 1.5) * SERIES.relaxation(step.time_s), rel=1e-3)


def test_a_bar_under_a_constant_load_creeps_by_the_inverse_of_its_series():
    # small strains: the relaxed one is F / 3 mu; the error of increments of half a relaxation time is 1e-3
    body, law = bar(Inelastic(prony=PronySeries(SERIES.g, SERIES.tau_s, "relaxed")))
    motion = Motion().step(loads={"z": 1e-4}, over_s=AT_ONCE).hold(0.2).hold(1.0).hold(10.0)
    for step in SolidPath(body, {"top": motion}).run():
        stretched = step.state.poses[0].translation[2]
        assert stretched / (1e-4 / (3 * law.mu0)) == pytest.approx(SERIES.creep(step.time_s), rel=2e-3)


def test_a_bar_without_durations_is_relaxed_at_each_step():
    body, law = bar(Inelastic(prony=SERIES))
    path = SolidPath(body, {"top": Motion().step(ways={"z": 0.2}).step(ways={"z": 0.3})})
    for step, stretch in zip(path.run(), (1.2, 1.5), strict=True):
        assert step.loads[0, 2] == pytest.approx(0.5 * law.nominal_stress("uniaxial", stretch), rel=1e-3)
        assert np.isnan(step.time_s)


def test_a_bar_softens_below_its_greatest_stretch_and_is_its_law_beyond():
    body, law = bar(Inelastic(mullins=SOFT))
    stretches, greatest, motion = [1.25, 1.5, 1.25, 1.0, 1.25, 1.5, 1.75], 0.0, Motion()
    for before, after in zip([1.0, *stretches], stretches, strict=False):
        motion = motion.step(ways={"z": after - before})
    for step, stretch in zip(SolidPath(body, {"top": motion}).run(), stretches, strict=True):
        energy = 0.2 * (stretch**2 + 2 / stretch - 3)
        greatest = max(greatest, energy)
        expected = law.nominal_stress("uniaxial", stretch) * SOFT.softening(energy, greatest)
        assert step.loads[0, 2] == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_the_tangent_of_a_body_that_remembers_is_the_derivative_of_its_forces():
    body, _ = bar(Inelastic(SOFT, SERIES))
    rng, step = np.random.default_rng(2), 1e-6
    states = [body.rest()]
    for _ in range(2):
        memories = body.memories_after(states[-1], 0.2)
        there = 0.05 * rng.standard_normal(body.points.shape) * body.free_components
        states.append(body.evaluate(there, states[0].poses, (), memories=memories))
    state, change = states[-1], rng.standard_normal(len(body.free))
    upper = body.tangent(state).toarray()
    product = (np.triu(upper) + np.triu(upper, 1).T) @ change
    up, down = (body.residual(body.moved(state, sign * step * change, [np.zeros(6)])) for sign in (1, -1))
    np.testing.assert_allclose(product, (up - down) / (2 * step), atol=1e-6 * np.abs(product).max())


def test_threads_and_parts_of_a_block_give_the_same_forces():
    law = make_law("neo_hooke", {"c10": 0.2}, bulk_over_shear=20)
    law.inelastic = Inelastic(SOFT, SERIES)
    mesh = box((0, 0, 0), (1, 1, 1), (8, 8, 8))     # more elements than are evaluated at once
    body = SolidBody(mesh, {mesh.regions[0]: law}, held={"z0": "xyz"})
    moved = 0.003 * np.random.default_rng(1).standard_normal(body.points.shape) * body.free_components
    state = body.evaluate(moved, (), ())
    state = body.with_histories(state, (), body.memories_after(state, 0.1))
    (_, nodes, block), memory = body.blocks[0], state.memories[0]
    whole = block.evaluate(0.5 * moved[nodes], history=memory).force
    half = slice(200, None)
    part = block.evaluate(0.5 * moved[nodes][half], half, history=memory).force
    np.testing.assert_allclose(part, whole[half], rtol=1e-12, atol=1e-15)


def test_motions_of_different_durations_are_refused():
    body, _ = bar(Inelastic(prony=SERIES))
    with pytest.raises(InputError, match="The durations .* do not fit 1 steps; give seconds above 0"):
        SolidPath(body, {"top": Motion().step(ways={"z": 0.1})}, seconds=[1.0, 2.0])
    with pytest.raises(InputError, match="take different times; give the same durations"):
        SolidPath(body, {"top": Motion().step(ways={"z": 0.1}, over_s=1.0)}, seconds=[2.0])
