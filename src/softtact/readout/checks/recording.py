"""All checks of a recording, and of the log of forces beside it.

A fault is safe where what it spoils can be left out or put right: those readings, that taxel, the zero of a load cell. The others
make a calibration wrong without a sign in its result, and `finding.refuse_unsafe` ends there. Each check compares a recording
with itself: its noise, how often its frames are renewed, how its counts follow the force. What is natural gives no finding: rows
that repeat a frame because they are written more often than it is renewed, presses at several places, creep, noise of any size.
"""

from typing import TYPE_CHECKING

from softtact.readout.checks import forces, frames
from softtact.readout.checks.finding import Finding, left_out, zeroed

if TYPE_CHECKING:
    import xarray


def check_recording(recording: "xarray.Dataset", *, largest: float | None = None) -> list[Finding]:
    """All findings in a recording (`softtact.readout.recording`), with those of its forces where it has them (`with_force`).

    largest: counts over the baseline at which the readout ends
    """
    both = tuple(range(recording.sizes["finger"]))
    found = [Finding("repaired", sentence, both) for sentence in recording.attrs["repairs"]]
    found += frames.wrong_readings(recording)
    found += frames.clipped_taxels(recording, left_out(recording, found), largest)
    found += frames.dead_taxels(recording)
    found += frames.frozen_frames(recording)
    found += frames.hanging_taxels(recording, left_out(recording, found))
    return found + (_of_forces(recording, found) if "force_n" in recording else list(frames.common_drift(recording)))


def _of_forces(recording, of_counts):
    """Findings in the forces; each later check relies on what the earlier ones found sound."""
    found = list(forces.gaps(recording))
    found += forces.standing_log(recording, left_out(recording, [*of_counts, *found]))
    spoiled = left_out(recording, [*of_counts, *found])
    found += forces.load_cell_zero(recording, spoiled)
    recording = zeroed(recording, found)
    for check in (forces.unit, forces.sign, forces.delay, forces.drift):
        if all(one.safe for one in found):
            found += check(recording, spoiled)
    return found
