"""Scores of the test sequences: of networks, of the image at rest, of other physics, and of the solved images themselves."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.evaluation.image_scores import marker_sum_change_px
from softtact.files import read_dataset, write_csv
from softtact.progress import Watch
from softtact.studies.markers.paths import TRAIN
from softtact.studies.markers.scoring import COLUMNS, Camera, Made, Truth, marker_places, scored_frames, scores, truth_of

if TYPE_CHECKING:
    import xarray

SLIDING_COLUMNS = ["source", "object", "state", "change_px", "markers_lost"]


def score_network(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Score the images that a network makes of the test sequences.

    inputs: generator, sequences (list);  outputs: scores (CSV)
    settings: network, seed, every, marker_radius_px
    """
    generator = opened_generator(inputs["generator"], threads)
    rows = []
    for data, whole, chosen, camera in _tests(inputs["sequences"], settings, label=f"scores of {settings['network']}"):
        made = made_by(generator, data.depth_grey.values[whole], camera, chosen)
        rows.append(scores(made, truth_of(data, whole[chosen]), camera, source=settings["network"], seed=settings["seed"]))
    write_csv(outputs["scores"], pd.concat(rows)[COLUMNS])


def score_references(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Score what needs no network: the image at rest, the markers of other physics, and the solved images by the same detector.

    inputs: sequences, BASELINE (lists in the same order);  outputs: scores (CSV);  settings: baselines, every, marker_radius_px
    """
    others = {name: [read_dataset(file) for file in inputs.get(name, [])] for name in settings["baselines"]}
    places = {
        name: {
            number: one.marker_px.values[one.sequence.values == number]
            for one in files
            for number in np.unique(one.sequence.values)
        }
        for name, files in others.items()
    }
    rows = []
    for data, whole, chosen, camera in _tests(inputs["sequences"], settings, label="scores of references"):
        truth, number = truth_of(data, whole[chosen]), int(data.sequence.values[whole[0]])
        for source, made in _references(data, whole, chosen, camera, truth):
            rows.append(scores(made, truth, camera, source=source, seed=0))
        for name, of_sequence in places.items():
            if number in of_sequence:
                px = of_sequence[number]
                rows.append(scores(Made(px[chosen], px[0], None), truth, camera, source=name, seed=0))
    write_csv(outputs["scores"], pd.concat(rows)[COLUMNS])


def _references(
    data: "xarray.Dataset", whole: np.ndarray, chosen: np.ndarray, camera: Camera, truth: Truth
) -> Iterator[tuple[str, Made]]:
    """The image at rest for every frame, and the solved images with their markers found by the detector."""
    still = np.repeat(truth.rest_px[None], len(chosen), axis=0)
    images = data.image.values[whole]
    yield "no_motion", Made(still, truth.rest_px, np.repeat(images[:1], len(chosen), axis=0))
    found = marker_places(images, camera)
    yield "physics", Made(found[chosen], found[0], images[chosen])


def _tests(
    files: list[Any], settings: dict[str, Any], label: str
) -> Iterator[tuple["xarray.Dataset", np.ndarray, np.ndarray, Camera]]:
    """(file, rows of a test sequence, which of them are scored, camera) of each test sequence."""
    watch = Watch(label)
    for count, file in enumerate(files, start=1):
        data = read_dataset(file)
        for number in np.unique(data.sequence.values[data.split.values != TRAIN]):
            whole = np.flatnonzero(data.sequence.values == number)
            yield data, whole, scored_frames(len(whole), settings["every"]), camera_of(data, whole, settings["marker_radius_px"])
            watch.report(f"file {count} of {len(files)}, sequence {number}")
    watch.end()


def camera_of(data: "xarray.Dataset", whole: np.ndarray, radius_px: float) -> Camera:
    """What scores need of the camera; whole: rows of one sequence."""
    return Camera(int(data.attrs["camera_px"]), radius_px, data.marker_px.values[whole[0]])


def made_by(generator: Any, grey: np.ndarray, camera: Camera, chosen: np.ndarray) -> Made:
    """What a generator makes of the depth images (n, y, x) uint8 of a whole sequence, of its chosen frames."""
    from softtact.learning.image_training import generate

    images = generate(generator, grey)
    places = marker_places(images, camera)
    return Made(places[chosen], places[0], images[chosen])


def opened_generator(file: Any, threads: int) -> Any:
    """The generator of a file, ready to run on the CPU."""
    from softtact.learning.image_networks import load_generator
    from softtact.learning.training import prepare_torch

    prepare_torch(threads=threads)
    return load_generator(file)[0]


def slide_objects(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """How the summed motion of all markers changes while the sensor moves aside, over a fixed and over a free object (equation 8).

    A free object goes along with the sensor, so that its frames stay as they were after the press down.

    inputs: sequences (list of one sequence an object), generators (list);  outputs: table (CSV: SLIDING_COLUMNS)
    settings: networks, marker_radius_px
    """
    rows = []
    generators = [
        (name, opened_generator(file, threads)) for name, file in zip(settings["networks"], inputs["generators"], strict=True)
    ]
    for file in inputs["sequences"]:
        data = read_dataset(file)
        whole = np.arange(data.sizes["frame"])
        camera, pressed = camera_of(data, whole, settings["marker_radius_px"]), int(np.flatnonzero(data.aside_mm.values > 0)[0]) - 1
        waiting = np.where(whole <= pressed, whole, pressed)
        for state, frames in (("fixed", whole), ("free", waiting)):
            sources = [("physics", marker_places(data.image.values[frames], camera))]
            for name, generator in generators:
                made = made_by(generator, data.depth_grey.values[frames], camera, whole)
                sources.append((name, made.places_px))
            rows += [_slid(source, str(data.object.values[0]), state, places[pressed], places[-1]) for source, places in sources]
    write_csv(outputs["table"], pd.DataFrame(rows, columns=SLIDING_COLUMNS))


def _slid(source: str, name: str, state: str, before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    """A row; markers that one of both images lacks are left out of the sum, which is nan without any."""
    known = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    return {
        "source": source,
        "object": name,
        "state": state,
        "change_px": marker_sum_change_px(before[known], after[known]) if known.any() else np.nan,
        "markers_lost": int((~known).sum()),
    }
