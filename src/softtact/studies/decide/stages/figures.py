"""The figures: maps of one object, scores of all contestants, the collapse, the learning curves, the map of robustness."""

import itertools
from typing import Any

import numpy as np
from matplotlib.patches import Patch

from softtact.evaluation.paired import compare
from softtact.files import read_csv, read_dataset
from softtact.press.plot import around_points
from softtact.reporting.style import colour, pyplot, save
from softtact.studies.decide.scoring import MEAN_READING

_FAMILY_COLOURS = {"elastic": colour("elastic"), "electrodes": "#b35806", "foundation": colour("foundation"),
                   "hyperelastic": colour("hyperelastic")}
_SHADES = {"smooth": 0.45, "stepped": 1.0}     # opacity of the bars
_CROSSES = "x+1234"     # of elastic layers and of the foundation model, in turns
_RINGS = "osD^v"        # of the hyperelastic model and of truths, in turns
_MARGIN = 1.1           # of the largest error, to which the axis of a learning curve goes
_SIGNS = {"undecided": "0.75", "holds": colour("hyperelastic"), "fails": colour("elastic")}


def draw_maps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the maps of one object at its largest force by truths and models.

    inputs: presses_MODEL (lists of one);  outputs: png, svg;  settings: models
    """
    presses = {model: read_dataset(inputs[f"presses_{model}"][0]) for model in settings["models"]}
    steps = np.flatnonzero(np.logical_and.reduce([press.converged.values == 1 for press in presses.values()]))
    step = int(steps[-1]) if len(steps) else 0
    figure = pyplot().figure(figsize=(1.9 * len(presses), 3.8), layout="constrained")
    for axes, (model, press) in zip(figure.subplots(1, len(presses), sharey=True), presses.items(), strict=True):
        image = axes.imshow(press.deformation_map_mm.values[step], origin="lower", extent=around_points(press.x, press.y),
                            cmap="viridis", vmin=0)
        axes.set_title(model.replace("_", " "), fontsize=8)
        axes.set_xlabel("x (mm)")
        figure.colorbar(image, ax=axes, orientation="horizontal", label="towards the PCB (mm)", shrink=0.9)
    figure.axes[0].set_ylabel("y (mm)")
    figure.suptitle(f"{press.attrs['item'].replace('_', ' ')} at {float(press.normal_force_n[step]):g} N", fontsize=9)
    save(figure, outputs["png"], outputs["svg"])


def draw_scores(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw every contestant's error with its interval over objects: a panel for each truth and readout, the mean reading's above.

    inputs: scores;  outputs: png, svg;  settings: seed
    """
    scores = read_csv(inputs["scores"])
    truths, readouts = (list(dict.fromkeys(scores[name])) for name in ("truth", "readout"))
    models = [model for model in dict.fromkeys(scores.model) if model != MEAN_READING]
    figure = pyplot().figure(figsize=(2.9 * len(readouts) + 0.8, 2.1 * len(truths) + 0.4), layout="constrained")
    grid = figure.subplots(len(truths), len(readouts), squeeze=False, sharey=True)
    for (row, truth), (column, readout) in ((one, other) for one in enumerate(truths) for other in enumerate(readouts)):
        axes, own = grid[row, column], scores[(scores.truth == truth) & (scores.readout == readout)]
        if not len(own):      # networks are not trained for every truth
            axes.set_axis_off()
            continue
        axes.set_title(f"truth {truth}, {readout}\n{_baseline_in_words(own)}", fontsize=8)
        axes.locator_params(axis="x", nbins=4)
        _bars(axes, own, models, settings["seed"])
        axes.set_xlabel("error over mean reading (1)")
    grid[0, 0].set_yticks(range(len(models)), models)
    grid[0, 0].invert_yaxis()      # of all panels, which share it
    figure.legend(handles=[Patch(color="0.3", alpha=shade, label=f"{kind} objects") for kind, shade in _SHADES.items()],
                  loc="outside upper center", ncols=2, fontsize=8)
    save(figure, outputs["png"], outputs["svg"])


def _bars(axes, rows, models, seed):
    """A bar for each contestant on smooth and on stepped objects."""
    for offset, (kind, shade) in enumerate(_SHADES.items()):
        for place, model in enumerate(models):
            table = rows[(rows.model == model) & (rows.kind == kind)].pivot(index="object", columns="seed", values="error_share")
            if not len(table):
                continue
            found = compare(table.to_numpy(), draws=1000, seed=seed)
            spread = [[max(found.mean - found.low, 0)], [max(found.high - found.mean, 0)]] if np.isfinite(found.low) else None
            axes.barh(place + 0.4 * offset - 0.2, found.mean, 0.38, xerr=spread, color=colour(model), alpha=shade,
                      error_kw={"lw": 0.8})


def _baseline_in_words(rows):
    """What the mean reading errs by, which would hide the contestants' differences as a bar."""
    means = rows[rows.model == MEAN_READING].groupby("kind").error_share.mean()
    return "mean reading: " + ", ".join(f"{means[kind]:.2f} ({kind})" for kind in _SHADES if kind in means)


def draw_collapse(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the lower feature's share against step over indentation.  inputs: collapse;  outputs: png, svg."""
    table = read_csv(inputs["collapse"])
    figure = pyplot().figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    crosses, rings = itertools.cycle(_CROSSES), itertools.cycle(_RINGS)
    for (family, model), own in table.groupby(["family", "model"], sort=False):
        axes.plot(own.ratio, own.lower_share, next(rings if family == "hyperelastic" else crosses), ms=4, mew=0.8, ls="", alpha=0.7,
                  color=_FAMILY_COLOURS[family], label=model, mfc="none" if model != "hyperelastic" else None)
    axes.set_xlim(0, min(4.0, float(table.ratio.max())) if len(table) else 1)
    axes.set_xlabel("step height over indentation (1)")
    axes.set_ylabel("deformation under the lower feature\nover that under the raised ones (1)")
    axes.legend(fontsize=7, ncols=2)
    save(figure, outputs["png"], outputs["svg"])


def draw_curve(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the learning curves of the networks, a row of panels for each.  inputs: learning_curve;  outputs: png, svg."""
    table = read_csv(inputs["learning_curve"])
    truths, readouts = (list(dict.fromkeys(table[name])) for name in ("truth", "readout"))
    figure = pyplot().figure(figsize=(3.6 * len(truths) + 0.4, 2.6 * len(readouts) + 0.6), layout="constrained")
    grid = figure.subplots(len(readouts), len(truths), squeeze=False, sharex=True, sharey="row")
    for (row, readout), (column, truth) in itertools.product(enumerate(readouts), enumerate(truths)):
        axes = grid[row, column]
        for model, own in table[(table.truth == truth) & (table.readout == readout)].groupby("model", sort=False):
            axes.plot(own.maps, own.error_share, "o-", ms=3, color=_FAMILY_COLOURS.get(model, "0.4"), label=model)
        axes.set_title(f"truth {truth}, {readout}", fontsize=9)
    for axes in grid[-1]:
        axes.set_xlabel("training maps")
        axes.xaxis.get_major_locator().set_params(integer=True)
    for axes, readout in zip(grid[:, 0], readouts, strict=True):
        axes.set_ylim(0, _MARGIN * table.error_share[table.readout == readout].max())     # of the whole row
        axes.set_ylabel("error over mean reading (1)")
    grid[0, 0].legend(fontsize=7)
    save(figure, outputs["png"], outputs["svg"])


def draw_robustness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw what the hyperelastic model errs less than both elastic ones in each truth: at all forces, with intervals, and at each.

    inputs: robustness;  outputs: png, svg
    """
    everything = read_csv(inputs["robustness"])
    single = [(force, rows) for force, rows in everything.groupby("force_n", sort=False) if force != "all"]
    table = everything[everything.force_n == "all"]
    names = [f"{one.law.replace('_', ' ')}, K/mu {one.bulk_over_shear:g}, "
             f"tips {'bonded' if one.tips_bonded else 'free'}, {one.mesh}"
             for one in table.itertuples()]
    figure = pyplot().figure(figsize=(7.6, 0.22 * len(table) + 1.2), layout="constrained")
    for axes, other in zip(figure.subplots(1, 2, sharey=True), ("elastic", "matched"), strict=True):
        gain, low, high = (table[f"{name}_over_{other}"].to_numpy() for name in ("gain", "low", "high"))
        axes.axvline(0, color="0.6", lw=0.8)
        for place, word in enumerate(table[f"verdict_over_{other}"]):
            axes.plot([low[place], high[place]], [place, place], "-", color=_SIGNS[word])
            axes.plot(gain[place], place, "o", ms=3, color=_SIGNS[word])
        for (force, rows), marker in zip(single, itertools.cycle("<>^vsD"), strict=False):
            axes.plot(rows[f"gain_over_{other}"], range(len(rows)), marker, ms=4, mfc="none", color="0.3", label=f"{force} N alone")
        axes.set_xlabel(f"error of {other} minus that of\nhyperelastic, over mean reading (1)", fontsize=8)
    figure.axes[0].set_yticks(range(len(names)), names, fontsize=7)
    figure.axes[0].invert_yaxis()
    if single:
        figure.axes[1].legend(fontsize=7)
    save(figure, outputs["png"], outputs["svg"])
