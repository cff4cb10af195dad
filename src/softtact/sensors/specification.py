"""The sensor as its YAML file describes it: sizes in mm, layers, frusta, taxels. No mechanics."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, PositiveInt, ValidationError

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.unknown_names import first_fault, known_keys, unknown

# How the frustum's two printed diameters are read: the narrow end, or (as the words of the text have it) the wide one as the tip.
ORIENTATIONS = ("default", "as_printed")
T = TypeVar("T")


def _at(path: Sequence[str | int]) -> str:
    return f", at {'.'.join(map(str, path))!r}" if path else ""


def _plain_value(field: Any) -> Any:
    """Accept `{value, assumed, reason}` wherever a plain value stands."""
    if isinstance(field, dict) and "value" in field:
        extra = set(field) - {"value", "assumed", "reason"}
        if extra:
            raise ValueError(f"unknown key {sorted(extra)[0]!r} beside 'value'")
        if field.get("assumed") and not field.get("reason"):
            raise ValueError("an assumed value needs a reason")
        return field["value"]
    return field


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Stated(_Strict, Generic[T]):
    """A value with whether it is assumed, and why."""

    value: T
    assumed: bool = False
    reason: str = ""


def _or_stated(kind: Any) -> BeforeValidator:
    """What lets a `kind` of value stand as a `Stated` one in the file."""
    return BeforeValidator(_plain_value, json_schema_input_type=kind | Stated[kind])


_NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Length = Annotated[PositiveFloat, _or_stated(PositiveFloat)]
Coefficient = Annotated[_NotNegative, _or_stated(_NotNegative)]
Flag = Annotated[bool, _or_stated(bool)]


class Frusta(_Strict):
    """Conical frusta below the sheet, on a square lattice centred on the sensor."""

    height_mm: Length
    tip_diameter_mm: Length
    root_diameter_mm: Length
    pitch_mm: Length


class Dielectric(_Strict):
    """Sheet with frusta; `relative_permittivity` of its solid."""

    material: str
    frusta: Frusta
    sheet_thickness_mm: Length
    relative_permittivity: Length = 3.5


class Cover(_Strict):
    """Cover and conductive fabric as one layer."""

    material: str
    thickness_mm: Length


class Taxels(_Strict):
    """Grid of electrodes on the PCB: `rows` along y, `columns` along x."""

    rows: PositiveInt
    columns: PositiveInt


class Friction(_Strict):
    """Coefficients of Coulomb friction of the object on the cover and of the frusta on the board, in the hyperelastic model."""

    object: Coefficient = 0.0
    board: Coefficient = 0.0


class ElasticLayer(_Strict):
    """Constants of the single linear layer that stands for all layers in the elastic model."""

    young_mpa: PositiveFloat
    poisson: Annotated[float, Field(gt=-1.0, lt=0.5)]


class SensorSpec(_Strict):
    """A layered sensor. Frame: origin at the centre of the sensing surface, x and y along the sides, z outwards."""

    name: str
    footprint_mm: tuple[PositiveFloat, PositiveFloat]
    map_shape: tuple[PositiveInt, PositiveInt]
    force_range_n: tuple[float, PositiveFloat]
    largest_counts: PositiveFloat = Field(2400.0, description="of the readout's converter; pictures end there")
    taxels: Taxels
    dielectric: Dielectric
    cover: Cover
    tips_bonded: Flag = True
    friction: Friction = Friction()
    elastic_layer: ElasticLayer

    def with_frustum_orientation(self, reading: str) -> "SensorSpec":
        """The same sensor with the `default` reading of its frustum's diameters, the narrow end as tip, or `as_printed`."""
        narrow, wide = sorted((self.dielectric.frusta.tip_diameter_mm, self.dielectric.frusta.root_diameter_mm))
        tip, root = {"default": (narrow, wide), "as_printed": (wide, narrow)}[reading]
        frusta = self.dielectric.frusta.model_copy(update={"tip_diameter_mm": tip, "root_diameter_mm": root})
        return self.model_copy(update={"dielectric": self.dielectric.model_copy(update={"frusta": frusta})})

    @property
    def thickness_mm(self) -> float:
        """Height of the sensing surface over the PCB."""
        return self.dielectric_thickness_mm + self.cover.thickness_mm

    @property
    def dielectric_thickness_mm(self) -> float:
        """Height of the electrode plane (top of the dielectric) over the PCB."""
        return self.dielectric.frusta.height_mm + self.dielectric.sheet_thickness_mm

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
        sides, frusta = " x ".join(f"{side:g}" for side in self.footprint_mm), " x ".join(map(str, self.frusta_counts))
        return (f"{self.name}: {sides} mm, {frusta} frusta, {self.taxels.rows} x {self.taxels.columns} taxels, "
                f"maps of {self.map_shape[0]} x {self.map_shape[1]} points")

    def check_for(self, kind: str) -> None:
        """Refuse a map or a lattice that a model of this kind (elastic, foundation, hyperelastic) cannot take by its quarters."""
        if kind in ("elastic", "foundation") and not all(count % 2 for count in self.map_shape):
            raise InputError(f"{self.name}, at 'map_shape': {list(self.map_shape)} has no middle row and column, which the fast "
                             "models ask for; write odd numbers.")
        if kind == "foundation" and any(count % 2 for count in self.frusta_counts):
            raise InputError(f"{self.name}: its lattice of {self.frusta_counts[0]} x {self.frusta_counts[1]} frusta has a row in "
                             "the middle; the foundation model wants even numbers; change the pitch or the footprint a little.")

    @property
    def frusta_counts(self) -> tuple[int, ...]:
        """How many frusta fit along x and y."""
        pitch = self.dielectric.frusta.pitch_mm
        return tuple(int(np.floor(side / pitch + 1e-9)) for side in self.footprint_mm)

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str = "sensor") -> "SensorSpec":
        """Validate a mapping; the first fault becomes one sentence that names `where` and the field."""
        try:
            spec = cls.model_validate(values)
        except ValidationError as error:
            fault = first_fault(error)
            field = ".".join(str(part) for part in fault["loc"])
            if fault["type"] == "extra_forbidden":
                *parents, last = fault["loc"]
                said = unknown(last, known_keys(cls, parents), kind="key")
                raise InputError(f"{where}{_at(parents)}: {said}{'' if said.endswith('?') else '.'}") from None
            if fault["type"] == "missing":
                raise InputError(f"{where}: the key '{field}' is missing; add it.") from None
            raise InputError(f"{where}: field '{field}' is not usable: {fault['msg']}; correct it.") from None
        if min(spec.frusta_counts) < 1:
            raise InputError(f"{where}: no frustum of pitch {spec.dielectric.frusta.pitch_mm} mm fits on the footprint "
                             f"{spec.footprint_mm} mm; enlarge the footprint or reduce the pitch.")
        if spec.tips_bonded and spec.friction.board > 0:
            raise InputError(f"{where}: bonded tips cannot slide with a friction of {spec.friction.board:g} on the board; "
                             "set 'tips_bonded' to false, or 'friction.board' to 0.")
        return spec

    @classmethod
    def from_yaml(cls, path: str | Path) -> "SensorSpec":
        """Read a sensor file."""
        path = Path(path)
        values = read_yaml(path, missing="there is no such sensor file.")
        if not isinstance(values, dict):
            raise InputError(f"{path}: a sensor file must hold keys and values; see docs/how-to/bring_your_sensor.md.")
        return cls.from_dict(values, where=str(path))
