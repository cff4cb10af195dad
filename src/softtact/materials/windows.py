"""Windows of stretch: of the tests behind a law, and along a test's path; and which windows and weights have an effect."""

from collections.abc import Collection, Mapping, Sequence

from softtact.errors import InputError
from softtact.materials.curves import MODES, VOLUMETRIC
from softtact.materials.laws.base import TEST_PATHS
from softtact.unknown_names import unknown


def refuse_idle(window: Mapping[str, Sequence[float]], weights: Mapping[str, float], *, modes: Collection[str]) -> None:
    """Refuse a window or a weight {mode: ...} that would change nothing in a fit to curves of these modes."""
    for name, what in (("window", window), ("weight", weights)):
        for mode in what:
            if mode not in MODES:
                said = unknown(mode, MODES, kind="test mode")
                raise InputError(f"The {name} of {mode!r}: {said}{'' if said.endswith('?') else '.'}")
            if mode not in modes:
                raise InputError(f"The {name} of {mode} has no effect, for there is no {mode} curve; leave it out.")
    if VOLUMETRIC in weights:
        raise InputError("The weight of volumetric has no effect, for K is fitted to that curve alone; leave it out.")
    if weights and len(set(modes) - {VOLUMETRIC}) == 1:
        raise InputError("The weight of the only mode has no effect; leave it out, or give a second test.")


def principal_window(windows: Mapping[str, Sequence[float]]) -> tuple[float, float] | None:
    """Lowest and highest principal stretch over {mode: [min, max] stretch along the loading}; None without a test of shape."""
    stretches = [stretch**exponent for mode, window in windows.items() if mode in TEST_PATHS
                 for stretch in window for exponent in TEST_PATHS[mode]]
    return (min(stretches), max(stretches)) if stretches else None


def path_window(principal: tuple[float, float], mode: str) -> tuple[float, float]:
    """(min, max) stretch on the path of a mode along which every principal stretch stays in the window `principal`."""
    low, high = principal
    ends = [sorted((low ** (1 / e), high ** (1 / e))) for e in TEST_PATHS[mode] if e]
    return max(end[0] for end in ends), min(end[1] for end in ends)
