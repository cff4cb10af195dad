"""Figure 6: SSIM per grasped object for each model, with box plots over maps and trials, the sensor's ceiling, and the
predictors without a network.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.reporting.style import colour, pyplot, ssim_label
from softtact.reporting.words import PREDICTORS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# Marks of the predictors without a network: those that ignore the map are the same for both models, others are of SHOWN_MODEL.
BASELINES = {"zeros": "x", "mean_reading": "_", "nearest_map": "1", "ridge": "+", "quadratic": "^", "gap_formula": "D"}
SHOWN_MODEL = "hyperelastic"     # its maps are the input of the baselines, if the study has them


def draw(ssim: "pd.DataFrame", ceiling: "pd.DataFrame", baselines: "pd.DataFrame | None" = None, *,
         choices: dict[str, Any] | None = None) -> "Figure":
    """Figure from ssim.csv, ceiling.csv and baselines.csv; one panel per set of test data.

    choices: {window, data_range} of the SSIM
    """
    plt = pyplot()
    sets = [name for name in ("validation", "unseen", "grasps") if (ssim.set == name).any()]
    counts = [max(3, ssim[ssim.set == name].item.nunique()) for name in sets]
    figure, axes = plt.subplots(1, len(sets), figsize=(2.5 + 0.5 * sum(counts), 5.0), sharey=True, squeeze=False,
                                gridspec_kw={"width_ratios": counts}, layout="constrained")
    for axis, name in zip(axes[0], sets, strict=True):
        _draw_set(axis, ssim[ssim.set == name], ceiling[ceiling.set == name], name)
        if baselines is not None:
            _draw_baselines(axis, baselines[baselines.set == name], sorted(ssim[ssim.set == name].item.unique()))
    axes[0, 0].set_ylabel(ssim_label(choices))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), frameon=False, ncols=5, loc="outside lower center", fontsize=8)
    return figure


def _draw_baselines(axis, rows, items):
    """A mark for each predictor and item."""
    models = sorted(rows.model.unique())
    shown = rows[rows.model == (SHOWN_MODEL if SHOWN_MODEL in models else models[0])]
    means = shown.groupby(["predictor", "item"]).ssim.mean()
    for name, mark in BASELINES.items():
        if name in means.index.get_level_values("predictor"):
            axis.plot(np.arange(len(items)), means[name].reindex(items), mark, color="#b03060", ms=6 if mark != "_" else 16,
                      mfc="none", label=PREDICTORS[name])


def _draw_set(axis, rows, ceiling, name):
    items, models = sorted(rows.item.unique()), sorted(rows.model.unique(), reverse=True)
    width = 0.8 / len(models)
    for m, model in enumerate(models):
        of_model = rows[rows.model == model]
        groups = [of_model[of_model.item == item].ssim.to_numpy() for item in items]
        at = np.arange(len(items)) + (m - 0.5 * (len(models) - 1)) * width
        axis.bar(at, [g.mean() if len(g) else 0 for g in groups], width, color=colour(model), alpha=0.55,
                 label=model)
        axis.boxplot(groups, positions=at, widths=0.6 * width, manage_ticks=False, showfliers=False,
                     medianprops={"color": "k"})
    repeated = [ceiling[ceiling.item == item].ssim.mean() for item in items]
    if np.isfinite(repeated).any():     # missing for an archive, which does not state repetitions
        axis.plot(np.arange(len(items)), repeated, "k_", ms=14, label="sensor against itself")
    axis.set_xticks(range(len(items)), [i.replace("_", " ") for i in items], rotation=60, ha="right")
    means = ", ".join(f"{rows[rows.model == model].ssim.mean():.2f}" for model in models)
    axis.set_title(f"{name}\nn = {len(rows) // len(models)}, means {means}", fontsize=9)
    axis.set_xlim(-0.6, len(items) - 0.4)
    axis.set_ylim(min(0.0, rows.ssim.min()) - 0.02, 1.02)
