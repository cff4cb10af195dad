"""Plot a material card: test curves with the fitted laws, residuals, and stable ranges."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.materials.cards import law_of_entry
from softtact.materials.curves import VOLUMETRIC, AnyCurve, join_by_mode, path_of
from softtact.materials.laws.base import SIMPLE_SHEAR
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Only the best laws are drawn, because more lines would overlap. Colours are distinct in grey, and line styles differ.
_LINES = (("#000000", "-"), ("#1f77b4", "--"), ("#e08214", "-."), ("#3f9c6d", ":"), ("#b2abd2", (0, (3, 1, 1, 1, 1, 1))))
_BEYOND = 0.15      # of the window's range, by which data and lines may extend beyond it
_MODE_COLOURS = {"uniaxial": "#1f4e79", "equibiaxial": "#e08214", "planar": "#3f9c6d"}


def plot_material(card: dict[str, Any], curves: Sequence[AnyCurve], *paths: str | Path) -> None:
    """Draw a card (dict) and the curves it was fitted to (list) as PNG or SVG files."""
    save(draw_material(card, curves), *paths)


def draw_material(card: dict[str, Any], curves: Sequence[AnyCurve]) -> "Figure":
    """The figure: a column per test mode with data and fits above residuals, and the stable ranges below."""
    plt = pyplot()
    curves = join_by_mode(curves)
    figure = plt.figure(figsize=(3.6 * max(len(curves), 2), 8.2), layout="constrained")
    rows = figure.add_gridspec(3, len(curves), height_ratios=(2.2, 1.0, 0.4 + 0.2 * len(card["ranking"])))
    names = _shown(card)
    for k, curve in enumerate(curves):
        above = figure.add_subplot(rows[0, k])
        below = figure.add_subplot(rows[1, k], sharex=above)
        draw = _draw_volume if curve.mode == VOLUMETRIC else _draw_shape
        draw(above, below, card, curve, names)
        above.set_title(f"{curve.mode}, {len(curve.stress)} points, {curve.kind}")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    ranges = figure.add_subplot(rows[2, :])
    _draw_ranges(ranges, card)
    figure.legend(handles + ranges.get_legend_handles_labels()[0], labels + ranges.get_legend_handles_labels()[1], frameon=False,
                  loc="outside lower center", ncols=3, fontsize=8)
    figure.suptitle(f"{card['material']}: chosen {card['chosen']}; errors are root mean squares over all points")
    return figure


def _shown(card):
    """The chosen law and the best others of the ranking."""
    others = [name for name in card["ranking"] if name != card["chosen"]]
    return [card["chosen"], *others][:len(_LINES)]


def _draw_shape(above, below, card, curve, names):
    """Nominal stress of data and laws, and the laws' errors at the points."""
    low, high = card["strain_window"][curve.mode]
    margin = _BEYOND * (high - low)
    stretch = np.linspace(low - margin if curve.mode == SIMPLE_SHEAR else max(low - margin, 0.5 * low), high + margin, 200)
    near, inside = curve.within((stretch[0], stretch[-1])), curve.within((low, high))
    above.axvspan(low, high, color="0.94", zorder=0)
    above.plot(near.deformation, near.stress, "o", ms=3, mfc="none", mew=0.6, color="0.35", label="data", zorder=1)
    for name, (colour, style) in zip(names, _LINES, strict=False):
        entry = card["laws"][name]
        law = law_of_entry(name, entry)
        label = f"{name}: {entry['relative_error']:.1%}, {1e3 * entry['rmse_mpa']:.3g} kPa"
        above.plot(stretch, law.nominal_stress(curve.mode, stretch), color=colour, ls=style, lw=1.3, label=label)
        error = law.nominal_stress(curve.mode, inside.deformation) - inside.stress
        below.plot(inside.deformation, 1e3 * error, color=colour, ls=style, lw=1)
    top, bottom = near.stress.max(), min(near.stress.min(), 0)
    above.set(xlim=(stretch[0], stretch[-1]), ylim=(bottom - 0.05 * (top - bottom), top + 0.1 * (top - bottom)))
    below.axhline(0, color="0.7", lw=0.6)
    above.set_ylabel("shear stress (MPa)" if curve.mode == SIMPLE_SHEAR else "nominal stress (MPa)")
    below.set(xlabel="shear strain" if curve.mode == SIMPLE_SHEAR else "stretch", ylabel="law - data (kPa)")


def _draw_volume(above, below, card, curve, names):
    """Pressure against volume, and the residual of a constant bulk modulus."""
    bulk = card["laws"][card["chosen"]]["bulk_modulus_mpa"]
    above.plot(curve.volume_ratio, curve.pressure, "o", ms=3, mfc="none", color="0.35")
    above.plot(curve.volume_ratio, bulk * (1 - curve.volume_ratio), "k-", lw=1.3)
    above.text(0.05, 0.05, f"K = {bulk:.4g} MPa", transform=above.transAxes)
    below.plot(curve.volume_ratio, 1e3 * (bulk * (1 - curve.volume_ratio) - curve.pressure), "k-", lw=1)
    below.axhline(0, color="0.7", lw=0.6)
    above.set_ylabel("pressure (MPa)")
    below.set(xlabel="volume ratio J", ylabel="law - data (kPa)")


def _draw_ranges(axes, card):
    """A bar per law and mode over the stretches at which the law is stable; ticks mark the range of that mode's data."""
    modes = list(_MODE_COLOURS)
    windows = [path_of(mode, window) for mode, window in card["strain_window"].items()]
    for row, name in enumerate(card["ranking"]):
        for k, mode in enumerate(modes):
            low, high = card["laws"][name]["stable_range"][mode]
            place = row + 0.24 * (k - 1)
            axes.plot([low, high], [place, place], lw=3.2, color=_MODE_COLOURS[mode], solid_capstyle="butt",
                      label=f"stable, {mode}" if row == 0 else None)
            for end in (end for path, window in windows if path == mode for end in window):
                axes.plot([end, end], [place - 0.11, place + 0.11], color="black", lw=0.9)
    axes.set(xscale="log", xlabel="stretch", ylim=(len(card["ranking"]) - 0.4, -0.6))
    names = [name + (" (chosen)" if name == card["chosen"] else "") for name in card["ranking"]]
    axes.set_yticks(range(len(names)), names)
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if axes.get_xlim()[0] <= tick <= axes.get_xlim()[1]]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_title("stable (Drucker) over these stretches; black ticks: ends of the data; scanned from 0.1 to 10", fontsize=9)
