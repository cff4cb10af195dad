"""Layered bodies of a sensor: the whole of it, one cell of an endless lattice, a piece of the dielectric."""

import itertools
from collections.abc import Sequence

import numpy as np

from softtact.contact.friction import coulomb
from softtact.contact.penalty import Contact
from softtact.fem.extruded_mesh import sheet_mesh_2d
from softtact.fem.levels import with_level
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.frusta import FrustumArray, FrustumGeometry
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.refinement import FAR, NEAR, split_depths_of, zones
from softtact.models.hyperelastic.rigid_contact import Surface
from softtact.models.hyperelastic.slab import Layer, Slab
from softtact.sensors.frusta import SensorSpec


def _lines(side, count, pitch, pitches):
    """Grid lines: the frusta's lattice, one for `pitches` of them, and a strip to each edge where one is left."""
    half = 0.5 * count * pitch
    inner = pitch * np.append(np.arange(0, count, pitches), count) - half
    margin = 0.5 * side - half
    return np.concatenate([[-0.5 * side], inner, [0.5 * side]]) if margin > 1e-6 else inner


def lattice(counts: Sequence[int], pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 2) of a frustum lattice around the origin and who has a neighbour in +x, +y, -x, -y (n, 4)."""
    nx, ny = counts
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(nx), np.arange(ny)))
    centres = pitch * np.column_stack([i - 0.5 * (nx - 1), j - 0.5 * (ny - 1)])
    return centres, np.column_stack([i < nx - 1, j < ny - 1, i > 0, j > 0])


def build_sensor_body(spec: SensorSpec, *, dielectric_law: Law | None, cover_law: Law | None, mesh: MeshSettings = MeshSettings(),
                      scatter: tuple[np.ndarray, np.ndarray] | None = None, contact: Contact | None = None, threads: int = 1,
                      surface: Surface | None = None) -> LayeredBody:
    """The whole sensor. `scatter`: None or (heights factor (n,), tip diameter factor (n,)) of its frusta.

    surface: the underside of the object that is to be pressed, where the cover's mesh is to be fine; without it a pitch everywhere
    """
    frusta, counts = spec.dielectric.frusta, spec.frusta_counts
    bottom = -(spec.cover.thickness_mm + spec.dielectric.sheet_thickness_mm)
    x_lines, y_lines = (_lines(side, count, frusta.pitch_mm, mesh.far_pitches)
                        for side, count in zip(spec.footprint_mm, counts, strict=True))
    held_below = spec.edge.held_below_mm
    sheet = Layer(with_level(np.linspace(bottom, -spec.cover.thickness_mm, mesh.sheet_layers + 1), -held_below), dielectric_law)
    cover = Layer(with_level(spec.cover.thickness_mm * (np.asarray(mesh.cover_heights) - 1), -held_below), cover_law)
    splits, zone = cover_splits(mesh, surface, x_lines, y_lines, frusta.pitch_mm)
    centres, neighbours = lattice(counts, frusta.pitch_mm)
    mesh_2d = sheet_mesh_2d(centres, counts, frusta.pitch_mm, frusta.root_diameter_mm, spec.footprint_mm,
                            refinement=mesh.refinement,
                      rings=mesh.frustum_rings, core=mesh.core)
    slab = Slab(sheet, cover, mesh_2d, x_lines, y_lines, sides="held", contact=contact or mesh.object_contact,
                constrained_cell_edges=mesh.constrained_cell_edges or _far(zone, x_lines, y_lines), splits=splits,
                quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio, friction=coulomb(spec.friction.object),
                held_below_mm=held_below)
    return LayeredBody(slab, _frustum_array(spec, centres, neighbours, dielectric_law, mesh, scatter, contact),
                       slab.bottom[mesh_2d.roots],
                       threads=threads)


def cover_splits(mesh: MeshSettings, surface: Surface | None, x_lines: np.ndarray, y_lines: np.ndarray,
                 pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """How often the cover's uppermost layers are split, from below (layers, ny 2^m, nx 2^m), and its zones.

    What is below follows their lower side, which must not be finer: it would hang freely between the nodes. Where it lies on the
    sheet itself it is split wherever the object presses, to follow the sheet between the frusta.
    """
    far = int(np.log2(mesh.far_pitches)) + mesh.refinement
    most = far + max(mesh.cover_splits)
    shape = (len(x_lines) - 1, len(y_lines) - 1)
    zone = np.full((shape[1] << most, shape[0] << most), NEAR) if surface is None else zones(surface, x_lines, y_lines, most)
    narrow = [np.round(np.log2(mesh.far_pitches * pitch / np.diff(lines))).astype(int).clip(0) for lines in (x_lines, y_lines)]
    narrow = np.maximum(*np.meshgrid(*narrow)).repeat(1 << most, axis=0).repeat(1 << most, axis=1)
    depths, on_sheet = [], mesh.bound_layers == 0
    for k, splits in enumerate(mesh.cover_splits):
        of_zone = far + np.array([mesh.refinement - far, 0, splits if k == 0 and on_sheet else 0, min(splits, 1), splits])
        depths.append(split_depths_of(np.maximum(of_zone[zone] - narrow, 0), shape, most))
    return np.stack(depths), zone


def _far(zone, x_lines, y_lines):
    """A function of places (n, 2) that tells (n,) which lie among FAR places of the grid only."""
    x, y = (np.interp(np.arange(size + 1), np.linspace(0, size, len(lines)), lines)
            for size, lines in zip(zone.shape[::-1], (x_lines, y_lines), strict=True))

    def far(places):
        around = np.zeros(len(places), dtype=int)
        for dx, dy in itertools.product((-1e-6, 1e-6), repeat=2):
            i, j = (np.clip(np.searchsorted(lines, value) - 1, 0, len(lines) - 2)
                    for lines, value in ((x, places[:, 0] + dx), (y, places[:, 1] + dy)))
            around = np.maximum(around, zone[j, i])
        return around == FAR

    return far


def build_unit_cell(spec: SensorSpec, *, dielectric_law: Law | None, cover_law: Law | None = None,
                    mesh: MeshSettings = MeshSettings(), height_factor: float = 1.0, tip_factor: float = 1.0) -> LayeredBody:
    """One frustum of an endless lattice with its share of the sheet, and of the cover where a law for it is given."""
    frusta = spec.dielectric.frusta
    lines = 0.5 * frusta.pitch_mm * np.linspace(-1, 1, 2**mesh.refinement + 1)
    splits = np.minimum(mesh.cover_splits, 1)[:, None, None] * np.ones((2 * len(lines) - 2,) * 2, dtype=int) if cover_law else None
    cover_mm = 0.0 if cover_law is None else spec.cover.thickness_mm
    bottom = -(cover_mm + spec.dielectric.sheet_thickness_mm)
    sheet = Layer(np.linspace(bottom, -cover_mm, mesh.sheet_layers + 1), dielectric_law)
    cover = Layer(cover_mm * (np.asarray(mesh.cover_heights) - 1) if cover_mm else np.zeros(1), cover_law)
    centre = np.zeros((1, 2))
    mesh_2d = sheet_mesh_2d(centre, (1, 1), frusta.pitch_mm, frusta.root_diameter_mm, (frusta.pitch_mm,) * 2,
                            refinement=mesh.refinement,
                      rings=mesh.frustum_rings, core=mesh.core)
    slab = Slab(sheet, cover, mesh_2d, lines, lines, sides="symmetric", contact=mesh.contact,
                constrained_cell_edges=mesh.constrained_cell_edges,
                splits=splits, quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio, friction=coulomb(spec.friction.object))
    support = _frustum_array(spec, centre, np.ones((1, 4), dtype=bool), dielectric_law, mesh,
               (np.array([height_factor]), np.array([tip_factor])), None, bottom=bottom)
    return LayeredBody(slab, support, slab.bottom[mesh_2d.roots])


def build_patch(spec: SensorSpec, counts: Sequence[int], *, dielectric_law: Law | None,
                mesh: MeshSettings = MeshSettings()) -> LayeredBody:
    """A piece of the dielectric alone, `counts` frusta along x and y with free borders half a pitch from the outer ones' axes."""
    frusta, thickness = spec.dielectric.frusta, spec.dielectric.sheet_thickness_mm
    centres, neighbours = lattice(counts, frusta.pitch_mm)
    lines = [frusta.pitch_mm * (np.arange(count + 1) - 0.5 * count) for count in counts]
    mesh_2d = sheet_mesh_2d(centres, counts, frusta.pitch_mm, frusta.root_diameter_mm, [np.ptp(line) for line in lines],
                      rings=mesh.frustum_rings, core=mesh.core)
    slab = Slab(Layer(np.linspace(-thickness, 0.0, mesh.sheet_layers + 1), dielectric_law), Layer(np.zeros(1), None), mesh_2d,
                *lines,
                sides="free", contact=mesh.contact, constrained_cell_edges=mesh.constrained_cell_edges,
                quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio)
    support = _frustum_array(spec, centres, neighbours, dielectric_law, mesh, None, None, bottom=-thickness)
    return LayeredBody(slab, support, slab.bottom[mesh_2d.roots])


def _frustum_array(spec, centres, neighbours, law, mesh, scatter, contact, *, bottom=None):
    frusta = spec.dielectric.frusta
    if bottom is None:
        bottom = -(spec.cover.thickness_mm + spec.dielectric.sheet_thickness_mm)
    height_factor, tip_factor = scatter or (np.ones(len(centres)), np.ones(len(centres)))
    heights = frusta.height_mm * height_factor
    # Every cone is built with the same root; where its printed readings are swapped the tip is the wide end.
    geometry = FrustumGeometry(centres=centres, heights=heights, tip_diameters=frusta.tip_diameter_mm * tip_factor,
                           root_diameter=frusta.root_diameter_mm, neighbours=neighbours,
                           wall_mm=0.5 * (frusta.pitch_mm - frusta.root_diameter_mm))
    return FrustumArray(geometry, law, heights=np.asarray(mesh.frustum_heights) * frusta.height_mm, root_z_mm=bottom,
                      pcb_z_mm=bottom - heights.max(), tips_bonded=spec.tips_bonded, contact=contact or mesh.contact,
                      unprojected_penalty_ratio=mesh.unprojected_penalty_ratio, quartic_penalty_ratio=mesh.quartic_penalty_ratio,
                      trilinear=mesh.trilinear_pressure, refinement=mesh.refinement, rings=mesh.frustum_rings, core=mesh.core,
                      friction=coulomb(spec.friction.board))
