"""Figure 9: the architectures on the same split with their SSIM and cost, and the history of each training."""

from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.reporting.style import ARCHITECTURE_LINES, colour, pyplot, ssim_label

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# Hatch and line style mark the architecture, colour the model: distinct in grey, too.
HATCHES = {"printed": "", "searched": "..", "compact": "////"}
NO_INTERVAL = "one item:\nno interval"


def draw(networks: "pd.DataFrame", histories: "dict[tuple[str, str], pd.DataFrame]", *,
         choices: dict[str, Any] | None = None) -> "Figure":
    """Figure from networks.csv and {(model, architecture): history.csv}; the architectures of a model are side by side.

    choices: {window, data_range} of the SSIM
    """
    plt = pyplot()
    figure, (scores, loss, ssim) = plt.subplots(1, 3, figsize=(13, 4.6), layout="constrained", width_ratios=(1.3, 1, 1))
    _draw_scores(scores, networks, choices)
    for (model, architecture), history in histories.items():
        style = {"color": colour(model), "ls": ARCHITECTURE_LINES[architecture], "marker": "." if len(history) < 40 else None}
        loss.plot(history.epoch, history.validation_loss, lw=1.6, **style)
        loss.plot(history.epoch, history.train_loss, lw=0.7, alpha=0.6, **style)
        ssim.plot(history.epoch, history.validation_ssim, lw=1.6, label=f"{model}, {architecture}", **style)
    loss.set(xlabel="epoch", ylabel="loss, counts summed over the taxels", yscale="log",
             title="loss: validation thick, training thin")
    ssim.set(xlabel="epoch", ylabel="SSIM", title="SSIM of the validation maps")
    ssim.legend(frameon=False, fontsize=8, loc="best")
    figure.legend(*scores.get_legend_handles_labels(), frameon=False, fontsize=8, ncols=3, loc="outside lower center")
    for axes in (loss, ssim):
        axes.xaxis.get_major_locator().set_params(integer=True)
    return figure


def _draw_scores(axes, networks, choices):
    sets = list(networks["set"].unique())
    kinds = list(networks.groupby(["model", "architecture"], sort=False).groups)
    width = 0.84 / len(kinds)
    for k, (model, architecture) in enumerate(kinds):
        rows = networks[(networks.model == model) & (networks.architecture == architecture)].set_index("set").loc[sets]
        at = np.arange(len(sets)) + (k - 0.5 * (len(kinds) - 1)) * width
        axes.bar(at, rows.ssim, width, color=colour(model), alpha=0.6, hatch=HATCHES[architecture], edgecolor="k", lw=0.6,
                 label=f"{model}, {architecture}: {_short(rows.weights.iloc[0])} weights, {rows.epoch_s.iloc[0]:.2g} s an epoch")
        axes.errorbar(at, rows.ssim, yerr=[rows.ssim - rows.ssim_low, rows.ssim_high - rows.ssim], fmt="none", color="k",
                      capsize=3, lw=1.2)
    ceiling = networks.groupby("set", sort=False).sensor_ssim.first().loc[sets]
    axes.hlines(ceiling, np.arange(len(sets)) - 0.45, np.arange(len(sets)) + 0.45, color="k", lw=1, ls=":",
                label="sensor against itself")
    axes.set_xticks(range(len(sets)), [_set_label(networks, name) for name in sets])
    axes.set(ylabel=ssim_label(choices), ylim=(min(0.0, networks.ssim.min()), 1.05),
             title="mean and 95 % interval")


def _set_label(networks, name):
    row = networks[networks["set"] == name].iloc[0]
    return f"{name}\n{row.maps} maps, items: {row['items']}" + (f"\n{NO_INTERVAL}" if row["items"] == 1 else "")


def _short(count):
    return f"{count / 1e6:.3g} million" if count >= 1e6 else f"{count / 1e3:.3g} thousand"
