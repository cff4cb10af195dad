"""Recordings of a sensor whose hidden constants are known: what a calibration is tried on, and a recording to begin with.

Synthetic, and named so in the recording's `source`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
import trimesh

from softtact.calibration.ladder import Presses
from softtact.press.sensor import Sensor
from softtact.readout.hysteresis import lagged
from softtact.readout.recording import FINGERS, make_recording
from softtact.readout.taxels import relative_change
from softtact.readout.virtual_sensor import VirtualSensorSettings, amplified, converted, make_specimen, taxel_capacitance

if TYPE_CHECKING:
    import xarray

_LEVELS = 14           # other forces than those that a calibration presses
_SMALL_MM = 0.1
BASELINE = 9000        # raw counts at rest


@dataclass(frozen=True)
class HiddenConstants:
    """A specimen as it was made: gain (rows, columns) in counts at dC/C0 = 1, the common scale in it;  zero_counts the same shape;
    sheet_excess_mm the same shape, by which the sheet over a taxel is thicker.
    """

    gain: np.ndarray
    zero_counts: np.ndarray
    sheet_excess_mm: np.ndarray
    relaxation: tuple[float, ...] = (0.08, 0.06)
    relaxation_s: tuple[float, ...] = (1.0, 10.0)
    modulus_scale: float = 1.0
    noise_counts: float = 6.0

    def effective_gain(self, sensor: Sensor) -> np.ndarray:
        """Gain (rows, columns) of taxels with the nominal sheet that read the same at a uniform small displacement: what a
        calibration, which knows no sheet of each taxel, can find.
        """
        small = np.full(sensor.spec.map_shape, _SMALL_MM)
        return self.gain * _change(sensor, self, small) / relative_change(sensor.spec, small)

    @classmethod
    def drawn(cls, sensor: Sensor, *, seed: int, scale: float = 2600.0, gain_scatter: float = 0.05) -> Self:
        """A specimen of a seed: gains, zeros and sheet as the virtual sensor draws them, scale and modulus within a fifth, creep
        within a third of its defaults.
        """
        rng = np.random.default_rng([seed, 7])
        settings = VirtualSensorSettings(gain_scatter=gain_scatter)
        made = make_specimen(sensor.spec, seed=seed, settings=settings)     # type: ignore[arg-type]
        common, modulus = np.exp(rng.uniform(-0.2, 0.2, 2))
        return cls(gain=scale * common * made.gain, zero_counts=made.offset_counts, sheet_excess_mm=made.sheet_excess_mm,
                   relaxation=tuple(np.array(settings.relaxation) * rng.uniform(0.67, 1.33, 2)),
                   relaxation_s=tuple(np.array(settings.relaxation_s) * rng.uniform(0.67, 1.33, 2)), modulus_scale=float(modulus))


def staircase_force(levels_n: Sequence[float], *, hold_s: float = 2.0, rate_n_per_s: float = 10.0,
                    sample_hz: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) in s and forces (n,) in N: a rest, up the levels and down again, each held, and a rest."""
    levels = [0.0, *levels_n, *levels_n[-2::-1], 0.0]
    corners = [(0.0, 0.0)]
    for force in levels:
        last, before = corners[-1]
        corners += [(last + abs(force - before) / rate_n_per_s, force), (last + abs(force - before) / rate_n_per_s + hold_s, force)]
    times, forces = np.array(corners).T
    at = np.arange(0, times[-1], 1 / sample_hz)
    return at, np.interp(at, times, forces)


def simulate_recording(presses: Presses, mesh: trimesh.Trimesh, hidden: HiddenConstants, time_s: np.ndarray, force_n: np.ndarray, *,
                       place: Sequence[float] = (0.0, 0.0, 0.0), finger: int = 0, seed: int = 0,
                       file: str = "") -> "xarray.Dataset":
    """A recording (`make_recording`) of an object (mm) pressed on one finger of a specimen; the other feels noise alone.

    place: where the object really lies, x, y in mm and degrees;  time_s, force_n (n,) of the press
    The converter neither clips below the baseline nor above: as the TSF-85's 16 bits about a raw baseline.
    """
    sensor, rng = presses.sensor, np.random.default_rng([seed, finger])
    ladder = Presses(sensor, model=presses.model, levels=_LEVELS, variants=presses.variants).ladder(
        mesh, place, largest_n=1.001 * float(force_n.max()) / hidden.modulus_scale)
    weights = lagged(ladder.weights(force_n / hidden.modulus_scale), time_s, shares=hidden.relaxation,
                     time_constants_s=hidden.relaxation_s)
    felt = np.concatenate([_change(sensor, hidden, np.tensordot(part, ladder.maps_mm, 1)) for part in np.array_split(weights, 20)])
    pressed = amplified(felt, gain=hidden.gain, offset=hidden.zero_counts)
    counts = np.zeros((len(time_s), FINGERS, *pressed.shape[1:]))
    counts[:, finger] = pressed
    noise = hidden.noise_counts * rng.standard_normal(counts.shape)
    raw = converted(counts + BASELINE, noise=noise, largest=65535.0)
    return make_recording(time_s, (raw - BASELINE).astype(int), baseline=np.full(counts.shape[1:], BASELINE),
                          force_n=np.stack([force_n if one == finger else 0 * force_n for one in range(FINGERS)], axis=1),
                          source="synthetic: simulated by softtact with hidden constants", file=file)


def _change(sensor, hidden, maps):
    """dC/C0 (n, row, column) of the specimen under maps (n, y, x) in mm."""
    rest = taxel_capacitance(sensor.spec, np.zeros(maps.shape[-2:]), sheet_excess_mm=hidden.sheet_excess_mm)
    return taxel_capacitance(sensor.spec, maps, sheet_excess_mm=hidden.sheet_excess_mm) / rest - 1
