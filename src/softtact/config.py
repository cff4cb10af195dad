"""The study's configuration: every key typed, described in place and checked before any work starts.

`load_study` is the one way in. It also reads the files that the configuration names (sensor, materials, objects), so
that rules hand their stages plain values, and a comment in a YAML file reruns nothing.
"""

import itertools
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    ValidationError,
    field_validator,
    model_validator,
)

from softtact.errors import InputError
from softtact.evaluation.ssim import check_window
from softtact.files import read_yaml
from softtact.geometry.sensor_spec import READINGS, SensorSpec
from softtact.learning.settings import LearningCurve, Network, Search, Ssim, Training
from softtact.materials.config import load_material
from softtact.materials.laws.registry import LAWS
from softtact.progress import announce
from softtact.published.archive import SOURCE as PUBLISHED
from softtact.published.archive import Archive, find_archive
from softtact.published.arrangement import ARRANGEMENTS
from softtact.sensing.virtual_sensor import VirtualSensorSettings, make_specimen
from softtact.unknown_names import first_fault, known_keys, unknown

PROJECT = Path(__file__).resolve().parents[2]
SETS = ("indenters", "unseen", "grasps")
CENTRED = "centred"  # the pose that gives an item its object's plain name


def _one_of(known, *, kind):
    """A string among the `known` ones."""

    def check(name):
        if name not in known:
            raise ValueError(unknown(name, known, kind=kind))
        return name

    return Annotated[str, AfterValidator(check)]


def _rising(values):
    if any(low >= high for low, high in itertools.pairwise(values)):
        raise ValueError("the values must rise from one to the next")
    return values


Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Fraction = Annotated[float, Field(gt=0.0, lt=1.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Forces = Annotated[list[PositiveFloat], Field(min_length=1), AfterValidator(_rising)]
ForcesFromZero = Annotated[list[NotNegative], Field(min_length=1), AfterValidator(_rising)]
Law = _one_of(LAWS, kind="law")
Reading = _one_of(READINGS, kind="reading")
Arrangement = _one_of(ARRANGEMENTS, kind="arrangement")
VirtualSensorKey = _one_of(VirtualSensorSettings.__dataclass_fields__, kind="key")
Six = Annotated[list[float], Field(min_length=6, max_length=6)]


class Section(BaseModel):
    """A mapping of the configuration whose keys are all known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Camera(Section):
    """The camera behind the acrylic plate of the contact-area test."""

    pixel_mm: PositiveFloat
    blur_mm: NotNegative
    noise: NotNegative
    falloff: NotNegative


class GlassMesh(Section):
    """Resolution of the frustum on glass; what is not said is the default for its shape."""

    frustum_levels: Annotated[list[float], AfterValidator(_rising)] | None = Field(
        None, description="heights of its layers of elements, from 0 to 1")
    frustum_rings: PositiveInt | None = Field(None, description="rings of elements around its core, thin at its rim")
    refinement: Annotated[int, Field(ge=0)] | None = Field(None, description="how often all elements are split in plan")


class Ftir(Section):
    """The dielectric pressed on glass, as a model and as a virtual specimen, and the camera that looks at it."""

    forces_n: ForcesFromZero = Field(description="on the whole dielectric")
    readings: Annotated[list[Reading], Field(min_length=1)] = Field(
        ["default", "as_printed"], description="of the printed frustum: its narrow or its wide end on the glass")
    laws: Annotated[list[Law], Field(min_length=1)] = Field(["mooney_rivlin", "ogden2"], description="each solves each reading")
    constants: Literal["printed", "fitted"] = Field("printed", description="of the laws: as published, or the card's fit")
    reading: Reading = Field("default", description="of the model under test and of the virtual specimen; one of `readings`")
    law: Law = Field(description="of the model under test; one of `laws`")
    virtual_law: Law = Field(description="of the virtual specimen")
    height_scatter: NotNegative = Field(0.01, description="standard deviation of its frusta's heights, share of the height")
    tip_scatter: NotNegative = Field(0.02, description="the same of their tips' diameters")
    mesh: GlassMesh = Field(GlassMesh(), description="of cells whose narrow end stands on the glass")
    camera: Camera
    measured: str | None = Field(None, description="CSV with force_n, area_mm2 (mean frustum) of one's own test")

    @model_validator(mode="after")
    def _tests_what_it_solves(self):
        for key, chosen, among in (("reading", self.reading, self.readings), ("law", self.law, self.laws)):
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
    """When an object asks for the hyperelastic model."""

    rule: Literal["any", "all"]
    thresholds: Thresholds


class Choice(Section):
    """How the policies that choose a model are compared."""

    models: dict[Literal["elastic", "foundation", "hyperelastic"], Name] = Field(description="the study's model of each kind")
    tolerances_mm: Annotated[list[PositiveFloat], Field(min_length=1), AfterValidator(_rising)] = Field(
        description="errors that a user would accept, root mean square over the map")


class SectionPress(Section):
    """The press that figure 2 and the report's turning view show: a large force, with the deformed body kept."""

    object: Name = Field(description="of the catalogue")
    force_n: PositiveFloat


class ItemSet(Section):
    """Objects of the catalogue, by name or `all` of a set, and the poses in which each is pressed: listed ones, then drawn ones."""

    names: list[Name] | Literal["all"]
    poses: dict[Name, Six | None] = Field({CENTRED: None}, min_length=1, description="of each: x, y, z in mm, then degrees")
    presses: PositiveInt | None = Field(None, description="in all; those beyond the listed poses are drawn for each object in turn")
    trials: PositiveInt | None = Field(None, description="readings of each press of this set; by default the study's `trials`")


class Objects(Section):
    """What is pressed: training indenters, indenters that training never sees, grasped objects."""

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
    """Resolution of a model's mesh, and the scatter of its frusta; what is not said is the model's own default."""

    sheet_layers: PositiveInt | None = None
    cover_levels: Annotated[list[float], AfterValidator(_rising)] | None = Field(
        None, description="heights of the cover's layers of elements, from 0 to 1")
    cover_splits: list[Annotated[int, Field(ge=0, le=4)]] | None = Field(
        None, description="how often each of these layers' elements, a pitch wide, are split under the object and at its edges")
    far_pitches: Literal[1, 2, 4] | None = Field(None, description="pitches that an element of the cover spans far from the object")
    frustum_levels: Annotated[list[float], AfterValidator(_rising)] | None = Field(
        None, description="heights of a frustum's layers of elements, from 0 to 1")
    frustum_rings: PositiveInt | None = Field(None, description="rings of elements around a frustum's core, thin at its rim")
    local_over_shear: NotNegative | None = Field(None, description="volumetric stiffness of frusta at each point, over mu")
    growing_over_shear: NotNegative | None = Field(
        None, description="stiffness of frusta against large volume changes that their elements' pressure misses, over mu")
    trilinear_pressure: bool | None = Field(None, description="pressure in the frusta's elements: trilinear (default), or linear")
    refinement: Annotated[int, Field(ge=0)] | None = Field(
        None, description="how often all elements are split into four in plan")
    contact_stiffness: PositiveFloat | None = Field(None, description="N/mm3 of the contacts' penalty")
    coarse_walls: bool | None = Field(
        None, description="along all walls between cells, not only far from the object, the sheet moves as one quadratic curve: "
                          "half the work, and 2 to 2.5 % of the map; without effect in a refined plan")
    largest_penetration_mm: PositiveFloat | None = Field(None, description="deeper overlaps in contacts are pressed apart")
    height_scatter: NotNegative | None = Field(None, description="standard deviation, share of the height")
    tip_scatter: NotNegative | None = Field(None, description="standard deviation, share of the tip's diameter")
    thickness_scatter: Annotated[float, Field(ge=0, le=0.1)] | None = Field(
        None, description="the same of sheet and cover, one thickness each for a specimen")
    specimen: Annotated[int, Field(ge=0)] | None = Field(None, description="seed of the scatter")


class OwnFriction(Section):
    """A model's own coefficients of Coulomb friction, in place of the sensor's."""

    object: NotNegative = Field(0.0, description="of the object on the cover")
    board: NotNegative = Field(0.0, description="of the frusta on the board; needs tips that are not held")


class Model(Section):
    """One mechanical model of the sensor: its kind, its mesh, the law of each layer, and the files its presses start from."""

    kind: Literal["elastic", "foundation", "hyperelastic"] = "hyperelastic"
    mesh: Mesh = Mesh()
    laws: dict[Literal["dielectric", "cover"], Law] = {}
    friction: OwnFriction | None = Field(None, description="only of a hyperelastic model; by default the sensor's")
    needs: list[Literal["mesh", "compliance", "card_dielectric", "card_cover"]] = []

    @property
    def prepared_from(self):
        """What its compliance is computed from."""
        return ["frustum_law", "card_dielectric", "card_cover"] if self.kind == "foundation" else []


class Data(Section):
    """Where maps and readings come from: presses and the virtual sensor, or the archive that the paper's authors published."""

    source: Literal["generated", "published"] = "generated"
    folder: str = Field("dataset", description="of the archive's CSV files (docs/published_archive.md)")
    variant: str | None = Field(None, description="ending of the files to read, V1 say, where there are several of a kind")
    unseen: list[Name] = Field([], description="the archive's indenters that training never sees, donut_m for its DonutM")
    without: list[str] = Field([], description="tests, by their Path, and objects, by their item's name, that are not used")
    taxel_order: Arrangement = Field("rows", description="of tax1 to tax28 under the map; the import says which one fits best")
    odd: Literal["leave_out", "refuse"] = Field("leave_out", description="tests that are odd")
    largest_odd_share: Annotated[float, Field(ge=0.0, le=1.0)] = Field(0.1, description="of tests that may be left out")

    @model_validator(mode="after")
    def _has_unseen_indenters(self):
        if self.source == "published" and not self.unseen:
            raise ValueError("'unseen' is empty; name indenters of the archive that training must not see")
        return self


class Dataset(Section):
    """How samples are made and split."""

    train_fraction: Fraction
    split_by: Literal["map", "press", "object"] = Field("map", description="what goes to training or validation as a whole")
    training_trials: Literal["each", "mean"] = Field("each", description="a sample per trial, or one of their mean")


class Values(Section):
    """The whole configuration; `config/config.yaml` holds it with comments."""

    study: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]
    seed: Annotated[int, Field(ge=0)]
    sensor: str
    materials: list[Name]
    objects: Objects
    ftir: Ftir
    complexity: Complexity
    choice: Choice
    section: SectionPress
    forces_n: Forces
    models: dict[Name, Model]
    tested: list[Name] = Field(min_length=1, description="models that a network is trained for")
    reference: Name
    virtual_sensor: dict[VirtualSensorKey, float | list[float]]
    trials: PositiveInt
    data: Data = Data()
    dataset: Dataset
    search: Search
    training: Training
    network: Network
    learning_curve: LearningCurve = LearningCurve()
    ssim: Ssim


@dataclass(frozen=True)
class Item:
    """One object in one pose: what a press presses. `id` names it in paths; `first` is its object's first pose."""

    id: str
    set: str
    object: str
    file: str
    unit: str
    label: str
    pose: list[float] | None
    first: bool


@dataclass(frozen=True)
class Study:
    """A checked configuration with the files that it names.

    values: the configuration;  spec: the sensor
    materials: {name: MaterialConfig};  items_of: {set: {id: Item}} in the order of the configuration
    section_item: what figure 2 presses
    archive: the published files that maps and readings come from, or None where they are generated
    """

    values: Values
    spec: SensorSpec
    materials: dict
    items_of: dict
    section_item: Item
    archive: Archive | None = None

    @property
    def tested(self):
        """The models that a network is trained for: of an archive, those whose simulations are there."""
        return list(self.archive.simulated) if self.archive else self.values.tested

    @property
    def learnt_from(self):
        """The models whose maps data sets are made of: those under test, and the reference, as if a model were perfect."""
        return self.tested if self.archive else list(dict.fromkeys([*self.tested, self.values.reference]))

    @property
    def pressed_with(self):
        """The models that every item is pressed with: those learnt from, and those that policies choose between."""
        return [] if self.archive else list(dict.fromkeys([*self.learnt_from, *self.values.choice.models.values()]))

    @property
    def source(self):
        """What the readings are from, in words."""
        return PUBLISHED if self.archive else "virtual sensor"

    @property
    def name(self):
        """The study's name, and its folder below results/."""
        return self.values.study

    @property
    def sensor(self):
        """The sensor's description as plain JSON values; what is assumed, and why, is left out."""
        return self.spec.model_dump(mode="json")

    def trials_of(self, set_name):
        """How often the virtual sensor reads each press of a set."""
        return getattr(self.values.objects, set_name).trials or self.values.trials

    def named(self):
        """What the configuration names, as plain JSON values: the sensor, the materials' settings, the items of each set."""
        materials = {name: {"curves": material.curve_settings, "fit": material.fit_settings}
                     for name, material in self.materials.items()}
        items = {name: [asdict(item) for item in items.values()] for name, items in self.items_of.items()}
        return {"sensor": self.sensor, "materials": materials, "items": items, "section": asdict(self.section_item)}

    def items(self):
        """The items of all sets, in order."""
        return [item for items in self.items_of.values() for item in items.values()]


def read_values(configfile=None, *, default="config/config.yaml"):
    """The configuration mapping of a file over the default one, merged as Snakemake does it."""
    values = _read_yaml(Path(default))
    return values if configfile is None else _merged(values, _read_yaml(Path(configfile)))


def _merged(base, over):
    return base | {key: _merged(base[key], value) if isinstance(base.get(key), dict) and isinstance(value, dict) else value
                   for key, value in over.items()}


def _read_yaml(path):
    """A mapping of a YAML file; what is none is refused."""
    values = read_yaml(path, missing="there is no such configuration; give the path of one, from the project's folder.")
    if not isinstance(values, dict):
        raise InputError(f"{path}: it holds no keys; write a configuration such as config/tiny.yaml.")
    return values


def sensor_file(name, *, folder=None):
    """The YAML file of a sensor, given by its path or by its name in `folder`/sensors.

    folder: by default config/ where the command runs, else the project's own
    """
    if Path(name).suffix in (".yaml", ".yml"):
        return Path(name)
    here = Path("config")
    folder = folder or (here if (here / "sensors").is_dir() else PROJECT / "config")
    return _existing(Path(folder, "sensors"), name, kind="sensor")


def load_study(values, *, folder="config"):
    """The `Study` of a configuration mapping; the first fault becomes an `InputError` of one sentence.

    folder: where sensors/ and materials/ lie
    """
    checked = _validated(Values, values, where="the configuration")
    spec = SensorSpec.from_yaml(sensor_file(checked.sensor, folder=folder))
    _check_forces(checked, spec)
    materials = _materials(checked, spec, Path(folder, "materials"))
    _check_models(checked, spec)
    _check_sensor(checked, spec)
    checked = _with_range(checked, spec)
    make_specimen(spec, seed=checked.seed, settings=VirtualSensorSettings.from_dict(checked.virtual_sensor))
    catalogue = read_catalogue(Path(checked.objects.catalogue))
    items_of = {name: _items(name, getattr(checked.objects, name), catalogue, spec=spec, seed=checked.seed) for name in SETS}
    _check_shapes(items_of)
    study = Study(checked, spec, materials, items_of, _section_item(checked, catalogue), _archive(checked))
    _say_outside_paths(study, folder)
    return study


def _say_outside_paths(study, folder):
    """Say on stderr which files of the configuration lie outside the folder that the study runs in."""
    values = study.values
    named = [("objects.catalogue", values.objects.catalogue), *((f"object {item.object}", item.file) for item in study.items()),
             *((f"material {name}", path) for name, config in study.materials.items() for path in config.measured_files),
             ("ftir.measured", values.ftir.measured), ("sensor", sensor_file(values.sensor, folder=folder)),
             ("data.folder", values.data.folder if values.data.source == "published" else None)]
    for what, path in dict.fromkeys(named):
        if path is not None and not Path(path).resolve().is_relative_to(Path.cwd().resolve()):
            announce(f"the configuration, at {what!r}: {path} lies outside this project, {Path.cwd()}; it is read from there.")


def _section_item(values, catalogue):
    """The item that the section's press presses, centred."""
    name = values.section.object
    _refuse_unknown(name, list(catalogue), kind="object", where="the configuration, at 'section.object'")
    return _item(catalogue[name], CENTRED, None, first=True)


def _archive(values):
    """The published files that the study reads, or None."""
    if values.data.source == "generated":
        return None
    return find_archive(values.data.folder, models=values.tested, variant=values.data.variant)


def _validated(model, values, *, where):
    """`model` from plain values; the first fault becomes an `InputError` naming the field and the remedy."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise InputError(_fault_sentence(model, first_fault(error), where=where)) from None


def _fault_sentence(model, fault, *, where):
    """One sentence for a fault of pydantic's."""
    *parents, last = fault["loc"] or ("",)
    section = f"{where}, at {'.'.join(map(str, parents))!r}" if parents else where
    if fault["type"] == "missing":
        return f"{section}: the key {last!r} is missing; add it."
    if fault["type"] == "extra_forbidden":
        return _sentence(f"{section}: {unknown(last, known_keys(model, parents), kind='key')}")
    at = ".".join(str(part) for part in fault["loc"] if part != "[key]")
    given = "" if isinstance(fault["input"], dict) else f" (it is {fault['input']!r:.60})"
    return _sentence(f"{where}, at {at!r}{given}: {fault['msg'].removeprefix('Value error, ')}")


def _existing(folder, name, *, kind):
    """The YAML file of `name` in a folder; an unknown name is refused with the nearest right one."""
    _refuse_unknown(name, sorted(path.stem for path in folder.glob("*.yaml")), kind=kind, where=str(folder))
    return folder / f"{name}.yaml"


def _refuse_unknown(name, known, *, kind, where):
    if name not in known:
        raise InputError(_sentence(f"{where}: {unknown(name, known, kind=kind)}"))


def _sentence(text):
    return text if text.endswith(("?", ".")) else f"{text}."


def _check_forces(values, spec):
    low, high = spec.force_range_n
    for key, force in [*(("forces_n", force) for force in values.forces_n), ("section.force_n", values.section.force_n)]:
        if not low < force <= high:
            raise InputError(f"the configuration, at '{key}': {force:g} N is out of the range of {spec.name}, above "
                             f"{low:g} and up to {high:g} N; leave it out or change the sensor's force_range_n.")


def _materials(values, spec, folder):
    """{name: MaterialConfig} of the listed materials, among which the sensor's own must be."""
    for layer in (spec.dielectric, spec.cover):
        if layer.material not in values.materials:
            raise InputError(f"the configuration, at 'materials': sensor {spec.name} is made of {layer.material!r}, "
                             "which is not in the list; add it.")
    return {name: load_material(_existing(folder, name, kind="material")) for name in values.materials}


def _check_models(values, spec):
    for name in [*values.tested, values.reference, *values.choice.models.values()]:
        _refuse_unknown(name, list(values.models), kind="model", where="the configuration, at 'models'")
    for name, model in values.models.items():
        where = f"the configuration, at 'models.{name}'"
        if model.friction and model.kind != "hyperelastic":
            raise InputError(f"{where}: a model of kind {model.kind!r} knows no friction; leave 'friction' out.")
        if model.friction:
            SensorSpec.from_dict({**spec.model_dump(mode="json"), "friction": model.friction.model_dump()}, where=where)


def _check_sensor(values, spec):
    """Refuse now a sensor that a model or a network of the study would refuse after hours."""
    for model in values.models.values():
        spec.check_for(model.kind)
    lost, shortest = 2 * max(len(values.network.filters), values.search.space.depth[1]), min(spec.map_shape)
    if shortest <= lost:
        raise InputError(f"{spec.name}, at 'map_shape': the printed and the searched network's layers take up to {lost} rows and "
                         f"columns, and the map has {shortest}; give it more points.")
    check_window(values.ssim.window, (spec.taxels.rows, spec.taxels.columns))


def _with_range(values, spec):
    """The configuration with the sensor's range of counts as that of the SSIM, unless it says another."""
    if "data_range" in values.ssim.model_fields_set:
        return values
    return values.model_copy(update={"ssim": values.ssim.model_copy(update={"data_range": spec.largest_counts})})


def read_catalogue(path):
    """{name: CatalogueEntry} with the mesh files' paths as seen from here; a missing mesh is refused now."""
    lines = read_yaml(path, missing="there is no such catalogue of objects; correct 'objects.catalogue'.")
    entries = [_validated(CatalogueEntry, line, where=str(path)) for line in lines or []]
    entries = [entry.model_copy(update={"file": str(path.parent / entry.file)}) for entry in entries]
    return {entry.name: entry for entry in entries}


def _items(set_name, chosen, catalogue, *, spec, seed):
    """{id: Item} of one set: each object in its poses, the listed ones and those that are drawn."""
    known = [name for name, entry in catalogue.items() if entry.set == set_name]
    names = known if chosen.names == "all" else chosen.names
    where = f"the configuration, at 'objects.{set_name}'"
    for name in names:
        _refuse_unknown(name, known, kind=f"object of set {set_name}", where=where)
    drawn = _dealt(chosen, len(names), where=where)
    items = {}
    for entry, count in zip((catalogue[name] for name in names), drawn, strict=True):
        poses = chosen.poses | _drawn(entry, count, spec=spec, seed=seed)
        made = [_item(entry, pose_name, pose, first=k == 0) for k, (pose_name, pose) in enumerate(poses.items())]
        items |= {item.id: item for item in made}
    return items


def _check_shapes(items_of):
    """Refuse a mesh that stands in two sets, be it under two names: a test must not hold a shape that training saw."""
    seen = {}
    for item in (item for items in items_of.values() for item in items.values() if item.first):
        other = seen.setdefault(Path(item.file).read_bytes(), item)
        if other.set != item.set:
            raise InputError(f"{item.file}: {item.object!r} of the set {item.set} has the same mesh as {other.object!r} of the set "
                             f"{other.set}; leave one of the two out.")


def _dealt(chosen, objects, *, where):
    """How many poses are drawn for each object of a set, so that there are as many presses as it says."""
    listed = objects * len(chosen.poses)
    more = (chosen.presses or listed) - listed
    if more < 0:
        raise InputError(f"{where}: presses is {chosen.presses}, and {objects} objects in {len(chosen.poses)} listed poses are "
                         f"{listed}; give that many or more, or leave 'presses' out.")
    return [more // objects + (k < more % objects) for k in range(objects)]


def _drawn(entry, count, *, spec, seed):
    """{"1": pose, ...} of an object, `count` of them; they depend on the seed, its name and its mesh."""
    if not count:
        return {}
    from softtact.geometry.meshes import read_triangles
    from softtact.geometry.places import draw_poses

    _check_mesh(entry)
    poses = draw_poses(read_triangles(entry.file, unit=entry.unit), count=count, footprint_mm=spec.footprint_mm,
                       seed=[seed, zlib.crc32(entry.name.encode())])
    return {str(k): pose for k, pose in enumerate(poses, start=1)}


def _check_mesh(entry):
    if not Path(entry.file).is_file():
        raise InputError(f"{entry.file}: there is no such mesh, which the catalogue names for {entry.name!r}; "
                         "put it there or correct the line.")


def _item(entry, pose_name, pose, *, first):
    _check_mesh(entry)
    suffix = "" if pose_name == CENTRED else f"-{pose_name}"
    return Item(entry.name + suffix, entry.set, entry.name, entry.file, entry.unit, entry.label + suffix, pose,
                first)
