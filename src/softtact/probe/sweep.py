"""Sweeps of a palpation sensor, and measures of hardness from them.

A sweep loads or moves the jaw step by step and gives the beam's deflection d and the films' forces. The paper's relative hardness
is F/d. Beam and tissue are springs in series, so F/d depends mostly on the beam. The apparent modulus takes the tissue's
compression c, the jaw's displacement less the beam's deflection, which an encoder in the jaw can measure: E_a = lim F/c x
height/(length x depth) at rest, from F = a c + b c^2 fitted to a sweep, so that stiffening with strain goes into b.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.materials.laws.base import Law
from softtact.models.solid.path import SolidPath
from softtact.probe.design import Hardness, PalpationDesign
from softtact.probe.structure import JAW, structure_body
from softtact.readout.strip import FilmReader

if TYPE_CHECKING:
    import xarray as xr


Scenario = Literal["load", "displacement"]
_CURVES = ("jaw_mm", "force_n", "beam_deflection_mm", "extrapolated_volume_fraction")
_REST_TERMS = 3           # of the polynomial of the deflection whose tangent at rest is taken


@dataclass(frozen=True)
class Palpation:
    """A sweep of s steps."""

    scenario: Scenario
    tissue: str
    jaw_mm: np.ndarray
    """(s,) displacement of the jaw, down."""
    force_n: np.ndarray
    """(s,) of the jaw on the tissue."""
    beam_deflection_mm: np.ndarray
    """(s,) of the beam's middle, down."""
    film_force_n: np.ndarray
    """(s, films), positive in compression."""
    films: tuple[str, ...]
    """Names of the films."""
    extrapolated_volume_fraction: np.ndarray
    """(s,) largest share of a region's volume beyond the data of its law; nan without such data."""
    displacement_mm: np.ndarray
    """(n, 3) of the mesh's nodes at the last step."""

    def table(self) -> pd.DataFrame:
        """A row for each step."""
        columns = {"tissue": self.tissue, "scenario": self.scenario, "step": np.arange(1, len(self.force_n) + 1),
                   "jaw_mm": self.jaw_mm, "force_n": self.force_n, "beam_deflection_mm": self.beam_deflection_mm}
        films = {f"film_{name.replace(' ', '_')}_n": force for name, force in zip(self.films, self.film_force_n.T, strict=True)}
        return pd.DataFrame(columns | films | {"extrapolated_volume_fraction": self.extrapolated_volume_fraction})

    def dataset(self) -> "xr.Dataset":
        """The curves with the films by name, and the last displacement, for NetCDF."""
        import xarray

        curves = {name: ("step", getattr(self, name)) for name in _CURVES}
        last = {"displacement_mm": (("node", "axis"), self.displacement_mm, {"units": "mm", "long_name": "at the last step"})}
        return xarray.Dataset(curves | last | {"film_force_n": (("step", "film"), self.film_force_n)},
                              coords={"film": list(self.films), "axis": ["x", "y", "z"]},
                              attrs={"tissue": self.tissue, "scenario": self.scenario})

    @classmethod
    def of(cls, data: "xr.Dataset") -> "Palpation":
        """The sweep of a `dataset`."""
        return cls(data.attrs["scenario"], data.attrs["tissue"], **{name: data[name].values for name in (*_CURVES, "film_force_n")},
                   films=tuple(map(str, data.film.values)), displacement_mm=data.displacement_mm.values)


@dataclass(frozen=True)
class Slope:
    """The relative hardness F/d of a sweep."""

    line_n_mm: float
    """Slope in N/mm of the least-squares line through rest and all steps, with an intercept, like a chart's trend line."""
    intercept_n: float
    """Of that line."""
    secant_n_mm: tuple[float, float]
    """Least and largest F/d of the steps."""
    initial_n_mm: float
    """Tangent dF/dd at rest."""
    final_n_mm: float
    """Tangent at the last step, from the last two."""


def slope(force_n: np.ndarray, deflection_mm: np.ndarray) -> Slope:
    """`Slope` of forces (s,) and deflections (s,), two steps or more.

    The tangent at rest is that of the polynomial F = a d + b d^2 + c d^3 through the first three steps, or of two.
    Raises InputError where the beam does not deflect.
    """
    if len(force_n) < 2 or not (np.diff(deflection_mm, prepend=0.0) > 0).all():
        raise InputError("A slope needs two steps or more under which the beam's deflection grows; give smaller or more steps.")
    force, deflection = np.append(0.0, force_n), np.append(0.0, deflection_mm)
    line, intercept = np.polyfit(deflection, force, 1)
    d, f = deflection_mm[:_REST_TERMS], force_n[:_REST_TERMS]
    initial = np.linalg.solve((d / d[-1])[:, None] ** np.arange(1, len(d) + 1), f)[0] / d[-1]
    secant = force_n / deflection_mm
    return Slope(float(line), float(intercept), (float(secant.min()), float(secant.max())), float(initial),
                 float((force[-1] - force[-2]) / (deflection[-1] - deflection[-2])))


def palpate(design: PalpationDesign, tissue: str, scenario: Scenario, *, law: Law | None = None, values: np.ndarray | None = None,
            threads: int = 1, report: Callable[[str], None] = lambda text: None) -> Palpation:
    """Sweep the jaw over a tissue of a design by load (N) or displacement (mm).

    law: in place of the tissue's;  values: rising values at the ends of the steps, by default the design's
    Raises InputError for an unknown tissue, ConvergenceError where a step is not reached.
    """
    body = structure_body(design, law or design.tissue(tissue).make(), threads=threads)
    readers = [FilmReader.on(body, film.on, film.side, (film.start, film.end)) for film in design.films.values()]
    middle = _beam_middle(body, design)
    if values is None:
        values = (design.load_n if scenario == "load" else design.displacement_mm).values
    motion = Motion()
    for change, value in zip(np.diff(values, prepend=0.0), values, strict=True):
        motion = motion.step(loads={"y": -float(value)}) if scenario == "load" else motion.step(ways={"y": -float(change)})
    rows, films, outside, state = [], [], [], None
    for step in SolidPath(body, {JAW: motion}, tell=report).run():
        state = step.state
        rows.append((-state.poses[0].translation[1], -step.loads[0, 1], -state.displacement[middle, 1]))
        films.append([reader.force_n(state.displacement) for reader in readers])
        outside.append(step.extrapolated_volume_fraction)
        report(f"{tissue}, {scenario}: step {len(rows)} of {len(values)}, {rows[-1][1]:.3g} N")
    assert state is not None
    jaw, force, deflection = np.array(rows).T
    return Palpation(scenario, tissue, jaw, force, deflection, np.array(films), tuple(design.films), np.array(outside),
                     state.displacement[:len(body.mesh.points)])


def _beam_middle(body, design):
    """The node in the middle of the beam's length, height and, of a solid, depth."""
    g = design.geometry
    beam = np.unique(np.concatenate([nodes.ravel() for region, nodes, _ in body.blocks if region == "beam"]))
    place = [g.middle, 0.5 * (g.levels[1] + g.levels[2]), 0.5 * g.depth if design.model == "solid" else 0.0]
    return beam[np.linalg.norm(body.points[beam] - place, axis=1).argmin()]


def apparent_modulus(force_n: np.ndarray, compression_mm: np.ndarray, *, height_mm: float, area_mm2: float) -> float:
    """E_a in MPa of a sweep (s,), two steps or more."""
    if len(force_n) < 2:
        raise InputError("An apparent modulus needs two steps or more; give smaller steps.")
    terms = np.column_stack([compression_mm, compression_mm**2])
    return float(np.linalg.lstsq(terms, force_n, rcond=None)[0][0] * height_mm / area_mm2)


def hardness_table(design: PalpationDesign, settings: Hardness, *, threads: int = 1,
                   report: Callable[[str], None] = lambda text: None) -> pd.DataFrame:
    """A row for each tissue, height and share of the jaw's displacement: the largest force, F/d there, and E_a."""
    rows = []
    for height in settings.tissue_heights:
        changed = design.with_(geometry={"tissue_height": height})
        values = np.linspace(0, design.displacement_mm.to, settings.steps + 1)[1:]
        for tissue in design.tissues:
            sweep = palpate(changed, tissue, "displacement", values=values, threads=threads, report=report)
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
    """Whether a measure of hardness is a property of the tissue alone, from a `hardness_table`."""

    change_with_load: float
    """Largest value over the least, less 1, of a tissue of one height; the worst of all."""
    change_with_height: float
    """The same over heights, at the largest load; 0 of one height, which shows nothing."""
    contrast: float
    """Value of the hardest tissue over that of the softest one at the largest load; the least over heights."""
    apart: bool
    """Whether the values of any two tissues do not overlap over all loads and heights."""
    heights: int
    """How many heights of tissue the table holds."""


def at_largest_displacement(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a `hardness_table` at the jaw's largest displacement, which sums of steps reach up to round-off."""
    return table[np.isclose(table.jaw_mm, table.jaw_mm.max(), rtol=1e-9, atol=0.0)]


def verdict(table: pd.DataFrame, column: str) -> HardnessVerdict:
    """`HardnessVerdict` of a column of `hardness_table`."""
    def change(groups):
        return float(max(group.max() / group.min() - 1 for _, group in groups))

    last = at_largest_displacement(table)
    ranges = table.groupby("tissue")[column].agg(["min", "max"]).sort_values("min")
    by_height = last.groupby("tissue_height_mm")[column]
    return HardnessVerdict(change(table.groupby(["tissue", "tissue_height_mm"])[column]), change(last.groupby("tissue")[column]),
                           float((by_height.max() / by_height.min()).min()),
                           bool((ranges["min"].to_numpy()[1:] > ranges["max"].to_numpy()[:-1]).all()),
                           int(table.tissue_height_mm.nunique()))
