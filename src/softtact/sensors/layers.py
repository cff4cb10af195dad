"""Sensors of `kind: layers`: one or two plain layers without frusta, on the board or held only at their sides."""

from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, Self

from pydantic import Field, PrivateAttr

from softtact.errors import InputError
from softtact.materials.config import law_from_printed
from softtact.materials.linear import LinearConstants
from softtact.sensors.base import BaseSpec
from softtact.sensors.fields import Coefficient, ElasticLayer, FiniteSection, Length
from softtact.sensors.library import material_file

_ELEMENTS = 4     # through the thickness, for the default size of elements in plan


class PlainLayer(FiniteSection):
    """A layer of constant thickness; `relative_permittivity` is used for the lowest, the dielectric."""

    material: str
    thickness_mm: Length
    relative_permittivity: Length = 3.5


class ObjectFriction(FiniteSection):
    """Coefficient of Coulomb friction of the object on the sensing surface, in the hyperelastic model."""

    object: Coefficient = 0.0


class LayersSpec(BaseSpec):
    """One or two plain layers, from below. The first is the dielectric: the deformation map is the movement of its top.

    support: `base`, the lowest layer is bonded to the board, or `none`, it is free below; the sides are held in both.
    element_mm: size of the hyperelastic model's elements in plan under an object; by default a quarter of the thickness: half
    of that changes the depth of a ball by 0.7 % and takes three times as long
    """

    kind: Literal["layers"]
    support: Literal["base", "none"]
    layers: Annotated[tuple[PlainLayer, ...], Field(min_length=1, max_length=2)]
    elastic_layer: ElasticLayer = Field(None, description="by default of the law of a single layer")     # type: ignore[assignment]
    element_mm: Length | None = None
    friction: ObjectFriction = ObjectFriction()
    _follows_law: bool = PrivateAttr(False)

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str = "sensor", folder: Path = Path()) -> Self:
        """As of every kind; the linear layer of a single layer follows from its law, where the file states none."""
        spec = super().from_dict(values, where=where, folder=folder)
        if "elastic_layer" in spec.model_fields_set:
            return spec
        if spec.cover is not None:
            raise InputError(f"{where}, at 'elastic_layer': it is missing, and two layers have no single law from which it could "
                             "follow; give its young_mpa and poisson.")
        linear = LinearConstants.of_law(law_from_printed(material_file(spec.dielectric.material), "mooney_rivlin"))
        return spec.with_elastic_layer_of(linear)

    def with_elastic_layer_of(self, linear: LinearConstants) -> Self:
        """The sensor with the linear layer of its single layer's law."""
        made = self.model_copy(update={"elastic_layer": ElasticLayer(young_mpa=linear.young_mpa, poisson=linear.poisson)})
        made._follows_law = True
        return made

    @property
    def elastic_layer_follows_law(self) -> bool:
        """Whether the file leaves the linear layer to the law of a single layer."""
        return self._follows_law

    @property
    def dielectric(self) -> PlainLayer:
        """The lowest layer, between the electrodes."""
        return self.layers[0]

    @property
    def cover(self) -> PlainLayer | None:
        """The upper layer, or None."""
        return self.layers[1] if len(self.layers) > 1 else None

    @property
    def thickness_mm(self) -> float:
        """Height of the sensing surface over the lower side."""
        return sum(layer.thickness_mm for layer in self.layers)

    @property
    def upper_layer_mm(self) -> float:
        """Thickness of the cover, or of the only layer."""
        return self.layers[-1].thickness_mm

    def _of_upper_layer(self, thickness_mm: float) -> dict[str, Any]:
        return {"layers": (*self.layers[:-1], self.layers[-1].model_copy(update={"thickness_mm": thickness_mm}))}

    @property
    def dielectric_thickness_mm(self) -> float:
        """Height of the electrode plane (top of the dielectric) over the lower side."""
        return self.dielectric.thickness_mm

    @property
    def base_held(self) -> bool:
        """Whether the board carries the sensor from below; else its sides carry it."""
        return self.support == "base"

    @property
    def materials(self) -> dict[str, str]:
        """Names of the materials by layer: dielectric, and cover where there are two."""
        return {name: layer.material for name, layer in zip(("dielectric", "cover"), self.layers, strict=False)}

    @property
    def element_size_mm(self) -> float:
        """Size of the hyperelastic model's elements in plan under an object."""
        return self.element_mm or self.thickness_mm / _ELEMENTS

    @property
    def parts_in_words(self) -> str:
        """Number of layers, and their support."""
        return f"{len(self.layers)} plain layer{'s' * (len(self.layers) > 1)} ({self.support})"

    @property
    def support_facts(self) -> dict[str, Any]:
        """Friction in the hyperelastic model, and the support, as attributes of a result."""
        return {"friction_object": self.friction.object, "support": self.support}

    def need_frusta(self, what: str, remedy: str) -> NoReturn:
        """Refuse `what` in a sentence that ends in the remedy."""
        raise InputError(f"{self.name} has no frusta, which {what} needs; {remedy}.")
