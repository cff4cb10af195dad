"""The solid model's contact: patch tests across meshes that do not match, Hertz, a ball on a bonded layer."""

import numpy as np
import pytest
from slabs import HeldSlab, graded, paraboloid
from solids import elastic, growing, places_of, pressed_by_roller, roller

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box, in_tetrahedra, mirrored, square_to_disc
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.items import FacePressure
from softtact.models.solid.newton import SolidSettings
from softtact.models.solid.path import SolidPath, last

TIGHT = SolidSettings(relative_residual=1e-12, penetration_mm=1e-9, max_augmentations=40)
RUBBER = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=20)


@pytest.mark.parametrize("upper_kind", ["hexahedron27", "tetra10"])
def test_a_uniform_pressure_crosses_two_meshes_that_do_not_match(upper_kind, record):
    """The contact patch test (Taylor and Papadopoulos): two blocks compressed by a tenth, as one block would be."""
    stretch, source = 0.9, "uniaxial test of the law"
    lower = box((0, 0, 0), (1, 1, 0.5), (3, 2, 1), region="lower")
    upper = box((0, 0, 0.5), (1, 1, 1), (2, 3, 1))
    mesh = lower.joined(in_tetrahedra(upper) if upper_kind == "tetra10" else upper, prefix="upper ")
    body = SolidBody(mesh, {"lower": RUBBER, "upper body": RUBBER},
                     held={"x0": "x", "y0": "y", "z0": "z", "upper x0": "x", "upper y0": "y"},
                     carried={"top": ((0, 0, 0), ["upper z1"], "z")})
    body.add(ContactPair(Surface.of(mesh.face("upper z0")), Surface.of(mesh.face("z1")), stiffness=20.0, reach_mm=0.3,
                              segments=True))
    step = last(SolidPath(body, {"top": Motion().step(ways={"z": stretch - 1})}, settings=TIGHT).run())
    expected, got = RUBBER.uniaxial_compressible(stretch), step.loads[0, 2]
    error = record(f"contact patch test, hexahedra under {upper_kind}: nominal stress", expected=expected, source=source, got=got)
    assert error < 1e-8      # the tolerance of the overlap over the height
    pressure = step.state.contacts[0].pressure
    scatter = np.ptp(pressure) / pressure.mean()
    name = f"the same: scatter of the contact pressure over its mean, {upper_kind}"
    assert record(name, expected=0.0, source="uniform", got=scatter) < 1e-7
    assert np.abs(step.state.displacement[:, 2] - (stretch - 1) * body.points[:, 2]).max() < 1e-8


def ring(inner, outer, cells, region):
    """A quarter of a ring in plane strain, faces y0 (inside), y1 (outside), x0 and x1 (the cuts)."""
    def transform(x):
        angle = np.pi / 2 * (1 - x[:, 0])
        return np.column_stack([x[:, 1] * np.cos(angle), x[:, 1] * np.sin(angle), 0 * angle])
    return box((0, inner), (1, outer), cells, region=region).moved(transform)


def test_a_pressure_crosses_a_curved_interface_of_two_rings(record):
    """Lame's tube cut in two. Facets are parabolas, and the two lines differ by a few 1e-6 of the radius, the
    displacements are 2e-3; so large are also the strains that Lame leaves out."""
    a, middle, b, pressure = 1.0, 1.5, 2.0, 1e-3
    expected, source = pressure * a**2 * (b**2 / middle**2 - 1) / (b**2 - a**2), "Lame; Timoshenko and Goodier, sec. 28"
    mesh = ring(a, middle, (13, 3), "in").joined(ring(middle, b, (10, 3), "out"), prefix="o ")
    law = elastic(1.0, 0.3)
    body = SolidBody(mesh, {"in": law, "o out": law}, held={"x0": "x", "o x0": "x", "x1": "y", "o x1": "y"})
    body.add(ContactPair(Surface.of(mesh.face("y1")), Surface.of(mesh.face("o y0")), stiffness=50.0, reach_mm=0.2,
                              segments=True))
    body.add(FacePressure(Surface.of(mesh.face("y0")), body.points, name="inside"))
    step = last(SolidPath(body, pressures={"inside": [pressure]}, settings=SolidSettings(penetration_mm=1e-6)).run())
    weight, found = step.state.histories[0].points.weight, step.state.contacts[0].pressure
    mean = weight @ found / weight.sum()
    assert record("ring in two parts: mean pressure between them", expected=expected, source=source, got=mean) < 5e-3
    scatter = np.sqrt(weight @ (found / mean - 1) ** 2 / weight.sum())
    assert record("ring in two parts: scatter of the pressure over its mean", expected=0.0, source="uniform", got=scatter) < 0.1


def quarter_sphere(radius, count, first):
    """Half a ball's section, its pole at the origin and its centre at (0, -radius); faces x0 (axis), y0 (equator), cap."""
    shares = growing(first, count)
    mesh = box((0, 0), (1, 1), (count, count), grading=(shares, 1 - shares[::-1]), geometry="axisymmetric")
    return mesh.moved(lambda x: np.column_stack([radius * square_to_disc(x[:, :2]), 0 * x[:, 0]]) - [0, radius, 0])


def two_spheres(count, first, depth=0.01, radii=(10.0, 6.0), young=(1.0, 0.6), poisson=0.3):
    """Ratios to Hertz of the force at a depth, and of radius and greatest pressure at the force."""
    upper = mirrored(quarter_sphere(radii[1], count + 1, 0.9 * first * radii[0] / radii[1]), 1)
    mesh = quarter_sphere(radii[0], count, first).joined(upper, prefix="u ")
    body = SolidBody(mesh, {"body": elastic(young[0], poisson), "u body": elastic(young[1], poisson)},
                     held={"x0": "x", "u x0": "x", "y0": "y"}, carried={"top": ((0, 0, 0), ["u y0"], "y")})
    body.add(ContactPair(Surface.of(mesh.face("u y1")), Surface.of(mesh.face("y1")), stiffness=10 / (first * radii[0]),
                              reach_mm=0.5, segments=True, axisymmetric=True))
    settings = SolidSettings(penetration_mm=1e-3 * depth)
    step = last(SolidPath(body, {"top": Motion().step(ways={"y": -depth})}, settings=settings).run())
    radius, modulus = 1 / sum(1 / r for r in radii), (1 - poisson**2) ** -1 / sum(1 / e for e in young)
    force = -step.loads[0, 1]
    a, peak = (0.75 * force * radius / modulus) ** (1 / 3), (6 * force * modulus**2 / (np.pi**3 * radius**2)) ** (1 / 3)
    place, pressure = places_of(body, step.state)
    area = step.state.histories[0].points.weight[pressure > 0].sum()
    near = place[:, 0] < 0.7 * a
    fitted = np.polyfit(place[near, 0] ** 2, pressure[near] ** 2, 1)      # p^2 is linear in r^2
    return force / (4 / 3 * modulus * np.sqrt(radius) * depth**1.5), np.sqrt(area / np.pi) / a, np.sqrt(fitted[1]) / peak


def test_two_elastic_spheres_press_as_hertz_says(record):
    """Radius and pressure depend on the force alone; the depth also on the balls' size, a / R = 1/25 here."""
    results = [two_spheres(*mesh) for mesh in ((10, 0.01), (14, 0.005), (18, 0.0025))]
    source = "Hertz; Johnson, Contact Mechanics, sec. 4.2"
    for k, (name, allowed) in enumerate((("force at the depth", 0.02), ("radius at the force", 0.02), ("greatest pressure", 0.02))):
        for (count, _), result in zip(((10, 0), (14, 0), (18, 0)), results, strict=True):
            error = record(f"two elastic spheres, {count} elements along the axis: {name} over Hertz", expected=1.0, source=source,
                           got=result[k])
        assert error < allowed
    errors = np.abs(np.array(results)[:, 2] - 1)
    assert errors[2] < errors[0]


def test_a_ball_on_a_bonded_incompressible_layer_needs_the_force_of_the_layered_model(record):
    """nu = 0.4995, R = 50 mm, 2 mm thick, 0.02 mm deep: axisymmetric elements against the sensor's hexahedra in a quarter."""
    law, depth, source = elastic(1.0, 0.4995), 0.02, "the layered model's slab, 27-node hexahedra"
    lines = graded(1.2, 6, 6.0, 4)
    slab = HeldSlab(lines, lines, np.array([-2.0, -1.2, -0.6, -0.2, 0.0]), [law] * 4, sides="symmetric", stiffness=500.0)
    expected = 4 * slab.press(paraboloid(50.0), depth, tolerance=1e-7).force
    mesh = box((0, -2), (6, 0), (len(lines) - 1 + 4, 4), grading=(graded(1.4, 10, 6.0, 4) / 6, np.array([0, 0.4, 0.7, 0.9, 1.0])),
               geometry="axisymmetric")
    body = pressed_by_roller(mesh, law, roller(50.0, 2.0, 16, geometry="axisymmetric", from_axis=True),
                             held={"x0": "x", "x1": "x", "y0": "xy"}, stiffness=100.0, reach_mm=0.5)
    step = last(SolidPath(body, {"roller": Motion().step(ways={"y": -depth})}, settings=SolidSettings(penetration_mm=2e-5)).run())
    # The slab's contact edge lies within its elements of 0.2 mm, under a contact of 1 mm.
    error = record("ball on a bonded layer, nu = 0.4995: force at 0.02 mm", expected=expected, source=source, got=-step.loads[0, 1])
    assert error < 0.02
