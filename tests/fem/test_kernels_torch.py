"""Elements summed on a device of torch, held against the compiled loops: the same numbers to rounding.

Torch's processor stands for a GPU where there is none: the same text runs on both.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from support.sensors import CORO

from softtact.errors import InputError
from softtact.fem import kernels_torch, solid_block
from softtact.fem.elements import HEX20, HEX27, WEDGE18
from softtact.fem.kernels_torch import DeviceKernels
from softtact.fem.solid_block import HexBlock, WedgeBlock
from softtact.materials.laws.mooney_rivlin import MooneyRivlin
from softtact.materials.laws.ogden import Ogden2
from softtact.materials.laws.volumetric import Logarithmic
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.press.sensor import Sensor

MOONEY = MooneyRivlin({"c10": 0.08, "c01": 0.02}, bulk_modulus=4.0)
OGDEN = Ogden2({"mu1": 0.15, "alpha1": 2.5, "mu2": 0.05, "alpha2": -3.0}, bulk_modulus=4.0)
SMALL = CORO.model_copy(update={"footprint_mm": (2.4, 2.4), "map_shape": (9, 9)})
GPU = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")


def elements(count, nodes, seed):
    """Coordinates and displacements (count, nodes, 3): edges 2 long moved by up to 0.1, then strained by some 0.2."""
    rng = np.random.default_rng(seed)
    coordinates = nodes + 0.1 * rng.uniform(-1, 1, (count, *nodes.shape))
    strain = 0.2 * rng.uniform(-1, 1, (count, 3, 3))
    return coordinates, np.einsum("emj,eij->emi", coordinates, strain) + 0.02 * rng.uniform(-1, 1, coordinates.shape)


BLOCKS = {
    "27 nodes, all of the volume's parts": (HexBlock, HEX27.nodes, MOONEY,
                                            {"trilinear": True, "unprojected_penalty_ratio": 0.5, "quartic_penalty_ratio": 100.0}),
    "20 nodes, 8 points": (HexBlock, HEX20.nodes, MOONEY, {"reduced": True}),
    "27 nodes, a volumetric function that is not quadratic": (
        HexBlock, HEX27.nodes, MooneyRivlin({"c10": 0.08, "c01": 0.02}, bulk_modulus=4.0, volumetric=Logarithmic),
        {"trilinear": True, "quartic_penalty_ratio": 100.0}),
    "wedge, a law of stretches": (WedgeBlock, WEDGE18.nodes, OGDEN, {"quartic_penalty_ratio": 10.0}),
}


@pytest.fixture(params=["cpu", pytest.param("cuda", marks=GPU)])
def loops(request):
    return DeviceKernels(request.param)


def test_a_device_gives_energy_forces_and_tangents_of_the_compiled_loops(loops):
    for name in BLOCKS:
        kind, nodes, law, options = BLOCKS[name]
        coordinates, displacement = elements(7, nodes, seed=3)
        block, there = kind(coordinates, law, **options), kind(coordinates, law, **options)
        there.loops = loops
        one, other = block.evaluate(displacement), there.evaluate(displacement)
        assert one.energy > 0.1 and other.energy == pytest.approx(one.energy, rel=1e-12)     # rounding of double precision
        np.testing.assert_allclose(other.force, one.force, rtol=0, atol=1e-12 * np.abs(one.force).max())
        chosen = np.array([5, 0, 2])
        for precision, rounding in ((np.float64, 1e-12), (np.float32, 3e-6)):     # 27 points' sums round 24 bits a few times
            K, K_there = (each.tangent(displacement[chosen], chosen, precision=precision) for each in (block, there))
            assert K_there.dtype == precision
            np.testing.assert_allclose(K_there, K, rtol=0, atol=rounding * np.abs(K).max())


@pytest.mark.slow
def test_all_that_the_sums_make_lies_on_the_device_of_their_arguments():
    """Torch's `meta` device stands for a GPU here: it has no numbers, and refuses to be mixed with the processor as a GPU does."""
    e, g, m, there = 2, 27, 20, {"device": "meta", "dtype": torch.float64}
    G, w = torch.empty(e, g, 3, m, **there), torch.empty(e, g, **there)
    F, C, J = kernels_torch._kinematics(G, torch.empty(e, m, 3, **there))
    stress, moduli = torch.empty(e, g, 6, **there), torch.empty(e, g, 6, 6, **there)
    force = kernels_torch._forces(F, J, G, w, stress, w)
    A, inverse = kernels_torch._moduli(F, w, stress, moduli, w, w)
    basis, gram_inverse = torch.empty(g, 4, **there), torch.empty(e, 4, 4, **there)
    change = torch.empty(e, g, 3 * m, **there)
    K = [kernels_torch._volumetric(change, basis, gram_inverse, w, stiffness, quartic)
         for stiffness in (1.0, w) for quartic in (None, w)]
    results = [C, J, force, inverse, kernels_torch._products(A, G), *K]
    assert {str(one.device) for one in results} == {"meta"} and force.shape == (e, 3 * m) and K[0].shape == (e, 3 * m, 3 * m)


def test_an_element_turned_inside_out_is_seen_on_a_device(loops):
    coordinates, displacement = elements(3, HEX27.nodes, seed=3)
    displacement[1] = -2 * coordinates[1]
    block = HexBlock(coordinates, MOONEY)
    block.loops = loops
    assert block.evaluate(displacement) is None


@pytest.fixture(scope="module")
def alone():
    """The press by the compiled loops."""
    return small_press()


def small_press(**changes):
    """A punch on 2 x 2 frusta to 0.5 N; settled to far less than the default, so that only rounding differs."""
    solver = NewtonSettings(relative_tolerance=1e-8, first_touch_tolerance_n=1e-6, kept_tangent_mm=0.0)
    sensor = Sensor(SMALL, {"dielectric": MOONEY, "cover": MOONEY}, mesh=MeshSettings.draft(), solver=solver)
    punch = trimesh.creation.cylinder(radius=0.8, height=1.0, sections=48)
    return replace(sensor, **changes).press(punch, force_n=[0.2, 0.5], model="hyperelastic", threads=1, label="")


def test_a_press_with_its_elements_on_a_device_gives_the_same_map(monkeypatch, loops, alone):
    assert "elements on" not in alone.solver
    monkeypatch.setattr("softtact.press.sensor.find_device", lambda name: {"there": loops.device}[name])
    there = small_press(device="there")
    assert there.solver.endswith(f"elements on {loops.device}")
    difference = np.abs(there.deformation_map_mm - alone.deformation_map_mm).max()
    assert difference < 1e-6 * alone.deformation_map_mm.max()


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_a_gpu_that_is_not_there_is_refused_and_auto_takes_the_processor():
    with pytest.raises(InputError, match="device='cuda': torch finds no GPU here; write 'cpu'"):
        small_press(device="cuda")
    assert "elements on" not in small_press(device="auto").solver


def test_a_device_of_an_unknown_name_is_refused():
    with pytest.raises(InputError, match="device='gpu' is unknown; write 'cpu', 'cuda', 'cuda:1' or 'auto'"):
        small_press(device="gpu")


def test_a_blocks_loops_are_the_compiled_ones_unless_told_otherwise():
    assert HexBlock(*elements(1, HEX20.nodes, seed=1)[:1], MOONEY).loops is solid_block.kernels
