"""Plot a material card: test curves with the fitted laws, cycles, tests over time, residuals, and stable ranges."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.materials.cards import law_of_entry, mullins_from_card, prony_from_card
from softtact.materials.curves import VOLUMETRIC, AnyCurve, join_by_mode, path_of
from softtact.materials.cycles import CyclicTest, energy_of
from softtact.materials.laws.base import SIMPLE_SHEAR
from softtact.materials.time_tests import RELAXATION, TimeTest
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Only the best laws are drawn, because more lines would overlap. Colours are distinct in grey, and line styles differ.
_LINES = (("#000000", "-"), ("#1f77b4", "--"), ("#e08214", "-."), ("#3f9c6d", ":"), ("#b2abd2", (0, (3, 1, 1, 1, 1, 1))))
_BEYOND = 0.15      # of the window's range, by which data and lines may extend beyond it
_MODE_COLOURS = {"uniaxial": "#1f4e79", "equibiaxial": "#e08214", "planar": "#3f9c6d"}


def plot_material(card: dict[str, Any], curves: Sequence[AnyCurve], *paths: str | Path, cycles: Sequence[CyclicTest] = (),
                  over_time: Sequence[TimeTest] = ()) -> None:
    """Draw a card (dict) and the tests it was fitted to as PNG or SVG files."""
    save(draw_material(card, curves, cycles=cycles, over_time=over_time), *paths)


def draw_material(card: dict[str, Any], curves: Sequence[AnyCurve], *, cycles: Sequence[CyclicTest] = (),
                  over_time: Sequence[TimeTest] = ()) -> "Figure":
    """The figure: a column per test with data and fits above residuals, and the stable ranges of laws below.

    cycles: tests with unloading, drawn with the card's Mullins effect;  over_time: drawn with its Prony series
    """
    plt = pyplot()
    curves = join_by_mode(curves)
    cycles = cycles if "mullins" in card else ()
    columns = len(curves) + len(cycles) + len(over_time)
    figure = plt.figure(figsize=(3.6 * max(columns, 2), 8.2 if curves else 5.6), layout="constrained")
    heights = (2.2, 1.0, 0.4 + 0.2 * len(card["ranking"])) if curves else (2.2, 1.0)
    rows = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    pairs = []
    for k in range(columns):
        above = figure.add_subplot(rows[0, k])
        pairs.append((above, figure.add_subplot(rows[1, k], sharex=above)))
    names = _shown(card) if curves else []
    for (above, below), curve in zip(pairs, curves, strict=False):
        draw = _draw_volume if curve.mode == VOLUMETRIC else _draw_shape
        draw(above, below, card, curve, names)
        above.set_title(f"{curve.mode}, {len(curve.stress)} points, {curve.kind}")
    for (above, below), test in zip(pairs[len(curves):], cycles, strict=False):
        _draw_cycles(above, below, card, test)
    for (above, below), timed, scale in zip(pairs[len(curves) + len(cycles):], over_time, _scales(card), strict=False):
        _draw_over_time(above, below, card, timed, scale)
    if not curves:
        figure.suptitle(f"{card['material']}: Prony series of {len(card['prony']['g'])} terms")
        return figure
    handles, labels = figure.axes[0].get_legend_handles_labels()
    ranges = figure.add_subplot(rows[2, :])
    _draw_ranges(ranges, card)
    figure.legend(handles + ranges.get_legend_handles_labels()[0], labels + ranges.get_legend_handles_labels()[1], frameon=False,
                  loc="outside lower center", ncols=3, fontsize=8)
    figure.suptitle(f"{card['material']}: chosen {card['chosen']}; errors are root mean squares over all points")
    return figure


def _scales(card):
    """The instantaneous moduli of the tests over time, in the measure of each."""
    return [test["instantaneous_modulus"] for test in card["prony"]["tests"]] if "prony" in card else []


def _draw_cycles(above, below, card, test):
    """Loading and unloading with the chosen law and its softening, in the order of time."""
    law, effect = law_of_entry(card["chosen"], card["laws"][card["chosen"]]), mullins_from_card(card)
    curve = test.history
    energy = energy_of(law, curve.mode, curve.deformation)
    model = effect.softening(energy, np.maximum.accumulate(energy)) * law.nominal_stress(curve.mode, curve.deformation)
    above.plot(curve.deformation, curve.stress, "o", ms=2.5, mfc="none", mew=0.5, color="0.45", label="data")
    above.plot(curve.deformation, model, "k-", lw=1.0, label=f"{card['chosen']}, Mullins effect")
    later = ~test.first
    below.plot(curve.deformation[later], 1e3 * (model - curve.stress)[later], "k.", ms=2.5)
    below.axhline(0, color="0.7", lw=0.6)
    above.set(ylabel=_stress_label(curve.mode), title=f"{curve.mode}, cycles, {later.sum()} points unloaded or reloaded")
    above.title.set_fontsize(9)
    above.legend(frameon=False, fontsize=8)
    below.set(xlabel=_strain_label(curve.mode), ylabel="effect - data (kPa)")


def _draw_over_time(above, below, card, test, scale):
    """Relaxation over time, or storage and loss modulus over frequency, with the Prony series; the relaxation times as ticks."""
    series = prony_from_card(card)
    dense = replace(test, at=np.geomspace(test.at[test.at > 0].min(), test.at.max(), 300))
    names = ("modulus",) if test.mode == RELAXATION else ("storage modulus", "loss modulus")
    drawn = zip(test.values, dense.of(series), test.of(series), names, _LINES, strict=False)
    for values, fine, fitted, name, (colour, style) in drawn:
        above.plot(test.at, values / scale, "o", ms=3, mfc="none", mew=0.6, color=colour, label=f"{name}, data")
        above.plot(dense.at, fine, color=colour, ls=style, lw=1.2, label=f"{name}, series")
        below.plot(test.at, 100 * (scale * fitted / values - 1), color=colour, ls=style, lw=1)
    places = np.array(series.tau_s) if test.mode == RELAXATION else 1 / (2 * np.pi * np.array(series.tau_s))
    above.plot(places, np.full(len(places), 0.02), "|", ms=10, color="black", transform=above.get_xaxis_transform(), clip_on=False,
               label="relaxation times" if test.mode == RELAXATION else "1/(2 pi tau)")
    below.axhline(0, color="0.7", lw=0.6)
    above.set(xscale="log", yscale="linear" if test.mode == RELAXATION else "log", ylabel="modulus / instantaneous modulus",
              title=f"{test.mode}, {len(test.at)} points")
    if test.mode != RELAXATION:
        above.set_ylim(top=10 * above.get_ylim()[1])     # room for the legend
    above.legend(frameon=False, fontsize=8, loc="upper right" if test.mode == RELAXATION else "upper left")
    below.set(xlabel="time (s)" if test.mode == RELAXATION else "frequency (Hz)", ylabel="series - data (%)")


def _stress_label(mode):
    return "shear stress (MPa)" if mode == SIMPLE_SHEAR else "nominal stress (MPa)"


def _strain_label(mode):
    return "shear strain" if mode == SIMPLE_SHEAR else "stretch"


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
    above.set_ylabel(_stress_label(curve.mode))
    below.set(xlabel=_strain_label(curve.mode), ylabel="law - data (kPa)")


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
