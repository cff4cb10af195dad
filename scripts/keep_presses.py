"""Keep presses and trainings of a study that takes longer than one sitting in files small enough to commit, and put them back.

    python scripts/keep_presses.py keep config/decide.yaml
    python scripts/keep_presses.py restore config/decide.yaml

`keep` writes results/STUDY/presses/MODEL/ITEM.nc of the hyperelastic models, as far as they are there, to
benchmarks/results/presses/STUDY/MODEL/ITEM.npz: 14 kB in place of 1 MB. Maps are rounded to 0.1 um; fields that no later stage
reads are left out. `restore` writes those that are missing back, if the study's settings are still those of their presses. The
objects have to be drawn before, else the workflow takes them for newer. Snakemake then makes the rest. Scores of trained networks
and their learning curves are kept in benchmarks/results/presses/STUDY/learning.csv and curves.csv, and put back once the readings
are there from which networks learn.
"""

import argparse
import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import xarray

from softtact.errors import InputError
from softtact.files import PROVENANCE, atomic_path, digest, read_arrays, read_csv, read_dataset, read_yaml, write_csv, write_dataset
from softtact.studies.jobs import paths_of
from softtact.studies.registry import checked_study

ROOT = Path(__file__).resolve().parents[1]
RECORD = ROOT / "benchmarks" / "results" / "presses"
TRAINED = {"learn": "learning.csv", "trace_curve": "curves.csv"}     # {stage: record}; a curve ends with scores, which come first
MAP, STEP_MM = "deformation_map_mm", 1e-4


def packed(data: xarray.Dataset) -> dict[str, np.ndarray]:
    """The arrays of a press' record: the map, and all that has no value for each point of the map.

    The map is rounded and differenced along each axis. Of these small numbers -n is stored as 2n - 1 and n as 2n, and their four
    bytes lie in planes of their own, of which three are zero nearly everywhere, so that they compress.
    """
    rounded = np.round(data[MAP].values / STEP_MM)
    there = np.isfinite(rounded).all(axis=(1, 2))      # a load step that was not reached has none
    whole = np.where(there[:, None, None], rounded, 0).astype(np.int64)
    for axis in range(3):
        whole = np.diff(whole, axis=axis, prepend=0)
    small = {name: one for name, one in data.variables.items() if not {"y", "x"} <= set(one.dims)}
    about = {"attributes": data.attrs, "map": data[MAP].attrs,
             "small": {name: [list(one.dims), str(one.dtype), one.values.tolist(), one.attrs] for name, one in small.items()}}
    counted = np.where(whole < 0, -2 * whole - 1, 2 * whole).astype("<u4")
    planes = np.moveaxis(counted[..., None].view(np.uint8), -1, 0)
    return {"map": np.ascontiguousarray(planes), "there": there, "about": np.array(json.dumps(about, default=_plain))}


def unpacked(arrays: dict[str, np.ndarray]) -> xarray.Dataset:
    """The data set of a press' record, its map within 0.05 um of the press'."""
    about = json.loads(str(arrays["about"]))
    planes = np.ascontiguousarray(np.moveaxis(arrays["map"], 0, -1))
    counted = planes.view("<u4")[..., 0].astype(np.int64)
    whole = np.where(counted % 2, -(counted + 1) // 2, counted // 2)
    for axis in range(3):
        whole = np.cumsum(whole, axis=axis)
    maps = np.where(arrays["there"][:, None, None], STEP_MM * whole, np.nan)
    variables = {name: (dims, np.array(values, kind), of) for name, (dims, kind, values, of) in about["small"].items()}
    attributes = {name: np.array(value) if isinstance(value, list) else value for name, value in about["attributes"].items()}
    data = xarray.Dataset({MAP: (("step", "y", "x"), maps, about["map"]), **variables}, attrs=attributes)
    return data.set_coords([name for name in ("x", "y") if name in data])


def _plain(value):
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def keep(jobs: list, study: str) -> int:
    """Write the records of the presses that are there and have none, or one of other settings; how many."""
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=True)
    count = 0
    for press, record, settings in _pairs(jobs, study):
        if press.exists() and not (record.exists() and _of(_read(record), settings)):
            record.parent.mkdir(parents=True, exist_ok=True)
            data = read_dataset(press)
            with atomic_path(record) as temporary, temporary.open("wb") as file:
                np.savez_compressed(file, **packed(data.assign_attrs(commit=commit.stdout.strip())))
            count += 1
    return count


def restore(jobs: list, study: str) -> tuple[int, int]:
    """Write the presses that are missing and have a record; how many, and how many records are of other settings."""
    missing = [path for job in jobs if job.stage == "draw_object" for path in job.made().values() if not Path(str(path)).exists()]
    if missing:
        raise InputError(f"{missing[0]} is missing, and {len(missing) - 1} more: draw the study's objects before its presses are "
                         f"restored (snakemake --cores all --until draw_object --configfile FILE).")
    count = other = 0
    for press, record, settings in _pairs(jobs, study):
        if press.exists() or not record.exists():
            continue
        data = _read(record)
        if not _of(data, settings):
            other += 1
            continue
        press.parent.mkdir(parents=True, exist_ok=True)
        write_dataset(press, data, seed=None, settings=settings)
        count += 1
    return count, other


def keep_trainings(jobs: list, study: str) -> int:
    """Write the scores of the trainings that are done, beside those that were kept before; how many."""
    count = 0
    for stage, record in TRAINED.items():
        kept = _kept_scores(study, record)
        for path, name, job in _trainings(jobs, stage):
            if path.exists():
                kept[name] = read_csv(path).assign(training=name, settings=digest(job.settings))
        if kept:
            write_csv(RECORD / study / record, pd.concat(kept.values()))
        count += len(kept)
    return count


def restore_trainings(jobs: list, study: str) -> tuple[int, int]:
    """Write the scores that are missing and were kept; how many, and how many have to wait for their readings or changed."""
    count = left = 0
    for stage, record in TRAINED.items():
        kept = _kept_scores(study, record)
        for path, name, job in _trainings(jobs, stage):
            if path.exists() or name not in kept:
                continue
            ready = all(Path(one).exists() for one in paths_of(job.inputs))
            if not ready or set(kept[name].settings) != {digest(job.settings)}:
                left += 1
                continue
            write_csv(path, kept[name].drop(columns=["training", "settings"]))
            count += 1
    return count, left


def _kept_scores(study, record):
    """{training: its rows} of a record."""
    path = RECORD / study / record
    return dict(iter(read_csv(path).groupby("training", sort=False))) if path.exists() else {}


def _trainings(jobs, stage):
    """(scores, name, job) of a stage's jobs that train a network."""
    for job in jobs:
        if job.stage == stage:
            (path,) = job.made().values()
            yield Path(str(path)), "/".join(job.wildcards.values()), job


def commits(study: str) -> Counter[str]:
    """{commit: presses that were kept at it}; empty for a study without records."""
    return Counter(str(_read(record).attrs["commit"]) for record in sorted((RECORD / study).glob("*/*.npz")))


def _read(record):
    with read_arrays(record) as arrays:
        return unpacked(dict(arrays.items()))


def _of(data, settings):
    """Whether a press was made with a job's settings."""
    return data.attrs[PROVENANCE[1]] == digest(settings)


def _pairs(jobs, study):
    """(press, record, settings) of the jobs that press one item each."""
    for job in jobs:
        if job.stage == "press":
            press = Path(str(job.made()["press"]))
            yield press, RECORD / study / press.parent.name / f"{press.stem}.npz", job.settings


def main() -> None:
    """Keep or restore, and say how many."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("keep", "restore"))
    parser.add_argument("configuration", type=Path)
    options = parser.parse_args()
    try:
        opened = checked_study(read_yaml(options.configuration, missing="there is no such configuration."), options.configuration)
        jobs, name = opened.jobs(f"results/{opened.study.name}"), opened.study.name
        if options.what == "keep":
            print(f"{keep(jobs, name)} presses and {keep_trainings(jobs, name)} trainings kept in "
                  f"{(RECORD / name).relative_to(ROOT)}")
        else:
            count, other = restore(jobs, name)
            trained, left = restore_trainings(jobs, name)
            print(f"{count} presses restored to results/{name}/presses; {other} records are of other settings and were left. "
                  f"{trained} trainings restored; {left} are of other settings, or wait for the readings and maps of the presses "
                  "(snakemake --cores all --until read_truth --configfile FILE, then restore again).")
    except InputError as error:
        sys.exit(f"keep_presses: {error}")


if __name__ == "__main__":
    main()
