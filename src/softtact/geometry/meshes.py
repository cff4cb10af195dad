"""Meshes that users bring: read, checked, in mm, and placed over the sensor.

Meshes that would silently give wrong results (open, inverted, overlapping or wrongly scaled) are refused in one sentence with the
remedy. manifold3d computes unions of closed meshes and cavities.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64, OpType

from softtact.errors import InputError, MissError
from softtact.geometry.formats import STATED_MM, UNIT_MM, Facets, in_mm, read_facets
from softtact.geometry.pose import Pose

MIN_SIZE_MM = 1.0  # far below a taxel's resolution
MAX_SIZE_MM = 500.0  # larger than any gripper holds
HIGHEST_MM = 1000.0  # over a sensor; heights from there on stand for no object (`contact.lower_envelope.NO_CONTACT_MM`)
_MERGE_DECIMALS = 5  # of a coordinate in mm: corners closer than 10 nm are merged
_FLAT = 1e-6  # thickness over size below which a mesh is no body
_FOLD = 5e-7  # one minus the cosine of the angle, 1e-3, below which two facets on one side of an edge lie on each other
_SLIVER = 1e-3  # of the size: facets with a smaller height have no reliable normal
OVERLAP = 1e-6  # of a body's volume: a smaller overlap is round-off


def read_triangles(path: str | Path, *, unit: str | None = None, min_size_mm: float = MIN_SIZE_MM,
                   max_size_mm: float = MAX_SIZE_MM) -> np.ndarray:
    """Facets (n, 3, 3) in mm as the file stores them, corners not merged; finite and of plausible size."""
    return _plausible(Path(path), unit, min_size_mm, max_size_mm).triangles


def _plausible(path, unit, min_size_mm, max_size_mm):
    """`Facets` of a file in mm, finite and of plausible size."""
    facets = load_sized(path, unit=unit)
    _refuse_non_finite(path, facets.triangles)
    plausible_facets(path, facets.triangles, unit=facets.unit, min_size_mm=min_size_mm, max_size_mm=max_size_mm)
    return facets


def load_sized(path: Path, *, unit: str | None) -> Facets:
    """`Facets` in mm as the file stores them, unchecked."""
    return in_mm(path, read_facets(path), unit)


def plausible_facets(path: Path, triangles: np.ndarray, *, unit: str | None, min_size_mm: float = MIN_SIZE_MM,
                     max_size_mm: float = MAX_SIZE_MM) -> np.ndarray:
    """The facets (n, 3, 3) in mm, if their size is plausible; else refused with the unit that would make it so.

    unit: in which they were read; None stands for mm
    """
    if len(triangles) == 0:
        raise InputError(f"{path}: no facet has finite coordinates; export the mesh again.")
    _refuse_implausible_size(path, triangles, unit or "mm", min_size_mm, max_size_mm)
    return triangles


def read_mesh(path: str | Path, *, unit: str | None = None, min_size_mm: float = MIN_SIZE_MM,
              max_size_mm: float = MAX_SIZE_MM) -> trimesh.Trimesh:
    """Closed, outward-oriented mesh of a file, as a `trimesh.Trimesh` in mm in the frame of the file.

    path : STL (binary or text), OBJ, PLY, OFF, 3MF, AMF, DAE, GLB or STEP, or a ZIP archive of one of them
    unit : 'mm', 'cm', 'm', 'inch' or 'in'; needed where the format states none (STL, OBJ, PLY, OFF), else it must be the file's
    min_size_mm, max_size_mm : range of a plausible largest side

    `metadata["notes"]` is a list of sentences on how the file was read: its own unit, and how closely facets follow curved faces.

    Raises InputError that names the file, what is wrong with it (unreadable, open, inside out, flat, folded, overlapping, of a
    wrong size) and the remedy.
    """
    path = Path(path)
    facets = _plausible(path, unit, min_size_mm, max_size_mm)
    mesh = merge_facets(facets.triangles)
    mesh.metadata["notes"] = list(facets.notes)
    check_body(path, mesh)
    refuse_folded(path, mesh)
    return mesh


def check_body(path: Path, mesh: trimesh.Trimesh) -> None:
    """Refuse a mesh that bounds no body: flat, open, inside out, or of pieces that overlap."""
    _refuse_flat(path, mesh)
    _refuse_open(path, mesh)
    _refuse_inverted(path, mesh)
    _refuse_overlapping(path, mesh)


def check_given(mesh: trimesh.Trimesh, *, name: str = "The object") -> None:
    """Refuse a mesh in memory whose press would be of something else: without facets, not finite, or closed and inside out."""
    if not len(mesh.faces):
        raise InputError(f"{name} has no facets; give a closed mesh in mm.")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"{name} has corners that are not finite numbers; correct or remove them.")
    if mesh.is_watertight and mesh.is_winding_consistent and mesh.volume < 0:
        raise InputError(f"{name} is inside out: its facets' normals point inwards; flip them with mesh.invert().")


def folded(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of facets (n, 2) of which one lies on the other, and the middles (n, 3) in mm of their edges.

    mesh : consistently oriented, so that the normals of two facets that lie on each other are opposite
    """
    normals = mesh.face_normals[mesh.face_adjacency]                                   # (k, 2, 3)
    opposite = np.flatnonzero(np.einsum("kd,kd->k", normals[:, 0], normals[:, 1]) < _FOLD - 1)
    edges = mesh.vertices[mesh.face_adjacency_edges[opposite]]                         # (n, 2, 3)
    areas = mesh.area_faces[mesh.face_adjacency[opposite]].min(axis=1)
    heights = 2 * areas / np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    thick = heights > _SLIVER * np.ptp(mesh.vertices, axis=0).max()
    return mesh.face_adjacency[opposite[thick]], edges[thick].mean(axis=1)


def refuse_folded(path: Path, mesh: trimesh.Trimesh) -> None:
    """Refuse facets that lie on their neighbour, as in a concave polygon that was triangulated from one corner, or a rough scan."""
    pairs, places = folded(mesh)
    if len(pairs):
        x, y, z = places[0]
        raise InputError(f"{path}: {len(pairs)} facets lie on a neighbour (the first at {x:.4g}, {y:.4g}, {z:.4g} mm), as in "
                         "concave polygons that were triangulated from one corner, or in a scan whose noise is as large as its "
                         "facets; triangulate it again in its modelling program, or smooth the scan.")


def merge_facets(triangles: np.ndarray) -> trimesh.Trimesh:
    """Mesh of facets (n, 3, 3) with equal corners merged; facets that collapse are left out."""
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles), process=False)
    mesh.merge_vertices(digits_vertex=_MERGE_DECIMALS)
    a, b, c = mesh.faces.T
    mesh.update_faces((a != b) & (b != c) & (c != a))
    mesh.remove_unreferenced_vertices()
    return mesh


def place(mesh: trimesh.Trimesh, *, pose: Pose | None = None) -> trimesh.Trimesh:
    """The mesh in the sensor frame.

    pose : a `Pose`; None centres the bounding box over the origin, lowest point at z = 0 (just touching)
    """
    pose = pose if pose is not None else default_pose(mesh)
    placed = mesh.copy()
    placed.vertices = pose.apply(mesh.vertices)
    return placed


def read_placed(path: str | Path, *, unit: str, pose: Sequence[float] | None) -> trimesh.Trimesh:
    """The mesh of a file in the sensor frame; pose: six values as of `Pose.from_values`, or None for the centred one."""
    return place(read_mesh(path, unit=unit), pose=None if pose is None else Pose.from_values(pose))


def default_pose(mesh: trimesh.Trimesh) -> Pose:
    """Pose that centres the mesh's bounding box over the sensor and lets its lowest point touch."""
    (x0, y0, z0), (x1, y1, _) = mesh.bounds
    return Pose(-np.array([(x0 + x1) / 2, (y0 + y1) / 2, z0]))


def check_over_sensor(mesh: trimesh.Trimesh, footprint_mm: tuple[float, float], *, name: str = "The object") -> None:
    """Refuse a placed mesh of which no facet lies over the sensor's footprint (x, y sides in mm), or that is far above it."""
    over = facets_over(mesh.triangles, footprint_mm)
    if not np.any(over):
        raise misses_sensor(mesh.vertices, footprint_mm, name=name)
    lowest = float(mesh.triangles[over][..., 2].min())
    if lowest >= HIGHEST_MM:
        raise MissError(f"{name} is {lowest:.4g} mm above the sensor, and it is only followed to first touch from below "
                        f"{HIGHEST_MM:g} mm; lower its pose, or correct its unit.")


def misses_sensor(points: np.ndarray, footprint_mm: tuple[float, float], *, name: str = "The object") -> MissError:
    """The refusal of an object with points (n, 3) in mm of which nothing lies over the sensor's footprint."""
    (x0, y0, _), (x1, y1, _) = points.min(axis=0), points.max(axis=0)
    return MissError(f"{name} misses the sensor: it spans x {x0:.4g} to {x1:.4g} mm and y {y0:.4g} to {y1:.4g} mm, and no part of "
                     f"it is over the {footprint_mm[0]:g} x {footprint_mm[1]:g} mm footprint about the origin; correct its pose.")


def facets_over(triangles: np.ndarray, footprint_mm: tuple[float, float]) -> np.ndarray:
    """Which facets (n, 3, 3) overlap, seen from above, a rectangle of sides `footprint_mm` about the origin, (n,) bool.

    Separating axes: two convex shapes are apart exactly if they are apart along the normal of a side of one of them.
    """
    xy = triangles[..., :2]  # (n, 3, 2)
    half = np.asarray(footprint_mm, float) / 2
    sides = np.roll(xy, -1, axis=1) - xy
    normals = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    axes = np.concatenate([np.broadcast_to(np.eye(2), (len(xy), 2, 2)), normals], axis=1)  # (n, 5, 2)
    along = np.einsum("nad,npd->nap", axes, xy)
    reach = np.abs(axes) @ half
    return np.all((along.min(axis=-1) <= reach) & (along.max(axis=-1) >= -reach), axis=1)


def _refuse_non_finite(path: Path, triangles: np.ndarray) -> None:
    bad = ~np.isfinite(triangles).all(axis=(1, 2))
    if bad.any():
        raise InputError(f"{path}: {bad.sum()} of {len(bad)} facets have coordinates that are not finite numbers "
                         f"(the first is facet {np.argmax(bad)}); export the mesh again.")


def _refuse_implausible_size(path: Path, triangles: np.ndarray, unit: str, smallest: float, largest: float) -> None:
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    if smallest <= size <= largest:
        return
    sizes = {other: size / STATED_MM[unit] * factor for other, factor in UNIT_MM.items() if other != unit}
    plausible = [f"{other} ({value:.4g} mm)" for other, value in sizes.items() if smallest <= value <= largest]
    remedy = f"perhaps its unit is {' or '.join(plausible)}" if plausible else "scale the mesh"
    raise InputError(f"{path}: read in {unit}, its largest side is {size:.4g} mm, outside {smallest:g} to "
                     f"{largest:g} mm; {remedy}.")


def _refuse_flat(path: Path, mesh: trimesh.Trimesh) -> None:
    centred = mesh.vertices - mesh.vertices.mean(axis=0) if len(mesh.faces) else np.zeros((3, 3))
    spread = np.linalg.svd(centred, compute_uv=False)
    if len(spread) < 3 or spread[2] <= _FLAT * spread[0]:
        raise InputError(f"{path}: the mesh is degenerate, all its points lie in one plane or line; export a solid "
                         "body.")


def _refuse_open(path: Path, mesh: trimesh.Trimesh) -> None:
    low, high = mesh.edges_sorted.T.astype(np.int64)
    _, uses = np.unique(low * len(mesh.vertices) + high, return_counts=True)
    boundary, odd = int(np.sum(uses == 1)), int(np.sum((uses != 2) & (uses != 1)))
    if boundary or odd:
        raise InputError(f"{path}: the surface is not closed ({boundary} boundary edges, {odd} edges with more than "
                         "two facets); repair it, for example with 'Make manifold' of Blender or MeshLab's hole "
                         "closing.")
    if not mesh.is_winding_consistent:
        raise InputError(f"{path}: neighbouring facets face opposite ways, so inside and outside are undefined; "
                         "make the normals consistent, for example with 'Recalculate outside' of Blender.")


def _refuse_inverted(path: Path, mesh: trimesh.Trimesh) -> None:
    if volume_of(mesh) <= 0:
        raise InputError(f"{path}: the facets' normals point inwards (volume {volume_of(mesh):.4g} mm3); flip them, for "
                         "example with trimesh's mesh.invert() or 'Flip normals' of Blender.")


def _refuse_overlapping(path: Path, mesh: trimesh.Trimesh) -> None:
    """Closed pieces that overlap or share walls have facets inside the body, which the contact search does not allow."""
    if mesh.body_count < 2:
        return
    pieces = mesh.split(only_watertight=False)
    bodies, outside = hollow_bodies(pieces)
    if united_count(bodies) != len(bodies):
        raise InputError(f"{path}: its {len(bodies)} closed pieces overlap or touch; unite them into one body, for "
                         "example with trimesh.boolean.union or Blender's Boolean modifier.")
    if outside:
        raise InputError(f"{path}: {len(outside)} of its {len(pieces)} closed pieces face inwards and are no cavities of the "
                         "others; flip them, for example with 'Recalculate outside' of Blender.")


def volume_of(mesh: trimesh.Trimesh) -> float:
    """Volume of a closed mesh, negative if it faces inwards; trimesh's warns of a division by zero for a volume of 0."""
    a, b, c = np.moveaxis(mesh.triangles - mesh.vertices.mean(axis=0), 1, 0)
    return float(np.einsum("kd,kd->", a, np.cross(b, c)) / 6)


def solid_of(mesh: trimesh.Trimesh, *, inverted: bool = False) -> Manifold:
    """`Manifold` of a closed mesh, with its facets reversed if it is `inverted`; empty for a mesh that is not closed."""
    faces = mesh.faces[:, ::-1] if inverted else mesh.faces
    return Manifold(Mesh64(np.ascontiguousarray(mesh.vertices, dtype=float), np.ascontiguousarray(faces, dtype=np.uint64)))


def union_of(meshes: Sequence[trimesh.Trimesh]) -> Manifold | None:
    """One `Manifold` of closed meshes, or None where one of them is not closed, or without meshes."""
    return union_of_solids([solid_of(mesh) for mesh in meshes])


def union_of_solids(solids: Sequence[Manifold]) -> Manifold | None:
    """One `Manifold` of several, or None where one of them is empty, or without any."""
    if not solids or any(solid.is_empty() for solid in solids):
        return None
    union = solids[0]
    for solid in solids[1:]:
        union = union + solid
    return union


def hollow_bodies(pieces: Sequence[trimesh.Trimesh]) -> tuple[list[Manifold], list[Manifold]]:
    """`Manifold`s of the closed pieces that face outwards, each without its cavities, and of what others in none of them enclose.

    A cavity is that of the smallest body around it, so that a body that lies free in a cavity stays. A single body keeps its
    cavities: nothing can lie in them.
    """
    bodies = [solid_of(piece) for piece in pieces if volume_of(piece) > 0]
    volumes, outside = [body.volume() for body in bodies], list[Manifold]()
    hollows: list[list[Manifold]] = [[] for _ in bodies]
    for piece in (piece for piece in pieces if volume_of(piece) <= 0):
        cavity = solid_of(piece, inverted=True)
        around = [k for k, body in enumerate(bodies) if _is_within(cavity, body)]
        (hollows[min(around, key=lambda k: volumes[k])] if around else outside).append(cavity)
    if len(bodies) > 1:
        bodies = [Manifold.batch_boolean([body, *inner], OpType.Subtract) for body, inner in zip(bodies, hollows, strict=True)]
    return bodies, outside


def united_count(bodies: Sequence[Manifold]) -> int:
    """How many bodies these are together: fewer than given where they touch, 0 where they overlap or one is not closed."""
    united, total = union_of_solids(bodies), sum(body.volume() for body in bodies)
    if united is None or total - united.volume() > OVERLAP * total:
        return 0
    return sum(part.volume() > 0 for part in united.decompose())     # a cavity is a part of negative volume


def is_cavity(piece: trimesh.Trimesh, solid: Manifold) -> bool:
    """Whether a closed mesh that faces inwards lies within a `Manifold`."""
    return solid is not None and _is_within(solid_of(piece, inverted=True), solid)


def _is_within(cavity, solid):
    return (solid ^ cavity).volume() > (1 - OVERLAP) * cavity.volume()
