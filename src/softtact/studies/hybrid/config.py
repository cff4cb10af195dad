"""A study's configuration, checked before any work starts.

`load_study` also reads the files that the configuration names (sensor, materials, objects), so that rules pass plain values to
their stages, and a changed comment in a YAML file reruns nothing. A sensor or a material is found by its name
(`softtact.sensors.library`); for a file below config/ that the working folder lacks, the one in the package is used.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from statistics import mean
from typing import Any

from softtact.errors import InputError
from softtact.materials.config import load_material
from softtact.progress import announce
from softtact.published.archive import SOURCE as PUBLISHED
from softtact.published.archive import Archive, find_archive
from softtact.readout.recorded_press import SOURCE as RECORDED
from softtact.readout.recording import COLUMNS, ROWS
from softtact.readout.ssim import check_window
from softtact.readout.virtual_sensor import VirtualSensorSettings, make_specimen
from softtact.sensors.library import is_shipped, material_file, sensor_file
from softtact.sensors.specification import SensorSpec
from softtact.studies.configuration import SHIPPED, here_or_shipped, read_mapping, refuse_unknown, validated
from softtact.studies.hybrid.keys import CENTRED, Data, Recording, Values
from softtact.studies.hybrid.objects import Item, check_shapes, items_of_set, make_item, read_catalogue

SETS = ("indenters", "unseen", "grasps")
TOGETHER = 50     # most presses of a fast model in one job: one minute of work, and a command line within the system's limit
_AT = "the configuration, at 'data.recordings'"
_LISTED = 8     # most items without a recording that a message lists


@dataclass(frozen=True)
class Study:
    """A checked configuration with the files that it names."""

    values: Values
    """The configuration."""
    spec: SensorSpec
    """The sensor."""
    materials: dict
    """{name: MaterialConfig}."""
    items_of: dict
    """{set: {id: Item}} in the order of the configuration."""
    section_item: Item
    """The item of figure 2."""
    archive: Archive | None = None
    """The published files with maps and readings, or None if items are pressed."""
    recordings: dict[str, list[Recording]] | None = None
    """{SET/ITEM: recordings with its readings}, or None."""

    @property
    def virtual(self) -> bool:
        """Whether the readings are those of the virtual sensor, made from the reference model's presses."""
        return self.archive is None and self.recordings is None

    @property
    def tested(self) -> list[str]:
        """The models that a network is trained for; of an archive, those with simulations."""
        return list(self.archive.simulated) if self.archive else self.values.tested

    @property
    def learnt_from(self) -> list[str]:
        """The models with data sets: those under test, and the reference if the virtual sensor reads it."""
        return list(dict.fromkeys([*self.tested, self.values.reference])) if self.virtual else self.tested

    @property
    def pressed_with(self) -> list[str]:
        """The models that press every item: those with data sets, and those that policies choose between."""
        return [] if self.archive else list(dict.fromkeys([*self.learnt_from, *self.values.choice.models.values()]))

    @property
    def source(self) -> str:
        """The source of the readings, in words."""
        return "virtual sensor" if self.virtual else PUBLISHED if self.archive else RECORDED

    @property
    def counts_per_relative_change(self) -> float | None:
        """Gain of the virtual sensor's readings; None for a real sensor, whose gain is unknown."""
        return VirtualSensorSettings.from_dict(self.values.virtual_sensor).counts_per_relative_change if self.virtual else None

    @property
    def name(self) -> str:
        """The study's name, and its folder below results/."""
        return self.values.study

    @property
    def sensor(self) -> dict[str, Any]:
        """The sensor's description as plain JSON values, without the reasons of assumed values."""
        return self.spec.model_dump(mode="json")

    def trials_of(self, set_name: str) -> float:
        """Number of readings of each press of a set; for recordings the mean over its items."""
        if self.recordings is None:
            return getattr(self.values.objects, set_name).trials or self.values.trials
        return mean(map(self.readings_of, self.items_of[set_name].values())) if self.items_of[set_name] else 0

    def readings_of(self, item: Item) -> int:
        """Number of readings of an item's press."""
        if self.recordings is not None:
            return len(self.recordings[f"{item.set}/{item.id}"])
        return getattr(self.values.objects, item.set).trials or self.values.trials

    def named(self) -> dict[str, Any]:
        """The contents of the named files as plain JSON values: the sensor, the materials' settings, the items of each set."""
        materials = {name: {"curves": material.curve_settings, "fit": material.fit_settings}
                     for name, material in self.materials.items()}
        items = {name: [asdict(item) for item in items.values()] for name, items in self.items_of.items()}
        return {"sensor": self.sensor, "materials": materials, "items": items, "section": asdict(self.section_item)}

    def items(self) -> list[Item]:
        """The items of all sets, in order."""
        return [item for items in self.items_of.values() for item in items.values()]

    def press_jobs(self, model: str) -> list[list[Item]]:
        """[[Item]]: the items that a model presses in each job, in the order of `items`.

        A fast model presses all places of an object in one job, because its start takes longer than a press. Each object has its
        jobs, so that a changed object reruns only these.
        """
        if self.values.models[model].kind == "hyperelastic":
            return [[item] for item in self.items()]
        places = [list(same) for _, same in groupby(self.items(), key=lambda item: (item.set, item.object))]
        return [same[first:first + TOGETHER] for same in places for first in range(0, len(same), TOGETHER)]


def read_values(configfile: str | Path | None = None, *, default: str | Path = "config/config.yaml") -> dict[str, Any]:
    """The configuration mapping of a file merged into the default one, as Snakemake does."""
    values = read_mapping(default)
    return values if configfile is None else _merged(values, read_mapping(configfile))


def _merged(base, over):
    return base | {key: _merged(base[key], value) if isinstance(base.get(key), dict) and isinstance(value, dict) else value
                   for key, value in over.items()}


def load_study(values: Mapping[str, Any], path: Path | None = None) -> Study:
    """The `Study` of a configuration mapping; raises an InputError of one sentence for the first fault.

    path: the file that it was read from; paths in a hybrid study are relative to the working folder, not to this file
    """
    checked = validated(Values, values, where="the configuration")
    spec = SensorSpec.from_yaml(_named("sensor", sensor_file, checked.sensor))
    _check_forces(checked, spec)
    materials = _materials(checked, spec)
    _check_models(checked, spec)
    _check_sensor(checked, spec)
    checked = _with_range(checked, spec)
    make_specimen(spec, seed=checked.seed, settings=VirtualSensorSettings.from_dict(checked.virtual_sensor))
    catalogue = read_catalogue(here_or_shipped(checked.objects.catalogue))
    items_of = {name: items_of_set(name, getattr(checked.objects, name), catalogue, spec=spec, seed=checked.seed) for name in SETS}
    check_shapes(items_of)
    study = Study(checked, spec, materials, items_of, _section_item(checked, catalogue), _archive(checked),
                  _recordings(checked.data, items_of, spec))
    _report_outside_paths(study)
    return study


def _named(key, find, name):
    """The file of a name in the configuration, from the library's function `find`; an error message names the key."""
    try:
        return find(name)
    except InputError as error:
        raise InputError(f"the configuration, at {key!r}: {str(error)[0].lower()}{str(error)[1:]}") from None


def _report_outside_paths(study):
    """Report on stderr the files of the configuration that lie outside the working folder."""
    values = study.values
    named = [("objects.catalogue", values.objects.catalogue), *((f"object {item.object}", item.file) for item in study.items()),
             *((f"material {name}", path) for name, config in study.materials.items() for path in config.measured_files),
             ("ftir.measured", values.ftir.measured), ("sensor", sensor_file(values.sensor)),
             ("data.folder", values.data.folder if values.data.source == "published" else None),
             *(("data.recordings", str(Path(path).parent)) for one in values.data.recordings for path in (one.file, one.force_log))]
    for what, path in dict.fromkeys(named):
        if path is None or is_shipped(path) or Path(path).is_relative_to(SHIPPED):
            continue
        if not Path(path).resolve().is_relative_to(Path.cwd().resolve()):
            announce(f"the configuration, at {what!r}: {path} lies outside this project, {Path.cwd()}; it is read from there.")


def _section_item(values, catalogue):
    """The item of the section's press, centred."""
    name = values.section.object
    refuse_unknown(name, list(catalogue), kind="object", where="the configuration, at 'section.object'")
    return make_item(catalogue[name], CENTRED, None, first=True)


def _archive(values):
    """The published files that the study reads, or None."""
    if values.data.source != "published":
        return None
    return find_archive(values.data.folder, models=values.tested, variant=values.data.variant)


def _recordings(data: Data, items_of: Mapping[str, Mapping[str, Any]], spec: SensorSpec) -> dict[str, list[Recording]] | None:
    """{SET/ITEM: recordings, its trials}, or None if the readings have another source.

    Raises InputError for a sensor with another grid, an unknown item, a file that is missing or listed twice, and an item without
    a recording.
    """
    if data.source != "recorded":
        return None
    if (spec.taxels.rows, spec.taxels.columns) != (ROWS, COLUMNS):
        raise InputError(f"{_AT}: the sensor {spec.name} has {spec.taxels.rows} x {spec.taxels.columns} taxels, and the TSF-85 "
                         f"{ROWS} x {COLUMNS}; name the sensor that was recorded, tsf85 say.")
    items = [f"{name}/{item}" for name, of_set in items_of.items() for item in of_set]
    for recording in data.recordings:
        refuse_unknown(recording.item, items, kind="item", where=_AT)
    _check_files(data.recordings)
    in_order = sorted(data.recordings, key=lambda one: one.item)
    found = {item: list(same) for item, same in groupby(in_order, key=lambda one: one.item)}
    missing = [item for item in items if item not in found]
    if missing:
        more = f" and {len(missing) - _LISTED} more" if len(missing) > _LISTED else ""
        raise InputError(f"{_AT}: there is no recording of {', '.join(missing[:_LISTED])}{more}; add one of each, or remove the "
                         "items from 'objects'.")
    return {item: found[item] for item in items}


def _check_files(recordings):
    """Refuse a missing file, and a finger of a recording that is listed for two presses."""
    seen: dict[tuple[Path, int], str] = {}
    for recording in recordings:
        for path in (recording.file, recording.force_log):
            if not Path(path).is_file():
                raise InputError(f"{_AT}: there is no file {path}, of {recording.item}; correct the path.")
        press = Path(recording.file).resolve(), recording.finger
        if press in seen:
            raise InputError(f"{_AT}: finger {recording.finger} of {recording.file} is listed for {seen[press]} and for "
                             f"{recording.item}, but a recording is of one press; remove one of the two.")
        seen[press] = recording.item


def _check_forces(values, spec):
    low, high = spec.force_range_n
    for key, force in [*(("forces_n", force) for force in values.forces_n), ("section.force_n", values.section.force_n)]:
        if not low < force <= high:
            raise InputError(f"the configuration, at '{key}': {force:g} N is out of the range of {spec.name}, above "
                             f"{low:g} and up to {high:g} N; leave it out or change the sensor's force_range_n.")


def _materials(values, spec):
    """{name: MaterialConfig} of the listed materials, which must include the sensor's."""
    for layer in (spec.dielectric, spec.cover):
        if layer.material not in values.materials:
            raise InputError(f"the configuration, at 'materials': sensor {spec.name} is made of {layer.material!r}, "
                             "which is not in the list; add it.")
    return {name: load_material(_named("materials", material_file, name)) for name in values.materials}


def _check_models(values, spec):
    for name in [*values.tested, values.reference, *values.choice.models.values()]:
        refuse_unknown(name, list(values.models), kind="model", where="the configuration, at 'models'")
    for name, model in values.models.items():
        where = f"the configuration, at 'models.{name}'"
        if model.friction and model.kind != "hyperelastic":
            raise InputError(f"{where}: a model of kind {model.kind!r} has no friction; leave 'friction' out.")
        if model.device != "cpu" and model.kind != "hyperelastic":
            raise InputError(f"{where}: a model of kind {model.kind!r} has no 'device'; leave it out.")
        if model.friction:
            SensorSpec.from_dict({**spec.model_dump(mode="json"), "friction": model.friction.model_dump()}, where=where)


def _check_sensor(values, spec):
    """Refuse early a sensor that a model or network of the study would refuse after hours, and a calibrated one."""
    if spec.calibration is not None:
        raise InputError(f"the configuration, at 'sensor': {spec.name} is calibrated, and a study draws its specimens and "
                         "their gain by 'virtual_sensor'; name the sensor that it was calibrated from.")
    for model in values.models.values():
        spec.check_for(model.kind)
    lost, shortest = 2 * max(len(values.network.filters), values.search.space.depth[1]), min(spec.map_shape)
    if shortest <= lost:
        raise InputError(f"{spec.name}, at 'map_shape': the printed and the searched network's layers take up to {lost} rows and "
                         f"columns, and the map has {shortest}; give it more points.")
    check_window(values.ssim.window, (spec.taxels.rows, spec.taxels.columns))


def _with_range(values, spec):
    """The configuration with the sensor's range of counts for the SSIM, unless it states another."""
    if "data_range" in values.ssim.model_fields_set:
        return values
    return values.model_copy(update={"ssim": values.ssim.model_copy(update={"data_range": spec.largest_counts})})
