"""Contact area per frustum against force of model, image and measurement, and the orientations compatible with the paper.

inputs: state, virtual, discs (list), measured (CSV force_n, area_mm2 of the mean frustum; by default the virtual dielectric is
    used)
outputs: area (CSV), orientations (CSV, long: each orientation and law), summary (JSON);  settings: pixel_mm of the camera
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.evaluation.curve_shape import PAPER_RMSE_MM2, judge, summary_sentence
from softtact.files import read_csv, read_dataset, write_csv, write_json
from softtact.tables import read_table

if TYPE_CHECKING:
    import xarray


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Join the three curves, compute their differences, and judge the orientations by the paper's statements."""
    state, virtual = read_dataset(inputs["state"]), read_dataset(inputs["virtual"])
    count = virtual.sizes["frustum"]
    orientations = long_table(state, count)
    write_csv(outputs["orientations"], orientations)
    table, found, source = _curves(inputs, state, virtual, count)
    write_csv(outputs["area"], table)
    judged = judge(orientations, pitch_mm=state.attrs["pitch_mm"], pixel_mm=settings["pixel_mm"])
    write_json(outputs["summary"], _errors(table, virtual, count) | {
        "discs_found": found, "source": source, "frusta": count, "verdict": summary_sentence(judged), "orientations": judged,
        "under_test": {"orientation": state.attrs["orientation_under_test"], "law": state.attrs["law_under_test"]}})


def long_table(state: "xarray.Dataset", count: int) -> pd.DataFrame:
    """The curve of every orientation and law, one row per force."""
    names = ["area_per_frustum_mm2", "compression_mm", "disc_gap_mm"]
    table = state[[*names, "force_n"]].to_dataframe().reset_index()
    table["area_total_mm2"] = count * table.area_per_frustum_mm2
    return table[["orientation", "law", "force_n", "area_per_frustum_mm2", "area_total_mm2", "compression_mm", "disc_gap_mm"]]


def _curves(inputs, state, virtual, count):
    """Table of the model under test, the image and the measurement; discs by force; source of the measurement."""
    forces = state.force_n.values
    model = state.area_per_frustum_mm2.sel(orientation=state.attrs["orientation_under_test"],
                                           law=state.attrs["law_under_test"]).values
    discs = pd.concat([read_csv(path) for path in inputs["discs"]])
    image = discs.groupby("force_n").area_mm2.sum().reindex(forces, fill_value=0.0).to_numpy() / count
    measured, source = _measured(inputs.get("measured"), forces, virtual)
    table = pd.DataFrame({"force_n": forces, "area_per_frustum_mm2": model, "area_image_mm2": image, "area_measured_mm2": measured,
                          "area_total_mm2": count * model, "area_image_total_mm2": count * image,
                          "area_measured_total_mm2": count * measured})
    return table, {f"{force:g}": int(n) for force, n in discs.groupby("force_n").size().items()}, source


def _errors(table, virtual, count):
    """Root mean square differences over the forces, per frustum and of the whole dielectric."""
    rmse = _rmse(table.area_per_frustum_mm2, table.area_measured_mm2)
    return {"rmse_mm2_per_frustum": rmse, "rmse_mm2_total": rmse * count, "paper_rmse_mm2": PAPER_RMSE_MM2,
            "rmse_image_mm2_per_frustum": _rmse(table.area_image_mm2, virtual.area_per_frustum_mm2.values)}


def _measured(path, forces, virtual):
    """The measured area at the forces, and its source."""
    if path is None:
        return virtual.area_per_frustum_mm2.values, "virtual dielectric (no measured curve was given)"
    force_n, area_mm2 = _measured_curve(path)
    low, high = force_n[0], force_n[-1]
    outside = [force for force in forces if not low <= force <= high]
    if outside:
        raise InputError(f"{path}: measured from {low:g} to {high:g} N, but 'ftir.forces_n' asks for {outside[0]:g} N; "
                         "leave that force out.")
    return np.interp(forces, force_n, area_mm2), f"measured: {path}"


def _measured_curve(path):
    """Forces (n,) in N, rising, and areas (n,) in mm2 of the file 'ftir.measured'."""
    table = read_table(path, what="curve for 'ftir.measured'")
    try:
        force_n, area_mm2 = np.array(table.numbers(["force_n", "area_mm2"]))
    except InputError as error:
        raise InputError(f"{str(error).removesuffix('.')}; the file needs the columns force_n and area_mm2 in numbers.") from None
    rows = [row for row, _ in table.rows]
    if len(rows) < 2:
        raise InputError(f"{path}: {len(rows)} point(s) make no curve; give at least two.")
    if force_n[0] > force_n[-1]:
        force_n, area_mm2, rows = force_n[::-1], area_mm2[::-1], rows[::-1]
    for name, values, bad, remedy in (
            ("force_n", force_n[1:], np.diff(force_n) <= 0, "goes back to {}; keep one loading branch, in order of the force"),
            ("force_n", force_n, force_n < 0, "is {}; a force that presses is positive, correct the column"),
            ("area_mm2", area_mm2, area_mm2 < 0, "is {}; an area is no less than 0, correct it")):
        if bad.any():
            row = rows[int(np.argmax(bad)) + len(rows) - len(values)]
            raise InputError(f"{path}, row {row}: {name} {remedy.format(f'{values[bad][0]:g}')}.")
    return force_n, area_mm2


def _rmse(a, b):
    return float(np.sqrt(np.mean((np.asarray(a) - b) ** 2)))
