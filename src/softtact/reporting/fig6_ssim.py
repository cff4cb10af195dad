"""Figure 6: SSIM per grasped object for each model, with box plots over maps and trials, and the sensor's own ceiling."""

from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.reporting.style import colour, pyplot, ssim_label

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def draw(ssim: "pd.DataFrame", ceiling: "pd.DataFrame", *, choices: dict[str, Any] | None = None) -> "Figure":
    """Figure from ssim.csv and ceiling.csv; one panel a set of test data.  choices: {window, data_range} of the SSIM"""
    plt = pyplot()
    sets = [name for name in ("validation", "unseen", "grasps") if (ssim.set == name).any()]
    counts = [max(3, ssim[ssim.set == name].item.nunique()) for name in sets]
    figure, axes = plt.subplots(1, len(sets), figsize=(2.5 + 0.5 * sum(counts), 4.4), sharey=True, squeeze=False,
                                gridspec_kw={"width_ratios": counts}, layout="constrained")
    for axis, name in zip(axes[0], sets, strict=True):
        _draw_set(axis, ssim[ssim.set == name], ceiling[ceiling.set == name], name)
    axes[0, 0].set_ylabel(ssim_label(choices))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), frameon=False, ncols=3, loc="outside lower center")
    return figure


def _draw_set(axis, rows, ceiling, name):
    items, models = sorted(rows.item.unique()), sorted(rows.model.unique(), reverse=True)
    width = 0.8 / len(models)
    for m, model in enumerate(models):
        own = rows[rows.model == model]
        groups = [own[own.item == item].ssim.to_numpy() for item in items]
        at = np.arange(len(items)) + (m - 0.5 * (len(models) - 1)) * width
        axis.bar(at, [g.mean() if len(g) else 0 for g in groups], width, color=colour(model), alpha=0.55,
                 label=model)
        axis.boxplot(groups, positions=at, widths=0.6 * width, manage_ticks=False, showfliers=False,
                     medianprops={"color": "k"})
    own = [ceiling[ceiling.item == item].ssim.mean() for item in items]
    if np.isfinite(own).any():     # an archive does not say which readings repeat which
        axis.plot(np.arange(len(items)), own, "k_", ms=14, label="sensor against itself")
    axis.set_xticks(range(len(items)), [i.replace("_", " ") for i in items], rotation=60, ha="right")
    means = ", ".join(f"{rows[rows.model == model].ssim.mean():.2f}" for model in models)
    axis.set_title(f"{name}\nn = {len(rows) // len(models)}, means {means}", fontsize=9)
    axis.set_xlim(-0.6, len(items) - 0.4)
    axis.set_ylim(min(0.0, rows.ssim.min()), 1.02)
