"""Presses by force over time on sensors of layers whose stiffness relaxes as one: creep under loads that are held.

If all moduli of a sensor relax alike, its state under a force F(t) that never falls is its state after a long time under
    F_eff(t) = int c(t - s) dF/ds ds,
with c the creep function of `materials.prony`, from 1 - sum c_j to 1 (correspondence of contact that grows: Lee and Radok, J. Appl.
Mech. 27 (1960) 438-444; exact for linear layers on rigid objects without friction, else as good as one factor for all stresses).
So a press is solved at the forces F_eff as if it were slow, by any model, and its forces are then multiplied by F/F_eff.
"""

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.press.result import PressResult

if TYPE_CHECKING:
    import xarray

    from softtact.sensors.base import BaseSpec

_ALIKE = 1e-12  # of the largest force: forces that differ by less are one load step
_UNITS_OF_FORCE = ("N", "N mm", "MPa")  # of readings that follow the load
_FORCES = ("normal_force_n", "pad_force_n", "shell_force_n", "force_n", "torque_nmm", "residual_n", "traction_mpa")


def effective_forces(force_n: np.ndarray, times_s: np.ndarray, shares: np.ndarray, late_s: np.ndarray) -> np.ndarray:
    """F_eff (k,) in N at times (k,) in s, of a force that rises in straight lines from 0 at 0 s to force_n (k,) at them.

    shares, late_s (n,): c_j and T_j of c(t) = 1 - sum c_j exp(-t / T_j)
    """
    force, times = np.concatenate([[0.0], force_n]), np.concatenate([[0.0], times_s])
    rate = np.diff(force) / np.diff(times)

    ended = times[1:, None] - times[1:]  # so long before each time each line of the force ended
    last = np.where(ended >= 0, np.diff(times), 0.0)
    late = np.exp(-np.maximum(ended, 0.0)[..., None] / late_s) * np.expm1(-last[..., None] / late_s)
    found: np.ndarray = (last + late @ (shares * late_s)) @ rate  # of the integral of c over each line
    return found


def refuse_creep(spec: "BaseSpec", motion: Motion) -> np.ndarray | None:
    """The times (k,) in s of a motion's steps, None without durations.

    Raises InputError for durations on a sensor that relaxes.
    """
    if motion.times_s is not None and spec.creep is not None:
        raise InputError(f"motion: {spec.name} relaxes, which over time is known for presses straight down by force; write such as "
                         '"fz -10 over 0.5; hold 60 in 6" for a model other than solid, or leave the durations out.')
    return motion.times_s


def slow_press(motion: Motion, creep: "tuple[np.ndarray, np.ndarray] | None") -> tuple[Motion, np.ndarray, np.ndarray]:
    """The slow press by rising forces that stands for a timed one, its load step's number at each step (k,), and F_eff (k,).

    creep: c_j and T_j;  None: nothing creeps
    Raises InputError where the force falls, and for a load that does not press.
    """
    force, times = motion.held_forces_n, motion.times_s
    assert force is not None and times is not None
    if (idle := np.flatnonzero(force <= 0)).size:
        raise InputError(f"motion: the load of step {idle[0] + 1}, fz {-force[idle[0]]:g} N, does not press; give one below 0, or "
                         "leave that step out.")
    if (falls := np.flatnonzero(np.diff(force) < 0)).size:
        raise InputError(f"motion: the force falls at step {falls[0] + 2} of {len(force)}, and a press of layers over time is "
                         "known while its load grows or is held; leave that step out, or press a sensor of kind solid.")
    effective = effective_forces(force, times, *(creep or (np.zeros(0), np.zeros(0))))
    new = np.diff(effective, prepend=0.0) > _ALIKE * effective[-1]
    return Motion().press(force_n=effective[new]), np.cumsum(new) - 1, effective


def at_times(result: PressResult, load_step: np.ndarray, effective_n: np.ndarray, motion: Motion) -> PressResult:
    """The result of a slow press as that of the timed one, as far as its load steps are reached; see `slow_press`."""
    there = load_step < result.steps
    index, scale = load_step[there], (np.asarray(motion.held_forces_n) / effective_n)[there]
    changed: dict[str, Any] = {one.name: getattr(result, one.name)[index] for one in fields(PressResult)
                               if one.metadata.get("dimensions", ("",))[0] == "step" and getattr(result, one.name) is not None}
    for name in _FORCES:
        changed[name] = changed[name] * scale.reshape(-1, *[1] * (changed[name].ndim - 1))
    changed["wall_time_s"] = np.where(np.diff(index, prepend=-1) > 0, result.wall_time_s[index], 0.0)
    placed = result.placed_object
    return replace(result, **changed, time_s=motion.times_s[there],      # type: ignore[index]
                   readings={name: _read_under(reading.isel(step=index), scale) for name, reading in result.readings.items()},
                   bodies=tuple(result.bodies[k] for k in index) if result.bodies else (),
                   placed_object=placed and replace(placed, way_mm=placed.way_mm[index]))


def _read_under(reading: "xarray.DataArray", scale: np.ndarray) -> "xarray.DataArray":
    """A reading (step, ...) with its forces and pressures times scale (step,); counts, depths and images stay."""
    import xarray

    factor, follows = xarray.DataArray(scale, dims="step"), _UNITS_OF_FORCE
    if "units" in reading.coords:
        times = xarray.where(reading["units"].isin(follows), factor, 1.0).transpose("step", ...)
        return reading.copy(data=(reading * times).transpose(*reading.dims).values)
    return reading.copy(data=(reading * factor).values) if reading.attrs.get("units") in follows else reading
