"""The jobs of a study of a robot skin.

    loads/load_N.nc                        load N, if it is an object pressed at finite strains
    readings.nc, tables/loads.csv          deformation, capacitances and counts under all loads
    tables/*.csv, facts/*.json             results of each section of the design; the report's sentences use the facts
    search/*.json                          results of all elastomers at one thickness and radius
    exports/, figures/, report.html
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from softtact.errors import InputError
from softtact.skin.design import Choice, PreparedDesign, SkinDesign, bears, check_design, needs_of, prepare, reaches
from softtact.skin.elastomers import read_elastomers
from softtact.studies.jobs import Job, figure_files, files_made, from_here

_TABLES = {
    "choose_layer": ("choice_printed", "front_confidence", "thickness", "choice"),
    "map_patch": ("detection", "crosstalk"),
    "rank_designs": ("search", "main_effects"),
    "lay_modules": ("modules", "seams"),
    "judge_claims": ("claims", "convergence"),
}


@dataclass(frozen=True)
class SkinStudy:
    """A checked design."""

    name: str
    """Name of its folder below results/."""
    prepared: PreparedDesign
    folder: Path
    """Folder to which the design's paths are relative."""

    @property
    def design(self) -> SkinDesign:
        """The validated design."""
        return self.prepared.design

    def path(self, file: str) -> str:
        """The path of a file of the design, relative to the working folder if it lies below it."""
        return from_here(self.folder / file)


def load(values: Mapping[str, Any], path: str | Path | None) -> SkinStudy:
    """The study of a design's keys and values from a file; raises an InputError of one sentence for the first fault."""
    path = Path(path or "design.yaml")
    design = check_design(values, path)
    if not design.loads:     # a sensor has none
        raise InputError(f"{path}, at 'loads': a study needs a load or more, and there is none; add one.")
    return SkinStudy(design.study or path.stem, prepare(design, path), path.parent)


def jobs(study: SkinStudy, folder: str | Path) -> list[Job]:
    """All jobs of a study with results in a folder, in an order in which they can run."""
    design, folder = study.design, str(folder)
    made = _loads(study, folder)
    for wanted, part in ((design.probes, _probes), (design.choice, _choice), (design.maps, _maps), (design.search, _search),
                         (design.link, _link)):
        if wanted:
            made += part(study, folder)
    made.append(Job("write_exports", {"laid": f"{folder}/modules.nc"} if design.link else {},
                    {kind: f"{folder}/exports/skin.{kind}" for kind in ("txt", "urdf", "xml")}, _plain(design, "module", "patch")))
    if design.claims:
        papers = {"elastomers": _values(read_elastomers())}     # a user's may take the name of one that the papers measured
        made.append(Job("judge_claims", {}, _tables("judge_claims", folder), papers, work={"claims": 1}))
    return [*made, _report(study, folder, made)]


def _loads(study, folder):
    """The jobs of the loads and of the readings under them."""
    design = study.design
    made, pressed, files, settings = [], [], [], []
    for number, choice in enumerate(design.loads, start=1):
        values = choice.model_dump(mode="json", exclude_defaults=True)
        file = choice.mesh or choice.mask
        if file:     # its path is an input, not a setting
            values |= {"mesh" if choice.mesh else "mask": Path(file).name}
        settings.append(values)
        if choice.strains == "finite":
            made.append(Job("press_object", {"mesh": study.path(file)}, {"load": f"{folder}/loads/load_{{load}}.nc"},
                            _skin(study) | {"load": values}, {"load": str(number)}, {"finite": _fields(study, 1)}))
            pressed.append(f"{folder}/loads/load_{number}.nc")
        elif file:
            files.append(study.path(file))
    read = Job("read_taxels", {name: paths for name, paths in (("files", files), ("pressed", pressed)) if paths},
               {"readings": f"{folder}/readings.nc", "table": f"{folder}/tables/loads.csv", "facts": f"{folder}/facts/loads.json"},
               _skin(study) | {"loads": settings, "converter": _converter(study)}, work={"field": _fields(study, len(settings))})
    drawn = [Job("draw_load", {"readings": f"{folder}/readings.nc", "table": f"{folder}/tables/loads.csv"},
                 figure_files(folder, "load_{load}"),
                 _plain(design, "module", "patch") | {"load": number, "elastomer": design.elastomer}, {"load": str(number)})
             for number in range(1, len(settings) + 1)]
    return [*made, read, *drawn]


def _probes(study, folder):
    table = {"table": f"{folder}/tables/probes.csv"}
    return [Job("compute_probes", {}, table, _skin(study) | _plain(study.design, "probes"),
                work={"field": _fields(study, 6 * len(study.design.probes.diameters_mm))}),
            Job("draw_probes", table, figure_files(folder, "probes"))]


def _choice(study, folder):
    choice, made = study.design.choice, _tables("choose_layer", folder)
    known = [name for name, one in study.prepared.elastomers.items() if reaches(one, 1e-3 * choice.target_kpa)]
    bearable = [name for name, one in study.prepared.elastomers.items() if bears(one, 1e-3 * choice.range_kpa[1])]
    return [Job("choose_layer", {}, made | {"facts": f"{folder}/facts/choice.json"},
                _plain(study.design, "module", "choice") | {"elastomers": _elastomers(study), "converter": _converter(study),
                                                            "known": known, "bearable": bearable},
                work={"cell": len(choice.thicknesses_mm) * len(bearable)}),
            Job("draw_front", {name: made[name] for name in ("choice_printed", "front_confidence")}, figure_files(folder, "front")),
            Job("draw_thickness", {"thickness": made["thickness"]}, figure_files(folder, "thickness"),
                choice.model_dump(mode="json", include={"detected_counts", "strain_limit"}))]


def _maps(study, folder):
    design, made = study.design, _tables("map_patch", folder)
    needs = (design.choice or Choice()).model_dump(mode="json", include={"detected_counts", "smallest_force_n"})
    return [Job("map_patch", {}, made | {"facts": f"{folder}/facts/maps.json"},
                _skin(study) | _plain(design, "maps") | {"converter": _converter(study), "needs": needs},
                work={"field": _fields(study, 1), "cell": len(design.maps.pitches_mm)}),
            Job("draw_maps", made, figure_files(folder, "maps"),
                _plain(design, "module", "patch") | {"force_n": 1e-3 * design.maps.pressure_kpa * design.maps.finger_mm2})]


def _search(study, folder):
    """A job for each thickness and radius, whose mesh serves all elastomers of a Poisson's ratio, and one to rank all designs."""
    space, choice, module = study.design.search, study.design.choice or Choice(), study.design.module
    names = space.elastomers or [name for name, one in study.prepared.elastomers.items() if bears(one, 1e-3 * choice.range_kpa[1])]
    common = {"elastomers": [study.prepared.elastomers[name].model_dump(mode="json") for name in names],
              "pitches_mm": space.pitches_mm, "converter": _converter(study), "needs": dataclasses.asdict(needs_of(choice)),
              "side_mm": module.side_mm, "gap_mm": module.guard_radius_mm - module.radius_mm}
    cells = {f"thickness_{thickness:g}_radius_{radius:g}": {"thickness_mm": thickness, "radius_mm": radius}
             for thickness, radius in product(space.thicknesses_mm, space.radii_mm)}
    made = [Job("search_cell", {}, {"rows": f"{folder}/search/{{cell}}.json"}, common | sizes, {"cell": name},
                {"cell": 2 * len(names) * len(space.pitches_mm)}) for name, sizes in cells.items()]
    ranked = Job("rank_designs", {"rows": [f"{folder}/search/{name}.json" for name in cells]}, _tables("rank_designs", folder),
                 {"weight_budget_g": choice.weight_budget_g, "elastomers": list(names), "thicknesses_mm": space.thicknesses_mm,
                  "radii_mm": space.radii_mm, "pitches_mm": space.pitches_mm})
    return [*made, ranked]


def _link(study, folder):
    design = study.design
    laid = {"laid": f"{folder}/modules.nc"}
    values = design.link.model_dump(mode="json", exclude={"mesh"})
    return [Job("lay_modules", {"mesh": study.path(design.link.mesh)},
                _tables("lay_modules", folder) | laid | {"facts": f"{folder}/facts/link.json"},
                _plain(design, "module") | {"link": values, "density_g_cm3": study.prepared.elastomer.density_g_cm3}),
            Job("draw_link", laid, {"png": f"{folder}/figures/link.png"})]


def _report(study, folder, made):
    """The report, from the results of all other jobs."""
    shown = {name: files_made(made, f"{folder}/{name}/", ".png" if name == "figures" else "")
             for name in ("tables", "figures", "facts", "exports")}
    return Job("report", shown | {"readings": f"{folder}/readings.nc"},
               {"page": f"{folder}/report.html", "summary": f"{folder}/summary.json"},
               {"design": study.design.model_dump(mode="json")})


def _skin(study):
    """The settings of the layer of elastomer on its taxels."""
    return _plain(study.design, "module", "patch", "mesh") | {"elastomer": study.prepared.elastomer.model_dump(mode="json")}


def _plain(design, *names):
    return design.model_dump(mode="json", include=set(names))


def _elastomers(study):
    return _values(study.prepared.elastomers)


def _values(elastomers):
    """The fields of each elastomer of a mapping by name."""
    return [elastomer.model_dump(mode="json") for elastomer in elastomers.values()]


def _converter(study):
    return dataclasses.asdict(study.prepared.converter)


def _tables(stage, folder):
    return {name: f"{folder}/tables/{name}.csv" for name in _TABLES[stage]}


def _fields(study, times):
    """Work of the solved fields, in units of a field of one module."""
    return times * len(study.prepared.layout.corners_mm)
