"""The solid model's elements: locking, bonded rubber, a tube under pressure, plane strain, turned and mirrored set-ups."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from solids import disc_in_cylinder, elastic, growing

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface, quadrature_points
from softtact.fem.structured_meshes import box, in_tetrahedra, mirrored
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.items import FacePressure
from softtact.models.solid.newton import SolidSettings
from softtact.models.solid.path import SolidPath, last

TIGHT = SolidSettings(relative_residual=1e-7, penetration_mm=1e-7, max_augmentations=30)
UNTURNED = np.eye(3)
RUBBER = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=20)


def to_membrane(x):
    """Cook's panel of a unit square."""
    return np.column_stack([48 * x[:, 0], 44 * x[:, 0] + x[:, 1] * (44 - 28 * x[:, 0]), 44 * x[:, 2]])


def cooks_membrane(cells, law, kind):
    """Rise of the upper corner under a unit shear force per unit thickness, at small strain."""
    mesh = box((0, 0), (1, 1), (cells, cells)) if kind == "quad9" else box((0, 0, 0), (1, 1, 1 / cells), (cells, cells, 1))
    mesh = (in_tetrahedra(mesh) if kind == "tetra10" else mesh).moved(to_membrane)
    body = SolidBody(mesh, {"body": law}, held={"x0": "xyz"} if kind == "quad9" else {"x0": "xyz", "z0": "z", "z1": "z"})
    state, load = body.rest(), np.zeros_like(body.points)
    points = quadrature_points(Surface.of(mesh.face("x1")), body.points)
    np.add.at(load[:, 1], points.nodes, points.values * points.weight[:, None] / points.weight.sum())
    moved = np.zeros_like(body.points)
    moved.ravel()[body.free] = body.solve(state, load.ravel()[body.free, None])[:, 0]
    return moved[np.argmin(np.abs(body.points - [48, 60, 0]).sum(axis=1)), 1] * (1 if kind == "quad9" else 44 / cells)


@pytest.mark.parametrize(("kind", "cells", "allowed"), [("quad9", 16, 0.015), ("hexahedron27", 8, 0.015), ("tetra10", 8, 0.01)])
def test_cooks_membrane_at_nu_4995_does_not_lock(kind, cells, allowed, record):
    """Allowed: what the corner singularity leaves on so few elements; a plain quadratic tetrahedron of 8 cells is 6 % too stiff."""
    expected, source = 19.4441, "limit of the displacement element (see Bodies of one material)"
    got = cooks_membrane(cells, elastic(1.0, 0.4995), kind)
    assert record(f"Cook's membrane, nu = 0.4995, {cells} x {cells} {kind}", expected=expected, source=source, got=got) < allowed


@pytest.mark.parametrize("kind", ["hexahedron27", "tetra10"])
def test_cooks_membrane_does_not_stiffen_with_the_bulk_modulus(kind, record):
    expected, source = 1.0, "absence of locking; the exact displacement falls by 0.1 %"
    one, other = (cooks_membrane(4, elastic(1.0, nu), kind) for nu in (0.4995, 0.4999995))
    error = record(f"Cook's membrane, 4 x 4 {kind}: displacement at nu = 0.4999995 over that at 0.4995", expected=expected,
                   source=source, got=other / one)
    assert error < 5e-3


@pytest.mark.parametrize("shape", [2.0, 8.0, 32.0])
def test_an_axisymmetric_bonded_disc_is_stiffened_as_gent_and_lindley_say(shape, record):
    """The formula leaves out the edge, which yields: the disc acts as if 0.043 of its height narrower all around.

    That is what the edge of a strip takes, 0.13/S; of a disc, whose force grows with the fourth power of the radius, it is 0.09/S.
    """
    expected, source = 1 + 2 * shape**2, "Gent and Lindley: E (1 + 2 S^2), E = 1 MPa"
    half = 1 / (4 * shape)                               # S = R / (2 h), R = 1 mm; by symmetry a half of the height h
    rim = 1 - growing(min(0.09, 0.3 * half), 10)[::-1]
    mesh = box((0, 0), (1, half), (10, 4), grading=(rim, 1 - growing(0.15, 4)[::-1]), geometry="axisymmetric")
    body = SolidBody(mesh, {"body": elastic(1.0, 0.5 - 1e-7)}, held={"x0": "x", "y0": "y"}, carried={"plate": ((0, 0, 0), ["y1"])})
    strain = 1e-5
    # With K = 2e6 E the balance's rounding is 1e-5 of the load.
    settings = SolidSettings(relative_residual=1e-4)
    step = last(SolidPath(body, {"plate": Motion().step(ways={"y": -strain * half})}, settings=settings).run())
    got = -step.loads[0, 1] / (np.pi * strain)
    error = record(f"axisymmetric bonded disc, S = {shape:g}: apparent modulus", expected=expected, source=source, got=got)
    assert got < expected and error < 0.1 / shape + 0.002      # 0.002: K is not infinite


def test_a_tube_of_mooney_rivlin_swells_under_pressure_as_the_closed_form_says(record):
    """r^2 = R^2 + c;  p = integral of 2 (c10 + c01) (l^2 - l^-2) dr / r, l = r / R. K = 1e5 mu stands for incompressible."""
    inner, outer, stretch, mu = 1.0, 2.0, 1.5, 2 * (0.08 + 0.03)
    c = inner**2 * (stretch**2 - 1)

    def pressure_at(c):
        def per_radius(R):
            l2 = (R * R + c) / R**2
            return mu * (l2 - 1 / l2) * R / (R * R + c)
        return quad(per_radius, inner, outer)[0]

    expected, source = inner * (stretch - 1), "closed form; Ogden, Non-Linear Elastic Deformations, sec. 5.3"
    mesh = box((inner, 0), (outer, 0.5), (8, 1), geometry="axisymmetric")
    law = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=1e5)
    body = SolidBody(mesh, {"body": law}, held={"y0": "y", "y1": "y"})
    body.add(FacePressure(Surface.of(mesh.face("x0")), body.points, axisymmetric=True, name="inside"))
    step = last(SolidPath(body, pressures={"inside": np.linspace(0, pressure_at(c), 6)[1:]}).run())
    got = step.state.displacement[mesh.face_nodes("x0"), 0].mean()
    assert brentq(lambda c: pressure_at(c) - step.state.pressures[0], 0, 5) == pytest.approx(c)
    # 1e-5 of the volume, and eight elements through the wall at fourth order.
    assert record("tube of Mooney-Rivlin, inner stretch 1.5: displacement", expected=expected, source=source, got=got) < 2e-4


def two_blocks(geometry):
    """A block on another one, without friction, in plane strain or as a slice of a spatial body."""
    high = (0.1,) if geometry == "solid" else ()
    low, cells = (0.0,) * len(high), (1,) * len(high)
    options = {} if high else {"geometry": geometry, "thickness_mm": 0.1}
    lower = box((0, 0, *low), (2, 1, *high), (5, 3, *cells), region="lower", **options)
    upper = box((0, 1, *low), (2, 1.6, *high), (4, 2, *cells), **options)
    mesh = lower.joined(upper, prefix="upper ")
    sides = {"z0": "z", "z1": "z", "upper z0": "z", "upper z1": "z"} if high else {}
    body = SolidBody(mesh, {"lower": RUBBER, "upper body": RUBBER}, held={"y0": "xyz"[:2 + len(high)], **sides},
                     carried={"top": ((1, 1.6, 0), ["upper y1"])})
    body.add(ContactPair(Surface.of(mesh.face("upper y0")), Surface.of(mesh.face("y1")), stiffness=40.0, reach_mm=0.3,
                              thickness_mm=0.1))
    return body


def test_plane_strain_is_a_slice_of_a_spatial_body(record):
    """Both have the same functions in the plane, so that what differs is rounding and the balance's tolerance."""
    motion = {"top": Motion().step(ways={"y": -0.1, "rz": 0.5})}
    flat, solid = (last(SolidPath(two_blocks(geometry), motion, settings=TIGHT).run()).loads[0]
                   for geometry in ("plane_strain", "solid"))
    for freedom, name in ((1, "force down, N"), (5, "torque, N mm")):
        expected, source = solid[freedom], "slice of hexahedra between smooth plates"
        assert record(f"plane strain: {name}", expected=expected, source=source, got=flat[freedom]) < 1e-5


def leaning_blocks(turn=UNTURNED, mirror=False, friction=0.0):
    """Loads (6,), turned back, of a block pressed on another and aside, all turned by `turn` or mirrored at x = 0."""
    lower, upper = box((0, 0, 0), (2, 2, 1), (2, 2, 1), region="lower"), box((0.4, 0.3, 1), (1.6, 1.7, 1.8), (2, 1, 1))
    mesh = lower.joined(upper, prefix="upper ")
    mesh = (mirrored(mesh, 0) if mirror else mesh).moved(lambda x: x @ turn.T)
    body = SolidBody(mesh, {"lower": RUBBER, "upper body": RUBBER}, held={"z0": "xyz"},
                     carried={"top": (turn @ [-1 if mirror else 1, 1, 1.8], ["upper z1"])})
    body.add(ContactPair(Surface.of(mesh.face("upper z0")), Surface.of(mesh.face("z1")), stiffness=30.0, reach_mm=0.3,
                              friction=friction, segments=True))
    way = turn @ [-0.05 if mirror else 0.05, 0.03, -0.12]
    step = last(SolidPath(body, {"top": Motion().step(ways=dict(zip("xyz", 0.5 * way, strict=True))).step(
        ways=dict(zip("xyz", 0.5 * way, strict=True)))}, settings=TIGHT).run())
    return np.concatenate([step.loads[0, :3] @ turn, step.loads[0, 3:] @ turn])


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_a_turned_and_a_mirrored_set_up_give_the_turned_and_mirrored_loads(friction, record):
    source = "invariance"
    first = leaning_blocks(friction=friction)
    assert abs(first[2]) > 0.05
    turned = leaning_blocks(Rotation.from_rotvec([0.5, -0.8, 1.1]).as_matrix(), friction=friction)
    mirror = leaning_blocks(mirror=True, friction=friction) * [-1, 1, 1, 1, -1, -1]
    for name, other in (("turned", turned), ("mirrored", mirror)):
        got = np.abs(other - first).max() / np.abs(first).max()
        # Quadrilaterals are cut along one diagonal, which a mirror turns into the other: the points differ.
        assert record(f"{name} set-up, mu = {friction:g}: largest difference of the loads over the largest", expected=0.0,
                      source=source, got=got) < 3e-4


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.3, marks=pytest.mark.slow)])
def test_bodies_in_contact_that_turn_together_keep_their_loads(friction, record):
    """Frame indifference: both held faces turn by 30 degrees after the press, and the forces with them.

    Compared are the first and the last turn: as a step begins, the surfaces are cut along each other anew, and what they carry
    moves to the new points."""
    lower, upper = box((0, 0, 0), (1, 1, 0.5), (2, 2, 1), region="lower"), box((0, 0, 0.5), (1, 1, 1), (3, 2, 1))
    mesh = lower.joined(upper, prefix="upper ")
    body = SolidBody(mesh, {"lower": RUBBER, "upper body": RUBBER},
                     carried={"base": ((0, 0, 0), ["z0"]), "top": ((0, 0, 0), ["upper z1"])})
    body.add(ContactPair(Surface.of(mesh.face("upper z0")), Surface.of(mesh.face("z1")), stiffness=30.0, reach_mm=0.2,
                              friction=friction, segments=True))
    turn = {"rx": 0.0, "ry": 0.0, "rz": 10.0}
    base = Motion().step(ways={}).step(ways=turn).step(ways=turn).step(ways=turn)
    top = Motion().step(ways={"x": 0.02 if friction else 0.0, "z": -0.03})
    pressed, *_ = SolidPath(body, {"base": Motion().step(ways={}), "top": top}, settings=TIGHT).run()
    # The upper frame was shifted, so its way about the origin is a turn and a shift along the arc.
    shift, ways = pressed.state.poses[1].translation, []
    for k in range(3):
        a, b = (Rotation.from_euler("z", 10.0 * n, degrees=True).as_matrix() @ shift for n in (k, k + 1))
        ways.append({**dict(zip("xyz", b - a, strict=True)), "rz": 10.0})
    for way in ways:
        top = top.step(ways=way)
    steps = list(SolidPath(body, {"base": base, "top": top}, settings=TIGHT).run())
    first, turned = (steps[k].loads[1, :3] @ Rotation.from_euler("z", 10 * k, degrees=True).as_matrix() for k in (1, 3))
    got = np.abs(turned - first).max() / np.abs(first).max()
    assert friction == 0 or abs(first[0]) > 0.05 * abs(first[2])
    assert record(f"bodies turned together by 30 degrees, mu = {friction:g}: change of the loads over the largest", expected=0.0,
                  source="frame indifference", got=got) < (3e-4 if friction else 1e-4)


def test_a_disc_twisted_on_a_half_space_has_reissner_and_sagocis_torque(record):
    """The torque's singular edge converges at first order; a block of five radii leaves about (1/5)^3 / 2."""
    expected, source = 16 / 3, "Reissner and Sagoci (1944): T = 16/3 G a^3 angle"
    mesh = disc_in_cylinder(1.0, 5.0, np.array([0, 0.1, 0.5, 0.9, 1.0]), depth_shares=growing(0.02, 5),
                            ring_shares=growing(0.025, 5))
    law = elastic(3.0, 0.4995)
    body = SolidBody(mesh, {"body": law}, held={"z0": "xyz", "side": "xyz"}, carried={"disc": ((0, 0, 0), ["disc"])})
    angle = 1e-4
    step = last(SolidPath(body, {"disc": Motion().step(ways={"rz": np.degrees(angle)})}).run())
    got = step.loads[0, 5] / (law.mu0 * angle)
    error = record("disc twisted on a block of five radii: torque over G a^3 angle", expected=expected, source=source, got=got)
    assert error < 0.03
