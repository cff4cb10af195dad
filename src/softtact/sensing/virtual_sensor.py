"""The virtual sensor: what a real one would read of a reference press. A stand-in, and named so wherever it is used.

Reference deformation -> capacitance per taxel -> hysteresis along the loading -> gain, offset and drift of the specimen ->
the converter's noise
and steps. One seed is one specimen; trials differ in contact noise, drift and converter noise.
"""

from dataclasses import dataclass

import numpy as np

from softtact.errors import InputError
from softtact.sensing.capacitance import capacitance_per_area, taxel_means


@dataclass(frozen=True)
class VirtualSensorSettings:
    """counts_per_relative_change: counts at dC/C0 = 1; relaxation: share of the response that lags, with time constant
    relaxation_s; level_s: duration of a force level; gain_scatter, offset_counts: per taxel; drift: gain change between
    trials; noise_counts, step_counts: the converter's."""

    counts_per_relative_change: float = 1000.0
    relaxation: float = 0.08
    relaxation_s: float = 2.0
    level_s: float = 1.0
    gain_scatter: float = 0.03
    offset_counts: float = 5.0
    drift: float = 0.02
    noise_counts: float = 6.0
    step_counts: float = 1.0
    largest_counts: float = 2400.0

    @classmethod
    def from_dict(cls, values):
        """Settings from a mapping; an unknown key is refused."""
        unknown = sorted(set(values) - set(cls.__dataclass_fields__))
        if unknown:
            raise InputError(f"virtual_sensor: key {unknown[0]!r} is unknown; use one of "
                             f"{', '.join(cls.__dataclass_fields__)}.")
        return cls(**values)


def lagged(response, *, share, time_constant_s, step_s):
    """Standard linear solid along the first axis: `share` of each change arrives with a delay (Prony series, one term)."""
    slow = np.zeros(response.shape[1:])
    out, decay = np.empty_like(response), np.exp(-step_s / time_constant_s)
    before = np.zeros(response.shape[1:])
    for k, now in enumerate(response):
        slow = decay * slow + share * (now - before)   # the part not yet arrived
        out[k], before = now - slow, now
    return out


def read_virtual_sensor(spec, deformation_map_mm, *, trials, seed, item, settings=VirtualSensorSettings()):
    """Counts (trial, force, row, column) for maps (force, y, x) in mm of one loading; `item` tells presses apart."""
    s = settings
    specimen = np.random.default_rng([seed, 0])
    shape = (spec.taxels.rows, spec.taxels.columns)
    gain = 1 + s.gain_scatter * specimen.standard_normal(shape)
    offset = s.offset_counts * specimen.standard_normal(shape)
    trial_rng = np.random.default_rng([seed, 1, *item.encode()])
    rest = capacitance_per_area(spec, 0.0)
    change = taxel_means(spec, capacitance_per_area(spec, deformation_map_mm)) / rest - 1
    response = lagged(s.counts_per_relative_change * change, share=s.relaxation, time_constant_s=s.relaxation_s,
                      step_s=s.level_s)
    drift = 1 + s.drift * trial_rng.standard_normal((trials, 1, 1, 1))
    counts = gain * response * drift + offset + s.noise_counts * trial_rng.standard_normal((trials, *response.shape))
    return np.clip(s.step_counts * np.round(counts / s.step_counts), 0.0, s.largest_counts)
