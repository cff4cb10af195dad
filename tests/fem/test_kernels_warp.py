"""The loops over elements as Warp kernels: the same numbers as the compiled ones, to rounding, on every device that is here.

Warp's processor stands for a GPU where there is none: the same kernels run on both.
"""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.sensors import CORO

from softtact.contact.motion import Motion
from softtact.devices import find_device
from softtact.errors import InputError
from softtact.fem import solid_block
from softtact.fem.assembly import SymmetricPattern, add_upper
from softtact.fem.elements import HEX20, HEX27, WEDGE18
from softtact.fem.kernels_plain import PlainLoops
from softtact.fem.solid_block import HexBlock, WedgeBlock
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.materials.laws.mooney_rivlin import MooneyRivlin
from softtact.materials.laws.ogden import Ogden2
from softtact.materials.laws.registry import make_law
from softtact.materials.laws.volumetric import Logarithmic
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.solid.blocks import region_blocks
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath, last
from softtact.press.sensor import Sensor

warp = pytest.importorskip("warp", reason="the extra `device` is not installed")
DEVICES = ["warp", *(["cuda"] if warp.is_cuda_available() else [])]
MOONEY = MooneyRivlin({"c10": 0.08, "c01": 0.02}, bulk_modulus=4.0)
OGDEN = Ogden2({"mu1": 0.15, "alpha1": 2.5, "mu2": 0.05, "alpha2": -3.0}, bulk_modulus=4.0)
SMALL = CORO.model_copy(update={"footprint_mm": (2.4, 2.4), "map_shape": (9, 9)})

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


@pytest.fixture(params=DEVICES)
def loops(request):
    from softtact.fem.kernels_warp import WarpKernels

    return WarpKernels(request.param)


def assert_alike(one, other, displacement, chosen):
    """Energy, forces and the chosen elements' tangents of two blocks agree to rounding."""
    a, b = one.evaluate(displacement), other.evaluate(displacement)
    assert a.energy > 0.1 and b.energy == pytest.approx(a.energy, rel=1e-12)     # rounding of double precision
    np.testing.assert_allclose(b.force, a.force, rtol=0, atol=1e-12 * np.abs(a.force).max())
    for precision, rounding in ((np.float64, 1e-12), (np.float32, 3e-6)):     # 27 points' sums round 24 bits a few times
        K, K_there = (each.tangent(displacement[chosen], chosen, precision=precision) for each in (one, other))
        assert K_there.dtype == precision
        np.testing.assert_allclose(K_there, K, rtol=0, atol=rounding * np.abs(K).max())


def pair(name, loops_of):
    """A block of seven elements with the compiled loops, the same one with other loops, and their displacement."""
    kind, nodes, law, options = BLOCKS[name]
    coordinates, displacement = elements(7, nodes, seed=3)
    one, other = kind(coordinates, law, **options), kind(coordinates, law, **options)
    other.loops = loops_of(one)
    return one, other, displacement


@pytest.mark.parametrize("name", BLOCKS)
def test_the_reference_loops_give_energy_forces_and_tangents_of_the_compiled_loops(name):
    def plain(block):
        elements, points, _, nodes = block.at_rest.gradients.shape
        return PlainLoops(np.zeros((elements, points, nodes)))

    assert_alike(*pair(name, plain), np.array([5, 0, 2]))


def test_a_device_gives_energy_forces_and_tangents_of_the_compiled_loops(loops):
    for name in BLOCKS:
        assert_alike(*pair(name, lambda _: loops), np.array([5, 0, 2]))


def test_an_element_turned_inside_out_is_seen_on_a_device(loops):
    coordinates, displacement = elements(3, HEX27.nodes, seed=3)
    displacement[1] = -2 * coordinates[1]
    block = HexBlock(coordinates, MOONEY)
    block.loops = loops
    assert block.evaluate(displacement) is None


def small_press(**changes):
    """A punch on 2 x 2 frusta to 0.5 N; settled to far less than the default, so that only rounding differs."""
    solver = NewtonSettings(relative_tolerance=1e-8, first_touch_tolerance_n=1e-6, kept_tangent_mm=0.0)
    sensor = Sensor(SMALL, {"dielectric": MOONEY, "cover": MOONEY}, mesh=MeshSettings.draft(), solver=solver)
    punch = trimesh.creation.cylinder(radius=0.8, height=1.0, sections=48)
    return replace(sensor, **changes).press(punch, force_n=[0.2, 0.5], model="hyperelastic", threads=1, label="")


@pytest.mark.slow
@pytest.mark.parametrize("device", DEVICES)
def test_a_press_with_its_elements_on_a_device_gives_the_same_map(device):
    alone, there = small_press(), small_press(device=device)
    assert "elements on" not in alone.solver and "elements on" in there.solver
    difference = np.abs(there.deformation_map_mm - alone.deformation_map_mm).max()
    assert difference < 1e-6 * alone.deformation_map_mm.max()


def test_a_blocks_loops_are_the_compiled_ones_unless_told_otherwise():
    assert HexBlock(*elements(1, HEX20.nodes, seed=1)[:1], MOONEY).loops is solid_block.kernels


LAWS = {
    "quadratic": make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=500),
    "logarithmic": make_law("yeoh", {"c10": 0.1, "c20": 0.01, "c30": 0.001}, bulk_over_shear=5, volumetric="logarithmic"),
}


@pytest.mark.slow
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("law", LAWS.values(), ids=list(LAWS))
@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
def test_forces_tangents_and_matrices_of_warp_are_those_of_the_compiled_loops(kind, law, device, monkeypatch):
    from softtact.fem import kernels_warp
    from softtact.fem.kernels_warp import WarpKernels

    monkeypatch.setattr(kernels_warp, "_AT_ONCE", 5)      # so that the matrix is summed up in parts

    mesh = box((0, 0, 0), (1, 1, 1), (2, 1, 1))
    mesh = (in_tetrahedra(mesh) if kind == "tetrahedra" else mesh).moved(lambda x: x + 0.04 * np.sin(4 * x[:, [1, 2, 0]]))
    ((_, nodes, block),) = region_blocks(mesh, {"body": law})
    ((_, _, other),) = region_blocks(mesh, {"body": law})
    other.loops = WarpKernels(device)
    moved = (0.03 * np.random.default_rng(3).standard_normal(mesh.points.shape))[nodes]
    one, two = block.evaluate(moved), other.evaluate(moved)
    assert two.energy == pytest.approx(one.energy, rel=1e-12)
    np.testing.assert_allclose(two.force, one.force, atol=1e-12 * np.abs(one.force).max())
    expected = block.tangent(moved)
    np.testing.assert_allclose(other.tangent(moved), expected, atol=1e-12 * np.abs(expected).max())
    pattern = SymmetricPattern(mesh.points[:, [0, 0, 0]] > 0, [nodes])      # one side is held
    values = np.zeros((2, len(pattern.indices)))
    add_upper(values[0], expected, pattern.positions(nodes))
    other.add_tangent(values[1], pattern.positions(nodes), moved)
    np.testing.assert_allclose(values[1], values[0], atol=1e-12 * np.abs(values[0]).max())


@pytest.mark.slow
@pytest.mark.parametrize("device", DEVICES)
def test_a_body_on_warps_device_ends_where_the_compiled_one_ends(device):
    ends = []
    for where in ("cpu", device):
        body = SolidBody(box((0, 0, 0), (1, 1, 1), (2, 2, 1)), {"body": LAWS["quadratic"]}, held={"z0": "xyz"},
                         carried={"top": ((0, 0, 1), ["z1"])}, device=where)
        ends.append(last(SolidPath(body, {"top": Motion().step(ways={"x": 0.2, "z": -0.1})}).run()).loads)
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-9, atol=1e-9)


def test_an_unknown_device_and_a_gpu_that_is_not_there_are_refused():
    with pytest.raises(InputError, match="device='gpu' is unknown; write 'cpu', 'warp', 'cuda', 'cuda:1' or 'auto'"):
        small_press(device="gpu")
    if not warp.is_cuda_available():
        assert find_device("auto", library="warp") == "cpu"
        with pytest.raises(InputError, match="device='cuda': Warp finds no GPU here; write 'cpu'"):
            small_press(device="cuda")


def test_what_warp_says_of_itself_does_not_stand_in_the_output():
    lines = ["from softtact.devices import find_device; find_device('auto', library='warp')",
             "from softtact.fem.kernels_warp import WarpKernels; WarpKernels('warp')"]
    for line in lines:
        assert subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True).stdout == ""
