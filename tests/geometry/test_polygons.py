"""Polygons of any shape as triangles: they cover it once, and look to the polygon's side."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.mesh_files import U_SHAPE

from softtact.errors import InputError
from softtact.geometry.polygons import Polygons, facets_of

TURNS = [(0, 0, 0), (90, 0, 0), (180, 0, 0), (33, -71, 128)]
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]     # a square with a hole, by a slit
SHAPES = {
    "triangle": [(0, 0), (3, 0), (0, 2)],
    "square": [(0, 0), (3, 0), (3, 3), (0, 3)],
    "concave quadrilateral": [(0, 0), (4, 1), (0, 4), (1, 1)],
    "quadrilateral with a straight corner": [(0, 0), (2, 0), (4, 0), (0, 3)],
    "U": U_SHAPE,
    "straight corners on each side": [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)],
    "a corner twice in a row": [(0, 0), (3, 0), (3, 0), (3, 3), (0, 3)],
    "the first corner again": [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0)],
    "keyhole": KEYHOLE,
    "spiral": [(0, 0), (9, 0), (9, 9), (2, 9), (2, 4), (5, 4), (5, 5), (3, 5), (3, 8), (8, 8), (8, 1), (0, 1)],
}


def triangles(corners, name="mesh.obj"):
    """Triangles of one polygon with corners (n, 3)."""
    n = len(corners)
    return facets_of(name, Polygons(np.asarray(corners, float), np.arange(n), np.array([n]), np.array([7])))


def vector_areas(facets):
    return 0.5 * np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])


def own_area(corners):
    """Vector area (3,) of a polygon by its rim alone."""
    return 0.5 * np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("shape", SHAPES)
def test_triangles_cover_a_polygon_once_from_any_corner_and_in_any_plane(shape, turn):
    flat = np.column_stack([np.array(SHAPES[shape], float), np.full(len(SHAPES[shape]), 5.0)])
    points = Rotation.from_euler("xyz", turn, degrees=True).apply(flat)
    for start in range(len(points)):
        areas = vector_areas(triangles(np.roll(points, start, axis=0)))
        assert areas.sum(axis=0) == pytest.approx(own_area(points), abs=1e-9)
        sizes = np.linalg.norm(areas, axis=1)
        assert sizes.sum() == pytest.approx(np.linalg.norm(own_area(points)))    # none lies on another
        assert sizes.min() > 1e-6


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.floats(0.2, 3), min_size=4, max_size=14), st.sampled_from(TURNS), st.integers(0, 13))
def test_random_stars_are_covered_once(radii, turn, start):
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.column_stack([radii * np.cos(angle), radii * np.sin(angle), np.ones(len(radii))])
    points = np.roll(Rotation.from_euler("xyz", turn, degrees=True).apply(flat), start, axis=0)
    areas = vector_areas(triangles(points))
    assert areas.sum(axis=0) == pytest.approx(own_area(points), abs=1e-9)
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(np.linalg.norm(own_area(points)))


def test_a_bent_quadrilateral_is_split_alike_from_any_corner():
    bent = np.array([(0, 0, 0), (20, 0, 0), (20, 20, 1), (0, 20, 0)], float)
    first = {tuple(map(tuple, sorted(facet.tolist()))) for facet in triangles(bent)}
    for start in range(1, 4):
        polygon = Polygons(bent, np.roll(np.arange(4), start), np.array([4]), np.array([7]))
        assert {tuple(map(tuple, sorted(facet.tolist()))) for facet in facets_of("mesh.obj", polygon)} == first


@pytest.mark.parametrize(("corners", "said"), [
    ([(0, 0, 0), (3, 3, 0), (3, 0, 0), (0, 3, 0)], "the polygon of 4 corners crosses itself"),
    ([(0, 0, 0), (3, 2, 0), (3, 0, 0), (0, 9, 0)], "crosses itself"),
    ([(0, 0, 0), (4, 4, 0), (4, 0, 0), (0, 4, 0), (-1, 2, 0)], "the polygon of 5 corners crosses itself"),
    ([(np.cos(a), np.sin(a), 0) for a in 0.8 * np.pi * np.arange(5)], "crosses itself"),
    ([(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 6), (-1, 5, 0)], "is so far from a plane"),
    ([(0, 0, 0), (10, 0, 9), (10, 10, 0), (0, 10, 9)], "is so far from a plane"),
], ids=["bow-tie", "uneven bow-tie", "crossed sides", "pentagram", "bent pentagon", "saddle"])
def test_a_polygon_that_crosses_itself_or_is_bent_is_refused_with_its_line(corners, said):
    with pytest.raises(InputError, match=f"mesh.obj: line 7: .*{said}"):
        triangles(corners)


def test_what_few_digits_make_of_small_polygons_is_read():
    """Of a mesh of 20 mm: a hexagon of 0.05 mm, bent by 1 um, and a strip of 10 mm by 1 um whose sides cross."""
    angle = np.pi / 3 * np.arange(6)
    hexagon = np.column_stack([0.025 * np.cos(angle), 0.025 * np.sin(angle), 5e-4 * (-1) ** np.arange(6)])
    strip = [(0, 0, 0), (10, 0, 0), (10, -0.001, 0), (0, 0.001, 0)]
    points = np.array([*hexagon, *strip, (20, 20, 20)])
    facets = facets_of("mesh.obj", Polygons(points, np.arange(10), np.array([6, 4]), np.array([7, 8])))
    assert len(facets) == 6 and np.isfinite(facets).all()


def test_a_polygon_without_area_keeps_its_rim():
    """It may close a slit between facets."""
    line = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (4, 0, 0), (3, 0, 0)], float)
    facets = triangles(line)
    edges = [(tuple(a), tuple(b)) for facet in facets.tolist() for a, b in zip(facet, facet[1:] + facet[:1], strict=True)]
    rim = {(tuple(a), tuple(b)) for a, b in zip(line, np.roll(line, -1, axis=0), strict=True)}
    assert {edge for edge in edges if edge[::-1] not in edges} == rim
