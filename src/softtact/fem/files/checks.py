"""Checks of a mesh of elements from a file: elements that repeat, are inverted or do not meet face to face; and its pieces."""

import math
from itertools import combinations
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import trimesh
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from softtact.errors import InputError
from softtact.fem.files.raw_mesh import FACET_CORNERS
from softtact.fem.solid_mesh import ELEMENTS, SolidMesh, flat_triangles

# Simplices that make up an element, among its corners in VTK's order.
_SIMPLICES = {3: [[0, 1, 2]], 4: [[0, 1, 2, 3]], 6: [[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5]],
              8: [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]}
_QUAD = [[0, 1, 2], [0, 2, 3]]
_ON = 1e-6               # of its size: how far from a simplex a point counts as on it
_DEEP = 0.02             # of an element's size: two bodies that lie deeper in each other overlap
_NEAREST = 32            # simplices and facets that are searched around a point
_SAMPLES = 50_000        # points in a piece, at most, that are searched in another one
_MOST_PIECES = 12        # between more pieces no contacts are searched
_MOST_TOLD = 3
_FLAT = 1e-6             # volume of four points in a plane, over the cube of their distance


def refuse_faulty(path: Path, mesh: SolidMesh) -> None:
    """Refuse elements with a node twice, that repeat or are inverted, and neighbours that do not match.

    Raises InputError that says how many there are and where one is.
    """
    _refuse_collapsed(path, mesh)
    _refuse_repeated(path, mesh)
    _refuse_inverted(path, mesh)
    _refuse_mismatched(path, mesh)


def _corners(kind, nodes):
    """Corners (e, c) of elements in VTK's order."""
    element = ELEMENTS[kind]
    return nodes[:, element.vtk_order[: element.corners]]


def _at(mesh, nodes):
    x, y, z = mesh.points[np.asarray(nodes)].mean(axis=0)
    return f"at {x:.4g}, {y:.4g}, {z:.4g} mm"


def _refuse_collapsed(path, mesh):
    for _, kind, nodes in mesh.cells:
        ordered = np.sort(_corners(kind, nodes), axis=1)
        if (twice := (np.diff(ordered, axis=1) == 0).any(axis=1)).any():
            raise InputError(f"{path}: {twice.sum()} elements have a node twice (one {_at(mesh, nodes[twice][0])}), as collapsed "
                             "hexahedra do; write them as wedges or tetrahedra.")


def _refuse_repeated(path, mesh):
    corners = [_corners(kind, nodes) for _, kind, nodes in mesh.cells]
    for width in {one.shape[1] for one in corners}:
        same = np.sort(np.concatenate([one for one in corners if one.shape[1] == width]), axis=1)
        found, counts = np.unique(same, axis=0, return_counts=True)
        if (counts > 1).any():
            raise InputError(f"{path}: {(counts - 1).sum()} elements stand there twice (one {_at(mesh, found[counts.argmax()])}); "
                             "leave the copies out.")


def _refuse_inverted(path, mesh):
    """Refuse elements whose Jacobian is not positive at all points of quadrature."""
    for region, element, nodes in mesh.parts():
        d = element.nodes.shape[1]
        slopes = element.shape(element.quadrature.points)[1]
        jacobian = np.einsum("emi,gmj->egij", mesh.points[nodes][..., :d], slopes, optimize=True)
        with np.errstate(all="ignore"):     # flat elements and tiny coordinates
            inverted = np.flatnonzero(~(np.linalg.det(jacobian).min(axis=1) > 0))
        if len(inverted):
            first = inverted[0]
            raise InputError(f"{path}: {len(inverted)} of {len(nodes)} elements of the region {region!r} are inverted (the first "
                             f"is number {first}, {_at(mesh, nodes[first])}); reverse the order of their nodes, or mesh the body "
                             "again.")


def _refuse_mismatched(path, mesh):
    """Refuse four outer corners that carry two triangles of one side and a quadrilateral, or two other triangles, of the other."""
    if mesh.geometry != "solid":
        return
    triangles = [nodes[:, :3] for kind, nodes in mesh.boundary.items() if FACET_CORNERS[kind] == 3]
    quads = [nodes[:, :4] for kind, nodes in mesh.boundary.items() if FACET_CORNERS[kind] == 4]
    if not triangles:
        return
    three = np.concatenate(triangles)
    known = {tuple(row) for row in np.sort(three, axis=1).tolist()}
    for quad in (row for block in quads for row in block.tolist()):
        for corners in combinations(quad, 3):
            if tuple(sorted(corners)) in known:
                one, other = _kinds_with(mesh, quad), _kinds_with(mesh, corners) - _kinds_with(mesh, quad)
                raise InputError(f"{path}: a face of {_listed(one)} lies on two triangles of {_listed(other or one)} "
                                 f"({_at(mesh, quad)}), so that they would gape there; mesh both sides with one kind, or with "
                                 "wedges whose triangles meet those of tetrahedra.")
    if (crossed := _crossed(mesh.points, three)) is not None:
        raise InputError(f"{path}: the triangles of two neighbours cross (on the four corners {_at(mesh, crossed)}), so that they "
                         "would gape there; mesh the body at one go.")


def _crossed(points, triangles):
    """Four nodes in a plane on which two triangles lie along one diagonal, and two along the other; None where there are none."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    apex = triangles[:, [2, 0, 1]].ravel()
    order = np.lexsort(edges.T)
    edges, apex = edges[order], apex[order]
    first = np.flatnonzero((edges[:-1] == edges[1:]).all(axis=1))
    four = np.sort(np.column_stack([edges[first], apex[first], apex[first + 1]]), axis=1)
    found, counts = np.unique(four, axis=0, return_counts=True)
    twice = found[counts == 2]
    if not len(twice):
        return None
    arms = points[twice[:, 1:]] - points[twice[:, :1]]
    flat = np.abs(np.linalg.det(arms)) < _FLAT * np.linalg.norm(arms, axis=2).max(axis=1) ** 3
    return twice[flat][0] if flat.any() else None


def _kinds_with(mesh, nodes):
    """The kinds of the elements that have all these nodes."""
    return {kind.rstrip("0123456789") for _, kind, cells in mesh.cells if (np.isin(cells, nodes).sum(axis=1) == len(nodes)).any()}


def _listed(kinds):
    names = {"tetra": "tetrahedra", "hexahedron": "hexahedra", "wedge": "wedges"}
    return " and ".join(sorted(names.get(kind, kind) for kind in kinds))


def piece_numbers(mesh: SolidMesh) -> tuple[int, list[np.ndarray]]:
    """Number of pieces that share no node, and the piece (e,) of each element of each of the mesh's cells."""
    corners = [_corners(kind, nodes) for _, kind, nodes in mesh.cells]
    pairs = np.concatenate([np.column_stack([np.repeat(one[:, 0], one.shape[1]), one.ravel()]) for one in corners])
    count = len(mesh.points)
    graph = sp.coo_matrix((np.ones(len(pairs), dtype=bool), pairs.T), shape=(count, count))
    labels = connected_components(graph, directed=False)[1]
    found, numbers = np.unique(np.concatenate([labels[one[:, 0]] for one in corners]), return_inverse=True)
    return len(found), np.split(numbers.ravel(), np.cumsum([len(one) for one in corners])[:-1])


def remarks_on_pieces(mesh: SolidMesh) -> tuple[int, list[str]]:
    """Number of pieces that share no node, and sentences (without a full stop) on those that touch or overlap, with a place."""
    count, numbers = piece_numbers(mesh)
    several = [f"the body is in {count} pieces that share no node"] if count > 1 else []
    remarks = [*several, *_unjoined(mesh, numbers, across=count > _MOST_PIECES)]
    if count == 1 or count > _MOST_PIECES:
        return count, remarks
    pieces = [_Piece(mesh, [nodes[of == k] for of, (_, _, nodes) in zip(numbers, mesh.cells, strict=True)],
                     list(dict.fromkeys(region for of, (region, _, _) in zip(numbers, mesh.cells, strict=True) if (of == k).any())))
              for k in range(count)]
    found = [text for one, other in combinations(pieces, 2) if (text := _meeting(one, other))]
    more = [f"{len(found) - _MOST_TOLD} more pairs of its pieces touch or overlap"] if len(found) > _MOST_TOLD else []
    return count, [*remarks, *found[:_MOST_TOLD], *more]


def _unjoined(mesh, numbers, *, across):
    """A remark on outer nodes that lie in one place, as at a crack or where small elements meet large ones.

    across: of all pieces, in place of nodes of the same piece
    """
    outer = np.unique(np.concatenate([nodes.ravel() for nodes in mesh.boundary.values()]))
    piece = np.zeros(len(mesh.points), dtype=np.int64)
    for of, (_, _, nodes) in zip(numbers, mesh.cells, strict=True):
        piece[nodes] = of[:, None]
    places = mesh.points[outer]
    pairs = outer[cKDTree(places).query_pairs(_ON * np.ptp(places, axis=0).max(), output_type="ndarray")]
    pairs = pairs if across else pairs[piece[pairs[:, 0]] == piece[pairs[:, 1]]]
    if not len(pairs):
        return []
    why = "merge them if the pieces are bonded" if across else "it is a crack, or elements of two sizes meet there"
    return [f"{len(pairs)} pairs of nodes{'' if across else ' of one piece'} lie in one place and are not joined (one "
            f"{_at(mesh, pairs[0])}): {why}"]


class _Piece:
    """Elements that hang together, as simplices, with points in and on them."""

    def __init__(self, mesh: SolidMesh, cells: list[np.ndarray], regions: list[str]) -> None:
        d = 3 if mesh.geometry == "solid" else 2
        own = tuple((region, kind, nodes) for (region, kind, _), nodes in zip(mesh.cells, cells, strict=True) if len(nodes))
        whole = SolidMesh(mesh.points, own, geometry=mesh.geometry)
        simplices = []
        for _, kind, nodes in whole.cells:
            corners = _corners(kind, nodes)
            pattern = _QUAD if d == 2 and corners.shape[1] == 4 else _SIMPLICES[corners.shape[1]]
            simplices.append(corners[:, pattern].reshape(-1, d + 1))
        self.regions = ", ".join(regions)
        self.simplices = mesh.points[np.concatenate(simplices)][..., :d]
        self.size = float(np.linalg.norm(np.ptp(self.simplices, axis=1), axis=1).mean()) / np.sqrt(d)
        self.outer = mesh.points[np.unique(np.concatenate([nodes.ravel() for nodes in whole.boundary.values()]))]
        self.low, self.high = self.outer.min(axis=0) - _ON * self.size, self.outer.max(axis=0) + _ON * self.size
        self._tree = cKDTree(self.simplices.mean(axis=1))
        self._outside = mesh.points[flat_triangles(whole.boundary)] if d == 3 else None
        self._lines = None if d == 3 else np.concatenate([mesh.points[nodes[:, :2]] for nodes in whole.boundary.values()])
        self.dimension = self._d = d

    def samples(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3) between two corners of a box, on and in the piece, and the volume (n,) for which each stands, mm3."""
        d, corners = self._d, self.simplices
        here = ((corners.max(axis=1) >= low[:d]) & (corners.min(axis=1) <= high[:d])).all(axis=1)
        chosen = corners[here][::max(1, here.sum() // _SAMPLES)]
        each = int(np.clip(_SAMPLES // max(len(chosen), 1), 1, 64))
        places = np.einsum("sc,eci->esi", np.random.default_rng(0).dirichlet(np.ones(d + 1), each), chosen)
        scale = here.sum() / (max(len(chosen), 1) * each * math.factorial(d))
        volume = scale * np.abs(np.linalg.det(chosen[:, 1:] - chosen[:, :1]))
        inner = np.pad(places.reshape(-1, d), ((0, 0), (0, 3 - d)))
        points = np.concatenate([self.outer, inner])
        inside = ((points >= low) & (points <= high)).all(axis=1)
        return points[inside], np.concatenate([np.zeros(len(self.outer)), np.repeat(volume, each)])[inside]

    def holds(self, places: np.ndarray) -> np.ndarray:
        """Which places (n, 3) lie in or on the piece."""
        if not len(places):
            return np.zeros(0, dtype=bool)
        _, near = self._tree.query(places[:, :self._d], k=min(_NEAREST, len(self.simplices)))
        near = np.reshape(near, (len(places), -1))
        found = np.zeros(len(places), dtype=bool)
        for candidates in near.T:
            corners = self.simplices[candidates]
            edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
            shares = np.linalg.solve(edges, (places[:, :self._d] - corners[:, 0])[..., None])[..., 0]
            found |= (shares.min(axis=1) >= -_ON) & (shares.sum(axis=1) <= 1 + _ON)
        return found

    def depth(self, places: np.ndarray) -> np.ndarray:
        """Distances (n,) of places in the piece from its outside."""
        if not len(places):
            return np.zeros(0)
        if self._outside is None:
            assert self._lines is not None
            a, along = self._lines[:, 0], self._lines[:, 1] - self._lines[:, 0]
            share = np.einsum("nli,li->nl", places[:, None] - a, along) / (along**2).sum(axis=1)
            return np.linalg.norm(places[:, None] - a - share.clip(0, 1)[..., None] * along, axis=2).min(axis=1)
        _, near = cKDTree(self._outside.mean(axis=1)).query(places, k=min(_NEAREST, len(self._outside)))
        near = np.reshape(near, (len(places), -1))
        return np.min([np.linalg.norm(trimesh.triangles.closest_point(self._outside[facets], places) - places, axis=1)
                       for facets in near.T], axis=0)


def _meeting(one: _Piece, other: _Piece) -> str:
    """A sentence on two pieces that overlap or touch, empty for others."""
    low, high = np.maximum(one.low, other.low), np.minimum(one.high, other.high)
    if (low > high).any():
        return ""
    named = f"the pieces of {one.regions} and {other.regions}" if one.regions != other.regions else f"two pieces of {one.regions}"
    places, depths, volume = [], [], 0.0
    for a, b in ((one, other), (other, one)):
        points, of_points = a.samples(low, high)
        inside = b.holds(points)
        places.append(points[inside])
        depths.append(b.depth(points[inside]))
        volume += of_points[inside].sum() / 2
    at, depth = np.concatenate(places), np.concatenate(depths)
    if not len(at):
        return ""
    if depth.max() <= _DEEP * min(one.size, other.size):
        x, y, z = at[np.linalg.norm(at - at.mean(axis=0), axis=1).argmin()]
        return f"{named} touch at {x:.4g}, {y:.4g}, {z:.4g} mm and are not joined there; merge their nodes if they are bonded"
    x, y, z = at[depth.argmax()]
    return (f"{named} overlap by {depth.max():.3g} mm or more at {x:.4g}, {y:.4g}, {z:.4g} mm, so that about "
            f"{volume:.2g} mm{one.dimension} count twice; cut one from the other before meshing")
