"""Plain layers without frusta against theory: confined compression, a clamped plate, the elastic model at small loads."""

import numpy as np
import pytest
import trimesh

from softtact.contact.height_field import HeightField
from softtact.materials.laws.registry import make_law
from softtact.models.elastic.compliance import elastic_compliance
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.build import build_plain_body, lower_side, plain_slab
from softtact.models.hyperelastic.path import press_load_steps
from softtact.models.hyperelastic.support import Support
from softtact.press.sensor import Sensor
from softtact.sensors.layers import LayersSpec

YOUNG, POISSON = 1.0, 0.3
MU, BULK = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
LAW = make_law("neo_hooke", {"c10": 0.5 * MU}, bulk_modulus=BULK)
SOFT = make_law("neo_hooke", {"c10": 0.1 * MU}, bulk_modulus=0.3 * BULK)
CONFINED = BULK + 4 / 3 * MU      # N/mm2 of strain, in a layer that cannot move aside


def spec(*thicknesses_mm, side_mm=4.0, points=21, support="base", element_mm=1.0):
    """A square sensor of plain layers, from below."""
    layers = [{"material": "silicone", "thickness_mm": thickness} for thickness in thicknesses_mm]
    return LayersSpec.from_dict({
        "kind": "layers", "name": "layers", "footprint_mm": [side_mm, side_mm], "map_shape": [points, points],
        "force_range_n": [0.0, 40.0], "taxels": {"rows": 4, "columns": 4}, "support": support, "layers": layers,
        "element_mm": element_mm, "elastic_layer": {"young_mpa": YOUNG, "poisson": POISSON}})


def laws(of):
    """The stiff law below, the soft one above."""
    return dict(zip(("dielectric_law", "cover_law"), (LAW, SOFT)[:len(of.layers)], strict=False))


def ball(radius_mm):
    """Resting on the surface."""
    return trimesh.creation.icosphere(subdivisions=5, radius=radius_mm).apply_translation([0, 0, radius_mm])


def pressed(body, mesh, force_n):
    """The load step of one force."""
    try:
        return next(iter(press_load_steps(body, HeightField(mesh), [force_n])))
    finally:
        body.close()


def held_forces(body, state):
    """Forces (3,) in N on the slab of what holds it: its sides and, where it is bonded, the board."""
    held = np.setdiff1d(np.arange(3 * body.slab.nodes), body.slab.free)
    force = np.zeros(3 * body.slab.nodes)
    force[held] = state.slab.force.ravel()[held]
    return force.reshape(-1, 3).sum(axis=0)


@pytest.mark.parametrize(("thicknesses", "compliance"), [
    ((2.0,), 2.0 / CONFINED),
    ((1.0, 0.5), 1.0 / CONFINED + 0.5 / (SOFT.bulk_modulus + 4 / 3 * SOFT.mu0)),
])
def test_a_wide_plate_on_a_bonded_layer_finds_the_confined_modulus(thicknesses, compliance):
    """Depth = p sum h / (K + 4/3 mu), linear elasticity. At 1 % strain the laws curve by about as much: 1.5 % allowed."""
    of = spec(*thicknesses)
    slab = plain_slab(of, (laws(of)["dielectric_law"], laws(of).get("cover_law")), sides="symmetric")
    body = LayeredBody(slab, Support(of.support))
    force = 0.01 * of.thickness_mm / compliance * 16.0
    plate = trimesh.creation.box((8.0, 8.0, 1.0)).apply_translation([0, 0, 0.5])
    load_step = pressed(body, plate, force)
    top = -load_step.state.slab.displacement[body.slab.cover_mesh.top_nodes, 2]
    assert top.mean() == pytest.approx(force / 16.0 * compliance, rel=0.015)
    assert np.ptp(top) < 0.01 * top.mean()      # a plate, and nothing that differs from place to place


@pytest.mark.slow
def test_the_elastic_and_the_hyperelastic_model_agree_under_a_light_ball():
    """Same E and nu, 3 % of the thickness deep: 2 % of depth and map, for meshes (1 %) and stiffening (1 %)."""
    of = spec(2.0, side_mm=9.0, points=31, element_mm=0.5)
    sensor = Sensor(of, {"dielectric": LAW}, prepared_models={"elastic": elastic_compliance(of)})
    elastic, hyper = (sensor.press(ball(20.0), force_n=0.15, model=model, threads=1) for model in ("elastic", "hyperelastic"))
    assert hyper.indentation_mm == pytest.approx(elastic.indentation_mm, rel=0.02)
    assert hyper.deformation_map_mm.max() == pytest.approx(elastic.deformation_map_mm.max(), rel=0.02)
    apart = np.sqrt(((hyper.deformation_map_mm - elastic.deformation_map_mm) ** 2).mean())
    assert apart < 0.06 * np.sqrt((elastic.deformation_map_mm**2).mean())     # 5.2 %; 2.3 % with elements half as large
    volume = 0.15 * 2.0 / CONFINED     # mm3: force times thickness over modulus, by reciprocity with a uniform pressure; sides far
    for result in (elastic, hyper):
        assert result.deformation_map_mm.sum() * 0.3**2 == pytest.approx(volume, rel=0.02)
    assert np.isnan(hyper.frustum_compression_mm).all() and hyper.within_validity.all()
    assert hyper.tactile_map == pytest.approx(elastic.tactile_map, abs=0.03 * elastic.tactile_map.max())


@pytest.mark.slow
@pytest.mark.parametrize("support", ["base", "none"])
def test_what_holds_the_layers_carries_the_object(support):
    """Balance of the whole body: reactions of sides and board against the object. The solver leaves up to 3e-3 N at a node."""
    of = spec(1.0, 1.0, side_mm=8.0, support=support, element_mm=0.5)
    body = build_plain_body(of, **laws(of))
    load_step = pressed(body, ball(4.0), 0.5)
    assert load_step.state.force == pytest.approx(0.5, abs=3e-3)
    assert held_forces(body, load_step.state) == pytest.approx([0.0, 0.0, 0.5], abs=0.003)     # upwards
    moved = -load_step.state.slab.displacement[body.slab.bottom, 2]
    assert moved.max() > 0.02 if support == "none" else (moved == 0).all()


def test_a_sheet_free_below_bends_like_a_clamped_plate():
    """w = 0.00560 P a^2 / D under a load in the middle (Timoshenko, Theory of Plates and Shells, table 37), thin plate.

    Side over thickness is 20: shear adds some per cent to it, and the load is spread; 6 % allowed for the lower side, on which
    the object leaves no dent. The top has one of some 0.01 mm, in which the models agree within 5 % of the whole: the
    elastic one's nodes are 0.5 mm apart, about as wide as the contact.
    """
    of, force = spec(1.0, side_mm=20.0, points=21, support="none", element_mm=1.0), 0.004
    expected = 0.00560 * force * 20.0**2 / (YOUNG / (12 * (1 - POISSON**2)))
    body = build_plain_body(of, **laws(of))
    load_step = pressed(body, ball(20.0), force)
    top, middle = (-(side @ load_step.state.slab.displacement[:, 2])[0]
                   for side in (body.slab.sampling(np.zeros((1, 2))), lower_side(body.slab, np.zeros((1, 2)))))
    assert middle == pytest.approx(expected, rel=0.06)
    sensor = Sensor(of, {"dielectric": LAW}, prepared_models={"elastic": elastic_compliance(of)})
    elastic = sensor.press(ball(20.0), force_n=force, model="elastic", threads=1)
    assert elastic.deformation_map_mm[0, 10, 10] == pytest.approx(top, rel=0.05)
    assert elastic.tactile_map.max() < 5.0       # it bends, and hardly becomes thinner
