"""Repair of meshes that define a body without ambiguity; each step is reported, and ambiguous meshes are refused.

Repaired: facets without finite corners or without area, repeated facets, corners that differ by round-off or lie on an edge of a
facet without them (T-junctions), holes that are flat or small, facets oriented against their neighbours, bodies inside out, bodies
that overlap, a few small facets that the noise of a scan laid on their neighbours. Not repaired: large curved holes, edges where
more than two walls meet, other facets that lie on their neighbours, double-sided bodies, flat or empty meshes, sizes that no body
on a sensor has.
`meshes.read_mesh` then checks the result as it checks any mesh.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import triangulate

from softtact.errors import InputError
from softtact.geometry.meshes import (
    MAX_SIZE_MM,
    MIN_SIZE_MM,
    check_body,
    folded,
    hollow_bodies,
    is_cavity,
    load_sized,
    merge_facets,
    plausible_facets,
    refuse_folded,
    union_of,
    union_of_solids,
    united_count,
    volume_of,
)
from softtact.geometry.polygons import triangulated
from softtact.words import numbered

_APART = 1e-5        # of the size: closer corners are one point with different rounding
_FLAT_HOLE = 1e-3    # of the size: largest distance of a hole's rim from its plane
_FEW_FOLDS = 0.01    # of the facets: those that noise may have laid on their neighbours
_SMALL_FACETS = 0.05 # of the size: their longest edges
_SMOOTHINGS = 20     # of their corners, until none lies on another
_SMALL_HOLES = 0.05  # of the surface: area of curved holes that are also closed by plane pieces


@dataclass(frozen=True)
class Mended:
    """A closed mesh (trimesh, mm), and sentences on its repairs and on how its file was read."""

    mesh: trimesh.Trimesh
    repairs: list
    notes: list


def read_mended(path: str | Path, *, unit: str | None = None, min_size_mm: float = MIN_SIZE_MM,
                max_size_mm: float = MAX_SIZE_MM) -> Mended:
    """Read a mesh as `read_mesh` does, and repair it where that is not ambiguous; else InputError with the reason."""
    path = Path(path)
    repairs: list[str] = []
    stored = load_sized(path, unit=unit)
    triangles = _finite(stored.triangles, repairs)
    plausible_facets(path, triangles, unit=stored.unit, min_size_mm=min_size_mm, max_size_mm=max_size_mm)
    mesh = merge_facets(triangles)
    if len(mesh.faces) == 0 or np.ptp(mesh.vertices, axis=0).min() == 0:
        check_body(path, mesh)     # it is degenerate, which no step repairs
    try:
        check_body(path, mesh)
    except InputError:
        return Mended(_mended(path, mesh, repairs), repairs, list(stored.notes))
    mesh = _smooth_folds(mesh, repairs)
    refuse_folded(path, mesh)
    return Mended(mesh, repairs, list(stored.notes))


def _mended(path, mesh, repairs):
    """The mesh after all steps; each repair is appended to `repairs`."""
    _refuse_double_sided(path, mesh)
    for step in (_join_corners, _split_at_corners, _without_doubles, _close_holes, _turn_facets, _turn_bodies):
        mesh = step(mesh, repairs)
    mesh = _smooth_folds(mesh, repairs)
    try:
        refuse_folded(path, mesh)     # before the union, which may leave slits thinner than round-off
        mesh = _unite(mesh, repairs)
        check_body(path, mesh)
    except InputError as error:
        done = f" (after: {'; '.join(repairs)})" if repairs else ""
        raise InputError(f"{error}{done}") from None
    return mesh


def _finite(triangles, repairs):
    """Facets (n, 3, 3) with finite corners."""
    good = np.isfinite(triangles).all(axis=(1, 2))
    if not good.all():
        repairs.append(f"left out {_count(~good, 'facet')} whose coordinates are not finite numbers")
    return triangles[good]


def _smooth_folds(mesh, repairs):
    """Move the corners of small facets that lie on a neighbour to the mean of their neighbours, where those are few; else nothing.

    Noise of a scanner as large as its facets lays some of them over. Large facets are another fault, which smoothing would hide.
    """
    smooth, first, neighbours = mesh, len(folded(mesh)[0]), None
    for _ in range(_SMOOTHINGS):
        pairs, _ = folded(smooth)
        if not len(pairs):
            break
        if len(pairs) > _FEW_FOLDS * len(mesh.faces):
            return mesh
        corners = np.unique(smooth.faces[pairs.ravel()])
        edges = smooth.vertices[smooth.faces[pairs.ravel()]]
        if np.linalg.norm(edges - np.roll(edges, 1, axis=1), axis=2).max() > _SMALL_FACETS * _size(mesh):
            return mesh
        neighbours = neighbours or mesh.vertex_neighbors
        vertices = np.array(smooth.vertices)
        vertices[corners] = [smooth.vertices[neighbours[corner]].mean(axis=0) for corner in corners]
        smooth = trimesh.Trimesh(vertices, mesh.faces, process=False)
    else:
        return mesh
    if first:
        moved = np.linalg.norm(smooth.vertices - mesh.vertices, axis=1)
        repairs.append(f"smoothed {numbered(first, 'fold')} of small facets, as noise of a scan makes them: "
                       f"{_count(moved > 0, 'corner')} moved by up to {moved.max():.2g} mm")
    return smooth


def _join_corners(mesh, repairs):
    """Merge corners of open edges that differ by round-off."""
    rim = np.unique(_open_edges(mesh))
    if not len(rim):
        return mesh
    from scipy.spatial import cKDTree

    pairs = cKDTree(mesh.vertices[rim]).query_pairs(_APART * _size(mesh), output_type="ndarray")
    if not len(pairs):
        return mesh
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    matrix = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(rim),) * 2)
    _, group = connected_components(matrix, directed=False)
    first = np.full(group.max() + 1, len(mesh.vertices))
    np.minimum.at(first, group, rim)
    number = np.arange(len(mesh.vertices))
    number[rim] = first[group]
    moved = _count(number != np.arange(len(number)), "corner")
    repairs.append(f"joined {moved} that lay within {_APART * _size(mesh):.2g} mm of others")
    return _of_faces(mesh.vertices, number[mesh.faces])


def _split_at_corners(mesh, repairs):
    """Add to facets the corners of their neighbours that lie on their open edges."""
    edges = _open_edges(mesh)
    if not len(edges):
        return mesh
    faces, split = split_at_corners(mesh, edges, tolerance=_APART * _size(mesh))
    if not split:
        return mesh
    repairs.append(f"split {numbered(split, 'facet')} at corners of others that lie on the edges")
    return _of_faces(mesh.vertices, faces)


def _refuse_double_sided(path, mesh):
    """Refuse a body whose facets are all there front and back: without both sides nothing of it would remain.

    A body that fills a cavity of another one has the cavity's facets on its back; it is allowed.
    """
    keep, back_to_back = _doubles(mesh.faces)
    walls = trimesh.Trimesh(mesh.vertices, back_to_back, process=False)
    bodies = [piece for piece in walls.split(only_watertight=False) if piece.is_watertight] if len(back_to_back) else []
    rest = _of_faces(mesh.vertices, mesh.faces[keep])
    for body in bodies:
        _fix_winding(body)
        if volume_of(body) > 0:
            body.invert()
        if not is_cavity(body, union_of([piece for piece in rest.split(only_watertight=False) if volume_of(piece) > 0])):
            raise InputError(f"{path}: {numbered(len(body.faces), 'facet')} of a closed surface are there front and back, so it "
                             "has no inside; export the mesh with single-sided facets.")


def _without_doubles(mesh, repairs):
    """Keep one of facets with the same corners; remove both of two that face each other, as nothing is between them."""
    mesh = _of_faces(mesh.vertices, mesh.faces)
    keep, _ = _doubles(mesh.faces)
    if len(keep) == len(mesh.faces):
        return mesh
    repairs.append(f"left out {numbered(len(mesh.faces) - len(keep), 'facet')} of those that were there twice")
    return _of_faces(mesh.vertices, mesh.faces[keep])


def _doubles(faces):
    """Numbers of the facets (k,) to keep, each once, and facets (n, 3) that are there as often front as back."""
    _, first, which, uses = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True)
    ahead = np.zeros(len(first), dtype=int)
    np.add.at(ahead, which.ravel(), np.where(_is_even(faces), 1, -1))
    # Equally oriented facets: one of them stays; equal numbers of either side: a wall without thickness.
    walls = (uses > 1) & (ahead == 0)
    return np.sort(first[~walls]), faces[first[walls]]


def _is_even(faces):
    """Whether a face's corners are an even permutation of their rising order (n,)."""
    a, b, c = faces.T
    return (a < b).astype(int) + (b < c) + (c < a) == 2


def _close_holes(mesh, repairs):
    """Close flat holes, and small curved ones, by plane pieces; with other holes the mesh stays open."""
    if _hangs_by_an_edge(mesh):
        return mesh
    loops = _rims(mesh)
    patches = [patch for loop in loops if (patch := _patch(mesh, loop)) is not None]
    if len(patches) < len(loops) or not patches:
        return mesh
    curved = sum(area for _, area, flat in patches if not flat)
    if curved > _SMALL_HOLES * mesh.area:
        return mesh
    area = sum(area for _, area, _ in patches)
    repairs.append(f"closed {numbered(len(patches), 'hole')}, {area:.3g} mm2 or {area / (mesh.area + area):.2g} of the surface")
    return _of_faces(mesh.vertices, np.vstack([mesh.faces, *(faces for faces, _, _ in patches)]))


def _hangs_by_an_edge(mesh):
    """Whether a facet has two open edges: then the corner between them is probably wrong, rather than its neighbours missing."""
    return bool((np.bincount(mesh.edges_face[_open_rows(mesh)], minlength=1) > 1).any())


def _rims(mesh):
    """Closed loops of open edges, each an array of corners, against the direction of their facets; empty where loops meet."""
    edges = _open_edges(mesh)
    following = dict(zip(edges[:, 1], edges[:, 0], strict=True))
    if not len(edges) or len(following) < len(edges) or set(following) != set(following.values()):
        return []
    loops = []
    while following:
        start, at = next(iter(following.items()))
        loop = [start]
        del following[start]
        while at != start:
            loop.append(at)
            at = following.pop(at)
        loops.append(np.array(loop))
    return loops


def _patch(mesh, loop):
    """Faces (k, 3) over a loop of corners, their area, and whether the loop is flat; None where they would overlap."""
    points = mesh.vertices[loop]
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle)
    normal = np.cross(points - middle, np.roll(points, -1, axis=0) - middle).sum(axis=0)
    x = axes[0]
    y = np.cross(normal / (np.linalg.norm(normal) or 1.0), x)
    plane = (points - middle) @ np.column_stack([x, y])
    faces = np.asarray(triangulate([plane])) if len(loop) > 3 else np.array([[0, 1, 2]])
    corners = plane[faces]
    areas = 0.5 * np.cross(np.pad(corners[:, 1] - corners[:, 0], ((0, 0), (0, 1))),
                           np.pad(corners[:, 2] - corners[:, 0], ((0, 0), (0, 1))))[:, 2]
    if len(faces) != len(loop) - 2 or (areas < -1e-9 * np.abs(areas).sum()).any():
        return None
    height = np.abs((points - middle) @ np.cross(x, y)).max()
    return loop[faces], float(trimesh.triangles.area(mesh.vertices[loop[faces]]).sum()), height <= _FLAT_HOLE * _size(mesh)


def _fix_winding(mesh):
    """Orient neighbouring facets consistently, in place, also where trimesh was imported without the package that this needs."""
    import networkx  # a command's process imports trimesh without it

    trimesh.repair.nx = networkx
    trimesh.repair.fix_winding(mesh)


def _turn_facets(mesh, repairs):
    """Orient neighbouring facets consistently."""
    if mesh.is_winding_consistent:
        return mesh
    turned = mesh.copy()
    _fix_winding(turned)
    changed = (turned.faces != mesh.faces).any(axis=1)
    bodies, of = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces)), None
    for body in range(bodies.max() + 1):     # the orientation of most facets is the body's
        of = bodies == body
        if changed[of].sum() > 0.5 * of.sum():
            turned.faces[of] = turned.faces[of][:, ::-1]
            changed[of] = ~changed[of]
    repairs.append(f"turned {_count(changed, 'facet')} that faced against the neighbours")
    return _of_faces(turned.vertices, turned.faces)


def _turn_bodies(mesh, repairs):
    """Turn bodies that are inside out; cavities, which lie in a body, stay."""
    if not mesh.is_watertight or not mesh.is_winding_consistent:
        return mesh
    pieces = list(mesh.split(only_watertight=False))
    inward = [piece for piece in pieces if volume_of(piece) < 0]
    solid = union_of([piece for piece in pieces if volume_of(piece) > 0])
    wrong = [piece for piece in inward if not is_cavity(piece, solid)]
    if not wrong:
        return mesh
    for piece in wrong:
        piece.invert()
    several = f"turned {numbered(len(wrong), 'body')} inside out"
    repairs.append(several if len(pieces) > 1 else "turned all facets: they faced inwards")
    return trimesh.util.concatenate(pieces) if len(pieces) > 1 else pieces[0]


def _unite(mesh, repairs):
    """Unite bodies that overlap or touch."""
    if not mesh.is_watertight or not mesh.is_winding_consistent or mesh.body_count < 2:
        return mesh
    bodies, outside = hollow_bodies(list(mesh.split(only_watertight=False)))
    united = union_of_solids(bodies)
    if united is None or united_count(bodies) == len(bodies):
        return mesh
    for cavity in outside:     # of several bodies together
        united = united - cavity
    count = united_count([united])
    repairs.append(f"united {numbered(len(bodies), 'body')} that overlap or touch into {count}")
    raw = united.to_mesh64()
    return merge_facets(raw.vert_properties[:, :3][raw.tri_verts])


def _open_edges(mesh):
    """Edges (n, 2), in the direction of their facets, that only one facet has."""
    return mesh.edges[_open_rows(mesh)]


def _open_rows(mesh):
    """Rows (n,) of the mesh's `edges` that only one facet has."""
    _, first, uses = np.unique(mesh.edges_sorted, axis=0, return_index=True, return_counts=True)
    return first[uses == 1]


def _of_faces(vertices, faces):
    """Mesh of faces, without faces with equal corners."""
    a, b, c = faces.T
    mesh = trimesh.Trimesh(vertices, faces[(a != b) & (b != c) & (c != a)], process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


def _size(mesh):
    return float(np.ptp(mesh.vertices, axis=0).max())


def _count(mask, noun):
    return numbered(int(mask.sum()), noun)


def split_at_corners(mesh: trimesh.Trimesh, open_edges: np.ndarray, *, tolerance: float) -> tuple[np.ndarray, int]:
    """Faces (n, 3) in which each corner that lies on an open edge of a facet is a corner of it, and how many facets were split.

    open_edges : corners (k, 2) of the edges that only one facet has, in its direction
    tolerance : largest distance in mm of a corner from an edge

    The surface keeps its shape: a facet is replaced by a fan of triangles that cover it.
    """
    inserted = _corners_on(mesh.vertices, open_edges, tolerance)
    split, pieces = [], []
    for number in np.flatnonzero(_has_edge(mesh.faces, inserted)):
        polygon = _with_corners(mesh.faces[number], inserted)
        if len(polygon) > 3:
            split.append(number)
            pieces.append(polygon[triangulated(mesh.vertices[polygon][None])[0]])
    return np.vstack([np.delete(mesh.faces, split, axis=0), *pieces]), len(split)


def _corners_on(points, edges, tolerance):
    """By an edge (a, b) the corners on it, from a to b."""
    from scipy.spatial import cKDTree

    rim = np.unique(edges)
    a, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    near = cKDTree(points[rim]).query_ball_point(a + along / 2, length / 2 + tolerance)
    inserted = {}
    for number, found in enumerate(near):
        corners = rim[found]
        spokes = points[corners] - a[number]
        at = spokes @ along[number] / length[number]
        beside = np.linalg.norm(spokes - at[:, None] * along[number] / length[number], axis=1)
        on = (beside <= tolerance) & (at > tolerance) & (at < length[number] - tolerance)
        if on.any():
            inserted[tuple(edges[number])] = corners[on][np.argsort(at[on])]
    return inserted


def _has_edge(faces, inserted):
    """Which faces (n,) have corners that are ends of an edge with corners on it."""
    ends = np.unique(np.array(list(inserted), dtype=int))
    return np.isin(faces, ends).sum(axis=1) >= 2


def _with_corners(face, inserted):
    """The corners of a face with those that lie on its edges."""
    polygon = []
    for a, b in zip(face, np.roll(face, -1), strict=True):
        polygon += [a, *(corner for corner in inserted.get((a, b), ()) if corner not in face)]
    return np.array(polygon)
