"""Are the tables and maps of two runs of a study the same, byte for byte?

    python benchmarks/same_twice.py                      # runs the tiny study with 1 and with 2 cores (ten minutes each), compares
    python benchmarks/same_twice.py --compare A B        # compares two result folders that are there already

Left out are what tells of the run and not of the study: times (of the presses' attributes; files of times and what holds them),
logs and benchmarks. Exit status 1 where anything else differs.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("workflow", "profiles", "config", "src")
# What holds times, or is drawn from them: tables of times, the claims on them, the policies' costs, networks by seconds, the
# searches' diaries, the page.
TIMED = ("report.html", "tables/run.csv", "tables/table3_timing.csv", "tables/claims.csv", "tables/policies.csv",
         "tables/networks.csv", "evaluation/timing.csv", "choice/presses.csv", "figures/fig8_policies", "figures/fig9_networks",
         "learning/elastic/search.journal", "learning/hyperelastic/search.journal")
SKIPPED = ("logs/", "benchmarks/", ".running")
TIMED_ATTRIBUTES = ("wall_time_s", "load_per_core")     # of presses


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("A", "B"), help="two result folders")
    folders = parser.parse_args().compare or [run(cores) for cores in (1, 2)]
    same, timed, different = compare(*folders)
    print(f"{len(same)} files are the same; {len(timed)} hold times and were left out; {len(different)} differ:")
    print("\n".join(different) or "none")
    return 1 if different else 0


def run(cores):
    """The tiny study in a folder of its own; its results."""
    folder = Path(tempfile.mkdtemp(prefix=f"softtact-{cores}-"))
    for part in PARTS:
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy2(ROOT / "Snakefile", folder)
    subprocess.run([sys.executable, "-m", "snakemake", "--cores", str(cores), "--configfile", "config/tiny.yaml"], cwd=folder,
                   check=True)
    return folder / "results/tiny"


def compare(first, second):
    """Names of the files that are the same, that hold times, and that differ or stand in one folder only, with why."""
    same, timed, different = [], [], []
    for name in sorted(names(first) | names(second)):
        if name.startswith(SKIPPED):
            continue
        if name.startswith(TIMED) or name.endswith("/timing.csv"):
            timed.append(name)
        elif not ((first / name).exists() and (second / name).exists()):
            different.append(f"{name}: in one only")
        elif (first / name).read_bytes() == (second / name).read_bytes() or same_but_for_times(first / name, second / name):
            same.append(name)
        else:
            different.append(name)
    return same, timed, different


def names(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def same_but_for_times(first, second):
    """Of two NetCDF files: are they identical without their attributes of time?"""
    if first.suffix != ".nc":
        return False
    import xarray

    a, b = (xarray.load_dataset(path, engine="h5netcdf") for path in (first, second))
    for name in TIMED_ATTRIBUTES:
        a.attrs.pop(name, None)
        b.attrs.pop(name, None)
    return a.identical(b)


if __name__ == "__main__":
    sys.exit(main())
