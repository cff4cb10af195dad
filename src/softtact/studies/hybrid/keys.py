"""The keys of a study's configuration, each with its type and description; `Values` is the whole configuration."""

import itertools
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, PositiveFloat, PositiveInt, field_validator, model_validator

from softtact.learning.settings import LearningCurve, Network, Repeats, Search, Ssim, Training
from softtact.materials.laws.registry import LAWS
from softtact.models.hyperelastic.mesh_settings import LARGEST_SCATTER
from softtact.published.archive import ARRANGEMENTS
from softtact.readout.virtual_sensor import VirtualSensorSettings
from softtact.sensors.specification import ORIENTATIONS
from softtact.unknown_names import Section, unknown

CENTRED = "centred"  # the pose for which an item has its object's name without a suffix


def _one_of(known, *, kind):
    """The type of a string that is one of the `known`."""

    def check(name):
        if name not in known:
            raise ValueError(unknown(name, known, kind=kind))
        return name

    return Annotated[str, AfterValidator(check)]


def _rising(values):
    if any(low >= high for low, high in itertools.pairwise(values)):
        raise ValueError("the values must rise from one to the next")
    return values


def _from_0_to_1(values):
    if (values[0], values[-1]) != (0, 1):
        raise ValueError("the values must rise from 0 to 1")
    return _rising(values)


Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Fraction = Annotated[float, Field(gt=0.0, lt=1.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Forces = Annotated[list[PositiveFloat], Field(min_length=1), AfterValidator(_rising)]
ForcesFromZero = Annotated[list[NotNegative], Field(min_length=1), AfterValidator(_rising)]
Heights = Annotated[list[float], Field(min_length=2), AfterValidator(_from_0_to_1)]
Scatter = Annotated[float, Field(ge=0.0, lt=LARGEST_SCATTER)]
Law = _one_of(LAWS, kind="law")
FrustumOrientation = _one_of(ORIENTATIONS, kind="orientation")
Arrangement = _one_of(ARRANGEMENTS, kind="arrangement")
VirtualSensorKey = _one_of(VirtualSensorSettings.__dataclass_fields__, kind="key")
Six = Annotated[list[float], Field(min_length=6, max_length=6)]


class Camera(Section):
    """The camera behind the acrylic plate of the contact-area test."""

    pixel_mm: PositiveFloat
    blur_mm: NotNegative
    noise: NotNegative
    falloff: NotNegative


class GlassMesh(Section):
    """Resolution of the frustum on glass; what is not stated is the default for its shape."""

    frustum_heights: Heights | None = Field(
        None, description="heights of its layers of elements, from 0 to 1")
    frustum_rings: PositiveInt | None = Field(None, description="rings of elements around its core, thin at its rim")
    refinement: Annotated[int, Field(ge=0)] | None = Field(None, description="how often all elements are split in the plane")


class Ftir(Section):
    """The dielectric pressed on glass, as a model and as a virtual specimen, and the camera behind the glass."""

    forces_n: ForcesFromZero = Field(description="on the whole dielectric")
    orientations: Annotated[list[FrustumOrientation], Field(min_length=1)] = Field(
        ["default", "as_printed"], description="of the printed frustum: its narrow or its wide end on the glass")
    laws: Annotated[list[Law], Field(min_length=1)] = Field(["mooney_rivlin", "ogden2"], description="each solves each orientation")
    constants: Literal["printed", "fitted"] = Field("printed", description="of the laws: as published, or the card's fit")
    orientation: FrustumOrientation = Field(
        "default", description="of the model under test and of the virtual specimen; one of `orientations`")
    law: Law = Field(description="of the model under test; one of `laws`")
    virtual_law: Law = Field(description="of the virtual specimen")
    height_scatter: NotNegative = Field(0.01, description="standard deviation of its frusta's heights, share of the height")
    tip_scatter: NotNegative = Field(0.02, description="the same of their tips' diameters")
    mesh: GlassMesh = Field(GlassMesh(), description="of cells whose narrow end stands on the glass")
    camera: Camera
    measured: str | None = Field(None, description="CSV with force_n, area_mm2 (mean frustum) of a measurement")

    @model_validator(mode="after")
    def _tests_what_it_solves(self):
        for key, chosen, among in (("orientation", self.orientation, self.orientations), ("law", self.law, self.laws)):
            if chosen not in among:
                raise ValueError(f"{key} {chosen!r} of the model under test is not among the {key}s {', '.join(among)}; add it")
        if not self.forces_n[-1] > 0:
            raise ValueError("forces_n holds 0 N only; add a force above")
        return self

    @field_validator("measured")
    @classmethod
    def _exists(cls, path):
        if path is not None and not Path(path).is_file():
            raise ValueError(f"there is no file {path}; give the path of the CSV, or null for the virtual dielectric")
        return path


class Thresholds(Section):
    """NPt >= total * CHt, NPo >= overlap * CHo."""

    total: PositiveFloat
    overlap: PositiveFloat


class Complexity(Section):
    """The rule that chooses the hyperelastic model for an object."""

    rule: Literal["any", "all"]
    thresholds: Thresholds


class Choice(Section):
    """The comparison of the policies that choose a model."""

    models: dict[Literal["elastic", "foundation", "hyperelastic"], Name] = Field(description="the study's model of each kind")
    tolerances_mm: Annotated[list[PositiveFloat], Field(min_length=1), AfterValidator(_rising)] = Field(
        description="errors that a user would accept, root mean square over the map")


class SectionPress(Section):
    """The press of figure 2 and of the report's interactive view: a large force, with the deformed body kept."""

    object: Name = Field(description="of the catalogue")
    force_n: PositiveFloat


class ItemSet(Section):
    """Objects of the catalogue, by name or `all` of a set, and the poses of each press: listed ones, then drawn ones."""

    names: list[Name] | Literal["all"]
    poses: dict[Name, Six | None] = Field({CENTRED: None}, min_length=1, description="of each: x, y, z in mm, then degrees")
    presses: PositiveInt | None = Field(None, description="in all; those beyond the listed poses are drawn for each object in turn")
    trials: PositiveInt | None = Field(None, description="readings of each press of this set; by default the study's `trials`")


class Objects(Section):
    """The pressed objects: training indenters, indenters outside the training, grasped objects."""

    catalogue: str
    indenters: ItemSet
    unseen: ItemSet
    grasps: ItemSet


class CatalogueEntry(Section):
    """One line of the catalogue: a mesh file beside it, the mesh's unit, and its set."""

    name: Name
    file: str
    unit: str
    set: Literal["indenters", "unseen", "grasps"]
    label: str


class Mesh(Section):
    """Resolution of a model's mesh, and the scatter of its frusta; other values are the model's defaults."""

    preset: Literal["default", "draft", "stable", "fine"] | None = Field(
        None, description="mesh and tolerances; the other keys override them (docs/explanation/discretisation.md)")
    sheet_layers: PositiveInt | None = None
    cover_heights: Heights | None = Field(
        None, description="heights of the cover's layers of elements, from 0 to 1")
    cover_splits: list[Annotated[int, Field(ge=0, le=5)]] | None = Field(
        None, description="for each of the uppermost layers, how often its elements, one pitch wide, are split under the object "
                          "and at its edges; lower layers, without a number here, keep the sheet's 2-D mesh")
    far_pitches: Literal[1, 2, 4] | None = Field(None, description="pitches that an element of the cover spans far from the object")
    frustum_heights: Heights | None = Field(
        None, description="heights of a frustum's layers of elements, from 0 to 1")
    frustum_rings: PositiveInt | None = Field(None, description="rings of elements around a frustum's core, thin at its rim")
    frustum_core: Annotated[float, Field(ge=0.3, le=0.8)] | None = Field(
        None, description="radius of this core's corners over the frustum's; with 0.5 frusta compress further than with 0.6")
    unprojected_penalty_ratio: NotNegative | None = Field(None, description="volumetric stiffness of frusta at each point, over mu")
    quartic_penalty_ratio: NotNegative | None = Field(
        None, description="stiffness of frusta against large volume changes that their elements' pressure misses, over mu")
    slab_quartic_penalty_ratio: NotNegative | None = Field(None, description="the same of sheet and cover")
    trilinear_pressure: bool | None = Field(None, description="pressure in the frusta's elements: trilinear (default), or linear")
    refinement: Annotated[int, Field(ge=0)] | None = Field(
        None, description="how often all elements are split into four in the plane")
    contact_stiffness: PositiveFloat | None = Field(None, description="N/mm3 of the contacts' penalty")
    constrained_cell_edges: bool | None = Field(
        None, description="constrain the sheet to one quadratic curve along all cell edges, not only far from the object: "
                          "half the work, an error of 2 to 2.5 % of the map; no effect on a refined 2-D mesh")
    largest_penetration_mm: PositiveFloat | None = Field(
        None, description="larger penetrations are reduced by augmented Lagrange iterations")
    relative_tolerance: Annotated[float, Field(gt=0, le=0.01)] | None = Field(
        None, description="largest unbalanced nodal force as a share of the force; 0.001 changes the map by 0.1 % (rms)")
    height_scatter: Scatter | None = Field(None, description="standard deviation, share of the height")
    tip_scatter: Scatter | None = Field(None, description="standard deviation, share of the tip's diameter")
    thickness_scatter: Annotated[float, Field(ge=0, le=0.1)] | None = Field(
        None, description="the same of sheet and cover, one thickness each for a specimen")
    specimen: Annotated[int, Field(ge=0)] | None = Field(None, description="seed of the scatter")


class ModelFriction(Section):
    """A model's coefficients of Coulomb friction, which replace the sensor's."""

    object: NotNegative = Field(0.0, description="of the object on the cover")
    board: NotNegative = Field(0.0, description="of the frusta on the board; needs tips that are not bonded")


class Model(Section):
    """One mechanical model of the sensor: its kind, its mesh, the law of each layer, and the files its presses start from."""

    kind: Literal["elastic", "foundation", "hyperelastic"] = "hyperelastic"
    mesh: Mesh = Mesh()
    laws: dict[Literal["dielectric", "cover"], Law] = {}
    friction: ModelFriction | None = Field(None, description="only of a hyperelastic model; by default the sensor's")
    device: Literal["cpu", "cuda", "auto"] = Field(
        "cpu", description="only of a hyperelastic model; where its elements are assembled; auto: a GPU if there is one")
    needs: list[Literal["mesh", "compliance", "card_dielectric", "card_cover"]] = []

    @property
    def prepared_from(self) -> list[str]:
        """The files from which its compliance is computed."""
        return ["frustum_law", "card_dielectric", "card_cover"] if self.kind == "foundation" else []


class Recording(Section):
    """A recording of one press of an item by a TSF-85, with its force."""

    item: Annotated[str, Field(pattern=r"^[a-z]+/[a-z0-9_-]+$")] = Field(description="SET/ITEM of the study, e.g. unseen/hexagon")
    file: str = Field(description="CSV of the maker's recorder")
    force_log: str = Field(description="CSV with time_s or Time(ms), and force_n, over the recording's time")
    finger: Literal[0, 1] = Field(0, description="that was pressed")
    baseline: Literal["auto", "subtracted", "kept"] = Field("auto", description="how the recorder wrote the readings")


class Data(Section):
    """The source of maps and readings.

    generated: presses, and the virtual sensor;  recorded: presses, and recordings of a real sensor;  published: both from the
    archive that the paper's authors published
    """

    source: Literal["generated", "recorded", "published"] = "generated"
    recordings: list[Recording] = Field([], description="if the source is recorded; several of an item are its trials")
    folder: str = Field("dataset", description="of the archive's CSV files (docs/how-to/published_archive.md)")
    variant: str | None = Field(None, description="ending of the files to read, e.g. V1, if there are several of a kind")
    unseen: list[Name] = Field([], description="the archive's indenters outside the training, e.g. donut_m for its DonutM")
    without: list[str] = Field([], description="tests, by their Path, and objects, by their item's name, that are not used")
    taxel_order: Arrangement = Field("rows", description="of tax1 to tax28 under the map; the import reports which fits best")
    outliers: Literal["leave_out", "refuse"] = Field("leave_out", description="what to do with tests that have outliers")
    largest_outlier_share: Annotated[float, Field(ge=0.0, le=1.0)] = Field(0.1, description="of tests that may be left out")

    @model_validator(mode="after")
    def _has_unseen_indenters(self):
        if self.source == "published" and not self.unseen:
            raise ValueError("'unseen' is empty; name indenters of the archive to leave out of the training")
        return self

    @model_validator(mode="after")
    def _uses_its_recordings(self):
        if self.recordings and self.source != "recorded":
            raise ValueError(f"'recordings' are listed, and the source is {self.source!r}, which reads none; write 'source: "
                             "recorded', or leave them out")
        return self


class Dataset(Section):
    """How samples are made and split."""

    train_fraction: Fraction
    split_by: Literal["map", "press", "object"] = Field("map", description="what goes to training or validation as a whole")
    training_trials: Literal["each", "mean"] = Field("each", description="a sample per trial, or one of their mean")


class Values(Section):
    """The whole configuration; `config/config.yaml` holds it with comments."""

    study: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", description="its name, and its folder below results/")]
    kind: Literal["hybrid"] = Field("hybrid", exclude=True, description="of study; other kinds: skin, palpation, grasps")
    seed: Annotated[int, Field(ge=0)] = Field(description="of drawn places, noise, splits and trainings")
    sensor: str = Field(description="name or YAML file of the sensor")
    materials: list[Name] = Field(description="names or YAML files of the materials whose laws are fitted")
    objects: Objects
    ftir: Ftir
    complexity: Complexity
    choice: Choice
    section: SectionPress
    forces_n: Forces = Field(description="load steps of every press; each gives a map")
    models: dict[Name, Model] = Field(description="the mechanical models by freely chosen names")
    tested: list[Name] = Field(min_length=1, description="models that a network is trained for")
    reference: Name = Field(description="the model whose presses the virtual sensor reads")
    virtual_sensor: dict[VirtualSensorKey, float | list[float]] = Field(
        description="sizes of its effects, in place of their defaults (docs/explanation/virtual_sensor.md)")
    trials: PositiveInt = Field(description="readings of each press by the virtual sensor")
    data: Data = Data()
    dataset: Dataset
    search: Search
    training: Training
    network: Network
    learning: Repeats = Repeats()
    learning_curve: LearningCurve = LearningCurve()
    ssim: Ssim
