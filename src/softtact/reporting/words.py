"""Headings of columns and names of predictors and sets in reports, in place of the names in files."""

from softtact.evaluation.score_tables import ALL_FORCES

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
    for unit, words in (("_n", " N"), ("_s", ", s"), ("_mm", ", mm"), ("_mpa", ", MPa"), ("_kpa", ", kPa"), ("_ff", ", fF")):
        if name.endswith(unit):
            return name.removesuffix(unit).replace("_", " ") + words
    return name.replace("_", " ")


def force_in_words(force: str) -> str:
    """A force of a `score_table` in words."""
    return "all forces" if force == ALL_FORCES else f"{force} N"
