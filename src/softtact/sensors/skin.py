"""Robot skins as sensors: the design of `softtact skin` in a file of `kind: skin`, whose module or patch is pressed.

Frame: that of the design, x and y in the plane of the taxels; z = 0 at the board, the sensing surface at the elastomer's thickness.
"""

from pathlib import Path
from typing import Any, Literal, NoReturn, Self

from pydantic import PrivateAttr

from softtact.errors import InputError
from softtact.sensors.base import Specification

_FORCE_RANGE_N = (0.0, 5.0)     # of a file that states none: fingertips on these skins


class SkinSpec(Specification):
    """A design by its keys and values, which are checked where the skin is loaded; `name` is its `skin`."""

    kind: Literal["skin"]
    design: dict[str, Any]
    _where: str = PrivateAttr("sensor")

    @classmethod
    def from_dict(cls, values: dict[str, Any], *, where: str = "sensor", folder: Path = Path()) -> Self:
        """See `Specification`."""
        spec = super().from_dict({"kind": values.get("kind"), "name": str(values.get("skin", "")), "design": values,
                                  "force_range_n": values.get("force_range_n", _FORCE_RANGE_N)}, where=where, folder=folder)
        spec._where = where
        return spec

    @property
    def where(self) -> str:
        """The file, for messages."""
        return self._where

    @property
    def models(self) -> tuple[str, ...]:
        """Names of the models that press it."""
        return "elastic", "solid"

    def _found_in(self, folder: Path) -> None:
        self._folder = folder      # of its elastomers

    def need_layers(self) -> NoReturn:
        """Refuse uses that need a sensor of layers."""
        raise InputError(f"{self.name}, a sensor of kind skin: a skin has no map of a plane and no rows of taxels, which are "
                         "needed here; press it with `softtact press` or `softtact.load_sensor`, or give a sensor of kind frusta "
                         "or layers.")
