"""Parts of sensor files: values, plain or with the reason for an assumption, and the blocks that kinds share."""

from typing import Annotated, Any, Generic, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, PositiveFloat, PositiveInt

from softtact.materials.prony import RELAXED, PronySeries
from softtact.unknown_names import Section

T = TypeVar("T")


def plain_value(field: Any) -> Any:
    """Accept `{value, assumed, reason}` in place of a plain value."""
    if isinstance(field, dict) and "value" in field:
        extra = set(field) - {"value", "assumed", "reason"}
        if extra:
            raise ValueError(f"unknown key {sorted(extra)[0]!r} beside 'value'")
        if field.get("assumed") and not field.get("reason"):
            raise ValueError("an assumed value needs a reason")
        return field["value"]
    return field


class FiniteSection(Section):
    """A section whose numbers are all finite."""

    model_config = ConfigDict(allow_inf_nan=False)


class Stated(FiniteSection, Generic[T]):
    """A value, whether it is assumed, and the reason."""

    value: T
    assumed: bool = False
    reason: str = ""


def _or_stated(kind: Any) -> BeforeValidator:
    """A validator that allows a `Stated` value in place of a plain one of a `kind`."""
    return BeforeValidator(plain_value, json_schema_input_type=kind | Stated[kind])


_NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_PoissonsRatio = Annotated[float, Field(gt=-1.0, lt=0.5)]
Length = Annotated[PositiveFloat, _or_stated(PositiveFloat)]
Sides = Annotated[tuple[PositiveFloat, PositiveFloat], _or_stated(tuple[PositiveFloat, PositiveFloat])]
Coefficient = Annotated[_NotNegative, _or_stated(_NotNegative)]
Flag = Annotated[bool, _or_stated(bool)]


class Taxels(FiniteSection):
    """Grid of electrodes on the PCB: `rows` along y, `columns` along x."""

    rows: PositiveInt
    columns: PositiveInt


class ElasticLayer(FiniteSection):
    """Constants of the single linear layer that stands for all layers in the elastic model."""

    young_mpa: Length
    poisson: Annotated[_PoissonsRatio, _or_stated(_PoissonsRatio)]


# --- support of a sensor's rim ---
#
# A rigid shell around the sensor, up to a stated height, which also carries an object wider than the sensor:
#     edge: {held: sides}                       the shell ends flush with the sensing surface: the whole side faces are held
#     edge: {held: {sides_below_mm: 1.5}}       the shell ends 1.5 mm below it: side faces are held from there down, free above
#     edge: {held: free}                        no shell: side faces are free
#     edge: {held: far}                         no shell, and side faces too far from every contact to matter (gels with a camera)
# The shell is rigid and as wide as `shell_width_mm`. An object that reaches over it comes down until it meets the shell's top,
# which carries all further force. So with `held: sides` a flat object wider than the sensor rests on the shell at first
# touch.


class SidesBelow(FiniteSection):
    """A shell that holds the side faces from a depth below the sensing surface on."""

    sides_below_mm: Length


def _held(value: Any) -> Any:
    """Refuse other values in one sentence; the errors of a pydantic union would name each of its members."""
    if isinstance(value, SidesBelow) or value in ("sides", "free", "far"):
        return value
    if not (isinstance(value, dict) and set(value) == {"sides_below_mm"}):
        raise ValueError(f"it is {value!r}; write sides, free, far, or {{sides_below_mm: h}} with h in mm")
    height = plain_value(value["sides_below_mm"])
    if isinstance(height, bool) or not isinstance(height, int | float) or not 0 < height < np.inf:
        raise ValueError(f"its sides_below_mm is {height!r}; give a height in mm above 0")
    return value


class Edge(FiniteSection):
    """Support of the rim: `held` is sides, free, far or {sides_below_mm: h}; each may also be given in place of the whole block."""

    held: Annotated[Literal["sides", "free", "far"] | SidesBelow, BeforeValidator(_held)] = "sides"
    shell_width_mm: Length = 2.0

    @property
    def held_below_mm(self) -> float:
        """Depth below the sensing surface from which side faces are held, the depth of the shell's top; infinite without shell."""
        if isinstance(self.held, SidesBelow):
            return self.held.sides_below_mm
        return 0.0 if self.held == "sides" else np.inf

    @property
    def in_words(self) -> str:
        """One clause for attributes of results."""
        if isinstance(self.held, SidesBelow):
            return f"sides held from {self.held.sides_below_mm:g} mm below the surface on"
        return {"sides": "sides held up to the surface", "free": "sides free", "far": "sides too far to matter"}[self.held]

    @property
    def far(self) -> bool:
        """Whether the sides are too far from every contact to matter: the elastic model then takes an infinitely wide layer."""
        return self.held == "far"


def _short(value: Any) -> Any:
    """`sides`, `free`, `far` and `{sides_below_mm: h}` in place of a whole `edge`."""
    if isinstance(value, str):
        return {"held": value}
    if isinstance(value, dict) and "sides_below_mm" in value and "held" not in value:
        return {"held": {"sides_below_mm": value["sides_below_mm"]}} | {k: v for k, v in value.items() if k != "sides_below_mm"}
    return value


EdgeField = Annotated[Edge, BeforeValidator(_short)]


# --- results of `softtact calibrate` for one sensor ---


Share = Annotated[float, Field(ge=0.0, lt=1.0)]


class Relaxation(FiniteSection):
    """Prony series by which the stiffness of a whole sensor relaxes; its moduli are those after a long time."""

    g: tuple[float, ...] = Field(description="shares of the instantaneous stiffness that relax")
    tau_s: tuple[float, ...] = Field(description="their times")

    @property
    def series(self) -> PronySeries:
        """The series. Raises InputError for shares and times that are none."""
        return PronySeries(self.g, self.tau_s, RELAXED)


class CalibrationBlock(FiniteSection):
    """counts = gain x counts_per_relative_change x dC/C0 + zero_counts, of each taxel; dC/C0 with the electrodes' edges and
    neighbours as in the virtual sensor.
    """

    gain: tuple[tuple[PositiveFloat, ...], ...] = Field(description="(rows, columns), as a share of the common one")
    zero_counts: tuple[tuple[float, ...], ...] = Field(description="(rows, columns), over the baseline")
    counts_per_relative_change: PositiveFloat
    relaxation: tuple[Share, ...] = Field((), description="shares of the deformation that creep in late")
    relaxation_s: tuple[PositiveFloat, ...] = Field((), description="their time constants")
    modulus_scale: PositiveFloat = Field(1.0, description="of the moduli of all layers, over those of the materials' files")
    noise_counts: float = Field(0.0, ge=0.0, description="of one reading, standard deviation")
    source: str = ""
    not_identifiable: tuple[str, ...] = ()
    standard_deviations: dict[str, float] = {}

    def fault(self, rows: int, columns: int) -> str | None:
        """The first fault for a sensor with `rows` and `columns` of taxels; None where all fits."""
        for name in ("gain", "zero_counts"):
            values = getattr(self, name)
            if len(values) != rows or any(len(row) != columns for row in values):
                return f"'calibration.{name}' has not {rows} rows of {columns} numbers, as the sensor has taxels"
        if len(self.relaxation) != len(self.relaxation_s):
            return "'calibration.relaxation' and 'calibration.relaxation_s' are not of one length"
        return "'calibration.relaxation' sums to 1 or more" if sum(self.relaxation) >= 1 else None
