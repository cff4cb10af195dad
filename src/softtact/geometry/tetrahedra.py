"""Tetrahedra that fill a closed surface, by fTetWild, and checks of the surface.

fTetWild: Hu, Schneider, Wang, Zorin and Panozzo, ACM Trans. Graph. 39 (2020) 117, through the package `pytetwild`. It keeps the
tetrahedra's outside within an envelope around the given surface. It takes the facets in random order, and its seed cannot be set: a
repetition gives another mesh of the same quality. To repeat the same numbers, keep the mesh file.
"""

import contextlib
import math
from typing import Any

import numpy as np
import trimesh

from softtact.errors import InputError, how_to_install
from softtact.geometry.meshes import volume_of
from softtact.outputs import temporary_folder
from softtact.processes import call_apart

ELEMENTS_PER_CUBE = 13     # in a cube of the element size: measured 10 to 30, least where the size is small against the body
_CORNER_SHARE = 0.5        # of its quality that a tetrahedron may lose when one of its corners is moved onto the surface
_ON_SURFACE = 1e-6         # of the diagonal: nearer hits of a ray are its start
_SHARP = np.radians(30)    # angle between facets from which their edge is an edge of the body


def estimated_elements(surface: trimesh.Trimesh, size_mm: float) -> int:
    """Estimated number of tetrahedra that fill a closed surface at an edge length in mm, within a factor of two."""
    return math.ceil(ELEMENTS_PER_CUBE * volume_of(surface) / size_mm**3)


def check_fillable(surface: trimesh.Trimesh, *, size_mm: float, most_elements: int, name: str) -> None:
    """Refuse a surface that intersects itself, and an edge length (mm) that gives too few or too many elements.

    name: of the surface, in the message
    """
    if not (math.isfinite(size_mm) and size_mm > 0):
        raise InputError(f"{name}: the element size {size_mm} mm is not possible; give a number above 0.")
    smallest = float(np.ptp(surface.vertices, axis=0).min())
    if size_mm > smallest:
        raise InputError(f"{name}: elements of {size_mm:g} mm are larger than the body's smallest side, {smallest:.4g} mm; give "
                         f"{smallest / 3:.2g} mm or less.")
    if (count := estimated_elements(surface, size_mm)) > most_elements:
        fitting = size_mm * (count / most_elements) ** (1 / 3)
        raise InputError(f"{name}: elements of {size_mm:g} mm would be about {count:,}, more than {most_elements:,}; give "
                         f"{fitting:.2g} mm or more, or allow more elements.")
    _refuse_self_intersecting(surface, name)


def _refuse_self_intersecting(surface, name):
    pyvista, _ = _programs()
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonMath import vtkMatrix4x4
    from vtkmodules.vtkFiltersModeling import vtkCollisionDetectionFilter

    search, facets = vtkCollisionDetectionFilter(), _poly(pyvista, surface.vertices, surface.faces)
    for number in (0, 1):
        search.SetInputData(number, facets)
        search.SetMatrix(number, vtkMatrix4x4())
    search.SetCollisionModeToAllContacts()
    search.GenerateScalarsOff()
    search.Update()
    one, other = (vtk_to_numpy(search.GetContactCells(number)) for number in (0, 1))
    apart = ~(surface.faces[one][:, :, None] == surface.faces[other][:, None]).any(axis=(1, 2))     # neighbours touch
    if apart.any():
        x, y, z = surface.triangles_center[one[apart][0]]
        raise InputError(f"{name}: the surface intersects itself at {len(np.unique(one[apart]))} facets (one at {x:.4g}, {y:.4g}, "
                         f"{z:.4g} mm); repair it, for example with Blender's Boolean or Remesh modifier.")


def fill(surface: trimesh.Trimesh, *, size_mm: float, envelope_mm: float, threads: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) in mm and tetrahedra (e, 4), of positive volume, that fill a closed surface (mm).

    size_mm: desired edge length;  envelope_mm: largest distance of the outside from the surface before corners are moved onto it
    """
    _programs()     # refuses here, not in the other process, where they are missing
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    options = {"edge_length_abs": size_mm, "epsilon": envelope_mm / diagonal, "num_threads": threads, "vtk_ordering": True}
    points, tetrahedra = call_apart(_filled, np.asarray(surface.vertices, dtype=float), np.asarray(surface.faces, dtype=np.int32),
                                    options)
    tetrahedra = np.asarray(tetrahedra, dtype=np.int64)
    if not len(tetrahedra):
        raise InputError(f"Elements of {size_mm:g} mm with an envelope of {envelope_mm:g} mm do not fill the body; give less.")
    used, tetrahedra = np.unique(tetrahedra, return_inverse=True)
    points, tetrahedra = np.asarray(points, dtype=float)[used], tetrahedra.reshape(-1, 4)
    outer = outer_corners(tetrahedra)
    points = _moved(points, tetrahedra, outer, ClosestPoints(surface.vertices, surface.faces)(points[outer]))
    sharp = surface.face_adjacency_edges[surface.face_adjacency_angles > _SHARP]
    if len(sharp):
        near = ClosestPoints(surface.vertices, sharp)(points[outer])
        here = np.linalg.norm(near - points[outer], axis=1) <= envelope_mm
        points = _moved(points, tetrahedra, outer[here], near[here])
    return points, tetrahedra


def _filled(points, triangles, options):
    """What fTetWild makes, in a folder of its own: it writes its surface into the working folder, over a file of that name."""
    with temporary_folder() as folder, contextlib.chdir(folder):
        return _programs()[1].tetrahedralize(points, triangles, **options)


def _moved(points, tetrahedra, corners, places):
    """The points with corners (k,) moved to places (k, 3), except corners whose tetrahedra would lose too much quality."""
    moved, before = points.copy(), quality(points[tetrahedra])
    moved[corners] = places
    while (spoilt := quality(moved[tetrahedra]) < _CORNER_SHARE * before).any():
        back = np.unique(tetrahedra[spoilt])
        moved[back] = points[back]
    return moved


def outer_corners(tetrahedra: np.ndarray) -> np.ndarray:
    """Corners (k,) of the facets that belong to one of the tetrahedra (e, 4) only."""
    facets = np.concatenate([tetrahedra[:, corners] for corners in ([0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3])])
    _, first, uses = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return np.unique(facets[first[uses == 1]])


def quality(corners: np.ndarray) -> np.ndarray:
    """Mean ratio (e,) of tetrahedra with corners (e, 4, 3): 12 (3 V)^(2/3) / sum of squared edges; 1 for a regular, 0 for a flat,
    negative for an inverted one. (Liu and Joe, BIT 34 (1994) 268.)
    """
    one, other = np.triu_indices(4, 1)
    squares = ((corners[:, one] - corners[:, other]) ** 2).sum(axis=(1, 2))
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    return 12 * np.sign(volume) * (3 * np.abs(volume)) ** (2 / 3) / squares


class ClosestPoints:
    """The closest points on triangles (t, 3), or line segments (t, 2), of points (n, 3)."""

    def __init__(self, points: np.ndarray, facets: np.ndarray) -> None:
        self._facets = _poly(_programs()[0], points, facets)

    def __call__(self, places: np.ndarray) -> np.ndarray:
        """Closest points (k, 3) of places (k, 3)."""
        return np.asarray(self._facets.find_closest_cell(np.ascontiguousarray(places), return_closest_point=True)[1])


def first_hits(surface: trimesh.Trimesh, starts: np.ndarray, directions: np.ndarray) -> list[float]:
    """Distances in mm at which rays from points (n, 3) on a surface first meet it again; those that do not meet it are left out."""
    facets, far = _poly(_programs()[0], surface.vertices, surface.faces), float(np.linalg.norm(surface.extents))
    found = []
    for start, direction in zip(starts, directions, strict=True):
        hits = np.linalg.norm(facets.ray_trace(start, start + far * direction)[0] - start, axis=1)
        hits = hits[hits > _ON_SURFACE * far]
        found += [float(hits.min())] if len(hits) else []
    return found


def _poly(pyvista, points, facets):
    table = np.column_stack([np.full(len(facets), np.shape(facets)[1]), facets]).ravel()
    return pyvista.PolyData(np.array(points, dtype=float), **{"faces" if np.shape(facets)[1] == 3 else "lines": table})


def _programs() -> tuple[Any, Any]:
    """The modules pyvista, whose searches are those of VTK, and pytetwild."""
    try:
        import pytetwild
        import pyvista
    except ImportError:
        raise InputError(how_to_install("pytetwild")) from None
    return pyvista, pytetwild
