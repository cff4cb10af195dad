"""The jobs of a study of a palpation sensor.

    TISSUE_SCENARIO.nc, fields_TISSUE.vtu  a sweep of the jaw, and the last step for ParaView
    sweeps/*.nc, hardness/*.csv            sweeps on a coarser mesh and with other assumptions, and for the study of hardness
    lump/lumps.nc                          film forces over lumps
    tables/*.csv, facts/*.json             their summaries; the report's sentences use the facts
    figures/, summary.json, report.html
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softtact.probe.design import PalpationDesign, check_design
from softtact.studies.jobs import Job, figure_files, files_made

_COARSER = 2.0     # factor of the element sizes of the second mesh, for the mesh error
_OF_STUDIES = {"variants", "variant_steps", "hardness", "search", "load_n", "displacement_mm"}     # not of a sweep


@dataclass(frozen=True)
class PalpationStudy:
    """A checked design."""

    design: PalpationDesign

    @property
    def name(self) -> str:
        """Name of its folder below results/."""
        return self.design.name


def load(values: Mapping[str, Any], path: str | Path | None) -> PalpationStudy:
    """The study of a design's keys and values from a file; raises an InputError of one sentence for the first fault."""
    return PalpationStudy(check_design(values, path or "design.yaml"))


def jobs(study: PalpationStudy, folder: str | Path) -> list[Job]:
    """All jobs of a study with results in a folder, in an order in which they can run."""
    design, folder = study.design, str(folder)
    main, coarse, variants = _main_sweeps(design, folder), _coarse_sweeps(design, folder), _variant_sweeps(design, folder)
    hardness = _hardness(design, folder)
    kept = {"sweeps": main, "coarse": coarse, "variants": list(variants.values()), "hardness": hardness}
    tables = {name: f"{folder}/tables/{name}.csv" for name in ("curves", "slopes", "claims", *(
        name for name in ("hardness", "variants") if kept[name]))}
    made = [*main, *coarse, *variants.values(), *hardness,
            Job("tabulate", {name: [path for job in jobs for path in job.made().values()] for name, jobs in kept.items() if jobs},
                tables | {"facts": f"{folder}/facts/sweeps.json"},
                {"variants": [{"variant": variant, "tissue": tissue} for variant, tissue in variants]}),
            *_figures(design, folder, main), *_search(design, folder)]
    return [*made, _report(design, folder, made)]


def _sweep(design: PalpationDesign, folder: str, name: str, tissue: str, scenario: str, steps: Sequence[float]) -> Job:
    return Job("sweep", {}, {"sweep": f"{folder}/{{sweep}}.nc"},
               {"design": _of_one_tissue(design, tissue), "scenario": scenario, "steps": list(map(float, steps))}, {"sweep": name},
               {design.model: len(steps)})


def _of_one_tissue(design: PalpationDesign, tissue: str) -> dict[str, Any]:
    """The values of a design that a sweep over a tissue uses."""
    values = design.model_dump(mode="json", exclude=_OF_STUDIES, exclude_none=True)
    steps = {"to": 0.5 * design.geometry.tissue_height, "by": 1.0}     # required keys; a sweep has its steps in its settings
    return values | {"tissues": {tissue: values["tissues"][tissue]}, "load_n": steps, "displacement_mm": steps}


def _main_sweeps(design, folder):
    steps = {"displacement": design.displacement_mm.values, "load": design.load_n.values}
    return [_sweep(design, folder, f"{tissue}_{scenario}", tissue, scenario, values)
            for scenario, values in steps.items() for tissue in design.tissues]


def _coarse_sweeps(design, folder):
    """The sweeps of the displacement on a coarser mesh."""
    coarse = design.with_(mesh={name: _COARSER * getattr(design.mesh, name) for name in ("along", "tissue", "base")})
    return [_sweep(coarse, folder, f"sweeps/coarse_{tissue}", tissue, "displacement", design.displacement_mm.values)
            for tissue in design.tissues]


def _variant_sweeps(design, folder):
    """{(variant, tissue): job} with the assumptions of each variant and of the design, in fewer steps."""
    if not design.variants:
        return {}
    found = {}
    designs = {"as designed": design, **{name: design.variant(name) for name in design.variants}}
    for number, (name, one) in enumerate(designs.items()):
        steps = one.displacement_mm.to * (1 + np.arange(design.variant_steps)) / design.variant_steps
        found |= {(name, tissue): _sweep(one, folder, f"sweeps/variant_{number}_{tissue}", tissue, "displacement", steps)
                  for tissue in one.tissues}
    return found


def _hardness(design, folder):
    if design.hardness is None:
        return []
    made = []
    for height in design.hardness.tissue_heights:
        settings = design.hardness.model_dump(mode="json") | {"tissue_heights": [height]}
        made += [Job("measure_hardness", {}, {"rows": f"{folder}/hardness/{{sweep}}.csv"},
                     {"design": _of_one_tissue(design, tissue) | {
                         "hardness": settings, "displacement_mm": design.displacement_mm.model_dump(mode="json")}},
                     {"sweep": f"{tissue}_{height:g}"}, {design.model: design.hardness.steps}) for tissue in design.tissues]
    return made


def _figures(design, folder, main):
    """Figures, and fields for ParaView."""
    sweeps = [job.made()["sweep"] for job in main]
    moved = {tissue: f"{folder}/{tissue}_displacement.nc" for tissue in design.tissues}
    body = {"design": _of_one_tissue(design, next(iter(design.tissues)))}
    drawn = [Job("draw_shapes", {"sweeps": list(moved.values())}, figure_files(folder, "fig2_shapes"), body),
             Job("draw_curves", {"sweeps": sweeps, "slopes": f"{folder}/tables/slopes.csv"},
                 figure_files(folder, "fig3_fig4_curves")),
             Job("draw_films", {"sweeps": list(moved.values())}, figure_files(folder, "films"))]
    if design.hardness:
        drawn.append(Job("draw_hardness", {"table": f"{folder}/tables/hardness.csv"}, figure_files(folder, "hardness")))
    return drawn + [Job("write_fields", {"sweep": path}, {"fields": f"{folder}/fields_{{tissue}}.vtu"}, body, {"tissue": tissue})
                    for tissue, path in moved.items()]


def _search(design, folder):
    search = design.search
    if search is None:
        return []
    body, values = _of_one_tissue(design, search.tissue), search.model_dump(mode="json")
    without_noise = {name: value for name, value in values.items() if name not in ("trials", "seed")} | {"noise_n": 1.0}
    lumps = {"lumps": f"{folder}/lump/lumps.nc"}
    tables = {name: f"{folder}/tables/lump_{name}.csv" for name in ("detection", "recovery")}
    steps, ratios = len(search.jaw_mm), len(search.stiffness_ratio) + 1
    return [Job("solve_lumps", {}, lumps, {"design": body | {"search": without_noise}},
                work={design.model: steps * ratios * len(search.x) * len(search.depth)}),
            Job("find_lumps", lumps, tables | {"facts": f"{folder}/facts/lump.json"},
                {"design": body | {"search": values}},
                work={design.model: 2 * steps * search.trials * len(search.moves)}),
            Job("draw_lump", tables, figure_files(folder, "lump"))]


def _report(design, folder, made):
    """The report, from the results of all other jobs."""
    chosen = {name: files_made(made, f"{folder}/{start}", end) for name, start, end in (
        ("tables", "tables/", ""), ("figures", "figures/", ".png"), ("facts", "facts/", ""), ("fields", "fields_", ""))}
    main = [f"{folder}/{tissue}_{scenario}.nc" for scenario in ("displacement", "load") for tissue in design.tissues]
    return Job("report", chosen | {"sweeps": main}, {"page": f"{folder}/report.html", "summary": f"{folder}/summary.json"},
               {"design": design.model_dump(mode="json", exclude_none=True)})
