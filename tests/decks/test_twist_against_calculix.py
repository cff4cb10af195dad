"""A twist of a small sensor on frusta: items of the solid model against CalculiX, which has every frustum meshed."""

from dataclasses import replace

import numpy as np
import pytest
from deck_study import needs_ccx
from support.meshed_frusta import punch_surface, under_punch
from support.solid_decks import calculix_lines, frame_load, pose_after

import softtact
from softtact.contact.motion import Motion
from softtact.models.solid.path import SolidPath
from softtact.press.solid_pad import OBJECT, SolidPad
from softtact.sensors.fields import Edge

pytestmark = [needs_ccx, pytest.mark.slow]
FRICTION, STEPS = 0.3, 4     # steps of 3 degrees: ccx moves nodes straight, 0.03 % off the circle
MOTION = Motion().step(ways={"z": -0.15}).step(ways={"z": -0.15})
for _ in range(STEPS):
    MOTION = MOTION.step(ways={"rz": 3.0})


def test_force_and_torque_of_a_twist_are_those_of_calculix(solve_lines):
    """3 x 3 frusta of coro with free sides, pressed by 0.3 mm with a paraboloid foot (mu = 0.3) and twisted by 12 degrees.

    Expected: the reaction of the punch in CalculiX 2.20, C3D20R and C3D15 of 0.6 mm, frusta meshed, tips held; 3 % of force and
    torque. Measured with the pad's elements of 0.4 mm: torques 2.9, 0.5, 1.5, 3.1 % above, forces 0.6 to 1.2 % below. The last
    torque, of which all slides, was 3.9 % above with 0.6 mm: half a per cent more is allowed for this mesh.
    """
    coro = softtact.load_sensor("coro")
    spec = coro.spec.model_copy(update={"footprint_mm": (3.6, 3.6), "edge": Edge(held="free"), "map_shape": (7, 7)})
    meshed = under_punch(spec, coro.laws, friction=FRICTION)
    tables = solve_lines(calculix_lines(meshed, {OBJECT: MOTION}, reduced=True, stiffness=200.0, increments=2))
    by_node = [table for table in tables.of("FRAME1") if table.shape[1] == 4]
    expected = np.array([frame_load(meshed, meshed.frames[0], pose_after(MOTION.steps[:k + 1]), table)
                         for k, table in enumerate(by_node)])
    body = SolidPad(replace(coro, spec=spec)).with_rigid(punch_surface(), friction=FRICTION, threads=1)
    found = np.array([step.loads[0] for step in SolidPath(body, {OBJECT: MOTION}).run()])
    assert expected.shape == found.shape
    np.testing.assert_allclose(found[1:, 2], expected[1:, 2], rtol=0.03)
    np.testing.assert_allclose(found[2:-1, 5], expected[2:-1, 5], rtol=0.03)
    np.testing.assert_allclose(found[-1, 5], expected[-1, 5], rtol=0.035)
