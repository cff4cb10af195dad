"""What Warp's kernels take against the compiled loops on the processor: forces, tangents and whole matrices, in turns.

    python benchmarks/solid_kernels.py [--device cuda] [--threads 2]     writes benchmarks/results/solid_kernels.json
                                                                         (with --device cuda: solid_kernels_cuda.json)

forces     energy and nodal forces of all elements, laws included
tangents   dense tangents of all elements, as arrays on the processor
matrix     the same summed up in the sparse matrix: on a device without a way back for the dense ones
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
from softtact.models.solid.body import SolidBody

LAW = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=500)
REPEATS = 5


def seconds(work):
    """Seconds that a call takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def shortest(works):
    """The shortest seconds of each of some calls, which run in turns; the first turn, which compiles, does not count."""
    for work in works:
        work()
    return np.min([[seconds(work) for work in works] for _ in range(REPEATS)], axis=0)


def row(name, mesh, device, threads):
    """Shortest times of both, and by how much tangents and matrices differ."""
    ((_, nodes, block),) = region_blocks(mesh, {"body": LAW})
    ((_, _, other),) = region_blocks(mesh, {"body": LAW})
    other.loops = WarpKernels(device)
    displacement = 0.01 * np.random.default_rng(0).standard_normal(mesh.points.shape)
    moved = displacement[nodes]
    expected, got = block.tangent(moved), other.tangent(moved)
    out = {"elements": name, "count": len(nodes), "device": device, "threads": threads,
           "difference": float(np.abs(got - expected).max() / np.abs(expected).max())}
    bodies = [SolidBody(mesh, {"body": LAW}, held={"z0": "xyz"}, threads=threads, device=where)
              for where in ("cpu", "warp" if device == "cpu" else device)]
    values = [matrix_of(body, displacement) for body in bodies]
    out |= {"unknowns": len(bodies[0].free),
            "matrix_difference": float(np.abs(values[1] - values[0]).max() / np.abs(values[0]).max())}
    works = {"forces": [partial(one.evaluate, moved, workers=bodies[0].workers) for one in (block, other)],
             "tangents": [partial(one.tangent, moved) for one in (block, other)],
             "matrix": [partial(matrix_of, body, displacement) for body in bodies]}
    for what, both in works.items():
        compiled, warp = shortest(both)
        out |= {f"{what}_compiled_s": compiled, f"{what}_warp_s": warp, f"{what}_ratio": warp / compiled}
    return out


def matrix_of(body, displacement):
    """Values of the body's matrix."""
    matrix = body._matrix_for([])
    body._add_blocks(matrix.data, displacement)
    return matrix.data.copy()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--divisions", type=int, nargs=3, default=(8, 8, 3))
    given = parser.parse_args()
    hexahedra = box((0, 0, 0), (10, 10, 5), tuple(given.divisions)).moved(lambda x: x + 0.05 * np.sin(x[:, [1, 2, 0]]))
    rows = []
    for kind, mesh in (("HEX27", hexahedra), ("TET10", in_tetrahedra(hexahedra))):
        rows.append(row(kind, mesh, given.device, given.threads))
        print(rows[-1], flush=True)
    name = WarpKernels(given.device).device.name
    record.write("solid_kernels" if given.device == "cpu" else f"solid_kernels_{given.device}", device=name, rows=rows)
