"""Sensors of `kind: frusta`: a cover on a dielectric sheet whose conical frusta stand on the board."""

from typing import Any, Literal

import numpy as np

from softtact.errors import InputError
from softtact.sensors.base import BaseSpec
from softtact.sensors.fields import Coefficient, FiniteSection, Flag, Length, Taxels

# Frustum orientations for the two printed diameters: the narrow end as the tip, or the wide one, as the paper's text has it.
ORIENTATIONS = ("default", "as_printed")


class Frusta(FiniteSection):
    """Conical frusta below the sheet, on a square lattice centred on the sensor."""

    height_mm: Length
    tip_diameter_mm: Length
    root_diameter_mm: Length
    pitch_mm: Length


class Dielectric(FiniteSection):
    """Sheet with frusta; `relative_permittivity` of its solid."""

    material: str
    frusta: Frusta
    sheet_thickness_mm: Length
    relative_permittivity: Length = 3.5


class Cover(FiniteSection):
    """Cover and conductive fabric as one layer."""

    material: str
    thickness_mm: Length


class Friction(FiniteSection):
    """Coefficients of Coulomb friction of the object on the cover and of the frusta on the board, in the hyperelastic model."""

    object: Coefficient = 0.0
    board: Coefficient = 0.0


class SensorSpec(BaseSpec):
    """A layered sensor on frusta. Frame: origin at the centre of the sensing surface, x and y along the sides, z outwards."""

    kind: Literal["frusta"] = "frusta"
    taxels: Taxels
    dielectric: Dielectric
    cover: Cover
    tips_bonded: Flag = True
    friction: Friction = Friction()

    def with_frustum_orientation(self, orientation: str) -> "SensorSpec":
        """The same sensor with the frustum orientation `default`, the narrow end as tip, or `as_printed`."""
        narrow, wide = sorted((self.dielectric.frusta.tip_diameter_mm, self.dielectric.frusta.root_diameter_mm))
        tip, root = {"default": (narrow, wide), "as_printed": (wide, narrow)}[orientation]
        frusta = self.dielectric.frusta.model_copy(update={"tip_diameter_mm": tip, "root_diameter_mm": root})
        return self.model_copy(update={"dielectric": self.dielectric.model_copy(update={"frusta": frusta})})

    @property
    def thickness_mm(self) -> float:
        """Height of the sensing surface over the PCB."""
        return self.dielectric_thickness_mm + self.cover.thickness_mm

    @property
    def upper_layer_mm(self) -> float:
        """Thickness of the cover."""
        return self.cover.thickness_mm

    def _of_upper_layer(self, thickness_mm: float) -> dict[str, Any]:
        return {"cover": self.cover.model_copy(update={"thickness_mm": thickness_mm})}

    @property
    def dielectric_thickness_mm(self) -> float:
        """Height of the electrode plane (top of the dielectric) over the PCB."""
        return self.dielectric.frusta.height_mm + self.dielectric.sheet_thickness_mm

    @property
    def materials(self) -> dict[str, str]:
        """Names of the materials by layer."""
        return {"dielectric": self.dielectric.material, "cover": self.cover.material}

    @property
    def frustum_height_mm(self) -> float:
        """Height of the frusta."""
        return self.dielectric.frusta.height_mm

    @property
    def parts_in_words(self) -> str:
        """How many frusta stand along x and y."""
        return " x ".join(map(str, self.frusta_counts)) + " frusta"

    @property
    def support_facts(self) -> dict[str, Any]:
        """Friction in the hyperelastic model, and whether tips are bonded, as attributes of a result."""
        return {"friction_object": self.friction.object, "friction_board": self.friction.board,
                "tips_bonded": int(self.tips_bonded)}

    def check_for(self, kind: str) -> None:
        """Refuse a map or a lattice that a model of this kind (elastic, foundation, hyperelastic) cannot divide into quarters."""
        super().check_for(kind)
        if kind == "foundation" and any(count % 2 for count in self.frusta_counts):
            raise InputError(f"{self.name}: its lattice of {self.frusta_counts[0]} x {self.frusta_counts[1]} frusta has a row in "
                             "the middle; the foundation model needs even numbers; change the pitch or the footprint a little.")

    @property
    def held_height_mm(self) -> float:
        """Height of sheet and cover, whose side faces a shell can hold."""
        return self.thickness_mm - self.frustum_height_mm

    @property
    def frusta_counts(self) -> tuple[int, ...]:
        """How many frusta fit along x and y."""
        pitch = self.dielectric.frusta.pitch_mm
        return tuple(int(np.floor(side / pitch + 1e-9)) for side in self.footprint_mm)

    def _check(self, where: str) -> None:
        super()._check(where)
        if self.edge.far:
            raise InputError(f"{where}, at 'edge.held': 'far' is for plain layers on a base, whose elastic model is infinitely "
                             "wide; write sides, free, or {sides_below_mm: h}.")
        if min(self.frusta_counts) < 1:
            raise InputError(f"{where}: no frustum of pitch {self.dielectric.frusta.pitch_mm} mm fits on the footprint "
                             f"{self.footprint_mm} mm; enlarge the footprint or reduce the pitch.")
        if self.tips_bonded and self.friction.board > 0:
            raise InputError(f"{where}: bonded tips cannot slide with a friction of {self.friction.board:g} on the board; "
                             "set 'tips_bonded' to false, or 'friction.board' to 0.")
