"""From loads to counts: the deformed mesh, the capacitances on it, and the counts of the converter.

The converter is a capacitance-to-digital converter like the AD7147, with the stray capacitance of its lines.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import scipy.sparse as sp

from softtact.errors import ExtrapolationWarning, InputError
from softtact.skin.elasticity import BondedLayer
from softtact.skin.elastomers import Elastomer
from softtact.skin.electrostatics import VACUUM_FF_PER_MM, ElectricField
from softtact.skin.layer_mesh import LayerMesh, even_mesh, taxel_mesh
from softtact.skin.layout import Layout
from softtact.skin.loads import Load, disc, ellipse, refuse_beside

_LARGE_STRAIN = 0.3     # of the thickness: the papers' elastomers were tested up to it
BEYOND = 0.005          # share of the volume strained beyond the tests, from which it is told
_RATIOS = 6             # ratios of pressure to modulus solved for a curve, at the extrema of a Chebyshev polynomial
_DEFORMATION_MESHES = {"coarse": (1.5, 2), "standard": (1.0, 4), "fine": (0.75, 5)}     # spacing in mm, layers
_FIELD_MESHES = {
    "coarse": (1, (0.5, 1.0)),
    "standard": (1, (1 / 3, 2 / 3, 1.0)),
    "fine": (2, (0.03, 0.1, 0.25, 0.6, 1.0)),
    "finest": (3, (0.01, 0.03, 0.08, 0.2, 0.4, 0.7, 1.0)),
}     # refinement around the gap, heights of the levels as shares of the thickness


@dataclass(frozen=True)
class Converter:
    """Counts of a capacitance, and the range that it must stay in."""

    step_ff: float
    """fF of a count."""
    range_pf: tuple[float, float]
    """Lowest and highest capacitance, of a taxel with its stray capacitance."""
    offset_step_pf: float
    """An offset is subtracted in such steps before conversion; 0 for none."""
    stray_pf: float = 10.0
    """Of the lines to a taxel."""
    stray_share: float = 0.2
    """Tolerance of the stray capacitance, as a share of it."""
    noise_counts: float = 1.0
    """Standard deviation of a reading."""

    @property
    def noise_ff(self) -> float:
        """Standard deviation of a reading in fF."""
        return self.noise_counts * self.step_ff

    def counts(self, capacitance_ff: np.ndarray) -> np.ndarray:
        """Whole counts above rest (load, taxel) of capacitances (1 + load, taxel), whose first row is the skin at rest.

        First an offset in whole steps brings each taxel at rest into the range. Raises InputError where a taxel leaves the range.
        """
        total = 1e-3 * np.asarray(capacitance_ff) + self.stray_pf
        if self.offset_step_pf:
            total = total - self.offset_step_pf * np.round(total[0] / self.offset_step_pf)
        self.refuse_outside(total)
        reading = np.floor(1e3 * total / self.step_ff)
        return (reading - reading[0])[1:].astype(int)

    def largest_change_ff(self, at_rest_ff: float) -> float:
        """Largest rise of a taxel's capacitance within the range, for every stray capacitance within its tolerance."""
        if self.offset_step_pf:
            return 1e3 * (self.range_pf[1] - 0.5 * self.offset_step_pf)
        return 1e3 * (self.range_pf[1] - self.stray_pf * (1 + self.stray_share)) - at_rest_ff

    def fits_at_rest(self, at_rest_ff: float) -> bool:
        """Whether a taxel at rest is within the range, for every stray capacitance within its tolerance."""
        if self.offset_step_pf:
            return True
        return bool(1e-3 * at_rest_ff + self.stray_pf * (1 - self.stray_share) >= self.range_pf[0])

    def refuse_outside(self, total_pf: np.ndarray) -> None:
        """Refuse capacitances in pF, stray included, beyond the range."""
        low, high = self.range_pf
        outside = (total_pf < low) | (total_pf > high)
        if outside.any():
            raise InputError(
                f"converter: taxel {int(np.nonzero(outside)[-1][0]) + 1} with its stray has {total_pf[outside][0]:.4g} pF, and the "
                f"range is {low:g} to {high:g} pF; correct `converter.stray_pf`, or take smaller taxels or a thicker layer."
            )


# "paper": Le et al. 2011, sec. II. "adi": the maker's data sheet of the AD7147 and its forum.
CONVERTERS = {
    "paper": Converter(step_ff=0.32, range_pf=(4.0, 30.0), offset_step_pf=0.0),
    "adi": Converter(step_ff=0.244, range_pf=(-8.0, 8.0), offset_step_pf=0.32),
}


@dataclass(frozen=True)
class LayerMeshSizes:
    """Sizes of both meshes of a skin; `mesh_convergence` shows their error."""

    spacing_mm: float = 1.0
    """Of the mesh for the deformation, in the plane."""
    layers: int = 4
    """Of elements across the thickness, of the mesh for the deformation."""
    field_spacing_mm: float = 1.2
    """Of the mesh for the electric field, in the plane; it has one element across each guard gap."""
    field_layers: int = 3
    """Of elements across the thickness, of the mesh for the electric field."""


@dataclass(frozen=True)
class Readings:
    """Response of a skin to loads."""

    capacitance_ff: np.ndarray
    """(load, taxel): of the deformed skin."""
    at_rest_ff: np.ndarray
    """(taxel,)"""
    counts: np.ndarray
    """(load, taxel): whole counts above rest."""
    displacement_mm: np.ndarray
    """(load, node, 3): of the nodes on the upper side."""
    layer_mm: np.ndarray
    """(load, node, 3): displacement of all nodes."""
    young_mpa: np.ndarray
    """(load,): the secant modulus that each load was solved with; nan at finite strains, which have a law."""
    remarks: list[str]
    """Where a curve was extrapolated, or a strain is large."""

    @property
    def delta_ff(self) -> np.ndarray:
        """(load, taxel): above rest."""
        return self.capacitance_ff - self.at_rest_ff


_COARSE = LayerMeshSizes(spacing_mm=2.0, layers=2)     # of what follows an object that moves
_BLOCK = 200     # columns of the compliance solved together


class Skin:
    """A layer of elastomer on taxels. Meshes and factorisations are computed once for all loads."""

    least_points = 10
    """Nodes' areas in contact below which a press is flagged: with 4 to 7 its depth varied by 40 % with the place on the mesh."""

    def __init__(self, layout: Layout, *, thickness_mm: float, poisson: float, permittivity: float,
                 mesh: LayerMeshSizes = LayerMeshSizes(), threads: int = 1) -> None:
        self.layout, self.thickness_mm, self.permittivity, self.threads = layout, thickness_mm, permittivity, threads
        self.layer = BondedLayer(
            LayerMesh(even_mesh(layout, spacing_mm=mesh.spacing_mm), np.linspace(0.0, thickness_mm, mesh.layers + 1)),
            poisson=poisson)
        self._field_sizes = mesh.field_spacing_mm, mesh.field_layers
        self._columns: dict[int, np.ndarray] = {}

    @cached_property
    def field_mesh(self) -> LayerMesh:
        """The mesh for the electric field."""
        spacing, layers = self._field_sizes
        return LayerMesh(taxel_mesh(self.layout, spacing_mm=spacing), np.linspace(0.0, self.thickness_mm, layers + 1))

    @cached_property
    def at_rest(self) -> ElectricField:
        """The field without a load."""
        return self.field()

    @cached_property
    def at_rest_ff(self) -> np.ndarray:
        """Capacitances (taxel,) without a load."""
        return self.capacitance_ff()

    def capacitance_ff(self, displacement_mm: np.ndarray | None = None) -> np.ndarray:
        """Capacitances (taxel,) in fF after a displacement (node, 3) of the layer's nodes, or at rest."""
        return (self.at_rest if displacement_mm is None else self.field(displacement_mm)).capacitance_ff

    def field(self, displacement_mm: np.ndarray | None = None) -> ElectricField:
        """The field after a displacement (node, 3) of the layer's nodes, or at rest."""
        moved = None if displacement_mm is None else self.to_field @ displacement_mm
        return ElectricField(self.field_mesh, self.layout, permittivity=self.permittivity, displacement_mm=moved)

    def compliance(self, nodes: np.ndarray) -> np.ndarray:
        """Displacement down (c, c) in mm of nodes (c,) of the upper side under 1 N down on each, for a modulus of 1 MPa.

        Columns are kept, so that an object that moves has most of them.
        """
        top = self.layer.mesh.top
        missing = np.array([node for node in nodes if node not in self._columns], dtype=int)
        for start in range(0, len(missing), _BLOCK):
            block = missing[start:start + _BLOCK]
            nodal = np.zeros((len(self.layer.mesh.nodes_mm), 3, len(block)))
            nodal[block, 2, np.arange(len(block))] = -1.0
            self._columns |= dict(zip(block, -self.layer.respond(nodal)[top, 2].T, strict=True))
        rows = np.searchsorted(top, nodes)
        return np.column_stack([self._columns[node][rows] for node in nodes])

    @cached_property
    def to_field(self) -> sp.csr_matrix:
        """Sparse matrix that interpolates values from the layer's nodes to the field's."""
        return self.layer.mesh.interpolation(self.field_mesh.nodes_mm)

    @cached_property
    def influence(self) -> np.ndarray:
        """Rise of each capacitance in fF per N straight down on a node of the layer, for a modulus of 1 MPa: (node, taxel).

        To first order in the force: the adjoint of elasticity applied to the shape derivative of each capacitance. One solve for a
        taxel gives its response to a force at any place.
        """
        gradient = self.at_rest.gradient()
        nodal = np.stack([self.to_field.T @ gradient[:, axis] for axis in range(3)], axis=1)
        return -self.layer.respond(nodal)[:, 2]

    def first_order_ff(self, load: Load, *, young_mpa: float) -> np.ndarray:
        """Rise (taxel,) of the capacitances under a load to first order, by `influence`."""
        return load.force_n @ (self.layer.under(load.points_mm) @ self.influence) / young_mpa


class CoarseSkin(Skin):
    """A skin on a coarse mesh, whose taxels are parallel plates, in milliseconds.

    A driven guard takes the fringes: a plate ends in the middle of the gap (Maxwell's guard ring). Over 24 random balls no taxel
    was off by more than 28 % of the largest rise of `Skin`, half of the balls by less than 18 %; the sum by 1 % in the median.
    """

    least_points = 0     # all of its presses are coarse

    def __init__(self, layout: Layout, *, thickness_mm: float, poisson: float, permittivity: float) -> None:
        super().__init__(layout, thickness_mm=thickness_mm, poisson=poisson, permittivity=permittivity, mesh=_COARSE)
        radius = 0.5 * (layout.radius_mm + layout.guard_radius_mm)
        disc = ellipse((0.0, 0.0), area_mm2=np.pi * radius**2, pressure_mpa=1.0, ratio=1.0)
        few = slice(0, None, 6)     # every sixth point around
        self._area_mm2 = disc.force_n[few] * disc.force_n.sum() / disc.force_n[few].sum()
        points = layout.centres_mm[:, None] + disc.points_mm[few]
        self._over_taxels = self.layer.under(points.reshape(-1, 2))

    def capacitance_ff(self, displacement_mm: np.ndarray | None = None) -> np.ndarray:
        """See `Skin`. Raises InputError where the elastomer would be pressed through."""
        down = np.zeros(len(self.layer.mesh.nodes_mm)) if displacement_mm is None else displacement_mm[:, 2]
        gap = self.thickness_mm + (self._over_taxels @ down).reshape(-1, len(self._area_mm2))
        if gap.min() <= 0:
            raise InputError("load: it presses the elastomer through, where small strains do not hold; choose less pressure or a "
                             "thicker or stiffer layer.")
        found: np.ndarray = VACUUM_FF_PER_MM * self.permittivity * (self._area_mm2 / gap).sum(axis=1)
        return found


def analyse(skin: Skin, loads: Sequence[Load], *, elastomer: Elastomer, converter: Converter) -> Readings:
    """`Readings` of loads one by one, each with the displacement it brings or the elastomer's secant modulus at its pressure."""
    rows, moved, moduli, remarks = [], [], [], []
    for load in loads:
        displacement, young = load.displacement_mm, np.nan
        if displacement is None:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", ExtrapolationWarning)
                young = elastomer.young_mpa(load.pressure_mpa)
            remarks += [str(warning.message) for warning in caught]
            displacement = skin.layer.displacement(load, young_mpa=young)
        rows.append(skin.capacitance_ff(displacement))
        moved.append(displacement)
        moduli.append(young)
        compression = -displacement[:, 2].min() / skin.thickness_mm
        if compression > _LARGE_STRAIN and load.displacement_mm is None:
            remarks.append(f"{load.words}: the elastomer is compressed by {compression:.0%} of its thickness, where small strains "
                           "are coarse; take the reading as a trend.")
        if load.beyond_tests > BEYOND:
            remarks.append(f"{load.words}: the law of the elastomer is extrapolated there.")
    capacitance, layer = np.array(rows), np.array(moved)
    return Readings(capacitance, skin.at_rest_ff, converter.counts(np.vstack([skin.at_rest_ff, capacitance])),
                    layer[:, skin.layer.mesh.top], layer, np.array(moduli), list(dict.fromkeys(remarks)))


def alone(layout: Layout, taxel: int) -> Layout:
    """The same elastomer with one taxel (counted from 0); the others become part of the guard, which has the same potential."""
    return Layout(layout.outline_mm, layout.centres_mm[[taxel]], layout.module[[taxel]], layout.corners_mm, layout.radius_mm,
                  layout.guard_radius_mm)


def probe_curves(skin: Skin, elastomer: Elastomer, *, diameters_mm: Sequence[float], pressures_kpa: Sequence[float],
                 modulus_shares: Sequence[float]) -> pd.DataFrame:
    """A row for each diameter, share and pressure: capacitance of a skin's first taxel under a cylindrical probe, and its rise.

    Le et al. 2011, fig. 6. modulus_shares: error of Young's modulus, 0 for the curve as it is. Deformations are proportional to
    pressure over modulus. The capacitance is a smooth function of that ratio, which is solved at a few values and interpolated.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtrapolationWarning)
        moduli = np.array([elastomer.young_mpa(1e-3 * pressure) for pressure in pressures_kpa])
    pressures = 1e-3 * np.asarray(pressures_kpa)
    ratio = {share: pressures / ((1 + share) * moduli) for share in modulus_shares}
    largest = max(values.max() for values in ratio.values())
    solved = largest * 0.5 * (1 - np.cos(np.pi * np.arange(1, _RATIOS + 1) / _RATIOS))
    rows = []
    for diameter in diameters_mm:
        x, y = skin.layout.centres_mm[0]
        load = disc((float(x), float(y)), diameter_mm=diameter, pressure_mpa=1.0)
        refuse_beside(load, skin.layout, where=f"probes, diameter {diameter:g} mm")
        unit = skin.layer.displacement(load, young_mpa=1.0)
        rise = [skin.field(value * unit).capacitance_ff[0] - skin.at_rest_ff[0] for value in solved]
        polynomial = np.polynomial.Polynomial.fit([0.0, *solved], [0.0, *rise], _RATIOS)
        rows += [
            {"diameter_mm": diameter, "modulus_share": share, "pressure_kpa": pressure, "young_mpa": (1 + share) * modulus,
             "capacitance_ff": skin.at_rest_ff[0] + polynomial(value), "delta_ff": polynomial(value),
             "within_test": bool(elastomer.tested_mpa[0] <= 1e-3 * pressure <= elastomer.tested_mpa[1])}
            for share, values in ratio.items()
            for pressure, modulus, value in zip(pressures_kpa, moduli, values, strict=True)
        ]
    return pd.DataFrame(rows)


def mesh_convergence(layout: Layout, load: Load, *, taxel: int, thickness_mm: float, poisson: float, permittivity: float,
                     young_mpa: float) -> pd.DataFrame:
    """A row for each mesh: largest displacement in mm, capacitance of a taxel (counted from 0) in fF at rest and under the load.

    The same load on finer and finer meshes. The field's meshes are compared on the deformation of the standard mesh, with one
    taxel, whose neighbours are part of the guard.
    """
    rows, solved = [], {}
    for name, (spacing, layers) in _DEFORMATION_MESHES.items():
        layer = BondedLayer(LayerMesh(even_mesh(layout, spacing_mm=spacing), np.linspace(0.0, thickness_mm, layers + 1)),
                            poisson=poisson)
        displacement = layer.displacement(load, young_mpa=young_mpa)
        solved[name] = layer, displacement
        rows.append({"mesh": name, "of": "deformation", "nodes": len(displacement),
                     "largest_displacement_mm": -displacement[:, 2].min()})
    one = alone(layout, taxel)
    layer, displacement = solved["standard"]
    for name, (refinement, levels) in _FIELD_MESHES.items():
        mesh = LayerMesh(taxel_mesh(one, spacing_mm=1.2, refinement=refinement), thickness_mm * np.array([0.0, *levels]))
        at_rest, pressed = (
            ElectricField(mesh, one, permittivity=permittivity, displacement_mm=u, order=4).capacitance_ff[0]
            for u in (None, layer.at(mesh.nodes_mm, displacement)))
        rows.append({"mesh": name, "of": "field", "nodes": len(mesh.nodes_mm), "at_rest_ff": at_rest, "capacitance_ff": pressed,
                     "delta_ff": pressed - at_rest})
    return pd.DataFrame(rows)
