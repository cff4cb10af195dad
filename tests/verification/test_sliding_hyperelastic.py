"""An object slid aside on the hyperelastic body, against closed forms and the elastic model."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from softtact.contact.motion import Motion
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.build import plain_slab
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_motion
from softtact.models.hyperelastic.support import Support
from softtact.press.sensor import load_sensor

pytestmark = pytest.mark.slow

COARSE = MeshSettings(cover_heights=(0.0, 0.5, 1.0), cover_splits=(0, 0), far_pitches=1)
TIGHT = NewtonSettings(relative_tolerance=1e-6, smallest_scale_n=0.1, largest_penetration_mm=1e-6)


def test_a_stuck_plate_shears_a_wide_bonded_layer_by_its_modulus(record):
    """tau = G delta / h far from the sides, where a layer between two planes that do not slide is sheared alone.

    The sides are free: held ones would be felt in the middle. The law is compressible (K = 2 G), for the same reason.
    The press before adds its stress to the modulus, 0.3 % here, and sticking takes a slip of 0.1 % of the way.
    """
    shear, thickness, way = 0.5, 1.0, 0.002
    spec = load_sensor("sheet").spec
    layer = spec.layers[0].model_copy(update={"thickness_mm": thickness})
    spec = spec.model_copy(update={"footprint_mm": (10.0, 6.0), "map_shape": (13, 21), "layers": (layer,), "element_mm": 0.5,
                                   "friction": spec.friction.model_copy(update={"object": 40.0})})
    law = make_law("neo_hooke", {"c10": 0.5 * shear}, bulk_modulus=2 * shear)
    body = LayeredBody(plain_slab(spec, (law, None), COARSE, sides="free"), Support(spec.support, COARSE.contact))

    def plate(x, y):
        return np.zeros_like(x), np.tile([0.0, 0.0, -1.0], (len(x), 1))

    *_, last = press_motion(body, plate, Motion().press(depth_mm=0.001).slide(x_mm=way), 0.0, settings=TIGHT)
    slab, top = last.state.slab, body.slab.top
    middle = (np.abs(top.reference[:, 0]) < 1.0) & (np.abs(top.reference[:, 1]) < 1.0)
    got = -slab.friction_response.traction[middle, 0].mean()
    error = record("wide bonded layer under a stuck plate: shear traction, MPa", expected=shear * way / thickness,
                   source="closed form: simple shear, tau = G delta / h", got=got)
    assert error < 0.01


def test_both_models_slide_a_ball_alike_on_a_plain_sheet(record):
    """The same E and nu, small strain: force down and aside. In the elastic model pressure acts along z alone."""
    sensor = load_sensor("sheet")
    friction = sensor.spec.friction.model_copy(update={"object": 0.3})
    sensor.spec = sensor.spec.model_copy(update={"friction": friction, "footprint_mm": (10.0, 10.0), "map_shape": (21, 21)})
    sensor.mesh, sensor.solver = MeshSettings.draft(), replace(NewtonSettings.draft(), relative_tolerance=1e-4)
    ball = trimesh.creation.icosphere(subdivisions=5, radius=8.0)
    motion = Motion().press(depth_mm=0.1).slide(x_mm=0.02).slide(x_mm=0.2)
    elastic, hyper = (sensor.press(ball, motion=motion, model=model, label="") for model in ("elastic", "hyperelastic"))
    for step, name in enumerate(("pressed", "aside by 0.02 mm, mostly stuck", "aside by 0.22 mm, sliding")):
        record(f"ball on a plain sheet, {name}: force down, N", expected=elastic.normal_force_n[step], source="the elastic model",
               got=hyper.normal_force_n[step])
        assert hyper.normal_force_n[step] == pytest.approx(elastic.normal_force_n[step], rel=0.05)
        if step:
            record(f"ball on a plain sheet, {name}: force aside, N", expected=elastic.force_n[step, 0], source="the elastic model",
                   got=hyper.force_n[step, 0])
            assert hyper.force_n[step, 0] == pytest.approx(elastic.force_n[step, 0], rel=0.05)
    np.testing.assert_allclose(hyper.deformation_map_mm[-1], elastic.deformation_map_mm[-1], atol=0.05 * 0.1)
