"""All combinations of elastomer, thickness, radius and pitch by finite elements, kept one by one to go on from."""

import itertools
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.files import digest, read_json, write_json
from softtact.progress import progress
from softtact.skin.choice import Needs, thickness_table
from softtact.skin.converter import Converter
from softtact.skin.elastomers import Elastomer
from softtact.skin.layout import module_layout
from softtact.skin.maps import crosstalk

FACTORS = ("elastomer", "thickness_mm", "radius_mm", "pitch_mm")
OUTPUTS = ("counts_at_smallest_force", "strain", "crosstalk", "weight_g_module")
_FORMAT = 1  # of what is kept


def search(
    elastomers: Mapping[str, Elastomer],
    *,
    thicknesses_mm: Sequence[float],
    radii_mm: Sequence[float],
    pitches_mm: Sequence[float],
    gap_mm: float,
    side_mm: float,
    needs: Needs,
    converter: Converter,
    weight_budget_g: float | None,
    folder: str | Path,
) -> pd.DataFrame:
    """A row a combination: what `thickness_table` tells of it, crosstalk, whether it meets all, whether another one dominates it.

    folder: where each row is kept as JSON; those that are there already are not computed again
    Raises InputError where a module has no place for taxels of a radius and pitch.
    """
    layouts = {
        (radius, pitch): module_layout(side_mm=side_mm, pitch_mm=pitch, radius_mm=radius, guard_radius_mm=radius + gap_mm)
        for radius in radii_mm
        for pitch in pitches_mm
    }
    combinations = list(itertools.product(elastomers.values(), thicknesses_mm, radii_mm, pitches_mm))
    rows = []
    for elastomer, thickness, radius, pitch in progress(combinations, label="designs"):
        key = digest([_FORMAT, elastomer.model_dump(), thickness, radius, pitch, gap_mm, side_mm, vars(needs), vars(converter)])
        path = Path(folder) / f"{key}.json"
        if not path.exists():
            beside = _crosstalk(thickness, radius, radius + gap_mm, pitch, elastomer.poisson)
            told = _told(elastomer, layouts[radius, pitch], thickness, needs=needs, converter=converter)
            write_json(path, told | {"radius_mm": radius, "pitch_mm": pitch, "crosstalk": beside})
        rows.append(read_json(path))
    return _judged(pd.DataFrame(rows), weight_budget_g)


def _told(elastomer, layout, thickness, *, needs, converter):
    """What `thickness_table` tells of one thickness, as plain values."""
    table = thickness_table(
        [elastomer], layout, needs=needs, thicknesses_mm=[thickness], converter=converter, weight_budget_g=None
    )
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in table.iloc[0].items()}


def main_effects(table: pd.DataFrame) -> pd.DataFrame:
    """A row a factor: which share of each output's variance over the search it explains alone (Sobol's first-order index).

    Sobol, Math. Comput. Simul. 55 (2001) 271; exact here, for the search holds all combinations. Of counts the logarithm is taken.
    """
    values = table.assign(counts_at_smallest_force=np.log(table.counts_at_smallest_force))
    rows = []
    for factor in FACTORS:
        shares = {}
        for output in OUTPUTS:
            whole = values[output].var(ddof=0)
            means = values.groupby(factor)[output].transform("mean")
            shares[output] = means.var(ddof=0) / whole if whole > 0 else np.nan
        rows.append({"factor": factor} | shares)
    return pd.DataFrame(rows)


def _judged(table, weight_budget_g):
    table["in_budget"] = (table.weight_g_module <= weight_budget_g) if weight_budget_g is not None else True
    table["meets_all"] = table[["force_met", "strain_met", "range_met", "in_budget"]].all(axis=1)
    costs = np.column_stack([table.weight_g_module, -table.counts_at_smallest_force, table.crosstalk.abs(), table.pitch_mm])
    better = (costs[None] <= costs[:, None]).all(axis=2) & (costs[None] < costs[:, None]).any(axis=2)
    table["not_dominated"] = ~better.any(axis=1)
    return table.sort_values(["meets_all", "not_dominated", "weight_g_module"], ascending=[False, False, True]).reset_index(
        drop=True
    )


@cache
def _crosstalk(thickness, radius, guard, pitch, poisson):
    """A neighbour's rise over that of the pressed taxel, which depends on neither modulus nor permittivity."""
    plain = Converter(step_ff=0.32, range_pf=(4.0, 30.0), offset_step_pf=0.0)
    table = crosstalk(
        [pitch],
        radius_mm=radius,
        guard_radius_mm=guard,
        thickness_mm=thickness,
        poisson=poisson,
        permittivity=1.0,
        young_mpa=1.0,
        probe_mm=2 * radius,
        converter=plain,
        pressure_mpa=0.01,
    )
    return float(table.crosstalk.iloc[0])
