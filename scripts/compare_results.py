"""Compare the results of one study made twice: every table and every map byte by byte, but for times.

    python scripts/compare_results.py ONE/results OTHER/results

Left out: columns and attributes of wall times (their names end in `_s`, or are `machine` or `load_per_core`), files named
timing.csv, what is made of nothing but times (table3_timing.csv, the claims on times), and what tells a run (run.csv, logs,
benchmarks, pictures, pages, Optuna's journal).
Everything else that is there must be there in both, and equal. Exit status 1 where it is not.
"""

import json
import sys
from pathlib import Path

import pandas as pd
import xarray

OF_TIMES = {"timing.csv", "table3_timing.csv", "run.csv"}


def main(one, other):
    files = {path.relative_to(one) for path in compared(one)}, {path.relative_to(other) for path in compared(other)}
    different = sorted(files[0] ^ files[1])
    same = 0
    for name in sorted(files[0] & files[1]):
        equal = content(one / name) == content(other / name)
        same += equal
        different += [] if equal else [name]
    print(f"{same} files are the same" + "".join(f"\ndifferent, or there but once: {name}" for name in different))
    return 1 if different or not same else 0


def compared(folder):
    """Tables, maps and cards below a folder, but for those of times."""
    kinds = {".csv", ".nc", ".json"}
    return [path for path in folder.rglob("*") if path.suffix in kinds and path.name not in OF_TIMES and "logs" not in path.parts]


def content(path):
    """What of a file must be the same, as bytes."""
    if path.suffix == ".csv":
        header = path.read_text(encoding="utf-8").split("\n", 1)[0].split(",")
        if path.name != "claims.csv" and not any(_of_times(name) for name in header):
            return path.read_bytes()
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
        kept = table[[name for name in table.columns if not _of_times(name)]]
        if path.name == "claims.csv":
            kept = kept[~kept.evidence.str.contains("timing")]
        return kept.to_csv(index=False).encode()
    if path.suffix == ".nc":
        data = xarray.load_dataset(path, engine="h5netcdf")
        attributes = sorted((name, value) for name, value in data.attrs.items() if not _of_times(name))
        return b"".join(_bytes(name, data[name]) for name in sorted(data.variables)) + repr(attributes).encode()
    return json.dumps(json.loads(path.read_text(encoding="utf-8")), sort_keys=True).encode()


def _of_times(column):
    return column.endswith("_s") or column in ("machine", "load_per_core")


def _bytes(name, variable):
    """Name, dimensions, kind and values of a variable; texts as they read."""
    values = variable.values
    return f"{name} {variable.dims} {values.dtype}".encode() + (repr(values.tolist()).encode() if values.dtype == object
                                                                else values.tobytes())


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:3])))
