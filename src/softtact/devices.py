"""Which device a computation goes to: the processor, or a GPU that torch finds."""

import os
import re
from pathlib import Path

from softtact.errors import InputError, how_to_install

_DRIVERS = ("/dev/nvidiactl", "/dev/dxg", "/dev/kfd")     # NVIDIA's, that of Windows' subsystem for Linux, AMD's


def find_device(name: str) -> str:
    """`cpu`, or torch's name of a GPU: `auto` is one where there is one, `cuda` (or `cuda:1`) asks for it.

    Raises InputError where the name is unknown, or the GPU that was asked for is not there.
    """
    if not re.fullmatch(r"cpu|auto|cuda(:\d+)?", name):
        raise InputError(f"device={name!r} is unknown; write 'cpu', 'cuda', 'cuda:1' or 'auto'.")
    if name == "cpu" or (name == "auto" and not _has_driver()):
        return "cpu"
    try:
        import torch  # seconds, which a machine without a driver need not wait for
    except ModuleNotFoundError:
        if name == "auto":
            return "cpu"
        raise InputError(f"device={name!r}: {how_to_install('torch')}") from None
    if not torch.cuda.is_available():
        if name == "auto":
            return "cpu"
        raise InputError(f"device={name!r}: torch finds no GPU here; write 'cpu', or leave it out.")
    return "cuda" if name == "auto" else name


def _has_driver():
    """Whether a GPU's driver may be there; for sure only on Linux."""
    return os.name == "nt" or any(Path(path).exists() for path in _DRIVERS)
