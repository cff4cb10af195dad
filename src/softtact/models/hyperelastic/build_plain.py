"""Bodies of one or two plain layers without frusta, bonded to the board or free below; their sides as the sensor's edge says.

The lowest part is the slab's sheet, 27-node hexahedra on a regular grid; above lies its cover, refined under the object. Of a
single layer the lower half is the sheet, of two layers the dielectric is.
"""

import numpy as np
import scipy.sparse as sp

from softtact.contact.friction import coulomb
from softtact.contact.penalty import Contact
from softtact.fem.extruded_mesh import SheetMesh2D, grid_mesh_2d, merge, with_centres
from softtact.fem.levels import with_level
from softtact.fem.point_location import interpolation_2d
from softtact.materials.laws.base import Law
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.build import cover_splits
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.rigid_contact import Surface
from softtact.models.hyperelastic.slab import Layer, Slab
from softtact.models.hyperelastic.slab_nodes import CoverSide
from softtact.models.hyperelastic.support import PlainSupport
from softtact.sensors.layers import LayersSpec

_SHEET_SHARE = 0.5      # of a single layer that is meshed as the slab's sheet
_SHEET_LAYERS = 2       # at least: a bonded layer's shear changes over its height


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
                     threads: int = 1, surface: Surface | None = None, sides: str = "held") -> LayeredBody:
    """The body of a `LayersSpec`; arguments as for `build_sensor_body`.

    scatter: must be None, there are no frusta that could differ;  sides: see `Slab`, for pieces of a wider layer
    """
    if scatter is not None:
        spec.need_frusta("a scatter of frusta", "leave height_scatter and tip_scatter out")
    x_lines, y_lines = (_lines(side, spec.element_size_mm, mesh) for side in spec.footprint_mm)
    sheet, cover = _layers(spec, dielectric_law, cover_law, mesh)
    splits, _ = cover_splits(mesh, surface, x_lines, y_lines, 2 * spec.element_size_mm)
    kind = Slab if spec.cover else SingleLayerSlab
    slab = kind(sheet, cover, grid_without_cells(*(_fine(lines, mesh) for lines in (x_lines, y_lines))), x_lines, y_lines,
                sides=sides, contact=contact or mesh.object_contact, splits=splits,
                quartic_penalty_ratio=mesh.slab_quartic_penalty_ratio, friction=coulomb(spec.friction.object),
                held_below_mm=spec.edge.held_below_mm)
    if spec.base_held:
        slab.hold(slab.bottom)
    return LayeredBody(slab, PlainSupport(spec.support, contact or mesh.contact), threads=threads)


def _layers(spec, dielectric_law, cover_law, mesh):
    """The slab's sheet and cover as `Layer`s, z = 0 at the top."""
    above = spec.cover.thickness_mm if spec.cover else (1 - _SHEET_SHARE) * spec.thickness_mm
    heights = np.linspace(-spec.thickness_mm, -above, max(mesh.sheet_layers, _SHEET_LAYERS) + 1)
    held = -spec.edge.held_below_mm
    return (Layer(with_level(heights, held), dielectric_law),
            Layer(with_level(above * (np.asarray(mesh.cover_heights) - 1), held), cover_law if spec.cover else dielectric_law))


def _lines(side, element_mm, mesh):
    """Lines of the cover's coarsest elements, as far as `far_pitches` pairs of elements apart."""
    count = int(np.ceil(side / (2 * element_mm * mesh.far_pitches) - 1e-9))
    return np.linspace(-0.5 * side, 0.5 * side, count + 1)


def _fine(lines, mesh):
    """Lines of the sheet's elements: two for each of the cover's pitches, so that it is as fine as what it carries."""
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
