"""Where the elements of a solid are summed up: compiled loops on the processor, or Warp's kernels there or on a GPU."""

from collections.abc import Sequence

import numpy as np

from softtact.errors import InputError, how_to_install
from softtact.fem.kernels_plain import PlainLoops
from softtact.fem.solid_block import SolidBlock


def find_device(name: str) -> str:
    """`cpu`, `warp`, or Warp's name of a GPU; InputError where that is unknown, or not there."""
    if name in ("cpu", "warp"):
        return name
    if name not in ("auto", "cuda"):
        raise InputError(f"device={name!r} is unknown; write 'cpu', 'warp', 'cuda' or 'auto'.")
    try:
        import warp
    except ModuleNotFoundError:
        if name == "auto":
            return "cpu"
        raise InputError(f"device={name!r}: {how_to_install('warp')}") from None
    warp.config.log_level = warp.LOG_WARNING     # what it tells beside would stand in a command's output
    if warp.is_cuda_available():
        return "cuda"
    if name == "auto":
        return "cpu"
    raise InputError(f"device={name!r}: Warp finds no GPU here; write 'cpu', or leave it out.")


def sum_on(blocks: Sequence[tuple[str, np.ndarray, SolidBlock]], device: str) -> None:
    """Let Warp sum up the spatial elements."""
    from softtact.fem.kernels_warp import WarpKernels

    loops = WarpKernels("cpu" if device == "warp" else device)
    for _, _, block in blocks:
        if not isinstance(block.loops, PlainLoops):
            block.loops = loops  # type: ignore[assignment]
