"""A ball pressed into a gel and moved aside with friction: the wide layer against CalculiX, which has it meshed."""

import numpy as np
import pytest
from deck_study import needs_ccx
from support.solid_decks import calculix_lines

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box, cylinder
from softtact.materials.laws.registry import make_law
from softtact.models.elastic.wide_layer import WideLayer
from softtact.models.elastic.wide_motion import follow_motion
from softtact.models.elastic.wide_sliding import WideObject
from softtact.models.solid.body import SolidBody

pytestmark = [needs_ccx, pytest.mark.slow]
THICK_MM, RADIUS_MM, FRICTION = 2.0, 8.0, 0.5
LAW = make_law("neo_hooke", {"c10": 0.075}, bulk_over_shear=20)
MOTION = Motion().step(ways={"z": -0.1}).step(ways={"x": 0.05}).step(ways={"x": 0.1})
LINES = np.array([0, 0.25, 0.5, 0.75, 1.0, 1.35, 2.2, 4.0, 7.0])      # mm from the middle: ends of elements


def half_a_layer_under_a_ball():
    """Half of a layer of 14 x 14 x 2 mm, held below, y >= 0, under a stiff paraboloid foot that just touches it."""
    line, levels = np.concatenate([-LINES[:0:-1], LINES]), np.array([0, 0.8, 1.5, 2.0])
    half = LINES[-1]
    mesh = box((-half, 0, 0), (half, half, THICK_MM), (len(line) - 1, len(LINES) - 1, len(levels) - 1),
               grading=[(line + half) / (2 * half), LINES / half, levels / THICK_MM])
    foot = cylinder(1.4, 0.4, (10, 1)).moved(
        lambda x: x + np.outer((x[:, :2]**2).sum(axis=1) / (2 * RADIUS_MM), [0, 0, 1.0]) + [0, 0, THICK_MM])
    both = mesh.joined(foot, prefix="foot ")
    body = SolidBody(both, {"body": LAW, "foot body": LAW.scaled(100.0)}, held={"z0": "xyz", "y0": "y"},
                     carried={"object": ((0, 0, THICK_MM + 0.3), ["foot boundary"])})
    body.add(ContactPair(Surface.of(both.face("z1")), Surface.of(both.face("foot z0")), stiffness=40.0, reach_mm=0.4,
                         friction=FRICTION, rigid=True))
    return body


def test_force_down_and_aside_are_those_of_calculix(solve_lines):
    """Pressed by 0.1 of 2 mm, then 0.05 and 0.15 mm aside, mu = 0.5: 3 % each, of the force aside where all slides over that down.

    CalculiX 2.20, C3D20 of 0.25 mm under the foot, three and a half in the contact's radius, finite strains, penalty of 200 N/mm3,
    free sides 7 mm away; here points 0.05 mm apart. Measured: 1.9 % down, which half of the depth makes 1.4 %; 0.6 % aside in
    partial slip; sliding, CalculiX carries 0.514 of the force down, more than mu. Sides 4 mm away make it 2 % softer down and 4 %
    aside.
    The law's small strains: G = 2 C10, K = 20 G, nu = 58 / 122.
    """
    deck = calculix_lines(half_a_layer_under_a_ball(), {"object": MOTION}, reduced=False, stiffness=200.0, increments=2)
    tables = solve_lines(deck)
    expected = 2 * np.array([table[-1, -3:] for table in tables.of("FRAME1") if table.shape[0] == 1])
    line = np.linspace(-3.0, 3.0, 121)
    shear = LAW.mu0
    layer = WideLayer.with_constants(THICK_MM, shear, (3 * 20 - 2) / (6 * 20 + 2), (0.05, 0.05), (121, 121))
    mover = WideObject(layer, lambda x, y: ((x**2 + y**2) / (2 * RADIUS_MM), None), (line, line), first_touch_mm=0.0,
                       friction=FRICTION)
    found = np.array([step.force_n.sum(axis=(0, 1)) for step in follow_motion(mover, MOTION, deepest_mm=THICK_MM)])
    np.testing.assert_allclose(found[:, 2], expected[:, 2], rtol=0.03)
    assert found[1, 0] == pytest.approx(expected[1, 0], rel=0.03)
    assert found[2, 0] / found[2, 2] == pytest.approx(expected[2, 0] / expected[2, 2], rel=0.03)
