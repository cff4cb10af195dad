"""What `softtact calibrate` found of one sensor, as a block of its file: from relative changes of capacitance to its counts."""

from typing import Annotated

from pydantic import Field, PositiveFloat

from softtact.sensors.fields import Section

Share = Annotated[float, Field(ge=0.0, lt=1.0)]


class CalibrationBlock(Section):
    """counts = gain x counts_per_relative_change x dC/C0 + zero_counts, each taxel's own; dC/C0 with the electrodes' edges and
    neighbours as the virtual sensor has them.
    """

    gain: tuple[tuple[PositiveFloat, ...], ...] = Field(description="(rows, columns), as a share of the common one")
    zero_counts: tuple[tuple[float, ...], ...] = Field(description="(rows, columns), over the baseline")
    counts_per_relative_change: PositiveFloat
    relaxation: tuple[Share, ...] = Field((), description="shares of the deformation that creep in late")
    relaxation_s: tuple[PositiveFloat, ...] = Field((), description="their time constants")
    modulus_scale: PositiveFloat = Field(1.0, description="of the moduli of all layers, over those of the materials' files")
    noise_counts: float = Field(0.0, ge=0.0, description="of one reading, standard deviation")
    source: str = ""
    not_identifiable: tuple[str, ...] = ()
    standard_deviations: dict[str, float] = {}

    def fault(self, rows: int, columns: int) -> str | None:
        """What does not fit a sensor of so many rows and columns of taxels, or each other; None where all does."""
        for name in ("gain", "zero_counts"):
            values = getattr(self, name)
            if len(values) != rows or any(len(row) != columns for row in values):
                return f"'calibration.{name}' has not {rows} rows of {columns} numbers, as the sensor has taxels"
        if len(self.relaxation) != len(self.relaxation_s):
            return "'calibration.relaxation' and 'calibration.relaxation_s' are not of one length"
        return "'calibration.relaxation' sums to 1 or more" if sum(self.relaxation) >= 1 else None
