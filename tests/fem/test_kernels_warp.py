"""The loops over elements as Warp kernels: the same numbers as the compiled ones, to rounding, on every device that is here."""

import subprocess
import sys

import numpy as np
import pytest

from softtact.contact.motion import Motion
from softtact.devices import find_device
from softtact.errors import InputError
from softtact.fem.assembly import SymmetricPattern, add_upper
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.materials.laws.registry import make_law
from softtact.models.solid.blocks import region_blocks
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath, last

warp = pytest.importorskip("warp", reason="the extra `device` is not installed")
DEVICES = ["cpu", *(["cuda"] if warp.is_cuda_available() else [])]

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
@pytest.mark.parametrize("device", [{"cpu": "warp"}.get(device, device) for device in DEVICES])
def test_a_body_on_warps_device_ends_where_the_compiled_one_ends(device):
    ends = []
    for where in ("cpu", device):
        body = SolidBody(box((0, 0, 0), (1, 1, 1), (2, 2, 1)), {"body": LAWS["quadratic"]}, held={"z0": "xyz"},
                         carried={"top": ((0, 0, 1), ["z1"])}, device=where)
        ends.append(last(SolidPath(body, {"top": Motion().step(ways={"x": 0.2, "z": -0.1})}).run()).loads)
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-9, atol=1e-9)


def test_an_unknown_device_and_a_gpu_that_is_not_there_are_refused():
    import warp

    with pytest.raises(InputError, match="'tpu' is unknown"):
        find_device("tpu", library="warp")
    if not warp.is_cuda_available():
        assert find_device("auto", library="warp") == "cpu"
        with pytest.raises(InputError, match="finds no GPU"):
            find_device("cuda", library="warp")


def test_what_warp_says_of_itself_does_not_stand_in_the_output():
    lines = ["from softtact.devices import find_device; find_device('auto', library='warp')",
             "from softtact.fem.kernels_warp import WarpKernels; WarpKernels('cpu')"]
    for line in lines:
        assert subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True).stdout == ""
