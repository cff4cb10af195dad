"""A skin's design, computed: tables, labelled arrays, figures, exports and the report in one folder."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from softtact.files import write_csv, write_dataset
from softtact.geometry.meshes import read_mesh
from softtact.progress import announce
from softtact.skin.analysis import Readings, Skin, alone, analyse, probe_curves
from softtact.skin.choice import (
    SearchSpace,
    front_confidence,
    main_effects,
    printed_criteria,
    search,
    thickness_table,
    thinnest,
    with_scatter,
)
from softtact.skin.contact import contact_load, press_at_finite_strains
from softtact.skin.design import Choice, LoadChoice, PreparedDesign, SkinDesign, bears, needs_of, prepare, reaches
from softtact.skin.layout import Layout
from softtact.skin.link import lay_modules, write_exports
from softtact.skin.loads import Load
from softtact.skin.maps import TaxelLayer, crosstalk, patch_maps
from softtact.studies.skin import figures
from softtact.studies.skin.claims import claims_of_skin
from softtact.studies.skin.report import DRAWN_FROM, write_page


def run_design(path: Path, design: SkinDesign, out: Path, *, threads: int = 1) -> dict[str, Any]:
    """Compute all sections of a design into the folder `out`; return what a command tells of it."""
    study = prepare(design, path)
    (out / "tables").mkdir(parents=True, exist_ok=True)
    (out / "figures").mkdir(exist_ok=True)
    announce(f"{design.skin}: deformation and field of {len(study.layout.centres_mm)} taxels")
    skin = _skin(study, study.layout, threads)
    readings = _readings(study, skin, path.parent)
    _write_readings(study, skin, readings, out)
    tables: dict[str, pd.DataFrame] = {"loads": _load_table(study, readings)}
    said: dict[str, Any] = {"remarks": readings.remarks}
    _compute_sections(study, skin, tables, said, out, threads)
    if design.link:
        positions, normals, said["link"] = _lay(study, tables, out, path.parent)
    else:
        positions, normals = _flat(study.layout)
    write_exports(out / "exports", "skin", positions, normals, radius_mm=study.layout.radius_mm)
    if design.claims:
        announce(f"{design.skin}: the papers' claims and the meshes' convergence")
        tables["claims"], tables["convergence"] = claims_of_skin(study.elastomers, threads=threads)
    for name, table in tables.items():
        write_csv(out / f"tables/{name}.csv", table)
    drawn = [f"load_{number + 1}" for number in range(len(study.loads))]
    drawn += [name for name, table in DRAWN_FROM.items() if table in tables]
    write_page(out, design, tables, said, figures=drawn)
    return {
        "skin": design.skin,
        "out": str(out),
        "report": str(out / "report.html"),
        "taxels": len(positions),
        "loads": tables["loads"].to_dict("records"),
        **said,
    }


def _compute_sections(study, skin, tables, said, out, threads):
    """Add what a design asks for of probes, choice, maps and search to the tables, and to what is said of it."""
    design = study.design
    if design.probes:
        announce(f"{design.skin}: probes")
        tables["probes"] = _probe(study, threads)
        figures.draw_probes(out / "figures/probes.png", tables["probes"])
    if design.choice:
        announce(f"{design.skin}: choice of the elastomer and its thickness")
        said |= _choose(study, design.choice, tables, out)
        if said["left_out"]:
            names = ", ".join(said["left_out"])
            said["remarks"].append(f"{names}: left out of the choice; their curves do not reach its pressures.")
    if design.maps:
        announce(f"{design.skin}: maps")
        said["maps"] = _draw_maps(study, skin, tables, out)
    if design.search:
        _search(study, tables, out)


def _probe(study, threads):
    """Curves of the probes, on a module with one taxel."""
    probes = study.design.probes
    return probe_curves(
        _skin(study, alone(study.layout, probes.at_taxel - 1), threads),
        study.elastomer,
        diameters_mm=probes.diameters_mm,
        pressures_kpa=probes.pressures_kpa,
        modulus_shares=probes.modulus_shares,
    )


def _skin(study, layout, threads):
    return Skin(layout, thickness_mm=study.design.module.thickness_mm, poisson=study.elastomer.poisson,
                permittivity=study.elastomer.permittivity_fe, mesh=study.design.mesh.sizes(), threads=threads)


def _readings(study: PreparedDesign, skin: Skin, folder: Path) -> Readings:
    choices = {load.name: load for load in study.design.loads}
    for name, load in study.loads.items():
        if load is None:
            study.loads[name] = _pressed(study, skin, choices[name], folder)
    return analyse(skin, [load for load in study.loads.values() if load], elastomer=study.elastomer, converter=study.converter)


def _pressed(study: PreparedDesign, skin: Skin, choice: LoadChoice, folder: Path) -> Load:
    assert choice.mesh is not None and choice.force_n is not None
    mesh = read_mesh(folder / choice.mesh, unit=choice.unit)
    how: dict[str, Any] = {
        "force_n": choice.force_n,
        "elastomer": study.elastomer,
        "turned_deg": choice.turned_deg,
        "name": choice.name,
    }
    centre = choice.centre(study.layout, study.where)
    if choice.strains == "small":
        return contact_load(skin, mesh, centre, **how)
    announce(f"{study.design.skin}: load {choice.name!r} at finite strains")
    return press_at_finite_strains(skin, mesh, centre, friction=choice.friction, **how)


def _load_table(study: PreparedDesign, readings: Readings) -> pd.DataFrame:
    """A row a load: what it is and what it does."""
    rows = []
    for number, (name, load) in enumerate(study.loads.items()):
        assert load is not None
        delta, counts = readings.delta_ff[number], readings.counts[number]
        rows.append(
            {
                "load": name,
                "what": load.words,
                "force_n": load.total_n,
                "young_mpa": readings.young_mpa[number],
                "deepest_mm": float(-readings.displacement_mm[number, :, 2].min()),
                "taxel": int(delta.argmax()) + 1,
                "delta_ff": float(delta.max()),
                "counts": int(counts.max()),
                "taxels_above_noise": int((counts > 3 * study.converter.noise_counts).sum()),
            }
        )
    return pd.DataFrame(rows)


def _write_readings(study: PreparedDesign, skin: Skin, readings: Readings, out: Path) -> None:
    """readings.nc, and a figure for each load."""
    top = skin.layer.mesh.nodes_mm[skin.layer.mesh.top, :2]
    per_taxel = {"capacitance_ff": ("fF", "of the deformed skin"), "delta_ff": ("fF", "above rest"), "counts": ("1", "above rest")}
    dataset = xr.Dataset(
        {
            name: (("load", "taxel"), getattr(readings, name), {"units": units, "long_name": text})
            for name, (units, text) in per_taxel.items()
        }
        | {
            "at_rest_ff": ("taxel", readings.at_rest_ff, {"units": "fF"}),
            "young_mpa": ("load", readings.young_mpa, {"units": "MPa"}),
            "displacement_mm": (
                ("load", "node", "axis"),
                readings.displacement_mm,
                {"units": "mm", "long_name": "of the upper side"},
            ),
            "node_mm": (("node", "plane"), top, {"units": "mm"}),
            "taxel_mm": (("taxel", "plane"), study.layout.centres_mm, {"units": "mm"}),
            "module": ("taxel", study.layout.module),
        },
        coords={
            "load": list(study.loads),
            "taxel": np.arange(1, len(study.layout.centres_mm) + 1),
            "axis": ["x", "y", "z"],
            "plane": ["x", "y"],
        },
        attrs={"elastomer": study.elastomer.name, "thickness_mm": study.design.module.thickness_mm},
    )
    write_dataset(out / "readings.nc", dataset, seed=None, settings=study.design.model_dump(mode="json"))
    for number, (name, load) in enumerate(study.loads.items()):
        assert load is not None
        figures.draw_load(
            out / f"figures/load_{number + 1}.png",
            study.layout,
            top,
            readings,
            number,
            title=f"{name}: {load.words}; {study.elastomer.name}",
        )


def _choose(study: PreparedDesign, choice: Choice, tables: dict[str, pd.DataFrame], out: Path) -> dict[str, Any]:
    """The tables of the choice; what the command tells of it."""
    target = 1e-3 * choice.target_kpa
    known = [e for e in study.elastomers.values() if reaches(e, target)]
    scatter = {"batch_scatter": choice.batch_scatter, "ageing_stiffening": choice.ageing_stiffening}
    tables["choice_printed"] = printed_criteria(known, stress_mpa=target, area_mm2=study.layout.area_mm2)
    tables["front_confidence"], same = front_confidence(
        known,
        stress_mpa=target,
        draws=choice.draws,
        strain_scatter=choice.strain_scatter,
        **scatter,
        seed=choice.seed,
    )
    bearable = [e for e in study.elastomers.values() if bears(e, 1e-3 * choice.range_kpa[1])]
    table = thickness_table(
        bearable,
        study.design.module.layout(),
        needs=needs_of(choice),
        thicknesses_mm=choice.thicknesses_mm,
        converter=study.converter,
        weight_budget_g=choice.weight_budget_g,
    )
    table = with_scatter(table, needs=needs_of(choice), **scatter)
    tables["thickness"], tables["choice"] = table, thinnest(table)
    figures.draw_front(out / "figures/front.png", tables["choice_printed"], tables["front_confidence"])
    figures.draw_thickness(
        out / "figures/thickness.png", table, detected_counts=choice.detected_counts, strain_limit=choice.strain_limit
    )
    robust = thinnest(table.assign(meets_all=table.meets_all_at_worst))
    left_out = [e.name for e in study.elastomers.values() if e not in known or e not in bearable]
    return {
        "same_front": same,
        "left_out": left_out,
        "chosen": _lightest(tables["choice"]),
        "chosen_at_worst": _lightest(robust),
    }


def _lightest(choice: pd.DataFrame) -> dict[str, Any] | None:
    """The first row of a choice, which is the lightest, in words and numbers; None where nothing meets all needs."""
    if not len(choice):
        return None
    best = choice.iloc[0]
    return {"elastomer": best.elastomer, "thickness_mm": float(best.thickness_mm), "weight_g_module": float(best.weight_g_module)}


def _draw_maps(study: PreparedDesign, skin: Skin, tables: dict[str, pd.DataFrame], out: Path) -> dict[str, float]:
    """The maps; what a command tells of them."""
    settings = study.design.maps
    assert settings is not None
    pressure, needs = 1e-3 * settings.pressure_kpa, study.design.choice or Choice()
    young = study.elastomer.tested_young_mpa(pressure)
    maps = patch_maps(
        skin,
        finger_mm2=settings.finger_mm2,
        pressure_mpa=pressure,
        young_mpa=young,
        converter=study.converter,
        detected_counts=needs.detected_counts,
        spacing_mm=settings.spacing_mm,
    )
    module = study.design.module
    tables["detection"] = maps.table()
    layer = TaxelLayer(module.radius_mm, module.guard_radius_mm, module.thickness_mm, study.elastomer.poisson,
                       study.elastomer.permittivity_fe, young)
    tables["crosstalk"] = crosstalk(settings.pitches_mm, layer, probe_mm=settings.crosstalk_probe_mm, converter=study.converter,
                                    pressure_mpa=pressure)
    figures.draw_maps(out / "figures/maps.png", study.layout, maps, tables["crosstalk"])
    return {
        "least_force_n": float(maps.smallest_force_n.min()),
        "worst_force_n": float(maps.smallest_force_n.max()),
        "asked_n": needs.smallest_force_n,
        "share_not_felt": float((maps.smallest_force_n > needs.smallest_force_n).mean()),
    }


def _search(study: PreparedDesign, tables: dict[str, pd.DataFrame], out: Path) -> None:
    settings, choice, module = study.design.search, study.design.choice or Choice(), study.design.module
    assert settings is not None
    names = settings.elastomers or [e.name for e in study.elastomers.values() if bears(e, 1e-3 * choice.range_kpa[1])]
    tables["search"] = search(
        {name: study.elastomers[name] for name in names},
        SearchSpace(settings.thicknesses_mm, settings.radii_mm, settings.pitches_mm,
                    gap_mm=module.guard_radius_mm - module.radius_mm, side_mm=module.side_mm),
        needs=needs_of(choice),
        converter=study.converter,
        weight_budget_g=choice.weight_budget_g,
        folder=out / "search",
    )
    tables["main_effects"] = main_effects(tables["search"])


def _lay(study: PreparedDesign, tables: dict[str, pd.DataFrame], out: Path, folder: Path
         ) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """Places and normals of the taxels on a link, and what a command tells of the modules."""
    link = study.design.link
    assert link is not None
    laid = lay_modules(
        read_mesh(folder / link.mesh, unit=link.unit),
        study.design.module.layout(),
        start_mm=None if link.start_mm is None else np.array(link.start_mm),
        direction=np.array(link.direction),
        rings=link.rings,
        least_radius_mm=link.least_radius_mm,
    )
    weight = 1e-3 * study.elastomer.density_g_cm3 * study.design.module.layout().area_mm2 * study.design.module.thickness_mm
    tables["modules"], tables["seams"] = laid.modules.assign(weight_g=weight), laid.seams
    figures.draw_link(out / "figures/link.png", laid.corners_mm, laid.positions_mm, laid.fits)
    told = {
        "modules": int(laid.fits.sum()),
        "bent_too_much": int((~laid.fits).sum()),
        "without_place": laid.left_out,
        "least_bend_radius_mm": float(laid.modules.bend_radius_mm.min()),
        "widest_gap_mm": float(laid.seams.gap_mm.max()) if len(laid.seams) else 0.0,
        "widest_overlap_mm": float(-laid.seams.gap_mm.min()) if len(laid.seams) else 0.0,
        "elastomer_g": float(weight * laid.fits.sum()),
    }
    return laid.positions_mm, laid.normals, told


def _flat(layout: Layout) -> tuple[np.ndarray, np.ndarray]:
    """Places and normals of the taxels of a flat skin."""
    count = len(layout.centres_mm)
    return np.column_stack([layout.centres_mm, np.zeros(count)]), np.tile([0.0, 0.0, 1.0], (count, 1))
