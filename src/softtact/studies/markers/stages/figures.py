"""Figures of the study: examples of images, errors by object and motion, the sliding test, and the page that one drags through."""

from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.files import atomic_path, read_csv, read_dataset
from softtact.reporting.style import pyplot, save
from softtact.studies.markers.claims import WORDS
from softtact.studies.markers.drag import DragSequence, drag_fragment
from softtact.studies.markers.judging import by_motion, by_object
from softtact.studies.markers.paths import UNSEEN
from softtact.studies.markers.stages.scoring import camera_of, made_by, opened_generator

if TYPE_CHECKING:
    import xarray

COLOURS = {
    "physics": "#222222",
    "proposed": "#1f4e79",
    "no_lstm": "#3f9c6d",
    "pix2pix": "#e08214",
    "temporal": "#8a3a8f",
    "no_motion": "#999999",
    "full_stick": "#b34a4a",
    "linear_frictionless": "#c9a227",
}


def draw_examples(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Figure 7: depth images, solved images and those of each network at several deformations of unseen objects.

    inputs: sequences (list), generators (list);  settings: networks, marker_radius_px, shown
    """
    plt, columns = pyplot(), []
    generators = {
        name: opened_generator(file, threads) for name, file in zip(settings["networks"], inputs["generators"], strict=True)
    }
    for data, whole in _shown(inputs["sequences"], max(settings["shown"], 1)):
        camera = camera_of(data, whole, settings["marker_radius_px"])
        every = np.arange(len(whole))
        made = {name: made_by(generator, data.depth_grey.values[whole], camera, every) for name, generator in generators.items()}
        pressed = int(np.argmax(data.aside_mm.values[whole] > 0)) - 1
        for frame in (pressed, len(whole) - 1):
            columns.append((data, whole, frame, made))
    rows = ["depth", "physics", *generators]
    figure, axes = plt.subplots(
        len(rows), len(columns), figsize=(1.7 * len(columns) + 0.6, 1.75 * len(rows)), squeeze=False, layout="constrained"
    )
    for k, (data, whole, frame, made) in enumerate(columns):
        at = whole[frame]
        axes[0, k].imshow(data.depth_grey.values[at], cmap="gray", vmin=0, vmax=255)
        axes[0, k].set_title(
            f"{data.object.values[at]}\n{data.depth_mm.values[at]:.1f} mm down, "
            f"{data.aside_mm.values[at]:.1f} mm along {data.aside.values[at]}",
            fontsize=7,
        )
        axes[1, k].imshow(data.image.values[at])
        for place, name in zip(axes[2:, k], generators, strict=True):
            images = made[name].images
            if images is not None:
                place.imshow(images[frame])
    for place, name in zip(axes[:, 0], rows, strict=True):
        place.set_ylabel({"depth": "depth"}.get(name, WORDS.get(name, name)).removeprefix("the "), fontsize=7, wrap=True)
    for place in axes.ravel():
        place.set_xticks([]), place.set_yticks([])
    save(figure, *outputs.values())


def draw_positions(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Figure 8: d of each object, and over depth and displacement aside.

    inputs: scores (CSV);  settings: sources, trained (objects)
    """
    _draw_scores(inputs, outputs, settings, "d_px")


def draw_likeness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Figure 9: the same of the mean squared error outside the markers."""
    _draw_scores(inputs, outputs, settings, "mse")


def _draw_scores(inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], score: str) -> None:
    plt, rows = pyplot(), read_csv(inputs["scores"])
    label = {"d_px": "d, px", "mse": "MSE outside the markers, grey levels²"}[score]
    sources = [name for name in settings["sources"] if rows.loc[rows.source == name, score].notna().any()]
    figure, (bars, down, aside) = plt.subplots(1, 3, figsize=(12, 3.6), width_ratios=(2.4, 1, 1), layout="constrained")
    of_object = by_object(rows).groupby(["source", "object"], sort=False)[score].mean()
    names = [*settings["trained"], *(name for name in dict.fromkeys(rows.object) if name not in settings["trained"])]
    names = [name for name in names if name in set(rows.object)]
    width = 0.8 / len(sources)
    for k, source in enumerate(sources):
        values = of_object.loc[source].reindex(names)
        bars.bar(
            np.arange(len(names)) + width * (k - 0.5 * (len(sources) - 1)),
            values,
            width,
            color=COLOURS[source],
            label=WORDS[source],
        )
    bars.set_xticks(np.arange(len(names)), names, rotation=60, ha="right", fontsize=7)
    split = sum(name in settings["trained"] for name in names) - 0.5
    bars.axvline(split, color="0.6", lw=0.8, ls=":")
    bars.set(ylabel=label, title="objects; left of the line: trained on, in other poses")
    motion = by_motion(rows)
    deepest = motion.depth_mm.max()
    for source in sources:
        one = motion[motion.source == source]
        for place, chosen, axis in ((down, one[one.aside_mm == 0], "depth_mm"), (aside, one[one.depth_mm == deepest], "aside_mm")):
            line = chosen.sort_values(axis)
            place.plot(line[axis], line[score], "o-", ms=3, color=COLOURS[source])
    down.set(xlabel="depth, mm", title="pressed down")
    aside.set(xlabel="displacement aside, mm", title=f"then aside, at {deepest:g} mm")
    for place in (bars, down, aside):
        place.set_ylim(bottom=0)
    bars.legend(frameon=False, fontsize=7, ncols=2)
    save(figure, *outputs.values())


def draw_sliding(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Figure 10: the change of the summed motion over fixed and free objects, with each source's threshold.

    inputs: verdicts (CSV);  settings: sources
    """
    plt, table = pyplot(), read_csv(inputs["verdicts"])
    sources = [name for name in settings["sources"] if name in set(table.source)]
    names = list(dict.fromkeys(table.object))
    figure, axes = plt.subplots(
        1, len(sources), figsize=(4.2 * len(sources), 3.6), sharey=True, squeeze=False, layout="constrained"
    )
    for place, source in zip(axes[0], sources, strict=True):
        one = table[table.source == source].set_index("object")
        for state, marker, colour in (("fixed", "s", "#1f4e79"), ("free", "o", "#e08214")):
            values = one[one.state == state].change_px.reindex(names).clip(lower=0.1)
            place.semilogy(
                np.arange(len(names)), values, marker, ms=5, mfc="none" if state == "free" else colour, color=colour, label=state
            )
        if one.change_px.notna().any():
            place.axhline(one.threshold_px.iloc[0], color="0.5", lw=0.8, ls="--", label="threshold")
        else:
            place.text(0.5, 0.5, "no image shows all markers", transform=place.transAxes, ha="center", fontsize=8)
        place.set_xticks(np.arange(len(names)), names, rotation=60, ha="right", fontsize=7)
        place.set_title(WORDS[source])
    axes[0, 0].set_ylabel("change of the summed motion, px")
    axes[0, -1].legend(frameon=False, fontsize=8)
    save(figure, *outputs.values())


def draw_training(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The losses of all trainings.  inputs: histories (list of CSV)."""
    plt = pyplot()
    figure, axes = plt.subplots(1, 3, figsize=(10, 3), layout="constrained")
    named = set[str]()
    for file in inputs["histories"]:
        one = read_csv(file)
        name = str(one.network.iloc[0])
        for place, column in zip(axes, ("l1", "adversarial", "discriminator"), strict=True):
            place.plot(one.epoch, one[column], color=COLOURS[name], label=None if name in named else WORDS[name])
            place.set(xlabel="epoch", title={"l1": "mean absolute error of pixels (-1 to 1)"}.get(column, f"{column} loss"))
        named.add(name)
    axes[0].set_ylim(bottom=0)
    handles = dict(zip(*axes[0].get_legend_handles_labels()[::-1], strict=True))
    axes[0].legend(handles.values(), handles.keys(), frameon=False, fontsize=7)
    save(figure, *outputs.values())


def drag_sequences(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The part of the page on which one drags through sequences.

    inputs: sequences (list), generator;  outputs: html;  settings: network, marker_radius_px, shown
    """
    generator, found = opened_generator(inputs["generator"], threads), []
    for data, whole in _shown(inputs["sequences"], settings["shown"]):
        camera = camera_of(data, whole, settings["marker_radius_px"])
        made = made_by(generator, data.depth_grey.values[whole], camera, np.arange(len(whole)))
        grey = np.repeat(data.depth_grey.values[whole][..., None], 3, axis=-1)
        name = WORDS[settings["network"]].removeprefix("the ")
        told = [
            f"{depth:.1f} mm down, {way:.1f} mm aside, {-force:z.1f} N, {share:.0%} of the contact slides"
            for depth, way, force, share in zip(
                data.depth_mm.values[whole],
                data.aside_mm.values[whole],
                data.force_n.values[whole, 2],
                data.slip_share.values[whole],
                strict=True,
            )
        ]
        scale = 256 / camera.px
        found.append(
            DragSequence(
                f"{data.object.values[whole[0]]}, along {data.aside.values[whole[0]]}",
                {"depth": grey, "solved": data.image.values[whole], name: made.images if made.images is not None else grey},
                {"solved": scale * data.marker_px.values[whole], name: scale * made.places_px},
                told,
            )
        )
    with atomic_path(outputs["html"]) as temporary:
        temporary.write_text(drag_fragment(found), encoding="utf-8")


def _shown(files: list[Any], count: int) -> "list[tuple[xarray.Dataset, np.ndarray]]":
    """(file, rows) of the longest unseen sequence of each of the first objects, else of any test."""
    found: list[tuple[bool, int, xarray.Dataset, np.ndarray]] = []
    for file in files:
        data = read_dataset(file)
        for split in (UNSEEN, "held_out"):
            numbers, frames = np.unique(data.sequence.values[data.split.values == split], return_counts=True)
            if len(numbers) and len(found) < count:
                number = numbers[np.argmax(frames)]
                found.append((split != UNSEEN, len(found), data, np.flatnonzero(data.sequence.values == number)))
                break
    return [(data, rows) for _, _, data, rows in sorted(found, key=lambda one: one[:2])]
