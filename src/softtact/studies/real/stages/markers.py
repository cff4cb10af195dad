"""Markers under a ball: the gel's parameters from one image, and other images judged with them."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from softtact.files import read_json, write_csv, write_json
from softtact.imaging.ball_markers import MarkerGel, fit_formulas, fit_linear_layer, fit_load
from softtact.imaging.marker_motion import (
    REGISTRATIONS,
    MarkerMotion,
    MotionFit,
    fit_motion,
    left_out_spline,
    motion_error,
    registration,
)
from softtact.progress import announce
from softtact.studies.real.paths import read_path, write_path

PHYSICS, FORMULAS, LAYER, SPLINE, NOTHING, CAMERA = MODELS = (
    "finite strain, stick and slip", "FOTS' formulas", "one linear layer", "thin-plate spline, left out", "no motion",
    "camera's motion alone")
SHARE = f"{PHYSICS}, stuck share fitted"
_COLUMNS = ["image", "model", "camera", "components", "vectors", "rounded", "fitted", "parameters"]


def fit_gel(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Fit the gel to the first image and compare with what the field uses.

    inputs: markers (CSV), path_NAME (NetCDF);  outputs: table, motion (CSV), gel (JSON), path (NetCDF);  settings: markers
    """
    values, markers = settings["markers"], MarkerMotion.read(inputs["markers"])
    chosen, gel, fits = _best_path(values, markers, inputs)
    around = {"centre_px": values["centre_px"], "sheared": False}
    rows, motions = _compared(markers, gel, values["middle_px"], around, "first")
    rows += [_row("first", f"{PHYSICS}, path {name}", "shift", fit, _named(load, one)) for name, (load, one, fit) in fits.items()]
    write_csv(outputs["table"], pd.DataFrame(rows, columns=_COLUMNS))
    write_csv(outputs["motion"], _motion_table(markers, motions))
    write_json(outputs["gel"], {"path": chosen, "middle_px": values["middle_px"], "centre_px": values["centre_px"],
                                **{name: value for name, value in vars(gel).items() if name != "press"}})
    write_path(outputs["path"], gel.press, chosen)


def judge_markers(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Judge other images with the gel as it is; only how the ball stands in them and the camera's shift are fitted.

    inputs: gel (JSON), path (NetCDF), others (list of CSV);  outputs: table (CSV);  settings: names, sheared (list of booleans)
    """
    gel, facts = _read_gel(inputs)
    rows: list[dict[str, Any]] = []
    for path, name, sheared in zip(inputs["others"], settings["names"], settings["sheared"], strict=True):
        markers = MarkerMotion.read(path)
        around = {"centre_px": _seen_centre(markers), "sheared": sheared}
        found, _ = _compared(markers, gel, facts["middle_px"], around, name)
        rows += found
    write_csv(outputs["table"], pd.DataFrame(rows, columns=_COLUMNS))


def score_markers(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The errors of one CSV of markers, with the gel that a finished study found; a stage to be run by hand.

    inputs: markers (CSV), gel (JSON), path (NetCDF);  outputs: table (CSV);  settings: sheared (default true)
    """
    gel, facts = _read_gel(inputs)
    markers = MarkerMotion.read(inputs["markers"])
    around = {"centre_px": _seen_centre(markers), "sheared": settings.get("sheared", True)}
    rows, _ = _compared(markers, gel, facts["middle_px"], around, markers.name)
    table = pd.DataFrame(rows, columns=_COLUMNS)
    write_csv(outputs["table"], table)
    for row in table.itertuples():
        announce(f"{row.model}, camera {row.camera}: {row.components:.3f} by components, {row.vectors:.3f} by vectors")


def _best_path(values, markers, inputs):
    """Name of the best path, its gel with ball and distance as fitted, and all fits {path: (load, gel, fit)}."""
    fits = {}
    for name, one in values["paths"].items():
        ratio = one["bulk_over_shear"]
        gel = MarkerGel(read_path(inputs[f"path_{name}"]), values["ball_px"], one["ball_over_thickness"], one["friction"],
                        values["distance_px"], (3 * ratio - 2) / (6 * ratio + 2))
        fits[name] = fit_load(markers, gel, values["middle_px"], centre_px=values["centre_px"], sheared=False, free_distance=True)
    chosen = min(fits, key=lambda name: fits[name][2].error.components)
    return chosen, fits[chosen][1], fits


def _compared(markers, gel, middle_px, around, image):
    """Rows of all models on one image, and the motions {model: (marker, 2)} with the camera's shift."""
    measured = markers.motion_px
    load, _, fit = fit_load(markers, gel, middle_px, **around)
    contact = {"ball_px": gel.ball_px, "contact_px": gel.contact_px(load.depth_px)}
    layer = contact | {"thickness_px": gel.thickness_px}
    rows, motions = [], {}
    for camera in REGISTRATIONS:
        load, _, fit = fit_load(markers, gel, middle_px, camera=camera, **around)
        found = {PHYSICS: (fit, _named(load, gel)),
                 FORMULAS: (one := fit_formulas(markers, middle_px, camera=camera, **contact, **around), _listed(one)),
                 LAYER: (one := fit_linear_layer(markers, middle_px, camera=camera, **layer, **around), _listed(one)),
                 CAMERA: (one := _camera_alone(markers, middle_px, camera), _listed(one))}
        if around["sheared"]:
            load, _, fit = fit_load(markers, gel, middle_px, camera=camera, free_share=True, **around)
            found[SHARE] = fit, f"stuck share {load.stick_share:.2f}; {_named(load, gel)}"
        rows += [_row(image, model, camera, one, text) for model, (one, text) in found.items()]
        motions = {model: one.predicted_px for model, (one, _) in found.items()} if camera == "shift" else motions
    spline, none = left_out_spline(markers), np.zeros_like(measured)
    for model, motion in ((SPLINE, spline), (NOTHING, none)):
        rows.append(_row(image, model, "none", MotionFit(np.zeros(0), motion, motion_error(motion, measured)), ""))
    return rows, motions


def _camera_alone(markers, middle_px, camera):
    free = REGISTRATIONS[camera]
    if not free:
        return MotionFit(np.zeros(0), none := np.zeros_like(markers.motion_px), motion_error(none, markers.motion_px))
    return fit_motion(lambda values: registration("similarity", markers.px, middle_px, values), markers, [[0.0] * free],
                      ([-80, -80, -0.1, -0.1][:free], [80, 80, 0.1, 0.1][:free]))


def _row(image, model, camera, fit, parameters):
    return {"image": image, "model": model, "camera": camera, **asdict(fit.error), "fitted": len(fit.values),
            "parameters": parameters}


def _named(load, gel):
    """Parameters of the physics in words, px."""
    aside = f"; aside {load.aside_px[0]:.1f}, {load.aside_px[1]:.1f}, all slides at {gel.sliding_px(load.depth_px):.1f}" if any(
        load.aside_px) else ""
    return (f"centre {load.centre_px[0]:.1f}, {load.centre_px[1]:.1f}; depth {load.depth_px:.1f}; contact radius "
            f"{gel.contact_px(load.depth_px):.1f}{aside}; camera {_listed_values(load.camera)}; ball {gel.ball_px:g}; thickness "
            f"{gel.thickness_px:.1f}; friction {gel.friction:g}; nu {gel.poisson:.3f}; camera's distance {gel.distance_px:.0f}")


def _listed(fit):
    return _listed_values(fit.values)


def _listed_values(values):
    return " ".join(f"{value:.4g}" for value in values)


def _read_gel(inputs):
    facts = read_json(inputs["gel"])
    fields = {name: facts[name] for name in ("ball_px", "ball_over_thickness", "friction", "distance_px", "poisson")}
    return MarkerGel(press=read_path(inputs["path"]), **fields), facts


def _seen_centre(markers):
    """Where the markers move most against their median: a start for the fit."""
    away = markers.motion_px - np.median(markers.motion_px, axis=0)
    weight = np.sum(away**2, axis=1)
    return [float(value) for value in weight @ markers.px / weight.sum()]


def _motion_table(markers, motions):
    frame = {"x_px": markers.px[:, 0], "y_px": markers.px[:, 1], "measured_x_px": markers.motion_px[:, 0],
             "measured_y_px": markers.motion_px[:, 1]}
    for model, motion in motions.items():
        frame |= {f"{model} x_px": motion[:, 0], f"{model} y_px": motion[:, 1]}
    return pd.DataFrame(frame)
