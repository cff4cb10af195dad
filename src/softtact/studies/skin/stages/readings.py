"""A skin under loads: deformation, capacitances, counts; and its readings for a finger at any place.

All stages have the settings of a skin: module, patch, mesh, elastomer.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from softtact.files import read_dataset, write_csv, write_dataset, write_json
from softtact.geometry.meshes import read_mesh
from softtact.skin.analysis import Converter, Readings, Skin, alone, analyse, probe_curves
from softtact.skin.design import LoadChoice
from softtact.skin.elastomers import Elastomer
from softtact.skin.loads import Load
from softtact.skin.maps import TaxelLayer, crosstalk, patch_maps
from softtact.studies.skin.settings import converter_of, design_of, elastomer_of, skin_of

_KEPT = ("pressure_mpa", "words", "indentation_mm", "beyond_tests")     # of a load at finite strains, beside its arrays


def press_object(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Press an object at finite strains.  inputs: mesh;  outputs: load (NetCDF);  settings: of the skin, and load."""
    from softtact.skin.contact import press_at_finite_strains

    skin, choice = skin_of(settings, threads), LoadChoice.model_validate(settings["load"])
    load = press_at_finite_strains(skin, read_mesh(inputs["mesh"], unit=choice.unit), choice.centre(skin.layout, "the design"),
                                   elastomer=elastomer_of(settings), friction=choice.friction,
                                   **_pressed_by(choice))
    data = xarray.Dataset({"point_mm": (("point", "plane"), load.points_mm), "force_n": ("point", load.force_n),
                           "displacement_mm": (("node", "axis"), load.displacement_mm)},
                          attrs={name: getattr(load, name) for name in _KEPT})
    write_dataset(outputs["load"], data, seed=None, settings=settings)


def read_taxels(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read all taxels under each load.

    inputs: files (list: meshes and masks of loads at small strains), pressed (list: loads at finite strains), by load
    outputs: readings (NetCDF), table (CSV), facts (JSON);  settings: of the skin, and loads, converter
    """
    skin, elastomer, converter = skin_of(settings, threads), elastomer_of(settings), converter_of(settings)
    files, pressed = iter(inputs.get("files", [])), iter(inputs.get("pressed", []))
    loads = {}
    for values in settings["loads"]:
        choice = LoadChoice.model_validate(values)
        loads[choice.name] = (_kept_load(next(pressed)) if choice.strains == "finite" else
                              _load(choice, skin, elastomer, next(files) if choice.mesh or choice.mask else None))
    readings = analyse(skin, list(loads.values()), elastomer=elastomer, converter=converter)
    table = _load_table(loads, readings, converter)
    write_dataset(outputs["readings"], _dataset(skin, loads, readings, elastomer), seed=None, settings=settings)
    write_csv(outputs["table"], table)
    write_json(outputs["facts"], {"taxels": len(skin.layout.centres_mm), "remarks": readings.remarks,
                                  "loads": table.astype(object).where(table.notna(), None).to_dict("records")})


def compute_probes(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Curves under probes, on a module with one taxel.  outputs: table (CSV);  settings: of the skin, and probes."""
    probes = settings["probes"]
    taxel = probes.pop("at_taxel") - 1
    skin = skin_of(settings, threads, layout=alone(design_of(settings).layout(), taxel))
    write_csv(outputs["table"], probe_curves(skin, elastomer_of(settings), **probes))


def map_patch(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Map the readings for a finger, and compute crosstalk against pitch.

    outputs: detection, crosstalk (CSV), facts (JSON)
    settings: of the skin, and maps, converter, needs {detected_counts, smallest_force_n}
    """
    elastomer, converter, module = elastomer_of(settings), converter_of(settings), design_of(settings).module
    maps, needs = settings["maps"], settings["needs"]
    pressure = 1e-3 * maps["pressure_kpa"]
    young = elastomer.tested_young_mpa(pressure)
    found = patch_maps(skin_of(settings, threads), finger_mm2=maps["finger_mm2"], pressure_mpa=pressure, young_mpa=young,
                       converter=converter, detected_counts=needs["detected_counts"], spacing_mm=maps["spacing_mm"])
    layer = TaxelLayer(module.radius_mm, module.guard_radius_mm, module.thickness_mm, elastomer.poisson, elastomer.permittivity_fe,
                       young)
    write_csv(outputs["detection"], found.table())
    write_csv(outputs["crosstalk"], crosstalk(maps["pitches_mm"], layer, probe_mm=maps["crosstalk_probe_mm"], converter=converter,
                                              pressure_mpa=pressure))
    least, wanted = found.smallest_force_n, needs["smallest_force_n"]
    write_json(outputs["facts"], {"maps": {"least_force_n": float(least.min()), "worst_force_n": float(least.max()),
                                           "asked_n": wanted, "share_not_felt": float((least > wanted).mean())}})


def _pressed_by(choice):
    """Force and place of an object, for small and finite strains alike."""
    return {"force_n": choice.force_n, "turned_deg": choice.turned_deg, "name": choice.name}


def _load(choice, skin, elastomer, file):
    """A load at small strains, with its mesh or mask."""
    if choice.mesh is None:
        named = choice if file is None else choice.model_copy(update={"mask": str(file)})
        return named.pressure(skin.layout, folder=Path(), where="the design")
    from softtact.skin.contact import contact_load

    return contact_load(skin, read_mesh(file, unit=choice.unit), choice.centre(skin.layout, "the design"), elastomer=elastomer,
                        **_pressed_by(choice))


def _kept_load(path):
    """Read a load of `press_object`."""
    data = read_dataset(path)
    return Load(data.point_mm.values, data.force_n.values, displacement_mm=data.displacement_mm.values,
                **{name: data.attrs[name] for name in _KEPT})


def _load_table(loads: Mapping[str, Load], readings: Readings, converter: Converter) -> pd.DataFrame:
    """A row for each load: its description, deformation and counts."""
    rows = []
    for number, (name, load) in enumerate(loads.items()):
        delta, counts = readings.delta_ff[number], readings.counts[number]
        rows.append({"load": name, "what": load.words, "force_n": load.total_n, "young_mpa": float(readings.young_mpa[number]),
                     "deepest_mm": float(-readings.displacement_mm[number, :, 2].min()), "taxel": int(delta.argmax()) + 1,
                     "delta_ff": float(delta.max()), "counts": int(counts.max()),
                     "taxels_above_noise": int((counts > 3 * converter.noise_counts).sum())})
    return pd.DataFrame(rows)


def _dataset(skin: Skin, loads: Mapping[str, Load], readings: Readings, elastomer: Elastomer) -> xarray.Dataset:
    """All readings as a labelled data set."""
    top = skin.layer.mesh.nodes_mm[skin.layer.mesh.top, :2]
    per_taxel = {"capacitance_ff": ("fF", "of the deformed skin"), "delta_ff": ("fF", "above rest"), "counts": ("1", "above rest")}
    values: dict[str, Any] = {
        **{name: (("load", "taxel"), getattr(readings, name), {"units": units, "long_name": text})
           for name, (units, text) in per_taxel.items()},
        "at_rest_ff": ("taxel", readings.at_rest_ff, {"units": "fF"}),
        "young_mpa": ("load", readings.young_mpa, {"units": "MPa"}),
        "displacement_mm": (("load", "node", "axis"), readings.displacement_mm, {"units": "mm", "long_name": "of the upper side"}),
        "node_mm": (("node", "plane"), top, {"units": "mm"}),
        "taxel_mm": (("taxel", "plane"), skin.layout.centres_mm, {"units": "mm"}),
        "module": ("taxel", skin.layout.module),
    }
    names = {"load": list(loads), "taxel": np.arange(1, len(skin.layout.centres_mm) + 1), "axis": ["x", "y", "z"],
             "plane": ["x", "y"]}
    return xarray.Dataset(values, coords=names, attrs={"elastomer": elastomer.name, "thickness_mm": skin.thickness_mm})
