"""Time and memory of a study's jobs: Snakemake's benchmark of each, summed by stage."""

import os
import platform
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.files import read_csv

COLUMNS = ["stage", "jobs", "total_s", "mean_s", "longest_s", "largest_memory_mb"]


def run_record(folder: str | Path) -> pd.DataFrame:
    """A row for each stage with a benchmark below `folder`, and one for all: seconds of wall time, memory in MB.

    Each job counts with its last run, even if that was in an earlier run of the workflow. The report's job is left out.
    """
    rows = []
    for stage in sorted(path for path in Path(folder).glob("*") if path.is_dir() and path.name != "report"):
        jobs = pd.concat([_read(path) for path in sorted(stage.rglob("*.tsv"))] or [pd.DataFrame({"s": [], "max_rss": []})])
        if len(jobs):
            rows.append(_row(stage.name, jobs.s.to_numpy(), jobs.max_rss.to_numpy()))
    if rows:
        seconds = np.array([(row["jobs"], row["total_s"], row["longest_s"], row["largest_memory_mb"]) for row in rows])
        rows.append({"stage": "all", "jobs": int(seconds[:, 0].sum()), "total_s": seconds[:, 1].sum(),
                     "mean_s": seconds[:, 1].sum() / seconds[:, 0].sum(), "longest_s": seconds[:, 2].max(),
                     "largest_memory_mb": _largest(seconds[:, 3])})
    return pd.DataFrame(rows, columns=COLUMNS)


def run_sentence(record: pd.DataFrame) -> str:
    """The record in sentences, with the machine."""
    where = f"The report was made on {machine()}; {os.cpu_count()} processors."
    if not len(record):
        return f"No job has left a benchmark. {where}"
    total = record.iloc[-1]
    stages = record.iloc[:-1].sort_values("total_s", ascending=False)
    longest = ", ".join(f"{row.stage} {row.total_s:.0f} s" for row in stages.iloc[:3].itertuples())
    return (f"{total.jobs:.0f} jobs of {len(stages)} stages took {total.total_s:.0f} s of wall time in all, each counted by its "
            f"last run and on its own, also where several ran side by side; the report's own job is not among them. "
            f"Most: {longest}. {where}")


def _row(stage, seconds, memory):
    return {"stage": stage, "jobs": len(seconds), "total_s": seconds.sum(), "mean_s": seconds.mean(),
            "longest_s": seconds.max(), "largest_memory_mb": _largest(memory)}


def _read(path):
    """Seconds and memory of a benchmark. A very short job has no memory, and one killed while it wrote the file has no row."""
    if not path.stat().st_size:
        return pd.DataFrame({"s": [], "max_rss": []})
    frame = read_csv(path, sep="\t", na_values=["NA", "-"])
    return pd.DataFrame({"s": frame["s"].astype(float), "max_rss": pd.to_numeric(frame.get("max_rss"), errors="coerce")})


def _largest(values):
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    return float(known.max()) if len(known) else np.nan


def machine() -> str:
    """Processor and system in words."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            names = {line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")}
    except OSError:
        names = {platform.processor() or platform.machine()}
    return f"{', '.join(sorted(names))}; {platform.system()}; Python {platform.python_version()}"
