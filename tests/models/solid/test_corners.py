"""Large solids are solved on two levels of nodes, and give what a factor of the whole gives."""

import numpy as np
import pytest

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.materials.laws.registry import make_law
from softtact.models.solid import blocks as regions
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath, last


def law(bulk):
    return make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=bulk)


def blocks(kind, *, bulk=5.0, friction=0.0):
    """A block on a wider one, of unlike meshes, carried at its top."""
    lower, upper = box((-1, -1, -1), (1, 1, 0), (3, 3, 2), region="lower"), box((-0.6, -0.6, 0), (0.5, 0.5, 0.8), (2, 2, 2))
    if kind == "tetrahedra":
        lower, upper = in_tetrahedra(lower), in_tetrahedra(upper)
    mesh = lower.joined(upper, prefix="upper ")
    body = SolidBody(mesh, {"lower": law(bulk), "upper body": law(bulk)}, held={"z0": "z", "x0": "xyz"},     # some nodes slide
                     carried={"top": ((0, 0, 0), ["upper z1"])})
    body.add(ContactPair(Surface.of(mesh.face("upper z0")), Surface.of(mesh.face("z1")), stiffness=50.0, reach_mm=0.3,
                              friction=friction))
    return body


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["tetrahedra", "hexahedra"])
def test_two_levels_give_the_presses_of_a_factor(kind, friction, monkeypatch):
    motion = Motion().step(ways={"z": -0.1}).step(ways={"x": 0.1})
    steps = {}
    for large in (0, 10**9):
        monkeypatch.setattr(regions, "_LARGE", large)
        body = blocks(kind, friction=friction)
        assert ("two levels" in body.solver.name) == (large == 0)
        steps[large] = last(SolidPath(body, {"top": motion}).run())
        assert ("two levels" in body.solver.name) == (large == 0)     # to the end
    assert (steps[0].dissipated_mj > 1e-5) == (friction > 0)     # points slide, whose coupling GMRES solves
    # Newton's method leaves 1e-6 of the force.
    np.testing.assert_allclose(steps[0].loads, steps[10**9].loads, rtol=0, atol=1e-5 * np.abs(steps[10**9].loads).max())


def test_a_system_with_sliding_points_is_solved_with_a_factor_on_two_levels_too(monkeypatch):
    motion, found = Motion().step(ways={"z": -0.1}).step(ways={"x": 0.1}), {}
    state = last(SolidPath(blocks("tetrahedra", friction=0.3), {"top": motion}).run()).state
    for large in (0, 10**9):
        monkeypatch.setattr(regions, "_LARGE", large)
        body = blocks("tetrahedra", friction=0.3)     # which has no factor yet
        found[large] = body.solve(state, np.ones((len(body.free), 1)))
    np.testing.assert_allclose(found[0], found[10**9], rtol=0, atol=1e-5 * np.abs(found[0]).max())     # GMRES leaves 1e-6


def test_small_bodies_nearly_incompressible_ones_and_plane_ones_keep_the_factor(monkeypatch):
    assert "dissected" in blocks("tetrahedra").solver.name
    monkeypatch.setattr(regions, "_LARGE", 0)
    assert "dissected" in blocks("tetrahedra", bulk=150.0).solver.name
    plane = SolidBody(box((0, 0), (1, 1), (2, 2), geometry="plane_strain"), {"body": law(5.0)}, held={"y0": "xy"})
    assert "dissected" in plane.solver.name
