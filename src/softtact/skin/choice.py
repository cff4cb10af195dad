"""Which elastomer, how thick, and with which taxels."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.files import digest, read_json, write_json
from softtact.progress import progress
from softtact.skin.analysis import Converter, Skin
from softtact.skin.elastomers import Elastomer
from softtact.skin.layout import Layout, module_layout
from softtact.skin.loads import disc
from softtact.skin.maps import crosstalk

_SKINS = 8  # kept with their meshes: as many as there are thicknesses in a table, for the next elastomer
SPECIMEN_MM = 6.0  # thickness of the tested specimens, which the printed t_min is a share of: the authors' published toolbox


def printed_criteria(elastomers: Sequence[Elastomer], *, stress_mpa: float, area_mm2: float) -> pd.DataFrame:
    """A row an elastomer: strain, S in 1/kPa, t_min in mm, W in g/cm2, g a module, whether on the Pareto front.

    t_min is the strain of a specimen of 6 mm in mm, as the authors compute it: not a limit of saturation.
    """
    strain = np.array([elastomer.fit(stress_mpa) for elastomer in elastomers])
    density = np.array([elastomer.density_g_cm3 for elastomer in elastomers])
    t_min, weight = _weights(strain, density)
    sensitivity = _sensitivity(strain, stress_mpa)
    return pd.DataFrame(
        {
            "elastomer": [elastomer.name for elastomer in elastomers],
            "stress_kpa": 1e3 * stress_mpa,
            "strain": strain,
            "young_mpa": stress_mpa / strain,
            "sensitivity_per_kpa": sensitivity,
            "t_min_mm": t_min,
            "weight_g_cm2": weight,
            "weight_g_module": weight * 0.01 * area_mm2,
            "on_front": pareto(sensitivity, weight),
            "within_test": [bool(e.tested_mpa[0] <= stress_mpa <= e.tested_mpa[1]) for e in elastomers],
        }
    )


def pareto(sensitivity: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Which of several choices (..., n) no other one dominates: more sensitive and lighter, one of them strictly."""
    s, w = np.asarray(sensitivity)[..., None, :], np.asarray(weight)[..., None, :]
    own_s, own_w = np.swapaxes(s, -1, -2), np.swapaxes(w, -1, -2)
    dominated = (s >= own_s) & (w <= own_w) & ((s > own_s) | (w < own_w))
    return np.asarray(~dominated.any(axis=-1))


def front_confidence(
    elastomers: Sequence[Elastomer],
    *,
    stress_mpa: float,
    draws: int,
    strain_scatter: float,
    batch_scatter: float,
    ageing_stiffening: float,
    seed: int,
) -> tuple[pd.DataFrame, dict[str, float]]:
    """How often each elastomer is on the front when its strain is not what the curve says; and how often the front is the same.

    strain_scatter: standard deviation of the strain as a share, from test to test
    batch_scatter: largest deviation between batches as a share, taken as even between both limits
    ageing_stiffening: largest rise of stiffness by age as a share, taken as even from none; all independent for each elastomer
    """
    rng = np.random.default_rng(seed)
    strain = np.array([elastomer.fit(stress_mpa) for elastomer in elastomers])
    density = np.array([elastomer.density_g_cm3 for elastomer in elastomers])
    shape = (draws, len(strain))
    factors = {
        "strain_scatter": 1 + strain_scatter * rng.standard_normal(shape),
        "batch": 1 + batch_scatter * rng.uniform(-1, 1, shape),
        "ageing": 1 / (1 + ageing_stiffening * rng.uniform(0, 1, shape)),
    }
    factors["all"] = np.prod(list(factors.values()), axis=0)
    nominal = pareto(_sensitivity(strain, stress_mpa), _weights(strain, density)[1])
    on_front, same = {"elastomer": [elastomer.name for elastomer in elastomers], "nominal": nominal}, {}
    for name, factor in factors.items():
        drawn = np.clip(strain * factor, 1e-3, 0.95)
        front = pareto(_sensitivity(drawn, stress_mpa), _weights(drawn, density)[1])
        on_front[name] = front.mean(axis=0)
        same[name] = float((front == nominal).all(axis=1).mean())
    return pd.DataFrame(on_front), same


@dataclass(frozen=True)
class Needs:
    """What a layer has to do."""

    range_mpa: tuple[float, float]
    """Lowest and highest pressure under the probe: the one to be told from noise, the other within strain and range."""
    probe_mm: float
    """Diameter of the disc that presses."""
    smallest_force_n: float
    """Of the probe, which has to be told from noise, too."""
    detected_counts: float
    """Rise of a taxel from which on it counts as told."""
    strain_limit: float
    """Largest mean strain under the probe."""


def thickness_table(
    elastomers: Sequence[Elastomer],
    layout: Layout,
    *,
    needs: Needs,
    thicknesses_mm: Sequence[float],
    converter: Converter,
    weight_budget_g: float | None,
    spacing_mm: float = 1.5,
) -> pd.DataFrame:
    """A row for each elastomer and thickness, by finite elements of one taxel in the middle of the module, with what it meets.

    The elastomer's modulus is that at the pressure of each load. Rows beyond its curve are left out and counted as not met.
    """
    rows = [
        _layer_row(elastomer, thickness, layout, needs, converter, spacing_mm)
        for elastomer in elastomers
        for thickness in thicknesses_mm
    ]
    table = pd.DataFrame(rows)
    table["in_budget"] = (table.weight_g_module <= weight_budget_g) if weight_budget_g is not None else True
    table["meets_all"] = table[["force_met", "strain_met", "range_met", "in_budget"]].all(axis=1)
    return table


def with_scatter(table: pd.DataFrame, *, needs: Needs, batch_scatter: float, ageing_stiffening: float) -> pd.DataFrame:
    """A `thickness_table` with what the worst batch does: counts when it is stiff and aged, strain when it is soft and new.

    Both are inversely proportional to the modulus, to first order; scatter and stiffening as in `front_confidence`.
    """
    counts = table.counts_at_smallest_force * (1 - batch_scatter) / (1 + ageing_stiffening)
    strain = table.strain * (1 + batch_scatter)
    return table.assign(
        counts_of_worst=counts, strain_of_worst=strain,
        meets_all_at_worst=table.meets_all & (counts >= needs.detected_counts) & (strain <= needs.strain_limit)
    )


def thinnest(table: pd.DataFrame) -> pd.DataFrame:
    """Of a `thickness_table` the thinnest row that meets all, for each elastomer; the lightest first."""
    met = table[table.meets_all].sort_values(["elastomer", "thickness_mm"])
    return met.groupby("elastomer", sort=False).head(1).sort_values("weight_g_module").reset_index(drop=True)


def _layer_row(elastomer, thickness, layout, needs, converter, spacing):
    area = np.pi * needs.probe_mm**2 / 4
    small, large = min(needs.smallest_force_n / area, needs.range_mpa[0]), needs.range_mpa[1]
    row = {
        "elastomer": elastomer.name,
        "thickness_mm": thickness,
        "weight_g_module": 1e-3 * elastomer.density_g_cm3 * layout.area_mm2 * thickness,
    }
    at_rest, mean_depth, rise_small, rise_large = _unit_cell(
        layout.corners_mm[0].tobytes(),
        layout.radius_mm,
        layout.guard_radius_mm,
        thickness,
        elastomer.poisson,
        elastomer.permittivity_fe,
        needs.probe_mm,
        spacing,
        small / elastomer.tested_young_mpa(small),
        large / elastomer.tested_young_mpa(large),
    )
    strain = mean_depth / thickness
    counts = rise_small / converter.step_ff
    return row | {
        "at_rest_ff": at_rest,
        "strain": strain,
        "counts_at_smallest_force": counts,
        "delta_ff_at_highest": rise_large,
        "force_met": counts >= needs.detected_counts,
        "strain_met": strain <= needs.strain_limit,
        "range_met": converter.fits_at_rest(at_rest) and rise_large <= converter.largest_change_ff(at_rest),
        "within_test": elastomer.tested_mpa[0] <= large <= elastomer.tested_mpa[1],
    }


@lru_cache(maxsize=_SKINS)
def _skin(corners, radius, guard, thickness, poisson, spacing):
    """A module with one taxel in its middle, of permittivity 1."""
    triangle = np.frombuffer(corners).reshape(3, 2)
    layout = Layout(triangle, triangle.mean(axis=0)[None], np.zeros(1, dtype=int), triangle[None], radius, guard)
    return Skin(
        layout, thickness_mm=thickness, poisson=poisson, permittivity=1.0, spacing_mm=spacing, layers=3, field_spacing_mm=2.5
    )


@cache
def _unit_cell(corners, radius, guard, thickness, poisson, permittivity, probe, spacing, small, large):
    """Capacitance at rest, mean depth in mm under the probe, rise at the small and at the large ratio of pressure to modulus."""
    skin = _skin(corners, radius, guard, thickness, poisson, spacing)
    load = disc(tuple(skin.layout.centres_mm[0]), diameter_mm=probe, pressure_mpa=1.0)
    unit = skin.layer.displacement(load, young_mpa=1.0)
    mean_depth = -(load.force_n @ (skin.layer.under(load.points_mm) @ unit[:, 2])) / load.total_n * large
    rest = float(skin.at_rest_ff[0])
    pressed = float(skin.field(large * unit).capacitance_ff[0]) if mean_depth < 0.6 * thickness else np.inf
    first_order = float(skin.first_order_ff(load, young_mpa=1.0)[0])
    return permittivity * rest, mean_depth, permittivity * small * first_order, permittivity * (pressed - rest)


def _sensitivity(strain, stress_mpa):
    """S in 1/kPa, eq. (5)."""
    return strain / (1e3 * stress_mpa * (1 - strain))


def _weights(strain, density):
    """t_min in mm and W in g/cm2, eq. (8)."""
    t_min = strain * SPECIMEN_MM
    return t_min, density * 0.1 * t_min


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
