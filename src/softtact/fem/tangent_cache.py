"""Tangents of like elements, each kept until its nodes have moved against each other.

Most cells are condensed again because a frustum's contact changed. Their elements' tangents, half of the work, are still good then.
"""

import numpy as np

from softtact.fem.solid_block import SolidBlock
from softtact.fem.static_condensation import packed


class TangentCache:
    """Of the elements (e,) of a `SolidBlock`; in single precision, upper triangles as `packed` has them."""

    def __init__(self, block: SolidBlock) -> None:
        elements, nodes = len(block.at_rest.shapes), block.at_rest.gradients.shape[3]
        self._block = block
        self._found_at = np.full((elements, nodes, 3), np.nan, dtype=np.float32)
        self._tangents = np.empty((elements, 3 * nodes * (3 * nodes + 1) // 2), dtype=np.float32)

    def at(self, displacement: np.ndarray, elements: np.ndarray, *, kept_mm: float) -> np.ndarray:
        """Tangents (b, w) of elements (b,) whose nodes' displacement (b, m, 3) is given.

        kept_mm: elements whose nodes moved by no more than that since their last tangent keep it, but for what all nodes share
        """
        shape = (displacement - displacement.mean(axis=1, keepdims=True)).astype(np.float32)
        same = np.abs(shape - self._found_at[elements]).max(axis=(1, 2)) <= kept_mm     # not so where none was found: nan
        if not same.all():
            anew = elements[~same]
            self._tangents[anew] = packed(self._block.tangent(displacement[~same], anew, precision=np.float32))
            self._found_at[anew] = shape[~same]
        return self._tangents[elements]

    def forget(self) -> None:
        """Let each element's next tangent be found anew."""
        self._found_at[:] = np.nan
