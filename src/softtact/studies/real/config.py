"""The study on measured data of gels with a camera: its configuration."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from softtact.errors import InputError
from softtact.sensors.fields import plain_value
from softtact.studies.configuration import read_mapping, read_over, validated
from softtact.studies.hybrid.keys import Name
from softtact.unknown_names import Section

DEFAULT = "config/real.yaml"
MADE = "made"     # in place of a file: what the study draws itself
DATA_VARIABLE = "SOFTTACT_TEST_DATA"      # names the folder that holds gel/
_Assumable = BeforeValidator(plain_value)


class ForcePoint(Section):
    """A measured force."""

    depth_mm: PositiveFloat = Field(description="of the ball's lowest point below the surface at rest")
    force_n: PositiveFloat


class ForceVariant(Section):
    """What the press assumes of gel and contact."""

    bulk_over_shear: Annotated[PositiveFloat, _Assumable] = Field(description="K / mu0 of the neo-Hookean gel")
    friction: Annotated[NonNegativeFloat, _Assumable] = Field(description="of the ball; 5 stands for a bonded contact")
    element_mm: PositiveFloat = Field(description="width of the elements under the ball")
    radius_mm: PositiveFloat = Field(description="of the round gel that stands for the rectangular one")


class GelForce(Section):
    """The force of a ball on a gel, and what predicts it."""

    ball_mm: PositiveFloat = Field(description="radius of the ball")
    height_mm: PositiveFloat = Field(description="of the gel, bonded below")
    source: str = Field(description="of the measured points")
    points: Annotated[list[ForcePoint], Field(min_length=2)] = Field(description="measured; one modulus is fitted to all of them")
    check_points: list[ForcePoint] = Field([], description="measured, but never fitted: predicted with the modulus of all points")
    depths_mm: Annotated[list[PositiveFloat], Field(min_length=2)] = Field(description="rising, at which forces are computed")
    variants: Annotated[dict[Name, ForceVariant], Field(min_length=1)] = Field(description="assumptions by name")
    judged: Name = Field(description="the variant whose depths decide; the linear layer has its compressibility")


class MarkerPath(Section):
    """A press of the ball on the gel, all lengths over the gel's thickness."""

    ball_over_thickness: PositiveFloat
    friction: NonNegativeFloat
    bulk_over_shear: PositiveFloat = Field(description="K / mu0")


class Markers(Section):
    """The motion of markers under a ball."""

    image: str = Field(description="CSV with Mx, My, dx, dy in px below the data's folder; or made: drawn by the study itself")
    others: list[str] = Field(description="more CSVs, judged with the gel's parameters as found on the first; below the data's "
                                          "folder or paths")
    sheared: list[str] = Field(description="those of the others whose ball was moved aside")
    middle_px: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(description="column and row of the image's middle")
    centre_px: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(description="of the contact, seen in the image")
    ball_px: PositiveFloat = Field(description="radius of the ball")
    distance_px: PositiveFloat = Field(description="start value of the camera's distance")
    paths: Annotated[dict[Name, MarkerPath], Field(min_length=1)] = Field(description="by name; the one that fits best is taken")
    depths: Annotated[list[PositiveFloat], Field(min_length=2)] = Field(description="rising, over the gel's thickness")
    element: PositiveFloat = Field(description="width of the elements under the ball over its radius")


class ShadingSet(Section):
    """Labelled presses of a ball."""

    source: Literal["taxim", "fots", "made"] = Field(
        description="the wheel of PyPI, images of FOTS below the data's folder, or drawn by the study itself")
    name: str = Field("", description="of the wheel's calibration")
    ball_px: Annotated[PositiveFloat, _Assumable] = Field(description="radius of the ball")
    stated: bool = Field(False, description="whether the ball's size is known with the data")
    thickness_px: Annotated[PositiveFloat, _Assumable] = Field(description="of the gel")
    mm_per_px: Annotated[PositiveFloat, _Assumable]
    least_mae: PositiveFloat | None = Field(
        None, description="grey levels that the mean absolute error must not exceed; null: no limit")


class ShadingStudy(Section):
    """The shading, fitted to two thirds of each set and judged on the rest."""

    sets: dict[Name, ShadingSet]
    seeds: Annotated[list[int], Field(min_length=1)] = Field(description="of the splits")
    held_out: Annotated[float, Field(gt=0, lt=1)] = Field(description="share of the presses")
    tilt_degree: PositiveInt = Field(description="of the polynomials in the tilt")
    place_degree: PositiveInt = Field(description="of their coefficients in the place")
    rounds: PositiveInt = Field(description="of finding circles and fitting the shading in turn")
    ball_ratios: list[Annotated[float, Field(gt=0.2)]] = Field(
        description="balls' radii over the largest labelled circle, among which the size is searched")


class RealValues(Section):
    """The keys of config/real.yaml."""

    study: Name = Field(description="its name, and its folder below results/")
    kind: Literal["real"] = Field(exclude=True, description="of study")
    seed: Annotated[int, Field(ge=0)] = Field(description="of what the study draws itself")
    data: str | None = Field(description=f"folder that holds gel/ with the measured data; null: the environment's {DATA_VARIABLE}")
    taxim: str | None = Field(description="folder with the wheel taxim 1.4.1 of PyPI; null: pip downloads it")
    gel_force: GelForce
    markers: Markers
    shading: ShadingStudy

    @model_validator(mode="after")
    def _is_consistent(self):
        for name, values in (("gel_force.depths_mm", self.gel_force.depths_mm), ("markers.depths", self.markers.depths)):
            if values != sorted(set(values)):
                raise ValueError(f"{name} is {values}; write rising numbers")
        deepest = max(point.depth_mm for point in [*self.gel_force.points, *self.gel_force.check_points])
        if deepest > self.gel_force.depths_mm[-1]:
            last = self.gel_force.depths_mm[-1]
            raise ValueError(f"gel_force.depths_mm ends at {last:g} mm, before the point at {deepest:g} mm; add it")
        if self.gel_force.judged not in self.gel_force.variants:
            raise ValueError(f"gel_force.judged is {self.gel_force.judged!r}, which is no variant; name one of "
                             f"{', '.join(self.gel_force.variants)}")
        if unknown := [name for name in self.markers.sheared if name not in self.markers.others]:
            raise ValueError(f"markers.sheared has {unknown[0]!r}, which is not among markers.others; add it there")
        return self


@dataclass(frozen=True)
class RealStudy:
    """A checked configuration."""

    values: RealValues
    """The configuration."""

    @property
    def name(self) -> str:
        """The study's name, and its folder below results/."""
        return self.values.study


def read_values(path: str | Path) -> dict[str, Any]:
    """The configuration mapping of a file; what it does not state is as in config/real.yaml."""
    return read_over(DEFAULT, path)


def load_study(values: Mapping[str, Any], path: str | Path | None = None) -> RealStudy:
    """The `RealStudy` of a configuration mapping; keys that it leaves out are as in config/real.yaml."""
    return RealStudy(validated(RealValues, read_mapping(DEFAULT) | dict(values), where=str(path or "the configuration")))


def gel_files(folder: str | None, pattern: str) -> list[Path]:
    """Files of the measured data that fit a pattern, in order; none where they are missing, which the stage that reads tells."""
    place = folder or os.environ.get(DATA_VARIABLE)
    return sorted(path for path in Path(place, "gel").glob(pattern) if path.is_file()) if place else []


def gel_data(folder: str | None, file: str) -> Path:
    """A file of the measured data; raises InputError that says where to get it."""
    place = folder or os.environ.get(DATA_VARIABLE)
    if not place:
        raise InputError(f"{file}: no folder of measured data is stated; set `data` in the configuration or {DATA_VARIABLE} in the "
                         "environment to the folder that holds gel/.")
    path = Path(place, "gel", file)
    if not path.exists():
        raise InputError(f"{path}: there is no such file; copy it from github.com/Rancho-zhao/FOTS, commit 5bcde04, as "
                         "docs/how-to/real_gels.md says.")
    return path
