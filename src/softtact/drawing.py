"""Pictures drawn in a separate process: a driver of OpenGL that fails may end its process, or never answer."""

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from softtact.progress import announce


def drawn_apart(command: Sequence[str], folder: Path, *, sentence: str, timeout_s: float,
                environment: Mapping[str, str] | None = None) -> dict[str, np.ndarray] | None:
    """Arrays by name of `images.npz`, which a command writes into the folder that is its last argument.

    None where it fails or does not answer in time, after a `sentence` on stderr.
    """
    try:
        done = subprocess.run([*command, str(folder)], capture_output=True, text=True, timeout=timeout_s, env=environment)
    except subprocess.TimeoutExpired:
        announce(f"{sentence} (no answer within {timeout_s:g} s).")
        return None
    images = folder / "images.npz"
    if done.returncode or not images.exists():
        lines = done.stderr.strip().splitlines() or ["without a message"]
        announce(f"{sentence} (status {done.returncode}: {lines[-1]:.200}).")
        return None
    with np.load(images, allow_pickle=False) as kept:
        return dict(kept)
