"""Edges sharper than the cover's mesh: its elements fold unless they resist it and edges are rounded; what is folded is flagged."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from support.bodies import COARSE, SMALL, small_body
from support.laws import LAWS

from softtact.contact.height_field import HeightField
from softtact.contact.rounded_object import EDGE_RADIUS_MM
from softtact.errors import ConvergenceError
from softtact.fem.graded_mesh import CoverMesh
from softtact.materials.config import law_from_printed
from softtact.models.hyperelastic import newton, path
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.mesh_settings import MeshSettings, NewtonSettings
from softtact.models.hyperelastic.newton_step import ContactStepper, StepContact
from softtact.press.sensor import Sensor
from softtact.sensors.library import material_file


def press(mesh, *forces_n, quality=COARSE, laws=LAWS):
    """A press of an object where it is, by default on elements of 1.2 mm."""
    sensor = Sensor(SMALL, laws, mesh=quality, solver=NewtonSettings.draft())
    return sensor.press(mesh, pose=np.eye(4), force_n=forces_n, model="hyperelastic", label="")


def tilted_wall():
    """A wall of 0.3 mm, tilted by 20 degrees."""
    wall = trimesh.creation.box((0.3, 4.0, 5.0))
    wall.apply_transform(trimesh.transformations.rotation_matrix(np.radians(20), (1, 0, 0)))
    return wall.apply_translation([0.1, 0.2, -wall.bounds[0, 2]])


def resting_ball():
    """A ball of 4 mm radius on the surface."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    return ball.apply_translation([0.0, 0.0, -ball.bounds[0, 2]])


def test_a_load_step_with_a_folded_cover_is_flagged_though_it_converged(monkeypatch):
    monkeypatch.setattr(LayeredBody, "folds", lambda self, state: False)      # elements that do not resist
    result = press(tilted_wall(), 2.0)
    assert result.least_volume_ratio[0] < 0 and result.converged[0] and not result.within_validity[0]
    assert result.validity_reason[0].startswith("an element of the cover is folded")


def test_a_load_step_in_which_the_cover_would_fold_is_repeated_with_one_that_does_not_under_rounded_edges():
    """Meshes half and a quarter as fine come down by 1.23 and 1.26 mm; with sharp edges the draft mesh does so by 1.22 mm."""
    result = press(tilted_wall(), 2.0, quality=MeshSettings.draft())
    assert result.least_volume_ratio[0] > 0.4 and result.within_validity[0] and result.edge_radius_mm[0] == EDGE_RADIUS_MM
    assert 1.05 < result.indentation_mm[0] < 1.3


def test_a_load_step_folded_between_the_points_of_a_cover_that_resists_is_repeated_with_points_wherever_folds_are_looked_for(
        monkeypatch):
    """The first load step is taken for such a one; it and those after it have the 62 points then, and all their iterations."""
    at_corners = press(tilted_wall(), 1.0, 2.0, quality=MeshSettings.draft())
    rules, evaluate = [], LayeredBody.evaluate
    monkeypatch.setattr(LayeredBody, "folds_between", lambda self, state: self.slab.resists_folding == 1)
    monkeypatch.setattr(LayeredBody, "evaluate", lambda self, *of: rules.append(self.slab.resists_folding) or evaluate(self, *of))
    result = press(tilted_wall(), 1.0, 2.0, quality=MeshSettings.draft())
    assert rules == sorted(rules) and rules[-1] == 2 and result.steps == 2
    assert result.iterations[0] > at_corners.iterations[0] and result.least_volume_ratio.min() > 0
    assert result.indentation_mm == pytest.approx(at_corners.indentation_mm, rel=0.02)


def test_a_wall_that_slipped_between_the_points_before_edges_were_rounded_is_pressed_anew_from_first_touch():
    """At 1 N the coarse mesh of sharp edges lets it down by 1.34 mm, from where it cuts on through the cover; rounded, it rests at
    0.74 mm."""
    at_once, after = (press(tilted_wall(), *forces) for forces in ((2.0,), (1.0, 2.0)))
    assert after.edge_radius_mm.tolist() == [0.0, EDGE_RADIUS_MM] and after.indentation_mm[0] > at_once.indentation_mm[0]
    assert after.indentation_mm[1] == pytest.approx(at_once.indentation_mm[0], rel=0.02)


def test_a_load_step_folded_between_the_points_is_kept_where_none_is_found_with_more_and_the_press_goes_on(monkeypatch):
    def in_vain(*of, between=False):
        if between:
            body.resisting_folding(*of[2:0:-1], between=True)
            raise ConvergenceError("no balance")
        return reached(*of)

    body, surface, settings, reached = small_body(), HeightField(resting_ball()), NewtonSettings.draft(), path._in_increments
    start = body.resisting_folding(newton.first_touch(body, surface, settings), surface)
    monkeypatch.setattr(LayeredBody, "folds_between", lambda self, state: self.slab.resists_folding == 1)
    monkeypatch.setattr(path, "_in_increments", in_vain)
    first = path._advance(body, surface, start, 0.0, path.ByForce(0.5, 0.02), settings)
    assert first.force_n == 0.5 and body.slab.resists_folding == 1
    assert path._advance(body, surface, first.state, 0.5, path.ByForce(1.0, 0.02), settings).force_n == 1.0
    body.close()


def test_an_element_folds_between_the_points_that_resist_only_where_it_could_have_more(monkeypatch):
    body = small_body()
    state = body.evaluate(*body.rest(), 0.0, far_above(body))
    monkeypatch.setattr(CoverMesh, "least_volume_ratio", lambda self, displacement: -0.03)
    folds = []
    for resists in (0, 1, 2):
        body.slab.resist_folding(resists)
        folds.append((body.folds(state), body.folds_between(state)))
    assert folds == [(True, False), (False, True), (False, False)]
    body.close()


def test_a_wall_that_too_few_points_of_a_coarse_mesh_carry_is_flagged():
    """Sharp, it comes down by 1.99 mm on this mesh, and by 1.26 mm on a fine one."""
    result = press(tilted_wall(), 2.0)
    assert result.least_volume_ratio[0] > 0.4 and not result.within_validity[0]
    assert "fewer than 9 points" in result.validity_reason[0]


def test_a_stage_from_a_state_before_the_edges_were_rounded_begins_with_the_points_of_now():
    """As on the way to the shell, where a load step has failed after its cover folded."""
    body, surface = small_body(), HeightField(tilted_wall())
    settings = NewtonSettings.draft()
    sharp = newton.first_touch(body, surface, settings)
    body.resisting_folding(sharp, surface)
    load_step = path._advance(body, surface, sharp, 0.0, path.ByForce(0.2, 0.02), settings)
    assert len(load_step.state.slab.gaps) == len(body.slab.top.area) == 4 * len(sharp.slab.gaps)
    assert load_step.state.force == pytest.approx(0.2, abs=0.02)
    body.close()


def test_edges_stay_sharp_where_the_cover_does_not_fold():
    assert press(resting_ball(), 1.0).edge_radius_mm[0] == 0.0


def test_every_step_under_rounded_edges_lowers_the_same_potential(monkeypatch):
    """With planes that a point keeps, each new plane raises it, and Newton's method lowers it again without end."""
    steps, better = [], newton._PressOfRounded.better

    def noting(self, trial, state, residual):
        accepted = better(self, trial, state, residual)
        steps.append((self, self._potential(state), self._potential(trial), accepted))
        return accepted

    monkeypatch.setattr(newton._PressOfRounded, "better", noting)
    monkeypatch.setattr(LayeredBody, "folds", lambda self, state: not self.slab.resists_folding)     # from the start
    press(resting_ball(), 2.0)
    followed = [(reached, begun) for (run, _, reached, accepted), (next_run, begun, *_) in pairwise(steps)
                if accepted and run is next_run]
    assert len(followed) > 2
    for reached, begun in followed:
        assert begun == pytest.approx(reached, rel=1e-12)


def test_a_run_under_rounded_edges_follows_points_in_two_steps_and_goes_on_while_residuals_fall(monkeypatch):
    """Points slip around an edge one after the other: more steps that follow them are no descent, fewer iterations begin anew."""
    body, surface, followed, accepted = small_body(), HeightField(resting_ball()), [], newton._Press.accepted
    monkeypatch.setattr(newton._Press, "accepted", lambda self, *of: followed.append(self.projected) or accepted(self, *of))
    corrected, correct = [], StepContact._correct
    monkeypatch.setattr(StepContact, "_correct", lambda self, *of: corrected.append(self) or correct(self, *of))
    start = body.resisting_folding(newton.first_touch(body, surface, NewtonSettings.draft()), surface)
    followed.clear()
    hurried = replace(NewtonSettings.draft(), max_iterations=3, nearly_balanced=0.0)
    found = newton.settle(body, surface, start, 2.0, 0.002, hurried)
    assert found.state is not None and found.iterations > 3
    assert followed == [True, True, *[False] * (found.iterations - 2)]
    assert 0 < len(corrected) <= found.iterations - 2      # of those that keep their normals; not the ones that are cut
    body.close()


def test_forces_under_rounded_edges_at_most_double_and_long_runs_in_vain_leave_room_for_smaller_increments(monkeypatch):
    """Three runs that went on to 120 iterations are more than a load step's 100, and no reason to give it up."""
    body, surface, settings, forces = small_body(), HeightField(resting_ball()), NewtonSettings.draft(), []
    start = body.resisting_folding(newton.first_touch(body, surface, settings), surface)
    settle, in_vain = newton.settle, [1, 2, 3]

    def noted(body, surface, state, force, *of, **more):
        forces.append(force)
        found = settle(body, surface, state, force, *of, **more)
        return replace(found, state=None, iterations=120) if force > 1 and in_vain and in_vain.pop() else found

    monkeypatch.setattr(path, "settle", noted)
    load_step = path._advance(body, surface, start, 0.0, path.ByForce(2.0, 0.02), settings)
    assert forces[:6] == pytest.approx([0.5, 1.0, 2.0, 1.5, 1.25, 1.125]) and not in_vain
    assert load_step.force_n == 2.0 and load_step.iterations > 360
    body.close()


def test_a_cover_that_resists_folding_changes_a_map_without_folds_little(monkeypatch):
    """Their points integrate polynomials of the fifth degree: 1.7 % on elements of 1.2 mm; with Simpson's points alone 3.8 %."""
    ball = resting_ball()
    before = press(ball, 5.0)
    monkeypatch.setattr(LayeredBody, "folds", lambda self, state: not self.slab.resists_folding)     # from the start
    resisting, largest = press(ball, 5.0), before.deformation_map_mm.max()
    assert 0 < np.abs(resisting.deformation_map_mm - before.deformation_map_mm).max() < 0.025 * largest


def test_a_rough_balance_has_to_wait_twice_as_long_under_rounded_edges():
    """Points that slip around an edge leave a residual between the tolerances for tens of iterations, and then none."""
    body = small_body()
    settings = replace(NewtonSettings.draft(), rough_after=20)
    state = body.evaluate(*body.rest(), 0.0, far_above(body))
    body.most_compressed = lambda state: (0.6, "")
    between = 0.5 * settings.rough_tolerance * 20.0
    for kind, first in ((newton._Press, 20), (newton._PressOfRounded, 40)):
        problem = kind(body, plane, 20.0, newton.tolerance_at(20.0, settings), settings)
        for iterations, enough in ((first - 1, False), (first, True)):
            problem.iterations = iterations
            assert problem.balanced(state, between) == enough
    body.close()


def test_points_under_rounded_edges_are_so_stiff_that_one_augmentation_serves(monkeypatch):
    """As stiff as elsewhere, points at the wall's edge would need four of them to overlap by less than 4 um."""
    count, augmented = [], LayeredBody.augmented
    monkeypatch.setattr(LayeredBody, "augmented", lambda self, *of, **more: count.append(self) or augmented(self, *of, **more))
    result = press(tilted_wall(), 2.0, quality=MeshSettings.draft())
    assert result.penetration_mm[0] < 0.004 and len(count) < 3


def test_the_rubber_keeps_its_factor_while_contacts_under_rounded_edges_change(monkeypatch):
    """What a node's frame neglects of points ten times as stiff would be stiffer than soft rubber: 88 factors in 21 iterations."""
    steppers, step = [], ContactStepper.step
    monkeypatch.setattr(ContactStepper, "step", lambda self, *given, **named: steppers.append(self) or step(self, *given, **named))
    monkeypatch.setattr(LayeredBody, "folds", lambda self, state: not self.slab.resists_folding)     # from the start
    soft = {layer: law_from_printed(material_file(name), "ogden2") for layer, name in SMALL.materials.items()}
    result = press(resting_ball(), 2.0, 5.0, quality=MeshSettings.draft(), laws=soft)
    assert result.within_validity.all() and steppers[-1].factors < 0.6 * result.iterations.sum()


def test_a_new_press_begins_with_elements_that_do_not_resist():
    body = small_body()
    body.resisting_folding(body.evaluate(*body.rest(), 0.0, far_above(body)), plane)
    assert body.slab.resists_folding
    body.begin()
    assert not body.slab.resists_folding


def test_a_cover_that_is_folded_already_cannot_resist():
    body = small_body()
    slab, _ = body.rest()
    slab[body.slab.cover_mesh.top_nodes[::2], 2] -= 2.0
    state = body.evaluate(*body.rest(), 0.0, far_above(body))
    with pytest.raises(ConvergenceError, match="folded under an edge"):
        body.resisting_folding(replace(state, slab=replace(state.slab, displacement=slab)), plane)


def far_above(body):
    """The contact projection on a plane that is out of reach."""
    return body.slab.project(body.rest()[0], plane)


def plane(x, y):
    return np.full(len(x), 1e3), np.tile([0.0, 0.0, -1.0], (len(x), 1))
