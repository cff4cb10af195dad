"""Objects from a stage's settings: parts of a design by their names, materials and converter by their fields."""

from collections.abc import Mapping
from typing import Any

from softtact.skin.analysis import Converter, Skin
from softtact.skin.design import SkinDesign
from softtact.skin.elastomers import Elastomer
from softtact.skin.layout import Layout

Settings = Mapping[str, Any]
_PARTS = ("module", "patch", "mesh")


def design_of(settings: Settings) -> SkinDesign:
    """A design with the settings `module`, `patch` and `mesh` if given, without loads."""
    return SkinDesign.model_validate({"skin": "", "loads": []} | {name: settings[name] for name in _PARTS if name in settings})


def skin_of(settings: Settings, threads: int, *, layout: Layout | None = None) -> Skin:
    """The layer of `elastomer` on the taxels of a design or of another layout."""
    design, elastomer = design_of(settings), elastomer_of(settings)
    return Skin(layout or design.layout(), thickness_mm=design.module.thickness_mm, poisson=elastomer.poisson,
                permittivity=elastomer.permittivity_fe, mesh=design.mesh.sizes(), threads=threads)


def elastomer_of(settings: Settings) -> Elastomer:
    """The elastomer in the setting `elastomer`."""
    return Elastomer.model_validate(settings["elastomer"])


def elastomers_of(settings: Settings) -> dict[str, Elastomer]:
    """Elastomers by name in the setting `elastomers`, a list."""
    return {values["name"]: Elastomer.model_validate(values) for values in settings["elastomers"]}


def converter_of(settings: Settings) -> Converter:
    """The converter in the setting `converter`."""
    return Converter(**settings["converter"] | {"range_pf": tuple(settings["converter"]["range_pf"])})
