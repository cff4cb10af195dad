"""The jobs of the study that decides.

    objects/OBJECT.stl, OBJECT.json        what is pressed, and what the paper's rule says of its meshes
    maps.nc                                all their maps in one file: to open hundreds takes longer than to score them
    matched.json                           the modulus of the matched elastic model
    presses/MODEL/ITEM.nc                  of tested models, truths, and truths of the map of robustness (few items)
    readings/TRUTH.nc                      the virtual sensor's counts of all items
    learning/TRUTH/MODEL_compact.csv, _printed_SEED.csv      scores of networks
    learning/TRUTH/MODEL_NETWORK_curve.csv                   on growing shares of the indenters
    tables/power.csv                       stated before any score is known
    tables/scores.csv, mean_scores.csv     of each object, and their means
    tables/hypotheses.csv, learning_curve.csv, robustness.csv, collapse.csv, claims.csv
    figures/, report.html
"""

import zlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from softtact.sensors.library import material_file
from softtact.studies.configuration import found_sensor
from softtact.studies.decide.config import (
    FORMULAS,
    HYPERELASTIC,
    MATCHED,
    MODELS,
    PRINTED,
    DecideItem,
    DecideStudy,
    Pressing,
    Trainings,
    pairs_of,
)
from softtact.studies.jobs import Job, figure_files, from_here

TABLES = ("scores", "hypotheses", "learning_curve", "power", "robustness", "collapse")
ON_PAGE = (*TABLES, "mean_scores", "claims")


def jobs(study: DecideStudy, folder: str | Path) -> list[Job]:
    """All jobs of a study whose results lie in a folder, in an order in which they can run."""
    of = _Jobs(study, str(folder))
    return [*of.objects(), *of.tested(), *of.truths(), *of.variants(), *of.readings(), *of.learning(), *of.judging(), *of.figures()]


class _Jobs:
    """The jobs of one study, part by part."""

    def __init__(self, study: DecideStudy, folder: str) -> None:
        self.study, self.values, self.folder = study, study.values, folder
        self.items = [*study.indenters, *study.objects]
        self.forces = list(study.values.forces_n)
        self.sensor = {"sensor": from_here(found_sensor(study.values.sensor))}
        self.pressing = self.sensor | {"materials": [from_here(material_file(name)) for name in study.spec.materials.values()]}

    def mesh(self, item: DecideItem) -> str:
        """Path of an item's mesh."""
        return f"{self.folder}/{item.file}" if item.made else item.file

    def presses(self, model: str, items: Sequence[DecideItem]) -> list[str]:
        """Paths of a model's presses."""
        return [f"{self.folder}/presses/{model}/{item.id}.nc" for item in items]

    def facts(self) -> list[str]:
        """Paths of what is known of the objects."""
        return [f"{self.folder}/objects/{item.id}.json" for item in self.study.objects]

    def objects(self) -> list[Job]:
        """Every object, in its meshes."""
        common = {"footprint_mm": list(self.study.spec.footprint_mm), "reach_mm": self.study.spec.thickness_mm,
                  "rule": self.values.rule}
        outputs = {"mesh": f"{self.folder}/objects/{{item}}.stl", "facts": f"{self.folder}/objects/{{item}}.json"}
        return [Job("draw_object", {}, outputs, {"object": asdict(item.made), "edges_mm": self._edges(item), **common},
                    {"item": item.id}) for item in self.study.objects if item.made is not None]

    def _edges(self, item):
        """The longest edges of an object's meshes, drawn from the seed and its name."""
        wanted = self.values.objects
        rng = np.random.default_rng([self.values.seed, zlib.crc32(item.id.encode())])
        low, high = np.log(wanted.edges_mm)
        return [round(float(edge), 3) for edge in np.exp(rng.uniform(low, high, wanted.remeshings))]

    def tested(self) -> list[Job]:
        """The presses of the tested models; the matched one needs the hyperelastic model's."""
        hyperelastic = self.hyperelastic(HYPERELASTIC, self.values.models["hyperelastic"], self.items, self.forces)
        match = Job("match_stiffness", {"presses": self.presses(HYPERELASTIC, self.study.indenters),
                                        "objects": [self.mesh(item) for item in self.study.indenters], **self.sensor},
                    {"modulus": f"{self.folder}/matched.json"}, {"units": [item.unit for item in self.study.indenters]},
                    work={"match": len(self.study.indenters)})
        return [*hyperelastic, match, *(self.fast(name) for name in MODELS if name != HYPERELASTIC)]

    def hyperelastic(self, name: str, model: Pressing, items: Sequence[DecideItem], forces: Sequence[float]) -> list[Job]:
        """One press a job."""
        draft = model.mesh == {"preset": "draft"}      # a truth may state a finer mesh than its preset's
        if name in self.values.truths:
            unit = "friction" if model.friction else "draft" if draft else "truth"
        elif name == HYPERELASTIC:
            unit = "draft" if draft else "default"
        else:
            unit = "variant_draft" if draft else "variant_default"      # few forces, far apart
        made, common = f"{self.folder}/presses/{{model}}/{{item}}.nc", {"name": name, "model": model.model_dump(mode="json")}
        return [Job("press", {"object": self.mesh(item), **self.pressing}, {"press": made},
                    common | {"item": item.id, "unit": item.unit, "forces_n": list(forces)},
                    {"model": name, "item": item.id}, {unit: len(forces)}) for item in items]

    def fast(self, name: str) -> Job:
        """All items by a fast model."""
        model = self.values.models[name]     # type: ignore[index]
        modulus = {"modulus": f"{self.folder}/matched.json"} if model.young_mpa == "matched" else {}
        return Job("press_fast", {"objects": [self.mesh(item) for item in self.items], **self.pressing, **modulus},
                   {"presses": [f"{self.folder}/presses/{{model}}/{item.id}.nc" for item in self.items]},
                   {"name": name, "model": model.model_dump(mode="json"), "forces_n": self.forces,
                    "items": [{"item": item.id, "unit": item.unit} for item in self.items]},
                   {"model": name}, {f"{model.kind}_items": len(self.items)})

    def truths(self) -> list[Job]:
        """The presses that the virtual sensor feels, of all items."""
        return [job for name, model in self.values.truths.items()
                for job in self.hyperelastic(name, model, self.items, self.forces)]

    def variants(self) -> list[Job]:
        """The presses of the map of robustness."""
        return [job for name, _, model in self.study.variants()
                for job in self.hyperelastic(name, model, self.study.few_objects, self.values.robustness.forces_n)]

    def readings(self) -> list[Job]:
        """All maps in one file, and what the virtual sensor reads of each truth."""
        models = [*MODELS, *self.values.truths]
        gathered = Job("gather_maps", {f"presses_{model}": self.presses(model, self.items) for model in models},
                       {"maps": f"{self.folder}/maps.nc"}, {"models": models, "sets": [item.set for item in self.items]},
                       work={"files": len(models) * len(self.items)})
        made = f"{self.folder}/readings/{{truth}}.nc"
        return [gathered, *(
            Job("read_truth", {"maps": f"{self.folder}/maps.nc", **self.sensor}, {"readings": made},
                {"truth": truth, "model": model, "seed": self.values.seed, "virtual_sensor": self.values.virtual_sensor},
                {"truth": truth}, {"readings": len(self.items)}) for truth, model in self.study.truths.items())]

    def maps(self, truth: str) -> dict[str, Any]:
        """Inputs of a stage that scores against a truth."""
        return {"readings": f"{self.folder}/readings/{truth}.nc", "maps": f"{self.folder}/maps.nc", **self.sensor}

    def learning(self) -> list[Job]:
        """The trainings of networks on one model's maps and one truth's readings, and their learning curves."""
        networks = self.values.learning.networks.items()
        return [job for jobs_of in (self._trainings, self._curves) for name, trained in networks for job in jobs_of(name, trained)]

    def _trainings(self, architecture: str, trained: Trainings) -> list[Job]:
        """A network's trainings; one of the printed network takes minutes, and each is a job of its own."""
        each = [[seed] for seed in range(trained.seeds)] if architecture == PRINTED else [list(range(trained.seeds))]
        made = []
        for seeds in each:
            settings, work = self._training(architecture, trained, len(seeds))
            network = f"{architecture}_{seeds[0]}" if architecture == PRINTED else architecture
            made += [Job("learn", self.maps(truth), {"scores": f"{self.folder}/learning/{{truth}}/{{model}}_{{network}}.csv"},
                         {"truth": truth, "model": model} | settings | {"seeds": seeds},
                         {"truth": truth, "model": model, "network": network}, work)
                     for truth, model in pairs_of(self.values.learning.truths_of(trained))]
        return made

    def _curves(self, architecture: str, trained: Trainings) -> list[Job]:
        """A network's learning curves: of the study's truths, their ends the first trainings."""
        settings, work = self._training(architecture, trained, len(trained.curve))
        first = f"{architecture}_0" if architecture == PRINTED else architecture
        learned = f"{self.folder}/learning/{{truth}}/{{model}}"
        return [Job("trace_curve", self.maps(truth) | {"whole": f"{learned}_{first}.csv".format(truth=truth, model=model)},
                    {"curve": f"{learned}_{{network}}_curve.csv"},
                    {"truth": truth, "model": model} | settings | {"shares": trained.curve},
                    {"truth": truth, "model": model, "network": architecture}, work)
                for truth, model in pairs_of(self.values.learning.truths)]

    def _training(self, architecture: str, trained: Trainings, times: int) -> tuple[dict[str, Any], dict[str, float]]:
        """Settings of a job that trains an architecture some times, and its work."""
        plan = self.values.learning
        schedule = trained.model_dump(mode="json", exclude={"seeds", "controls", "curve"})
        settings = {"architecture": architecture, "seed": self.values.seed, "device": plan.device,
                    "validation_share": plan.validation_share, "ssim_window": self.values.ssim_window,
                    "scored": self.values.scored, "trained": schedule}
        return settings, {f"{architecture}_maps": len(self.study.indenters) * len(self.forces) * trained.epochs * times}

    def judging(self) -> list[Job]:
        """Scores, power, hypotheses, and the maps of robustness and collapse."""
        values, folder = self.values, self.folder
        statistics = values.statistics.model_dump(mode="json")
        common = {"seed": values.seed, "ssim_window": values.ssim_window}
        table = {name: f"{folder}/tables/{name}.csv" for name in ON_PAGE}
        learned = self.learning()
        scored = [Job("score_formulas", self.maps(truth), {"scores": f"{folder}/scores/{{truth}}.csv"},
                      common | {"truth": truth, "scored": values.scored}, {"truth": truth}) for truth in self.study.truths]
        power = Job("state_power", {}, {"power": table["power"]},
                    {"statistics": statistics, **values.objects.model_dump(include={"smooth", "stepped"}),
                     "seeds": self._seeds(), "tests": self._tests()})
        gathered = Job("gather_scores", {"formulas": [str(job.made()["scores"]) for job in scored],
                                         "networks": [str(job.made()["scores"]) for job in learned if job.stage == "learn"],
                                         "curves": [str(job.made()["curve"]) for job in learned if job.stage == "trace_curve"],
                                         "facts": self.facts(),
                                         **{f"presses_{model}": self.presses(model, self.study.objects) for model in MODELS},
                                         **self.sensor},
                       {name: table[name] for name in ("scores", "mean_scores", "learning_curve")}
                       | {"choices": f"{folder}/scores/choices.csv"},
                       common | {"tolerance_mm": values.tolerance_mm})
        shown = {f"presses_{truth}": self.presses(model, self.study.objects) for truth, model in self.study.truths.items()}
        judged = Job("judge", {"scores": table["scores"], "power": table["power"], "choices": f"{folder}/scores/choices.csv",
                               "collapse": table["collapse"]},
                     {"hypotheses": table["hypotheses"]}, {"statistics": statistics, "seed": values.seed,
                                                           "truths": list(values.truths)})
        return [power, *scored, gathered, self._collapse(table["collapse"], shown), self._robustness(table["robustness"]), judged,
                Job("judge_claims", {name: table[name] for name in TABLES}, {"claims": table["claims"]},
                    {"statistics": statistics, "truths": list(values.truths), "printed": values.learning.printed is not None})]

    def _tests(self):
        """How many tests share a claim's level: truths, readouts and both primary scores."""
        of_networks = [truth for truth in self.values.learning.truths if truth in self.values.truths]
        readouts = 2 * len(self.values.truths) + len(of_networks) * (len(self._seeds()) - 2)
        return 2 * readouts

    def _seeds(self):
        """{readout: number of its trainings}; formulas have one."""
        return dict.fromkeys(FORMULAS, 1) | {name: made.seeds for name, made in self.values.learning.networks.items()}

    def _collapse(self, table, shown):
        stepped = [item for item in self.study.objects if item.set == "stepped"]
        moduli = self.values.collapse_young_mpa
        models = {f"presses_{model}": self.presses(model, stepped) for model in (*MODELS, *self.values.truths)}
        facts = [f"{self.folder}/objects/{item.id}.json" for item in stepped]
        return Job("trace_collapse", {"objects": [self.mesh(item) for item in stepped], "facts": facts, **models, **self.pressing},
                   {"collapse": table}, {"young_mpa": list(moduli), "forces_n": self.forces},
                   work={"elastic_items": len(stepped) * len(moduli)})

    def _robustness(self, table):
        few = self.study.few_objects
        variants = list(self.study.variants())
        inputs: dict[str, Any] = {f"presses_{model}": self.presses(model, few) for model in ("elastic", MATCHED, HYPERELASTIC)}
        return Job("map_robustness", {"variants": [path for name, _, _ in variants for path in self.presses(name, few)], **inputs,
                                      **self.sensor},
                   {"robustness": table},
                   {"variants": [varied for _, varied, _ in variants], "objects": [item.id for item in few],
                    "forces_n": list(self.values.robustness.forces_n), "seed": self.values.seed, "scored": self.values.scored,
                    "statistics": self.values.statistics.model_dump(mode="json")})

    def figures(self) -> list[Job]:
        """The figures and the page."""
        folder, table = self.folder, {name: f"{self.folder}/tables/{name}.csv" for name in ON_PAGE}
        shown = next(item for item in reversed(self.study.objects) if item.set == "stepped")
        maps = {f"presses_{model}": self.presses(model, [shown]) for model in (*self.values.truths, *MODELS)}
        drawn = {
            "maps": Job("draw_maps", maps, figure_files(folder, "maps"), {"models": [*self.values.truths, *MODELS]}),
            "scores": Job("draw_scores", {"scores": table["scores"]}, figure_files(folder, "scores"), {"seed": self.values.seed}),
            "collapse": Job("draw_collapse", {"collapse": table["collapse"]}, figure_files(folder, "collapse")),
            "learning_curve": Job("draw_curve", {"learning_curve": table["learning_curve"]},
                                  figure_files(folder, "learning_curve")),
            "robustness": Job("draw_robustness", {"robustness": table["robustness"]}, figure_files(folder, "robustness")),
        }
        pictures = [str(job.made()["png"]) for job in drawn.values()]
        page = Job("report", table | {"figures": pictures}, {"page": f"{folder}/report.html"},
                   {"study": self.study.name, "names": list(drawn), "shown": shown.id,
                    "config": self.values.model_dump_json(indent=2)})
        return [*drawn.values(), page]
