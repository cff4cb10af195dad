"""The solid model's friction: Cattaneo's partial slip, and the energy of a press and a slide."""

import numpy as np
import pytest
from slabs import graded, mirrored
from solids import elastic, places_of, pressed_by_roller, roller

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.newton import SolidSettings
from softtact.models.solid.path import SolidPath, last

A, RADIUS, MU = 1.0, 100.0, 0.4


def test_a_roller_dragged_aside_slips_in_part_as_cattaneo_says(record):
    """Incompressible half-plane, so that pressure and friction do not act on each other: c = a sqrt(1 - Q / (mu P))."""
    modulus, source = 1 / (1 - 0.4995**2), "Cattaneo (1938); Johnson, Contact Mechanics, sec. 7.2"
    lines, depth = mirrored(graded(1.3, 13, 20.0, 6)), -graded(0.3, 2, 20.0, 7)[::-1]
    mesh = box((-20, -20), (20, 0), (len(lines) - 1, len(depth) - 1), grading=((lines + 20) / 40, (depth + 20) / 20))
    body = pressed_by_roller(mesh, elastic(1.0, 0.4995), roller(RADIUS, 2.5, 30), held={"x0": "xy", "x1": "xy", "y0": "xy"},
                             stiffness=200.0, reach_mm=0.3, friction=MU)
    down, aside = 0.0185, 0.0045
    motion = Motion().step(ways={"y": -down}).step(ways={"x": aside}).step(ways={"x": aside})
    step = last(SolidPath(body, {"roller": motion}, settings=SolidSettings(penetration_mm=1e-5)).run())
    tangential, normal = abs(step.loads[0, 0]), -step.loads[0, 1]
    ratio = tangential / (MU * normal)
    assert 0.3 < ratio < 0.9
    a = np.sqrt(4 * normal * RADIUS / (np.pi * modulus))
    c, peak = a * np.sqrt(1 - ratio), 2 * normal / (np.pi * a)
    (place, pressure), contact = places_of(body, step.state), step.state.contacts[0]
    sticks = (pressure > 0) & ~contact.slides
    width = 0.5 * step.state.histories[0].points.weight[sticks].sum()
    assert record(f"partial slip at Q / mu P = {ratio:.2f}: half-width of the stick zone, mm", expected=c, source=source, got=width
                  ) < 0.05      # half an element of a/10 on each side
    x = place[:, 0] - 2 * aside
    law = MU * peak * (np.sqrt(np.maximum(1 - (x / a) ** 2, 0)) - c / a * np.sqrt(np.maximum(1 - (x / c) ** 2, 0)))
    weight, friction = step.state.histories[0].points.weight, np.abs(contact.friction[:, 0])
    error = np.sqrt(weight @ (friction - law) ** 2 / (weight @ law**2))
    assert record("the same: root mean square error of the friction over its own", expected=0.0, source=source, got=error) < 0.06


def sheared_blocks(steps, friction):
    """Work, strain energy and dissipation in mJ of a block with a rounded foot, pressed on a wider one and drawn aside."""
    law = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=20)
    lower, upper = box((0, 0), (3, 1), (12, 3), region="lower"), box((-0.6, 0), (0.6, 0.8), (6, 2))
    upper = upper.moved(lambda x: x + [1.3, 1, 0] + [0, 0.2, 0] * (x[:, :1] ** 2 * (1 - x[:, 1:2] / 0.8)))
    mesh = lower.joined(upper, prefix="upper ")
    body = SolidBody(mesh, {"lower": law, "upper body": law}, held={"y0": "xy"}, carried={"top": ((0, 0, 0), ["upper y1"])})
    body.add(ContactPair(Surface.of(mesh.face("upper y0")), Surface.of(mesh.face("y1")), stiffness=50.0, reach_mm=0.3,
                              friction=friction))
    motion = Motion()
    for _ in range(steps):
        motion = motion.step(ways={"y": -0.12 / steps})
    for _ in range(2 * steps):
        motion = motion.step(ways={"x": 0.25 / steps / 2})
    step = last(SolidPath(body, {"top": motion}, settings=SolidSettings(penetration_mm=1e-4)).run())
    return step.work_mj, step.state.strain_energy, step.dissipated_mj


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_work_is_strain_energy_and_what_friction_took(friction, record):
    """What is left falls with the increments: the trapezoidal rule's error, and with friction the penalty's, a few per mille."""
    source, left = "conservation of energy", []
    for steps in (2, 8):
        work, energy, dissipated = sheared_blocks(steps, friction)
        assert (dissipated > 0.05 * work) == bool(friction)
        left.append(record(f"press and slide in {3 * steps} steps, mu = {friction:g}: stored and dissipated energy over work",
                           expected=1.0, source=source, got=(energy + dissipated) / work))
    assert left[1] < (0.01 if friction else 0.005) and left[1] < left[0]
