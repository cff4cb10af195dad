"""Sliding on an elastic layer: full stick, Cattaneo and Mindlin, gross sliding, frictional work.

Cattaneo and Mindlin take pressure and traction as independent, which they are where nu = 1/2; nu = 0.4999 here. The layer is a
block of half-width and depth L under a contact of radius a, as for Hertz in `test_indentation`: a force moves a point of its top by
kappa Q / (G L) less than on a half-space, all alike under the contact, which two sizes tell (Richardson).
"""


import numpy as np
import pytest
from slabs import flat_punch, paraboloid
from support.sensors import CORO
from thick_layer import thick_layer

from softtact.contact.coulomb import CoulombSettings
from softtact.contact.motion import Motion
from softtact.models.elastic.sliding import SlidingObject, steps_on_layer
from softtact.models.elastic.tangential import surface_compliance

pytestmark = pytest.mark.slow     # the compliance of two thick layers

SHEAR, POISSON, A, RADIUS, FRICTION = 1.0, 0.4999, 1.0, 100.0, 0.3
FORCE = 4 * 2 * SHEAR * (1 + POISSON) / (1 - POISSON**2) * A**3 / (3 * RADIUS)      # Hertz's for the radius A
LIMIT = FRICTION * FORCE
TO_SLIDE = 3 * LIMIT * (2 - POISSON) / (16 * SHEAR * A)                           # mm, where the stick radius is 0
MINDLIN = "Mindlin; Johnson, Contact Mechanics, sec. 7.2"
SIZES = (8.0, 16.0)      # of L over A
SMALL = 0.02             # share of the limit at which all but a thin ring sticks
SHARES = (SMALL, 0.3, 0.5, 0.7, 0.9)
FINE = CoulombSettings(tolerance_mm=1e-10)       # the surface moves aside by 1e-3 mm here


def way_of(share):
    """Mindlin's tangential way (mm) of a share of the limiting force."""
    return TO_SLIDE * (1 - (1 - share) ** (2 / 3))


def radius_of(grid, weight):
    """Radius of a Hertzian distribution, from its second moment: of nodal forces (n,); no count of nodes at an edge."""
    return np.sqrt(2.5 * (weight @ (grid.points**2).sum(axis=1)) / weight.sum())


class Ball:
    """A ball on a thick layer that carries FORCE, and is moved aside to given places."""

    def __init__(self, far):
        self.surface = thick_layer(A, far * A, cells=4, shear=SHEAR, poisson=POISSON)
        self.object = SlidingObject(self.surface, paraboloid(RADIUS), first_touch_mm=0.0, friction=FRICTION, deepest_mm=far * A,
                                    settings=FINE)
        self.pressed = self.object.advance(self.object.start, np.zeros(2), load=FORCE)

    def to(self, state, x):
        return self.object.advance(state, np.array([x - state.position[0], 0.0]), load=FORCE)

    def along(self, places):
        states = [self.pressed]
        for x in places:
            states.append(self.to(states[-1], x))
        return states[1:]


@pytest.fixture(scope="module")
def balls():
    return [Ball(far) for far in SIZES]


@pytest.fixture(scope="module")
def partial_slip(balls):
    """For each size the states at Mindlin's ways of SHARES."""
    return [ball.along([way_of(share) for share in SHARES]) for ball in balls]


def test_the_tangential_stiffness_of_a_stuck_ball_is_mindlins(partial_slip, record):
    expected = (2 - POISSON) / (8 * SHEAR * A)
    small, large = (states[0].position[0] / states[0].force_n[0] for states in partial_slip)
    assert small < large < expected                      # held sides and base only stiffen
    # what is left of a/L, cells of a/4 and the thin ring that slips already at 2 %
    got = 2 * large - small
    assert record("thick layer, tangential compliance of a ball, mm/N", expected=expected, source=MINDLIN, got=got) < 0.02


def test_the_way_under_partial_slip_is_mindlins(partial_slip, record):
    """With the half-space's part that the block lacks, kappa Q / (G L), kappa being that of the stuck ball in the same block."""
    for states, far in zip(partial_slip, SIZES, strict=True):
        force = np.array([state.force_n[0] for state in states])
        lacking = way_of(force[0] / LIMIT) - states[0].position[0]
        for share, state, q in zip(SHARES[1:], states[1:], force[1:], strict=True):
            got = state.position[0] + lacking * q / force[0]
            error = record(f"thick layer L = {far:g} a: way at {share:g} of Mindlin's, mm", expected=way_of(q / LIMIT),
                           source=MINDLIN, got=got)
            assert error < 0.02


def test_the_stick_radius_is_cattaneos(partial_slip, balls, record):
    """c = a (1 - Q / mu P)^(1/3); the traction lacks a Hertzian distribution of radius c to mu p, whose second moment is taken."""
    for states, ball, far in zip(partial_slip, balls, SIZES, strict=True):
        for state in states[1:]:                         # at SMALL the ring is thinner than a cell
            lacking = FRICTION * state.normal - np.linalg.norm(state.tangential, axis=1)
            share = state.force_n[0] / LIMIT
            error = record(f"thick layer L = {far:g} a: stick radius at Q = {share:.3f} mu P, mm", source="Cattaneo; " + MINDLIN,
                           expected=A * (1 - share) ** (1 / 3), got=radius_of(ball.surface.grid, lacking))
            assert error < 0.02


def test_the_force_of_gross_sliding_is_mu_n(balls, record):
    """The surface no longer moves and all slip is along x, once the ball has slid some ways."""
    states = balls[0].along(TO_SLIDE * np.arange(1, 6))
    error = record("thick layer, gross sliding: tangential force, N", expected=LIMIT, source="Coulomb", got=states[-1].force_n[0])
    assert error < 1e-6 and not states[-1].sticks.any()


def test_a_cycle_of_partial_slip_loses_what_masings_rule_says(balls, record):
    """From Q* to -Q* and back each branch is Mindlin's curve, twice as large (Johnson, sec. 7.4)."""
    end, steps = way_of(0.8), 12
    there = end - 2 * end * np.arange(1, steps + 1) / steps
    states = balls[0].along(np.concatenate([[end], there, -there]))
    reached = states[0].force_n[0] / LIMIT
    share = np.linspace(-reached, reached, 2001)
    loading = 2 * way_of((share + reached) / 2)          # from -Q*
    expected = LIMIT * (2 * reached * loading[-1] - 2 * np.trapezoid(loading, share))
    got = states[-1].dissipated_mj - states[0].dissipated_mj
    # the slipping ring is one to four cells wide
    assert record("thick layer: work lost in a cycle of partial slip, mJ", expected=expected, source="Masing and " + MINDLIN,
                  got=got) < 0.05
    work, stored = (getattr(states[-1], name) - getattr(states[0], name) for name in ("work_mj", "stored_mj"))
    assert record("the same: work of the force less what is stored, mJ", expected=got, source="conservation of energy",
                  got=work - stored) < 0.01


def test_a_wide_bonded_layer_that_sticks_is_in_simple_shear(record):
    """tau = G delta / h far from the sides, and there the pressure of the confined layer."""
    thickness, delta = 2.0, 0.1
    layer = {"young_mpa": 1.289, "poisson": 0.1729}
    coro = CORO
    wide = coro.model_copy(update={"footprint_mm": (40.0, 40.0), "map_shape": (13, 13), "cover": coro.cover.model_copy(
        update={"thickness_mm": thickness - coro.dielectric_thickness_mm})})
    surface = surface_compliance(wide)
    mover = SlidingObject(surface, flat_punch(100.0), first_touch_mm=0.0, friction=10.0, deepest_mm=thickness)
    states = [state for state, _ in steps_on_layer(mover, Motion().press(depth_mm=delta).slide(x_mm=delta))]
    shear = layer["young_mpa"] / (2 * (1 + layer["poisson"]))
    half = surface.grid.shape[0] // 2
    middle = slice(half, half + 2)                      # a corner, two mid-sides and a centre: an element's worth
    element = 4 * np.prod(surface.grid.step)
    tau = states[-1].tangential[:, 0].reshape(surface.grid.shape)[middle, middle].sum() / element
    pressure = states[0].normal.reshape(surface.grid.shape)[middle, middle].sum() / element
    # the sides are 10 thicknesses away; forces are in single precision
    error = record("wide bonded layer, full stick: tau, MPa", expected=shear * delta / thickness, source="G delta / h", got=tau)
    assert error < 0.01
    assert record("the same, pressed: pressure, MPa", expected=surface.foundation_modulus * delta, source="confined modulus",
                  got=pressure) < 0.01
