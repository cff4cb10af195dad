"""The page of a calibration: estimates with standard deviations, residuals of each taxel, undetermined numbers."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from softtact.calibration.checks import Advice
from softtact.calibration.fit import CalibrationResult, in_words
from softtact.reporting.page import Page
from softtact.reporting.style import pyplot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_page(path: str | Path, result: CalibrationResult, *, notes: Sequence[str] = (), advice: Sequence[Advice] = ()) -> None:
    """Write the page of a calibration with its figures inside; notes: sentences on readings that were left out."""
    problem = result.problem
    noise = np.mean([one.noise_counts for one in problem.experiments])
    page = Page("Calibration of a sensor", problem.presses.sensor.spec.name, folder=Path(path).parent)
    page.opening(
        asked="Which numbers of the sensor, and which places of the objects, give the recorded counts? From "
              f"{'; '.join(one.name for one in problem.experiments)}, by the {problem.presses.model} model.",
        found=[(f"The calibrated sensor misses the recorded counts by {result.misfit:.2f} times the noise ({noise:.1f} counts a "
                "reading).", "#found")],
        sure=[("A misfit beyond noise counts as noise in the standard deviations. The error of the model is in them, too: from "
               f"these misfits and what is known of it, {100 * result.model_error:.1f} % of a map.", "#found"),
              *(f"These presses leave open: {sentence}" for sentence in result.not_identifiable), *notes])
    page.section("The numbers", anchor="found")
    page.table(pd.DataFrame(_rows(result), columns=["number", "value", "standard deviation"]))
    page.section("Figures")
    for caption, figure in (
            ("Measured (points) and calibrated (lines) counts, summed over the taxels. Grey: forces beyond the model's validity, "
             "which are left out.", draw_time(result)),
            ("Each taxel: its gain over the common one, its zero, the root mean square of its residuals.", draw_taxels(result)),
            ("Root mean square residual of each taxel, one map for each recording; no number where none of its readings was used.",
             draw_residuals(result))):
        page.figure(_png(figure), caption)
    if advice:
        page.section("Which press would help most", anchor="advice")
        page.table(pd.DataFrame([_advised(one) for one in advice]))
    page.write(path)


def _advised(one):
    """A row for an advised press."""
    return {"object": one.candidate.name, "place: x, y in mm, angle in degrees": ", ".join(map(str, one.candidate.place)),
            "up to, N": f"{one.largest_n:.3g}", "information, nats": f"{one.information:.2f}",
            "mean deviation of the gains afterwards": f"{100 * one.gain_deviation:.2f} %"}


def _rows(result):
    """(name, value, deviation) of the numbers common to all taxels, and of the range of the others."""
    scale, gain = result.linear.scale, result.linear.gain / result.linear.scale
    yield "common gain, counts at dC/C0 = 1", f"{scale:.1f}", f"{100 * result.deviation('ln scale'):.2f} %"
    yield ("gains over the common one, least to largest", f"{gain.min():.3f} to {gain.max():.3f}",
           f"{100 * result.gain_deviation.mean():.2f} % in the mean")
    yield ("zeros, least to largest, counts", f"{result.linear.zero.min():.1f} to {result.linear.zero.max():.1f}",
           f"{result.zero_deviation.mean():.2f} in the mean")
    for name, value in zip(result.problem.names, result.vector, strict=True):
        shown, deviation = (np.exp(value), f"{100 * result.deviation(name):.2f} %") if name.startswith("ln ") else (
            value, f"{result.deviation(name):.3g}")
        unit = {"x": " (mm)", "y": " (mm)", "angle": " (degrees)", "ln time": " (s)", "cover": " over the sensor's"}
        yield in_words(name) + unit.get(name.rpartition(" ")[0] or name, ""), f"{shown:.4g}", deviation


def draw_time(result: CalibrationResult) -> "Figure":
    """Sums of counts over time, measured and calibrated: a panel for each recording."""
    experiments = result.problem.experiments
    figure, axes = pyplot().subplots(1, len(experiments), figsize=(3.4 * len(experiments), 2.8), squeeze=False,
                                     layout="constrained")
    for axis, one, counts, valid in zip(axes[0], experiments, result.counts, result.problem.valid_n, strict=True):
        time = one.bins @ one.time_s
        axis.plot(time, one.counts.sum(axis=(1, 2)), ".", color="0.4", ms=3, label="measured")
        axis.plot(time, counts.sum(axis=(1, 2)), color="#1f4e79", lw=1.2, label="calibrated")
        low, high = axis.get_ylim()
        axis.fill_between(time, low, high, where=one.force_of_bins > valid, color="0.9", zorder=0)
        axis.set(title=Path(one.name).name, xlabel="time (s)", ylim=(low, high))
    axes[0, 0].set_ylabel("sum of counts")
    axes[0, 0].legend(frameon=False, fontsize=8)
    return figure


def draw_taxels(result: CalibrationResult) -> "Figure":
    """Maps of gains, zeros and residuals."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 3, figsize=(9.5, 4.2), layout="constrained")
    gain = 100 * (result.linear.gain / result.linear.scale - 1)
    rms = _root_mean_square(np.concatenate(_residuals(result)))
    for axis, values, title, unit, cmap in ((axes[0], gain, "gain over the common one", "%", "PuOr"),
                                            (axes[1], result.linear.zero, "zero", "counts", "PuOr"),
                                            (axes[2], rms, "residual, root mean square", "counts", "viridis")):
        limit = _largest(np.abs(values))
        _draw_map(figure, axis, values, title, unit, cmap, (-limit, limit) if cmap == "PuOr" else (0.0, limit))
    return figure


def draw_residuals(result: CalibrationResult) -> "Figure":
    """A map of the root mean square residuals for each recording."""
    experiments, maps = result.problem.experiments, [_root_mean_square(part) for part in _residuals(result)]
    figure, axes = pyplot().subplots(1, len(maps), figsize=(3.2 * len(maps), 4.2), squeeze=False, layout="constrained")
    highest = _largest(np.stack(maps))
    for axis, one, values in zip(axes[0], experiments, maps, strict=True):
        _draw_map(figure, axis, values, Path(one.name).name, "counts", "viridis", (0.0, highest))
    return figure


def _residuals(result):
    """Measured minus calibrated counts (b, row, column) of each recording, nan for readings that were left out."""
    _, inverse = result.problem.stacked()
    ends = np.cumsum([len(one.counts) for one in result.problem.experiments])[:-1]
    return [np.where(used > 0, one.counts - counts, np.nan) for one, counts, used in
            zip(result.problem.experiments, result.counts, np.split(inverse, ends), strict=True)]


def _root_mean_square(residuals):
    """Of residuals (b, row, column) that are not nan, for each taxel (row, column); nan for one without any."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.nansum(residuals**2, axis=0) / np.isfinite(residuals).sum(axis=0))


def _largest(values):
    """The end of a scale for values of which some are nan; 1 where there are none above 0."""
    return float(np.nan_to_num(values).max()) or 1.0


def _draw_map(figure, axis, values, title, unit, cmap, limits):
    image = axis.imshow(values, origin="lower", vmin=limits[0], vmax=limits[1], cmap=cmap)
    for (row, column), value in np.ndenumerate(values):
        if np.isnan(value):     # of a taxel whose readings were all left out
            continue
        light = (value - limits[0]) / (limits[1] - limits[0])
        dark = not 0.2 < light < 0.8 if cmap == "PuOr" else light < 0.6
        axis.text(column, row, f"{value:.1f}", ha="center", va="center", fontsize=7, color="white" if dark else "black")
    axis.set(title=title, xlabel="column (x)", ylabel="row (y)", xticks=range(values.shape[1]), yticks=range(values.shape[0]))
    figure.colorbar(image, ax=axis, label=unit, shrink=0.8)


def _png(figure):
    content = io.BytesIO()
    figure.savefig(content, format="png", metadata={"Software": None}, dpi=110)
    pyplot().close(figure)
    return content.getvalue()
