"""A body of quadratic tetrahedra from any closed surface, and measures of its quality.

    mesh = mesh_body("finger.stl", unit="mm", size_mm=0.8).with_faces(back=lambda middles: middles[:, 2] < 0.01)

The corners come from `geometry.tetrahedra`. Mid-side nodes of the outer edges are moved onto the given surface wherever all
elements remain valid, so that the elements approximate it to third order of their size.
"""

import math
import warnings
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import trimesh
from scipy.sparse.csgraph import connected_components

from softtact.errors import InputError, MeshWarning
from softtact.fem.elements import TET10, TRI6
from softtact.fem.quadratic_nodes import raised
from softtact.fem.solid_mesh import SolidMesh
from softtact.geometry.meshes import UNIT_MM, check_body, plausible_facets, read_mesh, refuse_folded, volume_of
from softtact.geometry.tetrahedra import ClosestPoints, check_fillable, fill, first_hits, quality

MOST_ELEMENTS = 400_000      # about 1.7 million unknowns
_ENVELOPE = 0.05             # of the size: tolerance of fTetWild's surface; smaller values refine curved parts
_OF_WIDTH = 0.4              # of the width of a gap or wall: envelope that keeps it
_LEAST_ENVELOPE = 0.01       # of the size: smaller ones are taken only when they are asked for, as they take minutes
_NARROW = 5.0                # tolerances of deviation: wider gaps and walls are not lost for their width
_MOST_RAYS = 200             # by which the width of gaps is measured
_LOST = 2.0                  # envelopes from the mesh from which a part of the surface is lost
_MOST_POINTS, _MOST_CUTS = 50_000, 100     # on the surface, and along the edges of a facet, from which deviations are measured
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
    """Largest distance of the mesh's outside from the surface, or of the surface from the outside."""
    deviation_rms_mm: float
    """Root mean square distance of the mesh's outside from the surface."""
    least_quality: float
    """Least mean ratio of the elements' corners: 1 for a regular tetrahedron, 0 for a flat one."""
    mean_quality: float
    """Average of the elements' mean ratios."""
    least_jacobian: float
    """Least determinant of the Jacobian in an element over that of the straight one: 1 for straight elements."""

    shells: int
    """Closed parts of the outside: bodies, and cavities in them."""
    holes: int
    """Holes that go through the bodies (the genus of the outside)."""
    lost_width_mm: float | None = None
    """Width of the gaps that were filled or the walls that were lost, where there are any."""
    remarks: tuple[str, ...] = ()
    """What of the surface was lost, in sentences without a full stop."""

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
    envelope_mm: tolerance of the mesh's surface before its nodes are moved onto the given one, by default a twentieth of the size,
        and less where that would lose a part of the surface; a smaller tolerance makes smaller elements where the surface is curved
    most_elements: larger meshes are refused;  threads: of the mesher

    Warns (MeshWarning) of gaps that were filled, parts that were joined and details that were lost.
    A repeated call gives a different mesh of like quality (see `geometry.tetrahedra`): write the mesh, and keep the file.
    Raises InputError where the surface is open, intersects itself or is of an implausible size, where elements would be larger than
    the body or too many, and where the mesh loses more than 5 % of the body. It needs the extra `mesh`.
    """
    mesh, report = meshed_body(surface, size_mm=size_mm, unit=unit, region=region, envelope_mm=envelope_mm,
                               most_elements=most_elements, threads=threads)
    for remark in report.remarks:
        warnings.warn(f"{remark}.", MeshWarning, stacklevel=2)
    return mesh


def meshed_body(surface: str | Path | trimesh.Trimesh, *, size_mm: float, unit: str | None = None, region: str = "body",
                envelope_mm: float | None = None, most_elements: int = MOST_ELEMENTS,
                threads: int = 1) -> tuple[SolidMesh, BodyReport]:
    """As `mesh_body`, with the report, whose remarks are given in place of warnings."""
    body, name = closed_surface(surface, unit=unit)
    check_fillable(body, size_mm=size_mm, most_elements=most_elements, name=name)
    envelope = _ENVELOPE * size_mm if envelope_mm is None else envelope_mm
    if not 0 < envelope <= size_mm:
        raise InputError(f"{name}: an envelope of {envelope} mm is not possible; give one above 0, up to {size_mm:g} mm.")
    options: dict[str, Any] = {"size_mm": size_mm, "region": region, "threads": threads, "name": name}
    mesh, report = _meshed(body, envelope_mm=envelope, **options)
    needed = _OF_WIDTH * report.lost_width_mm if report.lost_width_mm else envelope / 3
    if envelope_mm is None and report.remarks and _LEAST_ENVELOPE * size_mm <= needed < envelope:
        finer, closer = _meshed(body, envelope_mm=needed, **options)
        if closer.elements <= most_elements and (not closer.remarks or closer.deviation_mm < report.deviation_mm):
            word = f"an envelope of {envelope:.3g} mm would lose details of the body, so that one of {needed:.3g} mm was taken"
            mesh, report = finer, replace(closer, remarks=(word, *closer.remarks))
    if abs(report.volume_error) > _MOST_VOLUME_ERROR:
        raise InputError(f"{name}: elements of {size_mm:g} mm change the body's volume by {100 * report.volume_error:.2g} %; give "
                         "smaller ones.")
    return mesh, report


def _meshed(body, *, size_mm, envelope_mm, region, threads, name):
    """The mesh of a closed surface, and its report."""
    corners, tetrahedra = fill(body, size_mm=size_mm, envelope_mm=envelope_mm, threads=threads)
    points, (nodes,), _ = raised(corners, [("tetra", tetrahedra)])
    mesh = SolidMesh(points, ((region, "tetra10", nodes),))
    mesh = SolidMesh(_curved(mesh, ClosestPoints(body.vertices, body.faces)), mesh.cells)
    return mesh, body_report(mesh, body, tolerance_mm=_LOST * envelope_mm)


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


def body_report(mesh: SolidMesh, surface: trimesh.Trimesh, *, tolerance_mm: float | None = None) -> BodyReport:
    """`BodyReport` of a mesh of tetrahedra against the closed surface (mm) that it fills.

    tolerance_mm: deviation from which a part of the surface is lost, by default a tenth of the edges on the outside
    """
    nodes = np.concatenate([nodes for _, kind, nodes in mesh.cells if kind == "tetra10"])
    facets = mesh.boundary["triangle6"]
    values, weights = TRI6.shape(TRI6.quadrature.points)[0], TRI6.quadrature.weights
    places = np.einsum("gm,fmi->fgi", values, mesh.points[facets]).reshape(-1, 3)
    away = np.linalg.norm(places - ClosestPoints(surface.vertices, surface.faces)(places), axis=1)
    corners = mesh.points[facets[:, :3]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    share = (area[:, None] * weights).ravel()
    edge = float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).mean())
    given, of_facet = surface_points(surface, spacing_mm=min(edge / 2, float(surface.extents.min()) / 8))
    tolerance = edge / 10 if tolerance_mm is None else tolerance_mm
    nearest = ClosestPoints(mesh.points, facets[:, _QUARTERS].reshape(-1, 3))(given)
    lost = np.linalg.norm(given - nearest, axis=1)
    ratio, volume = quality(mesh.points[nodes[:, :4]]), mesh.volume_mm3()
    curved = nodes[np.isin(nodes, facets[:, 3:]).any(axis=1)]     # inner edges are straight
    used = len(np.unique(nodes))
    shells, of_surface = _shells(facets[:, :3]), _shells(surface.faces)
    far, here = given[lost.argmax()], np.flatnonzero((lost > tolerance) & (of_facet >= 0))
    width = _width(surface, given[here], of_facet[here], _NARROW * tolerance) if len(here) else None
    remarks = _on_shells(shells, of_surface, far) + _on_lost(far, lost, tolerance, width)
    return BodyReport(elements=len(nodes), nodes=used, unknowns=3 * used, volume_mm3=volume,
                      volume_error=volume / volume_of(surface) - 1, deviation_mm=float(max(away.max(), lost.max())),
                      deviation_rms_mm=float(np.sqrt(share @ away**2 / share.sum())), least_quality=float(ratio.min()),
                      mean_quality=float(ratio.mean()), least_jacobian=float(_jacobian_ratio(mesh.points, curved).min()),
                      shells=shells[0], holes=shells[1], lost_width_mm=width,
                      remarks=tuple(remarks))


def surface_points(surface: trimesh.Trimesh, *, spacing_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) about `spacing_mm` apart on a surface, and the facet (n,) in which each lies; its corners, too, of facet -1."""
    triangles = np.asarray(surface.triangles)
    spacing = max(spacing_mm, np.sqrt(surface.area / _MOST_POINTS))
    cuts = np.clip(np.ceil(np.sqrt(2 * surface.area_faces) / spacing), 1, _MOST_CUTS).astype(int)
    found, facets = [np.asarray(surface.vertices)], [np.full(len(surface.vertices), -1)]
    for cut in np.unique(cuts):
        i, j = (grid.ravel() for grid in np.meshgrid(np.arange(cut), np.arange(cut), indexing="ij"))
        a, b = (i + 1 / 3)[i + j < cut] / cut, (j + 1 / 3)[i + j < cut] / cut
        found.append(np.einsum("sc,fci->fsi", np.column_stack([a, b, 1 - a - b]), triangles[cuts == cut]).reshape(-1, 3))
        facets.append(np.repeat(np.flatnonzero(cuts == cut), len(a)))
    return np.concatenate(found), np.concatenate(facets)


def _width(surface, places, facets, most):
    """Width in mm of the narrow gaps or thin walls at places on the surface, a low decile over them; None above `most`."""
    chosen = np.linspace(0, len(places) - 1, min(len(places), _MOST_RAYS)).astype(int)
    normals = surface.face_normals[facets[chosen]]
    widths = first_hits(surface, places[chosen], normals) + first_hits(surface, places[chosen], -normals)
    width = float(np.quantile(widths, 0.1)) if widths else math.inf
    return width if width <= most else None


def _shells(triangles):
    """Number of closed shells of triangles (t, 3), and of the holes that go through them, by Euler's formula."""
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    used, ends = np.unique(edges, return_inverse=True)
    ends = ends.reshape(-1, 2)
    count = len(used)
    shells = connected_components(sp.coo_matrix((np.ones(len(ends), bool), ends.T), shape=(count, count)), directed=False)[0]
    return int(shells), int(shells - (count - len(edges) + len(triangles)) // 2)


def _on_shells(found, given, far):
    """Remarks on parts of the surface that were joined or closed."""
    at = "{:.4g}, {:.4g}, {:.4g} mm".format(*far)
    return [f"the surface has {of_surface} {what} and the mesh has {of_mesh}: {why} (the surface is farthest from the mesh at "
            f"{at}); give a smaller --envelope or --size"
            for what, why, of_mesh, of_surface in (("closed parts", "parts were joined or lost", found[0], given[0]),
                                                   ("holes through it", "holes were closed or made", found[1], given[1]))
            if of_mesh != of_surface]


def _on_lost(far, lost, tolerance, width):
    """A remark on the part of the surface that lies farther from the mesh than a tolerance in mm."""
    if lost.max() <= tolerance:
        return []
    of = f" of {width:.2g} mm" if width else ""
    remedy = f"an --envelope of {_OF_WIDTH * width:.2g} mm, which makes many more elements" if width else "a smaller --envelope"
    return [f"{100 * np.mean(lost > tolerance):.2g} % of the surface lie up to {lost.max():.3g} mm from the mesh's outside "
            "(farthest at {:.4g}, {:.4g}, {:.4g} mm): ".format(*far)
            + f"narrow gaps or holes{of} were filled, or thin parts lost; give {remedy}, or a smaller --size"]


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
