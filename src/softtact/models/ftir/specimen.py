"""The dielectric between a plate and glass (FTIR): one cell of its lattice, and all frusta, each with its height and tip.

`press_cell_on_glass` computes force per frustum against contact area. For a specimen, the forces and contact discs of all frusta
are computed under a plate without rotation, with one cell per frustum. Frustum i of height h_i is compressed by
c_i = max(0, d - (h_max - h_i)) when the plate is at a depth d below its first touch, so
    sum_i F(c_i; h_i, t_i) = F_total
is one equation for d. The cell's force F and area A come from `press_cell_on_glass` at a few heights and tip diameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from softtact.contact.height_field import HeightField
from softtact.errors import ConvergenceError, InputError
from softtact.fem.elements import HEX27, QUAD9
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.build import build_unit_cell, lattice
from softtact.models.hyperelastic.frusta import FrustumArray
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps
from softtact.sensors.frusta import SensorSpec

# A gap this wide ends total reflection: the evanescent wave's intensity falls to 1/e in lambda / (4 pi sqrt(n^2 sin^2 theta - 1)),
# for green light (0.53 um) in acrylic (n = 1.49) 0.13 um at 45 degrees and 0.05 um at 60 degrees.
DARK_GAP_MM = 1e-4
_SPARE = 1.25            # largest force on a cell over that of the mean frustum: the tallest frustum carries more
_LEVELS = 14            # forces at which a cell is solved
# Where tips are narrow their sides fold onto the glass: thin layers in the lowest third and thin rings at the rim
# (docs/notebook/2026-11-22-mesh-on-glass.md).
GLASS_MESH = MeshSettings.converging(frustum_heights=(*np.linspace(0, 0.2, 11), 0.24, 0.28, 0.33, 0.4, 0.5, 0.7, 1.0),
                                     frustum_rings=4)
# Where tips are wide the sides fold onto the sheet, and thin layers there turn inside out before the paper's 140 N.
WIDE_TIP_MESH = MeshSettings.converging(frustum_heights=(0.0, 0.1, 0.3, 0.6, 0.9, 1.0))
# Augmented overlaps ripple by as much as they are allowed to, and the dark area with them.
SETTINGS = NewtonSettings(max_augmentations=0, first_touch_mm=1e-3, smallest_scale_n=0.1, smallest_increment_n=1e-3)
_GIVE_UP_N = 5e-3    # force step at which a curve that may end early ends: smaller ones cost minutes and win little
_SAMPLES = 24        # points a side of a face at which contact is asked for


@dataclass(frozen=True)
class GlassCurve:
    """force_n (f,) on one frustum; area_mm2 (f,) of its contact with the glass; compression_mm (f,) of the cell."""

    force_n: np.ndarray
    area_mm2: np.ndarray
    compression_mm: np.ndarray


def press_cell_on_glass(spec: SensorSpec, law: Law, forces_n: Sequence[float] | np.ndarray, *, mesh: MeshSettings | None = None,
                        height_factor: float = 1.0, tip_factor: float = 1.0, as_far_as_it_goes: bool = False) -> GlassCurve:
    """Contact area of one frustum under forces (N per frustum, increasing, from 0 on).

    mesh: `MeshSettings`, by default the one for the frustum's shape
    as_far_as_it_goes: end the curve at the last force that was reached, where otherwise a ConvergenceError would be raised
    """
    body = build_unit_cell(spec, dielectric_law=law, mesh=mesh or glass_mesh(spec), height_factor=height_factor,
                           tip_factor=tip_factor)
    forces = np.asarray(forces_n, dtype=float)
    reached = [(0.0, 0.0, 0.0)] if forces[0] == 0 else []
    settings = replace(SETTINGS, smallest_increment_n=_GIVE_UP_N) if as_far_as_it_goes else SETTINGS
    try:
        for load_step in press_load_steps(body, HeightField(plate_over(spec)), forces[forces > 0], settings=settings):
            area = contact_area(body.support, load_step.state.support.displacement)     # type: ignore[arg-type]
            reached.append((load_step.force_n, area, load_step.state.indentation))
    except ConvergenceError:
        if not as_far_as_it_goes or len(reached) < 2:
            raise
    finally:
        body.close()
    return GlassCurve(*np.array(reached).T)


def glass_mesh(spec: SensorSpec, **changes: Any) -> MeshSettings:
    """The `MeshSettings` for a frustum of this shape; `changes` apply if its sides fold onto the glass."""
    frusta = spec.dielectric.frusta
    return replace(GLASS_MESH, **changes) if frusta.tip_diameter_mm < frusta.root_diameter_mm else WIDE_TIP_MESH


def plate_over(spec: SensorSpec) -> trimesh.Trimesh:
    """A rigid plate over the cell, its underside at z = 0."""
    plate = trimesh.creation.box((4 * spec.dielectric.frusta.pitch_mm,) * 2 + (1.0,))
    plate.apply_translation([0, 0, 0.5])
    return plate


def contact_area(support: FrustumArray, displacement: np.ndarray, *, frustum: int = 0, gap_mm: float = DARK_GAP_MM) -> float:
    """Projected area (mm2) of one frustum's surface that is nearer to the glass than `gap_mm`."""
    position = support.coordinates[frustum] + displacement[frustum]
    faces = np.vstack([support.mesh.layer(0)[:, HEX27.bottom], support.outer_faces])
    side = (np.arange(_SAMPLES) + 0.5) * 2 / _SAMPLES - 1
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    values, slopes = QUAD9.shape(points)
    nodes = position[faces]                                                     # (f, 9, 3)
    z = np.einsum("pa,fa->fp", values, nodes[..., 2])
    edges = np.einsum("fad,pai->fpdi", nodes[..., :2], slopes)
    projected = np.abs(np.linalg.det(edges)) * (2 / _SAMPLES) ** 2
    glass = support.coordinates[..., 2].min()
    return float(projected[z < glass + gap_mm].sum())


@dataclass(frozen=True)
class Specimen:
    """Frusta by centres (n, 2) in mm, height_factor (n,) and tip_factor (n,): shares of the nominal height and tip diameter."""

    centres: np.ndarray
    height_factor: np.ndarray
    tip_factor: np.ndarray


@dataclass(frozen=True)
class PressedSpecimen:
    """descent_mm (f,) of the plate from its first touch; force_n, area_mm2 (f, n) of each frustum at each total force."""

    descent_mm: np.ndarray
    force_n: np.ndarray
    area_mm2: np.ndarray


def scattered_specimen(spec: SensorSpec, *, height_scatter: float, tip_scatter: float, seed: int) -> Specimen:
    """A `Specimen` whose factors are normally distributed about 1 with these standard deviations."""
    centres, _ = lattice(spec.frusta_counts, spec.dielectric.frusta.pitch_mm)
    rng = np.random.default_rng([seed, 2])
    heights, tips = rng.standard_normal((2, len(centres)))
    return Specimen(centres, 1 + height_scatter * heights, 1 + tip_scatter * tips)


class CellFamily:
    """Force and contact area of a cell by its compression, for frusta near the nominal shape.

    Five cells are solved: the nominal one, two with other heights and two with other tips. Each quantity is interpolated by
    a parabola in the height factor and one in the tip factor, at equal compression per height, without a product term.
    """

    def __init__(self, spec: SensorSpec, law: Law, *, largest_n: float, height_spread: float, tip_spread: float,
                 mesh: MeshSettings | None = None) -> None:
        """largest_n: largest mean force per frustum;  spreads: largest deviations of the factors from 1 on either side."""
        self.height_mm, self.spreads = spec.dielectric.frusta.height_mm, (height_spread, tip_spread)

        def solve(height_factor=1.0, tip_factor=1.0):
            forces = _SPARE * tip_factor**2 * largest_n * np.linspace(0, 1, _LEVELS + 1)     # all to about the same compression
            return _Cell(press_cell_on_glass(spec, law, forces, mesh=mesh, height_factor=height_factor, tip_factor=tip_factor,
                                             as_far_as_it_goes=True), height_factor * self.height_mm)

        self.nominal = solve()
        self.pairs = [[solve(**{name: 1 + sign * spread}) for sign in (-1, 1)] if spread else None
                      for name, spread in zip(("height_factor", "tip_factor"), self.spreads, strict=True)]

    @cached_property
    def limit(self) -> float:
        """Compression per height up to which all cells were solved."""
        return min(cell.limit for cell in [self.nominal, *(cell for pair in self.pairs if pair for cell in pair)])

    def force(self, compression_mm: np.ndarray, height_factor: np.ndarray, tip_factor: np.ndarray) -> np.ndarray:
        """Forces (n,) in N of frusta at compressions (n,) >= 0."""
        return self._at("force", compression_mm, height_factor, tip_factor)

    def area(self, compression_mm: np.ndarray, height_factor: np.ndarray, tip_factor: np.ndarray) -> np.ndarray:
        """Contact areas (n,) in mm2; none where there is no compression."""
        return np.where(compression_mm > 0, self._at("area", compression_mm, height_factor, tip_factor), 0.0)

    def _at(self, quantity, compression_mm, height_factor, tip_factor):
        share = compression_mm / (height_factor * self.height_mm)
        value = centre = getattr(self.nominal, quantity)(share)
        for pair, spread, factor in zip(self.pairs, self.spreads, (height_factor, tip_factor), strict=True):
            if pair is not None:
                x = (factor - 1) / spread
                low, high = (getattr(cell, quantity)(share) for cell in pair)
                value = value + 0.5 * x * (high - low) + 0.5 * x**2 * (high + low - 2 * centre)
        return value


class _Cell:
    """A solved cell: force (N) and area (mm2) as monotone cubic functions of its compression per height."""

    def __init__(self, curve: GlassCurve, height_mm):
        share = curve.compression_mm / height_mm
        self.limit = float(share[-1])
        self.force = PchipInterpolator(share, curve.force_n)
        self.area = PchipInterpolator(share[1:], curve.area_mm2[1:])     # at the first touch the area jumps from 0 to the tip's


def cell_family(spec: SensorSpec, law: Law, specimen: Specimen, *, largest_n: float,
                mesh: MeshSettings | None = None) -> CellFamily:
    """The `CellFamily` that spans a specimen's frusta; largest_n: largest total force that will be asked for."""
    spreads = [float(np.abs(factor - 1).max()) for factor in (specimen.height_factor, specimen.tip_factor)]
    return CellFamily(spec, law, largest_n=largest_n / len(specimen.centres), height_spread=spreads[0], tip_spread=spreads[1],
                      mesh=mesh)


def press_specimen(family: CellFamily, specimen: Specimen, forces_n: Sequence[float] | np.ndarray) -> PressedSpecimen:
    """The `PressedSpecimen` under total forces (f,) in N, from 0 on, none smaller than the one before."""
    forces = np.asarray(forces_n, dtype=float)
    if not len(forces) or not (np.diff(forces, prepend=0.0) >= 0).all() or not np.isfinite(forces[-1]):
        given = ", ".join(f"{force:g}" for force in forces) or "none"
        raise InputError(f"The forces on the specimen are {given} N; give finite ones from 0 on that do not fall.")
    lag = family.height_mm * (specimen.height_factor.max() - specimen.height_factor)       # mm until the plate meets a frustum
    shape = specimen.height_factor, specimen.tip_factor
    deepest = float((family.limit * family.height_mm * specimen.height_factor + lag).min())

    def carried(descent):
        return family.force(np.maximum(0.0, descent - lag), *shape)

    reach = carried(deepest).sum()
    if forces[-1] > reach:
        raise ConvergenceError(f"The cells of the dielectric were pressed up to {reach:.4g} N in all, not to {forces[-1]:g} N; "
                               "ask for smaller forces or for less scatter of the heights.")
    descents = np.array([brentq(lambda d, f=force: carried(d).sum() - f, 0.0, deepest, xtol=1e-13, rtol=1e-13) if force else 0.0
                         for force in forces])
    areas = np.array([family.area(np.maximum(0.0, d - lag), *shape) for d in descents])
    return PressedSpecimen(descents, np.array([carried(d) for d in descents]), areas)
