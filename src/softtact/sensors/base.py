"""Specifications of sensors: fields of all kinds, their files, and fields of sensors of layers (footprint, map, taxels)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt, PrivateAttr, ValidationError, model_serializer

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.sensors.fields import (
    CalibrationBlock,
    Edge,
    EdgeField,
    ElasticLayer,
    FiniteSection,
    Relaxation,
    Sides,
    SidesBelow,
    Taxels,
)
from softtact.unknown_names import Section, first_fault, known_keys, unknown

DEFAULT_KIND = "frusta"     # of a file that states none
_FEWEST_HELD = 7      # points of a map along a side that is held: the elastic model's stencil takes three elements of a quarter
FILES_OF_READOUTS = ("shading", "background")     # keys of readouts that name files


class ReadoutEntry(BaseModel):
    """A readout of a sensor: its `kind`, and the keys of that kind."""

    model_config = ConfigDict(extra="allow", frozen=True)
    kind: str = Field(description="one of the registered kinds: camera, capacitance, depth, markers, points, strip")


class Specification(FiniteSection):
    """Fields of a sensor of any kind; each class states its `kind` as a literal.

    readouts: the sensor's readouts by names of choice; by default those of its kind
    """

    name: str
    force_range_n: tuple[float, PositiveFloat]
    readouts: dict[str, ReadoutEntry] = {}
    _folder: Path = PrivateAttr(Path())

    @property
    def folder(self) -> Path:
        """Folder of the sensor's file, to which paths in it are relative."""
        return self._folder

    @property
    def stated_readouts(self) -> dict[str, ReadoutEntry]:
        """The readouts of the file, or else the default ones of the kind."""
        return self.readouts

    @property
    def has_layers(self) -> bool:
        """Whether it consists of layers with maps of their surface."""
        return False

    @property
    def paths(self) -> list[Path]:
        """All files of the sensor besides its YAML file."""
        named = [self.folder / str(value) for entry in self.readouts.values() for key, value in (entry.model_extra or {}).items()
                 if key in FILES_OF_READOUTS]
        return [path for path in named if path.is_file()]

    def need_layers(self) -> None:
        """Raise InputError if the sensor does not consist of layers."""

    def need_frusta(self, what: str, remedy: str) -> None:
        """Refuse `what`, in a sentence that ends in the remedy, where the sensor has no frusta."""

    def _found_in(self, folder: Path) -> None:
        """Store the folder of the sensor's file, to which its paths are relative."""
        if self.readouts:       # which alone need it: equal contents are equal sensors, from wherever they were read
            self._folder = folder

    def _check(self, where: str) -> None:
        """Refuse values that are valid one by one but not together."""
        low, high = self.force_range_n
        if low < 0 or low >= high:
            raise InputError(f"{where}, at 'force_range_n': {[low, high]} is no range; write [least, largest] in N.")
        for name in self.readouts:
            if not name or "/" in name:
                raise InputError(f"{where}, at 'readouts': a file of results cannot hold the name {name!r}; write it without '/'.")

    @model_serializer(mode="wrap")
    def _without_defaults(self, handler: Any) -> dict[str, Any]:
        values: dict[str, Any] = handler(self)
        return {name: value for name, value in values.items() if value or name not in ("readouts", "relaxation")}

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str = "sensor", folder: Path = Path()) -> Self:
        """Validate a mapping; the first fault becomes one sentence that names `where` and the field.

        folder: to which paths among the values are relative
        """
        kind = cls.model_fields["kind"].annotation.__args__[0]     # type: ignore[union-attr]
        if values.get("kind", DEFAULT_KIND) != kind:
            raise InputError(f"{where}, at 'kind': {values.get('kind', DEFAULT_KIND)!r} is not the required kind; give a "
                             f"sensor of kind {kind}.")
        try:
            spec = cls.model_validate(values)
        except ValidationError as error:
            raise InputError(sentence(cls, first_fault(error), where)) from None
        spec._found_in(folder)
        spec._check(where)
        return spec

    @classmethod
    def from_yaml(cls, path: str | Path) -> Self:
        """Read a sensor file of this kind."""
        return cls.from_dict(read_mapping(path), where=str(path), folder=Path(path).parent)


class BaseSpec(Specification):
    """Fields of sensors of layers, with or without frusta below.

    Frame: origin at the centre of the sensing surface, x and y along the sides, z outwards.
    """

    footprint_mm: Sides
    map_shape: tuple[PositiveInt, PositiveInt]
    largest_counts: PositiveFloat = Field(2400.0, description="of the readout's converter; pictures end there")
    taxels: Taxels | None = None
    elastic_layer: ElasticLayer
    edge: EdgeField = Edge()
    calibration: CalibrationBlock | None = None
    relaxation: Relaxation | None = Field(None, description="of the stiffness of the whole sensor; its moduli are the relaxed ones")

    @property
    def creep(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Shares (n,) of the deformation under a held force that come late, and their times (n,) in s; None where nothing creeps.

        From `relaxation`, or as its `calibration` found them.
        """
        if self.relaxation is not None:
            return self.relaxation.series.retardation()
        if self.calibration is None or not self.calibration.relaxation:
            return None
        return np.array(self.calibration.relaxation), np.array(self.calibration.relaxation_s)

    @property
    def thickness_mm(self) -> float:
        """Height of the sensing surface over the lower side: over the PCB, where the sensor lies on it."""
        raise NotImplementedError

    @property
    def upper_layer_mm(self) -> float:
        """Thickness of the upper layer."""
        raise NotImplementedError

    def with_upper_layer(self, thickness_mm: float) -> Self:
        """The sensor with another thickness of its upper layer, in the same shell: a thicker one protrudes further."""
        update = self._of_upper_layer(thickness_mm)
        if isinstance(self.edge.held, SidesBelow):
            below = self.edge.held.sides_below_mm + thickness_mm - self.upper_layer_mm
            update["edge"] = self.edge.model_copy(update={"held": SidesBelow(sides_below_mm=below)})
        return self.model_copy(update=update)

    def _of_upper_layer(self, thickness_mm: float) -> dict[str, Any]:
        """The changed fields of a sensor with another thickness of its upper layer."""
        raise NotImplementedError

    @property
    def held_height_mm(self) -> float:
        """Height of the layers, without frusta, whose side faces a shell can hold."""
        return self.thickness_mm

    @property
    def base_held(self) -> bool:
        """Whether the board carries the sensor from below; else its sides carry it."""
        return True

    @property
    def deepest_mm(self) -> float:
        """Largest descent (mm) of an object: to the board, or infinite without one."""
        return self.thickness_mm if self.base_held else np.inf

    @property
    def materials(self) -> dict[str, str]:
        """Names of the materials by layer, from below: dielectric, and cover where there is one."""
        raise NotImplementedError

    @property
    def frustum_height_mm(self) -> float:
        """Height of the frusta; nan without frusta."""
        return np.nan

    @property
    def parts_in_words(self) -> str:
        """Short description of the sensor's parts."""
        raise NotImplementedError

    @property
    def support_facts(self) -> dict[str, Any]:
        """Support of the sensor, and friction in the hyperelastic model, as attributes of a result."""
        raise NotImplementedError

    @property
    def map_x_mm(self) -> np.ndarray:
        """Columns of the deformation map, (33,) for the paper's sensor."""
        return np.linspace(-0.5, 0.5, self.map_shape[1]) * self.footprint_mm[0]

    @property
    def map_y_mm(self) -> np.ndarray:
        """Rows of the deformation map, (57,) for the paper's sensor."""
        return np.linspace(-0.5, 0.5, self.map_shape[0]) * self.footprint_mm[1]

    @property
    def in_words(self) -> str:
        """Name, size and counts in one line."""
        sides = " x ".join(f"{side:g}" for side in self.footprint_mm)
        taxels = f"{self.taxels.rows} x {self.taxels.columns} taxels" if self.taxels else "no taxels"
        return (f"{self.name}: {sides} mm, {self.parts_in_words}, {taxels}, "
                f"maps of {self.map_shape[0]} x {self.map_shape[1]} points")

    def check_for(self, kind: str) -> None:
        """Raise InputError if a model (elastic, foundation, hyperelastic) cannot press it: no frusta, or no middle row."""
        if kind == "foundation":
            self.need_frusta("the foundation model", "press with elastic or hyperelastic")
        if kind in ("elastic", "foundation") and not self.edge.far and not all(count % 2 for count in self.map_shape):
            raise InputError(f"{self.name}, at 'map_shape': {list(self.map_shape)} has no middle row and column, which the fast "
                             "models need; write odd numbers.")
        if kind == "elastic" and self.edge.held_below_mm == 0 and min(self.map_shape) < _FEWEST_HELD:
            raise InputError(f"{self.name}, at 'map_shape': {list(self.map_shape)} has fewer than {_FEWEST_HELD} points along a "
                             "side, which the elastic model needs where the edge holds the sides; write larger odd numbers.")

    @property
    def has_layers(self) -> bool:
        """Whether it consists of layers with maps of their surface."""
        return True

    @property
    def stated_readouts(self) -> dict[str, ReadoutEntry]:
        """The readouts of the file, by default the taxels' counts."""
        return self.readouts or ({"taxels": ReadoutEntry(kind="capacitance")} if self.taxels else {})

    def need_taxels(self, what: str) -> Taxels:
        """The taxels, which `what` needs; InputError where the sensor has none."""
        if self.taxels is None:
            raise InputError(f"{self.name} has no taxels, which {what} needs; add 'taxels: {{rows, columns}}' to its file, or "
                             "take a sensor that has them.")
        return self.taxels

    def _check(self, where: str) -> None:
        super()._check(where)
        if min(self.map_shape) < 2:
            raise InputError(f"{where}, at 'map_shape': {list(self.map_shape)} has a side with a single point, and a map has "
                             "points on opposite sides of the sensor; write at least 3.")
        below = self.edge.held_below_mm
        if np.isfinite(below) and below >= self.held_height_mm:
            raise InputError(f"{where}, at 'edge.held.sides_below_mm': {below:g} mm is not less than the height of the layers, "
                             f"{self.held_height_mm:g} mm, so nothing is held; make it smaller, or write 'held: free'.")
        if self.relaxation is not None:
            try:
                self.relaxation.series.retardation()
            except InputError as error:
                raise InputError(f"{where}, at 'relaxation': {str(error).removeprefix('prony: ')}") from None
        if self.calibration is not None:
            if self.relaxation is not None and self.calibration.relaxation:
                raise InputError(f"{where}, at 'relaxation': its calibration holds the creep that was measured; leave one of them "
                                 "out.")
            taxels = self.need_taxels("a calibration")
            if fault := self.calibration.fault(taxels.rows, taxels.columns):
                raise InputError(f"{where}: {fault}; calibrate the sensor again.")
        if not self.base_held and not np.isfinite(below):
            raise InputError(f"{where}, at 'edge.held': with support 'none' and free sides nothing holds the sensor; hold the "
                             "sides, or write support: base.")


def read_mapping(path: str | Path) -> dict[str, Any]:
    """The keys and values of a sensor file; one without any is refused."""
    values = read_yaml(Path(path), missing="there is no such sensor file.")
    if not isinstance(values, dict):
        raise InputError(f"{path}: a sensor file must hold keys and values; see docs/how-to/bring_your_sensor.md.")
    return values


def sentence(cls: type[Section], fault: Any, where: str) -> str:
    """The fault of a field of a file and its remedy, from pydantic's first fault."""
    field = ".".join(str(part) for part in fault["loc"])
    if fault["type"] == "extra_forbidden":
        *parents, last = fault["loc"]
        hint = unknown(last, known_keys(cls, parents), kind="key")
        return f"{where}{_at(parents)}: {hint}{'' if hint.endswith('?') else '.'}"
    if fault["type"] == "missing":
        return f"{where}: the key '{field}' is missing; add it."
    return f"{where}: field '{field}' is not usable: {fault['msg']}; correct it."


def _at(path: Sequence[str | int]) -> str:
    return f", at {'.'.join(map(str, path))!r}" if path else ""
