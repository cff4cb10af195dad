"""Steps that are exact in the contact: against a general minimiser, and what a factor serves for."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse as sp
import trimesh
from support.bodies import small_body

from softtact.contact.height_field import HeightField
from softtact.contact.penalty import Contact, penalty
from softtact.geometry.meshes import place
from softtact.linalg.symmetric_product import SymmetricProduct
from softtact.models.hyperelastic import newton_step
from softtact.models.hyperelastic.body import _REMEDIES, _first_remedy, _Remedy
from softtact.models.hyperelastic.newton_step import ContactFactor, ContactStepper
from softtact.models.hyperelastic.states import LinearGaps

UNKNOWNS, POINTS = 12, 8
CONTACT = Contact(stiffness=3000.0, smoothing=1 / 3000)


class DenseSolver:
    """Cholesky of numpy behind the interface of the sparse solvers; counts its solves."""

    def __init__(self):
        self.solves = 0

    def factor(self, upper):
        whole = (upper + sp.triu(upper, 1).T).toarray()
        try:
            np.linalg.cholesky(whole)
        except np.linalg.LinAlgError:
            return False
        self._inverse = np.linalg.inv(whole)
        return True

    def solve(self, right):
        self.solves += 1
        return self._inverse @ right


def dense_stepper(solver=None):
    """A stepper whose factor is new for each contact."""
    return ContactStepper(ContactFactor(solver or DenseSolver()))


class Scene:
    """A random positive definite body under a free object, its points between 2 um in the object and 2 um away."""

    def __init__(self, seed, *, stiffness=5.0):
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(UNKNOWNS, UNKNOWNS))
        self.matrix = stiffness * (np.eye(UNKNOWNS) + root @ root.T / UNKNOWNS)
        self.rows = rng.normal(size=(POINTS, UNKNOWNS))
        self.points = LinearGaps(gaps=rng.uniform(-2e-3, 2e-3, POINTS), rows=sp.csr_matrix(self.rows),
                           indentation_increment=-rng.uniform(0.7, 1, POINTS), area=rng.uniform(0.01, 0.03, POINTS),
                                 contact=CONTACT)
        self.residual, self.excess = rng.normal(scale=1e-2, size=UNKNOWNS), -0.05

    def step(self, stepper, **changes):
        arguments = {"excess": self.excess, **changes}
        return stepper.step(sp.csr_matrix(np.triu(self.matrix)), self.residual, self, **arguments)

    def rubber_forces(self, rubber, step):
        return SymmetricProduct(rubber.indptr, rubber.indices)(rubber.data, step)

    def follow(self, step, indentation_increment):
        """The object is plain: the points always face the same."""
        return False

    def energy(self, x):
        """The step's energy (mJ) over that of no step: linear and quadratic in the rubber, exact in the contact."""
        step, indentation_increment = x[:UNKNOWNS], x[UNKNOWNS]
        gaps = self.points.gaps + self.rows @ step + self.points.indentation_increment * indentation_increment
        after, before = (penalty(g, stiffness=CONTACT.stiffness, smoothing=CONTACT.smoothing)[0] for g in (gaps, self.points.gaps))
        held = self.points.pressure(0.0)      # the residual holds the contact's present forces already
        change = self.rows @ step + self.points.indentation_increment * indentation_increment
        linear = self.residual @ step + self.excess * indentation_increment + held @ change
        return linear + 0.5 * step @ self.matrix @ step + self.points.area @ (after - before)


@pytest.fixture
def exact(monkeypatch):
    """Steps solved to the last digit, where the press asks for less."""
    for name, value in (("_INNER_TOLERANCE", 1e-9), ("_FORCING", 1e-6), ("_INNER_STEPS", 60)):
        monkeypatch.setattr(newton_step, name, value)


@pytest.mark.parametrize("seed", range(5))
def test_a_step_is_the_least_energy_that_a_general_minimiser_finds(exact, seed):
    scene = Scene(seed)
    step, indentation_increment = scene.step(dense_stepper())
    found = np.append(step, indentation_increment)
    general = scipy.optimize.minimize(scene.energy, np.zeros(UNKNOWNS + 1), method="BFGS", options={"gtol": 1e-9, "maxiter": 4000})
    scale = abs(general.fun)
    assert scene.energy(found) <= general.fun + 1e-9 * scale
    assert np.abs(scipy.optimize.approx_fprime(found, scene.energy, 1e-9)).max() < 1e-4    # the differences' own rounding


@pytest.mark.parametrize("seed", range(3))
def test_an_object_that_would_go_too_far_stops_and_the_body_is_in_balance_at_that_depth(exact, seed):
    scene = Scene(seed)
    _, free = scene.step(dense_stepper())
    step, indentation_increment = scene.step(dense_stepper(), largest=0.3 * abs(free))
    assert indentation_increment == pytest.approx(0.3 * free, rel=1e-12)
    at_depth = scipy.optimize.approx_fprime(np.append(step, indentation_increment), scene.energy, 1e-9)
    assert np.abs(at_depth[:-1]).max() < 1e-4    # the differences' own rounding
    assert at_depth[-1] < -1e-2                  # N: deeper down the energy is still less


def test_a_limit_that_the_object_does_not_reach_changes_nothing():
    (step, indentation_increment), (limited, lowered) = (Scene(1).step(dense_stepper(), largest=far) for far in (np.inf, 1.0))
    assert lowered == indentation_increment and (limited == step).all()


def test_an_object_that_is_held_is_not_lowered():
    step, indentation_increment = Scene(1).step(dense_stepper(), excess=None)
    assert indentation_increment == 0.0 and np.abs(step).max() > 0


def test_a_point_that_would_fly_into_the_object_is_stopped_within_one_step(exact):
    # One unknown, pulled up by 1 N against 1 N/mm, a point 1 um under the object: Newton's tangent does not know of it.
    scene = Scene(0)
    scene.matrix, scene.rows, scene.residual = np.eye(1), np.array([[-1.0]]), np.array([-1.0])
    scene.points = LinearGaps(gaps=np.array([1e-3]), rows=sp.csr_matrix(scene.rows), indentation_increment=np.array([-1.0]),
                              area=np.array([0.02]), contact=CONTACT)
    step, _ = scene.step(dense_stepper(), excess=None)
    depth = step[0] - 1e-3
    # 1 N = step + area k (depth - t / 2): by hand, depth = (1 - 1e-3 + 60 t / 2) / 61
    assert depth == pytest.approx((1 - 1e-3 + 60 / 6000) / 61, rel=1e-6)


def test_a_free_object_that_touches_nothing_gives_nan():
    scene = Scene(2)
    scene.points = replace(scene.points, gaps=np.full(POINTS, 0.1))
    _, indentation_increment = scene.step(dense_stepper(), excess=-1.0)
    assert np.isnan(indentation_increment)


def test_a_factor_serves_the_next_step_too():
    scene, stepper = Scene(3), dense_stepper()
    scene.step(stepper)
    factors = stepper.factors
    scene.matrix = 1.02 * scene.matrix     # rubber that has stiffened a little
    scene.step(stepper)
    assert stepper.factors == factors


def test_it_takes_no_further_solve_to_see_that_a_step_is_good_enough():
    scene, solver = Scene(3), DenseSolver()
    scene.points = replace(scene.points, gaps=np.full(POINTS, 0.1))
    step, _ = scene.step(dense_stepper(solver), excess=None)
    np.testing.assert_allclose(scene.matrix @ step, -scene.residual, rtol=1e-9)
    assert solver.solves == 2     # of what the object's indentation increment does, and of the step itself


def test_a_step_with_an_old_factor_is_the_same_step(exact):
    scene, other, stepper = Scene(3), Scene(4), dense_stepper()
    new = scene.step(dense_stepper())
    other.step(stepper)
    old = scene.step(stepper)
    assert np.abs(new[0] - old[0]).max() < 1e-6 * np.abs(new[0]).max() and old[1] == pytest.approx(new[1], rel=1e-6)


def test_a_body_that_is_not_stable_has_no_step():
    scene = Scene(5)
    scene.matrix = scene.matrix - 3 * np.linalg.eigvalsh(scene.matrix)[-1] * np.eye(UNKNOWNS)
    assert scene.step(dense_stepper()) is None


class KeptFactor(ContactFactor):
    """A factor that serves on as it is."""

    def follow(self, problem, slope):
        return True


def test_no_factor_is_tried_of_a_body_whose_negative_stiffness_was_met():
    scene, stepper = Scene(5), ContactStepper(KeptFactor(DenseSolver()))
    scene.points = replace(scene.points, gaps=np.full(POINTS, 0.1))     # no contact, which would be stiffer than that
    scene.step(stepper, excess=None)
    factors = stepper.factors
    scene.matrix = -scene.matrix
    assert scene.step(stepper, excess=None) is None and stepper.factors == factors


def test_a_symmetric_matrix_times_a_vector_is_found_from_its_upper_triangle():
    """Nodes of three components have three rows of the same columns; the last node here is held along its last component."""
    for components in [1, 2, 3, 4]:
        rng = np.random.default_rng(7)
        graph = sp.random(20, 20, density=0.1, rng=rng) + sp.eye(20)
        half = sp.kron(graph, np.ones((components, components))).tocsr()[:-1, :-1]
        half.data = rng.normal(size=half.nnz)
        whole, x = (half + half.T).tocsr(), rng.normal(size=half.shape[0])
        upper = sp.triu(whole, format="csr")
        upper.sort_indices()
        np.testing.assert_allclose(SymmetricProduct(upper.indptr, upper.indices)(upper.data, x), whole @ x, rtol=1e-13, atol=1e-13)


class SlidingScene(Scene):
    """The same, but half the points' areas leave the object as soon as a step is taken."""

    def follow(self, step, indentation_increment):
        self.points = replace(self.points, area=np.where(np.arange(POINTS) % 2, 0.0, self.points.area))
        return True


def test_a_step_is_in_balance_with_what_the_points_face_where_it_leads(exact):
    scene = SlidingScene(6)
    before, rows, indentation_increment = scene.points.pressure(0.0), scene.points.rows, scene.points.indentation_increment
    step, down = scene.step(dense_stepper())
    carried = scene.points.pressure(rows @ step + indentation_increment * down)
    left = scene.residual + scene.matrix @ step - rows.T @ (carried - before)
    assert np.abs(left).max() < 1e-8 * np.abs(scene.residual).max()
    assert abs(scene.excess - indentation_increment @ (carried - before)) < 1e-8 * abs(scene.excess)
    assert not carried[1::2].any()


@pytest.mark.parametrize(("last", "again", "first"), [(0, False, 0), (1, False, 0), (5, False, 3), (0, True, 0), (5, True, 5)])
def test_a_damped_tangent_begins_with_what_was_enough_before_and_another_one_with_less(last, again, first):
    assert _first_remedy(last, again) == first


def test_what_makes_a_tangent_positive_grows_from_nothing_to_a_shift_that_outweighs_any_negative_mode():
    strength = [(remedy.cells + remedy.cover, remedy.shift) for remedy in _REMEDIES]
    assert strength[0] == (0.0, 0.0) and strength[-1][1] > 1e6
    assert all(after[1] > before[1] or after[0] > 0 for before, after in pairwise(strength))


def test_a_tangent_is_of_its_own_state_whatever_was_asked_before():
    """Several tangents of one step share what the cover adds; that of another state, or made positive, is another one."""
    body, rng = small_body(), np.random.default_rng(4)
    surface = HeightField(place(trimesh.creation.icosphere(subdivisions=2, radius=4.0), pose=None))
    slab, support = body.rest()
    states = [body.evaluate(moved, support, -1.0, body.slab.project(moved, surface)).slab for moved in
              (slab + rng.normal(scale=0.02, size=slab.shape) * (body.slab.points[:, 2:] > -1.0) for _ in range(2))]
    cells = [np.zeros_like(outer) for outer in body.cells.outer]
    asked = [(0, False), (0, True), (1, True), (1, False), (0, False)]
    first = {}
    for which, positive in asked:
        values = body.slab.rubber_tangent(states[which], cells, positive=positive).data.copy()
        assert (values == first.setdefault((which, positive), values)).all()
    assert len({values.tobytes() for values in first.values()}) == 4
    body.close()


def test_a_body_whose_tangent_is_not_positive_definite_is_given_one_that_is():
    """Nodes of the cover displaced at random: its elements are indefinite, and so is the whole."""
    body, rng = small_body(), np.random.default_rng(3)
    slab, support = body.rest()
    slab += rng.normal(scale=0.02, size=slab.shape) * (body.slab.points[:, 2:] > -1.0)
    surface = HeightField(place(trimesh.creation.icosphere(subdivisions=2, radius=4.0), pose=None))
    state = body.evaluate(slab, support, -1.0, body.slab.project(slab, surface))
    body.cells.refresh(state)
    least = [np.linalg.eigvalsh((upper + sp.triu(upper, 1).T).toarray().astype(float))[0] for upper in
             (body.slab.rubber_tangent(state.slab, body.cells.positive_outer(), positive=positive).copy()
              for positive in (False, True))]
    assert least[0] < -0.01 and least[1] > -1e-3
    body.close()


def test_a_share_of_the_negative_modes_lies_between_the_tangent_and_the_one_without_them():
    body, rng = small_body(), np.random.default_rng(3)
    slab, support = body.rest()
    slab += rng.normal(scale=0.02, size=slab.shape) * (body.slab.points[:, 2:] > -1.0)
    support += rng.normal(scale=0.005, size=support.shape)
    surface = HeightField(place(trimesh.creation.icosphere(subdivisions=2, radius=4.0), pose=None))
    state = body.evaluate(slab, support, -1.0, body.slab.project(slab, surface))
    body.cells.refresh(state)
    positive = body.cells.positive_outer()
    none, quarter, whole = (body._rubber_tangent(state, _Remedy(share, share), positive).data.astype(float)
                            for share in (0.0, 0.25, 1.0))
    assert np.abs(whole - none).max() > 1.0
    np.testing.assert_allclose(quarter, none + 0.25 * (whole - none), atol=1e-5 * np.abs(whole).max())     # single precision
    of_cells = body._rubber_tangent(state, _Remedy(cells=0.25), positive).data.astype(float)
    assert np.abs(of_cells - none).max() > 1e-4 * np.abs(whole).max()
    body.close()
