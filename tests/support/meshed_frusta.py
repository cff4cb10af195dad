"""A sensor's frusta, sheet and cover meshed whole as a solid, under a meshed rigid punch: what frusta as items are held to."""

from dataclasses import replace

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.extruded_mesh import disc_mesh_2d, extrude, sheet_mesh_2d
from softtact.fem.solid_mesh import SolidMesh
from softtact.fem.structured_meshes import cylinder
from softtact.models.hyperelastic.build import lattice
from softtact.models.solid.body import SolidBody

PUNCH_MM, ROUND_MM, THICK_MM = 1.5, 5.0, 0.5     # radius, radius of curvature of its paraboloid foot, height


def whole_sensor(spec, *, cover_heights=(0.0, 0.5, 1.0), frustum_heights=(0.0, 0.2, 0.6, 1.0), rings=1, refinement=0):
    """HEX27 and WEDGE18 of all layers, regions `dielectric` and `cover`; z = 0 at the sheet's lower side; faces tips, top."""
    frusta, counts = spec.dielectric.frusta, spec.frusta_counts
    sheet, cover = spec.dielectric.sheet_thickness_mm, spec.cover.thickness_mm
    centres, _ = lattice(counts, frusta.pitch_mm)
    plan = sheet_mesh_2d(centres, counts, frusta.pitch_mm, frusta.root_diameter_mm, spec.footprint_mm, rings=rings,
                         refinement=refinement).mesh_2d
    heights = np.concatenate([[0.0], sheet + cover * np.asarray(cover_heights)])
    layers = extrude(plan, heights)
    points, cells = [layers.points], [("dielectric", "hexahedron27", layers.hexes), ("dielectric", "wedge18", layers.wedges)]
    disc = extrude(disc_mesh_2d(refinement, rings), frusta.height_mm * np.asarray(frustum_heights))
    share = disc.points[:, 2] / frusta.height_mm
    radius = 0.5 * (frusta.tip_diameter_mm * (1 - share) + frusta.root_diameter_mm * share)
    shape = np.column_stack([disc.points[:, :2] * radius[:, None], disc.points[:, 2] - frusta.height_mm])
    for centre in centres:
        cells.append(("dielectric", "hexahedron27", disc.hexes + sum(map(len, points))))
        points.append(shape + [*centre, 0.0])
    mesh = one_node_a_place(SolidMesh(np.vstack(points), tuple(cells)))
    mesh = mesh.with_regions(lambda x: np.where(x[:, 2] < sheet, "dielectric", "cover"))
    return mesh.with_faces(tips=lambda x: x[:, 2] < 1e-9 - frusta.height_mm, top=lambda x: x[:, 2] > sheet + cover - 1e-9)


def one_node_a_place(mesh, tolerance=1e-6):
    """The mesh with nodes at one place made one."""
    number = np.arange(len(mesh.points))
    for a, b in sorted(cKDTree(mesh.points).query_pairs(tolerance)):
        number[b] = min(number[a], number[b])
    used, compact = np.unique(number, return_inverse=True)
    cells = tuple((region, kind, compact[nodes]) for region, kind, nodes in mesh.cells)
    return replace(mesh, points=np.ascontiguousarray(mesh.points[used]), cells=cells, faces={})


def under_punch(spec, laws, *, friction, **options):
    """The meshed sensor, tips held, under a rigid punch with a paraboloid foot that just touches it; frame `object`."""
    whole = whole_sensor(spec, **options)
    top = spec.dielectric.sheet_thickness_mm + spec.cover.thickness_mm
    punch = cylinder(PUNCH_MM, THICK_MM, (6, 1)).moved(
        lambda x: x + np.outer((x[:, :2]**2).sum(axis=1) / (2 * ROUND_MM), [0, 0, 1.0]) + [0, 0, top])
    mesh = whole.joined(punch, prefix="punch ")
    held = {"tips": "xyz"}
    stiff = laws["cover"].scaled(100.0)
    body = SolidBody(mesh, {**laws, "punch body": stiff}, held=held,
                     carried={"object": ((0, 0, top + 0.5 * (THICK_MM + PUNCH_MM**2 / (2 * ROUND_MM))), ["punch boundary"])})
    surface = Surface.of(mesh.face("top"))
    body.add(ContactPair(surface, Surface.of(mesh.face("punch z0")), stiffness=40.0, reach_mm=0.6, friction=friction, rigid=True))
    return body


def punch_surface():
    """The same punch as a closed surface."""
    r = np.linspace(0, PUNCH_MM, 31)
    line = np.column_stack([r, r**2 / (2 * ROUND_MM)])
    line = np.vstack([line, [PUNCH_MM, THICK_MM + line[-1, 1]], [0.0, THICK_MM + line[-1, 1]]])
    return trimesh.creation.revolve(line, sections=96)
