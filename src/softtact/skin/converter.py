"""From capacitances to counts: a capacitance-to-digital converter like the AD7147, with the stray capacitance of its lines."""

from dataclasses import dataclass

import numpy as np

from softtact.errors import InputError


@dataclass(frozen=True)
class Converter:
    """Counts of a capacitance, and the range that it has to stay in."""

    step_ff: float
    """fF a count."""
    range_pf: tuple[float, float]
    """Lowest and highest capacitance, of a taxel with its stray."""
    offset_step_pf: float
    """An offset is taken off in such steps before conversion; 0 for none."""
    stray_pf: float = 10.0
    """Of the lines to a taxel."""
    stray_share: float = 0.2
    """How far the stray may be from that, as a share."""
    noise_counts: float = 1.0
    """Standard deviation of a reading."""

    @property
    def noise_ff(self) -> float:
        """Standard deviation of a reading in fF."""
        return self.noise_counts * self.step_ff

    def counts(self, capacitance_ff: np.ndarray) -> np.ndarray:
        """Change of a reading's whole counts by capacitances (load, taxel), the first row being the skin at rest.

        An offset in whole steps brings each taxel at rest into the range first. Raises InputError where a taxel leaves the range.
        """
        total = 1e-3 * np.asarray(capacitance_ff) + self.stray_pf
        if self.offset_step_pf:
            total = total - self.offset_step_pf * np.round(total[0] / self.offset_step_pf)
        self.refuse_outside(total)
        reading = np.floor(1e3 * total / self.step_ff)
        return (reading - reading[0])[1:].astype(int)

    def largest_change_ff(self, at_rest_ff: float) -> float:
        """By how much a taxel's capacitance may rise within the range, with the stray anywhere in its share."""
        if self.offset_step_pf:
            return 1e3 * (self.range_pf[1] - 0.5 * self.offset_step_pf)
        return 1e3 * (self.range_pf[1] - self.stray_pf * (1 + self.stray_share)) - at_rest_ff

    def fits_at_rest(self, at_rest_ff: float) -> bool:
        """Whether a taxel at rest is within the range, with the stray anywhere in its share."""
        if self.offset_step_pf:
            return True
        return bool(1e-3 * at_rest_ff + self.stray_pf * (1 - self.stray_share) >= self.range_pf[0])

    def refuse_outside(self, total_pf: np.ndarray) -> None:
        """Refuse capacitances in pF, stray included, beyond the range."""
        low, high = self.range_pf
        outside = (total_pf < low) | (total_pf > high)
        if outside.any():
            raise InputError(
                f"converter: taxel {int(np.nonzero(outside)[-1][0]) + 1} with its stray has {total_pf[outside][0]:.4g} pF, and the "
                f"range is {low:g} to {high:g} pF; correct `converter.stray_pf`, or take smaller taxels or a thicker layer."
            )


# "paper": Le et al. 2011, sec. II. "adi": the maker's data sheet of the AD7147 and its forum.
CONVERTERS = {
    "paper": Converter(step_ff=0.32, range_pf=(4.0, 30.0), offset_step_pf=0.0),
    "adi": Converter(step_ff=0.244, range_pf=(-8.0, 8.0), offset_step_pf=0.32),
}
