"""Figure 5: contact area of the dielectric's frusta against force."""

from typing import TYPE_CHECKING, Any

from softtact.reporting.style import pyplot

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_MODEL, _MEASURED = "#1f4e79", "#e08214"     # distinct in grey and for the colour-blind; markers differ, too
_STROKES = (("--", 1.0), ((0, (1, 4)), 2.4), ("-", 0.7), ("-.", 1.0))     # so that two coinciding lines are both visible
_FAR = 1.5                                   # times the largest main area; higher curves are drawn in a separate panel


def draw(area: "pd.DataFrame", summary: dict[str, Any], *, orientations: "pd.DataFrame | None" = None) -> "Figure":
    """Figure from contact_area.csv, its summary and, if given, orientations.csv (all orientations and laws)."""
    main = ["area_per_frustum_mm2", "area_measured_mm2", "area_image_mm2"]
    others = [] if orientations is None else _others(orientations, summary["under_test"])
    bound = _FAR * area[main].to_numpy().max()
    far = [record for record in others if record[1].area_per_frustum_mm2.min() > bound]
    figure, panels = _panels(bool(far))
    for k, (label, curve) in enumerate(others):
        style, width = _STROKES[k % len(_STROKES)]
        panel = panels[0] if curve.area_per_frustum_mm2.min() > bound else panels[-1]
        panel.plot(curve.force_n, curve.area_per_frustum_mm2, ls=style, color="0.35", lw=width, label=label)
    axes = panels[-1]
    axes.plot(area.force_n, area.area_per_frustum_mm2, "-", color=_MODEL, lw=2, label=f"model under test{_name(summary)}")
    axes.plot(area.force_n, area.area_measured_mm2, "s", ms=6, color=_MEASURED, mfc="none", mew=1.5, label=summary["source"])
    axes.plot(area.force_n, area.area_image_mm2, "k+", ms=8, label="discs found in the virtual dielectric's frames")
    axes.set(xlabel="force on the dielectric (N)", ylabel="contact area per frustum (mm²)", xlim=(0, None), ylim=(0, None))
    if far:
        middle = far[0][1].area_per_frustum_mm2.mean()
        panels[0].set_ylim(0.9 * middle, 1.1 * max(curve.area_per_frustum_mm2.max() for _, curve in far))
    _total_on_the_right(panels, summary["frusta"])
    panels[0].set_title(f"RMSE of the model {summary['rmse_mm2_per_frustum']:.4f} mm² per frustum ({len(area)} forces, "
                        f"{summary['frusta']} frusta)\npaper, against its own sensor: 0.008 mm²", fontsize=9)
    lines = [line for panel in panels[::-1] for line in panel.get_lines() if not line.get_label().startswith("_")]
    figure.legend(handles=sorted(lines, key=lambda line: line.get_color() == "0.35"), loc="outside lower center", ncols=2,
                  frameon=False, fontsize=8)
    return figure


def _panels(far):
    """Figure and its panels from the top: the main one, with a low one above it for much larger areas if needed."""
    if not far:
        figure, axes = pyplot().subplots(figsize=(6.6, 4.8), layout="constrained")
        return figure, [axes]
    figure, (high, low) = pyplot().subplots(2, 1, figsize=(6.6, 5.4), layout="constrained", sharex=True, height_ratios=(1, 4))
    high.spines["bottom"].set_linestyle(":")
    high.tick_params(bottom=False)
    return figure, [high, low]


def _total_on_the_right(panels, count):
    """A second scale, the total of `count` frusta, on every panel."""
    for panel in panels:
        second = panel.secondary_yaxis("right", functions=(lambda a: a * count, lambda a: a / count))
        second.spines["right"].set_visible(True)
    second.set_ylabel(f"total of {count} frusta (mm²)")


def _name(summary):
    chosen = summary.get("under_test")
    return f" ({chosen['orientation']}, {chosen['law']})" if chosen else ""


def _others(orientations, chosen):
    """(label, curve) of the orientations and laws that are not under test."""
    return [(f"{orientation}, {law}", curve) for (orientation, law),
            curve in orientations.groupby(["orientation", "law"], sort=False)
            if (orientation, law) != (chosen["orientation"], chosen["law"])]
