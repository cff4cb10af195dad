"""Stands in for `python -m softtact.studies`: writes small outputs that follow from the command line alone.

Usage: stub_runner.py KIND.NAME --in name=path ... --out name=path ... --settings JSON --threads N
A press, or the stage SOFTTACT_STUB_SLOW, waits SOFTTACT_STUB_WAIT_S seconds, to be caught in the middle. With
SOFTTACT_STUB_KILLED=FOLDER each stage's first job kills itself after its first output, and leaves its name in the folder.
"""

import hashlib
import os
import signal
import sys
import time
from pathlib import Path

DAMAGED = b"half of a f"     # refused, as a stage refuses what it cannot read


def main(arguments):
    stage, options = arguments[0], arguments[1:]
    pairs = list(zip(options[::2], options[1::2], strict=True))
    inputs = [path for path in (value.partition("=")[2] for option, value in pairs if option == "--in") if path]
    settings = dict(pairs)["--settings"]
    digest = hashlib.sha256((stage + settings).encode())
    for path in inputs:
        found = content(Path(path))
        if DAMAGED in found:
            sys.exit(f"{stage}: {path}: damaged; delete it and make it again.")
        digest.update(b"".join(found))
    if stage == os.environ.get("SOFTTACT_STUB_SLOW", "hybrid.simulate_press"):
        time.sleep(float(os.environ.get("SOFTTACT_STUB_WAIT_S", "0")))
    for path in (Path(value.partition("=")[2]) for option, value in pairs if option == "--out"):
        write(path, f"{stage} {path.name} {digest.hexdigest()}\n")
        kill_first(stage, path)


def kill_first(stage, path):
    """SIGKILL this process if it is the first of its stage, with a part of another file left beside the output."""
    killed = os.environ.get("SOFTTACT_STUB_KILLED")
    if killed and not Path(killed, stage).exists():
        Path(killed, stage).touch()
        path.with_name(f".{path.stem}-x7f{path.suffix}").write_bytes(DAMAGED)
        os.kill(os.getpid(), signal.SIGKILL)


def content(path):
    """Bytes of a file, or of the files of a folder."""
    return [file.read_bytes() for file in sorted(path.iterdir())] if path.is_dir() else [path.read_bytes()]


def write(path, text):
    """A file, or a folder with a file where the name has no ending."""
    if not path.suffix:
        path.mkdir(parents=True, exist_ok=True)
        path = path / "content.txt"
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text)
    temporary.replace(path)


main(sys.argv[1:])
