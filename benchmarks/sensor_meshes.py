"""Conforming meshes of frusta, sheet and cover in several kinds of elements, all cut out of one mesh of full quadratic ones.

A cell of the plan is tiled, merged and lifted to 27-node hexahedra and 18-node wedges; these hold the nodes of every other kind:
20-node hexahedra and 15-node wedges leave out some, linear elements keep the corners, and tetrahedra cut the wedges in three.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from softtact.fem.extruded_mesh import cell_mesh_2d, extrude, merge, refine

_NO_QUADS = np.zeros((0, 9, 2))


@dataclass(frozen=True)
class LayeredMesh:
    """points (n, 3) in mm, z = 0 at the top; by material ("dielectric", "cover") hexahedra (e, 27) and wedges (w, 18).

    top, tips, cone_sides: dicts of faces by their number of nodes, 9 (quads) or 6 (triangles), in plan order;
    interface: corner nodes of the coarsest plan between sheet and cover; extent: half sides of the footprint (mm);
    z_root: height of the cones' roots (mm).
    """

    points: np.ndarray
    hexes: dict
    wedges: dict
    top: dict
    tips: dict
    cone_sides: dict
    interface: np.ndarray
    extent: np.ndarray
    z_root: float


@dataclass(frozen=True)
class Stack:
    """Heights of the element layers: shares of the frustum's height (0 at the tip, 1 at the root), layers of sheet and cover."""

    cone: tuple = (0.0, 0.2, 0.6, 1.0)
    sheet: int = 1
    cover: int = 2

    def halved(self, times=1):
        """Every layer split in two, `times` times."""
        cone = np.asarray(self.cone)
        for _ in range(times):
            cone = np.sort(np.concatenate([cone, 0.5 * (cone[1:] + cone[:-1])]))
        return Stack(tuple(cone), self.sheet * 2**times, self.cover * 2**times)


def octagon_cell(pitch, diameter):
    """A cell of 16 straight triangles, the first eight a fan under which the cone stands: quads (0, 9, 2), triangles (16, 6, 2).

    The octagon's points at 45 degrees stand further out than the circle, so that it has the circle's area.
    """
    angles = np.deg2rad(45 * np.arange(8))
    radius = 0.5 * diameter * np.where(np.arange(8) % 2, np.pi / (2 * np.sqrt(2)), 1.0)
    ring = radius[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    corner = 0.5 * pitch * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    fan = [[np.zeros(2), ring[k], ring[(k + 1) % 8]] for k in range(8)]
    outside = [t for k in range(4) for t in ([ring[2 * k], corner[k], ring[2 * k + 1]],
                                             [ring[2 * k + 1], corner[k], ring[(2 * k + 2) % 8]])]
    corners = np.array(fan + outside)
    return _NO_QUADS, np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=1))], axis=1)


def layered_mesh(spec, counts, *, cell=cell_mesh_2d, refinement=0, stack=Stack(), straight=False):
    """Mesh of a lattice `counts` of a `SensorSpec`; `cell(pitch, diameter)` gives a cell's quads and triangles.

    straight: the rims' nodes are moved so that the polygon of the corners has the circle's area (linear elements, refined plans).
    """
    frusta, z_root = spec.dielectric.frusta, -(spec.dielectric.sheet_thickness_mm + spec.cover.thickness_mm)
    quads, triangles = cell(frusta.pitch_mm, frusta.root_diameter_mm)
    on_disc = (5, 0) if len(quads) else (0, 8)
    x, y = (frusta.pitch_mm * (np.arange(n) - 0.5 * (n - 1)) for n in counts)
    centres = np.column_stack([grid.ravel() for grid in np.meshgrid(x, y)])
    coarse = merge(_tiled(quads, centres), _tiled(triangles, centres))
    mesh_2d = refine(coarse, refinement)
    disc = refine(merge(quads[:on_disc[0]], triangles[:on_disc[1]]), refinement)
    if straight:
        radius, corners = 0.5 * frusta.root_diameter_mm, 4 * 2**refinement
        mesh_2d, disc = _widened(mesh_2d, centres, radius, corners), _widened(disc, np.zeros((1, 2)), radius, corners)
    levels = np.concatenate([np.linspace(z_root, -spec.cover.thickness_mm, stack.sheet + 1),
                             np.linspace(-spec.cover.thickness_mm, 0, stack.cover + 1)[1:]])
    slab = extrude(mesh_2d, levels)
    ratio = frusta.tip_diameter_mm / frusta.root_diameter_mm
    cone = extrude(disc, np.asarray(stack.cone), scale=lambda share: ratio + (1 - ratio) * share)
    return _joined(slab, cone, mesh_2d, disc, centres, coarse, z_root, frusta.height_mm, stack.sheet,
                   0.5 * frusta.pitch_mm * np.asarray(counts))


def _tiled(elements, centres):
    return (elements[None] + centres[:, None, None]).reshape(-1, *elements.shape[1:])


def _widened(mesh_2d, centres, radius, corners):
    """The plan with its rims moved out between the points where discs touch: a polygon of `corners` with the circle's area.

    A corner at radius 1 and the next at f, or both at f: the area is sin(2 pi / corners) (8 f + (corners - 8) f^2) / 2 = pi.
    The nodes along the cells' walls make room: they slide towards the cells' corners.
    """
    distance, owner = cKDTree(centres).query(mesh_2d.points)
    offset = mesh_2d.points - centres[owner]
    touching = np.abs(offset).min(axis=1) < 1e-9
    moved = (np.abs(distance - radius) < 0.02 * radius) & ~touching
    factor = max(np.roots([corners - 8, 8, -2 * np.pi / np.sin(2 * np.pi / corners)]))
    points = mesh_2d.points.copy()
    points[moved] = centres[owner[moved]] + factor * radius * offset[moved] / distance[moved, None]
    share = np.abs(offset) / radius
    slide = np.where((share.max(axis=1) > 1 - 1e-9)[:, None] & (share < 1 - 1e-9), 5 * (factor - 1) * share * (1 - share), 0.0)
    points += radius * slide * np.sign(offset)
    return type(mesh_2d)(points, mesh_2d.quads, mesh_2d.corners, mesh_2d.triangles)


def _joined(slab, cone, mesh_2d, disc, centres, coarse, z_root, height, sheet_layers, extent):
    """Slab and cones on one set of nodes: each cone's uppermost plane is the slab's lowest there."""
    own = np.setdiff1d(np.arange(len(cone.points)), cone.planes[-1])
    first = len(slab.points)
    z = z_root + height * (cone.points[own, 2] - 1)
    placed = [np.column_stack([cone.points[own, :2] + c, z]) for c in centres]
    roots = _find(mesh_2d.points, _tiled(disc.points[None], centres).reshape(-1, 2)).reshape(len(centres), -1)
    number = np.empty((len(centres), len(cone.points)), dtype=np.int64)
    number[:, own] = first + np.arange(len(centres) * len(own)).reshape(len(centres), -1)
    number[:, cone.planes[-1]] = slab.planes[0][roots]

    def placed_cone(elements):
        return number[:, elements].reshape(-1, elements.shape[1])

    split = {"dielectric": slice(None, sheet_layers), "cover": slice(sheet_layers, None)}
    hexes = {name: slab.hexes.reshape(slab.layers, -1, 27)[part].reshape(-1, 27) for name, part in split.items()}
    wedges = {name: slab.wedges.reshape(slab.layers, -1, 18)[part].reshape(-1, 18) for name, part in split.items()}
    hexes["dielectric"] = np.vstack([hexes["dielectric"], placed_cone(cone.hexes)])
    wedges["dielectric"] = np.vstack([wedges["dielectric"], placed_cone(cone.wedges)])
    tips = {9: placed_cone(cone.planes[0][disc.quads]), 6: placed_cone(cone.planes[0][disc.triangles])}
    top = {9: slab.planes[-1][mesh_2d.quads], 6: slab.planes[-1][mesh_2d.triangles]}
    seen = _find(mesh_2d.points, coarse.points[:coarse.corners])
    return LayeredMesh(np.vstack([slab.points, *placed]), hexes, wedges, top, tips, _cone_sides(cone, disc, placed_cone),
                       slab.planes[sheet_layers][seen], extent, z_root)


def _cone_sides(cone, disc, placed_cone):
    """Side faces (f, 9) of the cones: those over the plan's outer edges."""
    edges = np.vstack([disc.quads[:, [[k, (k + 1) % 4, 4 + k] for k in range(4)]].reshape(-1, 3),
                       disc.triangles[:, [[k, (k + 1) % 3, 3 + k] for k in range(3)]].reshape(-1, 3)])
    _, first, counts = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True, return_counts=True)
    a, b, m = edges[first[counts == 1]].T
    middles = cone.planes.size + np.arange(cone.layers * cone.planes.shape[1]).reshape(cone.layers, -1)
    faces = [np.column_stack([low[a], low[b], high[b], high[a], low[m], middle[b], high[m], middle[a], middle[m]])
             for low, high, middle in zip(cone.planes[:-1], cone.planes[1:], middles, strict=True)]
    return {9: placed_cone(np.vstack(faces))}


def _find(points, wanted):
    distance, index = cKDTree(points).query(wanted)
    if distance.max() > 0.03:
        raise ValueError("a node is missing in the plan")
    return index


# Cutting elements -----------------------------------------------------------------------------------------------------------

_QUAD_HALVES = np.array([[0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7]])     # a 9-node quad's two 6-node triangles
_MIDDLE = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])                 # of a 6-node triangle: corner or middle of two corners
_PRISM_TETS = (((0, 0), (1, 0), (2, 0), (2, 1)), ((0, 0), (1, 0), (1, 1), (2, 1)), ((0, 0), (0, 1), (1, 1), (2, 1)))
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))


def wedges_of(hexes, wedges):
    """18-node wedges (w, 18) in place of 27-node hexahedra and beside the given ones."""
    halves = np.concatenate([_QUAD_HALVES + 9 * level for level in range(3)], axis=1)
    return np.vstack([hexes[:, halves].reshape(-1, 18), wedges])


def triangles_of(faces):
    """6-node triangles (t, 6) of faces by their number of nodes."""
    return np.vstack([faces.get(9, np.zeros((0, 9), int))[:, _QUAD_HALVES].reshape(-1, 6), faces.get(6, np.zeros((0, 6), int))])


def tetrahedra_of(points, wedges):
    """10-node tetrahedra (3 w, 10) of 18-node wedges: corners, then the edges 01 12 20 03 13 23; the first four are linear ones.

    A wedge's corners are taken in the order of their numbers, so that neighbours cut a common side along one diagonal.
    """
    order = np.argsort(wedges[:, :3], axis=1)
    rows = np.arange(len(wedges))
    out = []
    for tet in _PRISM_TETS:
        def node(p, q):
            (v, a), (w, b) = p, q
            level = 2 if a != b else a
            return wedges[rows, 6 * level + _MIDDLE[order[:, v], order[:, w]]]

        corners = [node(v, v) for v in tet]
        out.append(np.stack(corners + [node(tet[i], tet[j]) for i, j in _TET_EDGES], axis=1))
    return _turned(points, np.stack(out, axis=1).reshape(-1, 10))


def _turned(points, tets):
    """The same tetrahedra, all of positive volume."""
    x = points[tets[:, :4]]
    negative = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    swapped = tets[:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    return np.where(negative[:, None], swapped, tets)


def compressed(points, *arrays):
    """The points that the arrays use, and the arrays in their new numbers."""
    used = np.unique(np.concatenate([a.ravel() for a in arrays]))
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    return points[used], *(number[a] for a in arrays)
