"""The cost of a study before it starts: jobs, core hours, disk.

The time of a job comes from the study's finished jobs (results/STUDY/benchmarks, wall time), else from `config/costs.yaml`, which
states where and when it was measured. A job whose files exist counts as done.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Any

from softtact.files import read_yaml
from softtact.studies.configuration import here_or_shipped
from softtact.studies.jobs import Job, paths_of

if TYPE_CHECKING:
    from softtact.studies.registry import OpenStudy


@dataclass(frozen=True)
class Cost:
    """Jobs of one stage: their number, the number left, seconds of each, and MB on disk of all of them."""

    stage: str
    jobs: int
    left: int
    each_s: float
    """Mean over the jobs left."""
    disk_mb: float = 0.0

    @property
    def hours(self) -> float:
        """Core hours of the jobs left."""
        return self.left * self.each_s / 3600


def read_costs(path: str | Path | None = None) -> dict[str, Any]:
    """The measured times of `config/costs.yaml` in the working folder, or those that ship with the package."""
    return read_yaml(here_or_shipped(path or "config/costs.yaml"), missing="there is no file of measured times; correct the path.")


def origin_of(opened: "OpenStudy", measured: Mapping[str, Any]) -> str:
    """Place and date of the measured times of a kind of study."""
    return measured.get(opened.kind, measured)["origin"]


def costs_of_jobs(opened: "OpenStudy", measured: Mapping[str, Any], folder: str | Path) -> list[Cost]:
    """[Cost] of a study with a list of jobs, in their order.

    measured: config/costs.yaml, with `seconds` and `mb` below the kind
    """
    stages: dict[str, list[Job]] = {}
    for job in opened.jobs(folder):
        stages.setdefault(job.stage, []).append(job)
    times = measured[opened.kind]
    return [_stage_cost(stage, jobs, times, Path(folder)) for stage, jobs in stages.items()]


def _stage_cost(stage, jobs, times, folder):
    left = [job for job in jobs if not all(Path(path).exists() for path in paths_of(job.made()))]
    seconds = finished_s(folder, f"{stage}/**/*.tsv") or mean(_job_s(job, times) for job in left or jobs)
    return Cost(stage, len(jobs), len(left), seconds, len(jobs) * times["mb"].get(stage, times["mb"]["any"]))


def _job_s(job, times):
    """Seconds of a job: `start` plus a time for each unit of work."""
    return times["seconds"]["start"] + sum(count * times["seconds"][unit] for unit, count in job.work.items())


def cost_lines(name: str, costs: Sequence[Cost], *, origin: str, cores: int) -> Iterator[str]:
    """The costs as a table for people."""
    width = max(len(cost.stage) for cost in costs)
    yield f"{'cost of the study ' + name:{width}}{'jobs':>7}{'left':>7}{'s each':>9}{'core hours':>12}{'MB':>8}"
    for cost in costs:
        yield f"{cost.stage:{width}}{cost.jobs:7}{cost.left:7}{cost.each_s:9.3g}{cost.hours:12.2f}{cost.disk_mb:8.0f}"
    hours = sum(cost.hours for cost in costs)
    yield (f"{'in all':{width}}{sum(cost.jobs for cost in costs):7}{sum(cost.left for cost in costs):7}{'':9}{hours:12.2f}"
           f"{sum(cost.disk_mb for cost in costs):8.0f}")
    yield (f"at most {_words(hours / cores)} on {cores} cores, without a GPU. Times are this study's own where it has run, else "
           f"{origin}")


def _words(hours):
    return f"{60 * hours:.0f} minutes" if hours < 2 else f"{hours:.0f} hours" if hours < 72 else f"{hours / 24:.1f} days"


def left_of(files: Sequence[Path]) -> int:
    """Number of files that do not exist."""
    return sum(not file.exists() for file in files)


def finished_s(folder: Path, pattern: str) -> float | None:
    """Mean wall time of the study's finished jobs, or None."""
    times = [seconds for path in folder.glob(f"benchmarks/{pattern}") if (seconds := wall_s(path)) is not None]
    return mean(times) if times else None


def wall_s(path: Path) -> float | None:
    """Wall time in s of a job from Snakemake's benchmark; None if the job was killed while it wrote the file."""
    names, *rows = [line.split("\t") for line in path.read_text(encoding="utf-8").splitlines()] or [[]]
    return float(rows[0][0]) if rows and len(rows[0]) == len(names) else None
