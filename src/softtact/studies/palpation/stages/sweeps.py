"""Sweeps of the jaw, and their tables.

Setting `design`: the values of a `PalpationDesign` that the stage uses.
"""

from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softtact.files import atomic_path, read_csv, read_dataset, write_csv, write_dataset, write_json
from softtact.probe.design import PalpationDesign
from softtact.probe.structure import structure_mesh
from softtact.probe.sweep import Palpation, hardness_table, palpate, slope, verdict
from softtact.progress import Watch

MEASURES = ("relative_hardness_n_mm", "apparent_modulus_mpa")


def sweep(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Sweep the jaw over one tissue.

    outputs: sweep (NetCDF);  settings: design, scenario, steps: ends of the steps in mm or N
    """
    design = PalpationDesign.model_validate(settings["design"])
    (tissue,) = design.tissues
    with _watch(f"{tissue}, {settings['scenario']}") as report:
        found = palpate(design, tissue, settings["scenario"], values=np.array(settings["steps"]), threads=threads, report=report)
    write_dataset(outputs["sweep"], found.dataset(), seed=None, settings=settings)


def measure_hardness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Measure the hardness of one tissue of one height over load.  outputs: rows (CSV);  settings: design with `hardness`."""
    design = PalpationDesign.model_validate(settings["design"])
    assert design.hardness is not None
    with _watch("hardness") as report:
        table = hardness_table(design, design.hardness, threads=threads, report=report)
    write_csv(outputs["rows"], table, float_format="%.17g")


def tabulate(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Tabulate all sweeps, and judge the paper's claims.

    inputs: sweeps (list), coarse (list: those of the displacement on a coarser mesh), hardness (list), variants (list)
    outputs: curves, slopes, claims, hardness, variants (CSV), facts (JSON);  settings: variants [{variant, tissue}, ...]
    """
    from softtact.studies.palpation.claims import claims_of_probe

    sweeps = [_sweep(path) for path in inputs["sweeps"]]
    curves, slopes = pd.concat([one.table() for one in sweeps]), pd.DataFrame(map(_slope_row, sweeps))
    moved, coarse = (pd.DataFrame(map(_slope_row, kept)) for kept in (
        [one for one in sweeps if one.scenario == "displacement"], map(_sweep, inputs["coarse"])))
    mesh_error = float((coarse.line_n_mm / moved.line_n_mm - 1).abs().max())
    hardness = pd.concat([read_csv(path, float_precision="round_trip") for path in inputs.get("hardness", [])]
                         or [pd.DataFrame()], ignore_index=True)
    claims = claims_of_probe(curves, slopes, hardness if len(hardness) else None, mesh_error=mesh_error)
    variants = [one | _slope_row(_sweep(path)) for one, path in zip(settings["variants"], inputs.get("variants", []), strict=True)]
    tables = {"curves": curves, "slopes": slopes, "claims": claims, "hardness": hardness,
              "variants": pd.DataFrame(variants, columns=["variant", "tissue", "line_n_mm", "initial_n_mm", "force_n"])}
    for name in set(tables) & set(outputs):
        write_csv(outputs[name], tables[name])
    verdicts = {column: asdict(verdict(hardness, column)) for column in MEASURES} if len(hardness) else {}
    beyond = max(float(one.extrapolated_volume_fraction.max()) for one in sweeps)
    write_json(outputs["facts"], {
        "slopes": slopes.to_dict("records"), "mesh_error": mesh_error, "hardness": verdicts,
        "extrapolated_volume_fraction": None if beyond != beyond else beyond,
        "claims": claims[["claim", "ours", "verdict"]].to_dict("records")})


def write_fields(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The last step as VTU: elements by their corners, displacement in mm, and the region's number.

    inputs: sweep (NetCDF);  outputs: fields (VTU);  settings: design
    """
    import meshio

    mesh, found = structure_mesh(PalpationDesign.model_validate(settings["design"])), _sweep(inputs["sweep"])
    cells, regions = [], []
    for region, element, nodes in mesh.parts():
        corners = 4 if element.nodes.shape[1] == 2 else 8
        cells.append(("quad" if corners == 4 else "hexahedron", nodes[:, :corners]))
        regions.append(np.full(len(nodes), mesh.regions.index(region), dtype=np.int32))
    with atomic_path(outputs["fields"]) as temporary:
        meshio.Mesh(mesh.points, cells, point_data={"displacement_mm": found.displacement_mm},
                    cell_data={"region": regions}).write(temporary, file_format="vtu")


def _sweep(path: Path) -> Palpation:
    return Palpation.of(read_dataset(path))


def _slope_row(found: Palpation) -> dict[str, Any]:
    """A row of the table of slopes."""
    row = asdict(slope(found.force_n, found.beam_deflection_mm))
    least, largest = row.pop("secant_n_mm")
    return {"tissue": found.tissue, "scenario": found.scenario} | row | {
        "secant_least_n_mm": least, "secant_largest_n_mm": largest, "force_n": float(found.force_n[-1]),
        "beam_deflection_mm": float(found.beam_deflection_mm[-1])}


@contextmanager
def _watch(label):
    """A function that reports progress, with a final line end after the block."""
    watch = Watch(label)
    try:
        yield watch.report
    finally:
        watch.end()
