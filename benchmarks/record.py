"""What a benchmark leaves: benchmarks/results/NAME.json with the machine, the versions and the numbers."""

import importlib.metadata
import json
import os
import platform
import re
import shutil
import subprocess
from datetime import UTC, datetime
from pathlib import Path

RESULTS = Path(__file__).parent / "results"
THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def machine():
    """Processor, cores, and how busy they were in the last minute."""
    info = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", info.read_text()) if info.exists() else None
    return {"processor": model[1] if model else platform.processor(), "cores": os.cpu_count(),
            "load": round(os.getloadavg()[0], 1)}


def versions():
    """Of Python, the packages that compute, and CalculiX where it is installed."""
    packages = {name: _version(name) for name in ("numpy", "scipy", "numba", "pypardiso", "mkl")}
    return {"python": platform.python_version(), **packages, "ccx": _ccx_version()}


def _version(name):
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _ccx_version():
    if shutil.which("ccx") is None:
        return None
    said = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
    return re.search(r"Version (\S+)", said)[1]


def threads_of(count):
    """The environment in which every library takes `count` threads."""
    return {**os.environ, **{name: str(count) for name in THREAD_VARIABLES}}


def read(name):
    """The last record."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def write(name, **numbers):
    """Write the record and return its path."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    whole = {"date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M"), "machine": machine(), "versions": versions(), **numbers}
    path.write_text(json.dumps(whole, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path
