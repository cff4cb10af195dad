"""The force of a ball on a gel: one modulus against measured points."""

from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from softtact.files import write_csv, write_json
from softtact.models.elastic.ball_on_layer import BallOnLayer
from softtact.models.solid.ball_on_disc import Disc, DiscPress, press_disc
from softtact.progress import Watch
from softtact.studies.real.paths import read_path, write_path

ELASTIC = "elastic layer"       # linear, frictionless, of endless width
_ROUNDING = 1e-9                # of the path's last force, which the force at its last depth may exceed by round-off


def press_ball(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press a ball into a gel along a path of depths.  outputs: path (NetCDF);  settings: disc (values of a `Disc`), depths_mm"""
    watch = Watch("ball on a gel")
    found = press_disc(Disc(**settings["disc"]), settings["depths_mm"], report=lambda share: watch.report(f"{share:.0%}"))
    watch.end()
    write_path(outputs["path"], found, settings)


def fit_modulus(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Fit the modulus to each point alone and to all, and predict depth and force at every point.

    inputs: path_VARIANT (NetCDF);  outputs: table (CSV), facts (JSON);  settings: gel_force
    """
    values = settings["gel_force"]
    points, checks = ([(one["depth_mm"], one["force_n"]) for one in values[name]] for name in ("points", "check_points"))
    curves = {name: _curves(name, inputs, values) for name in [*values["variants"], ELASTIC]}
    table = pd.concat([_of_variant(name, path, ratio, points, checks) for name, (path, ratio) in curves.items()])
    write_csv(outputs["table"], table)
    fitted = table[(table.variant == values["judged"]) & (table.fitted_to == "all")]
    worst = float(fitted.depth_error.abs().max(skipna=False))
    write_json(outputs["facts"], {"variant": values["judged"], "c10_mpa": float(fitted.c10_mpa.iloc[0]),
                                  "largest_depth_error": worst if np.isfinite(worst) else None, "source": values["source"]})


def _curves(name, inputs, values):
    """Force over G of a depth, depth of a force over G, and E over G, of a variant."""
    if name == ELASTIC:
        one = values["variants"][values["judged"]]
        poisson = (3 * one["bulk_over_shear"] - 2) / (6 * one["bulk_over_shear"] + 2)
        path = elastic_path(values["ball_mm"], values["height_mm"], poisson, values["depths_mm"])
        return path, 2 * (1 + poisson)
    ratio = values["variants"][name]["bulk_over_shear"]
    return read_path(inputs[f"path_{name}"]), 9 * ratio / (3 * ratio + 1)


def elastic_path(ball_mm: float, height_mm: float, poisson: float, depths_mm: list[float]) -> DiscPress:
    """The path of a linear elastic layer without friction, without its surface."""
    def contact(depth):
        largest = min(0.97 * ball_mm, 9.9 * height_mm)
        return brentq(lambda radius: BallOnLayer(radius, ball_mm, height_mm, poisson).depth - depth, 1e-3 * ball_mm, largest)

    forces = [BallOnLayer(contact(depth), ball_mm, height_mm, poisson).force_over_shear_modulus for depth in depths_mm]
    none = np.zeros((len(depths_mm) + 1, 1))
    return DiscPress(np.array([0.0, *depths_mm]), np.array([0.0, *forces]), np.zeros(1), none, none)


def _of_variant(name, path, young_over_shear, points, checks):
    """Rows of one variant: fitted to each point and to all of them, and predicted at all points, those of the check too."""
    each = {f"{depth:g} mm": force / float(path.at(depth)) for depth, force in points}
    fits = each | {"all": _one_modulus(path, points)}
    return pd.DataFrame([
        {"variant": name, "fitted_to": to, "shear_modulus_mpa": shear, "young_mpa": young_over_shear * shear,
         "c10_mpa": 0.5 * shear, "depth_mm": depth, "force_n": force, **_predicted(path, shear, depth, force),
         "fitted": (depth, force) in points and to in ("all", f"{depth:g} mm")}
        for to, shear in fits.items() for depth, force in [*points, *checks]])


def _predicted(path, shear, depth, force):
    """Depth at a measured force and force at a measured depth, with their relative errors; no depth beyond the path."""
    near = float(path.depth_at(force / shear)) if _on_path(path, force / shear) else np.nan
    load = float(path.at(depth)) * shear
    return {"predicted_depth_mm": near, "depth_error": near / depth - 1, "predicted_force_n": load, "force_error": load / force - 1}


def _on_path(path, force_over_shear):
    """Whether the path of depths was computed as far as a force."""
    return force_over_shear <= path.force_over_shear[-1] * (1 + _ROUNDING)


def _one_modulus(path, points):
    """The shear modulus whose largest relative error of the depth is least, among those with all points on the path."""
    each = [force / float(path.at(depth)) for depth, force in points]
    low, high = min(each), max(each)
    if high - low < 1e-9 * high:
        return low

    def worst(shear):
        if not all(_on_path(path, force / shear) for _, force in points):
            return np.inf
        return max(abs(float(path.depth_at(force / shear)) / depth - 1) for depth, force in points)

    tried = np.linspace(high, low, 400)     # from the stiffest, which has all points on the path
    return float(tried[np.argmin([worst(one) for one in tried])])
