"""A skin's design from its YAML file, and its checks before any computation."""

import dataclasses
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt, ValidationError, model_validator

from softtact.errors import ExtrapolationWarning, InputError
from softtact.files import read_yaml
from softtact.geometry.meshes import read_mesh
from softtact.sensors.fields import Coefficient, FiniteSection, Length
from softtact.skin.analysis import CONVERTERS, Converter, LayerMeshSizes
from softtact.skin.choice import Needs
from softtact.skin.elastomers import Elastomer, find_elastomer, fingertip_area_mm2, read_elastomers
from softtact.skin.layout import Layout, hexagon_layout, module_layout
from softtact.skin.loads import Load, disc, ellipse, mask, refuse_beside
from softtact.skin.maps import finger_places
from softtact.unknown_names import first_fault, known_keys, unknown

Share = Annotated[float, Field(ge=0.0, lt=1.0)]
_ELLIPSE = {"pressure_kpa", "ratio", "angle_deg"}
_USED = {"diameter_mm": {"pressure_kpa"}, "area_mm2": _ELLIPSE, "fingertip": _ELLIPSE, "mask": {"pressure_kpa", "pixel_mm"},
         "mesh": {"unit", "turned_deg", "force_n", "strains", "friction"}}     # keys of a load beside its place, by its shape


class Module(FiniteSection):
    """The triangular module, all lengths in mm."""

    side_mm: Length = 30.0
    pitch_mm: Length = 5.0
    radius_mm: Length = 2.0
    guard_radius_mm: Length = 2.2
    thickness_mm: Length = 2.0
    centres_mm: Annotated[tuple[tuple[float, float], ...], Field(min_length=1)] | None = None

    def layout(self) -> Layout:
        """Its taxels; overlapping ones are refused."""
        return module_layout(side_mm=self.side_mm, pitch_mm=self.pitch_mm, radius_mm=self.radius_mm,
                             guard_radius_mm=self.guard_radius_mm, centres_mm=self.centres_mm)


class MeshChoice(FiniteSection):
    """Sizes of the meshes, as `LayerMeshSizes` has them."""

    spacing_mm: PositiveFloat = 1.0
    layers: PositiveInt = 4
    field_spacing_mm: PositiveFloat = 1.2
    field_layers: PositiveInt = 3

    def sizes(self) -> LayerMeshSizes:
        """The same for `Skin`."""
        return LayerMeshSizes(self.spacing_mm, self.layers, self.field_spacing_mm, self.field_layers)


class ConverterChoice(FiniteSection):
    """A converter by its name, with stray capacitance and noise."""

    name: str = "paper"
    stray_pf: Coefficient = 10.0
    stray_share: Share = 0.2
    noise_counts: Coefficient = 1.0

    def converter(self, where: str) -> Converter:
        """The converter; an unknown name is refused."""
        if self.name not in CONVERTERS:
            raise InputError(f"{where}, at 'converter.name': {unknown(self.name, CONVERTERS, kind='converter')}.")
        return dataclasses.replace(CONVERTERS[self.name], stray_pf=self.stray_pf, stray_share=self.stray_share,
                                   noise_counts=self.noise_counts)


class LoadChoice(FiniteSection):
    """One load: a pressure on one of `diameter_mm`, `area_mm2` (an ellipse), `fingertip`, `mask`; or `mesh` with a force."""

    name: str
    at_mm: tuple[float, float] | None = None
    at_taxel: PositiveInt | None = None
    pressure_kpa: PositiveFloat | None = None
    diameter_mm: PositiveFloat | None = None
    area_mm2: PositiveFloat | None = None
    fingertip: Literal["cellphone", "keyboard", "mouse"] | None = None
    mask: str | None = None
    pixel_mm: PositiveFloat | None = None
    mesh: str | None = None
    unit: Literal["mm", "cm", "m", "inch", "in"] = "mm"
    turned_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    force_n: PositiveFloat | None = None
    strains: Literal["small", "finite"] = "small"
    friction: NonNegativeFloat = 0.0
    ratio: PositiveFloat = 1.5
    angle_deg: float = 0.0

    @model_validator(mode="after")
    def _one_of_each(self) -> "LoadChoice":
        shapes = [name for name in ("diameter_mm", "area_mm2", "fingertip", "mask", "mesh") if getattr(self, name) is not None]
        if len(shapes) != 1:
            raise ValueError(f"load {self.name!r} has {' and '.join(shapes) or 'no shape'}; give one of diameter_mm, area_mm2, "
                             "fingertip, mask, mesh")
        if (self.at_mm is None) == (self.at_taxel is None):
            raise ValueError(f"load {self.name!r}: give either at_mm or at_taxel")
        needed = "force_n" if self.mesh else "pressure_kpa"
        if getattr(self, needed) is None:
            raise ValueError(f"load {self.name!r}: {needed} is missing")
        if self.strains == "finite" and not self.mesh:
            raise ValueError(f"load {self.name!r}: strains: finite is for a mesh that presses, because a uniform pressure has no "
                             "stable equilibrium there; leave it out")
        if self.friction and self.strains == "small":
            raise ValueError(f"load {self.name!r}: friction is for strains: finite; add that or leave friction out")
        if self.mask and self.pixel_mm is None:
            raise ValueError(f"load {self.name!r}: pixel_mm is missing, the side of the mask's pixels")
        stated = set(self.model_dump(exclude_defaults=True))
        if unused := sorted(stated & set().union(*_USED.values()) - _USED[shapes[0]]):
            raise ValueError(f"load {self.name!r}: a load by {shapes[0]} has no {' or '.join(unused)}; leave it out")
        return self

    def centre(self, layout: Layout, where: str) -> tuple[float, float]:
        """Its centre in mm."""
        if self.at_mm is not None:
            return self.at_mm
        assert self.at_taxel is not None
        if self.at_taxel > len(layout.centres_mm):
            raise InputError(f"{where}, load {self.name!r}: there is no taxel {self.at_taxel}; give one of 1 to "
                             f"{len(layout.centres_mm)}.")
        x, y = layout.centres_mm[self.at_taxel - 1]
        return float(x), float(y)

    def pressure(self, layout: Layout, *, folder: Path, where: str) -> Load:
        """The load as forces, for all shapes but a mesh; a load beside the elastomer is refused."""
        assert self.pressure_kpa is not None
        centre, pressure = self.centre(layout, where), 1e-3 * self.pressure_kpa
        if self.diameter_mm is not None:
            load = disc(centre, diameter_mm=self.diameter_mm, pressure_mpa=pressure)
        elif self.mask is not None:
            assert self.pixel_mm is not None
            load = mask(folder / self.mask, centre, pixel_mm=self.pixel_mm, pressure_mpa=pressure)
        else:
            area = self.area_mm2 if self.area_mm2 is not None else fingertip_area_mm2(str(self.fingertip))
            load = ellipse(centre, area_mm2=area, pressure_mpa=pressure, ratio=self.ratio, angle_deg=self.angle_deg)
        refuse_beside(load, layout, where=f"{where}, load {self.name!r}")
        return load


class Probes(FiniteSection):
    """Capacitance against pressure under cylindrical probes, for errors of the modulus given as shares."""

    diameters_mm: tuple[PositiveFloat, ...] = (4.0, 5.0, 6.0, 10.0)
    pressures_kpa: tuple[PositiveFloat, ...] = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0)
    modulus_shares: tuple[Annotated[float, Field(gt=-1)], ...] = (-0.1, -0.05, 0.0, 0.05, 0.1)
    at_taxel: PositiveInt = 7


class Choice(FiniteSection):
    """Requirements by which the elastomer and its thickness are chosen."""

    target_kpa: PositiveFloat = 10.0
    range_kpa: tuple[PositiveFloat, PositiveFloat] = (10.0, 50.0)
    probe_mm: Length = 6.0
    smallest_force_n: PositiveFloat = 0.05
    detected_counts: Coefficient = 3.0
    strain_limit: Share = 0.3
    weight_budget_g: PositiveFloat | None = None
    thicknesses_mm: tuple[PositiveFloat, ...] = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
    draws: PositiveInt = 2000
    strain_scatter: Coefficient = 0.10
    batch_scatter: Coefficient = 0.33
    ageing_stiffening: Coefficient = 0.2
    seed: int = 0


class Maps(FiniteSection):
    """Maps of detection and localisation over a patch."""

    spacing_mm: PositiveFloat = 1.0
    finger_mm2: PositiveFloat = 69.91
    pressure_kpa: PositiveFloat = 10.0
    pitches_mm: tuple[PositiveFloat, ...] = (4.5, 5.0, 6.0, 8.0, 10.0)
    crosstalk_probe_mm: PositiveFloat = 4.0


class Link(FiniteSection):
    """A robot's link that modules are laid on."""

    mesh: str
    unit: Literal["mm", "cm", "m", "inch", "in"] = "mm"
    start_mm: tuple[float, float, float] | None = None
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    rings: NonNegativeInt = 2
    least_radius_mm: Length = 10.0


class Search(FiniteSection):
    """Values of which a search takes all combinations."""

    elastomers: tuple[str, ...] | None = None
    thicknesses_mm: tuple[PositiveFloat, ...] = (1.0, 2.0, 3.0)
    radii_mm: tuple[PositiveFloat, ...] = (1.5, 2.0)
    pitches_mm: tuple[PositiveFloat, ...] = (4.5, 5.0, 6.0)


class SkinDesign(FiniteSection):
    """A whole design; a section that is left out is not computed."""

    skin: str
    module: Module = Module()
    patch: Literal["none", "hexagon"] = "none"
    elastomer: str = "SomaFoama"
    elastomers: str | None = None
    converter: ConverterChoice = ConverterChoice()
    mesh: MeshChoice = MeshChoice()
    loads: tuple[LoadChoice, ...]
    probes: Probes | None = None
    choice: Choice | None = None
    maps: Maps | None = None
    link: Link | None = None
    search: Search | None = None
    claims: bool = False
    force_range_n: tuple[float, PositiveFloat] = Field((0.0, 5.0), description="of presses on it as a sensor")
    kind: Literal["skin"] = "skin"
    study: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")] | None = None

    def layout(self) -> Layout:
        """The taxels of the module, or of the hexagonal patch of six."""
        module = self.module.layout()
        return hexagon_layout(module) if self.patch == "hexagon" else module


def read_design(path: str | Path) -> SkinDesign:
    """The design of a YAML file; the first fault becomes one sentence with file, field and remedy."""
    values = read_yaml(path, missing="there is no such design; give the path of a YAML file, see docs/how-to/design_a_skin.md.")
    if not isinstance(values, dict):
        raise InputError(f"{path}: a design holds keys and values; see docs/how-to/design_a_skin.md.")
    return check_design(values, path)


def check_design(values: Mapping[str, Any], path: str | Path) -> SkinDesign:
    """The design of keys and values that were read from a file; faults as of `read_design`."""
    try:
        design = SkinDesign.model_validate(values)
    except ValidationError as error:
        raise InputError(f"{path}{_fault(first_fault(error))}") from None
    if design.module.centres_mm is not None and "pitch_mm" in design.module.model_fields_set:
        raise InputError(f"{path}, at 'module.pitch_mm': it has no effect beside centres_mm, which has the taxels' places; leave "
                         "one of both out.")
    names = [load.name for load in design.loads]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}, at 'loads': two loads are called {twice!r}; give them different names.")
    return design


def _fault(fault):
    """The message on a fault found by pydantic, without the file's name."""
    *parents, last = fault["loc"] or ("",)
    at = f", at {'.'.join(map(str, fault['loc']))!r}"
    if fault["type"] == "extra_forbidden":
        reason = unknown(last, known_keys(SkinDesign, parents), kind="key")
        return f"{', at ' + repr('.'.join(map(str, parents))) if parents else ''}: {reason}{'' if reason.endswith('?') else '.'}"
    if fault["type"] == "missing":
        return f": the key {'.'.join(map(str, fault['loc']))!r} is missing; add it."
    given = "" if isinstance(fault["input"], dict) else f" (it is {fault['input']!r:.60})"
    return f"{at}{given}: {fault['msg'].removeprefix('Value error, ')}; correct it."


@dataclass
class PreparedDesign:
    """A checked design with its names resolved to layout, materials, converter and loads."""

    design: SkinDesign
    where: str
    """The design's file."""
    layout: Layout
    elastomers: dict[str, Elastomer]
    elastomer: Elastomer
    converter: Converter
    loads: dict[str, Load | None]
    """By name; None for a mesh, which has no forces before it is pressed."""


def prepare(design: SkinDesign, path: Path) -> PreparedDesign:
    """Resolve and check a design, without long computations; raises InputError for the first fault."""
    where, layout, folder = str(path), design.layout(), path.parent
    elastomers = read_elastomers(folder / design.elastomers if design.elastomers else None)
    elastomer = find_elastomer(design.elastomer, elastomers, where=f"{where}, at 'elastomer'")
    loads = {load.name: None if load.mesh else load.pressure(layout, folder=folder, where=where) for load in design.loads}
    pressures = {f"load {name!r}": [load.pressure_mpa] for name, load in loads.items() if load is not None}
    if design.probes:
        pressures["at 'probes.pressures_kpa'"] = [1e-3 * pressure for pressure in design.probes.pressures_kpa]
    if design.maps:
        pressures["at 'maps.pressure_kpa'"] = [1e-3 * design.maps.pressure_kpa]
    _refuse_pressures(elastomer, pressures, where)
    _refuse_places(design, layout, folder, where)
    _refuse_choice(design, elastomers, where)
    _refuse_search(design, elastomers, where)
    return PreparedDesign(design, where, layout, elastomers, elastomer, design.converter.converter(where), loads)


def needs_of(choice: Choice) -> Needs:
    """The requirements of a choice in MPa, mm and N."""
    low, high = (1e-3 * value for value in choice.range_kpa)
    return Needs((low, high), choice.probe_mm, choice.smallest_force_n, choice.detected_counts, choice.strain_limit)


def bears(elastomer: Elastomer, stress_mpa: float) -> bool:
    """Whether an elastomer's curve reaches a stress."""
    try:
        elastomer.tested_young_mpa(stress_mpa)
    except InputError:
        return False
    return True


def reaches(elastomer: Elastomer, stress_mpa: float) -> bool:
    """Whether an elastomer's curve has a strain at a stress, extrapolated or not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)
            return elastomer.strain(stress_mpa) < 1
    except InputError:
        return False


def _refuse_choice(design, elastomers, where):
    """Refuse a choice at pressures that no elastomer's curve reaches, or in a range that does not rise."""
    if design.choice is None:
        return
    low, high = design.choice.range_kpa
    if low >= high:
        raise InputError(f"{where}, at 'choice.range_kpa': {low:g} to {high:g} kPa does not rise; write the lower pressure first.")
    for name, pressure, check in (("target_kpa", design.choice.target_kpa, reaches), ("range_kpa", high, bears)):
        if not any(check(elastomer, 1e-3 * pressure) for elastomer in elastomers.values()):
            raise InputError(f"{where}, at 'choice.{name}': no elastomer's curve reaches {pressure:g} kPa; choose less pressure.")


def _refuse_pressures(elastomer, pressures, where):
    """Refuse pressures {place: [MPa]} that the elastomer's curve does not reach."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtrapolationWarning)
        for place, values in pressures.items():
            for value in values:
                try:
                    elastomer.strain(value)
                except InputError as error:
                    raise InputError(f"{where}, {place}: {error}") from None


def _refuse_places(design, layout, folder, where):
    """Refuse loads and probes without a taxel or beside the elastomer, and meshes that cannot be read."""
    for load in design.loads:
        load.centre(layout, where)
        if load.mesh:
            read_mesh(folder / load.mesh, unit=load.unit)
    if design.link:
        read_mesh(folder / design.link.mesh, unit=design.link.unit)
    if design.maps:
        _refuse_maps(design, layout, where)
    if design.probes is None:
        return
    if design.probes.at_taxel > len(layout.centres_mm):
        raise InputError(f"{where}, at 'probes.at_taxel': there is no taxel {design.probes.at_taxel}; give one of 1 to "
                         f"{len(layout.centres_mm)}.")
    x, y = layout.centres_mm[design.probes.at_taxel - 1]
    for diameter in design.probes.diameters_mm:
        load = disc((float(x), float(y)), diameter_mm=diameter, pressure_mpa=1e-3)
        refuse_beside(load, layout, where=f"{where}, at 'probes.diameters_mm', {diameter:g} mm")


def _refuse_maps(design, layout, where):
    """Refuse a finger that lies nowhere on the elastomer as a whole, and pitches at which taxels overlap."""
    maps, least = design.maps, 2 * design.module.guard_radius_mm
    if not len(finger_places(layout, finger_mm2=maps.finger_mm2, spacing_mm=maps.spacing_mm)):
        raise InputError(f"{where}, at 'maps.finger_mm2': at none of the places {maps.spacing_mm:g} mm apart does a finger of "
                         f"{maps.finger_mm2:g} mm2 lie on the elastomer as a whole; make finger_mm2 or spacing_mm smaller.")
    if (narrow := min(maps.pitches_mm, default=np.inf)) <= least:
        raise InputError(f"{where}, at 'maps.pitches_mm': taxels at a pitch of {narrow:g} mm need more than {least:g} mm (guard "
                         "gaps included); make it larger, or the module's guard_radius_mm smaller.")


def _refuse_search(design, elastomers, where):
    """Refuse unknown elastomers, those that do not bear the range of pressure, and modules without place for their taxels."""
    if design.search is None:
        return
    if design.module.centres_mm is not None:
        raise InputError(f"{where}, at 'search': it builds the published module at other pitches, and module.centres_mm has places "
                         "of its own, which have no pitch; leave one of both out.")
    highest = 1e-3 * (design.choice or Choice()).range_kpa[1]
    for name in design.search.elastomers or ():
        elastomer = find_elastomer(name, elastomers, where=f"{where}, at 'search.elastomers'")
        _refuse_pressures(elastomer, {"at 'search.elastomers' and 'choice.range_kpa'": [highest]}, where)
    gap = design.module.guard_radius_mm - design.module.radius_mm
    for radius in design.search.radii_mm:
        for pitch in design.search.pitches_mm:
            try:
                module_layout(side_mm=design.module.side_mm, pitch_mm=pitch, radius_mm=radius, guard_radius_mm=radius + gap)
            except InputError as error:
                raise InputError(f"{where}, at 'search', radius {radius:g} and pitch {pitch:g} mm: {error}") from None
