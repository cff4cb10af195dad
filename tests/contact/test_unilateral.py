"""Unilateral contact: the fast method against the plain one, the conditions of contact over random objects, and its load steps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from small_layer import THICKNESS, ball, flat_box, layer_compliance, placed, punch, underside

from softtact.contact.unilateral import ContactSettings, active_set, depth_on_springs, press_elastic
from softtact.errors import ConvergenceError

TOLERANCE_MM = 1e-6      # of a gap: the fast method's own criterion
FORCES = [0.3, 1.0, 3.0, 6.0]
SHAPES = {
    "sphere": placed(ball(6.0)),
    "punch": placed(punch(3.0)),
    "flat box": placed(flat_box(5.0, 3.5)),
    "tilted box": placed(flat_box(5.0, 3.5), (1, -2, 0, 8, 5, 30)),
    "tilted plate over the sides": placed(flat_box(30.0, 30.0), (0, 0, 0, 3, 0, 0)),
    "sphere near a corner": placed(ball(3.0), (4.5, 4.5, 0, 0, 0, 0)),
}


def layer_contact(mesh):
    """Compliance (c, c) and gaps (c,) of a placed mesh's points on the small layer."""
    grid, compliance = layer_compliance()
    points = underside(mesh, grid).nodes(THICKNESS)
    return compliance[np.ix_(points.nodes, points.nodes)], points.gap


# --- against the plain method ---


def assert_both_methods_agree(compliance, gap0, forces):
    fast, plain = press_elastic(compliance, gap0, forces), list(active_set(compliance, gap0, forces))
    for number, load_step in enumerate(plain):
        assert fast.depth[number] == pytest.approx(load_step.indentation, abs=TOLERANCE_MM)
        # a gap of 1e-6 mm, on depths of a millimetre, shifts forces by some 1e-6 of the whole
        assert np.abs(fast.force[:, number] - load_step.nodal_force).max() < 1e-5 * load_step.force_n


def test_the_fast_method_equals_the_plain_one_on_random_decaying_compliances():
    """exp(-r / length) is positive definite at any places (Matern's covariance), and so is it when rows are scaled."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        places = rng.uniform(0, 10, (150, 2))
        scale = np.exp(0.3 * rng.standard_normal(len(places)))
        compliance = np.outer(scale, scale) * np.exp(-cdist(places, places) / rng.uniform(0.5, 3.0))
        assert_both_methods_agree(compliance, rng.uniform(0, 2, len(places)), [0.5, 3.0, 20.0, 100.0])


def test_the_fast_method_equals_the_plain_one_on_an_elastic_layer():
    for shape in SHAPES:
        assert_both_methods_agree(*layer_contact(SHAPES[shape]), FORCES)


# --- what holds for any object ---


@st.composite
def placed_objects(draw):
    """Spheres, boxes and cylinders, tilted up to 15 degrees, standing or lying anywhere over the layer's middle."""
    size = st.floats(0.8, 8.0)
    kind = draw(st.sampled_from(["sphere", "box", "cylinder", "lying cylinder"]))
    if kind == "sphere":
        mesh = ball(draw(size))
    elif kind == "box":
        mesh = flat_box(draw(size), draw(size))
    else:
        mesh = punch(draw(size), sections=64)
    turned = 90.0 if kind == "lying cylinder" else 0.0
    tilt, place = st.floats(-15.0, 15.0), st.floats(-4.0, 4.0)
    return placed(mesh, (draw(place), draw(place), 0, turned + draw(tilt), draw(tilt), draw(st.floats(0, 90))))


@st.composite
def rising_forces(draw):
    return np.array(sorted(draw(st.lists(st.floats(0.05, 8.0), min_size=1, max_size=6, unique=True))))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(mesh=placed_objects(), forces=rising_forces())
def test_the_conditions_of_contact_hold_under_any_object(mesh, forces):
    compliance, gap0 = layer_contact(mesh)
    load_steps = press_elastic(compliance, gap0, forces)
    gap = gap0[:, None] - load_steps.depth + compliance @ load_steps.force
    assert load_steps.gap == pytest.approx(gap, abs=1e-12)          # what it states is what its forces make
    assert load_steps.penetration.max() <= TOLERANCE_MM and gap.min() >= -TOLERANCE_MM - 1e-12
    assert load_steps.force.min() >= 0
    np.testing.assert_allclose(load_steps.force.sum(axis=0), forces, rtol=1e-8)
    assert np.abs(gap[load_steps.force > 0]).max() <= TOLERANCE_MM + 1e-12      # force only where it touches


@settings(max_examples=30, deadline=None, derandomize=True)
@given(mesh=placed_objects(), forces=rising_forces())
def test_a_growing_force_never_lets_the_object_rise(mesh, forces):
    depth = press_elastic(*layer_contact(mesh), forces).depth
    assert (np.diff(depth) >= -2 * TOLERANCE_MM).all()
    assert depth[0] > 0


@settings(max_examples=30, deadline=None, derandomize=True)
@given(mesh=placed_objects(), forces=rising_forces())
def test_a_load_step_does_not_depend_on_which_others_are_asked_for(mesh, forces):
    compliance, gap0 = layer_contact(mesh)
    together = press_elastic(compliance, gap0, forces)
    for number, force in enumerate(forces):
        alone = press_elastic(compliance, gap0, [force])
        assert alone.depth[0] == pytest.approx(together.depth[number], abs=2 * TOLERANCE_MM)
        assert np.abs(alone.force[:, 0] - together.force[:, number]).max() < 2e-5 * force


def test_a_contact_of_few_points_settles_beside_load_steps_of_many():
    """Four of 1,500 random objects did not: columns solved to round-off went on until they overflowed single precision."""
    turned = (9.603615917826147, 10.616084112252889, 34.81012463210103)
    mesh = placed(flat_box(5.554685380756925, 1.4949992466991637), (-0.7781347717029305, 1.3096204431125456, 0.0, *turned))
    forces = [0.22705810378710833, 1.8914501765444083, 5.382173559677132, 7.8424460618939476]
    with np.errstate(over="raise", invalid="raise"):
        assert_both_methods_agree(*layer_contact(mesh), forces)


# --- first guess, preconditioner, refusal ---


def test_first_guess_and_preconditioner_change_the_way_and_not_the_end():
    compliance, gap0 = layer_contact(SHAPES["tilted box"])
    plain = press_elastic(compliance, gap0, FORCES)
    diagonal = 1 / np.diag(compliance)[:, None].astype(np.float32)
    other = press_elastic(compliance, gap0, FORCES, area=np.linspace(0.2, 1.0, len(gap0)), foundation_modulus=30.0,
                          precondition=lambda x: diagonal * x)
    np.testing.assert_allclose(other.depth, plain.depth, atol=2 * TOLERANCE_MM)
    assert np.abs(other.force - plain.force).max() < 2e-5 * FORCES[-1]


def test_one_point_carries_everything():
    load_steps = press_elastic(np.array([[0.5]]), np.array([0.1]), [1.0, 2.0])
    np.testing.assert_allclose(load_steps.depth, [0.6, 1.1])
    np.testing.assert_allclose(load_steps.force, [[1.0, 2.0]])


def test_a_load_step_that_does_not_settle_is_named():
    with pytest.raises(ConvergenceError, match="at 0.3 N in 1 iterations"):
        press_elastic(*layer_contact(SHAPES["sphere"]), FORCES, settings=ContactSettings(max_iterations=1))


@pytest.mark.parametrize("load", [1e-9, 0.3, 40.0, 5e4])
def test_springs_carry_exactly_the_force_at_their_depth(load):
    rng = np.random.default_rng(2)
    heights, area = np.round(rng.uniform(-2.0, 3.0, 200), 1), rng.uniform(0.1, 0.5, 200)
    depth = depth_on_springs(heights, area, load)
    assert (area * np.maximum(depth - heights, 0.0)).sum() == pytest.approx(load, rel=1e-9, abs=1e-14)
