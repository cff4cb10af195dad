"""The figures of a skin: displacement and taxels as in the papers, probes, Pareto front, thickness, maps, modules on a link.

Outputs of each are png and svg; for the link only png.
"""

from typing import Any

import numpy as np

from softtact.files import read_csv, read_dataset
from softtact.reporting.style import pyplot, save
from softtact.studies.skin.settings import design_of

_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)     # of counts, on a logarithmic scale
_EXCITED = "autumn_r"  # yellow to red, as in the papers


def draw_load(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Left: displacement of the upper side in mm. Right: taxels coloured by the rise of their counts.

    inputs: readings (NetCDF), table (CSV);  settings: module, patch, load (its number), elastomer
    """
    number, layout = settings["load"] - 1, design_of(settings).layout()
    readings, row = read_dataset(inputs["readings"]).isel(load=number), read_csv(inputs["table"]).iloc[number]
    figure, (left, right) = pyplot().subplots(1, 2, figsize=(9, 4.2), layout="constrained")
    down = -readings.displacement_mm.values[:, 2]
    shown = left.tricontourf(*readings.node_mm.values.T, down, levels=20, cmap="viridis")
    figure.colorbar(shown, ax=left, label="displacement down (mm)")
    counts = readings.counts.values
    discs = _taxels(right, layout, counts, cmap=_EXCITED, limits=(0, max(1, counts.max())))
    figure.colorbar(discs, ax=right, label="counts above rest")
    for centre, count in zip(layout.centres_mm, counts, strict=True):
        if len(layout.centres_mm) <= 12:
            right.text(*centre, f"{count:d}", ha="center", va="center", fontsize=8)
    for axes in (left, right):
        _frame(axes, layout)
    figure.suptitle(f"{row.load}: {row.what}; {settings['elastomer']}", fontsize=9)
    save(figure, *outputs.values())


def draw_probes(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Rise of the pressed taxel's capacitance against pressure: a panel for each probe, a line for each error of the modulus.

    inputs: table (CSV). Dotted: the elastomer's curve is extrapolated.
    """
    plt, table = pyplot(), read_csv(inputs["table"])
    diameters = sorted(set(table.diameter_mm))
    figure, panels = plt.subplots(
        1, len(diameters), figsize=(2.6 * len(diameters) + 1, 3), layout="constrained", sharey=True, squeeze=False
    )
    colours = plt.get_cmap("coolwarm")(np.linspace(0, 1, table.modulus_share.nunique()))
    for axes, diameter in zip(panels[0], diameters, strict=True):
        for hue, (share, rows) in zip(colours, table[table.diameter_mm == diameter].groupby("modulus_share"), strict=True):
            colour, name = (hue, f"E {share:+.0%}") if share else ("black", "E")
            axes.plot(rows.pressure_kpa, rows.delta_ff, ":", color=colour)
            axes.plot(rows.pressure_kpa.where(rows.within_test), rows.delta_ff, "-", color=colour, label=name)
        axes.set(xlabel="pressure (kPa)", title=f"probe of {diameter:g} mm")
    if not table.within_test.all():
        panels[0][0].plot([], [], ":", color="grey", label="beyond the tested stress")
    panels[0][0].set_ylabel("rise of the capacitance (fF)")
    panels[0][0].legend(frameon=False, fontsize=8)
    save(figure, *outputs.values())


def draw_front(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Left: sensitivity against weight, with the Pareto front as red squares. Right: share of draws with an elastomer on the front.

    inputs: choice_printed, front_confidence (CSV)
    """
    table, confidence = read_csv(inputs["choice_printed"]), read_csv(inputs["front_confidence"])
    figure, (left, right) = pyplot().subplots(1, 2, figsize=(9.5, 4), layout="constrained")
    left.plot(table.weight_g_module, table.sensitivity_per_kpa, "o", color="0.3")
    front = table[table.on_front]
    left.plot(front.weight_g_module, front.sensitivity_per_kpa, "s", mfc="none", mec="red", ms=11, label="Pareto optimal")
    for number, row in enumerate(table.sort_values("weight_g_module").itertuples()):
        left.annotate(
            row.elastomer,
            (row.weight_g_module, row.sensitivity_per_kpa),
            (5, 7) if number % 2 else (5, -12),
            textcoords="offset points",
            fontsize=7,
        )
    left.set(
        xlabel="weight of a module at t_min (g)", ylabel="sensitivity S (1/kPa)", title=f"target {table.stress_kpa.iloc[0]:g} kPa"
    )
    left.margins(x=0.22, y=0.12)
    left.legend(frameon=False, loc="lower right")
    place = np.arange(len(confidence))
    for offset, (name, colour) in zip(
        (0.3, 0.1, -0.1, -0.3),
        {"strain_scatter": "#e08214", "batch": "#3f9c6d", "ageing": "#8073ac", "all": "#1f4e79"}.items(),
        strict=True,
    ):
        right.barh(place + offset, confidence[name], height=0.18, color=colour, label=name.replace("_", " "))
    right.set_yticks(
        place, [f"{name} *" if on else name for name, on in zip(confidence.elastomer, confidence.nominal, strict=True)]
    )
    right.set(xlabel="share of draws on the front (*: on the nominal front)", xlim=(0, 1))
    right.invert_yaxis()
    right.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=4, fontsize=7)
    save(figure, *outputs.values())


def draw_thickness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Counts at the smallest force and strain at the highest pressure against thickness, a line for each elastomer.

    inputs: thickness (CSV);  settings: detected_counts, strain_limit
    """
    plt, table = pyplot(), read_csv(inputs["thickness"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.6), layout="constrained")
    for colour, (name, rows) in zip(plt.get_cmap("tab10").colors, table.groupby("elastomer", sort=False), strict=False):
        left.loglog(rows.thickness_mm, rows.counts_at_smallest_force, ".-", color=colour)
        right.semilogx(rows.thickness_mm, rows.strain, ".-", color=colour, label=name)
    left.axhline(settings["detected_counts"], color="0.5", ls="--")
    right.axhline(settings["strain_limit"], color="0.5", ls="--")
    left.set(xlabel="thickness (mm)", ylabel="counts at the smallest force")
    right.set(xlabel="thickness (mm)", ylabel="mean strain at the highest pressure")
    left.set_yticks([ticks for ticks in _TICKS if ticks < 1.5 * table.counts_at_smallest_force.max()])
    left.set_ylim(0.8 * min(settings["detected_counts"], table.counts_at_smallest_force.min()))
    for axis in (left.xaxis, left.yaxis, right.xaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    for axes in (left, right):
        axes.set_xticks(sorted(set(table.thickness_mm)))
        axes.minorticks_off()
    right.legend(frameon=False, fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, *outputs.values())


def draw_maps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Smallest detectable force, error of localisation, and crosstalk against pitch.

    inputs: detection, crosstalk (CSV);  settings: module, patch, force_n (of the finger)
    """
    maps, crosstalk, layout = read_csv(inputs["detection"]), read_csv(inputs["crosstalk"]), design_of(settings).layout()
    places = maps[["x_mm", "y_mm"]].to_numpy(dtype=float)
    figure, (one, two, three) = pyplot().subplots(1, 3, figsize=(13, 3.9), layout="constrained")
    for axes, values, label in (
        (one, 1e3 * maps.smallest_force_n.to_numpy(), "smallest detectable force (mN)"),
        (two, maps.localisation_mm.to_numpy(), f"error of localisation at {settings['force_n']:.2g} N (mm)"),
    ):
        finite = values[np.isfinite(values)]
        if len(finite):
            low, high = np.percentile(finite, (0, 97))
            shown = axes.scatter(
                *places.T, c=values, cmap="viridis", vmin=low, vmax=max(high, low * 1.01), marker="s", s=_size(places)
            )
            figure.colorbar(shown, ax=axes, label=label, extend="max")
        else:     # one or two taxels do not tell a place and a force
            axes.set_title(f"{label}: not given by these taxels", fontsize=9)
        _outline_taxels(axes, layout, edge="white" if len(finite) else "0.4")
        _frame(axes, layout)
    three.semilogy(crosstalk.pitch_mm, np.maximum(np.abs(crosstalk.crosstalk), 1e-6), "o-", color="#1f4e79")
    three.set(xlabel="pitch (mm)", ylabel="crosstalk: neighbour over own, absolute")
    beside = three.twinx()
    beside.plot(crosstalk.pitch_mm, crosstalk.localisation_mm, "s--", color="#e08214")
    if (crosstalk.localisation_mm > 0).any():     # 0 of a converter without noise
        beside.set_yscale("log")
    beside.set_ylabel("error of localisation half-way (mm)", color="#e08214")
    save(figure, *outputs.values())


def draw_link(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Modules on a link from two sides; red: bent below the least radius.  inputs: laid (NetCDF)."""
    plt, laid = pyplot(), read_dataset(inputs["laid"])
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = plt.figure(figsize=(9, 4.5), layout="constrained")
    corners_mm, colours = laid.corner_mm.values, ["#9ecae1" if fit else "#e34a33" for fit in laid.fits.values]
    low, high = corners_mm.reshape(-1, 3).min(axis=0), corners_mm.reshape(-1, 3).max(axis=0)
    for place, turn in enumerate((-60, 60), start=1):
        axes: Any = figure.add_subplot(1, 2, place, projection="3d")
        axes.add_collection3d(Poly3DCollection(list(corners_mm), facecolors=colours, edgecolors="0.3", alpha=0.7))
        axes.scatter(*laid.position_mm.values.T, s=3, color="black")
        axes.set(
            xlim=(low[0], high[0]),
            ylim=(low[1], high[1]),
            zlim=(low[2], high[2]),
            xlabel="x (mm)",
            ylabel="y (mm)",
            zlabel="z (mm)",
        )
        axes.set_box_aspect(np.maximum(high - low, 1.0))
        axes.view_init(20, turn)
    save(figure, outputs["png"])


def _taxels(axes, layout, values, *, cmap, limits):
    """Discs of the taxels, coloured by values (taxel,)."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    discs = PatchCollection(
        [Circle(tuple(centre), layout.radius_mm) for centre in layout.centres_mm], cmap=cmap, edgecolor="0.3", linewidth=0.6
    )
    discs.set_array(np.asarray(values, dtype=float))
    discs.set_clim(*limits)
    axes.add_collection(discs)
    return discs


def _outline_taxels(axes, layout, *, edge):
    from matplotlib.patches import Circle

    for centre in layout.centres_mm:
        axes.add_patch(Circle(tuple(centre), layout.radius_mm, fill=False, edgecolor=edge, linewidth=0.7))


def _frame(axes, layout):
    """The modules' sides, and equal scales."""
    for corners in layout.corners_mm:
        axes.plot(*np.vstack([corners, corners[:1]]).T, color="0.4", linewidth=0.8)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")


def _size(places):
    """Area of a mark in points such that neighbouring marks touch, of one place or of places on a line, too."""
    steps = [np.diff(np.unique(np.round(along, 6))) for along in places.T]
    spacing = min((float(one.min()) for one in steps if len(one)), default=1.0)
    return 0.9 * (230 / max(np.ptp(places, axis=0).max(), spacing) * spacing) ** 2
