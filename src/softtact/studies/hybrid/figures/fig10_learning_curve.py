"""Figure 10: SSIM against the number of training maps, one panel per set."""

from typing import TYPE_CHECKING, Any

from softtact.reporting.style import ARCHITECTURE_LINES, colour, pyplot, ssim_label

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

MARKS = {"elastic": "s", "foundation": "D", "hyperelastic": "o"}      # distinct in grey, too


def draw(curves: "pd.DataFrame", ceiling: "pd.DataFrame", *, choices: dict[str, Any] | None = None) -> "Figure":
    """Figure from one frame with the learning_curve.csv of all models, and ceiling.csv.

    choices: {window, data_range} of the SSIM
    """
    plt = pyplot()
    sets = list(curves["set"].unique())
    figure, panels = plt.subplots(1, len(sets), figsize=(3.6 * len(sets), 4.2), sharey=True, squeeze=False, layout="constrained")
    for axes, name in zip(panels[0], sets, strict=True):
        _draw_set(axes, curves[curves["set"] == name])
        repeated = ceiling[ceiling["set"] == name].ssim.mean()
        if repeated == repeated:     # nan for a sensor that was read once
            axes.axhline(repeated, color="k", lw=1, ls=":", label="sensor against itself")
        axes.set(title=name, xlabel="training maps with their readings", xscale="log")
        sizes = sorted(curves.maps.unique())
        axes.set_xticks(sizes, sizes, rotation=45)
        axes.minorticks_off()
    panels[0, 0].set_ylabel(ssim_label(choices))
    figure.legend(*panels[0, 0].get_legend_handles_labels(), frameon=False, fontsize=8, ncols=3, loc="outside lower center")
    return figure


def _draw_set(axes, curves):
    kinds = list(curves.groupby(["model", "architecture"], sort=False))
    for k, ((model, architecture), rows) in enumerate(kinds):
        beside = 1.03 ** (k - 0.5 * (len(kinds) - 1))     # shifts intervals at the same number of maps apart
        spread = [rows.ssim - rows.ssim_low, rows.ssim_high - rows.ssim]
        axes.errorbar(rows.maps * beside, rows.ssim, yerr=spread, color=colour(model), ls=ARCHITECTURE_LINES[architecture],
                      lw=1.4, ms=5, marker=MARKS.get(model, "^"), capsize=3, elinewidth=0.8, label=f"{model}, {architecture}")
