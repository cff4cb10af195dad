"""The elastic model: one linear layer, fixed at its base and as the sensor's edge states; contact by the compliance of its top.

In a sensor that is free below only the sides are fixed, and the compliance includes the displacements of the lower side.
The vertical compliance of the top's nodes (mm/N) is computed once for a sensor (`elastic_compliance`), from quarters of the layer
(`quarter_symmetry`). The nodes are at half the map's spacing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from softtact.contact.lower_envelope import NO_CONTACT_MM
from softtact.contact.node_grid import NodeGrid, Stencil, patches_of
from softtact.contact.object_points import ObjectPoints
from softtact.contact.shell import pad_forces
from softtact.contact.undersides import PosedUnderside
from softtact.contact.unilateral import (
    RISE,
    ContactLoadSteps,
    among_candidates,
    depth_on_springs,
    highest_missed,
    press_elastic,
)
from softtact.errors import ConvergenceError
from softtact.files import read_arrays
from softtact.linalg.workers import on_one_thread
from softtact.models.quarter_symmetry import PARITIES, LinearLayer, ParityBlocks, QuarterSlab, of_parities
from softtact.sensors.base import BaseSpec
from softtact.sensors.fields import ElasticLayer
from softtact.sensors.frusta import SensorSpec

_SHARES = (0.34, 0.3, 0.22, 0.14)     # of the layer's thickness, from below, that its element layers have
_ABOVE_PLANE, _BELOW_PLANE = (0.4, 0.35, 0.25), (0.55, 0.45)     # the same of the parts above and below the electrodes' plane
_SINGLE = 2                            # rows of points along a contact's edge, where pressure is steep, that share none
_REACH = 1                            # nodes that the preconditioner looks around; 2 and 3 cost as much as they save
_MARGIN = 8                           # nodes about these that it is computed with: those beyond change it by less than 1e-6


@dataclass(frozen=True)
class Compliance:
    """Compliance of the top under downward forces in mm/N: blocks by parity among a quarter's nodes of the grid.

    foundation_modulus: pressure per depth in N/mm3 under a wide punch;  stencil: approximate inverse
    lower: displacements of the lower side, like `blocks`; None if it is fixed
    """

    grid: NodeGrid
    blocks: ParityBlocks
    foundation_modulus: float
    stencil: Stencil
    lower: ParityBlocks | None = None

    def save(self, path: Path) -> None:
        """Write as a NumPy archive, in single precision."""
        lower: dict[str, Any] = {} if self.lower is None else {"lower": self.lower.blocks}
        arrays: dict[str, Any] = self.grid.arrays()
        np.savez(path, **arrays, blocks=self.blocks.blocks, foundation_modulus=self.foundation_modulus,
                 stencil=self.stencil.values, **lower)

    @classmethod
    def load(cls, path: Path) -> "Compliance":
        """Read what `save` wrote."""
        with read_arrays(path) as data:
            return cls(grid=NodeGrid.of(data), blocks=ParityBlocks(data["blocks"]),
                       foundation_modulus=float(data["foundation_modulus"]),
                       stencil=Stencil(data["stencil"]), lower=ParityBlocks(data["lower"]) if "lower" in data else None)

    def stiffened(self, factor: float) -> "Compliance":
        """The compliance of the same layer with `factor` times the modulus."""
        lower = None if self.lower is None else ParityBlocks(self.lower.blocks / np.float32(factor))
        return replace(self, blocks=ParityBlocks(self.blocks.blocks / np.float32(factor)), lower=lower,
                       foundation_modulus=factor * self.foundation_modulus, stencil=Stencil(factor * self.stencil.values))

    def among(self, points: ObjectPoints) -> np.ndarray:
        """Compliance (c, c) among `ObjectPoints`."""
        places = self.grid.quarter(points.nodes)
        return self.blocks.between(*places, *places)

    def top(self, points: ObjectPoints, force: np.ndarray) -> np.ndarray:
        """How far the grid's nodes are down (l, ny, nx) in mm under forces (c, l) in N at points."""
        return np.ascontiguousarray(self._moved(self.blocks, points, force))

    def fields(self, points: ObjectPoints, force: np.ndarray, *, top: np.ndarray | None = None) -> np.ndarray:
        """Deformation (l, 2 ny - 1, 2 nx - 1) in mm at all nodes, with sides that are held, of forces (c, l) in N at points.

        top: what `top` gives for these, if it is known
        """
        return self._everywhere(self.top(points, force) if top is None else top)

    def lower_fields(self, points: ObjectPoints, force: np.ndarray) -> np.ndarray | None:
        """Deformation of the lower side; None if it is fixed."""
        return None if self.lower is None else self._everywhere(self._moved(self.lower, points, force))

    def thinning(self, points: ObjectPoints, force: np.ndarray) -> np.ndarray:
        """By how much the layer is thinner at the nodes of `fields`."""
        fields, lower = self.fields(points, force), self.lower_fields(points, force)
        return fields if lower is None else fields - lower

    def _moved(self, blocks, points, force):
        quarter = tuple(count // 2 + 1 for count in self.grid.shape)
        return blocks.fields(quarter, *self.grid.quarter(points.nodes), force).astype(float)

    def _everywhere(self, inner):
        return self.grid.with_held_sides(inner)


@dataclass(frozen=True)
class InnerPlaneCompliance(Compliance):
    """A `Compliance` whose fields are of a plane inside the layer, to which its `lower` belongs; contact is that of the top."""

    def fields(self, points: ObjectPoints, force: np.ndarray, *, top: np.ndarray | None = None) -> np.ndarray:
        """Deformation (l, 2 ny - 1, 2 nx - 1) in mm of the plane at all nodes, whatever the `top` is."""
        return self._everywhere(self._moved(self.lower, points, force))

    def lower_fields(self, points: ObjectPoints, force: np.ndarray) -> None:
        """None: the layer's lower side is fixed."""
        return None


@dataclass(frozen=True)
class DraftCompliance(Compliance):
    """A `Compliance` on a coarser grid whose fields are given at the nodes of the whole one, by cubic splines."""

    nodes: tuple[int, int] = (0, 0)
    """(2 ny - 1, 2 nx - 1) of the whole grid, with sides that are held."""

    def _everywhere(self, inner):
        from scipy.interpolate import RectBivariateSpline

        coarse = super()._everywhere(inner)
        over = [(fine - 1) / (few - 1) for fine, few in zip(self.nodes, coarse.shape[1:], strict=True)]
        places = [np.arange(fine) / share for fine, share in zip(self.nodes, over, strict=True)]
        return np.stack([RectBivariateSpline(*map(np.arange, one.shape), one)(*places) for one in coarse])


def draft_of(spec: BaseSpec, compliance: Compliance) -> DraftCompliance:
    """The `DraftCompliance` of a sensor from a `Compliance` with `draft_cells`."""
    rows, columns = spec.map_shape
    return DraftCompliance(grid=compliance.grid, blocks=compliance.blocks, foundation_modulus=compliance.foundation_modulus,
                           stencil=compliance.stencil, lower=compliance.lower, nodes=(2 * rows - 1, 2 * columns - 1))


def draft_cells(spec: BaseSpec) -> tuple[int, ...]:
    """Elements along a quarter's sides of a `DraftCompliance`: half as many, so nodes lie at the map's points, but at least three,
    which the stencil takes where the sides are held.
    """
    return tuple(max(3, count // 2) for count in map_cells(spec))


def map_cells(spec: BaseSpec) -> tuple[int, ...]:
    """Elements (nx, ny) along a quarter's sides: as many as the map has steps there; nodes lie at half the map's spacing."""
    spec.check_for("elastic")
    return tuple((count - 1) // 2 for count in spec.map_shape[::-1])


def surface_grid(slab: QuarterSlab) -> NodeGrid:
    """The `NodeGrid` of the free nodes on a whole slab's top, from its `QuarterSlab`."""
    sides = not slab.side_held[-1]
    x, y = (line if sides else line[:-1] for line in (slab.x, slab.y))
    return NodeGrid(np.concatenate([-x[:0:-1], x]), np.concatenate([-y[:0:-1], y]), sides)


def elastic_slab(spec: BaseSpec, *, cells: tuple[int, ...] | None = None) -> QuarterSlab:
    """The `QuarterSlab` of a sensor's single elastic layer."""
    layer = spec.elastic_layer
    bulk, shear = layer.young_mpa / (3 * (1 - 2 * layer.poisson)), layer.young_mpa / (2 * (1 + layer.poisson))
    return QuarterSlab(spec.footprint_mm, [LinearLayer(spec.thickness_mm, bulk, shear, _SHARES)], cells or map_cells(spec),
                       base_held=spec.base_held, held_below_mm=spec.edge.held_below_mm)


def elastic_compliance(spec: BaseSpec, *, threads: int = 1, cells: tuple[int, ...] | None = None) -> Compliance:
    """The `Compliance` of a sensor's elastic layer; `cells`: elements along a quarter's sides, if not as the map asks for."""
    slab = elastic_slab(spec, cells=cells)
    planes, count = [slab.top] if spec.base_held else [slab.top, slab.below_top(0)], slab.top.size
    kept = 3 * np.concatenate([plane.ravel() for plane in planes]) + 2
    both = _among(slab, kept, count, threads, f"{spec.name}: compliance, a quarter's parities")
    blocks = both[:, :count]
    return Compliance(grid=surface_grid(slab), blocks=ParityBlocks(blocks),
                      foundation_modulus=confined_modulus(spec.elastic_layer) / spec.thickness_mm,
                      stencil=_stencil(blocks, slab.top.shape),
                      lower=None if spec.base_held else ParityBlocks(both[:, count:]))


def electrode_plane_compliance(spec: SensorSpec, *, threads: int = 1) -> InnerPlaneCompliance:
    """The `InnerPlaneCompliance` of a sensor's elastic layer whose maps are of the electrodes' plane, on top of the dielectric."""
    layer, parts = spec.elastic_layer, (spec.cover.thickness_mm, spec.dielectric_thickness_mm)
    bulk, shear = layer.young_mpa / (3 * (1 - 2 * layer.poisson)), layer.young_mpa / (2 * (1 + layer.poisson))
    above, below = (LinearLayer(thickness, bulk, shear, shares)
                    for thickness, shares in zip(parts, (_ABOVE_PLANE, _BELOW_PLANE), strict=True))
    slab = QuarterSlab(spec.footprint_mm, [below, above], map_cells(spec), base_held=True, held_below_mm=spec.edge.held_below_mm)
    planes, count = [slab.top, slab.below_top(slab.boundary_over(below))], slab.top.size
    kept = 3 * np.concatenate([plane.ravel() for plane in planes]) + 2
    both = _among(slab, kept, count, threads, f"{spec.name}: compliance at the electrodes, a quarter's parities")
    blocks = both[:, :count]
    return InnerPlaneCompliance(grid=surface_grid(slab), blocks=ParityBlocks(blocks),
                                foundation_modulus=confined_modulus(layer) / spec.thickness_mm,
                                stencil=_stencil(blocks, slab.top.shape), lower=ParityBlocks(both[:, count:]))


def _among(slab, kept, loaded, threads, label):
    """Compliance (4, k, loaded) of each parity among unknowns (k,) under forces on the first of them, in single precision."""
    stiffness, out = slab.stiffness, np.empty((len(PARITIES), len(kept), loaded), dtype=np.float32)

    def act(parity, threads):
        return slab.compliance(stiffness, kept, parity, threads=threads, dtype=np.float32)[:, :loaded]

    for number, block in enumerate(of_parities(act, functionals=len(kept), threads=threads, label=label)):
        out[number] = block
    return out


def confined_modulus(layer: ElasticLayer) -> float:
    """Modulus (MPa) of an elastic layer in uniaxial compression without lateral strain."""
    return layer.young_mpa * (1 - layer.poisson) / ((1 + layer.poisson) * (1 - 2 * layer.poisson))


def _stencil(blocks, shape):
    """The whole top's stiffness about its middle, cut off `_REACH` nodes away."""
    offset = np.arange(-_REACH, _REACH + 1)
    first = [2 * (side // 4) - _REACH for side in shape]     # the quarter's middle; nodes of four kinds follow it
    lines = [np.arange(start, start + 2 * _REACH + 2) for start in first]
    window = [np.arange(max(0, own[0] - _MARGIN), min(side, own[-1] + 1 + _MARGIN)) for own, side in zip(lines, shape, strict=True)]
    patch, near = (rows[:, None] * shape[1] + columns for rows, columns in (lines, window))
    near = near.ravel()
    stiffness = ParityBlocks(np.stack([_inverse_among(block[np.ix_(near, near)], np.searchsorted(near, patch.ravel()))
                                       for block in blocks]))
    place = np.arange(patch.size).reshape(patch.shape)
    values = np.zeros((2, 2, len(offset), len(offset)))
    for j, i in ((0, 0), (0, 1), (1, 0), (1, 1)):
        others = place[j:j + len(offset), i:i + len(offset)].ravel()
        ones = np.ones((len(others), 2), dtype=int)
        own = place[j + _REACH, i + _REACH].reshape(1)
        values[j, i] = stiffness.between(own, ones[:1], others, ones).reshape(values.shape[2:])
    return Stencil(values)


def _inverse_among(block, nodes):
    """Rows and columns `nodes` of the inverse of a parity's compliance, of the nodes that it does not hold."""
    there = np.diag(block) > 0
    place = np.cumsum(there) - 1
    factor = cho_factor(block if there.all() else block[np.ix_(there, there)], lower=True, check_finite=False)
    ones = np.zeros((len(factor[0]), len(nodes)), dtype=block.dtype)
    ones[place[nodes], np.arange(len(nodes))] = 1.0
    return cho_solve(factor, ones, check_finite=False)[place[nodes]]


@dataclass(frozen=True)
class LayerPress:
    """fields (l, 2 ny - 1, 2 nx - 1): deformation in mm at the surface's nodes, at half the map's steps, of all load steps;
    the contact's `ContactLoadSteps`;  areas (c,) in mm2 of its points;  lower_fields: of a lower side that is free
    """

    fields: np.ndarray
    contact: ContactLoadSteps
    areas: np.ndarray
    lower_fields: np.ndarray | None = None

    @property
    def maps(self) -> np.ndarray:
        """Deformation maps (l, ny, nx) in mm: every second node along x and y."""
        return self.fields[:, ::2, ::2]

    @property
    def thinning(self) -> np.ndarray:
        """By how much the layer is thinner at its nodes, (l, 2 ny - 1, 2 nx - 1) in mm."""
        return self.fields if self.lower_fields is None else self.fields - self.lower_fields

    def columns(self, some: np.ndarray) -> "LayerPress":
        """The press of some of its load steps."""
        contact = ContactLoadSteps(**{one.name: getattr(self.contact, one.name)[..., some] for one in fields(self.contact)})
        return LayerPress(self.fields[some], contact, self.areas,
                          None if self.lower_fields is None else self.lower_fields[some])


def press_layer(compliance: Compliance, points: ObjectPoints, forces_n: Sequence[float] | np.ndarray, *,
                patches: bool = False) -> LayerPress:
    """Press `ObjectPoints` of the compliance's grid with forces (l,) in N; patches: as for `press_object`."""
    contact = _contact_among(compliance, points, patches)(forces_n)
    return _with_fields(compliance, points, contact, compliance.top(points, contact.force))


@on_one_thread
def press_object(compliance: Compliance, underside: PosedUnderside, forces_n: np.ndarray, *,
                 patches: bool = False) -> tuple[ObjectPoints, LayerPress]:
    """The `LayerPress` of an object that comes down through rising forces (l,) in N, at most to the shell, and its points.

    patches: let four level points inside a large contact share a pressure (`patches_of`): two thirds of the time, readings within
    0.1 %. Raises ConvergenceError.
    """
    points, contact, top = _touch(compliance, underside, forces_n, patches, bulges=True)
    return points, _with_fields(compliance, points, contact, top)


@on_one_thread
def touch_object(compliance: Compliance, underside: PosedUnderside, forces_n: np.ndarray, *,
                 bulges: bool = True) -> tuple[ObjectPoints, ContactLoadSteps]:
    """The contact of `press_object` and its points.

    bulges: whether the surface may bulge into a recess of the object far above its depth; if not, `highest_missed` of the surface's
    displacement tells whether it does
    """
    return _touch(compliance, underside, forces_n, False, bulges)[:2]


def _touch(compliance, underside, forces_n, patches, bulges):
    """The contact, its points, and how far all nodes (l, ny, nx) are down, or None if the surface does not bulge.

    The layer is stiffer than springs side by side, so points within the reach of these are enough; if the object gets deeper all
    the same, more points are taken. Beside the object the surface rises, so points slightly above the depth can touch, too; and
    in a recess of the object, into which a nearly incompressible layer bulges, points far above it.
    """
    grid, height = compliance.grid, underside.height_mm
    lowest, below = min(underside.touch_mm, float(height.min())), height < NO_CONTACT_MM
    on_springs = depth_on_springs(height, grid.areas(np.arange(grid.count)), forces_n[-1] / compliance.foundation_modulus)
    over = height - lowest

    def solve(reach):
        nodes = np.flatnonzero((over <= reach) & below)
        points = ObjectPoints.level(nodes, height[nodes], grid.step)
        contact = _on_pad(_contact_among(compliance, points, patches), points, forces_n, underside)
        return points, contact, compliance.top(points, contact.force) if bulges else None

    def needed(found, reach):
        _, contact, top = found
        depth = contact.depth - lowest
        return max(RISE * depth[-1], highest_missed(over, reach, top.reshape(len(depth), -1), depth) if bulges else 0.0)

    return among_candidates(solve, needed, reach_mm=RISE * (on_springs - lowest), most_mm=float(over[below].max()))


def _on_pad(press, points, forces_n, underside):
    """The `ContactLoadSteps` of `press` under forces (l,) on the object, of which the pad carries what the shell does not."""
    try:
        contact = press(forces_n)
        if contact.depth[-1] <= underside.stop_mm:
            return contact
    except ConvergenceError:     # a force that the pad cannot carry alone
        if np.isinf(underside.stop_mm):
            raise
    on_pad = pad_forces(forces_n, stop_mm=underside.stop_mm, touch_mm=underside.touch_mm,
                        depth_of=lambda force: press([force]).depth[0])
    if on_pad.any():
        return press(on_pad)
    gap = np.tile((points.gap - underside.stop_mm)[:, None], len(forces_n))     # it rests on the shell: the layer is undeformed
    return ContactLoadSteps(force=np.zeros_like(gap), depth=np.full(len(forces_n), underside.stop_mm), gap=gap,
                            iterations=np.zeros(len(forces_n), dtype=int), settled=np.ones(len(forces_n), dtype=bool))


def _contact_among(compliance, points, patches):
    """The `ContactLoadSteps` of points as a function of forces (l,) in N on them."""
    area, stencil = points.covered * compliance.grid.areas(points.nodes), compliance.stencil.on(compliance.grid, points.nodes)
    among, modulus = compliance.among(points), compliance.foundation_modulus
    share = patches_of(points, compliance.grid, True, beside_edge=_SINGLE) if patches else None
    if share is None or share.shape[0] == points.count:
        return partial(press_elastic, among, points.gap, area=area, foundation_modulus=modulus, precondition=stencil)
    own, single = (share > 0).astype(np.float32), share.astype(np.float32)
    among = single @ np.ascontiguousarray((single @ among).T)

    def press(forces_n):
        contact = press_elastic(among, share @ points.gap, forces_n, area=own @ area, foundation_modulus=modulus,
                                precondition=lambda x: own @ stencil(own.T @ x))
        return replace(contact, force=share.T @ contact.force, gap=own.T @ contact.gap)

    return press


def _with_fields(compliance, points, contact, top):
    return LayerPress(fields=compliance.fields(points, contact.force, top=top), contact=contact,
                      areas=compliance.grid.areas(points.nodes), lower_fields=compliance.lower_fields(points, contact.force))
