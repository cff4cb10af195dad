"""A body of quadratic tetrahedra from any closed surface, and measures of its quality.

    mesh = mesh_body("finger.stl", unit="mm", size_mm=0.8).with_faces(back=lambda middles: middles[:, 2] < 0.01)

The corners come from `geometry.tetrahedra`. Mid-side nodes of the outer edges are moved onto the given surface wherever all
elements remain valid, so that the elements approximate it to third order of their size.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from softtact.errors import InputError
from softtact.fem.elements import TET10, TRI6
from softtact.fem.quadratic_nodes import raised
from softtact.fem.solid_mesh import SolidMesh
from softtact.geometry.meshes import UNIT_MM, check_body, plausible_facets, read_mesh, refuse_folded, volume_of
from softtact.geometry.tetrahedra import ClosestPoints, check_fillable, fill, quality

MOST_ELEMENTS = 400_000      # about 1.7 million unknowns
_ENVELOPE = 0.05             # of the size: tolerance of fTetWild's surface; smaller values refine curved parts
_LEAST_JACOBIAN = 0.3        # of the straight element's: least determinant at any point of a curved one
_MOST_VOLUME_ERROR = 0.05    # a larger loss of volume means that parts of the body are missing
_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])     # linear triangles between a quadratic triangle's nodes


@dataclass(frozen=True)
class BodyReport:
    """Deviation of a mesh of tetrahedra from its surface, and quality of its elements."""

    elements: int
    """Number of tetrahedra."""
    nodes: int
    """Number of nodes, mid-side nodes included."""
    unknowns: int
    """Three for each node, without boundary conditions."""
    volume_mm3: float
    """Volume of the elements."""
    volume_error: float
    """Relative, to the volume within the given surface."""
    deviation_mm: float
    """Largest distance of the mesh's outside from the surface, or of the surface's corners from the outside."""
    deviation_rms_mm: float
    """Root mean square distance of the mesh's outside from the surface."""
    least_quality: float
    """Least mean ratio of the elements' corners: 1 for a regular tetrahedron, 0 for a flat one."""
    mean_quality: float
    """Average of the elements' mean ratios."""
    least_jacobian: float
    """Least determinant of the Jacobian in an element over that of the straight one: 1 for straight elements."""

    def as_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


def mesh_body(surface: str | Path | trimesh.Trimesh, *, size_mm: float, unit: str | None = None, region: str = "body",
              envelope_mm: float | None = None, most_elements: int = MOST_ELEMENTS, threads: int = 1) -> SolidMesh:
    """A `SolidMesh` of quadratic tetrahedra (tetra10) that fill a closed surface.

    surface: an STL, OBJ or PLY file, or a `trimesh.Trimesh`
    size_mm: target edge length
    unit: of the surface: mm, cm, m, inch or in; required for a file; a Trimesh is in mm by default
    region: name of the mesh's only region; `SolidMesh.with_regions` divides it, `SolidMesh.with_faces` names faces
    envelope_mm: tolerance of the mesh's surface before its nodes are moved onto the given one, by default a twentieth of the size;
        smaller details are lost, and a smaller tolerance makes smaller elements where the surface is curved
    most_elements: larger meshes are refused;  threads: of the mesher

    A repeated call gives a different mesh of like quality (see `geometry.tetrahedra`): write the mesh, and keep the file.
    Raises InputError where the surface is open, intersects itself or is of an implausible size, where elements would be larger than
    the body or too many, and where the mesh loses more than 5 % of the body. It needs the extra `mesh`.
    """
    body, name = closed_surface(surface, unit=unit)
    check_fillable(body, size_mm=size_mm, most_elements=most_elements, name=name)
    envelope = _ENVELOPE * size_mm if envelope_mm is None else envelope_mm
    if not 0 < envelope <= size_mm:
        raise InputError(f"{name}: an envelope of {envelope} mm is not possible; give one above 0, up to {size_mm:g} mm.")
    corners, tetrahedra = fill(body, size_mm=size_mm, envelope_mm=envelope, threads=threads)
    points, (nodes,), _ = raised(corners, [("tetra", tetrahedra)])
    mesh = SolidMesh(points, ((region, "tetra10", nodes),))
    mesh = SolidMesh(_curved(mesh, ClosestPoints(body.vertices, body.faces)), mesh.cells)
    error = mesh.volume_mm3() / volume_of(body) - 1
    if abs(error) > _MOST_VOLUME_ERROR:
        raise InputError(f"{name}: elements of {size_mm:g} mm change the body's volume by {100 * error:.2g} %; give smaller ones.")
    return mesh


def closed_surface(surface: str | Path | trimesh.Trimesh, *, unit: str | None = None) -> tuple[trimesh.Trimesh, str]:
    """A checked surface (mm) that bounds a body, and its name in messages."""
    if not isinstance(surface, trimesh.Trimesh):
        return read_mesh(surface, unit=unit), str(surface)
    name = Path("The surface")
    if unit is not None and unit not in UNIT_MM:
        raise InputError(f"{name}: the unit {unit!r} is not known; state one of {', '.join(UNIT_MM)}.")
    body = surface.copy()
    body.apply_scale(UNIT_MM[unit or "mm"])
    plausible_facets(name, np.asarray(body.triangles), unit=unit or "mm")
    check_body(name, body)
    refuse_folded(name, body)
    return body, str(name)


def body_report(mesh: SolidMesh, surface: trimesh.Trimesh) -> BodyReport:
    """`BodyReport` of a mesh of tetrahedra against the closed surface (mm) that it fills."""
    nodes = np.concatenate([nodes for _, kind, nodes in mesh.cells if kind == "tetra10"])
    facets = mesh.boundary["triangle6"]
    values, weights = TRI6.shape(TRI6.quadrature.points)[0], TRI6.quadrature.weights
    places = np.einsum("gm,fmi->fgi", values, mesh.points[facets]).reshape(-1, 3)
    away = np.linalg.norm(places - ClosestPoints(surface.vertices, surface.faces)(places), axis=1)
    corners = mesh.points[facets[:, :3]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    share = (area[:, None] * weights).ravel()
    outside = ClosestPoints(mesh.points, facets[:, _QUARTERS].reshape(-1, 3))
    given = np.asarray(surface.vertices)
    lost = np.linalg.norm(given - outside(given), axis=1).max()
    ratio, volume = quality(mesh.points[nodes[:, :4]]), mesh.volume_mm3()
    curved = nodes[np.isin(nodes, facets[:, 3:]).any(axis=1)]     # inner edges are straight
    used = len(np.unique(nodes))
    return BodyReport(elements=len(nodes), nodes=used, unknowns=3 * used, volume_mm3=volume,
                      volume_error=volume / volume_of(surface) - 1, deviation_mm=float(max(away.max(), lost)),
                      deviation_rms_mm=float(np.sqrt(share @ away**2 / share.sum())), least_quality=float(ratio.min()),
                      mean_quality=float(ratio.mean()), least_jacobian=float(_jacobian_ratio(mesh.points, curved).min()))


def _curved(mesh: SolidMesh, closest: ClosestPoints) -> np.ndarray:
    """The mesh's points with the mid-side nodes of outer edges on the surface, except where an element would be inverted."""
    nodes, middles = mesh.cells[0][2], np.unique(mesh.boundary["triangle6"][:, 3:])
    points = mesh.points.copy()
    points[middles] = closest(points[middles])
    touched = nodes[np.isin(nodes, middles).any(axis=1)]
    while (folded := _jacobian_ratio(points, touched) < _LEAST_JACOBIAN).any():
        back = np.intersect1d(touched[folded], middles)
        points[back] = mesh.points[back]
        touched = touched[np.isin(touched, middles).any(axis=1)]
    return points


def _jacobian_ratio(points: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Least determinant (e,) at the nodes and at the points of the full rule, over that of the element with straight edges."""
    at = np.vstack([TET10.nodes, TET10.quadrature.points])
    jacobian = np.einsum("emi,gmj->egij", points[nodes], TET10.shape(at)[1], optimize=True)
    straight = points[nodes[:, 1:4]] - points[nodes[:, :1]]
    return np.linalg.det(jacobian).min(axis=1) / np.linalg.det(straight)
