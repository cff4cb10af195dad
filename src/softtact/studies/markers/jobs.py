"""The jobs of the study of marker images.

objects/OBJECT.stl                     the authors' file, or a generated object
dataset/OBJECT_PART.nc, manifest.csv   sequences of frames, and a row for each
baselines/NAME/OBJECT_PART.nc          markers by other physics, of the test sequences
sliding/OBJECT.nc                      one sequence of each object, for the sliding test
learning/NETWORK/SEED/generator.pt, history.csv
scores/*.csv                           a row for each scored frame
tables/scores.csv, table1.csv, table2.csv, by_object.csv, by_motion.csv, sliding.csv, claims.csv
figures/, report.html
"""

from pathlib import Path
from typing import Any

from softtact.sensors.library import material_file
from softtact.studies.configuration import found_sensor
from softtact.studies.jobs import Job, figure_files, from_here
from softtact.studies.markers.config import MarkerStudy
from softtact.studies.markers.paths import TRAIN, SequencePlan
from softtact.studies.markers.stages.data import plan_values

TABLES = ("scores", "table1", "table2", "by_object", "by_motion", "sliding", "claims")
SLIDING_SPLIT = "sliding"
Numbered = list[tuple[int, SequencePlan]]


def jobs(study: MarkerStudy, folder: str | Path) -> list[Job]:
    """All jobs of a study whose results lie in a folder, in an order in which they can run."""
    of = _Jobs(study, str(folder))
    return [*of.shaping(), *of.pressing(), *of.learning(), *of.scoring(), *of.judging()]


class _Jobs:
    """The jobs of one study, part by part."""

    def __init__(self, study: MarkerStudy, folder: str) -> None:
        self.study, self.values, self.folder = study, study.values, folder
        self.pressed_with = {
            "sensor": from_here(found_sensor(study.values.sensor)),
            "materials": [from_here(material_file(name)) for name in study.spec.materials.values()],
            "images": [from_here(path) for path in study.spec.paths],
        }
        self.parts = list(self._parts())
        self.sequences = [f"{folder}/dataset/{part}.nc" for part, _ in self.parts]
        self.trainings = [(name, seed) for name in self.values.networks.names for seed in self.values.networks.seeds]
        self.sources = ["no_motion", *self.values.baselines, *reversed(self.values.networks.names), "physics"]

    def _parts(self):
        """(name, [(number, plan)]) of each file of sequences: some poses of an object."""
        numbered = list(enumerate(self.study.plans))
        for name in self.study.objects:
            own = [(number, plan) for number, plan in numbered if plan.object == name]
            poses = list(dict.fromkeys((plan.split, plan.x_mm, plan.y_mm, plan.angle_deg) for _, plan in own))
            size = self.values.poses_per_file
            for k in range(0, len(poses), size):
                chosen = set(poses[k : k + size])
                yield (
                    f"{name}_{k // size}",
                    [(number, plan) for number, plan in own if (plan.split, plan.x_mm, plan.y_mm, plan.angle_deg) in chosen],
                )

    def mesh(self, name: str) -> str:
        """Path of an object's mesh in the results."""
        return f"{self.folder}/objects/{name}.stl"

    def shaping(self) -> list[Job]:
        """Every object."""
        files = {name: self.study.mesh_file(name) for name in self.study.objects}
        return [
            Job(
                "shape_object",
                {} if file is None else {"mesh": from_here(file)},
                {"mesh": f"{self.folder}/objects/{{object}}.stl"},
                {"object": name},
                {"object": name},
            )
            for name, file in files.items()
        ]

    def _press(self, stage: str, plans: Numbered, output: dict[str, str], wildcards: dict[str, str], **more: Any) -> Job:
        """A job that presses some sequences of one object."""
        values, grid = self.values, self.values.grid
        settings = {
            "plans": [plan_values(plan) for _, plan in plans],
            "numbers": [number for number, _ in plans],
            "path": values.path.model_dump(mode="json"),
            "pixels": self.study.pixels,
            "deepest_mm": self.study.deepest_mm,
            "friction": values.friction,
            "surface_maps": values.surface_maps,
            **more,
        }
        frames = sum(len(plan.moved_mm(grid)) for _, plan in plans)
        return Job(
            stage, {"mesh": self.mesh(plans[0][1].object), **self.pressed_with}, output, settings, wildcards, {"frames": frames}
        )

    def pressing(self) -> list[Job]:
        """The data set, other physics of its tests, and the sequences of the sliding test."""
        made = [
            self._press("press_object", plans, {"sequences": f"{self.folder}/dataset/{{part}}.nc"}, {"part": part})
            for part, plans in self.parts
        ]
        listed = Job(
            "list_data",
            {"sequences": self.sequences},
            {"manifest": f"{self.folder}/dataset/manifest.csv", "facts": f"{self.folder}/facts/data.json"},
            {
                "path": self.values.path.model_dump(mode="json"),
                "objects": len(self.study.objects),
                "generated": [name for name in self.study.objects if self.study.mesh_file(name) is None],
            },
        )
        others = [
            self._press(
                "press_baseline",
                tests,
                {"markers": f"{self.folder}/baselines/{{baseline}}/{{part}}.nc"},
                {"baseline": name, "part": part},
                baseline=name,
            )
            for name in self.values.baselines
            for part, plans in self.parts
            if (tests := _tests(plans))
        ]
        slide = self.values.sliding
        slid = [
            Job(
                "press_sliding",
                *_parts_of(
                    self._press(
                        "press_object",
                        [(0, SequencePlan(name, SLIDING_SPLIT, 0.0, 0.0, 0.0, slide.depth_mm, "x"))],
                        {"sequences": f"{self.folder}/sliding/{{object}}.nc"},
                        {"object": name},
                        path=self.values.path.model_dump(mode="json") | {"aside_mm": slide.aside_mm},
                    )
                ),
            )
            for name in self.study.objects
        ]
        return [*made, listed, *others, *slid]

    def generator(self, name: str, seed: int) -> str:
        """Path of a trained generator."""
        return f"{self.folder}/learning/{name}/{seed}/generator.pt"

    def learning(self) -> list[Job]:
        """The trainings."""
        networks, grid = self.values.networks, self.values.grid
        training = networks.training.model_dump(mode="json")
        trained = [len(plan.moved_mm(grid)) for _, plans in self.parts for _, plan in plans if plan.split == TRAIN]
        longest = [frames for frames in trained if frames == max(trained)]
        made = {
            "generator": f"{self.folder}/learning/{{network}}/{{seed}}/generator.pt",
            "history": f"{self.folder}/learning/{{network}}/{{seed}}/history.csv",
        }
        settings = {"size": networks.size, "training": training, "device": networks.device}
        return [
            Job(
                "train_network",
                {"sequences": self.sequences},
                made,
                settings | {"network": name, "seed": seed},
                {"network": name, "seed": str(seed)},
                {
                    f"{networks.size}_{'temporal' if name == 'temporal' else 'frame'}_steps": networks.training.epochs
                    * sum(longest if name != "pix2pix" else trained)
                },
            )
            for name, seed in self.trainings
        ]

    def scoring(self) -> list[Job]:
        """Scores of networks and of what needs none, and the sliding test."""
        values, folder, grid = self.values, self.folder, self.values.grid
        common = {"every": values.scored_every, "marker_radius_px": self.study.marker_radius_px}
        frames = {"scored": sum(len(plan.moved_mm(grid)) for _, plans in self.parts for _, plan in _tests(plans))}
        networks = [
            Job(
                "score_network",
                {"generator": self.generator(name, seed), "sequences": self.sequences},
                {"scores": f"{folder}/scores/{{network}}_{{seed}}.csv"},
                common | {"network": name, "seed": seed},
                {"network": name, "seed": str(seed)},
                frames,
            )
            for name, seed in self.trainings
        ]
        others: dict[str, list[str]] = {
            str(name): [f"{folder}/baselines/{name}/{part}.nc" for part, plans in self.parts if _tests(plans)]
            for name in values.baselines
        }
        references = Job(
            "score_references",
            {"sequences": self.sequences, **others},
            {"scores": f"{folder}/scores/references.csv"},
            common | {"baselines": list(values.baselines)},
            work=frames,
        )
        first = list(values.networks.names)
        sliding = Job(
            "slide_objects",
            {
                "sequences": [f"{folder}/sliding/{name}.nc" for name in self.study.objects],
                "generators": [self.generator(name, self.values.networks.seeds[0]) for name in first],
            },
            {"table": f"{folder}/scores/sliding.csv"},
            {"networks": first, "marker_radius_px": self.study.marker_radius_px},
            work={"scored": len(self.study.objects) * 2 * 21 * (1 + len(first))},
        )
        return [*networks, references, sliding]

    def judging(self) -> list[Job]:
        """Tables, claims, figures and the page."""
        values, folder = self.values, self.folder
        table, facts = {name: f"{folder}/tables/{name}.csv" for name in TABLES}, f"{folder}/facts/data.json"
        scored = [f"{folder}/scores/{name}_{seed}.csv" for name, seed in self.trainings] + [f"{folder}/scores/references.csv"]
        judged = Job(
            "judge",
            {"scores": scored, "sliding": f"{folder}/scores/sliding.csv", "facts": facts},
            table,
            {"sources": self.sources, "trained": list(values.objects.train), "networks": list(values.networks.names)},
        )
        drawn, drag = self._drawing(table)
        page = Job(
            "report",
            {
                **{name: table[name] for name in ("table1", "table2", "by_object", "sliding", "claims")},
                "manifest": f"{folder}/dataset/manifest.csv",
                "facts": facts,
                "drag": f"{folder}/figures/sequences.html",
                "figures": [str(job.made()["png"]) for job in drawn.values()],
            },
            {"page": f"{folder}/report.html"},
            {
                "study": self.study.name,
                "size": values.networks.size,
                "pixels": self.study.pixels,
                "config": values.model_dump_json(indent=2),
            },
        )
        return [judged, *drawn.values(), drag, page]

    def _drawing(self, table: dict[str, str]) -> tuple[dict[str, Job], Job]:
        """The figures, and the page with sequences to drag; table: files of the tables."""
        folder = self.folder
        first, tested = list(self.values.networks.names), self._tested()
        generators = [self.generator(name, self.values.networks.seeds[0]) for name in first]
        shown = {"marker_radius_px": self.study.marker_radius_px, "shown": self.values.shown}
        errors = {"sources": self.sources, "trained": list(self.values.objects.train)}
        drawn = {
            "fig7_examples": Job(
                "draw_examples",
                {"sequences": tested, "generators": generators},
                figure_files(folder, "fig7_examples"),
                {"networks": first, **shown},
            ),
            "fig8_d": Job("draw_positions", {"scores": table["scores"]}, figure_files(folder, "fig8_d"), errors),
            "fig9_mse": Job("draw_likeness", {"scores": table["scores"]}, figure_files(folder, "fig9_mse"), errors),
            "fig10_sliding": Job(
                "draw_sliding", {"verdicts": table["sliding"]}, figure_files(folder, "fig10_sliding"), {"sources": self.sources}
            ),
            "training": Job(
                "draw_training",
                {"histories": [f"{folder}/learning/{name}/{seed}/history.csv" for name, seed in self.trainings]},
                figure_files(folder, "training"),
            ),
        }
        drag = Job(
            "drag_sequences",
            {"sequences": tested, "generator": generators[0]},
            {"html": f"{folder}/figures/sequences.html"},
            {"network": first[0], **shown},
        )
        return drawn, drag

    def _tested(self) -> list[str]:
        """Files that hold the sequences which figures show: of unseen objects first."""
        names = [*self.values.objects.test, *self.values.objects.train]
        files = {
            name: [
                file
                for (part, plans), file in zip(self.parts, self.sequences, strict=True)
                if plans[0][1].object == name and _tests(plans)
            ]
            for name in names
        }
        return [file for name in names for file in files[name]][: max(self.values.shown, 1)]


def _tests(plans: Numbered) -> Numbered:
    return [(number, plan) for number, plan in plans if plan.split != TRAIN]


def _parts_of(job: Job) -> tuple[Any, ...]:
    """What a job is made of, but for its stage."""
    return job.inputs, job.outputs, job.settings, job.wildcards, job.work
