"""Write constraints.txt: the versions that are installed in this environment, and nothing else.

    make .venv/tested && .venv/bin/python scripts/write_constraints.py

To be run after an upgrade, and after a change of the packages in pyproject.toml.
"""

import json
import subprocess
import sys
from pathlib import Path

FILE = Path(__file__).resolve().parents[1] / "constraints.txt"
HEAD = "# The versions that the tests were run with (Python 3.11, x86-64 Linux); scripts/write_constraints.py writes them anew.\n"
NOT_OURS = ("pip", "setuptools", "wheel", "softtact")


def main():
    """Write the file."""
    listed = subprocess.run([sys.executable, "-m", "pip", "list", "--format", "json"], capture_output=True, text=True, check=True)
    packages = {entry["name"]: entry["version"].partition("+")[0] for entry in json.loads(listed.stdout)}     # 2.13.0+cpu: 2.13.0
    lines = [f"{name}=={packages[name]}\n" for name in sorted(packages, key=str.lower) if name.lower() not in NOT_OURS]
    FILE.write_text(HEAD + "".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
