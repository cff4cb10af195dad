"""Bodies of a sensor: the whole of it, one cell of an endless lattice, a piece of the dielectric, one or two plain layers.

The cover's mesh is refined in steps towards the object, and finest at the object's edges (`zones`). If a flat punch's edge is in
an element, the whole element stays flat: with faces of a pitch the punch acts up to half a pitch wider, and the map of a punch of
3 mm radius is 10 % low. Also, the sheet bulges into the pockets between frusta, which a face of a pitch cannot resolve: 6 % of
the map. Fine elements are needed only where the object presses (benchmarks/mesh_error.py).

Plain layers are bonded to the board or free below; their sides are fixed as the sensor's edge states. The lowest part is the slab's
sheet, 27-node hexahedra on a regular grid; above is its cover, refined under the object. The sheet is the lower half of a single
layer, or the dielectric of two layers.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.ndimage import maximum_filter, minimum_filter

from softtact.contact.friction import coulomb
from softtact.contact.penalty import Contact
from softtact.fem.extruded_mesh import SheetMesh2D, grid_mesh_2d, interpolation_2d, merge, sheet_mesh_2d, with_centres
from softtact.fem.graded_mesh import split_depths
from softtact.fem.structured_meshes import with_level
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.frusta import FrustumArray, FrustumGeometry
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.slab import CoverSide, Layer, Slab, SlabMesh
from softtact.models.hyperelastic.states import ObjectSurface
from softtact.models.hyperelastic.support import Support
from softtact.sensors.frusta import SensorSpec
from softtact.sensors.layers import LayersSpec

REACH_MM = 1.0        # parts of the object higher than this above its lowest point are assumed not to touch the cover
AROUND_MM = 0.3       # width of the margin around the object that belongs to the zone under it
NEAR_MM = 2.4         # width of the margin in which elements have at most the size of a pitch
_STEEP = 1.2          # slope within an element above which it contains an edge
_SLANTED = 0.067      # slope within an element above which the underside counts as curved, not flat
_SAMPLES = 4          # heights along each side of the smallest element
FAR, NEAR, FLAT, CURVED, EDGE = range(5)
_SHEET_SHARE = 0.5      # of a single layer that is meshed as the slab's sheet
_SHEET_LAYERS = 2       # at least: a bonded layer's shear changes over its height


def zones(surface: ObjectSurface, x_lines: np.ndarray, y_lines: np.ndarray, most: int) -> np.ndarray:
    """FAR, NEAR, FLAT, CURVED or EDGE for each place of a grid (ny 2^most, nx 2^most) whose cells are split `most` times."""
    height = _heights(surface, x_lines, y_lines, _SAMPLES << most)
    side = min(np.diff(lines).max() for lines in (x_lines, y_lines)) / (1 << most)
    # An edge on the line between two elements concerns both, so each sample is compared with its neighbours. (Samples farther away
    # add 9000 unknowns under a wide punch with edges split four times, and change the map by 0.2 %.)
    low = minimum_filter(height, 3)
    rise = _in_places(maximum_filter(height, 3) - low, np.max)
    reached = _in_places(low, np.min) < REACH_MM
    touched = _in_places(height, np.min) < REACH_MM
    under, near = (maximum_filter(touched, 2 * int(np.ceil(far / side - 1e-9)) + 1) for far in (AROUND_MM, NEAR_MM))
    curved, edge = reached & (rise > _SLANTED * side), reached & (rise > _STEEP * side)
    return np.max([NEAR * near, FLAT * under, CURVED * curved, EDGE * edge], axis=0)


def _heights(surface, x_lines, y_lines, parts):
    """Heights (y, x) in mm above the object's lowest point at the centres of parts of the grid's cells."""
    x, y = (_sampled(lines, parts) for lines in (x_lines, y_lines))
    gx, gy = np.meshgrid(x, y)
    height = surface(gx.ravel(), gy.ravel())[0].reshape(gx.shape)
    return np.minimum(height - height.min(), 2 * REACH_MM)


def _in_places(samples, choose):
    """Minimum or maximum of the samples in each smallest cell."""
    rows, columns = samples.shape
    return choose(samples.reshape(rows // _SAMPLES, _SAMPLES, columns // _SAMPLES, _SAMPLES), axis=(1, 3))


def _sampled(lines, parts):
    """Middles of equal parts of the intervals between lines."""
    fine = np.interp(np.arange(2 * parts * (len(lines) - 1) + 1), 2 * parts * np.arange(len(lines)), lines)
    return fine[1::2]


def split_depths_of(zone: np.ndarray, shape: tuple[int, int], most: int) -> np.ndarray:
    """Split depths on the finest grid for zones (ny 2^most, nx 2^most), in a grid of `shape` (nx, ny)."""

    def wanted(low, size, depth):
        block = int(size * (1 << most))
        i, j = (low * (1 << most)).astype(int).T
        whole = zone.reshape(zone.shape[0] // block, block, zone.shape[1] // block, block).max(axis=(1, 3))
        return whole[j // block, i // block] > depth

    return split_depths(shape, wanted, most)


def _lines(side, count, pitch, pitches):
    """Grid lines: one for every `pitches` pitches of the frusta's lattice, and those of strips at the edges if there are any."""
    half = 0.5 * count * pitch
    inner = pitch * np.append(np.arange(0, count, pitches), count) - half
    margin = 0.5 * side - half
    return np.concatenate([[-0.5 * side], inner, [0.5 * side]]) if margin > 1e-6 else inner


def lattice(counts: Sequence[int], pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 2) of a frustum lattice around the origin, and which frusta have neighbours in +x, +y, -x, -y (n, 4)."""
    nx, ny = counts
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(nx), np.arange(ny)))
    centres = pitch * np.column_stack([i - 0.5 * (nx - 1), j - 0.5 * (ny - 1)])
    return centres, np.column_stack([i < nx - 1, j < ny - 1, i > 0, j > 0])


def build_sensor_body(spec: SensorSpec, *, dielectric_law: Law | None, cover_law: Law | None, mesh: MeshSettings = MeshSettings(),
                      scatter: tuple[np.ndarray, np.ndarray] | None = None, contact: Contact | None = None, threads: int = 1,
                      surface: ObjectSurface | None = None) -> LayeredBody:
    """The whole sensor. `scatter`: None or (heights factor (n,), tip diameter factor (n,)) of its frusta.

    surface: underside of the pressed object, for the refinement of the cover's mesh; without it elements are a pitch wide
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
    plan = SlabMesh(mesh_2d, x_lines, y_lines, splits, mesh.constrained_cell_edges or _far(zone, x_lines, y_lines))
    slab = Slab(sheet, cover, plan, sides="held", contact=contact or mesh.object_contact,
                quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio, friction=coulomb(spec.friction.object),
                held_below_mm=held_below)
    return LayeredBody(slab, _frustum_array(spec, centres, neighbours, dielectric_law, mesh, scatter, contact),
                       slab.bottom[mesh_2d.roots],
                       threads=threads)


def cover_splits(mesh: MeshSettings, surface: ObjectSurface | None, x_lines: np.ndarray, y_lines: np.ndarray,
                 pitch: float) -> tuple[np.ndarray, np.ndarray]:
    """Split depths of the cover's uppermost layers, from below (layers, ny 2^m, nx 2^m), and its zones.

    The mesh below is tied to their lower side, which must not be finer, as its additional nodes would be free. A lower side
    directly on the sheet is split wherever the object presses, to resolve the sheet between the frusta.
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
    """A function of places (n, 2) that returns which (n,) of them have only FAR cells around them."""
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
    """One frustum of an infinite lattice with its part of the sheet, and of the cover if a law for it is given."""
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
    slab = Slab(sheet, cover, SlabMesh(mesh_2d, lines, lines, splits, mesh.constrained_cell_edges), sides="symmetric",
                contact=mesh.contact, quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio, friction=coulomb(spec.friction.object))
    support = _frustum_array(spec, centre, np.ones((1, 4), dtype=bool), dielectric_law, mesh,
               (np.array([height_factor]), np.array([tip_factor])), None, bottom=bottom)
    return LayeredBody(slab, support, slab.bottom[mesh_2d.roots])


def build_patch(spec: SensorSpec, counts: Sequence[int], *, dielectric_law: Law | None,
                mesh: MeshSettings = MeshSettings()) -> LayeredBody:
    """A piece of the dielectric alone with `counts` frusta along x and y, and free sides half a pitch from the outer axes."""
    frusta, thickness = spec.dielectric.frusta, spec.dielectric.sheet_thickness_mm
    centres, neighbours = lattice(counts, frusta.pitch_mm)
    lines = [frusta.pitch_mm * (np.arange(count + 1) - 0.5 * count) for count in counts]
    mesh_2d = sheet_mesh_2d(centres, counts, frusta.pitch_mm, frusta.root_diameter_mm, [np.ptp(line) for line in lines],
                      rings=mesh.frustum_rings, core=mesh.core)
    slab = Slab(Layer(np.linspace(-thickness, 0.0, mesh.sheet_layers + 1), dielectric_law), Layer(np.zeros(1), None),
                SlabMesh(mesh_2d, *lines, constrained_cell_edges=mesh.constrained_cell_edges), sides="free", contact=mesh.contact,  # type: ignore[arg-type, misc]
                quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio)
    support = _frustum_array(spec, centres, neighbours, dielectric_law, mesh, None, None, bottom=-thickness)
    return LayeredBody(slab, support, slab.bottom[mesh_2d.roots])


def _frustum_array(spec, centres, neighbours, law, mesh, scatter, contact, *, bottom=None):
    frusta = spec.dielectric.frusta
    if bottom is None:
        bottom = -(spec.cover.thickness_mm + spec.dielectric.sheet_thickness_mm)
    height_factor, tip_factor = scatter or (np.ones(len(centres)), np.ones(len(centres)))
    heights = frusta.height_mm * height_factor
    # Every cone is built with the same root; if its diameters are swapped, the tip is the wide end.
    geometry = FrustumGeometry(centres=centres, heights=heights, tip_diameters=frusta.tip_diameter_mm * tip_factor,
                           root_diameter=frusta.root_diameter_mm, neighbours=neighbours,
                           wall_mm=0.5 * (frusta.pitch_mm - frusta.root_diameter_mm))
    return FrustumArray(geometry, law, mesh, height_mm=frusta.height_mm, root_z_mm=bottom, tips_bonded=spec.tips_bonded,
                        contact=contact or mesh.contact, friction=coulomb(spec.friction.board))


class SingleLayerSlab(Slab):
    """A slab of one material: the electrode plane is its top, and both its parts are the same region."""

    regions = ("sheet", "sheet")

    def sampling(self, points: np.ndarray) -> sp.csr_matrix:
        """Sparse matrix (p, nodes) that interpolates a nodal field of the top at points (p, 2)."""
        mesh = self.cover_mesh
        at = CoverSide(mesh, mesh.top, mesh.top_cells, self.x_lines, self.y_lines).interpolation(points)
        at.resize(len(points), self.nodes)
        return at


def build_plain_body(spec: LayersSpec, *, dielectric_law: Law | None, cover_law: Law | None = None,
                     mesh: MeshSettings = MeshSettings(), scatter: tuple | None = None, contact: Contact | None = None,
                     threads: int = 1, surface: ObjectSurface | None = None) -> LayeredBody:
    """The body of a `LayersSpec`; arguments as for `build_sensor_body`.

    scatter: must be None, since there are no frusta
    """
    if scatter is not None:
        spec.need_frusta("a scatter of frusta", "leave height_scatter and tip_scatter out")
    slab = plain_slab(spec, (dielectric_law, cover_law), mesh, contact=contact, surface=surface)
    return LayeredBody(slab, Support(spec.support, contact or mesh.contact), threads=threads)


def plain_slab(spec: LayersSpec, laws: tuple[Law | None, Law | None], mesh: MeshSettings = MeshSettings(), *,
               contact: Contact | None = None, surface: ObjectSurface | None = None, sides: str = "held") -> Slab:
    """The slab of plain layers with laws (dielectric, cover);  sides: see `Slab`, for parts of a wider layer."""
    x_lines, y_lines = (_element_lines(side, spec.element_size_mm, mesh) for side in spec.footprint_mm)
    splits, _ = cover_splits(mesh, surface, x_lines, y_lines, 2 * spec.element_size_mm)
    kind = Slab if spec.cover else SingleLayerSlab
    mesh_2d = grid_without_cells(*(_fine(lines, mesh) for lines in (x_lines, y_lines)))
    slab = kind(*_layers(spec, *laws, mesh), SlabMesh(mesh_2d, x_lines, y_lines, splits), sides=sides,  # type: ignore[arg-type, misc]
                contact=contact or mesh.object_contact, quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio,
                friction=coulomb(spec.friction.object), held_below_mm=spec.edge.held_below_mm)
    if spec.base_held:
        slab.hold(slab.bottom)
    return slab


def _layers(spec, dielectric_law, cover_law, mesh):
    """The slab's sheet and cover as `Layer`s, z = 0 at the top."""
    above = spec.cover.thickness_mm if spec.cover else (1 - _SHEET_SHARE) * spec.thickness_mm
    heights = np.linspace(-spec.thickness_mm, -above, max(mesh.sheet_layers, _SHEET_LAYERS) + 1)
    held = -spec.edge.held_below_mm
    return (Layer(with_level(heights, held), dielectric_law),
            Layer(with_level(above * (np.asarray(mesh.cover_heights) - 1), held), cover_law if spec.cover else dielectric_law))


def _element_lines(side, element_mm, mesh):
    """Grid lines of the cover's coarsest elements, at most `far_pitches` pairs of elements apart."""
    count = int(np.ceil(side / (2 * element_mm * mesh.far_pitches) - 1e-9))
    return np.linspace(-0.5 * side, 0.5 * side, count + 1)


def _fine(lines, mesh):
    """Grid lines of the sheet's elements: two for each of the cover's, so that the sheet is as fine as the cover above it."""
    parts = 2 * mesh.far_pitches * 2**mesh.refinement
    return np.interp(np.arange(parts * (len(lines) - 1) + 1), parts * np.arange(len(lines)), lines)


def grid_without_cells(x_lines: np.ndarray, y_lines: np.ndarray) -> SheetMesh2D:
    """The `SheetMesh2D` of a grid without frusta: no roots, no cells."""
    grid, none = grid_mesh_2d(x_lines, y_lines), np.zeros((0, 4), dtype=np.int64)
    return SheetMesh2D(merge(with_centres(grid.points[grid.quads])), np.zeros((0, 25), dtype=np.int64), 0, (none, np.zeros(3)))


def lower_side(slab: Slab, points: np.ndarray) -> sp.csr_matrix:
    """Sparse matrix (p, nodes) that interpolates a nodal field of the lower side at points (p, 2)."""
    on_plan = interpolation_2d(slab.sheet_mesh_2d.mesh_2d, points).tocoo()
    nodes = slab.bottom[on_plan.col]
    return type(on_plan)((on_plan.data, (on_plan.row, nodes)), shape=(len(points), slab.nodes)).tocsr()
