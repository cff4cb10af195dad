"""Do the laws of one card tell the same story, where the data are and just outside?

The difference of two laws on a path is the root mean square of the difference of their nominal stresses over that of their mean.
"""

import itertools
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from softtact.materials.laws.base import TEST_PATHS, Law
from softtact.materials.windows import path_window

THRESHOLD = 0.2     # laws that part by more are named
MARGIN = 0.1        # "just outside": so much farther, as a share of the window's extent in log stretch
_POINTS = 33


def paths_inside(windows: Mapping[str, tuple[float, float]]) -> dict[str, np.ndarray]:
    """{mode: stretches (n,)} over the windows {mode: (min, max)} of the tests."""
    return {mode: np.geomspace(*window, _POINTS) for mode, window in windows.items() if mode in TEST_PATHS}


def paths_outside(principal: tuple[float, float]) -> dict[str, np.ndarray]:
    """{mode: stretches (n,)} just beyond the window `principal` of principal stretches, in both directions of all three paths."""
    paths = {}
    for mode in TEST_PATHS:
        low, high = path_window(principal, mode)
        reach = (high / low) ** MARGIN
        paths[mode] = np.concatenate([np.geomspace(low / reach, low, _POINTS), np.geomspace(high, high * reach, _POINTS)])
    return paths


def difference(one: Law, other: Law, paths: Mapping[str, np.ndarray]) -> tuple[float, str]:
    """(largest difference of two laws over the paths, its mode)"""
    found = [(_difference(one, other, mode, stretch), mode) for mode, stretch in paths.items()]
    return max(found)


def _difference(one, other, mode, stretch):
    a, b = one.nominal_stress(mode, stretch), other.nominal_stress(mode, stretch)
    with np.errstate(invalid="ignore"):
        value = np.sqrt(np.mean((a - b) ** 2) / np.mean((0.5 * (a + b)) ** 2))
    return float(value) if np.isfinite(value) else np.inf


def differences(laws: Mapping[str, Law], paths: Mapping[str, np.ndarray]) -> dict[str, dict[str, dict[str, Any]]]:
    """{law: {other: {"difference": share, or None where one does not exist, "mode": ...}}} of laws {name: Law}, each pair twice."""
    table: dict[str, dict[str, dict[str, Any]]] = {name: {} for name in laws}
    for one, other in itertools.combinations(laws, 2):
        value, mode = difference(laws[one], laws[other], paths)
        entry = {"difference": value if np.isfinite(value) else None, "mode": mode}
        table[one][other] = table[other][one] = entry
    return table


def partings(chosen: str, agreement: Mapping[str, Any], *, among: Collection[str], threshold: float = THRESHOLD) -> Iterator[str]:
    """Sentences on the laws of the list `among` that part from the chosen one by more than `threshold`."""
    for place, where in (("inside", "within the data"), ("outside", "just outside the data")):
        named = [f"{name} by {_share(entry)} ({entry['mode']})" for name, entry in agreement[place].get(chosen, {}).items()
                 if name in among and (entry["difference"] is None or entry["difference"] > threshold)]
        if named:
            remedy = "the curves do not say which is right there" if place == "outside" else "the others do not fit"
            yield f"{chosen} and other laws part {where}: {', '.join(named)}; {remedy}."


def _share(entry):
    return "any amount" if entry["difference"] is None else f"{entry['difference']:.0%}"
