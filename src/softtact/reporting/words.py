"""Headings of columns and names of predictors and sets in reports, in place of the names in files."""

import math
import re
from typing import Any

import numpy as np
import pandas as pd

from softtact.evaluation.score_tables import ALL_FORCES

_NAME = re.compile(r"\w+")

PREDICTORS = {"printed": "printed network", "searched": "searched network", "compact": "compact network", "zeros": "zeros",
              "mean_reading": "mean training reading at that force", "nearest_map": "reading of the nearest training map",
              "ridge": "ridge on the taxels' mean deformations", "quadratic": "quadratic of a taxel's mean deformation",
              "gap_formula": "gap formula, untrained", "moved": "mark: the truth moved by one taxel",
              "halved": "mark: the truth halved",
              "sensor_repeated": "the sensor against its other trials"}
KINDS = {"network": "network", "trivial": "trivial predictor", "simple": "simple predictor", "mark": "mark", "sensor": "ceiling"}
SETS = {"validation": "validation", "unseen": "unseen indenters", "grasps": "grasped objects", "indenters": "indenters"}
HEADERS = {
    "model": "model", "set": "set", "force": "force, N", "force_n": "force, N", "predictor": "what reads", "kind": "kind",
    "items": "presses",
    "maps": "maps", "ssim": "SSIM", "ssim_own_range": "SSIM, range of each map's maximum", "mae_counts": "mean error, counts",
    "mae_share": "mean error over the mean reading", "overlap": "overlap of the contact patches",
    "skill": "skill over the best trivial predictor", "skill_simple": "skill over the best simple predictor",
    "sensor_ssim": "SSIM, sensor against itself", "architecture": "network", "weights": "weights", "epochs": "epochs",
    "epoch_s": "an epoch, s", "map_s": "one map alone, s", "mean_reading_ssim": "SSIM of the mean reading at that force",
    "quadratic_ssim": "SSIM of the quadratic", "gap_formula_ssim": "SSIM of the gap formula", "learning_rate": "learning rate",
    "best_epoch": "best epoch", "train_loss": "training loss there, counts",
    "validation_loss": "validation loss there, counts",
    "unseen_loss": "loss on unseen indenters, counts", "late_fall": "fall of the loss in the last quarter",
    "remains": "what remains of the loss", "gain": "counts at dC/C0 = 1",
    "mesh_error": "mesh of the model and root mean square error of its maps, in their largest value",
    "percentile_counts": "99th percentile of the readings, counts", "peak_counts": "median of the maps' peaks, counts",
    "full_share": "share of taxels at the end of the range", "mean_counts": "mean reading, counts", "material": "material",
    "law": "law",
    "chosen": "chosen", "parameters": "parameters", "rmse_mpa": "RMSE, MPa", "relative_error": "relative error",
    "mu0_mpa": "initial shear modulus, MPa", "bulk_modulus_mpa": "bulk modulus, MPa", "stable_over_data": "stable over the data",
    "stable_uniaxial": "stable stretches, uniaxial", "stable_biaxial": "stable stretches, biaxial",
    "stable_planar": "stable stretches, planar", "not_identifiable": "what the data leave open",
    "printed_parameters": "printed parameters", "printed_rmse": "printed RMSE", "data": "curves", "contradiction": "contradiction",
    "object": "object", "source": "whose", "model_in_paper": "model in the paper", "mean_s": "mean, s", "min_s": "shortest, s",
    "max_s": "longest, s", "sd_s": "standard deviation, s", "machine": "machine", "policy": "policy", "presses": "presses",
    "share_elastic": "share elastic", "share_foundation": "share foundation", "share_hyperelastic": "share hyperelastic",
    "mean_error_mm": "mean distance from the hyperelastic map, mm", "largest_error_mm": "largest distance, mm",
    "mean_error_counts": "mean distance from the hyperelastic reading, counts of all taxels",
    "largest_error_counts": "largest distance, counts",
    "time_per_press_s": "time of a press, s",
    "time_in_all_s": "time in all, s", "over_tolerance": "share above the tolerance", "paper": "paper",
    "perfect_model_gain": "gain by a perfect model", "more_maps_gain": "gain by more maps",
    "other_network_gain": "gain by another network",
    "limit": "limit", "sentence": "in words", "stage": "stage", "jobs": "jobs", "total_s": "in all, s", "longest_s": "longest, s",
    "largest_memory_mb": "largest memory, MB", "claim": "claim", "where": "where", "ours": "ours", "uncertainty": "uncertainty",
    "verdict": "verdict", "seeds": "seeds", "ssim_sd": "SSIM, standard deviation",
    "ssim_least": "SSIM, least", "ssim_most": "SSIM, most", "mae_sd": "standard deviation of the mean error, counts",
    "rule": "rule", "evidence": "evidence", "weight_g_module": "weight of a module, g", "weight_g_cm2": "weight, g/cm2",
    "weight_g": "weight, g", "sensitivity_per_kpa": "sensitivity, 1/kPa", "delta_ff": "rise, fF", "t_min_mm": "t_min, mm"}
# Of the other studies.
HEADERS |= {
    "scenario": "loaded by", "line_n_mm": "slope of the trend line, N/mm", "intercept_n": "trend line at zero deflection, N",
    "initial_n_mm": "slope at rest, N/mm", "final_n_mm": "slope at the end, N/mm",
    "secant_least_n_mm": "least force over deflection, N/mm", "secant_largest_n_mm": "largest force over deflection, N/mm",
    "beam_deflection_mm": "deflection of the beam, mm", "tissue_height_mm": "height of the tissue, mm",
    "jaw_mm": "travel of the jaw, mm", "relative_hardness_n_mm": "relative hardness F/d, N/mm",
    "apparent_modulus_mpa": "apparent modulus, MPa", "variant": "assumption", "thickness_mm": "thickness, mm",
    "at_rest_ff": "capacitance at rest, fF", "counts_at_smallest_force": "counts at the smallest force",
    "delta_ff_at_highest": "rise at the highest pressure, fF", "force_met": "feels the smallest force",
    "strain_met": "strain is below its limit", "range_met": "stays in the converter's range",
    "within_test": "within the material's test", "in_budget": "within the weight", "meets_all": "meets all needs",
    "counts_of_worst": "counts of the worst batch", "strain_of_worst": "strain of the worst batch",
    "meets_all_at_worst": "worst batch meets all needs", "stress_kpa": "pressure, kPa", "young_mpa": "Young's modulus, MPa",
    "on_front": "Pareto optimal", "pitch_mm": "pitch, mm", "own_ff_per_n": "rise of the pressed taxel, fF/N",
    "neighbour_ff_per_n": "rise of its neighbour, fF/N", "crosstalk": "neighbour's rise over the pressed taxel's",
    "localisation_mm": "error of the place, mm", "taxels_per_cm2": "taxels in a cm2", "nominal": "as measured",
    "strain_scatter": "strains scatter", "batch": "batches differ", "ageing": "age", "all": "all together", "what": "what presses",
    "deepest_mm": "largest displacement, mm", "taxel": "taxel that feels most", "taxels_above_noise": "taxels above noise",
    "factor": "what is varied", "not_dominated": "Pareto optimal", "radius_mm": "radius of a taxel, mm", "truth": "truth",
    "readout": "what reads", "score": "score", "mean": "mean difference", "low": "lower end, 95 %", "high": "upper end, 95 %",
    "bound": "to be above", "p_above": "p that it is not above", "p_below": "p that it is not below",
    "p_holm": "p not above, shared by Holm", "p_holm_below": "p not below, shared by Holm", "power": "power",
    "error_share": "error over the mean reading", "ssim_paper": "SSIM, converter's range, smallest window",
    "ssim_paper_whole": "SSIM, converter's range, largest window", "x_mm": "x, mm", "y_mm": "y, mm", "angle_deg": "angle, degrees",
    "status": "state", "message": "what went wrong", "trials": "trials",
    "force_left_n": "force left, N", "force_right_n": "force right, N", "model_grip_left": "model left",
    "model_grip_right": "model right",
    "deepest_left_mm": "deepest left, mm", "deepest_right_mm": "deepest right, mm", "counts_left": "sum of counts left",
    "counts_right": "sum of counts right", "at_range_end_left": "taxels at the range's end, left",
    "at_range_end_right": "taxels at the range's end, right", "trial_sd_left_counts": "scatter of trials left, counts",
    "trial_sd_right_counts": "scatter of trials right, counts", "fitted_to": "modulus fitted to",
    "shear_modulus_mpa": "shear modulus, MPa", "c10_mpa": "C10, MPa", "depth_mm": "depth, mm",
    "predicted_depth_mm": "predicted depth, mm", "depth_error": "error of the depth, share",
    "predicted_force_n": "predicted force, N", "force_error": "error of the force, share", "fitted": "fitted",
    "components": "error of a component, px", "vectors": "error of a vector, px", "rounded": "error of a component in whole px",
    "circles": "circles are", "mae": "mean error, grey levels", "mse": "mean squared error", "psnr_db": "PSNR, dB",
    "normal_deg": "error of normals, degrees", "normal_median_deg": "median error of normals, degrees",
    "ball_px": "assumed radius, px", "ball_mm": "assumed radius, mm", "best_px": "best radius, px",
    "best_low_px": "lower end of its interval, px", "best_high_px": "upper end of its interval, px",
    "state": "object is", "change_px": "change of the summed motion, px", "markers_lost": "markers lost",
    "threshold_px": "threshold, px", "right": "told rightly"}
_UNITS = {"n_mm": "N/mm", "ff_per_n": "fF/N", "n": "N", "s": "s", "mm": "mm", "mpa": "MPa", "kpa": "kPa", "ff": "fF", "px": "px",
          "deg": "degrees", "db": "dB", "g": "g", "percent": "%"}
_EXACT = 1e-4, 1e7      # between them a number has no power of ten


def header(column: str) -> str:
    """A column's heading; an unlisted name, such as a law or a force, gets its unit and spaces for underscores."""
    if column in HEADERS:
        return HEADERS[column]
    for start, words in (("mae_share_", "mean error over the mean reading, "), ("ssim_", "SSIM, "), ("mae_counts_",
                                                                                                     "mean error in counts, ")):
        if column.startswith(start):
            return words + _plain(column.removeprefix(start))
    return _plain(column)


def _plain(name):
    for unit, words in _UNITS.items():
        if name.endswith(f"_{unit}"):
            return f"{name.removesuffix(f'_{unit}').replace('_', ' ')}, {words}"
    return name.replace("_", " ")


def in_words(value: Any) -> str:
    """A value of a table: a number in four digits, yes or no, nothing for a missing one, a name without underscores."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float):     # NumPy's doubles are floats, too
        if math.isnan(value):
            return ""
        if value == 0 or _EXACT[0] <= abs(value) < _EXACT[1]:
            return np.format_float_positional(value, precision=4, fractional=False, trim="-")
        return f"{value:.2e}"
    text = "" if value is None or value is pd.NA else str(value)
    return text.replace("_", " ") if _NAME.fullmatch(text) else text


def force_in_words(force: str) -> str:
    """A force of a `score_table` in words."""
    return "all forces" if force == ALL_FORCES else f"{force} N"
