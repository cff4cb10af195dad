"""A recording of a TSF-85 as a strip of pictures or a video: taxels of both fingers, sums of counts, and force over time."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.imaging.movies import write_movie
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_FRAMES = 6                   # of a strip
_COLOURS = ("#1f4e79", "#e08214")
_RATE_HZ, _MOST_FRAMES = 20, 600     # of a video in real time; a longer one plays faster


def save_strip(recording: "xarray.Dataset", path: str | Path) -> None:
    """Write a PNG: sums of counts (and force if known) over time, and below the taxels at six times, one row per finger."""
    save(draw_strip(recording), path)


def draw_strip(recording: "xarray.Dataset") -> "Figure":
    """The figure of `save_strip`, at the time of the largest sum of counts and five times spread evenly over the recording."""
    time, counts = recording.time.values, recording.counts.values
    peak = int(np.nansum(np.abs(counts), axis=(2, 3)).max(axis=1).argmax())
    shown = sorted({peak, *(int(np.abs(time - at).argmin()) for at in np.linspace(time[0], time[-1], _FRAMES))})
    fingers = counts.shape[1]
    figure = pyplot().figure(figsize=(1.4 * len(shown) + 1.6, 2.2 + 2.3 * fingers), layout="constrained")
    rows = figure.add_gridspec(1 + fingers, len(shown), height_ratios=[1.3, *[1.6] * fingers])
    _draw_time(figure.add_subplot(rows[0, :]), recording, time[shown])
    axes = [[figure.add_subplot(rows[1 + finger, k]) for k in range(len(shown))] for finger in range(fingers)]
    limits = _limits(counts)
    for k, reading in enumerate(shown):
        for finger in range(fingers):
            image = _draw_taxels(axes[finger][k], counts[reading, finger], limits)
            axes[finger][k].set_ylabel(f"finger {finger}\nrow" if k == 0 else "")
        axes[0][k].set_title(_label(recording, reading), fontsize=8)
        axes[-1][k].set_xlabel("column")
    figure.colorbar(image, ax=[one for row in axes for one in row], label="counts over the baseline", shrink=0.7)
    return figure


def save_video(recording: "xarray.Dataset", path: str | Path) -> None:
    """Write a GIF or an MP4 (extra `optics`) that plays a recording in real time, or faster if it is longer than 30 s."""
    write_movie(path, _frames(recording), fps=_RATE_HZ)


def _frames(recording: "xarray.Dataset") -> Iterator[np.ndarray]:
    """Pictures (height, width, 3) of a recording."""
    time, counts = recording.time.values, recording.counts.values
    number = int(np.clip(_RATE_HZ * (time[-1] - time[0]), 1, _MOST_FRAMES))
    fingers, limits = counts.shape[1], _limits(counts)
    figure = pyplot().figure(figsize=(2.4 * fingers + 0.8, 5.2), dpi=100, layout="constrained")
    rows = figure.add_gridspec(2, fingers, height_ratios=[1.0, 2.2])
    mark = _draw_time(figure.add_subplot(rows[0, :]), recording, time[:1])[0]
    axes = [figure.add_subplot(rows[1, finger]) for finger in range(fingers)]
    images = [_draw_taxels(axis, counts[0, finger], limits) for finger, axis in enumerate(axes)]
    for finger, axis in enumerate(axes):
        axis.set(title=f"finger {finger}", xlabel="column", ylabel="row")
    figure.colorbar(images[-1], ax=axes, label="counts over the baseline", shrink=0.8)
    figure.suptitle(_label(recording, 0), fontsize=9)
    figure.canvas.draw()
    figure.set_layout_engine("none")      # keep the layout, because a new one takes a second per frame
    for at in np.linspace(time[0], time[-1], number):
        reading = int(np.abs(time - at).argmin())
        for finger, image in enumerate(images):
            image.set_data(counts[reading, finger])
        mark.set_xdata([time[reading]] * 2)
        figure.suptitle(_label(recording, reading), fontsize=9)
        figure.canvas.draw()
        frame = np.asarray(figure.canvas.buffer_rgba())[..., :3]
        yield frame.copy()
    pyplot().close(figure)


def _limits(counts):
    return min(0.0, float(np.nanmin(counts))), max(float(np.nanmax(counts)), 1.0)


def _label(recording, reading):
    time = f"{recording.time.values[reading]:.2f} s"
    if "force_n" not in recording:
        return time
    forces = dict.fromkeys(f"{force:.3g}" for force in recording.force_n.values[reading])     # equal forces appear once
    return f"{time}\n{' and '.join(forces)} N"


def _draw_time(axis, recording, marked):
    """Draw sums of counts and, if known, the force over time; return the lines that mark the times (n,)."""
    time = recording.time.values
    for finger in range(recording.sizes["finger"]):
        axis.plot(time, recording.counts.values[:, finger].sum(axis=(1, 2)), color=_COLOURS[finger], lw=1, label=f"finger {finger}")
    axis.set(xlabel="time (s)", ylabel="sum of counts")
    if "force_n" in recording:
        other = axis.twinx()
        other.plot(time, recording.force_n.values.max(axis=1), color="0.5", ls="--", lw=0.9, label="force")
        other.set_ylabel("force (N)")
        other.spines["right"].set_visible(True)
        axis.plot([], [], color="0.5", ls="--", lw=0.9, label="force")
    axis.legend(frameon=False, fontsize=7, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    return [axis.axvline(at, color="0.7", lw=0.7, zorder=0) for at in marked]


def _draw_taxels(axis, counts, limits):
    axis.set(xticks=range(counts.shape[1]), yticks=range(counts.shape[0]))
    axis.tick_params(labelsize=6)
    return axis.imshow(counts, origin="lower", vmin=limits[0], vmax=limits[1], cmap="viridis")
