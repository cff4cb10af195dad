"""Kinds of values that sensor files are made of: plain, or stated with whether they are assumed and why."""

from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PositiveFloat, PositiveInt

T = TypeVar("T")


def plain_value(field: Any) -> Any:
    """Accept `{value, assumed, reason}` wherever a plain value stands."""
    if isinstance(field, dict) and "value" in field:
        extra = set(field) - {"value", "assumed", "reason"}
        if extra:
            raise ValueError(f"unknown key {sorted(extra)[0]!r} beside 'value'")
        if field.get("assumed") and not field.get("reason"):
            raise ValueError("an assumed value needs a reason")
        return field["value"]
    return field


class Section(BaseModel):
    """A part of a sensor file: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Stated(Section, Generic[T]):
    """A value with whether it is assumed, and why."""

    value: T
    assumed: bool = False
    reason: str = ""


def _or_stated(kind: Any) -> BeforeValidator:
    """What lets a `kind` of value stand as a `Stated` one in the file."""
    return BeforeValidator(plain_value, json_schema_input_type=kind | Stated[kind])


_NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Length = Annotated[PositiveFloat, _or_stated(PositiveFloat)]
Coefficient = Annotated[_NotNegative, _or_stated(_NotNegative)]
Flag = Annotated[bool, _or_stated(bool)]


class Taxels(Section):
    """Grid of electrodes on the PCB: `rows` along y, `columns` along x."""

    rows: PositiveInt
    columns: PositiveInt


class ElasticLayer(Section):
    """Constants of the single linear layer that stands for all layers in the elastic model."""

    young_mpa: PositiveFloat
    poisson: Annotated[float, Field(gt=-1.0, lt=0.5)]
