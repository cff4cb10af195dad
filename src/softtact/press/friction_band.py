"""A press with several coefficients of friction, where the true one is not known: between which readings a sensor's lie."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError

if TYPE_CHECKING:
    import xarray

    from softtact.press.result import PressResult
    from softtact.press.sensor import Sensor


@dataclass(frozen=True)
class FrictionBand:
    """The same press with several coefficients."""

    friction: np.ndarray
    """(k,) Coulomb's coefficients of the object on the surface, rising."""
    results: "list[PressResult]"
    """One for each coefficient."""

    def readings(self, readout: str) -> "xarray.DataArray":
        """Readings of a readout with `friction` as their first dimension: `.min("friction")` and `.max("friction")` are the band.

        Raises InputError where the sensor has no such readout.
        """
        import xarray

        known = self.results[0].readings
        if readout not in known:
            raise InputError(f"{self.results[0].sensor} has no readout {readout!r}; its readings are {', '.join(known) or 'none'}.")
        return xarray.concat([result.readings[readout] for result in self.results], dim="friction", coords="different",
                             compat="equals").assign_coords(friction=self.friction)


def press_over_friction(sensor: "Sensor", mesh: Any, friction: Sequence[float], **how: Any) -> FrictionBand:
    """Press an object once for each coefficient of friction.

    Readings need not change evenly with friction: besides the ends of what is likely give one or two values between them.
    mesh, how: as of `Sensor.press`
    Raises InputError for fewer than two coefficients, and as a press does.
    """
    values = np.unique(np.asarray(friction, dtype=float))
    if len(values) < 2:
        raise InputError(f"friction {list(friction)}: a band needs at least two different coefficients; give its ends.")
    return FrictionBand(values, [sensor.with_friction(value).press(mesh, **how) for value in values])
