"""Windows of stretch: of the tests behind a law, and along a test's path."""

from collections.abc import Mapping, Sequence

from softtact.materials.laws.base import TEST_PATHS


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
