"""Figure 5: contact area of the dielectric's frusta against force."""

from softtact.reporting.style import pyplot


def draw(area, summary):
    """Figure from contact_area.csv and its summary."""
    plt = pyplot()
    figure, axes = plt.subplots(figsize=(6.2, 3.8), layout="constrained")
    total = summary["frusta"]
    axes.plot(area.force_n, area.area_per_frustum_mm2, "-", color="#1f4e79", label="model under test")
    axes.plot(area.force_n, area.area_measured_mm2, "s", color="#e08214", mfc="none", label=summary["source"].split(" (")[0])
    axes.plot(area.force_n, area.area_image_mm2, "k+", label="discs found in the frames")
    axes.set(xlabel="force on the dielectric (N)", ylabel="contact area per frustum (mm2)", ylim=(0, None))
    second = axes.secondary_yaxis("right", functions=(lambda a: a * total, lambda a: a / total))
    second.set_ylabel(f"total of {total} frusta (mm2)")
    axes.set_title(f"RMSE {summary['rmse_mm2_per_frustum']:.4f} mm2 per frustum (paper, against its sensor: 0.008)", fontsize=9)
    axes.legend(frameon=False, loc="lower right")
    return figure
