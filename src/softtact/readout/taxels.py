"""The readout `capacitance`: counts of the taxels, those of an ideal readout or of a sensor whose `calibration` is known.

    readouts: {taxels: {kind: capacitance}}
"""

from typing import TYPE_CHECKING

import numpy as np

from softtact.errors import InputError
from softtact.readout.capacitance import ideal_counts
from softtact.readout.registry import SurfaceMotion, Unlabelled, labelled, register
from softtact.readout.virtual_sensor import amplified, taxel_capacitance
from softtact.sensors.base import BaseSpec
from softtact.sensors.fields import FiniteSection

if TYPE_CHECKING:
    import xarray

    from softtact.sensors.specification import AnySpec

LARGEST_WHOLE = np.iinfo(np.uint16).max     # of a converter of 16 bits


@register("capacitance")
class Capacitance(FiniteSection):
    """Counts (step, row, column) of the sensor's taxels, long after the press and without noise."""

    def read(self, surface: SurfaceMotion) -> "xarray.DataArray":
        """See `Capacitance`."""
        values, dimensions, units = self.unlabelled(surface)
        return labelled(values, dimensions, units=units)

    def unlabelled(self, surface: SurfaceMotion) -> Unlabelled:
        """See `Capacitance`. Raises InputError for a sensor without layers between electrodes."""
        if surface.thinning_mm is None or not isinstance(surface.spec, BaseSpec):
            raise InputError(f"{surface.spec.name} has no layers between electrodes, which the readout 'capacitance' reads; take "
                             "points or strip.")
        surface.spec.need_taxels("the readout 'capacitance'")
        return Unlabelled(counts_of(surface.spec, surface.thinning_mm), ("step", "row", "column"), "counts")     # type: ignore[arg-type]


def relative_change(spec: "AnySpec", displacement_mm: np.ndarray, *, shift_mm: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """dC / C0 (..., rows, columns) of the electrodes under a displacement (..., y, x) in mm, with their edges and neighbours.

    shift_mm: (x, y) by which the object is displaced over the sensor, relative to the press
    """
    rest = taxel_capacitance(spec, np.zeros(displacement_mm.shape[-2:]))      # type: ignore[arg-type]
    return taxel_capacitance(spec, displacement_mm, shift_mm=shift_mm) / rest - 1      # type: ignore[arg-type]


def counts_of(spec: "AnySpec", displacement_mm: np.ndarray) -> np.ndarray:
    """Counts (..., rows, columns) of a sensor's `calibration`, long after the press and without noise; else the ideal ones."""
    known = spec.calibration
    if known is None:
        return ideal_counts(spec, displacement_mm)
    change = known.counts_per_relative_change * relative_change(spec, displacement_mm)
    return np.minimum(amplified(change, gain=np.array(known.gain), offset=np.array(known.zero_counts)), spec.largest_counts)


def whole_counts(counts: np.ndarray) -> np.ndarray:
    """Counts as a converter gives them: whole, from 0 to `LARGEST_WHOLE`, uint16. Those of a calibrated sensor may be below 0."""
    return np.clip(np.round(counts), 0, LARGEST_WHOLE).astype(np.uint16)


def need_whole_counts(spec: "AnySpec", what: str) -> None:
    """Raise InputError for a sensor whose range `whole_counts` would cut off; `what` holds such counts."""
    if spec.largest_counts > LARGEST_WHOLE:
        raise InputError(f"{spec.name}: its largest_counts, {spec.largest_counts:g}, are more than the {LARGEST_WHOLE} that 16 "
                         f"bits hold, in which {what} keeps counts; state at most {LARGEST_WHOLE} in its file.")
