"""Sensors of `kind: solid`: any soft body of elements, such as a fingertip's dome, with its materials and supports.

    name: dome
    kind: solid
    mesh: {file: dome.vtu}                   # of `softtact mesh`; another program's mesh states its unit
    regions: {body: {material: neoprene}}    # or {card: my_card.json}, or {law: neo_hooke, parameters: {c10: 0.1}}
                                             # and {..., prony: {g: [0.2], tau_s: [1.0], moduli: relaxed}}
    faces: {base: "z<0.01", skin: "z>0.01"}  # outer facets by rules, beside those that the mesh file names
    held: {base: xyz}
    contact: {face: skin, friction: 0.3}
    readouts: {tips: {kind: points, points_mm: [[0, 0, 5], [2, 0, 4.5]], radius_mm: 1.0}}
    force_range_n: [0, 20]
"""

from pathlib import Path
from typing import Annotated, Literal, NoReturn

from pydantic import Field, PositiveFloat

from softtact.errors import InputError
from softtact.materials.cards import CardMullins, CardProny, inelastic_of, law_from_card, load_card
from softtact.materials.config import law_from_printed
from softtact.materials.laws.base import Law
from softtact.materials.laws.registry import make_law
from softtact.sensors.base import ReadoutEntry, Specification
from softtact.sensors.fields import Coefficient, FiniteSection, Length
from softtact.sensors.library import material_file

_SURFACES = (".stl", ".obj", ".ply")
_SOURCES = ("material", "card", "law")


class MeshFile(FiniteSection):
    """The body's elements: VTU, or any format that `softtact mesh` reads; `unit` where the file does not state one."""

    file: str
    unit: str | None = None


class Region(FiniteSection):
    """The law of a region: a material's printed constants, a card of `softtact fit`, or constants in MPa."""

    material: str | None = None
    card: str | None = None
    law: str | None = Field(None, description="name of the law; of a material, the one whose printed constants are taken")
    parameters: dict[str, float] | None = None
    bulk_over_shear: PositiveFloat | None = None
    prony: CardProny | None = Field(None, description="relaxation, beside a law without")
    mullins: CardMullins | None = Field(None, description="softening of the first cycles, beside a law without")


class ContactFace(FiniteSection):
    """The face that objects meet, with Coulomb's coefficient."""

    face: str
    friction: Coefficient = 0.0


class ReadingPlaces(FiniteSection):
    """A readout of the kind points, in the short form of this kind of sensor."""

    points_mm: Annotated[tuple[tuple[float, float, float], ...], Field(min_length=1)]
    radius_mm: Length
    face: str | None = Field(None, description="by default the face of the contact")


class SolidSpec(Specification):
    """A soft body as a sensor. Frame: that of its mesh, in mm; objects come down along z unless a motion says otherwise."""

    kind: Literal["solid"]
    mesh: MeshFile
    regions: Annotated[dict[str, Region], Field(min_length=1)]
    faces: dict[str, str] = {}
    held: Annotated[dict[str, str], Field(min_length=1)]
    contact: ContactFace
    readings: ReadingPlaces | None = Field(None, description="short for a readout of the name and the kind points")

    def _found_in(self, folder: Path) -> None:
        self._folder = folder      # of its mesh

    @property
    def models(self) -> tuple[str, ...]:
        """Names of the models that press it."""
        return ("solid",)

    @property
    def mesh_path(self) -> Path:
        """Path of the mesh file, relative to the working folder."""
        return self._folder / self.mesh.file

    @property
    def paths(self) -> list[Path]:
        """All files of the sensor besides its YAML file."""
        return [*super().paths, self.mesh_path, *(self._folder / region.card for region in self.regions.values() if region.card)]

    @property
    def stated_readouts(self) -> dict[str, ReadoutEntry]:
        """The readouts of the file, `readings` as one of the name `points` among them."""
        if self.readings is None:
            return self.readouts
        return {"points": ReadoutEntry(kind="points", **self.readings.model_dump()), **self.readouts}

    def need_layers(self) -> NoReturn:
        """Refuse uses that need a sensor of layers."""
        raise InputError(f"{self.name}, a sensor of kind solid: a solid has no layers and no taxels, which are needed here; press "
                         "it with `softtact press` or `softtact.load_sensor`, or give a sensor of kind frusta or layers.")

    def law_of(self, name: str) -> Law:
        """The law of a region. Raises InputError where its material, card or constants give no law."""
        region = self.regions[name]
        law = self._law_at_first_loading(region)
        if region.prony or region.mullins:
            law.inelastic = inelastic_of(region.model_dump(include={"prony", "mullins"}))
        return law

    def _law_at_first_loading(self, region: Region) -> Law:
        if region.card:
            return law_from_card(load_card(self._folder / region.card), region.law)
        if region.material:
            return law_from_printed(material_file(region.material), region.law or "mooney_rivlin")
        if region.bulk_over_shear is None:
            return make_law(str(region.law), region.parameters or {})
        return make_law(str(region.law), region.parameters or {}, bulk_over_shear=region.bulk_over_shear)

    def _check(self, where: str) -> None:
        super()._check(where)
        if Path(self.mesh.file).suffix.lower() in _SURFACES:
            filled = Path(self.mesh.file).with_suffix(".vtu").name
            raise InputError(f"{where}, at 'mesh.file': {self.mesh.file} is a surface, and the body needs elements; run `softtact "
                             f"mesh {self.mesh.file} --unit mm --size ... --out {filled}` and name the file that it writes.")
        for name, region in self.regions.items():
            if fault := _region_fault(region):
                raise InputError(f"{where}, at 'regions.{name}': {fault}")
        if self.readings is not None and "points" in self.readouts:
            raise InputError(f"{where}, at 'readings': it means a readout of the name 'points', which is also under "
                             "'readouts'; leave one of them out.")


def _region_fault(region: Region) -> str | None:
    """The fault in the sources of a region's law, and its remedy; None without fault."""
    given = [name for name in _SOURCES if getattr(region, name) is not None]
    if not given:
        return "it has no law; give 'material', 'card', or 'law' with 'parameters'."
    if region.card and (region.prony or region.mullins):
        return "a card states its own 'prony' and 'mullins'; write them there, or leave them out."
    if region.material and region.card:
        return "it has a material and a card; leave one of them out."
    plain = given == ["law"]
    if plain and region.parameters is None:
        return f"the law {region.law!r} has no parameters; give its constants in MPa."
    if not plain and (region.parameters is not None or region.bulk_over_shear is not None):
        return f"'parameters' and 'bulk_over_shear' belong to 'law'; leave them out, or leave {given[0]!r} out."
    return None
