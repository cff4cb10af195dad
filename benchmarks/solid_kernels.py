"""What Warp's kernels take against the compiled loops on the processor: forces and tangents of the same elements, in turns.

    python benchmarks/solid_kernels.py [--device cuda]      writes benchmarks/results/solid_kernels.json
"""

import argparse
import time
from functools import partial

import numpy as np
import record

from softtact.fem.kernels_warp import WarpKernels
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.materials.laws.registry import make_law
from softtact.models.solid.blocks import region_blocks

LAW = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=500)
REPEATS = 5


def seconds(work):
    """Seconds that a call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def row(name, mesh, device):
    """Shortest times of both, and by how much the tangents differ."""
    ((_, nodes, block),) = region_blocks(mesh, {"body": LAW})
    ((_, _, other),) = region_blocks(mesh, {"body": LAW})
    other.loops = WarpKernels(device)
    moved = (0.01 * np.random.default_rng(0).standard_normal(mesh.points.shape))[nodes]
    expected, got = block.tangent(moved), other.tangent(moved)
    out = {"elements": name, "count": len(nodes), "device": device,
           "difference": float(np.abs(got - expected).max() / np.abs(expected).max())}
    for what in ("evaluate", "tangent"):
        times = [[seconds(partial(getattr(one, what), moved)) for one in (block, other)] for _ in range(REPEATS)]
        compiled, warp = np.min(times, axis=0)
        out |= {f"{what}_compiled_s": compiled, f"{what}_warp_s": warp, f"{what}_ratio": warp / compiled}
    return out


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    device = parser.parse_args().device
    hexahedra = box((0, 0, 0), (10, 10, 5), (8, 8, 3)).moved(lambda x: x + 0.05 * np.sin(x[:, [1, 2, 0]]))
    rows = [row("HEX27", hexahedra, device), row("TET10", in_tetrahedra(hexahedra), device)]
    for one in rows:
        print(one)
    record.write("solid_kernels", rows=rows)
