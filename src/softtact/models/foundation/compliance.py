"""The foundation model of a sensor: sheet and cover as a linear slab, on frusta with their unit cell's nonlinear law.

The slab's displacements under unit forces at its top and at the frusta are computed once, from one quarter of it
(`quarter_symmetry`). The frusta's linear stiffness, except against compression, is part of the slab; their compression is a
separate displacement, to which a press applies the nonlinear law (`press_foundation`).
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from softtact.contact.node_grid import NodeGrid
from softtact.files import read_arrays
from softtact.materials.laws.base import Law
from softtact.models.elastic.compliance import map_cells, surface_grid
from softtact.models.foundation.frustum_spring import FrustumLaw, frustum_law
from softtact.models.quarter_symmetry import PARITIES, LinearLayer, ParityBlocks, QuarterSlab, of_parities, picked
from softtact.sensors.frusta import SensorSpec

SHEET_SHARES, COVER_SHARES = (1.0,), (0.45, 0.35, 0.2)
_BLOCKS = ("surface", "sideways", "membrane", "lateral", "lateral_self")
_GROUND = 2e-3  # of a frustum's stiffness at rest, also for lifted frusta: so small, yet single precision still resolves 1e-5 mm


@dataclass(frozen=True)
class FoundationCompliance:
    """Compliance of the slab on its frusta under downward forces, by parity (see `quarter_symmetry`), and the law of the frusta.

    surface: among the grid's nodes in the quarter (a,), the frusta (b,) and the electrode plane at the map's points (c,), without
        the sides if the grid is without them
    sideways: displacements of every second node of the grid in x and in y (2 c,), from forces on nodes and frusta (a + b,)
    membrane: membrane forces N_xx, N_yy, N_xy of the frusta's cells (3 b,) in N/mm, from the same forces
    lateral: displacement and tilt of the frusta's roots along x, then along y (4 b,), from forces at all of these (a + b + c)
    lateral_self: displacement and tilt of the roots, from unit lateral forces and moments on the roots (4 b)
    grid: the nodes;  counts: frusta along x and y;  foundation_modulus: pressure per depth in N/mm3 of the layer at rest
    """

    grid: NodeGrid
    counts: tuple
    foundation_modulus: float
    law: FrustumLaw
    surface: ParityBlocks
    sideways: ParityBlocks
    membrane: ParityBlocks
    lateral: ParityBlocks
    lateral_self: ParityBlocks

    def save(self, path: Path) -> None:
        """Write as a NumPy archive."""
        arrays: dict[str, Any] = self.grid.arrays() | {"counts": self.counts, "foundation_modulus": self.foundation_modulus}
        arrays |= {f"law_{name}": values for name, values in self.law.arrays().items()}
        arrays |= {name: getattr(self, name).blocks for name in _BLOCKS}
        np.savez(path, **arrays)

    @classmethod
    def load(cls, path: Path) -> "FoundationCompliance":
        """Read what `save` wrote."""
        with read_arrays(path) as data:
            of_law: dict[str, Any] = {name.removeprefix("law_"): data[name] for name in data.files if name.startswith("law_")}
            blocks = {name: ParityBlocks(data[name]) for name in _BLOCKS}
            return cls(grid=NodeGrid.of(data), counts=tuple(data["counts"]),
                       foundation_modulus=float(data["foundation_modulus"]), law=FrustumLaw(**of_law), **blocks)


def foundation_compliance(spec: SensorSpec, *, dielectric_law: Law, cover_law: Law, frustum: FrustumLaw | None = None,
                          cells: tuple[int, ...] | None = None, threads: int = 1) -> FoundationCompliance:
    """The `FoundationCompliance` of a sensor with its two laws.

    frustum: its `FrustumLaw`, or None to compute it;  cells: elements along the quarter's sides, by default the map's steps
    """
    spec.check_for("foundation")
    frustum = frustum or frustum_law(spec, dielectric_law)
    slab = foundation_slab(spec, dielectric_law, cover_law, cells=cells)
    centres = _quarter_lattice(spec)
    roots = _roots(slab, centres, frustum)
    descents = _cleaned(sp.kron(sp.eye(len(centres)), frustum.descent[None], format="csr") @ roots)
    stiffness = slab.stiffness + roots.T @ sp.block_diag([frustum.rest] * len(centres), format="csr") @ roots
    if np.isinf(spec.edge.held_below_mm):
        frustum, ground = _with_ground(frustum)
        stiffness = stiffness + ground * descents.T @ descents
    followed = sp.vstack([_membrane(slab, spec, centres), _lateral_movement(roots, frustum, centres)]).tocsr()
    electrodes, top = slab.below_top(slab.boundary_over(slab.layers[0][0])), slab.top
    sideways = np.concatenate([3 * top[::2, ::2].ravel() + axis for axis in (0, 1)])
    rows = 3 * top.ravel() + 2, 3 * electrodes[::2, ::2].ravel() + 2, sideways
    parts = of_parities(lambda parity, threads: _of_parity(slab, stiffness, descents, followed, rows, parity, threads),
                        functionals=sum(map(len, rows)) + descents.shape[0] + followed.shape[0], threads=threads,
                        label=f"{spec.name}: compliance, a quarter's parities")
    surface, aside, both, own = _stacked(parts, len(PARITIES))
    membrane, lateral = both[:, :3 * len(centres), :surface.shape[2]], both[:, 3 * len(centres):]
    own = own[:, 3 * len(centres):, 3 * len(centres):]
    return FoundationCompliance(
        grid=surface_grid(slab), counts=spec.frusta_counts, foundation_modulus=_foundation_modulus(spec, frustum, cover_law),
        law=frustum, surface=ParityBlocks(surface), sideways=ParityBlocks(aside), membrane=ParityBlocks(membrane),
        lateral=ParityBlocks(lateral), lateral_self=ParityBlocks(own))


def _with_ground(frustum):
    """A frustum's law without a small linear part, and that part's stiffness in N/mm, which supports a slab with free sides."""
    ground = _GROUND * frustum.force_n[1] / frustum.compression_mm[1]
    return replace(frustum, force_n=frustum.force_n - ground * frustum.compression_mm), ground


def foundation_slab(spec: SensorSpec, dielectric_law: Law, cover_law: Law, *, cells: tuple[int, ...] | None = None) -> QuarterSlab:
    """The `QuarterSlab` of sheet and cover with two laws' linear constants."""
    layers = [LinearLayer(spec.dielectric.sheet_thickness_mm, dielectric_law.bulk_modulus, dielectric_law.mu0, SHEET_SHARES),
              LinearLayer(spec.cover.thickness_mm, cover_law.bulk_modulus, cover_law.mu0, COVER_SHARES)]
    return QuarterSlab(spec.footprint_mm, layers, cells or map_cells(spec), base_held=False,
                       held_below_mm=spec.edge.held_below_mm)


def _quarter_lattice(spec):
    """Centres (b, 2) of the quarter's frusta, x fastest, from the middle outwards."""
    pitch = spec.dielectric.frusta.pitch_mm
    x, y = (pitch * (np.arange(count // 2) + 0.5) for count in spec.frusta_counts)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _roots(slab, centres, frustum):
    """Displacements of all roots' nodes (3 b m, unknowns); frusta on a plane of symmetry count by their part in the quarter."""
    at = slab.interpolation(np.abs((centres[:, None] + frustum.root_xy).reshape(-1, 2)))
    roots = sp.kron(sp.kron(sp.eye(len(centres)), frustum.spread, format="csr") @ at, sp.eye(3), format="csr")
    roots.resize(roots.shape[0], slab.unknowns)
    return roots


def _cleaned(matrix):
    matrix.data[np.abs(matrix.data) < 1e-12] = 0.0
    matrix.eliminate_zeros()
    return matrix.tocsr()


def _membrane(slab, spec, centres):
    """Membrane forces of the quarter's cells (3 b, unknowns)."""
    pitch, (nx, ny) = spec.dielectric.frusta.pitch_mm, (count // 2 for count in spec.frusta_counts)

    def cells_of(x, y):
        i, j = (x / pitch).astype(int), (y / pitch).astype(int)
        return np.where((i < nx) & (j < ny), j * nx + i, -1)

    return sp.vstack(slab.mean_forces(cells_of, len(centres))).tocsr() / pitch**2


def _lateral_movement(roots, frustum, centres):
    """Displacement and tilt of the roots along x, then along y (4 b, unknowns), from the displacements of all their nodes."""
    return sp.vstack([sp.kron(sp.eye(len(centres)), row[None]) @ roots for row in frustum.lateral])


def _of_parity(slab, stiffness, descents, followed, rows, parity, threads):
    """Blocks of one parity: surface (loaded + c, loaded), sideways (2 c, loaded), followed (f, loaded + c), for downward forces;
    and `followed` (f, f) for the forces conjugate to these.

    rows: numbers of the vertical unknowns on the top and in the electrode plane, and of the top's lateral unknowns (2 c)
    """
    top, plane, sideways = (picked(numbers, slab.unknowns) for numbers in rows)
    whole = slab.responses(stiffness, sp.vstack([top, descents, plane, sideways, followed], format="csr"), parity, threads=threads,
                           dtype=np.float32)
    loaded = top.shape[0] + descents.shape[0]
    under = loaded + plane.shape[0]
    behind = under + sideways.shape[0]
    return whole[:under, :loaded], -whole[under:behind, :loaded], -whole[behind:, :under], whole[behind:, behind:]


def _stacked(parts, count):
    """Arrays (count, ...) in single precision from an iterator over tuples of arrays, without keeping the originals."""
    out: list[np.ndarray] = []
    for number, blocks in enumerate(parts):
        out = out or [np.empty((count, *block.shape), dtype=np.float32) for block in blocks]
        for kept, block in zip(out, blocks, strict=True):
            kept[number] = block
    return out


def _foundation_modulus(spec, frustum, cover_law):
    """Foundation modulus (N/mm3) of frusta and layers in series at small depths."""
    frusta = frustum.compression_mm[1] / frustum.force_n[1] * spec.dielectric.frusta.pitch_mm**2
    layers = (spec.thickness_mm - spec.dielectric.frusta.height_mm) / (cover_law.bulk_modulus + 4 / 3 * cover_law.mu0)
    return 1.0 / (frusta + layers)
