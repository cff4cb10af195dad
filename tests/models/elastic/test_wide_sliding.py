"""Contact with friction on a wide layer: Hertz, Cattaneo and Mindlin, full stick, paths, balances; its twin, the dense model."""

import numpy as np
import pytest
import trimesh
from support.sensors import CORO

from softtact.contact.coulomb import CoulombSettings
from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion, MotionStep
from softtact.errors import ConvergenceError, InputError
from softtact.models.elastic.sliding import move_on_layer
from softtact.models.elastic.tangential import surface_compliance
from softtact.models.elastic.wide_layer import WideLayer
from softtact.models.elastic.wide_motion import follow_motion
from softtact.models.elastic.wide_sliding import WideObject

SHEAR, POISSON, A, RADIUS, FRICTION = 1.0, 0.5, 1.0, 100.0, 0.3
FORCE = 4 * 2 * SHEAR * (1 + POISSON) / (1 - POISSON**2) * A**3 / (3 * RADIUS)      # Hertz's for the radius A
LIMIT = FRICTION * FORCE
TO_SLIDE = 3 * LIMIT * (2 - POISSON) / (16 * SHEAR * A)                           # mm, where the stick radius is 0
SHARES = (0.02, 0.3, 0.5, 0.7, 0.9)


def paraboloid(x, y):
    return (x * x + y * y) / (2 * RADIUS), None


def thick(thickness, points, half=1.5):
    """A paraboloid under FORCE on a layer much thicker than its contact, whose radius is so many points; and the grid's line."""
    step = A / points
    line = np.arange(-int(half * points), int(half * points) + 1) * step
    layer = WideLayer.with_constants(thickness, SHEAR, POISSON, (step, step), (len(line), len(line)))
    mover = WideObject(layer, paraboloid, (line, line), first_touch_mm=0.0, friction=FRICTION,
                       settings=CoulombSettings(tolerance_mm=1e-10))
    return mover, line, mover.follow(MotionStep(loads={"z": -FORCE}), FORCE)


def radius_of(line, weight):
    """Radius of a Hertzian distribution (n, n), from its second moment."""
    x, y = np.meshgrid(line, line)
    return np.sqrt(2.5 * (weight * (x * x + y * y)).sum() / weight.sum())


def way_of(share):
    """Mindlin's tangential way (mm) of a share of the limiting force."""
    return TO_SLIDE * (1 - (1 - share) ** (2 / 3))


# --- on a thick layer ---


@pytest.mark.slow
def test_a_ball_on_a_thick_layer_is_hertzs():
    """Radius and peak within 0.5 % with 8 points in the radius; the depth, of two thicknesses extrapolated, within 0.5 %."""
    depths = []
    for thickness in (8.0, 16.0):
        _, line, pressed = thick(thickness, points=8)
        depths.append(pressed.position[2])
        assert radius_of(line, pressed.normal) == pytest.approx(A, rel=0.005)
        assert pressed.normal.max() * 64 / A**2 == pytest.approx(3 * FORCE / (2 * np.pi * A**2), rel=0.005)
    assert 2 * depths[1] - depths[0] == pytest.approx(A**2 / RADIUS, rel=0.005)


@pytest.mark.slow
def test_the_depth_converges_with_the_second_order_of_the_grid():
    """4, 8, 16 points in the radius: the distance to the last falls to a fifth in the second order, to 1 / 3.8 in the order 1.5."""
    depths = [thick(4.0, points)[2].position[2] for points in (4, 8, 16)]
    assert (depths[2] - depths[0]) / (depths[2] - depths[1]) > 3.8


@pytest.fixture(scope="module")
def partial_slip():
    """{thickness: states at Mindlin's ways of SHARES}, with the grid's line."""
    found = {}
    for thickness in (8.0, 16.0):
        mover, line, _ = thick(thickness, points=8)
        ways = np.diff([0.0, *map(way_of, SHARES)])
        found[thickness] = [mover.follow(MotionStep(ways={"x": way}), FORCE) for way in ways]
    return found, line


def aside_of(step):
    return step.force_n[..., 0].sum()


@pytest.mark.slow
def test_the_tangential_stiffness_of_a_stuck_ball_is_mindlins(partial_slip):
    """8 G a / (2 - nu): 1 %, as the rim slips at 2 % of the limit already, a thin ring of it."""
    compliance = [states[0].position[0] / aside_of(states[0]) for states in partial_slip[0].values()]
    assert 2 * compliance[1] - compliance[0] == pytest.approx((2 - POISSON) / (8 * SHEAR * A), rel=0.01)


@pytest.mark.slow
def test_the_stick_radius_is_cattaneos(partial_slip):
    """c = a (1 - Q / mu P)^(1/3), from the second moment of what the traction lacks to mu p: within a quarter of a point."""
    states, line = partial_slip
    for state in states[16.0]:
        lacking = FRICTION * state.normal - np.linalg.norm(state.force_n[..., :2], axis=-1)
        assert radius_of(line, lacking) == pytest.approx(A * (1 - aside_of(state) / LIMIT) ** (1 / 3), abs=0.25 / 8)


@pytest.mark.slow
def test_the_slipping_share_of_the_contact_is_mindlins(partial_slip):
    """1 - (c / a)^2 = 1 - (1 - Q / mu P)^(2/3), of some 200 points: within 0.03, a third of the ring of points at the rim."""
    for states in partial_slip[0].values():
        for state in states[1:]:
            share = state.slides.sum() / (state.normal > 0).sum()
            assert share == pytest.approx(1 - (1 - aside_of(state) / LIMIT) ** (2 / 3), abs=0.03)


# --- a gel: objects about as wide as the layer is thick ---

GEL = WideLayer.with_constants(2.0, 0.15, 0.49, (0.2, 0.2), (61, 61))
LINE = np.linspace(-6.0, 6.0, 61)
BALL = HeightField(trimesh.creation.icosphere(subdivisions=4, radius=3.0).apply_translation([0, 0, 3.0]))
PUNCH = HeightField(trimesh.creation.box((3.1, 2.3, 2.0)).apply_translation([0, 0, 1.0]))


def gel(surface, friction=0.5, **how):
    return WideObject(GEL, surface, (LINE, LINE), first_touch_mm=0.0, friction=friction, **how)


def follow(surface, text, friction=0.5, **how):
    return list(follow_motion(gel(surface, friction, **how), Motion.parse(text), deepest_mm=2.0))


def test_full_stick_under_a_wide_plate_is_simple_shear():
    """tau = G delta / h at the middle of a plate eight thicknesses wide, and the pressure of the confined layer: 1 %."""
    thickness, delta, poisson = 1.0, 0.05, 0.3
    line = np.linspace(-4.0, 4.0, 41)
    layer = WideLayer.with_constants(thickness, SHEAR, poisson, (0.2, 0.2), (41, 41))
    mover = WideObject(layer, lambda x, y: (np.zeros_like(x), None), (line, line), first_touch_mm=0.0, friction=np.inf)
    steps = list(follow_motion(mover, Motion().press(depth_mm=delta).slide(x_mm=delta), deepest_mm=thickness))
    middle = steps[-1].force_n[20, 20] / 0.2**2
    assert middle[0] == pytest.approx(SHEAR * delta / thickness, rel=0.01)
    assert -middle[2] == pytest.approx(2 * SHEAR * (1 - poisson) / (1 - 2 * poisson) * delta / thickness, rel=0.01)


def test_without_friction_the_surface_moves_with_the_footprint_alone():
    """A ball moved aside leaves the surface as one pressed there: 2.0 mm are ten points of the grid."""
    moved = follow(BALL, "z -0.5; x 2.0", friction=0.0)[-1]
    pressed = follow(BALL, "z -0.5", friction=0.0)[-1]
    np.testing.assert_allclose(moved.displacement_mm[:, 10:], pressed.displacement_mm[:, :-10], atol=2e-4)      # the solver's 5e-5
    assert not moved.force_n[..., :2].any() and moved.dissipated_mj == 0.0


def test_two_paths_to_one_place_leave_different_surfaces():
    """z 0.5 at x = 0, or z 0.5 at x = -1 and then 1 aside: the second drags the surface along."""
    there = follow(BALL, "z -0.5")[-1]
    apart = gel(HeightField(trimesh.creation.icosphere(subdivisions=4, radius=3.0).apply_translation([-1.0, 0, 3.0])))
    *_, dragged = follow_motion(apart, Motion.parse("z -0.5; x 1.0 in 2"), deepest_mm=2.0)
    assert abs(there.displacement_mm[30, 30, 0]) < 1e-3 and dragged.displacement_mm[30, 30, 0] > 0.2


def test_work_is_stored_or_rubbed_away():
    """Under a flat punch of which no edge passes a point: to the solver's tolerance. Coulomb's bound is kept at all points."""
    steps = follow(PUNCH, "z -0.3 in 3; x 0.04 in 2; x -0.04 in 2", friction=0.05)
    for step in steps:
        assert step.work_mj == pytest.approx(step.stored_mj + step.dissipated_mj, rel=1e-3)
        assert (np.linalg.norm(step.force_n[..., :2], axis=-1) <= 0.05 * step.normal * (1 + 1e-6)).all()
    assert steps[-1].dissipated_mj > 1e-3 * steps[-1].work_mj


def test_a_stuck_path_gives_all_its_work_back():
    steps = follow(PUNCH, "z -0.2; x 0.04; x -0.04", friction=50.0)
    assert np.nanmax(steps[-1].path_mm) == 0.0 and steps[-1].dissipated_mj == 0.0
    np.testing.assert_allclose(steps[-1].force_n, steps[0].force_n, atol=1e-4)      # N: 2e-4 mm over a point's 10 mm/N
    assert steps[1].work_mj > steps[0].work_mj


def test_signs_and_gaps_are_as_documented():
    step = follow(BALL, "z -0.4; x 0.1")[-1]
    assert step.force_n[..., 0].sum() > 0 > step.force_n[..., 2].max(initial=-1) - 1e-12
    assert step.displacement_mm[30, 30, 0] > 0 > step.displacement_mm[30, 30, 2]
    touches = step.normal > 0
    assert np.abs(step.gap_mm[touches]).max() < 3e-4 and (step.gap_mm[~touches] > -3e-4).all()     # the solver's tolerance, 2e-4
    assert np.isinf(step.gap_mm[0, 0]) and np.isnan(step.path_mm[~touches]).all() and not (step.slides & ~touches).any()


def test_a_mirrored_motion_gives_the_mirrored_surface():
    one, other = (follow(PUNCH, f"z -0.2; x {sign}0.2; y 0.1")[-1] for sign in ("", "-"))
    np.testing.assert_allclose(other.displacement_mm[:, ::-1] * [-1, 1, 1], one.displacement_mm, atol=2e-4)


def test_a_turn_twists_the_surface_by_its_angle_where_it_sticks():
    """A punch that sticks turns the points under it with it, by 5 degrees about its middle, and the moment is about z."""
    still, turned = follow(PUNCH, "z -0.3; rz 5", friction=50.0)
    x, y = np.meshgrid(LINE, LINE)
    moved = turned.displacement_mm - still.displacement_mm
    under = (np.abs(x) < 1.2) & (np.abs(y) < 0.8)
    angle = np.radians(5)
    at = np.stack([x, y], axis=-1) + still.displacement_mm[..., :2]
    expected = np.stack([at[..., 0] * (np.cos(angle) - 1) - at[..., 1] * np.sin(angle),
                         at[..., 0] * np.sin(angle) + at[..., 1] * (np.cos(angle) - 1)], axis=-1)
    np.testing.assert_allclose(moved[under][:, :2], expected[under], atol=1e-3)
    assert (x * turned.force_n[..., 1] - y * turned.force_n[..., 0]).sum() > 0.01


def test_a_load_finds_the_depth_that_gives_it():
    deep = follow(BALL, "z -0.4")[-1]
    loaded = follow(BALL, f"fz -{deep.normal.sum()}")[-1]
    assert loaded.normal.sum() == pytest.approx(deep.normal.sum(), rel=1e-9)
    assert loaded.position[2] == pytest.approx(0.4, rel=2e-3)           # increments by load and by depth differ


def test_an_object_lifted_off_leaves_the_surface_at_rest():
    steps = follow(BALL, "z -0.3; z 0.5; z -0.4")
    assert not steps[1].force_n.any() and not steps[1].displacement_mm.any() and steps[1].stored_mj == 0.0
    assert steps[1].gap_mm.min() == pytest.approx(0.2, abs=1e-9) and steps[2].normal.sum() > 0


@pytest.mark.parametrize(("text", "said"), [
    ("z -0.1; rx 3", "Step 2 of the motion: the elastic model of a gel prescribes x, y, z and rz and loads z only; leave the rot"),
    ("fz -1; fx 1", "Step 2 .* leave the load on x out"), ("fz 1", "a load of 1 N along z does not press"),
    ("z -0.2; x 500", "needs 3125 increments to follow the path of friction, more than 2000; divide it")])
def test_what_it_cannot_follow_is_refused(text, said):
    with pytest.raises(InputError, match=said):
        follow(BALL, text)


def test_deeper_than_the_gel_is_not_reached_and_the_steps_before_are_kept():
    steps = follow_motion(gel(BALL, 0.0), Motion.parse("z -0.1; z -2.0"), deepest_mm=2.0)
    assert next(steps).position[2] == pytest.approx(0.1)
    with pytest.raises(ConvergenceError, match=r"Step 2 was not reached: the object would be 2\.1 mm deep in a gel 2 mm"):
        next(steps)


# --- its twin: the dense compliance of a whole layer of finite elements ---


@pytest.fixture(scope="module")
def small_sheet():
    """1 mm thick, sides 4 mm from a contact of about 1 mm, nodes 0.2 mm apart."""
    cover = CORO.cover.model_copy(update={"thickness_mm": 1.0 - CORO.dielectric_thickness_mm + 0.5})
    return CORO.model_copy(update={"footprint_mm": (8.0, 8.0), "map_shape": (21, 21), "cover": cover})


@pytest.mark.slow
def test_it_does_what_the_dense_model_does(small_sheet):
    """Press, drag, drag back, with displacement by pressure left out of the places as there: forces within 2 %.

    Hat functions here, quadratic elements there, four to five nodes in the contact's radius: 4 % of the largest displacement at
    one point, 0.5 % rms.
    """
    spec, friction = small_sheet, 0.4
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=4.0).apply_translation([0.03, -0.02, 4.0])
    surface, motion = HeightField(mesh), Motion.parse("z -0.15; x 0.06; x 0.3; x -0.1")
    dense = move_on_layer(surface_compliance(spec), surface, motion, first_touch_mm=0.0, friction=friction,
                          deepest_mm=spec.thickness_mm)
    line = np.linspace(-4.0, 4.0, 41)
    layer = WideLayer.of(spec.elastic_layer, spec.thickness_mm, (0.2, 0.2), (41, 41))
    mover = WideObject(layer, surface, (line, line), first_touch_mm=0.0, friction=friction, pressure_moves=False)
    steps = list(follow_motion(mover, motion, deepest_mm=spec.thickness_mm))
    force = np.array([step.force_n.sum(axis=(0, 1)) for step in steps])
    np.testing.assert_allclose(force, dense.force_n, atol=0.02 * np.abs(dense.force_n).max())
    for step, expected in zip(steps, dense.displacement_mm, strict=True):
        error, largest = step.displacement_mm[::2, ::2] - expected, np.abs(expected).max()
        assert np.abs(error).max() < 0.04 * largest and np.sqrt((error**2).mean()) < 0.005 * largest
    np.testing.assert_allclose([step.dissipated_mj for step in steps], dense.dissipated_mj, atol=0.02 * dense.work_mj[-1])


@pytest.mark.parametrize("shape", ["facet", "edge", "corner", "box"])
def test_an_object_of_facets_settles_under_a_load_whatever_touches_first(shape):
    """Few points under a small load: none of them may pull while the contact is sought."""
    ball = trimesh.creation.icosphere(2, radius=6.0)
    lowest = {"facet": ball.face_normals[0], "corner": ball.vertex_normals[0],
              "edge": ball.vertices[ball.edges_unique[0]].sum(axis=0), "box": None}
    mesh = trimesh.creation.box((3.0, 3.0, 2.0)) if shape == "box" else ball.apply_transform(
        trimesh.geometry.align_vectors(lowest[shape], (0, 0, -1)))
    surface = HeightField(mesh.apply_translation((0, 0, -mesh.bounds[0, 2])))
    line = np.linspace(-4, 4, 65)
    for load in (0.01, 0.5, 5.0):
        layer = WideLayer.with_constants(4.0, 0.05, 0.48, (line[1] - line[0],) * 2, (65, 65))
        mover = WideObject(layer, surface, (line, line), first_touch_mm=surface.first_touch_mm(line, line), friction=0.5)
        assert -mover.follow(MotionStep(loads={"z": -load}), load).force_n[..., 2].sum() == pytest.approx(load, rel=1e-9)
