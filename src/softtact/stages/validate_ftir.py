"""Contact area per frustum against force: the model's, the image's, and the measured one.

inputs: state, virtual, discs (list), measured (CSV force_n, area_mm2 of the mean frustum; without it the virtual dielectric
    stands in)
outputs: area (CSV), summary (JSON)
"""

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.files import read_dataset, write_csv, write_json

PAPER_RMSE_MM2 = 0.008   # section 4.1


def run(*, inputs, outputs, settings, threads=1):
    """Join the three curves and report their differences."""
    state, virtual = read_dataset(inputs["state"]), read_dataset(inputs["virtual"])
    forces, model = state.force_n.values, state.area_per_frustum_mm2.values
    discs = pd.concat([pd.read_csv(path) for path in inputs["discs"]])
    count = virtual.sizes["frustum"]
    image = discs.groupby("force_n").area_mm2.sum().reindex(forces, fill_value=0.0).to_numpy() / count
    measured, source = _measured(inputs.get("measured"), forces, virtual)
    table = pd.DataFrame({"force_n": forces, "area_per_frustum_mm2": model, "area_image_mm2": image,
                          "area_measured_mm2": measured})
    write_csv(outputs["area"], table)
    rmse = _rmse(model, measured)
    write_json(outputs["summary"], {
        "rmse_mm2_per_frustum": rmse, "rmse_mm2_total": rmse * count, "paper_rmse_mm2": PAPER_RMSE_MM2,
        "rmse_image_mm2_per_frustum": _rmse(image, virtual.area_per_frustum_mm2.values), "frusta": count,
        "discs_found": {f"{force:g}": int(n) for force, n in discs.groupby("force_n").size().items()}, "source": source})


def _measured(path, forces, virtual):
    """The measured area at the forces, and what it comes from."""
    if path is None:
        return virtual.area_per_frustum_mm2.values, "virtual dielectric (no measured curve was given)"
    try:
        curve = pd.read_csv(path, usecols=["force_n", "area_mm2"], dtype=float).sort_values("force_n")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; correct 'ftir.measured'.") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}; the file needs the columns force_n and area_mm2 in numbers.") from None
    low, high = curve.force_n.min(), curve.force_n.max()
    outside = [force for force in forces if not low <= force <= high]
    if outside:
        raise InputError(f"{path}: measured from {low:g} to {high:g} N, but 'ftir.forces_n' asks for {outside[0]:g} N; "
                         "leave that force out.")
    return np.interp(forces, curve.force_n, curve.area_mm2), f"measured: {path}"


def _rmse(a, b):
    return float(np.sqrt(np.mean((np.asarray(a) - b) ** 2)))
