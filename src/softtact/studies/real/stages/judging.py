"""The verdicts, and the page of the study."""

from typing import Any

import pandas as pd

from softtact.files import read_csv, read_json, write_csv
from softtact.reporting.page import Page, counted
from softtact.studies.real.claims import claims_of_real

_CAPTIONS = {
    "gel_force": "Left: force of a ball on the gel, each variant with the one modulus that is best for all fitted points "
                 "(crosses). Right: error of the depth at the measured forces.",
    "markers": "Motion of the markers under a ball, measured and by the models, each fitted to this image with the camera's shift.",
    "shading": "A press of each set that was held out, with its circle as labelled: measured and by each model. Circles were "
               "found from the colours.",
    "ball_size": "Error of the colours over the assumed radius of the ball: presses held out, in and around the contact; the "
                 "wheel's table, which has seen all presses, in the contact.",
    "circles": "The middle of each press from its label: where the shading finds it, and where the image minus the untouched gel "
               "is most odd, for which no shading and no ball is assumed. Where both agree and the label does not, it is off.",
}


_SCORES = ("mae", "mse", "ssim", "psnr_db", "around_mae", "around_mse", "around_ssim", "around_psnr_db", "normal_deg",
           "normal_median_deg")


def judge(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the table of claims.  inputs: the tables (CSV);  outputs: claims;  settings: of `claims_of_real`"""
    tables = {name: read_csv(path) for name, path in inputs.items()}
    write_csv(outputs["claims"], claims_of_real(tables, **settings))


def report(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page.  inputs: the tables, claims (CSV), figures, facts (lists), gel (JSON);  outputs: page;
    settings: study, names (of the figures), config
    """
    tables = {name: read_csv(path, keep_default_na=name != "claims") for name, path in inputs.items()
              if name not in ("figures", "facts", "gel")}
    facts, gel = [read_json(path) for path in inputs["facts"]], read_json(inputs["gel"])
    page = Page("Gels with a camera on measured data", settings["study"], folder=outputs["page"].parent)
    judged = tables["claims"]
    page.opening(
        asked="Do the models of gels with a camera give the forces, the markers and the colours that were measured?",
        found=[(counted(judged), inputs["claims"]),
               *((f"{one.claim}: {one.ours} ({one.verdict}).", inputs["claims"]) for one in judged.itertuples())],
        sure=["Force: moduli are fitted to the points that each row of the table names; all else is predicted.",
              (f"Markers: the gel (path {gel['path']}, distance {gel['distance_px']:.0f} px) is fitted to the first image; in "
               "other images only the ball's place, depth and motion and the camera's shift are.", inputs["gel"]),
              "Shading: fitted to presses that are not among those of the scores; circles that are found use the held-out image "
              "itself to find where the ball is, labelled ones do not. The wheel's table was fitted to all presses by its makers."],
        synthetic=[(f"{one['presses']} presses: {one['source']}{'' if one['measured'] else '; synthetic, no measurement'}.", path)
                   for one, path in zip(facts, inputs["facts"], strict=True)])
    page.claims(tables["claims"], title="Claims", file=inputs["claims"])
    page.figures((path, _CAPTIONS[name]) for path, name in zip(inputs["figures"], settings["names"], strict=True))
    page.section("Tables")
    page.table(tables["gel_force"][tables["gel_force"].fitted_to == "all"], "One modulus for all points", file=inputs["gel_force"])
    page.table(tables["markers"], "Markers, first image", file=inputs["markers"])
    if len(tables["other_markers"]):
        page.table(tables["other_markers"], "Markers, other images", file=inputs["other_markers"])
    page.table(mean_scores(tables["shading"]), "Shading, mean over held-out presses", file=inputs["shading"])
    page.table(tables["ball_size"].drop_duplicates(["set", "model"]), "Size of the ball", file=inputs["ball_size"])
    page.table(circles_summary(tables["circles"]), "Labelled circles, medians over presses", file=inputs["circles"])
    page.configuration(settings["config"])
    page.write(outputs["page"])


def mean_scores(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each set, kind of circles and model: means over seeds of the means over presses, and the scatter over seeds."""
    names = [name for name in _SCORES if name in table]
    keys = ["set", "circles", "model"]
    seeds = table.groupby([*keys, "seed"], sort=False)[names].mean()
    over = seeds.groupby(keys, sort=False)
    spread = over[["mae"]].std(ddof=1).rename(columns={"mae": "mae_sd_of_seeds"})
    return pd.concat([over[names].mean(), spread, over.size().rename("seeds")], axis=1).reset_index()


def circles_summary(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each set: medians of distances between labelled, found and odd middles, and of the radii's ratio, in px."""
    own = table.assign(found_over_label_radius=table.found_radius_px / table.label_radius_px)
    names = ["found_minus_label_px", "odd_minus_label_px", "odd_minus_found_px", "found_over_label_radius", "label_radius_px"]
    return own.groupby("set", sort=False)[names].median().reset_index()
