"""The YAML file of a palpation sensor: an elastic beam on two supports with a soft filler between them, and tissue and jaw above.

Lengths are in mm, forces in N, moduli in MPa. x runs along the beam from the left support's outer end, y up from the base.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from pydantic import Field

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.materials.config import validated
from softtact.materials.laws.base import Law
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants
from softtact.sensors.fields import FiniteSection

Positive = Annotated[float, Field(gt=0)]
Length = Annotated[float, Field(ge=0.05, le=1000)]
_SOFT_MPA, _STIFF_MPA = 20.0, 1e6     # largest Young's modulus of a tissue or filler, and of supports and beam: diamond's
_MOST_STEPS, _MOST_ELEMENTS = 1000, 200_000
_STIFFEST = 1e4         # lump, over its tissue
EDGE_LINES = (1, 3)     # times `mesh.edge`: distances of lines of the mesh from the supports' inner edges, to both sides
_ROUNDING_MM = 1e-9
REGIONS = ("left support", "right support", "filler", "beam", "tissue")


class Material(FiniteSection):
    """A material: constants of a law and K, or mu and K, or E and nu, of a neo-Hookean law."""

    law: str = "neo_hooke"
    parameters: dict[str, float] | None = Field(None, description="of the law, MPa or 1")
    shear_mpa: Positive | None = Field(None, description="mu of W = mu/2 (I1bar - 3) + kappa/2 (J - 1)^2")
    bulk_mpa: Positive | None = Field(None, description="kappa")
    young_mpa: Positive | None = None
    poisson: float | None = Field(None, gt=-1, lt=0.5)
    stretch_window: tuple[Positive, Positive] | None = Field(None, description="lowest and highest principal stretch of its data")
    assumed: bool = False
    source: str = Field(min_length=1, description="source of the constants, or why they are assumed")

    @pydantic.model_validator(mode="after")
    def _stated_once(self):
        names = ("parameters", "shear_mpa", "bulk_mpa", "young_mpa", "poisson")
        given = {name for name in names if getattr(self, name) is not None}
        if given not in ({"parameters", "bulk_mpa"}, {"shear_mpa", "bulk_mpa"}, {"young_mpa", "poisson"}):
            raise ValueError("give shear_mpa and bulk_mpa, young_mpa and poisson, or parameters and bulk_mpa")
        if self.law != "neo_hooke" and self.parameters is None:
            raise ValueError(f"the law {self.law} needs its parameters")
        if self.stretch_window and not self.stretch_window[0] < 1 < self.stretch_window[1]:
            low, high = self.stretch_window
            raise ValueError(f"stretch_window is from {low:g} to {high:g}; give the lowest principal stretch of the data, below 1, "
                             "and the highest, above 1")
        return self

    def make(self) -> Law:
        """The `Law`. Raises InputError for constants that a law does not allow."""
        if self.young_mpa is not None and self.poisson is not None:
            linear = LinearConstants(self.young_mpa, self.poisson)
            law = make_law("neo_hooke", {"c10": linear.mu_mpa / 2}, bulk_modulus=linear.bulk_modulus_mpa)
        else:
            parameters = self.parameters if self.shear_mpa is None else {"c10": self.shear_mpa / 2}
            law = make_law(self.law, parameters or {}, bulk_modulus=self.bulk_mpa)
        law.stretch_window = self.stretch_window
        return law


class Geometry(FiniteSection):
    """Sizes in mm."""

    support_length: Length
    support_height: Length
    filler_length: Length
    beam_height: Length
    tissue_height: Length
    depth: Length = Field(description="out of the plane")

    @property
    def length(self) -> float:
        """Of beam and tissue: both supports and the filler."""
        return 2 * self.support_length + self.filler_length

    @property
    def middle(self) -> float:
        """x of the beam's middle."""
        return 0.5 * self.length

    @property
    def levels(self) -> tuple[float, float, float, float]:
        """y of the base, the beam's bottom and top, and the tissue's top."""
        beam = self.support_height + self.beam_height
        return 0.0, self.support_height, beam, beam + self.tissue_height


class Film(FiniteSection):
    """A force-sensing film on the top or the bottom of a part."""

    on: Literal["left support", "right support", "filler", "beam"]
    side: Literal["top", "bottom"]
    start: float = Field(description="x of its left end")
    end: float
    assumed: bool = False
    source: str = Field(min_length=1)


class Steps(FiniteSection):
    """Equal steps up to a final value."""

    to: Annotated[float, Field(gt=0, le=1000)]
    by: Positive

    @pydantic.model_validator(mode="after")
    def _not_too_many(self):
        if self.to / self.by > _MOST_STEPS:
            raise ValueError(f"steps of {self.by:g} up to {self.to:g} are {self.to / self.by:.0f}, more than {_MOST_STEPS}; make "
                             "them larger")
        return self

    @property
    def values(self) -> np.ndarray:
        """The values at the ends of the steps; the last one is `to`."""
        return np.linspace(0, self.to, max(1, round(self.to / self.by)) + 1)[1:]


class Lump(FiniteSection):
    """A rectangular inclusion in the tissue."""

    x: float = Field(description="of its middle")
    depth: Positive = Field(description="of its middle below the jaw's face of the tissue")
    width: Positive
    height: Positive
    stiffness_ratio: Annotated[float, Field(gt=0, le=_STIFFEST)] = Field(description="its moduli over those of the tissue")


class Hardness(FiniteSection):
    """The study of relative hardness over load and tissue height."""

    tissue_heights: list[Positive] = Field(min_length=1)
    shares: list[Annotated[float, Field(gt=0, le=1)]] = Field(min_length=2, description="of the jaw's displacement in a sweep")
    steps: int = Field(8, ge=4, le=_MOST_STEPS)

    @pydantic.model_validator(mode="after")
    def _enough(self):
        if min(self.shares) * self.steps < 3:
            raise ValueError(f"the least share {min(self.shares):g} of {self.steps} steps leaves fewer than three; give more steps")
        return self


class LumpSearch(FiniteSection):
    """The study of a hidden lump: a table of film forces over its place, depth and stiffness, and estimates from it."""

    tissue: str
    width: Positive
    height: Positive
    x: list[float] = Field(min_length=4, description="places along the left half; the right half is their mirror image")
    depth: list[Positive] = Field(min_length=4)
    stiffness_ratio: list[Annotated[float, Field(gt=1, le=_STIFFEST)]] = Field(min_length=3, description="plain tissue, 1, is "
                                                                                                         "solved as well")
    jaw_mm: list[Positive] = Field(min_length=1, description="rising displacements at which the films are read")
    noise_n: Positive = Field(description="standard deviation of a film's reading")
    moves: list[float] = Field([0.0], min_length=1, description="displacement in mm of the sensor back along the tissue for each "
                               "press, from the first place on: a lump's x is larger by it")
    trials: int = Field(20, ge=1, le=100_000)
    seed: int = Field(0, ge=0)
    assumed: bool = False
    source: str = Field(min_length=1)

    @pydantic.model_validator(mode="after")
    def _rises(self):
        for name in ("x", "depth", "stiffness_ratio", "jaw_mm"):
            values = getattr(self, name)
            if any(b <= a for a, b in zip(values, values[1:], strict=False)):
                raise ValueError(f"{name} is {values}; give rising values")
        return self


class MeshSizes(FiniteSection):
    """Sides of the quadratic elements in mm."""

    along: Positive = 2.0
    tissue: Positive = 2.0
    base: Positive = 1.25
    edge: Positive | None = Field(None, description="first elements beside the supports' inner edges, where the beam bends most")
    beam_layers: int = Field(2, ge=2, multiple_of=2, description="elements across the beam, an even number: its middle has nodes")
    depth_layers: int = Field(2, ge=1, description="elements across the depth of a solid")


class PalpationDesign(FiniteSection):
    """A palpation sensor, the tissues that it presses and the sweeps."""

    name: str = Field(pattern=r"^[a-z0-9_]+$", validation_alias=pydantic.AliasChoices("study", "name"))
    kind: Literal["palpation"] = "palpation"
    model: Literal["plane_strain", "solid"] = "plane_strain"
    geometry: Geometry
    supports: Material
    filler: Material
    beam: Material
    tissues: dict[str, Material] = Field(min_length=1)
    jaw: Literal["bonded", "sliding"] = "bonded"
    tissue_on_beam: Literal["bonded"] | Annotated[float, Field(ge=0)] = Field("bonded", description="or Coulomb's coefficient")
    beam_on_base: Literal["bonded"] | Annotated[float, Field(ge=0)] = Field("bonded", description="likewise")
    films: dict[str, Film] = Field(min_length=1)
    load_n: Steps
    displacement_mm: Steps
    mesh: MeshSizes = MeshSizes()
    lump: Lump | None = None
    variants: dict[str, dict[str, Any]] = Field(default_factory=dict, description="designs with other values of some keys, by name")
    variant_steps: int = Field(6, ge=3, le=_MOST_STEPS, description="steps of the jaw's displacement in a variant")
    hardness: Hardness | None = None
    search: LumpSearch | None = None

    @pydantic.model_validator(mode="after")
    def _fits(self):
        if self.tissue_on_beam != "bonded" and self.beam_on_base != "bonded":
            raise ValueError("the beam is loose on both sides; set tissue_on_beam or beam_on_base to bonded")
        for name, film in self.films.items():
            low, high = self.span(film.on)
            if not low <= film.start < film.end <= high:
                raise ValueError(f"the film {name} from {film.start:g} to {film.end:g} mm does not lie on the {film.on}, which "
                                 f"reaches from {low:g} to {high:g} mm")
        if self.displacement_mm.to >= self.geometry.tissue_height:
            raise ValueError(f"the jaw's displacement of {self.displacement_mm.to:g} mm is more than the tissue's height; make it "
                             "smaller")
        longest = self.geometry.support_length / max(EDGE_LINES)
        if self.mesh.edge and self.mesh.edge > longest + _ROUNDING_MM:     # the mesh would be longer than the sensor
            raise ValueError(f"mesh.edge is {self.mesh.edge:g} mm, and lines {max(EDGE_LINES)} times as far from the inner edges "
                             f"would lie outside of the supports of {self.geometry.support_length:g} mm; give a third of that, "
                             f"{longest:.4g} mm, or less")
        if (count := self._elements()) > _MOST_ELEMENTS:
            raise ValueError(f"the mesh would have {count:.2g} elements, more than {_MOST_ELEMENTS:,}; make its sides longer")
        if self.lump:
            self._lump_fits(self.lump)
        if self.search and self.search.tissue not in self.tissues:
            raise ValueError(f"search.tissue is {self.search.tissue!r}, which is none of {', '.join(self.tissues)}")
        return self

    def _elements(self):
        """About how many elements the mesh has."""
        g, mesh = self.geometry, self.mesh
        layers = g.support_height / mesh.base + mesh.beam_layers + g.tissue_height / mesh.tissue
        return g.length / mesh.along * layers * (mesh.depth_layers if self.model == "solid" else 1)

    def _lump_fits(self, lump):
        half, height = 0.5 * lump.width, 0.5 * lump.height
        if not (half < lump.x < self.geometry.length - half and height < lump.depth < self.geometry.tissue_height - height):
            raise ValueError(f"the lump at x = {lump.x:g} mm in a depth of {lump.depth:g} mm leaves the tissue; move it, or "
                             "make it smaller")

    def span(self, part: str) -> tuple[float, float]:
        """x of a part's ends."""
        g = self.geometry
        return {"left support": (0.0, g.support_length), "filler": (g.support_length, g.support_length + g.filler_length),
                "right support": (g.support_length + g.filler_length, g.length)}.get(part, (0.0, g.length))

    def tissue(self, name: str) -> Material:
        """A tissue by its name. Raises InputError that lists the known ones."""
        if name not in self.tissues:
            raise InputError(f"There is no tissue {name!r}; there are {', '.join(self.tissues)}.")
        return self.tissues[name]

    def with_(self, **changes: Any) -> "PalpationDesign":
        """The design with other values of some keys, checked. A mapping changes keys of a section; None removes a key.

        Raises InputError where they do not fit.
        """
        return validated(PalpationDesign, _changed(self.model_dump(exclude_none=True), changes), where=self.name)

    def mirrored_films(self) -> np.ndarray:
        """For each film (films,) the number of its mirror image about the middle. Raises InputError for a film without one."""
        films, length, found = list(self.films.values()), self.geometry.length, []
        for film in films:
            on = {"left support": "right support", "right support": "left support"}.get(film.on, film.on)
            places = [k for k, other in enumerate(films) if other.on == on and other.side == film.side
                      and np.allclose([other.start, other.end], [length - film.end, length - film.start])]
            if not places:
                raise InputError(f"{self.name}: the film on the {film.on} from {film.start:g} to {film.end:g} mm has no mirror "
                                 "image; the search for a lump needs films that are symmetric about the beam's middle.")
            found.append(places[0])
        return np.array(found)

    def variant(self, name: str) -> "PalpationDesign":
        """The design of one of its variants. Raises InputError where its values do not fit."""
        return self.with_(variants={}, variant_steps=self.variant_steps, **self.variants[name])


def _changed(values, changes):
    """A mapping with other values, nested mappings changed likewise."""
    out = dict(values)
    for name, value in changes.items():
        if isinstance(value, dict) and isinstance(out.get(name), dict) and value:
            out[name] = _changed(out[name], value)
        elif value is None:
            out.pop(name, None)
        else:
            out[name] = value
    return out


def check_design(values: object, path: str | Path) -> PalpationDesign:
    """The design of keys and values that were read from a file. Raises InputError, one sentence with file, field and remedy."""
    design = validated(PalpationDesign, values, where=str(path))
    _refuse_materials(design, str(path))
    _refuse_studies(design, str(path))
    for name in design.variants:
        try:
            variant = design.variant(name)
        except InputError as error:
            raise InputError(f"{path}: variants.{name}: {error}") from None
        _refuse_materials(variant, f"{path}: variants.{name}")
    return design


def refuse_search(design: PalpationDesign, search: LumpSearch) -> None:
    """Refuse, with an InputError, a search that cannot be solved.

    Its films are not symmetric about the middle, lumps lie beyond it or leave the tissue, the jaw presses through the tissue, or no
    lump is within the table in every press.
    """
    design.mirrored_films()
    middle, height, first = design.geometry.middle, design.geometry.tissue_height, search.x[0]
    if search.x[-1] > middle + _ROUNDING_MM:
        raise InputError(f"search.x reaches {search.x[-1]:g} mm, beyond the beam's middle at {middle:g} mm; give the left half "
                         "alone.")
    if search.jaw_mm[-1] >= height:
        raise InputError(f"search.jaw_mm reaches {search.jaw_mm[-1]:g} mm, and the tissue is {height:g} mm high; make it smaller.")
    for place, side, end in (("x", "width", 2 * middle), ("depth", "height", height)):
        values, size = getattr(search, place), getattr(search, side)
        if not 0.5 * size < values[0] <= values[-1] < end - 0.5 * size:
            raise InputError(f"search.{place} is from {values[0]:g} to {values[-1]:g} mm, where a lump with a search.{side} of "
                             f"{size:g} mm leaves the tissue of {end:g} mm; move it inwards, or make it smaller.")
    reach = max(search.moves) - min(search.moves)
    if 2 * (middle - first) <= reach:
        raise InputError(f"search.moves reach {reach:g} mm, and the table of lumps {2 * (middle - first):g} mm, from {first:g} to "
                         f"{2 * middle - first:g} mm; move the sensor less.")


def _refuse_studies(design, where):
    """Refuse what would fail only after the sweeps: one step, heights of tissue that the jaw presses through, and searches."""
    for name in ("load_n", "displacement_mm"):
        steps = getattr(design, name)
        if len(steps.values) < 2:     # a slope needs two
            raise InputError(f"{where}: {name}: steps of {steps.by:g} up to {steps.to:g} are one, and a sweep needs two or more; "
                             f"make {name}.by {0.5 * steps.to:g} or less.")
    for height in design.hardness.tissue_heights if design.hardness else ():
        try:
            design.with_(geometry={"tissue_height": height}, variants={}, hardness=None, search=None)
        except InputError as error:
            raise InputError(f"{where}: hardness.tissue_heights of {height:g} mm: {error}") from None
    if design.search:
        try:
            refuse_search(design, design.search)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None


def _refuse_materials(design, where):
    """Refuse constants that a law does not allow, and moduli that are most likely in Pa."""
    tissues = {f"tissues.{name}": material for name, material in design.tissues.items()}
    young = {}
    for name, material in ({"supports": design.supports, "beam": design.beam, "filler": design.filler} | tissues).items():
        try:
            law = material.make()
        except InputError as error:     # the constants' checks do not know the file
            raise InputError(f"{where}: {name}: {error}") from None
        young[name] = LinearConstants.of_law(law).young_mpa
    least = min(("supports", "beam"), key=young.__getitem__)
    for name, value in young.items():
        stiff = name in ("supports", "beam")
        if value > _STIFF_MPA if stiff else value > min(_SOFT_MPA, young[least]):
            limit = ("diamond" if stiff else f"the {least} ({young[least]:.4g} MPa)" if value > young[least] else
                     f"any soft tissue or rubber ({_SOFT_MPA:g} MPa)")
            raise InputError(f"{where}: {name}: Young's modulus is {value:.4g} MPa, stiffer than {limit}; is it in Pa or kPa? Then "
                             f"write {1e-6 * value:.4g} or {1e-3 * value:.4g}.")


def load_design(path: str | Path) -> PalpationDesign:
    """The design of a YAML file; faults as of `check_design`."""
    return check_design(read_yaml(path, missing="there is no such design; config/probe.yaml is one."), path)
