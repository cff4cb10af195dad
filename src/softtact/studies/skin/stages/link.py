"""A skin's taxels in space: modules placed on a robot's link, and files for other programs."""

from typing import Any

import numpy as np
import pandas as pd
import xarray

from softtact.files import read_dataset, write_csv, write_dataset, write_json
from softtact.geometry.meshes import read_mesh
from softtact.skin.design import Link
from softtact.skin.link import lay_modules as lay
from softtact.skin.link import write_exports as export
from softtact.studies.skin.settings import design_of


def lay_modules(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Place modules on a link.

    inputs: mesh;  outputs: modules, seams (CSV), laid (NetCDF), facts (JSON);  settings: module, link, density_g_cm3
    """
    link = Link.model_validate(settings["link"] | {"mesh": str(inputs["mesh"])})
    module = design_of(settings).module
    laid = lay(read_mesh(inputs["mesh"], unit=link.unit), module.layout(), start_mm=None if link.start_mm is None else
               np.array(link.start_mm), direction=np.array(link.direction), rings=link.rings, least_radius_mm=link.least_radius_mm)
    weight = 1e-3 * settings["density_g_cm3"] * module.layout().area_mm2 * module.thickness_mm
    write_csv(outputs["modules"], laid.modules.assign(weight_g=weight))
    write_csv(outputs["seams"], laid.seams)
    data = xarray.Dataset({"position_mm": (("taxel", "axis"), laid.positions_mm), "normal": (("taxel", "axis"), laid.normals),
                           "corner_mm": (("module", "corner", "axis"), laid.corners_mm), "fits": ("module", laid.fits)},
                          coords={"axis": ["x", "y", "z"]})
    write_dataset(outputs["laid"], data, seed=None, settings=settings)
    gaps = laid.seams.gap_mm if len(laid.seams) else pd.Series([0.0])
    write_json(outputs["facts"], {"taxels": len(laid.positions_mm), "link": {
        "modules": int(laid.fits.sum()), "bent_too_much": int((~laid.fits).sum()), "without_place": laid.left_out,
        "least_bend_radius_mm": float(laid.modules.bend_radius_mm.min()), "widest_gap_mm": float(gaps.max()),
        "widest_overlap_mm": float(-gaps.min()), "elastomer_g": float(weight * laid.fits.sum())}})


def write_exports(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the taxels for other programs.

    inputs: laid (NetCDF), if modules are placed on a link;  outputs: txt, urdf, xml with the same name in one folder
    settings: module, patch
    """
    layout = design_of(settings).layout()
    if "laid" in inputs:
        laid = read_dataset(inputs["laid"])
        positions, normals = laid.position_mm.values, laid.normal.values
    else:
        count = len(layout.centres_mm)
        positions, normals = np.column_stack([layout.centres_mm, np.zeros(count)]), np.tile([0.0, 0.0, 1.0], (count, 1))
    export(outputs["txt"].parent, outputs["txt"].stem, positions, normals, radius_mm=layout.radius_mm)
