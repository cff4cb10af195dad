"""Tables, claims and the page."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from softtact.files import read_csv, read_json, write_csv
from softtact.reporting.page import Page, counted
from softtact.studies.markers.claims import PRINTED_IMAGES, PRINTED_MARKERS, WORDS, claims_of_markers
from softtact.studies.markers.judging import by_motion, by_object, sliding_verdicts
from softtact.studies.markers.scoring import table_one, table_two

CAPTIONS = {
    "fig7_examples": "Figure 7: depth image, solved image, and the images of each network, of objects that no network knew; "
    "pressed down, then aside.",
    "fig8_d": "Figure 8: d, the sum over all markers of their position error in px of the camera; in the mean of test sequences.",
    "fig9_mse": "Figure 9: mean squared error outside the markers.",
    "fig10_sliding": "Figure 10: change of the summed motion of the markers (equation 8) while the sensor moves aside.",
    "training": "Losses of the trainings, one line a seed.",
}
_TITLES = {"by_object": "By object", "sliding": "Sliding test", "manifest": "Sequences"}
_MOST_ROWS = 40


def judge(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the tables and the claims.

    inputs: scores (list of CSV), sliding (CSV), facts (JSON)
    outputs: scores, table1, table2, by_object, by_motion, sliding, claims (CSV)
    settings: sources (in their order), trained (objects), networks
    """
    rows = pd.concat([read_csv(file) for file in inputs["scores"]], ignore_index=True)
    verdicts = sliding_verdicts(read_csv(inputs["sliding"]), settings["trained"])
    write_csv(outputs["scores"], rows)
    write_csv(
        outputs["table1"], _beside(table_one(rows, settings["sources"]), PRINTED_MARKERS, ("d_px", "e_px", "degenerate_percent"))
    )
    write_csv(outputs["table2"], _beside(table_two(rows, settings["sources"]), PRINTED_IMAGES, ("mae", "mse", "ssim", "psnr")))
    write_csv(outputs["by_object"], by_object(rows))
    write_csv(outputs["by_motion"], by_motion(rows))
    write_csv(outputs["sliding"], verdicts)
    write_csv(outputs["claims"], claims_of_markers(rows, verdicts, read_json(inputs["facts"]), _weights(settings["networks"])))


def _weights(names: Sequence[str]) -> dict[str, int]:
    """Numbers of weights of the compared networks, and of the printed ones."""
    import torch

    from softtact.learning.image_networks import count_weights, make_networks

    with torch.device("meta"):  # sizes without numbers
        found = {name: count_weights(make_networks(name)[0]) for name in names}
        return found | {
            f"{name}_printed": count_weights(make_networks(name, size="printed")[0]) for name in ("proposed", "temporal")
        }


def _beside(table: pd.DataFrame, printed: Mapping[str, tuple[float, ...]], names: tuple[str, ...]) -> pd.DataFrame:
    """A table with the printed numbers of the same columns beside, and rows of those sources that are only printed."""
    known = pd.DataFrame(
        [
            {"source": source, **{f"printed_{name}": value for name, value in zip(names, values, strict=True)}}
            for source, values in printed.items()
        ]
    )
    joined = table.merge(known, on="source", how="outer")
    only_printed = [source for source in printed if source not in set(table.source)]
    return joined.set_index("source").loc[[*table.source, *only_printed]].reset_index()


def report(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page.

    inputs: table1, table2, by_object, sliding, claims, manifest (CSV), facts (JSON), figures (list), drag (HTML)
    outputs: page;  settings: study, size, pixels, friction (words), config
    """
    tables = {
        name: read_csv(inputs[name], keep_default_na=name != "claims")
        for name in ("table1", "table2", "by_object", "sliding", "claims", "manifest")
    }
    facts = read_json(inputs["facts"])
    page = Page("Marker images", settings["study"], folder=outputs["page"].parent)
    page.opening(
        asked=[
            "Which network makes the marker images of a gel from depth images best, and how near do they come to solved images?",
            *((sentence, inputs["facts"]) for sentence in _facts(facts, settings)),
        ],
        found=[*_best_networks(tables["table1"], inputs["table1"]), (counted(tables["claims"]), inputs["claims"])],
        sure=[
            ("The solved images, their markers found by the same detector, are the floor of all errors.", inputs["table1"]),
            ("A claim is decided only where its 95 % interval over objects is clear of its limit.", inputs["claims"]),
        ],
        synthetic="No real image of this sensor is here. The images that networks learn from, and are scored on, "
        "are our own: solved by the elastic model and drawn by the camera readout. A network can only come near that physics, "
        "and no number here is the paper's. How far the physics itself is from real markers is told by softtact stage "
        "markers.compare_markers, for anyone who has an image.",
    )
    page.section("Tables I and II")
    page.text(
        "Means over the scored frames. d and error vectors are of images in which every marker was found. The solved images are "
        "those that the networks learn, their markers found by the same detector: the floor of all d. Printed: the paper's "
        "numbers, on its real images."
    )
    for name, title in (
        ("table1", "Table I: markers"),
        ("table2", f"Table II: outside the markers, images of {settings['pixels']} px"),
    ):
        page.table(_worded(tables[name]), title, file=inputs[name])
    page.section("Drag through a sequence", anchor="drag")
    page.figure(inputs["drag"], "Drag the slider, or in the picture. Yellow: motion of the markers since rest, five times.")
    page.figures((path, CAPTIONS[path.stem]) for path in inputs["figures"])
    page.claims(tables["claims"], file=inputs["claims"])
    page.section("More tables")
    for name, title in _TITLES.items():
        page.table(_worded(tables[name]), title, file=inputs[name], most_rows=_MOST_ROWS)
    page.configuration(settings["config"])
    page.write(outputs["page"])


_HEADS = {"d_px": "d, px", "e_px": "error vector magnitude, px", "degenerate_percent": "degenerate images, %", "mae": "MAE",
          "mse": "MSE", "ssim": "SSIM", "psnr": "PSNR, dB"}


def _worded(table: pd.DataFrame) -> pd.DataFrame:
    """A table with sources and columns in words; a column without any number, such as a spread over one seed, is left out."""
    heads: dict[str, str] = {}
    for name, head in _HEADS.items():
        heads |= {name: head, f"{name}_sd": f"{head}, sd over seeds", f"{name}_each": f"{head}, each seed",
                  f"printed_{name}": f"printed: {head}"}
    if "source" in table:
        table = table.assign(source=table.source.map(lambda name: WORDS.get(name, name)))
    return table.dropna(axis=1, how="all").rename(columns=heads | {"source": "images or markers of"})


def _best_networks(table: pd.DataFrame, file: str) -> list[tuple[str, str]]:
    """A sentence on the marker errors of all that make images, the least first, and the table's file."""
    known = table.dropna(subset="d_px").sort_values("d_px")
    shown = ", ".join(f"{WORDS.get(one.source, one.source)} {one.d_px:.3g} px" for one in known.itertuples())
    return [(f"Sum of the position errors of all markers, d: {shown}.", file)] if shown else []


def _facts(facts: dict[str, Any], settings: dict[str, Any]) -> list[str]:
    made = facts["generated"]
    objects = (
        "All objects are generated after the sizes of the paper's files."
        if len(made) == facts["objects"]
        else f"Generated, the others being the authors' files: {', '.join(made)}."
    )
    return [
        f"{facts['sequences']} sequences of {facts['frames']:,} frames were pressed, {facts['share_of_printed_pairs']:.2%} of the "
        f"paper's 317,520 pairs; networks are {settings['size']}, images {settings['pixels']} px. The largest force is "
        f"{facts['largest_force_n']:.3g} N, the largest motion of a marker {facts['largest_marker_motion_px']:.3g} px of the "
        "camera's image.",
        objects,
    ]
