"""Is F/d a property of the tissue? The paper's relative hardness, and an index of our own, over load and the tissue's height.

The beam and the tissue are springs in series, so F/d mostly tells the beam. The index takes the tissue's own compression c, the
jaw's way less the beam's deflection, which an instrument with an encoder in its jaw knows: the apparent modulus at rest
E_a = lim F/c x height/(length x depth), from F = a c + b c^2 fitted to a sweep, so that stiffening with strain goes into b.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.probe.design import Design, Hardness
from softtact.probe.sweep import palpate


def apparent_modulus(force_n: np.ndarray, compression_mm: np.ndarray, *, height_mm: float, area_mm2: float) -> float:
    """E_a in MPa of a sweep (s,), two steps or more."""
    if len(force_n) < 2:
        raise InputError("An apparent modulus needs two steps or more; give smaller steps.")
    terms = np.column_stack([compression_mm, compression_mm**2])
    return float(np.linalg.lstsq(terms, force_n, rcond=None)[0][0] * height_mm / area_mm2)


def hardness_table(design: Design, settings: Hardness, *, threads: int = 1, tell: Callable[[str], None] = lambda text: None
                   ) -> pd.DataFrame:
    """A row for each tissue, height and share of the jaw's way: the largest force, F/d there, and the index."""
    rows = []
    for height in settings.tissue_heights:
        own = design.with_(geometry={"tissue_height": height})
        ways = np.linspace(0, design.displacement_mm.to, settings.steps + 1)[1:]
        for tissue in design.tissues:
            sweep = palpate(own, tissue, "displacement", values=ways, threads=threads, tell=tell)
            for share in settings.shares:
                count = round(share * settings.steps)
                force, deflection = sweep.force_n[:count], sweep.beam_deflection_mm[:count]
                index = apparent_modulus(force, sweep.jaw_mm[:count] - deflection, height_mm=height,
                                         area_mm2=design.geometry.length * design.geometry.depth)
                rows.append({"tissue": tissue, "tissue_height_mm": height, "jaw_mm": sweep.jaw_mm[count - 1], "force_n": force[-1],
                             "relative_hardness_n_mm": force[-1] / deflection[-1], "apparent_modulus_mpa": index})
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class HardnessVerdict:
    """What a table of `hardness_table` says of a measure of hardness."""

    change_with_load: float
    """Largest value over the least of a tissue of one height, less 1; the worst of them."""
    change_with_height: float
    """The same over heights, at the largest load."""
    contrast: float
    """Least ratio, over heights, of the hardest tissue's largest-load value to the softest one's."""
    apart: bool
    """Whether the values of any two tissues do not overlap, whatever load and height."""


def verdict(table: pd.DataFrame, column: str) -> HardnessVerdict:
    """`HardnessVerdict` of a column of `hardness_table`."""
    def change(groups):
        return float(max(group.max() / group.min() - 1 for _, group in groups))

    last = table[table.jaw_mm == table.jaw_mm.max()]
    ranges = table.groupby("tissue")[column].agg(["min", "max"]).sort_values("min")
    by_height = last.groupby("tissue_height_mm")[column]
    return HardnessVerdict(change(table.groupby(["tissue", "tissue_height_mm"])[column]), change(last.groupby("tissue")[column]),
                           float((by_height.max() / by_height.min()).min()),
                           bool((ranges["min"].to_numpy()[1:] > ranges["max"].to_numpy()[:-1]).all()))
