"""Pictures drawn in a separate process, because an OpenGL driver that fails may crash its process or hang."""

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from softtact.processes import run_tied
from softtact.progress import announce


def drawn_apart(command: Sequence[str], folder: Path, *, sentence: str, timeout_s: float,
                environment: Mapping[str, str] | None = None) -> dict[str, np.ndarray] | None:
    """Run a command that writes `images.npz` into the folder, its last argument; return the arrays of that file by name.

    Returns None, and prints `sentence` on stderr, if the command fails or takes longer than `timeout_s`.
    """
    try:
        done = run_tied([*command, str(folder)], capture_output=True, text=True, timeout=timeout_s, env=environment)
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
