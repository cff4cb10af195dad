"""The shape of curves and maps: whether a curve of contact area meets the paper's statements, and which features of an object show.

The paper states: the area grew with the force, "but not necessarily linearly"; one circle was detected around each contact; real
and simulated area differed by 0.008 mm2. As a rule, a curve is compatible if
    it rises at every force;
    it grows by at least five times the paper's RMSE over the test, else the error would hide the growth;
    neighbouring discs stay two pixels of the camera apart, else they merge and no circle surrounds a single one;
    no step's rate (area per force) exceeds four times the mean rate, since the paper would have mentioned a jump.
The deviation from a straight line is reported but not judged.
For a deformation map the prominent features are counted, and a lower feature beside a higher one is measured.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import ndimage

if TYPE_CHECKING:
    import xarray

PAPER_RMSE_MM2 = 0.008          # section 4.1
LEAST_GROWTH_MM2 = 5 * PAPER_RMSE_MM2
LEAST_GAP_PIXELS = 2
LARGEST_RATE = 4.0
STANDS_OUT = 0.5          # of a map's largest deformation; a connected part above it is a feature
LOWER_MM = 0.5            # height difference of the paper's lower features of objects 5 and 6
_SAME_HEIGHT_MM = 0.05    # largest difference of heights that count as equal

COLUMNS = ["item", "model", "force_n", "features", "raised_mm", "lower_mm", "lower_sd_mm", "lower_points", "lower_share",
           "frustum_share"]


def measures(force_n: "np.ndarray | pd.Series", area_mm2: "np.ndarray | pd.Series", *, pitch_mm: float) -> dict[str, float]:
    """The quantities of the rule for a curve of area (f,) per frustum at forces (f,), without those of 0 N.

    growth_mm2, growth_share: from the first force to the last;  disc_gap_mm: between equal circles of the last area;
    largest_step_share: of the growth, in one step;  largest_rate: the steepest step's area per force over the mean one;
    departure_from_line: largest distance from the straight line between the ends, as a share of the growth.
    """
    force, area = (np.asarray(values, dtype=float)[np.asarray(force_n) > 0] for values in (force_n, area_mm2))
    growth = area[-1] - area[0]
    scale = growth if abs(growth) > 1e-9 else np.inf
    line = np.interp(force, force[[0, -1]], area[[0, -1]])
    rate = np.diff(area) / np.diff(force) * (force[-1] - force[0])
    return {"from_n": float(force[0]), "to_n": float(force[-1]), "growth_mm2": float(growth),
            "growth_share": float(growth / area[0]), "rising": bool((np.diff(area) > 0).all()),
            "disc_gap_mm": float(pitch_mm - 2 * np.sqrt(area[-1] / np.pi)),
            "largest_step_share": float((np.diff(area) / scale).max(initial=0.0)),
            "largest_rate": float((rate / scale).max(initial=0.0)),
            "departure_from_line": float(np.abs((area - line) / scale).max())}


def objections(found: dict[str, float], *, pixel_mm: float) -> list[str]:
    """Sentences on how a curve with these `measures` breaks the rule; empty if it is compatible."""
    least_gap = LEAST_GAP_PIXELS * pixel_mm
    reasons = []
    if not found["growth_mm2"] >= LEAST_GROWTH_MM2:
        reasons.append(f"its area changes by {found['growth_mm2']:.3f} mm2, less than {LEAST_GROWTH_MM2:g} mm2 "
                       "(five times the paper's RMSE)")
    elif not found["rising"]:
        reasons.append("its area falls between two forces")
    if not found["disc_gap_mm"] >= least_gap:
        reasons.append(f"its discs leave {max(found['disc_gap_mm'], 0):.3f} mm between them, less than {least_gap:g} mm "
                       "(two pixels), so that no circles could be told apart")
    if found["largest_rate"] > LARGEST_RATE:
        reasons.append(f"it grows in a jump ({found['largest_step_share']:.0%} of the growth in one step, at "
                       f"{found['largest_rate']:.1f} times the mean rate)")
    return reasons


def verdict(name: str, found: dict[str, float], *, pixel_mm: float) -> str:
    """One sentence on a curve called `name`."""
    against = objections(found, pixel_mm=pixel_mm)
    span = f"{found['from_n']:g} to {found['to_n']:g} N"
    if against:
        return f"{name}: hardly compatible with the paper's curve: from {span} " + ", and ".join(against) + "."
    return (f"{name}: compatible with the paper's curve: from {span} its area grows by {found['growth_mm2']:.3f} mm2 per frustum "
            f"({found['growth_share']:.0%}), at most {found['largest_rate']:.1f} times as fast as on average, "
            f"{found['departure_from_line']:.0%} of the growth off a straight line, and {found['disc_gap_mm']:.2f} mm stay between "
            "discs.")


def judge(orientations: "pd.DataFrame", *, pitch_mm: float, pixel_mm: float) -> list[dict[str, Any]]:
    """Records {orientation, law, allowed, sentence, and the measures} of a long table (orientation, law, force_n,
    area_per_frustum_mm2).
    """
    records = []
    for (orientation, law), curve in orientations.groupby(["orientation", "law"], sort=False):
        found = measures(curve.force_n, curve.area_per_frustum_mm2, pitch_mm=pitch_mm)
        records.append({"orientation": orientation, "law": law, "allowed": not objections(found, pixel_mm=pixel_mm),
                        "sentence": verdict(f"{orientation}, {law}", found, pixel_mm=pixel_mm), **found})
    return records


def summary_sentence(records: Sequence[dict[str, Any]]) -> str:
    """One sentence on which of the judged orientations and laws are compatible with the paper."""
    allowed = [f"{r['orientation']} with {r['law']}" for r in records if r["allowed"]]
    orientations = list(dict.fromkeys(r["orientation"] for r in records))
    out = [name for name in orientations if not any(r["allowed"] for r in records if r["orientation"] == name)]
    text = f"The paper's words allow {', '.join(allowed)}." if allowed else "The paper's words allow none of the curves."
    return text + (f" They hardly allow the orientation {' or '.join(out)} with any law." if out else "")


def count_features(map_mm: np.ndarray) -> int:
    """Number of parts, connected by sides or corners, of a map (y, x) above STANDS_OUT times its largest value."""
    return int(ndimage.label(map_mm > STANDS_OUT * map_mm.max(), structure=np.ones((3, 3)))[1])


def feature_masks(heights_mm: np.ndarray, *, lower_mm: float = LOWER_MM,
                  same_mm: float = _SAME_HEIGHT_MM) -> tuple[np.ndarray, np.ndarray]:
    """(raised, lower) masks (y, x) of an object's underside: the parts that touch first, and those `lower_mm` above.

    same_mm: heights within it are one
    """
    rise = heights_mm - np.nanmin(heights_mm)
    return rise < same_mm, np.abs(rise - lower_mm) < same_mm


def lower_shares(maps_mm: np.ndarray, heights_mm: np.ndarray, *, lower_mm: float) -> np.ndarray:
    """Mean deformation under the lower feature over that under the raised ones (l,), of maps (l, y, x) in mm.

    heights_mm (y, x): of the object over the map's grid, nan beside it;  lower_mm: by which the lower feature stands back
    nan where no point of the map lies under one of the two.
    """
    raised, lower = feature_masks(heights_mm, lower_mm=lower_mm, same_mm=min(_SAME_HEIGHT_MM, 0.4 * lower_mm))
    if not (raised.any() and lower.any()):
        return np.full(len(maps_mm), np.nan)
    return maps_mm[:, lower].mean(axis=1) / maps_mm[:, raised].mean(axis=1)


def measure_press(press: "xarray.Dataset", heights_mm: np.ndarray, *, frustum_height_mm: float) -> dict[str, Any]:
    """One row by COLUMNS of a press (data set) at its largest force; `heights_mm` (y, x) of the object over the map's grid."""
    final = press.isel(step=-1)
    values = final.deformation_map_mm.values
    raised, lower = feature_masks(heights_mm)
    there = lower.any()
    high, low = float(values[raised].mean()), float(values[lower].mean()) if there else np.nan
    return {"item": press.attrs["item"], "model": press.attrs["model"], "force_n": float(final.normal_force_n),
            "features": count_features(values), "raised_mm": high, "lower_mm": low,
            "lower_sd_mm": float(values[lower].std(ddof=1)) if lower.sum() > 1 else np.nan, "lower_points": int(lower.sum()),
            "lower_share": low / high, "frustum_share": float(final.frustum_compression_mm) / frustum_height_mm}


def feature_table(presses: "Iterable[xarray.Dataset]", heights_of: dict[str, np.ndarray], *,
                  frustum_height_mm: float) -> pd.DataFrame:
    """A row for each press; heights_of {item: (y, x)} in mm."""
    rows = [measure_press(press, heights_of[press.attrs["item"]], frustum_height_mm=frustum_height_mm) for press in presses]
    return pd.DataFrame(rows, columns=COLUMNS)
