"""Which device a computation goes to: the processor, or a GPU that torch or Warp finds."""

import importlib
import os
import re
from pathlib import Path
from typing import Any

from softtact.errors import InputError, how_to_install

# A library's name in messages, the names of devices that it takes, and these in words.
_NAMES = {"torch": ("torch", r"cpu|auto|cuda(:\d+)?", "'cpu', 'cuda', 'cuda:1' or 'auto'"),
          "warp": ("Warp", "cpu|auto|cuda|warp", "'cpu', 'warp', 'cuda' or 'auto'")}
_DRIVERS = ("/dev/nvidiactl", "/dev/dxg", "/dev/kfd")     # NVIDIA's, that of Windows' subsystem for Linux, AMD's


def find_device(name: str, *, library: str = "torch") -> str:
    """`cpu`, or the library's name of a GPU: `auto` is one where there is one, `cuda` asks for it.

    library: torch, which also takes `cuda:1`, or warp, which sums up elements on the processor, too, under the name `warp`
    Raises InputError where the name is unknown, or the GPU that was asked for is not there.
    """
    title, pattern, choices = _NAMES[library]
    if not re.fullmatch(pattern, name):
        raise InputError(f"device={name!r} is unknown; write {choices}.")
    if name in ("cpu", "warp") or (name == "auto" and not _has_driver()):
        return name.replace("auto", "cpu")
    try:
        module: Any = importlib.import_module(library)     # seconds, which a machine without a driver need not wait for
    except ModuleNotFoundError:
        if name == "auto":
            return "cpu"
        raise InputError(f"device={name!r}: {how_to_install(library)}") from None
    if library == "warp":
        module.config.log_level = module.LOG_WARNING     # its notices would stand in a command's output
    if module.is_cuda_available() if library == "warp" else module.cuda.is_available():
        return "cuda" if name == "auto" else name
    if name == "auto":
        return "cpu"
    raise InputError(f"device={name!r}: {title} finds no GPU here; write 'cpu', or leave it out.")


def _has_driver():
    """Whether a GPU's driver may be there; for sure only on Linux."""
    return os.name == "nt" or any(Path(path).exists() for path in _DRIVERS)
