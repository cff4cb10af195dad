"""The paper's claims on marker images, each with its number, ours, and a verdict computed by the rule beside it.

Our networks learn from our own solved images, and are scored on them: a verdict says whether a statement holds there. The paper's
numbers themselves need its real images. Rows that hold printed statements against each other are `consistent in print` or
`contradicts itself`.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import (
    COLUMNS,
    CONSISTENT,
    CONTRADICTION,
    LEAST_OBJECTS,
    MEASUREMENTS,
    RULE,
    UNDECIDED,
    Estimate,
    above,
    difference_of_groups,
    inside,
    mean_over_objects,
    row,
    verdict_of,
)
from softtact.studies.markers.judging import SMALL_OBJECTS, wrong_objects

# Tables I and II: d in px, error vector magnitude in px, degenerate images in %; MAE, MSE, SSIM, PSNR.
PRINTED_MARKERS = {
    "Taxim": (205, 205, np.nan),
    "pix2pix": (193, 204, 46.9),
    "no_lstm": (169, 174, 3.78),
    "proposed": (147, 154, 0.522),
}
PRINTED_IMAGES = {
    "Phong": (14.8, 354, 0.913, 22.7),
    "pix2pix": (12.6, 355, 0.908, 25.1),
    "no_lstm": (5.01, 62.0, 0.916, 32.2),
    "proposed": (3.08, 22.9, 0.943, 35.2),
}
MM_PER_PX = 0.0625  # not printed; of the authors' own files
_SCORES, _SLIDING, _OURS = "tables/scores.csv", "tables/sliding.csv", "on our own solved images"
_ALIKE = 0.2  # share of the mean by which objects may differ and still be without a clear difference


def claims_of_markers(rows: pd.DataFrame, verdicts: pd.DataFrame, facts: dict[str, Any], weights: dict[str, int]) -> pd.DataFrame:
    """Data frame with `decisions.COLUMNS`.

    rows: scores, a row for each frame;  verdicts: of the sliding test;  facts: of the data set;  weights: {network: number}
    """
    found = [
        _pairs(facts),
        *_numbers_in_print(),
        *_words_in_print(),
        *_without_lstm(weights),
        *_orders(rows),
        *_of_groups(rows),
        _larger_areas(rows),
        _levels(rows),
        *_sliding(verdicts),
        *_needs_images(),
    ]
    return pd.DataFrame(found, columns=COLUMNS)


def _pairs(facts: dict[str, Any]) -> dict[str, str]:
    pairs = 16 * facts["pairs_of_object"]
    return row(
        "19,845 pairs of images an object, 318k in all",
        "sec. IV-C",
        "19,845; 318k",
        f"{facts['poses']} poses make {facts['pairs_of_object']:,} pairs, 16 objects {pairs:,}",
        CONSISTENT if (facts["pairs_of_object"], round(pairs, -3)) == (19_845, 318_000) else UNDECIDED,
        "product of the stated poses, depths and ways; undecided for another path",
        "facts/data.json",
        uncertainty="none: counted",
    )


def _numbers_in_print() -> Iterator[dict[str, str]]:
    of_taxim, of_phong = (
        1 - PRINTED_MARKERS["proposed"][0] / PRINTED_MARKERS["Taxim"][0],
        1 - PRINTED_IMAGES["proposed"][1] / PRINTED_IMAGES["Phong"][1],
    )
    yield row(
        "The position error is 28.3 % below the illumination model's and the MSE 93.5 % below the FEM-based method's",
        "sec. I",
        "28.3 % (illumination model), 93.5 % (FEM)",
        f"tables I and II: {of_taxim:.1%} below Taxim, the FEM-based method; {of_phong:.1%} below Phong, the illumination model",
        CONTRADICTION,
        "the introduction names each baseline for the other's table",
        "tables/claims.csv",
        uncertainty="none: printed numbers",
    )
    per_marker = PRINTED_MARKERS["proposed"][0] / 64 * MM_PER_PX
    yield row(
        "147 px are 0.144 mm a marker",
        "sec. V-A",
        "0.144 mm",
        f"{per_marker:.4f} mm at {MM_PER_PX:g} mm a pixel",
        CONSISTENT if abs(per_marker - 0.144) < 5e-4 else CONTRADICTION,
        "147 / 64 markers, scale of the authors' files",
        "tables/claims.csv",
        uncertainty="none: printed numbers",
    )


def _words_in_print() -> Iterator[dict[str, str]]:
    yield row(
        "Each patch's number is in [0, 1] owing to tanh",
        "sec. III-B",
        "[0, 1]",
        "tanh lies in (-1, 1), and log D needs D > 0",
        CONTRADICTION,
        "range of the function",
        "tables/claims.csv",
        uncertainty="none: a function's range",
    )
    yield row(
        "Which eight objects are trained on",
        "fig. 6, sec. V-A",
        "fig. 6: those on the right; section V-A: those on the left",
        "section IV-C names those of fig. 6's right half; section V-A's left and right agree with it only if fig. 8 has another "
        "order than fig. 6",
        CONTRADICTION,
        "the statements name opposite halves; the study follows section IV-C",
        "tables/claims.csv",
        uncertainty="none: printed statements",
    )


def _without_lstm(weights: dict[str, int]) -> Iterator[dict[str, str]]:
    if "no_lstm" in weights:
        yield row(
            "The 3D-UNet without LSTM refers to earlier frames by its 3-D convolutions",
            "sec. III-B, V",
            "all layers are 3-D",
            f"kernels of one frame give {weights['proposed_printed'] / 1e6:.1f} million weights, of three frames "
            f"{weights['temporal_printed'] / 1e6:.0f}; with one frame no layer but the LSTM sees another frame",
            CONSISTENT,
            "the ablation named 3D-UNet then treats each frame alone, as Pix2Pix does",
            "tables/claims.csv",
            uncertainty="none: counted",
        )


def _by_object(rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Means of a score, a row for each object and a column for each source."""
    return rows.groupby(["object", "source"])[name].mean().unstack()


def _gap(rows: pd.DataFrame, name: str, worse: str, better: str) -> Estimate:
    """Mean over objects of what one source has more of than another."""
    means = _by_object(rows, name)
    if worse not in means or better not in means:
        return Estimate(np.nan, np.nan, np.nan, 0)
    return mean_over_objects(means[worse] - means[better])


_ORDERS = (
    ("d_px", "d", "px", "no_lstm", "proposed", "table I", "169 and 147 px"),
    ("d_px", "d", "px", "pix2pix", "no_lstm", "table I", "193 and 169 px"),
    ("e_px", "error vector magnitude", "px", "no_lstm", "proposed", "table I", "174 and 154 px"),
    ("degenerate", "share of degenerate images", "", "pix2pix", "no_lstm", "table I", "46.9 and 3.78 %"),
    ("degenerate", "share of degenerate images", "", "no_lstm", "proposed", "table I", "3.78 and 0.522 %"),
    ("mse", "MSE outside the markers", "", "pix2pix", "no_lstm", "table II", "355 and 62.0"),
    ("mse", "MSE outside the markers", "", "no_lstm", "proposed", "table II", "62.0 and 22.9"),
    ("d_px", "d", "px", "no_motion", "proposed", "not claimed", "the authors' networks beat no motion: not printed"),
    ("d_px", "d", "px", "temporal", "proposed", "not claimed", "a true 3-D kernel instead of the LSTM: not tried"),
    ("d_px", "d", "px", "proposed", "physics", "not claimed", "the solved images by the same detector: its floor"),
)
WORDS = {
    "proposed": "the proposed network",
    "no_lstm": "the 3D-UNet without LSTM",
    "pix2pix": "Pix2Pix",
    "temporal": "the true 3-D kernel without LSTM",
    "no_motion": "no motion",
    "physics": "the solved images",
    "full_stick": "full stick",
    "linear_frictionless": "no friction",
}


def _orders(rows: pd.DataFrame) -> Iterator[dict[str, str]]:
    for name, words, unit, worse, better, where, paper in _ORDERS:
        gap, means = _gap(rows, name, worse, better), _by_object(rows, name).mean()
        claim = f"The {words} of {WORDS[better]} is smaller than that of {WORDS[worse]}"
        ours = "not run" if not gap.objects else f"{means[worse]:.4g} and {means[better]:.4g} {unit}".strip() + f" {_OURS}"
        yield row(
            claim, where, paper, ours, above(gap, 0.0), RULE, _SCORES, uncertainty=gap.in_words("+.3g")
        )


def _of_groups(rows: pd.DataFrame) -> Iterator[dict[str, str]]:
    one = rows[rows.source == "proposed"]
    means = one.groupby(["split", "object"]).d_px.mean()
    groups = [
        means.loc[split].to_numpy() if split in means.index.get_level_values(0) else np.zeros(0) for split in ("held_out", "unseen")
    ]
    gap, level = difference_of_groups(groups[1], groups[0]), float(one.d_px.mean())
    yield row(
        "There is no clear difference in d between objects that were trained on and others",
        "sec. V-A, fig. 8",
        "by eye",
        "no image shows all markers" if np.isnan(gap.mean) else f"unseen objects {gap.mean:+.3g} px of {level:.3g} px {_OURS}",
        inside(gap, -_ALIKE * level, _ALIKE * level),
        f"the difference within {_ALIKE:.0%} of the mean; {RULE}",
        _SCORES,
        uncertainty=gap.in_words("+.3g"),
    )


def _larger_areas(rows: pd.DataFrame) -> dict[str, str]:
    means = _by_object(rows, "d_px")
    claim, rule = "Objects with larger areas, such as cylinder and pacman, have a larger d", "both above the median of all objects"
    if "proposed" not in means or not {"cylinder", "pacman"} <= set(means.index):
        return row(claim, "sec. V-A", "by eye", "not run", UNDECIDED, rule, _SCORES)
    one = means["proposed"]
    return row(
        claim,
        "sec. V-A",
        "by eye",
        f"cylinder {one.cylinder:.3g}, pacman {one.pacman:.3g}, median {one.median():.3g} px",
        UNDECIDED,
        f"{rule}; two objects are fewer than the {LEAST_OBJECTS} that a verdict needs",
        _SCORES,
        uncertainty="two objects that are named",
    )


def _levels(rows: pd.DataFrame) -> dict[str, str]:
    claim, rule = (
        "The proposed network has the smallest d at every deformation",
        "of the networks, at every depth and displacement aside scored",
    )
    networks = [name for name in ("proposed", "no_lstm", "pix2pix") if name in set(rows.source)]
    if len(networks) < 2 or "proposed" not in networks:
        return row(claim, "fig. 8 (b)", "by eye", "not run", UNDECIDED, rule, _SCORES)
    means = (
        rows[rows.source.isin(networks)]
        .assign(depth=rows.depth_mm.round(3), aside=rows.aside_mm.round(3))
        .groupby(["depth", "aside", "source"])
        .d_px.mean()
        .unstack()
    )
    means = means.dropna(how="all").fillna(np.inf)  # a network whose images all lack a marker has no d
    if means.empty:
        return row(claim, "fig. 8 (b)", "by eye", "no image shows all markers", UNDECIDED, rule, _SCORES)
    best = means.idxmin(axis=1) == "proposed"
    return row(
        claim,
        "fig. 8 (b)",
        "by eye",
        f"at {int(best.sum())} of {len(best)} deformations {_OURS}",
        verdict_of(bool(best.all())),
        rule,
        _SCORES,
        uncertainty="none: means of all objects compared",
    )


def _sliding(verdicts: pd.DataFrame) -> Iterator[dict[str, str]]:
    rule = "no object but these two is told wrongly; of all sixteen, else undecided"
    for source in ("proposed", "physics"):
        claim = f"The change of the summed motion tells fixed from free objects, all but cone and tetrahedron: {WORDS[source]}"
        if source not in set(verdicts.source):
            yield row(claim, "sec. V-C", "cone and tetrahedron wrong", "not run", UNDECIDED, rule, _SLIDING)
            continue
        wrong, objects = wrong_objects(verdicts, source), verdicts.object.nunique()
        yield row(
            claim,
            "sec. V-C",
            "cone and tetrahedron wrong",
            f"wrong of {objects}: {', '.join(wrong) or 'none'}",
            verdict_of(set(wrong) <= set(SMALL_OBJECTS)) if objects >= 16 else UNDECIDED,
            rule,
            _SLIDING,
            uncertainty="none: every object once",
        )


def _needs_images() -> Iterator[dict[str, str]]:
    for name in ("Taxim", "pix2pix", "no_lstm", "proposed"):
        yield row(
            f"d of {WORDS.get(name, name)} on real images",
            "table I",
            f"{PRINTED_MARKERS[name][0]} px",
            "no real sequence is here",
            MEASUREMENTS,
            "needs the authors' images",
            "tables/claims.csv",
            uncertainty="not told",
        )
