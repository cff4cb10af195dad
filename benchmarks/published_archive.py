"""Time and memory of reading an archive in the published layout: `python benchmarks/published_archive.py` (--maps N, default 1000)
from the project's folder. The archive is of random numbers with 17 digits, as a program writes them; one model's files.

Base is a process that has imported the reader and read nothing; the reading runs in a process of its own.
"""

import argparse
import multiprocessing
import re
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import record

from softtact.published.archive import find_archive
from softtact.published.importing import read_archive

PAPERS_MAPS = 15400
FRAMES = 50


def write_archive(folder, maps):
    """Flat and Curved files with `maps` maps in all, a fifth of them curved; 50 frames a test."""
    rng = np.random.default_rng(1)
    for name, tests in (("Flat", maps * 4 // 5 // FRAMES), ("Curved", maps // 5 // FRAMES)):
        paths = np.array([f"{name}{chr(65 + k % 26)}/test_{k}" for k in range(tests)])
        values = pd.DataFrame(rng.uniform(0, 0.4, (tests * FRAMES * 57, 33)), columns=[f"x{k}" for k in range(33)])
        values.assign(Path=np.repeat(paths, FRAMES * 57)).to_csv(folder / f"{name}_Simulation_Abaqus.csv", index=False)
        counts = pd.DataFrame(rng.uniform(0, 2400, (tests * FRAMES, 29)), columns=["force", *(f"tax{k}" for k in range(1, 29))])
        counts["force"] = np.tile(np.linspace(1, 50, FRAMES), tests)
        counts.assign(Path=np.repeat(paths, FRAMES)).to_csv(folder / f"{name}_Real_Abaqus.csv", index=False)


def peak_mb():
    """Largest resident memory of this process so far; `ru_maxrss` would begin with that of the process that started it."""
    return int(re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024


def measure(folder):
    """Wall time, s, and memory, MB, of reading, pairing and checking."""
    base, start = peak_mb(), time.perf_counter()
    tables = read_archive(find_archive(folder, models=["hyperelastic"]))
    return {"seconds": time.perf_counter() - start, "base_mb": base, "above_base_mb": peak_mb() - base,
            "maps": sum(len(test.readings) for tests in tables.tests.values() for test in tests)}


def main():
    """Measure and record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=1000)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_archive(folder, parser.parse_args().maps)
        size_mb = sum(path.stat().st_size for path in folder.iterdir()) / 2**20
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            row = pool.apply(measure, (folder,)) | {"files_mb": size_mb}
    row["seconds_for_15400"] = row["seconds"] * PAPERS_MAPS / row["maps"]
    row["files_mb_for_15400"] = size_mb * PAPERS_MAPS / row["maps"]
    print(pd.Series(row).to_string())
    record.write("published_archive", **row)


if __name__ == "__main__":
    main()
