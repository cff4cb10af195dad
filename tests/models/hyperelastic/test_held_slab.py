"""What keeps elements of sheet and cover from giving way: all of them have it, it is felt late, and its slopes are right."""

from dataclasses import replace

import numpy as np
import pytest
from support.sensors import CORO

from softtact.fem.elements import HEX27, WEDGE18
from softtact.fem.solid_block import HexBlock, WedgeBlock
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.build import build_patch, build_sensor_body, build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings

SMALL = CORO.model_copy(update={"footprint_mm": (6.0, 6.0), "map_shape": (11, 11)})     # 5 x 5 frusta
DIELECTRIC = make_law("mooney_rivlin", {"c10": 0.17, "c01": 0.004}, bulk_modulus=7.0)
COVER = make_law("neo_hooke", {"c10": 0.2}, bulk_modulus=8.0)
HELD = replace(MeshSettings.draft(), slab_quartic_penalty_ratio=10.0)
BODIES = {"sensor": lambda mesh: build_sensor_body(SMALL, dielectric_law=DIELECTRIC, cover_law=COVER, mesh=mesh),
          "unit cell": lambda mesh: build_unit_cell(SMALL, dielectric_law=DIELECTRIC, cover_law=COVER, mesh=mesh),
          "patch": lambda mesh: build_patch(SMALL, (2, 2), dielectric_law=DIELECTRIC, mesh=mesh)}


@pytest.mark.parametrize("body", BODIES)
def test_the_quartic_penalty_of_each_layer_follows_its_own_shear_modulus_and_that_of_the_frusta_its_own_setting(body):
    held = BODIES[body](HELD)
    assert held.slab.solids
    for _, block in held.slab.solids:
        assert block.quartic_modulus == pytest.approx(10 * block.law.mu0)
    assert held.support.block.quartic_modulus == pytest.approx(HELD.quartic_penalty_ratio * DIELECTRIC.mu0)
    assert all(block.quartic_modulus == 0 for _, block in BODIES[body](MeshSettings.draft()).slab.solids)


def nodes_of(make):
    return {HexBlock: HEX27.nodes, WedgeBlock: WEDGE18.nodes}[make][None] * 0.3


@pytest.mark.parametrize("make", [HexBlock, WedgeBlock])
def test_it_grows_with_the_fourth_power_of_what_an_elements_pressure_misses(make):
    """Ten times the displacement, ten thousand times the energy, but for what is not linear in it (a few per cent)."""
    free, held = (make(nodes_of(make), DIELECTRIC, quartic_penalty_ratio=q) for q in (0.0, 10.0))
    way = np.random.default_rng(5).standard_normal(nodes_of(make).shape)

    def added(size):
        return held.evaluate(size * way).energy - free.evaluate(size * way).energy

    assert added(2e-3) == pytest.approx(1e4 * added(2e-4), rel=0.1)
    assert 0 < added(2e-4) < 1e-4 * free.evaluate(2e-4 * way).energy


@pytest.mark.parametrize("make", [HexBlock, WedgeBlock])
def test_its_forces_are_the_slope_of_its_energy_and_its_tangent_theirs(make):
    block = make(nodes_of(make), DIELECTRIC, quartic_penalty_ratio=10.0)
    rng = np.random.default_rng(6)
    place, way = 0.01 * rng.standard_normal(nodes_of(make).shape), rng.standard_normal(nodes_of(make).shape)
    plus, minus = (block.evaluate(place + sign * 1e-6 * way) for sign in (1, -1))
    assert block.evaluate(place).force.ravel() @ way.ravel() == pytest.approx((plus.energy - minus.energy) / 2e-6, rel=1e-7)
    difference = ((plus.force - minus.force) / 2e-6).ravel()
    product = block.tangent(place)[0] @ way.ravel()
    assert np.linalg.norm(product - difference) < 1e-6 * np.linalg.norm(difference)     # differences of steps of 1e-6 mm
