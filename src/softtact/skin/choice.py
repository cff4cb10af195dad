"""The choice of elastomer, thickness and taxels: the papers' criteria, the thinnest layer that meets all needs, a full search.

Le, Maiolino, Mastrogiovanni and Cannata, sec. III-B: sensitivity S, eq. (5), against weight W, eq. (8).
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import pandas as pd

from softtact.progress import progress
from softtact.skin.analysis import Converter, LayerMeshSizes, Skin
from softtact.skin.elastomers import Elastomer
from softtact.skin.layout import Layout, module_layout
from softtact.skin.loads import disc
from softtact.skin.maps import TaxelLayer, crosstalk

FACTORS = ("elastomer", "thickness_mm", "radius_mm", "pitch_mm")
OUTPUTS = ("counts_at_smallest_force", "strain", "crosstalk", "weight_g_module")
SPECIMEN_MM = 6.0  # thickness of the tested specimens, to which the printed t_min is relative: the authors' published toolbox
_SKINS = 8  # skins cached with their factorisations: one for each thickness of a table, for the next elastomer


def printed_criteria(elastomers: Sequence[Elastomer], *, stress_mpa: float, area_mm2: float) -> pd.DataFrame:
    """A row for each elastomer: strain, S in 1/kPa, t_min in mm, W in g/cm2, g of a module, whether it is on the Pareto front.

    t_min is the strain of a specimen of 6 mm in mm, as the authors compute it; it is not a limit of saturation.
    """
    strain = np.array([elastomer.fit(stress_mpa) for elastomer in elastomers])
    density = np.array([elastomer.density_g_cm3 for elastomer in elastomers])
    t_min, weight = _weights(strain, density)
    sensitivity = _sensitivity(strain, stress_mpa)
    return pd.DataFrame({
        "elastomer": [elastomer.name for elastomer in elastomers], "stress_kpa": 1e3 * stress_mpa, "strain": strain,
        "young_mpa": stress_mpa / strain, "sensitivity_per_kpa": sensitivity, "t_min_mm": t_min, "weight_g_cm2": weight,
        "weight_g_module": weight * 0.01 * area_mm2, "on_front": pareto(sensitivity, weight),
        "within_test": [bool(e.tested_mpa[0] <= stress_mpa <= e.tested_mpa[1]) for e in elastomers]})


def pareto(sensitivity: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Whether each choice (..., n) is Pareto optimal: no other is at least as sensitive and light, and better in one of both."""
    s, w = np.asarray(sensitivity)[..., None, :], np.asarray(weight)[..., None, :]
    row_s, row_w = np.swapaxes(s, -1, -2), np.swapaxes(w, -1, -2)
    dominated = (s >= row_s) & (w <= row_w) & ((s > row_s) | (w < row_w))
    return np.asarray(~dominated.any(axis=-1))


def front_confidence(elastomers: Sequence[Elastomer], *, stress_mpa: float, draws: int, strain_scatter: float, batch_scatter: float,
                     ageing_stiffening: float, seed: int) -> tuple[pd.DataFrame, dict[str, float]]:
    """Share of random draws in which each elastomer is on the front, and in which the whole front is the nominal one.

    strain_scatter: standard deviation of the strain between tests, as a share
    batch_scatter: largest deviation between batches, as a share; uniform between both limits
    ageing_stiffening: largest rise of stiffness by age, as a share; uniform from zero. All are independent for each elastomer
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
    """Requirements of a layer."""

    range_mpa: tuple[float, float]
    """Lowest and highest pressure under the probe: the lowest must be detected, the highest stay within strain and range."""
    probe_mm: float
    """Diameter of the disc that presses."""
    smallest_force_n: float
    """Of the probe; it must be detected, too."""
    detected_counts: float
    """Rise of a taxel from which on it counts as detected."""
    strain_limit: float
    """Largest mean strain under the probe."""


def thickness_table(elastomers: Sequence[Elastomer], layout: Layout, *, needs: Needs, thicknesses_mm: Sequence[float],
                    converter: Converter, weight_budget_g: float | None, spacing_mm: float = 1.5) -> pd.DataFrame:
    """A row for each elastomer and thickness, with the needs that it meets, by finite elements of one taxel amid the module.

    The elastomer's modulus is the secant one at the pressure of each load.
    """
    table = pd.DataFrame([_layer_row(elastomer, thickness, layout, needs, converter, spacing_mm)
                          for elastomer in elastomers for thickness in thicknesses_mm])
    return _with_budget(table, weight_budget_g)


def with_scatter(table: pd.DataFrame, *, needs: Needs, batch_scatter: float, ageing_stiffening: float) -> pd.DataFrame:
    """A `thickness_table` with the worst batches: counts of a stiff and aged one, strain of a soft and new one.

    Both are inversely proportional to the modulus, to first order; scatter and stiffening as in `front_confidence`.
    """
    counts = table.counts_at_smallest_force * (1 - batch_scatter) / (1 + ageing_stiffening)
    strain = table.strain * (1 + batch_scatter)
    return table.assign(
        counts_of_worst=counts, strain_of_worst=strain,
        meets_all_at_worst=table.meets_all & (counts >= needs.detected_counts) & (strain <= needs.strain_limit)
    )


def thinnest(table: pd.DataFrame) -> pd.DataFrame:
    """The thinnest row of a `thickness_table` that meets all needs, for each elastomer; the lightest first."""
    met = table[table.meets_all].sort_values(["elastomer", "thickness_mm"])
    return met.groupby("elastomer", sort=False).head(1).sort_values("weight_g_module").reset_index(drop=True)


@dataclass(frozen=True)
class SearchSpace:
    """Values that `search` combines, and the common sizes."""

    thicknesses_mm: Sequence[float]
    """Of the elastomer."""
    radii_mm: Sequence[float]
    """Of the taxels."""
    pitches_mm: Sequence[float]
    """Between the taxels."""
    gap_mm: float
    """Between a taxel and the guard around it."""
    side_mm: float
    """Of the module."""


def search(elastomers: Mapping[str, Elastomer], space: SearchSpace, *, needs: Needs, converter: Converter) -> pd.DataFrame:
    """A row for each combination: that of `thickness_table` without a budget of weight, radius, pitch and crosstalk.

    Raises InputError where a module has no place for taxels of a radius and pitch.
    """
    layouts = {(radius, pitch): module_layout(side_mm=space.side_mm, pitch_mm=pitch, radius_mm=radius,
                                              guard_radius_mm=radius + space.gap_mm)
               for radius in space.radii_mm for pitch in space.pitches_mm}
    combinations = list(itertools.product(elastomers.values(), space.thicknesses_mm, space.radii_mm, space.pitches_mm))
    rows = []
    for elastomer, thickness, radius, pitch in progress(combinations, label="designs"):
        table = thickness_table([elastomer], layouts[radius, pitch], needs=needs, thicknesses_mm=[thickness], converter=converter,
                                weight_budget_g=None)
        beside = _crosstalk(thickness, radius, radius + space.gap_mm, pitch, elastomer.poisson)
        rows.append(table.assign(radius_mm=radius, pitch_mm=pitch, crosstalk=beside))
    return pd.concat(rows, ignore_index=True)


def ranked(table: pd.DataFrame, weight_budget_g: float | None) -> pd.DataFrame:
    """A `search` with a budget of weight and its Pareto front over weight, counts, crosstalk and pitch; the best rows first."""
    table = _with_budget(table, weight_budget_g)
    costs = np.column_stack([table.weight_g_module, -table.counts_at_smallest_force, table.crosstalk.abs(), table.pitch_mm])
    better = np.all(costs[None] <= costs[:, None], axis=2) & np.any(costs[None] < costs[:, None], axis=2)
    table["not_dominated"] = ~better.any(axis=1)
    order = ["meets_all", "not_dominated", "weight_g_module"]
    return table.sort_values(order, ascending=[False, False, True]).reset_index(drop=True)


def main_effects(table: pd.DataFrame) -> pd.DataFrame:
    """A row for each factor: the share of each output's variance that it explains alone (Sobol's first-order index).

    Sobol, Math. Comput. Simul. 55 (2001) 271; exact here, because the search holds all combinations. Counts are in logarithms.
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


def _layer_row(elastomer, thickness, layout, needs, converter, spacing):
    """A row of `thickness_table` without the budget of weight."""
    area = np.pi * needs.probe_mm**2 / 4
    small, large = min(needs.smallest_force_n / area, needs.range_mpa[0]), needs.range_mpa[1]
    cell = _UnitCell(layout.corners_mm[0].tobytes(), layout.radius_mm, layout.guard_radius_mm, thickness, elastomer.poisson,
                     needs.probe_mm, spacing)
    rest, mean_depth, first_order, pressed = _pressed_cell(cell, large / elastomer.tested_young_mpa(large))
    permittivity = elastomer.permittivity_fe
    at_rest, rise_large = permittivity * rest, permittivity * (pressed - rest)
    rise_small = permittivity * (small / elastomer.tested_young_mpa(small)) * first_order
    strain = mean_depth / thickness
    counts = rise_small / converter.step_ff
    return {
        "elastomer": elastomer.name, "thickness_mm": thickness,
        "weight_g_module": 1e-3 * elastomer.density_g_cm3 * layout.area_mm2 * thickness,
        "at_rest_ff": at_rest, "strain": strain, "counts_at_smallest_force": counts, "delta_ff_at_highest": rise_large,
        "force_met": counts >= needs.detected_counts, "strain_met": strain <= needs.strain_limit,
        "range_met": converter.fits_at_rest(at_rest) and rise_large <= converter.largest_change_ff(at_rest),
        "within_test": elastomer.tested_mpa[0] <= large <= elastomer.tested_mpa[1],
    }


def _with_budget(table, weight_budget_g):
    """The table with the need of weight, and whether all needs are met."""
    table["in_budget"] = (table.weight_g_module <= weight_budget_g) if weight_budget_g is not None else True
    table["meets_all"] = table[["force_met", "strain_met", "range_met", "in_budget"]].all(axis=1)
    return table


@dataclass(frozen=True)
class _UnitCell:
    """A module with one taxel in its middle and a probe over it, lengths in mm: all inputs of its meshes and factorisations."""

    corners: bytes
    """(3, 2) of the module, as the array's bytes, so that the cell can be a key."""
    radius: float
    guard_radius: float
    thickness: float
    poisson: float
    probe: float
    """Diameter of the disc that presses."""
    spacing: float
    """Of the mesh for the deformation."""


@lru_cache(maxsize=_SKINS)
def _skin(cell):
    """The `Skin` of a cell, of permittivity 1."""
    triangle = np.frombuffer(cell.corners).reshape(3, 2)
    layout = Layout(triangle, triangle.mean(axis=0)[None], np.zeros(1, dtype=int), triangle[None], cell.radius, cell.guard_radius)
    return Skin(layout, thickness_mm=cell.thickness, poisson=cell.poisson, permittivity=1.0,
                mesh=LayerMeshSizes(spacing_mm=cell.spacing, layers=3, field_spacing_mm=2.5))


@cache
def _pressed_cell(cell, ratio):
    """Of permittivity 1: capacitance at rest, mean depth in mm, its first-order rise for p / E = 1, capacitance when pressed.

    ratio: pressure over modulus, p / E, for the mean depth and the last capacitance
    """
    skin = _skin(cell)
    load = disc(tuple(skin.layout.centres_mm[0]), diameter_mm=cell.probe, pressure_mpa=1.0)
    unit = skin.layer.displacement(load, young_mpa=1.0)
    mean_depth = -(load.force_n @ (skin.layer.under(load.points_mm) @ unit[:, 2])) / load.total_n * ratio
    pressed = float(skin.field(ratio * unit).capacitance_ff[0]) if mean_depth < 0.6 * cell.thickness else np.inf
    return float(skin.at_rest_ff[0]), mean_depth, float(skin.first_order_ff(load, young_mpa=1.0)[0]), pressed


@cache
def _crosstalk(thickness, radius, guard_radius, pitch, poisson):
    """Rise of a neighbour over that of the pressed taxel, which depends on neither modulus nor permittivity."""
    layer = TaxelLayer(radius, guard_radius, thickness, poisson, permittivity=1.0, young_mpa=1.0)
    plain = Converter(step_ff=0.32, range_pf=(4.0, 30.0), offset_step_pf=0.0)
    return float(crosstalk([pitch], layer, probe_mm=2 * radius, converter=plain, pressure_mpa=0.01).crosstalk.iloc[0])


def _sensitivity(strain, stress_mpa):
    """S in 1/kPa, eq. (5)."""
    return strain / (1e3 * stress_mpa * (1 - strain))


def _weights(strain, density):
    """t_min in mm and W in g/cm2, eq. (8)."""
    t_min = strain * SPECIMEN_MM
    return t_min, density * 0.1 * t_min
