"""What the default study found, in ten sentences, each from the tables in docs/results/: no number here is typed by hand."""

import re
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from softtact.files import read_yaml
from softtact.reporting.words import in_words
from softtact.studies.hybrid.mesh_error import MESH_ERRORS, tested_meshes

LEAST_ERROR = "error, 20 um"      # the policy of the expected error that the page holds against the paper's rule


def number(value: float) -> str:
    """A number in three digits, a whole number in full."""
    return in_words(float(f"{value:.3g}")) if value != int(value) else f"{int(value):,}"


def found(folder: Path, verdicts: pd.Series, run: str) -> list[str]:
    """The sentences that the tables in a folder allow.

    verdicts: of the claims, by the rules of today;  run: the sentence of `reporting.run_record` on the run's jobs and time
    """
    counts = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.value_counts().items())
    sentences = [f"The rules of today make of the {len(verdicts)} claims that were judged: {counts}."]
    meshes = tested_meshes(read_yaml(folder / "config.yaml", missing="the page names the meshes of the tested models."))
    tables = {path.stem: pd.read_csv(path) for path in sorted(folder.glob("*.csv"))}
    for name, words in (("networks", _networks), ("claims", _difference), ("seeds", _seeds), ("policies", _policies),
                        ("table3_timing", _times)):
        if name in tables:
            sentences += words(tables[name], meshes) if words is _networks else words(tables[name])
    jobs = re.search(r"(\d+) jobs of \d+ stages took (\d+) s", run)
    return sentences + ([f"The run had {jobs[1]} jobs, which took {jobs[2]} s of wall time in all, each counted on its own."]
                        if jobs else [])


def _networks(table: pd.DataFrame, meshes: dict[str, str]) -> Iterator[str]:
    """Scores on grasped objects: the printed network, a compact one, and what needs none; meshes: of tested models, by preset."""
    of = {(row.model, row.architecture): row for row in table[table["set"] == "grasps"].itertuples()}
    hyper, elastic = (of.get((model, "printed")) for model in ("hyperelastic", "elastic"))
    if not (hyper and elastic):
        return
    mesh = meshes.get("hyperelastic")
    off = f" ({mesh} mesh, off by {MESH_ERRORS[mesh].rms} in the root mean square)" if mesh else ""
    yield (f"On grasped objects the paper's network reads the virtual sensor from hyperelastic maps{off} with a mean SSIM of "
           f"{_ssim(hyper)}, from elastic maps with {_ssim(elastic)}.")
    small = of.get(("hyperelastic", "compact")), of.get(("elastic", "compact"))
    if all(small):
        yield (f"A network of {number(small[0].weights)} weights in place of {number(hyper.weights)} reads the same objects with "
               f"{number(small[0].ssim)} and {number(small[1].ssim)}.")
    yield (f"Without a network, a quadratic of a taxel's mean deformation reaches {number(hyper.quadratic_ssim)}, the mean "
           f"training reading {number(hyper.mean_reading_ssim)}; the sensor against its own other trials has "
           f"{number(hyper.sensor_ssim)}, about the most that any model can have.")


def _difference(table: pd.DataFrame) -> Iterator[str]:
    """Whether one model is read better, by the differences on the same objects: intervals of each score alone do not tell."""
    for row in table[table.claim == "On grasped objects the hyperelastic model reads better than the elastic one"].itertuples():
        yield (f"Which maps are read better is told by differences on the same objects: {row.ours} ({row.uncertainty}). "
               f"The run judged this claim as {row.verdict}.")


def _ssim(row):
    return f"{number(row.ssim)} (95 % interval {number(row.ssim_low)} to {number(row.ssim_high)})"


def _seeds(table: pd.DataFrame) -> Iterator[str]:
    """How much the seed of a training changes."""
    for row in table[(table["set"] == "grasps") & (table.model == "hyperelastic")].iloc[:1].itertuples():
        yield (f"Over {row.seeds} seeds the {row.architecture} network's SSIM on grasped objects lies between "
               f"{number(row.ssim_least)} and {number(row.ssim_most)}.")


def _policies(table: pd.DataFrame) -> Iterator[str]:
    """What the fast models and the rules of choosing one miss of the hyperelastic maps."""
    of = {row.policy: row for row in table.itertuples()}
    if {"always elastic", "always foundation"} <= of.keys():
        elastic, foundation = of["always elastic"], of["always foundation"]
        yield (f"Elastic maps lie {number(elastic.mean_error_mm)} mm from the hyperelastic ones in the mean and "
               f"{number(elastic.largest_error_mm)} mm at most; the foundation model's {number(foundation.mean_error_mm)} mm and "
               f"{number(foundation.largest_error_mm)} mm.")
    if {"paper", LEAST_ERROR} <= of.keys():
        paper, ours = of["paper"], of[LEAST_ERROR]
        yield (f"The paper's rule of choosing a model by an object's complexity errs by {number(paper.mean_error_mm)} mm in "
               f"{number(paper.time_per_press_s)} s a press; a choice by the expected error ({LEAST_ERROR.partition(', ')[2]}) "
               f"errs by {number(ours.mean_error_mm)} mm in {number(ours.time_per_press_s)} s.")


def _times(table: pd.DataFrame) -> Iterator[str]:
    """Seconds of a map, ours and printed."""
    of = {(row.model, row.source): row.mean_s for row in table.itertuples()}
    if {(model, source) for model in ("elastic", "hyperelastic") for source in ("ours", "paper")} <= of.keys():
        shown = {place: f"{number(seconds)} s" for place, seconds in of.items()}
        yield (f"A map takes {shown['elastic', 'ours']} with the elastic and {shown['hyperelastic', 'ours']} with the hyperelastic "
               f"model; the paper prints {shown['elastic', 'paper']} and {shown['hyperelastic', 'paper']}, of another machine, "
               "solver and mesh.")
