"""Which device a computation goes to: the processor, or a GPU that torch or Warp finds."""

import importlib
import os
import re
from pathlib import Path
from typing import Any

from softtact.errors import InputError, how_to_install, require

# For each library: its name in messages, a pattern of the device names that it accepts, and these names for a message.
_NAMES = {"torch": ("torch", r"cpu|auto|cuda(:\d+)?", "'cpu', 'cuda', 'cuda:1' or 'auto'"),
          "warp": ("Warp", r"cpu|auto|cuda(:\d+)?|warp", "'cpu', 'warp', 'cuda', 'cuda:1' or 'auto'")}
_DRIVERS = ("/dev/nvidiactl", "/dev/dxg", "/dev/kfd")     # NVIDIA's, that of Windows' subsystem for Linux, AMD's


def find_device(name: str, *, library: str = "torch") -> str:
    """The device for a name: `cpu`, or the library's name of a GPU. `auto` takes a GPU if there is one; `cuda` requires one.

    library: torch, or warp, which also sums elements up on the processor, under the name `warp`
    Raises InputError where the name is unknown, or the library or the GPU that was asked for is not there.
    """
    title, pattern, choices = _NAMES[library]
    if not re.fullmatch(pattern, str(name)):
        raise InputError(f"device={name!r} is unknown; write {choices}.")
    if name == "warp":
        require("warp", f"device={name!r}")
    if name in ("cpu", "warp") or (name == "auto" and not _has_driver()):
        return name.replace("auto", "cpu")
    try:
        module: Any = importlib.import_module(library)     # takes seconds, so only where there is a driver
    except ModuleNotFoundError:
        if name == "auto":
            return "cpu"
        raise InputError(f"device={name!r}: {how_to_install(library)}") from None
    if library == "warp":
        module.config.log_level = module.LOG_WARNING     # else its notices mix with a command's output
    if module.is_cuda_available() if library == "warp" else module.cuda.is_available():
        return "cuda" if name == "auto" else name
    if name == "auto":
        return "cpu"
    raise InputError(f"device={name!r}: {title} finds no GPU here; write 'cpu', or leave it out.")


def _has_driver():
    """Whether a GPU driver may be installed; a False is certain on Linux, other systems always give True."""
    return os.name == "nt" or any(Path(path).exists() for path in _DRIVERS)
