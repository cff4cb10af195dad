"""Closed meshes as solids: their union, and whether one that faces inwards is a cavity of them."""

from collections.abc import Sequence

import numpy as np
import trimesh
from manifold3d import Manifold, Mesh64

OVERLAP = 1e-6  # of a body's volume: what is less is round-off


def volume_of(mesh: trimesh.Trimesh) -> float:
    """Volume of a closed mesh, negative of one that faces inwards; trimesh's own warns of a division by a volume of 0."""
    a, b, c = np.moveaxis(mesh.triangles - mesh.vertices.mean(axis=0), 1, 0)
    return float(np.einsum("kd,kd->", a, np.cross(b, c)) / 6)


def solid_of(mesh: trimesh.Trimesh, *, inverted: bool = False) -> Manifold:
    """`Manifold` of a closed mesh, of which the facets are turned if it is `inverted`; empty where it is none."""
    faces = mesh.faces[:, ::-1] if inverted else mesh.faces
    return Manifold(Mesh64(np.ascontiguousarray(mesh.vertices, dtype=float), np.ascontiguousarray(faces, dtype=np.uint64)))


def union_of(meshes: Sequence[trimesh.Trimesh]) -> Manifold | None:
    """One `Manifold` of closed meshes, or None where one of them is none, or there are none."""
    solids = [solid_of(mesh) for mesh in meshes]
    if not solids or any(solid.is_empty() for solid in solids):
        return None
    union = solids[0]
    for solid in solids[1:]:
        union = union + solid
    return union


def is_cavity(piece: trimesh.Trimesh, solid: Manifold) -> bool:
    """Whether a closed mesh that faces inwards lies within a `Manifold`."""
    if solid is None:
        return False
    cavity = solid_of(piece, inverted=True)
    return (solid ^ cavity).volume() > (1 - OVERLAP) * cavity.volume()
