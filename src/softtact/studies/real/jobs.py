"""The jobs of the study on measured data.

    presses/SET.npz, SET.json              labelled presses of a ball, with their source and checksum
    markers/IMAGE.csv                      measured motion of markers
    paths/PATH.nc                          forces and surfaces under a ball by the solid model
    shading/SET.yaml, markers/gel.json     what was fitted
    tables/gel_force.csv, markers.csv, marker_motion.csv, shading.csv, ball_size.csv, circles.csv, claims.csv
    figures/, report.html
"""

from pathlib import Path
from typing import Any

from softtact.studies.jobs import Job, figure_files, from_here
from softtact.studies.real.config import MADE, RealStudy, gel_files

FOTS_FILES = ("fots/presses.csv", "fots/background.npy", "fots/presses/*")
FIGURES = ("gel_force", "markers", "shading", "ball_size", "circles")


def jobs(study: RealStudy, folder: str | Path) -> list[Job]:
    """All jobs of a study whose results lie in a folder, in an order in which they can run."""
    of = _Jobs(study, str(folder))
    return [*of.gathering(), *of.pressing(), *of.fitting(), *of.figures(), *of.ends()]


class _Jobs:
    """The jobs of one study, part by part."""

    def __init__(self, study: RealStudy, folder: str) -> None:
        self.values, self.folder = study.values, folder
        self.sets, self.markers = list(study.values.shading.sets), study.values.markers

    def table(self, name: str) -> str:
        """Path of a table."""
        return f"{self.folder}/tables/{name}.csv"

    def gathering(self) -> list[Job]:
        """Copies of the measured data, each with its source."""
        values = self.values
        made = f"{self.folder}/presses/{{set}}"
        sets = [Job("gather_presses", self.measured(name), {"presses": f"{made}.npz", "facts": f"{made}.json"},
                    {"set": values.shading.sets[name].model_dump(mode="json"), "data": values.data, "taxim": values.taxim,
                     "seed": values.seed}, {"set": name}, {"set": 1}) for name in self.sets]
        files = {"image": self.markers.image} | {f"other_{number}": file for number, file in enumerate(self.markers.others)}
        images = [Job("gather_markers", self.measured_markers(file), {"markers": f"{self.folder}/markers/{{image}}.csv"},
                      {"file": file, "data": values.data, "seed": values.seed, "markers": self.made_of()}, {"image": name})
                  for name, file in files.items()]
        return [*sets, *images]

    def measured(self, name: str) -> dict[str, list[str]]:
        """The measured files of a set, as far as they are here: a change of them gathers it anew."""
        source, values = self.values.shading.sets[name].source, self.values
        files = {"fots": [path for pattern in FOTS_FILES for path in gel_files(values.data, pattern)],
                 "taxim": sorted(Path(values.taxim).glob("*.whl")) if values.taxim else []}
        return {"files": list(map(from_here, files.get(source, [])))}

    def measured_markers(self, file: str) -> dict[str, list[str]]:
        """The measured file of an image, if it is here."""
        if file == MADE:
            return {"files": []}
        found = [Path(file)] if Path(file).is_file() else [] if Path(file).is_absolute() else gel_files(self.values.data, file)
        return {"files": list(map(from_here, found))}

    def made_of(self) -> dict[str, object]:
        """What a drawn image of markers is made with."""
        return {name: getattr(self.markers, name) for name in ("middle_px", "centre_px", "ball_px", "distance_px")}

    def pressing(self) -> list[Job]:
        """The paths of the solid model."""
        force, made = self.values.gel_force, f"{self.folder}/paths/{{path}}.nc"
        shape: dict[str, Any] = {"height_mm": force.height_mm, "ball_mm": force.ball_mm}
        paths: dict[str, dict[str, Any]] = {
            f"force_{name}": {"disc": shape | one.model_dump(mode="json"), "depths_mm": force.depths_mm}
            for name, one in force.variants.items()}
        for name, one in self.markers.paths.items():
            ball = one.ball_over_thickness
            paths[f"markers_{name}"] = {
                "disc": {"height_mm": 1.0, "ball_mm": ball, "radius_mm": 5.0, "friction": one.friction,
                         "bulk_over_shear": one.bulk_over_shear, "element_mm": self.markers.element * ball},
                "depths_mm": self.markers.depths}
        return [Job("press_ball", {}, {"path": made}, settings, {"path": name},
                    {"steps": len(settings["depths_mm"]) * (2 if settings["disc"]["friction"] else 1)})
                for name, settings in paths.items()]

    def fitting(self) -> list[Job]:
        """The modulus, the gel of the markers, the shadings."""
        force = self.values.gel_force
        variants = {f"path_{name}": f"{self.folder}/paths/force_{name}.nc" for name in force.variants}
        values = self.markers.model_dump(mode="json")
        paths = {f"path_{name}": f"{self.folder}/paths/markers_{name}.nc" for name in self.markers.paths}
        others = [f"{self.folder}/markers/other_{number}.csv" for number in range(len(self.markers.others))]
        shading = self.values.shading.model_dump(mode="json", exclude={"sets"})
        return [
            Job("fit_modulus", variants, {"table": self.table("gel_force"), "facts": f"{self.folder}/facts/gel_force.json"},
                {"gel_force": force.model_dump(mode="json")}),
            Job("fit_gel", {"markers": f"{self.folder}/markers/image.csv", **paths},
                {"table": self.table("markers"), "motion": self.table("marker_motion"), "gel": f"{self.folder}/markers/gel.json",
                 "path": f"{self.folder}/markers/gel.nc"}, {"markers": values}, work={"fits": 3 * len(paths) + 6}),
            Job("judge_markers",
                {"gel": f"{self.folder}/markers/gel.json", "path": f"{self.folder}/markers/gel.nc", "others": others},
                {"table": self.table("other_markers")},
                {"names": self.markers.others, "sheared": [name in self.markers.sheared for name in self.markers.others]},
                work={"fits": 8 * len(others)}),
            *(Job("fit_shading", {"presses": f"{self.folder}/presses/{{set}}.npz".format(set=name)},
                  {"table": f"{self.folder}/shading/{{set}}.csv", "ball": f"{self.folder}/shading/{{set}}_ball.csv",
                   "circles": f"{self.folder}/shading/{{set}}_circles.csv",
                   "shading": f"{self.folder}/shading/{{set}}.yaml", "examples": f"{self.folder}/shading/{{set}}_examples.npz"},
                  {"set": self.values.shading.sets[name].model_dump(mode="json"), "shading": shading, "name": name}, {"set": name},
                  {"splits": len(self.values.shading.seeds)}) for name in self.sets),
            Job("gather_tables", {"shading": [f"{self.folder}/shading/{name}.csv" for name in self.sets],
                                  "ball": [f"{self.folder}/shading/{name}_ball.csv" for name in self.sets],
                                  "circles": [f"{self.folder}/shading/{name}_circles.csv" for name in self.sets]},
                {name: self.table(name) for name in ("shading", "ball_size", "circles")}, {"sets": self.sets})]

    def figures(self) -> list[Job]:
        """All figures."""
        examples = [f"{self.folder}/shading/{name}_examples.npz" for name in self.sets]
        force = self.values.gel_force
        paths = {f"path_{name}": f"{self.folder}/paths/force_{name}.nc" for name in force.variants}
        return [Job("draw_gel_force", {"table": self.table("gel_force"), **paths}, figure_files(self.folder, "gel_force"),
                    {"gel_force": force.model_dump(mode="json")}),
                Job("draw_markers", {"motion": self.table("marker_motion")}, figure_files(self.folder, "markers")),
                Job("draw_shading", {"examples": examples}, figure_files(self.folder, "shading"), {"sets": self.sets}),
                Job("draw_circles", {"table": self.table("circles")}, figure_files(self.folder, "circles")),
                Job("draw_ball_size", {"table": self.table("ball_size")}, figure_files(self.folder, "ball_size"))]

    def ends(self) -> list[Job]:
        """Verdicts and the page."""
        names = ["gel_force", "markers", "other_markers", "shading", "ball_size", "circles"]
        tables = {name: self.table(name) for name in names}
        limits = {name: one.least_mae for name, one in self.values.shading.sets.items()}
        made = {name: one.source == MADE for name, one in self.values.shading.sets.items()}
        stated = {name: one.ball_px if one.stated else None for name, one in self.values.shading.sets.items()}
        judge = Job("judge", tables, {"claims": self.table("claims")},
                    {"limits": limits, "made": made, "stated": stated,
                     "markers_made": self.markers.image == MADE, "sheared": self.markers.sheared,
                     "judged": self.values.gel_force.judged})
        figures = [f"{self.folder}/figures/{name}.png" for name in FIGURES]
        facts = [f"{self.folder}/presses/{name}.json" for name in self.sets]
        return [judge, Job("report", {**tables, "claims": self.table("claims"), "figures": figures, "facts": facts,
                                      "gel": f"{self.folder}/markers/gel.json"},
                           {"page": f"{self.folder}/report.html"}, {"study": self.values.study, "names": list(FIGURES),
                                                                    "config": self.values.model_dump_json(indent=1)})]
