"""The loops over elements as Warp kernels: the same numbers as the compiled ones, to rounding."""

import numpy as np
import pytest

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.materials.laws.registry import make_law
from softtact.models.solid.blocks import region_blocks
from softtact.models.solid.body import SolidBody
from softtact.models.solid.device import find_device
from softtact.models.solid.path import SolidPath, last

pytest.importorskip("warp", reason="the extra `device` is not installed")

LAWS = {
    "quadratic": make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=500),
    "logarithmic": make_law("yeoh", {"c10": 0.1, "c20": 0.01, "c30": 0.001}, bulk_over_shear=5, volumetric="logarithmic"),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS.values(), ids=list(LAWS))
@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
def test_forces_and_tangents_of_warp_are_those_of_the_compiled_loops(kind, law):
    from softtact.fem.kernels_warp import WarpKernels

    mesh = box((0, 0, 0), (1, 1, 1), (2, 1, 1))
    mesh = (in_tetrahedra(mesh) if kind == "tetrahedra" else mesh).moved(lambda x: x + 0.04 * np.sin(4 * x[:, [1, 2, 0]]))
    ((_, nodes, block),) = region_blocks(mesh, {"body": law})
    ((_, _, other),) = region_blocks(mesh, {"body": law})
    other.loops = WarpKernels("cpu")
    moved = (0.03 * np.random.default_rng(3).standard_normal(mesh.points.shape))[nodes]
    one, two = block.evaluate(moved), other.evaluate(moved)
    assert two.energy == pytest.approx(one.energy, rel=1e-12)
    np.testing.assert_allclose(two.force, one.force, atol=1e-12 * np.abs(one.force).max())
    expected = block.tangent(moved)
    np.testing.assert_allclose(other.tangent(moved), expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.slow
def test_a_body_on_warps_device_ends_where_the_compiled_one_ends():
    ends = []
    for device in ("cpu", "warp"):
        body = SolidBody(box((0, 0, 0), (1, 1, 1), (2, 2, 1)), {"body": LAWS["quadratic"]}, held={"z0": "xyz"},
                         carried={"top": ((0, 0, 1), ["z1"])}, device=device)
        ends.append(last(SolidPath(body, {"top": Motion().step(ways={"x": 0.2, "z": -0.1})}).run()).loads)
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-9, atol=1e-9)


def test_an_unknown_device_and_a_gpu_that_is_not_there_are_refused():
    import warp

    with pytest.raises(InputError, match="'tpu' is unknown"):
        find_device("tpu")
    if not warp.is_cuda_available():
        assert find_device("auto") == "cpu"
        with pytest.raises(InputError, match="finds no GPU"):
            find_device("cuda")
