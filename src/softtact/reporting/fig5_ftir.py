"""Figure 5: contact area of the dielectric's frusta against force."""

from softtact.reporting.style import pyplot

_MODEL, _MEASURED = "#1f4e79", "#e08214"     # apart in grey and to the colour-blind; markers tell them too
_DASHES = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))


def draw(area, summary, *, readings=None):
    """Figure from contact_area.csv, its summary, and readings.csv (all readings and laws), if there is one."""
    figure, axes = pyplot().subplots(figsize=(6.6, 4.6), layout="constrained")
    count = summary["frusta"]
    if readings is not None:
        _draw_others(axes, readings, summary["under_test"])
    axes.plot(area.force_n, area.area_per_frustum_mm2, "-", color=_MODEL, lw=2, label=f"model under test{_name(summary)}")
    axes.plot(area.force_n, area.area_measured_mm2, "s", ms=6, color=_MEASURED, mfc="none", mew=1.5, label=summary["source"])
    axes.plot(area.force_n, area.area_image_mm2, "k+", ms=8, label="discs found in its frames")
    axes.set(xlabel="force on the dielectric (N)", ylabel="contact area per frustum (mm²)", xlim=(0, None), ylim=(0, None))
    second = axes.secondary_yaxis("right", functions=(lambda a: a * count, lambda a: a / count))
    second.spines["right"].set_visible(True)
    second.set_ylabel(f"total of {count} frusta (mm²)")
    axes.set_title(f"RMSE of the model {summary['rmse_mm2_per_frustum']:.4f} mm² per frustum ({len(area)} forces, {count} frusta)\n"
                   "paper, against its own sensor: 0.008 mm²", fontsize=9)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return figure


def _name(summary):
    chosen = summary.get("under_test")
    return f" ({chosen['reading']}, {chosen['law']})" if chosen else ""


def _draw_others(axes, readings, chosen):
    """Thin lines: the readings and laws that are not under test."""
    others = [(key, curve) for key, curve in readings.groupby(["reading", "law"], sort=False)
              if key != (chosen["reading"], chosen["law"])]
    for k, ((reading, law), curve) in enumerate(others):
        axes.plot(curve.force_n, curve.area_per_frustum_mm2, ls=_DASHES[k % len(_DASHES)], color="0.35", lw=1,
                  label=f"{reading}, {law}")
