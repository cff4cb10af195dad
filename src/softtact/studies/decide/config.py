"""The study that decides the paper's claims: its configuration, and what it presses."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PositiveFloat, PositiveInt, model_validator

from softtact.errors import InputError
from softtact.geometry.generated import GeneratedObject, draw_objects
from softtact.readout.ssim import check_window
from softtact.sensors.fields import plain_value
from softtact.sensors.frusta import SensorSpec
from softtact.studies.configuration import found_sensor, here_or_shipped, read_mapping, read_over, refuse_unknown, validated
from softtact.studies.hybrid.keys import CatalogueEntry, Forces, Fraction, Law, Name, NotNegative, VirtualSensorKey
from softtact.studies.hybrid.objects import read_catalogue
from softtact.unknown_names import Section

DEFAULT = "config/decide.yaml"
ELASTIC, ELECTRODES, MATCHED, FOUNDATION, HYPERELASTIC = MODELS = (
    "elastic", "electrodes", "matched", "foundation", "hyperelastic")
CONTROLS = {"ceiling": HYPERELASTIC, "flipped": MATCHED}     # truths that are tested models
COMPARED = ELASTIC, MATCHED, HYPERELASTIC     # with each other in the controls: networks are trained for them alone there
INDENTERS = "indenters"
FORMULAS = GAP, QUADRATIC = "gap", "quadratic"      # readouts that are fitted
NETWORKS = COMPACT, PRINTED = "compact", "printed"


class Pressing(Section):
    """A mechanical model: what stands for the sensor's layers, and how it is discretised."""

    kind: Literal["elastic", "foundation", "hyperelastic"]
    law: Annotated[Law, BeforeValidator(plain_value)] | None = Field(
        None, description="of both layers, with its printed constants; none of the elastic layer")
    bulk_over_shear: Annotated[PositiveFloat, BeforeValidator(plain_value)] | None = Field(
        None, description="K / mu0 of both layers; by default that of the materials' files")
    friction: Annotated[NotNegative, BeforeValidator(plain_value)] = Field(
        0.0, description="of the object, and of frusta that are not bonded on the board")
    tips_bonded: bool = Field(True, description="whether frusta are bonded to the board")
    mesh: dict[str, Any] = Field({}, description="of the hyperelastic model, as in a hybrid study")
    young_mpa: PositiveFloat | Literal["printed", "matched"] = Field(
        "printed", description="of the elastic layer; matched: nearest to the hyperelastic model's maps of indenters")
    plane: Literal["surface", "electrodes"] = Field("surface", description="of the elastic layer whose movement is the map")

    @model_validator(mode="after")
    def _is_whole(self):
        if (self.kind == "elastic") == (self.law is not None):
            raise ValueError("the elastic layer has no law, the other kinds need one")
        return self


class Objects(Section):
    """The objects that decide, generated from the seed."""

    smooth: PositiveInt = Field(description="with one convex cap")
    stepped: PositiveInt = Field(description="with three features, of which one stands back")
    steps_mm: Annotated[list[PositiveFloat], Field(min_length=2, max_length=2)] = Field(
        description="[least, most] by which it stands back, spread evenly over the objects")
    remeshings: PositiveInt = Field(description="meshes of each object with the same surface, of which the rule counts the points")
    edges_mm: Annotated[list[PositiveFloat], Field(min_length=2, max_length=2)] = Field(
        description="[least, most] of the longest edge of a remeshing's facets, drawn evenly on a logarithmic scale")


class Trainings(Section):
    """The trainings of a network, alike for all models and truths."""

    seeds: PositiveInt
    epochs: PositiveInt
    batch: PositiveInt
    learning_rate: PositiveFloat
    controls: bool = Field(False, description="whether it is trained on the controls' readings, too, for the models compared there")
    curve: list[Fraction] = Field([], description="shares of the training indenters at which its first seed is trained anew")


class Learning(Section):
    """The readouts that are trained."""

    validation_share: Fraction = Field(description="of the indenters, whole objects: they choose the best epoch")
    truths: Annotated[list[Name], Field(min_length=1)] = Field(description="whose readings networks are trained on")
    compact: Trainings
    printed: Trainings | None = Field(None, description="the paper's network; null: none")
    device: Literal["auto", "cpu", "cuda"] = "auto"

    @property
    def networks(self) -> dict[str, Trainings]:
        """{architecture: its trainings} of those that are trained."""
        return {COMPACT: self.compact} | ({PRINTED: self.printed} if self.printed is not None else {})

    def truths_of(self, trained: Trainings) -> list[str]:
        """Whose readings a network is trained on, in order."""
        return list(dict.fromkeys([*self.truths, *(CONTROLS if trained.controls else [])]))


def pairs_of(truths: Iterable[str]) -> list[tuple[str, str]]:
    """(truth, model) of whose readings networks are trained on, and of whose maps, in order."""
    return [(truth, model) for truth in truths for model in (COMPARED if truth in CONTROLS else MODELS)]


class Assumed(Section):
    """What the power is computed from, stated before any score is known."""

    effect: PositiveFloat = Field(description="difference of two scores that matters")
    object_sd: NotNegative = Field(description="standard deviation of such differences between objects")
    seed_sd: NotNegative = Field(description="the same between trainings")


class Statistics(Section):
    """How verdicts are reached."""

    level: Fraction = Field(description="chance of a verdict on a claim where there is no difference, half of it for each side")
    least_objects: PositiveInt = Field(description="with fewer, every verdict is undecided")
    margin: PositiveFloat = Field(description="by which the hybrid's score may be worse than the hyperelastic model's")
    cost_share: PositiveFloat = Field(description="of the hyperelastic model's time that the hybrid may take")
    shown_share: Fraction = Field(description="of the raised features' deformation, above which a map shows the lower one")
    least_shown: PositiveInt = Field(description="objects whose truth shows it, below which nothing is said on details")
    power: Fraction = Field(description="that a test should have")
    assumed: Annotated[Assumed, BeforeValidator(plain_value)]


class Robustness(Section):
    """Truths of all combinations, on few objects, read by the gap formula."""

    laws: list[Law]
    bulk_over_shear: list[PositiveFloat]
    tips_bonded: list[bool]
    meshes: list[Literal["draft", "default", "stable", "fine"]]
    objects: PositiveInt = Field(description="of each kind, the first ones")
    forces_n: Forces = Field(description="among those of the study")


class DecideValues(Section):
    """The keys of config/decide.yaml."""

    study: Name = Field(description="its name, and its folder below results/")
    kind: Literal["decide"] = Field(exclude=True, description="of study")
    seed: Annotated[int, Field(ge=0)] = Field(description="of objects, virtual sensor, trainings and draws")
    sensor: str = Field(description="name or YAML file of the sensor, of kind frusta")
    catalogue: str = Field(description="YAML file that lists the indenters' meshes")
    indenters: list[str] | Literal["all"] = Field(description="names of the catalogue's set `indenters`, for training")
    objects: Objects
    forces_n: Forces = Field(description="load steps of every press")
    models: dict[Literal["elastic", "electrodes", "matched", "foundation", "hyperelastic"], Pressing] = Field(
        description="the tested models; all five")
    truths: Annotated[dict[Name, Pressing], Field(min_length=1)] = Field(description="what the virtual sensor feels, by name")
    virtual_sensor: dict[VirtualSensorKey, Any] = Field(description="as of a hybrid study")
    rule: dict[Literal["total", "overlap"], PositiveFloat] = Field(
        description="thresholds of the paper's rule, either of which asks for the hyperelastic model")
    tolerance_mm: Annotated[PositiveFloat, BeforeValidator(plain_value)] = Field(description="of the policy by expected error")
    scored: Literal["truth", "all"] = Field(
        description="at which load steps models are scored: where the truth holds, or where all tested models do, too")
    ssim_window: PositiveInt = Field(description="of both SSIMs, in taxels")
    learning: Learning
    statistics: Statistics
    robustness: Robustness
    collapse_young_mpa: list[PositiveFloat] = Field(description="further moduli of the elastic layer, pressed for the collapse")

    @model_validator(mode="after")
    def _agrees(self):
        missing = [name for name in MODELS if name not in self.models]
        if missing:
            raise ValueError(f"models has no {missing[0]!r}; the study compares {', '.join(MODELS)}: add it")
        for name in self.truths:
            if name in MODELS or name in CONTROLS:
                raise ValueError(f"truths has {name!r}, which names a model or a control; give it another name")
        for name in self.learning.truths:
            if name not in self.truths and name not in CONTROLS:
                raise ValueError(f"learning.truths has {name!r}, which is no truth; known: {', '.join([*self.truths, *CONTROLS])}")
        for force in self.robustness.forces_n:
            if force not in self.forces_n:
                raise ValueError(f"robustness.forces_n has {force:g} N, which is not among forces_n; add it there or leave it out")
        return self


@dataclass(frozen=True)
class DecideItem:
    """An indenter or an object."""

    id: str
    """Its name in paths."""
    set: str
    """indenters, smooth or stepped."""
    file: str
    """Its mesh in mm: of the catalogue, or the path below the results where the study writes it."""
    unit: str
    """Of the mesh."""
    made: GeneratedObject | None = None
    """What the study generates; None of an indenter."""


@dataclass(frozen=True)
class DecideStudy:
    """A checked configuration with what it presses."""

    values: DecideValues
    """The configuration."""
    spec: SensorSpec
    """The sensor."""
    indenters: list[DecideItem]
    """For training, in the catalogue's order."""

    @property
    def name(self) -> str:
        """The study's name, and its folder below results/."""
        return self.values.study

    @cached_property
    def objects(self) -> list[DecideItem]:
        """What decides: smooth objects first; files are relative to the results' folder."""
        wanted = self.values.objects
        drawn = draw_objects(wanted.smooth, wanted.stepped, steps_mm=wanted.steps_mm, side_mm=min(self.spec.footprint_mm),
                             seed=self.values.seed)
        return [DecideItem(one.name, "stepped" if one.stepped else "smooth", f"objects/{one.name}.stl", "mm", one) for one in drawn]

    @property
    def truths(self) -> dict[str, str]:
        """{truth: model whose presses it is}, the controls last."""
        return {name: name for name in self.values.truths} | CONTROLS

    @property
    def few_objects(self) -> list[DecideItem]:
        """Those of the map of robustness: the first smooth ones, and as many stepped ones spread over the steps."""
        count = self.values.robustness.objects
        smooth, stepped = ([item for item in self.objects if item.set == kind] for kind in ("smooth", "stepped"))
        places = [round(k * (len(stepped) - 1) / max(count - 1, 1)) for k in range(min(count, len(stepped)))]
        return smooth[:count] + [stepped[k] for k in dict.fromkeys(places)]

    def variants(self) -> Iterator[tuple[str, dict[str, Any], Pressing]]:
        """(name, what it varies, model) of each truth of the map of robustness."""
        wanted = self.values.robustness
        for law in wanted.laws:
            for ratio in wanted.bulk_over_shear:
                for bonded in wanted.tips_bonded:
                    for mesh in wanted.meshes:
                        varied = {"law": law, "bulk_over_shear": ratio, "tips_bonded": bonded, "mesh": mesh}
                        name = f"{law}_{ratio:g}_{'bonded' if bonded else 'free'}_{mesh}".replace(".", "p")
                        yield name, varied, Pressing.model_validate({"kind": "hyperelastic", **varied, "mesh": {"preset": mesh}})


def read_values(path: str | Path) -> dict[str, Any]:
    """The configuration mapping of a file; what it does not state is as in config/decide.yaml."""
    return read_over(DEFAULT, path)


def load_study(values: Mapping[str, Any], path: str | Path | None = None) -> DecideStudy:
    """The `DecideStudy` of a configuration mapping; keys that it leaves out are as in config/decide.yaml.

    Raises InputError that names file, field and remedy.
    """
    where = str(path or "the configuration")
    checked = validated(DecideValues, read_mapping(DEFAULT) | dict(values), where=where)
    spec = SensorSpec.from_yaml(found_sensor(checked.sensor))
    spec.check_for("foundation")
    check_window(checked.ssim_window, (spec.taxels.rows, spec.taxels.columns))
    low, high = spec.force_range_n
    if not low < checked.forces_n[0] <= checked.forces_n[-1] <= high:
        raise InputError(f"{where}, at 'forces_n': {checked.forces_n[0]:g} to {checked.forces_n[-1]:g} N is not within the range "
                         f"of {spec.name}, {low:g} to {high:g} N; leave out what is beyond.")
    return DecideStudy(checked, spec, _indenters(checked, read_catalogue(here_or_shipped(checked.catalogue)), where))



def _indenters(values: DecideValues, catalogue: Mapping[str, CatalogueEntry], where: str) -> list[DecideItem]:
    known = [name for name, entry in catalogue.items() if entry.set == INDENTERS]
    names = known if values.indenters == "all" else values.indenters
    for name in names:
        refuse_unknown(name, known, kind="indenter", where=f"{where}, at 'indenters'")
    return [DecideItem(name, INDENTERS, catalogue[name].file, catalogue[name].unit) for name in names]
