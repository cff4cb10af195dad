"""Derivatives of the foundation model against differences of balances, which Newton's method settles in double precision."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from foundation_study import SMALL, points_of
from support.laws import LAWS

from softtact.contact.undersides import ObjectSurface
from softtact.models.foundation.compliance import foundation_compliance
from softtact.models.foundation.gradient import Balance, Rates, Tangent, Unknowns
from softtact.models.foundation.solve import settled_contacts
from softtact.models.quarter_symmetry import ParityBlocks
from softtact.press import gradient
from softtact.press.batch import press_batch
from softtact.press.sensor import Sensor

FORCE, POSE = 6.0, (0.3, -0.4, 0.0, 4.0, -3.0, 20.0)
FIELDS = ("force", "q", "depth", "loads", "lateral", "rise", "shift")
CASES = [((3.5, 3.5), 2.0, False), ((2.5, -2.5), 4.0, True)]     # place, force, and whether the frustum nearest to a change stands
TOLERANCE = 1e-5     # in the norm of each kind of unknown


def ellipsoid(subdivisions=4):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    mesh.apply_scale([5.0, 4.0, 4.5])
    return mesh


@pytest.fixture(scope="module")
def pressed(compliance):
    """The balance of an ellipsoid on the small sensor, and the gaps of its points."""
    points = points_of(ellipsoid(), compliance, POSE)
    contact = next(settled_contacts(compliance, points, [FORCE]))
    return Balance(compliance, points, contact), contact.points.gap


@pytest.fixture(scope="module")
def tangent(pressed):
    return Tangent.settled(*pressed, FORCE)


def settled(balance, gap, force_n):
    """One step of Newton's method further than a gradient needs, as small differences of balances do."""
    near = Tangent.settled(balance, gap, force_n)
    return Tangent(near.balance, near.at.plus(near.solve(near.balance.residual(near.at, gap, force_n))))


def assert_difference(rates, upper, lower, step):
    for name in FIELDS:
        wanted = (getattr(upper.at, name) - getattr(lower.at, name)) / (2 * step)
        apart = np.linalg.norm(getattr(rates.unknowns, name) - wanted)
        assert apart <= TOLERANCE * np.linalg.norm(wanted) + 1e-9, name


def test_newtons_method_settles_the_balance_quadratically_from_the_solvers_load_step(pressed, tangent):
    """So the tangent is that of the residuals, and the residuals are those of the solver."""
    balance, gap = tangent.balance, pressed[1]
    aside = tangent.at.plus(replace(balance.nothing(), lateral=np.full_like(tangent.at.lateral, 1e-4),
                                    loads=np.full_like(tangent.at.loads, 1e-3), depth=1e-3))
    sizes = []
    for _ in range(4):
        sizes.append(np.abs(balance.residual(aside, gap, FORCE).lateral).max())
        aside = aside.plus(Tangent(balance, aside).solve(balance.residual(aside, gap, FORCE)))
    assert sizes[2] < 1e-4 * sizes[0] and sizes[3] < 1e-10
    assert np.abs(tangent.at.force - pressed[0].unknowns.force).max() < 5e-3 * FORCE


def test_rates_by_the_gaps_are_differences_of_balances(pressed, tangent):
    (balance, gap), step = pressed, 1e-6
    way = np.cos(np.arange(len(gap)))
    upper, lower = (settled(balance, gap + sign * step * way, FORCE) for sign in (1, -1))
    assert_difference(tangent.by_gaps(way), upper, lower, step)


def test_rates_by_the_force_are_differences_of_balances(pressed, tangent):
    upper, lower = (settled(*pressed, FORCE + sign * 1e-5) for sign in (1, -1))
    assert_difference(tangent.by_force(), upper, lower, 1e-5)


def test_rates_by_several_numbers_at_once_are_those_by_each(tangent):
    place = np.arange(tangent.balance.nodes)
    gaps = np.stack([np.cos(place), np.zeros(len(place)), 1e-3 * np.sin(3 * place)])      # of unlike sizes
    for found, wanted in zip(tangent.by_gaps(gaps, np.array([0.0, 1.0, 0.0])).each(),
                             (tangent.by_gaps(gaps[0]), tangent.by_force(), tangent.by_gaps(gaps[2])), strict=True):
        for of, name in [(Rates, "load"), (Rates, "lateral"), *((Unknowns, name) for name in FIELDS)]:
            one, other = (getattr(rates if of is Rates else rates.unknowns, name) for rates in (found, wanted))
            assert np.linalg.norm(one - other) <= TOLERANCE * np.linalg.norm(other), name
        assert found.margin == pytest.approx(wanted.margin, rel=1e-4) and found.depth == pytest.approx(wanted.depth, rel=TOLERANCE)
        for one, other in zip(found.openings, wanted.openings, strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=TOLERANCE * np.abs(other).max())


def test_the_active_sets_stay_within_the_margin_and_change_beyond_it(pressed, tangent):
    margin = tangent.by_force().margin

    def sets(share):
        contacts = [Tangent.settled(*pressed, FORCE + sign * share * margin).balance.contact for sign in (-1, 1)]
        return [np.concatenate([one.touching, one.standing]) for one in contacts]

    now = np.concatenate([tangent.balance.contact.touching, tangent.balance.contact.standing])
    assert all((one == now).all() for one in sets(0.9)) and any((one != now).any() for one in sets(1.1))


@pytest.mark.parametrize(("place", "force_n", "stands"), CASES)
def test_the_margin_ends_where_a_frustum_leaves_or_meets_the_sheet_too(compliance, place, force_n, stands):
    """Without the patches: the distance of each frustum from its other state, over the speed of balances nearby."""
    points, step = points_of(ellipsoid(), compliance, (*place, *POSE[2:])), 1e-5
    start = next(settled_contacts(compliance, points, [force_n]))
    tangent, upper, lower = (Tangent.settled(Balance(compliance, points, start), start.points.gap, force_n + by)
                             for by in (0.0, step, -step))
    contact = tangent.balance.contact

    def distance(of):
        return np.where(contact.standing, of.at.q, -of._down.ravel() - of.at.rise)

    ahead = distance(tangent) / (np.abs(distance(upper) - distance(lower)) / (2 * step))
    frusta = Tangent(tangent.balance.of(replace(contact, possible=np.zeros_like(contact.possible))), tangent.at)
    assert contact.standing[ahead.argmin()] == stands
    assert frusta.by_force().margin == pytest.approx(ahead.min(), rel=1e-3)


def stiffer(compliance, factor):
    """The compliance of the same sensor with `factor` times all moduli."""
    law = compliance.law
    blocks = {name: ParityBlocks(getattr(compliance, name).blocks.astype(float) / factor)
              for name in ("surface", "sideways", "lateral", "lateral_self")}
    law = replace(law, force_n=factor * law.force_n, stiffness=factor * law.stiffness, upright=factor * law.upright)
    return replace(compliance, **blocks, membrane=ParityBlocks(compliance.membrane.blocks.astype(float)), law=law)


def test_rates_by_the_moduli_are_those_by_a_stiffer_compliance(compliance, pressed, tangent):
    points, contact, step = points_of(ellipsoid(), compliance, POSE), tangent.balance.contact, 1e-5
    lower, upper = (Balance(stiffer(compliance, factor), points,
                            replace(contact, contact_compliance=contact.contact_compliance / factor))
                    for factor in (1 - step, 1 + step))
    by_compliance = tangent.by_compliance(lower, upper, 2 * step, pressed[1])
    by_moduli = tangent.by_moduli(tangent.by_force())
    for name in FIELDS:
        found, wanted = (getattr(one.unknowns, name) for one in (by_compliance, by_moduli))
        assert np.linalg.norm(found - wanted) <= 1e-4 * np.linalg.norm(wanted) + 1e-9, name
    assert by_compliance.margin == pytest.approx(by_moduli.margin, rel=1e-3)


def test_rates_of_a_frustums_rise_and_stiffening_are_differences_of_them(law):
    sideways, force, rates, step = np.full(4, 0.05), np.array([1e-4, 1e-3, 0.01, 0.1]), np.array([1.0, -2.0, 0.5, 1.0]), 1e-7
    upper, lower = (law.rise(sideways + sign * step * rates, force + sign * step * 0.3) for sign in (1, -1))
    found = law.rise_rate(sideways, force, rates, np.full(4, 0.3))
    np.testing.assert_allclose(found, (upper - lower) / (2 * step), rtol=1e-6, atol=1e-9)
    assert found[0] != 0
    (_, above), (_, below) = (law.stiffening(force + sign * 1e-6) for sign in (1, -1))
    by_force = law.stiffening_rate(force) * law.slope(force)[:, None, None]
    np.testing.assert_allclose(by_force, (above - below) / 2e-6, rtol=1e-2, atol=1e-3 * np.abs(by_force).max())


@pytest.mark.parametrize(("by", "step"), [("force", 0.4), ("x", 0.15), ("ry", 1.0)])
def test_a_gradient_of_a_press_is_about_the_difference_of_presses(compliance, by, step):
    """Within 5 %: the solver's presses are settled to some micrometres only, so steps must be large."""
    sensor, mesh = Sensor(SMALL, LAWS, prepared_models={"foundation": compliance}), ellipsoid(subdivisions=6)
    mesh.apply_scale(2.5)     # no point of it counts as beside an edge
    pose = np.array([*POSE[:2], 3.0, *POSE[3:]])

    def press(by_pose=0.0, by_force=0.0):
        return sensor.press(mesh, pose=pose + by_pose, force_n=FORCE + by_force, model="foundation", label="")

    aside = {"x": np.eye(6)[0], "ry": np.eye(6)[4], "force": 0.0}[by]
    upper, lower = (press(sign * step * aside, sign * step * (by == "force")) for sign in (1, -1))
    result = press()
    for of, name in (("tactile_map", "tactile_map"), ("deformation_map", "deformation_map_mm"), ("depth", "indentation_mm")):
        found, wanted = result.gradient(of, by)[by], (getattr(upper, name) - getattr(lower, name)) / (2 * step)
        assert np.linalg.norm(found - wanted) < 0.05 * np.linalg.norm(wanted) + 2.5e-3 * (of == "depth"), of
    assert result.gradient("depth", ["young", "force"]).units == ("mm/1", "mm/N")


def test_a_flat_punch_and_a_small_ball_that_move_aside_change_their_maps_by_their_edges(compliance):
    """With the contact of points beside edges held, the punch's derivative would be zero, and the ball's 0.6 of it off.

    Within 15 %: differences by steps of 0.1 and 0.05 mm differ by 5 to 10 %, as shares of covered samples are steps of an eighth.
    """
    sensor, places = Sensor(SMALL, LAWS, prepared_models={"foundation": compliance}), {"x": np.eye(6)[0], "y": np.eye(6)[1]}
    ball = trimesh.creation.icosphere(subdivisions=5, radius=2.0)
    for mesh in (trimesh.creation.box((4.0, 5.0, 3.0)), ball):
        pose = np.array([*POSE[:2], 3.0, 0.0, 0.0, POSE[5]])

        def press(aside=0.0, mesh=mesh, pose=pose):
            return sensor.press(mesh, pose=pose + aside, force_n=FORCE, model="foundation", label="")

        gradient = press().gradient("deformation_map", list(places))
        for name, way in places.items():
            wanted = (press(0.1 * way).deformation_map_mm - press(-0.1 * way).deformation_map_mm) / 0.2
            assert np.linalg.norm(gradient[name] - wanted) < 0.15 * np.linalg.norm(wanted), (name, len(mesh.faces))


def test_rows_of_a_batch_are_the_gradients_of_the_presses_alone(compliance):
    sensor, mesh = Sensor(SMALL, LAWS, prepared_models={"foundation": compliance}), ellipsoid()
    pose, missed = (*POSE[:2], 3.0, *POSE[3:]), (80.0, *POSE[1:])
    alone = sensor.press(mesh, pose=pose, force_n=FORCE, model="foundation", label="").gradient("tactile_map", "force")
    found = press_batch(sensor, ObjectSurface(mesh), [missed, pose], FORCE, model="foundation").gradient("tactile_map", "force")
    assert found.units == alone.units and list(found.errors) == [0] and np.isnan(found.values[0]).all()
    np.testing.assert_allclose(found.values[1], alone.values[0], rtol=1e-9)
    np.testing.assert_allclose(found.active_set_margin[1], alone.active_set_margin[0], rtol=1e-9)


@pytest.mark.slow
def test_a_gradient_by_thickness_is_about_the_difference_of_thicker_and_thinner_covers(compliance, law, monkeypatch):
    """Within 5 %, as above; the maps' derivative is that of presses on sensors whose cover is 5 % thicker and thinner."""
    def made(spec, laws=LAWS):
        return foundation_compliance(spec, dielectric_law=laws["dielectric"], cover_law=laws["cover"], frustum=law)

    monkeypatch.setattr(gradient, "cached_foundation", made)
    mesh, pose = ellipsoid(subdivisions=6), [*POSE[:2], 3.0, *POSE[3:]]
    mesh.apply_scale(2.5)

    def press(share):
        spec = SMALL.with_upper_layer((1 + share) * SMALL.upper_layer_mm)
        sensor = Sensor(spec, LAWS, prepared_models={"foundation": made(spec) if share else compliance})
        return sensor.press(mesh, pose=pose, force_n=FORCE, model="foundation", label="")

    upper, lower, apart_mm = press(0.05), press(-0.05), 0.1 * SMALL.upper_layer_mm
    for of, name in (("tactile_map", "tactile_map"), ("deformation_map", "deformation_map_mm"), ("depth", "indentation_mm")):
        found = press(0.0).gradient(of, "thickness")["thickness"]
        wanted = (getattr(upper, name) - getattr(lower, name)) / apart_mm
        assert np.linalg.norm(found - wanted) < 0.05 * np.linalg.norm(wanted), of
