"""The study's own objects, written as STL files: `python scripts/make_objects.py --out config/objects`.

The pipeline reads meshes and never calls this module: whatever is pressed lies on disk as an STL file, with one line
in `catalogue.yaml`. Names of indenters that the published data set uses are kept; their drawings are not published,
so the sizes are ours, and so are the indenters beyond those. Every pressing face is at least 90 mm2, wide enough to carry
the sensor's full 50 N.

Each object is built of few solids: a pad, a path, a ring, a dome, a block; lengths in mm. A solid stands on z = 0 with the face
that presses, and grows upwards. Its lower edge is rounded, because a sharp edge puts an infinite pressure on a soft layer, which
no mesh resolves.
"""

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold, OpType
from numpy.typing import ArrayLike

from softtact.files import atomic_path

EDGE_MM = 0.25  # radius of the rounded lower edge
CHORD_ERROR_MM = 0.02  # how far a polygon may leave its circle
_EDGE_STEPS = 3  # straight pieces of the rounded edge, seen from the side
_DECIMALS = 4  # of a coordinate in mm; unions leave corners that differ by round-off
FACE_HEIGHT = 4.0  # mm from the pressing face to the plate: the plate must not touch at the deepest press
PLATE_HEIGHT = 4.0
PLATE_MARGIN = 0.1  # mm; sides that only touch would leave slivers in the union
BAR_WIDTH = 3.5
OVERLAP = 0.5  # mm that a part reaches into its plate, so that the union is one body
LOW_FEATURE = 0.5  # mm by which the low features of objects 5 and 6 stay behind the others (paper, sec. 4.2)


def circle_segments(radius: float) -> int:
    """Number of sides, a multiple of 4, that keeps a polygon within `CHORD_ERROR_MM` of its circle."""
    half_angle = np.arccos(max(1.0 - CHORD_ERROR_MM / radius, 0.0))
    return max(12, 4 * int(np.ceil(np.pi / half_angle / 4)))


def edge_profile(radius: float, height: float, *, edge: float = EDGE_MM, round_top: bool = False) -> np.ndarray:
    """Outline (points, 2) of a disc seen from the side as (distance from the axis, z), from the bottom upwards."""
    angle = np.linspace(0.0, np.pi / 2, _EDGE_STEPS + 1)
    lower = np.column_stack([radius - edge + edge * np.sin(angle), edge - edge * np.cos(angle)])
    upper = lower[::-1] * [1, -1] + [0, height] if round_top else [[radius, height]]
    return np.vstack([lower, upper])


def disc_points(centre: ArrayLike, radius: float, height: float, **profile: Any) -> np.ndarray:
    """Points (n, 3) of a disc with a rounded edge, whose convex hull is the disc."""
    outline = edge_profile(radius, height, **profile)
    count = circle_segments(radius)
    angle = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy = np.asarray(centre) + outline[:, None, :1] * around
    z = np.broadcast_to(outline[:, None, 1:], (len(outline), count, 1))
    return np.concatenate([xy, z], axis=-1).reshape(-1, 3)


def pad(centres: ArrayLike, *, radius: float, height: float, **profile: Any) -> Manifold:
    """Convex solid: the hull of discs of `radius` about each of `centres` (n, 2); one centre gives a disc."""
    points = [disc_points(centre, radius, height, **profile) for centre in np.atleast_2d(centres)]
    return Manifold.hull_points(np.concatenate(points))


def polygon(corners: Sequence[Sequence[float] | np.ndarray] | np.ndarray, *, height: float, corner_radius: float = 0.5,
            **profile: Any) -> Manifold:
    """Convex polygon through `corners` (n, 2), with rounded corners."""
    return pad(_inset(np.asarray(corners, float), corner_radius), radius=corner_radius, height=height, **profile)


def path(points: Sequence[Sequence[float] | np.ndarray] | np.ndarray, *, width: float, height: float) -> Manifold:
    """Bar of `width` with round ends along the line through `points` (n, 2)."""
    points = np.asarray(points, float)
    return union([pad(ends, radius=width / 2, height=height) for ends in zip(points[:-1], points[1:], strict=True)])


def arc(*, radius: float, width: float, start_deg: float, end_deg: float, height: float) -> Manifold:
    """Bar along an arc about the origin."""
    count = int(np.ceil(circle_segments(radius) * abs(end_deg - start_deg) / 360)) + 1
    angle = np.radians(np.linspace(start_deg, end_deg, count))
    return path(radius * np.column_stack([np.cos(angle), np.sin(angle)]), width=width, height=height)


def ring(*, outer: float, inner: float, height: float, centre: tuple[float, float] = (0.0, 0.0)) -> Manifold:
    """Ring between two diameters; both lower edges are rounded."""
    outside = edge_profile(outer / 2, height)
    width = (outer - inner) / 2
    inside = edge_profile(width, height) * [-1, 1] + [inner / 2 + width, 0]
    section = CrossSection([np.vstack([outside, inside[::-1]])])
    return section.revolve(circle_segments(outer / 2)).translate((*centre, 0.0))


def dome(*, radius: float, base_diameter: float, height: float) -> Manifold:
    """Spherical cap of `radius` under a cylinder of `base_diameter`; `height` counts from the lowest point."""
    polar = np.linspace(0.0, np.arcsin(base_diameter / 2 / radius), 16)[1:]
    outline = np.column_stack([radius * np.sin(polar), radius - radius * np.cos(polar)])
    outline = np.vstack([[0.0, 0.0], outline, [base_diameter / 2, height], [0.0, height]])
    return CrossSection([outline]).revolve(circle_segments(base_diameter / 2))


def block(size_x: float, size_y: float, height: float, *, corner_radius: float = 0.5, **profile: Any) -> Manifold:
    """Rectangular block about the z axis."""
    x, y = size_x / 2, size_y / 2
    return polygon([(-x, -y), (x, -y), (x, y), (-x, y)], height=height, corner_radius=corner_radius, **profile)


def ball(*, radius: float, subdivisions: int = 4) -> Manifold:
    """Sphere that rests on z = 0."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Manifold.hull_points(sphere.vertices + [0, 0, radius])


def hull(points: np.ndarray) -> Manifold:
    """Convex solid around points (n, 3)."""
    return Manifold.hull_points(points)


def union(solids: Iterable[Manifold]) -> Manifold:
    """One solid of several."""
    return Manifold.batch_boolean(list(solids), OpType.Add)


def raised(solid: Manifold, z: float) -> Manifold:
    """The solid, moved up by `z`."""
    return solid.translate((0.0, 0.0, z))


def to_mesh(solid: Manifold) -> trimesh.Trimesh:
    """Triangle mesh in single precision, as an STL holds it, with its facets in one fixed order.

    The order that the boolean operations leave depends on threads; sorted facets give the same file every time.
    """
    raw = solid.to_mesh64()
    corners = np.float32(np.round(raw.vert_properties[:, :3], _DECIMALS)).astype(float) + 0.0  # no negative zeros
    facets = _sorted_facets(_without_collapsed(corners[raw.tri_verts]))
    return trimesh.Trimesh(**trimesh.triangles.to_kwargs(facets), process=False)


def _without_collapsed(triangles):
    """Facets (n, 3, 3) without those that have two equal corners."""
    equal = [np.all(triangles[:, i] == triangles[:, (i + 1) % 3], axis=1) for i in range(3)]
    return triangles[~np.any(equal, axis=0)]


def _sorted_facets(triangles):
    """Facets (n, 3, 3) turned to begin at their smallest corner, then sorted."""
    first = np.array([np.lexsort(facet.T[::-1])[0] for facet in triangles])
    turn = (first[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(triangles, turn[..., None], axis=1)
    return turned[np.lexsort(turned.reshape(-1, 9).T[::-1])]


def _inset(corners, distance):
    """Corners (n, 2) of a convex polygon, counter-clockwise, after its sides moved inwards by `distance`."""
    before = _unit(corners - np.roll(corners, 1, axis=0))
    after = _unit(np.roll(corners, -1, axis=0) - corners)
    half_turn = np.sum(before * after, axis=1, keepdims=True)
    inwards = np.column_stack([-before[:, 1], before[:, 0]]) + np.column_stack([-after[:, 1], after[:, 0]])
    return corners + distance * inwards / (1.0 + half_turn)


def _unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def bar(*points: Sequence[float], width: float = BAR_WIDTH) -> Manifold:
    """Bar of an indenter along the line through `points`."""
    return path(points, width=width, height=FACE_HEIGHT + OVERLAP)


def disc(diameter: float, centre: tuple[float, float] = (0.0, 0.0)) -> Manifold:
    """Round pad of an indenter."""
    return pad(centre, radius=diameter / 2, height=FACE_HEIGHT + OVERLAP)


def hoop(outer: float, inner: float, centre: tuple[float, float] = (0.0, 0.0)) -> Manifold:
    """Ring of an indenter."""
    return ring(outer=outer, inner=inner, height=FACE_HEIGHT + OVERLAP, centre=centre)


def face(*corners: Sequence[float] | np.ndarray) -> Manifold:
    """Convex polygonal pad of an indenter; corners counter-clockwise."""
    return polygon(corners, height=FACE_HEIGHT + OVERLAP)


def corner_points(count: int, radius: float, *, start_deg: float = 90.0) -> np.ndarray:
    """Corners (count, 2) of a regular polygon."""
    angle = np.radians(start_deg + 360.0 * np.arange(count) / count)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def star(*, points: int = 5, outer: float = 10.0, inner: float = 5.0) -> Manifold:
    """Star as overlapping kites, each from a tip across the centre: the rounded edges meet on the outline only."""
    tips = corner_points(points, outer)
    valleys = corner_points(points, inner, start_deg=90.0 + 180.0 / points)
    return union(face(tips[k], valleys[k], valleys[(k + 2) % points], valleys[k - 1]) for k in range(points))


def corner_brackets(x: float = 8.0, y: float = 15.0, leg: float = 5.0) -> Manifold:
    """An L in each of the four corners."""
    return union(bar((sx * (x - leg), sy * y), (sx * x, sy * y), (sx * x, sy * (y - leg)))
                 for sx in (-1, 1) for sy in (-1, 1))


def blob(*discs: tuple[float, float, float]) -> Manifold:
    """Pad of overlapping discs (x, y, diameter)."""
    return union(disc(diameter, (x, y)) for x, y, diameter in discs)


def half_disc(radius: float) -> Manifold:
    """Half of a disc, its straight side along x."""
    angle = np.radians(np.linspace(0.0, 180.0, 25))
    return face(*np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))


def cap(radius: float, base_diameter: float) -> Manifold:
    """Spherical cap of an indenter."""
    return dome(radius=radius, base_diameter=base_diameter, height=FACE_HEIGHT + OVERLAP)


def ellipse(length: float = 24.0, width: float = 13.0) -> Manifold:
    """Elliptic pad with its long side along y."""
    angle = 2 * np.pi * np.arange(48) / 48
    return face(*np.column_stack([width / 2 * np.cos(angle), length / 2 * np.sin(angle)]))


INDENTERS: dict[str, Callable[[], Manifold]] = {
    "A Form": lambda: union([bar((-7, -12), (0, 12), (7, -12)), bar((-4, -3), (4, -3))]),
    "Bordes H": lambda: union([bar((-8, 14), (8, 14)), bar((-8, -14), (8, -14))]),
    "Bordes V": lambda: union([bar((-8, -14), (-8, 14)), bar((8, -14), (8, 14))]),
    "Circle G": lambda: disc(18),
    "Circle M": lambda: disc(15),
    "Circle S": lambda: disc(13),
    "Circle XS": lambda: disc(11),
    "Corners": corner_brackets,
    "Cruz": lambda: union([bar((0, -14), (0, 14)), bar((-8, 0), (8, 0))]),
    "Diagonal": lambda: bar((-8, -14), (8, 14)),
    "Diagonal Inver": lambda: bar((8, -14), (-8, 14)),
    "Donut G": lambda: hoop(19, 11),
    "Donut M": lambda: hoop(15, 7),
    "Echo H": lambda: union([bar((-8, 9), (8, 9)), bar((-5, 0), (5, 0)), bar((-2, -9), (2, -9))]),
    "Echo V": lambda: union([bar((-7, -14), (-7, 14)), bar((0, -9), (0, 9)), bar((7, -4), (7, 4))]),
    "Echo X": lambda: union([bar((-7, -7), (7, 7)), bar((-7, 7), (7, -7)), bar((-4, 14), (4, 14)),
                             bar((-4, -14), (4, -14))]),
    "Glasses": lambda: union([hoop(14, 7, (0, 9)), hoop(14, 7, (0, -9)), bar((0, -3.4), (0, 3.4))]),
    "Triangle": lambda: face(*corner_points(3, 11)),
    "Square": lambda: face(*corner_points(4, 9, start_deg=45)),
    "Sphere": lambda: cap(20, 19),
    "Star": star,
    "Rectangle": lambda: face((-5, -12), (5, -12), (5, 12), (-5, 12)),
    "T Form": lambda: union([bar((-8, 10), (8, 10)), bar((0, 10), (0, -12))]),
    "U Form": lambda: bar((-7, 11), (-7, -11), (7, -11), (7, 11)),
    # From here on names are ours: the publication tells the kinds, and that there are 49 in all.
    "Triangle S": lambda: face(*corner_points(3, 9.2)),
    "Triangle Right": lambda: face((-7, -12), (7, -12), (-7, 12)),
    "Triangle Long": lambda: face((-5, -15), (5, -15), (0, 15)),
    "Square S": lambda: face(*corner_points(4, 7.6, start_deg=45)),
    "Square M": lambda: face(*corner_points(4, 10.8, start_deg=45)),
    "Square G": lambda: face(*corner_points(4, 13, start_deg=45)),
    "Sphere S": lambda: cap(16, 17),
    "Sphere M": lambda: cap(25, 19),
    "Sphere G": lambda: cap(32, 19.5),
    "Circle XG": lambda: disc(19.5),
    "Rectangle S": lambda: face((-4, -8), (4, -8), (4, 8), (-4, 8)),
    "Rectangle G": lambda: face((-8, -14), (8, -14), (8, 14), (-8, 14)),
    "Donut S": lambda: hoop(13, 5),
    "Donut XG": lambda: hoop(19.6, 14.5),
    "Bar": lambda: bar((0, -14), (0, 14), width=5),
    "Cruz X": lambda: union([bar((-6, -10), (6, 10)), bar((-6, 10), (6, -10))]),
    "H Form": lambda: union([bar((-6, -11), (-6, 11)), bar((6, -11), (6, 11)), bar((-6, 0), (6, 0))]),
    "Y Form": lambda: union([bar((0, -12), (0, 0)), bar((0, 0), (-7, 11)), bar((0, 0), (7, 11))]),
    "V Form": lambda: bar((-7, 11), (0, -11), (7, 11)),
    "Pentagon": lambda: face(*corner_points(5, 9.5)),
    "Half Moon": lambda: half_disc(9.8),
    "Three Dots": lambda: union([disc(7, (-5, -8)), disc(7, (5, -3)), disc(7, (-1, 9))]),
    "Irregular A": lambda: face((-7, -9), (3, -13), (8, -2), (4, 8), (-5, 11)),
    "Irregular B": lambda: blob((-3, -9, 9), (2, -3, 11), (-2, 5, 8), (3, 10, 7)),
    "Irregular C": lambda: union([bar((-6, -12), (1, -6), (-3, 3), (6, 12)), bar((1, -6), (7, -9)), disc(6, (6, 4))]),
}

UNSEEN: dict[str, Callable[[], Manifold]] = {
    "Hexagon": lambda: face(*corner_points(6, 8.5)),
    "Ellipse": ellipse,
    "L Form": lambda: bar((-6, 12), (-6, -12), (7, -12)),
    "Two Dots": lambda: union([disc(8.5, (-3, 8)), disc(8.5, (3, -8))]),
    "Ring Segment": lambda: arc(radius=7.8, width=4, start_deg=-30, end_deg=210, height=FACE_HEIGHT + OVERLAP),
    "Z Form": lambda: bar((-6, 11), (6, 11), (-6, -11), (6, -11)),
    "Arrow": lambda: union([bar((0, -13), (0, 12)), bar((-7, 4), (0, 12), (7, 4))]),
    "Parallelogram": lambda: face((-9, -9), (2, -9), (9, 9), (-2, 9)),
    "S Form": lambda: bar((7, 11), (-6, 9), (-6, 1), (6, -1), (6, -9), (-7, -11)),
    "Irregular D": lambda: union([face((-8, 1), (1, -4), (8, 3), (2, 12), (-5, 11)), bar((3, -2), (-4, -13))]),
}


def on_plate(pressing: Manifold) -> Manifold:
    """Indenter: the pressing part under a plate a little larger than its bounding box."""
    x0, y0, _, x1, y1, _ = pressing.bounding_box()
    plate = block(x1 - x0 + 2 * PLATE_MARGIN, y1 - y0 + 2 * PLATE_MARGIN, PLATE_HEIGHT)
    plate = plate.translate(((x0 + x1) / 2, (y0 + y1) / 2, FACE_HEIGHT))
    return union([pressing, plate])


def object_1() -> Manifold:
    """Smooth rectangular prism."""
    return block(14, 34, 18, corner_radius=2.0, edge=2.0, round_top=True)


def object_2() -> Manifold:
    """Smooth sphere."""
    return ball(radius=25.0)


def object_3() -> Manifold:
    """Smooth circular prism on its flat end."""
    return pad((0, 0), radius=10.0, height=30.0, edge=0.5, round_top=True)


def object_4() -> Manifold:
    """Circular prism whose end carries a rim and a boss of one height."""
    body = raised(pad((0, 0), radius=10.5, height=16.0, edge=0.5, round_top=True), 2.0)
    reliefs = [ring(outer=20, inner=13, height=2.5), pad((0, 0), radius=3.5, height=2.5)]
    return union([body, *reliefs])


def object_5() -> Manifold:
    """Rectangular prism with four ridges, the second one 0.5 mm lower, and blind holes in the far side."""
    floor, holes_floor, top = 3.0, 10.0, 18.0
    body = raised(block(24, 42, top - floor, corner_radius=2.0), floor)
    ridges = [ridge(y, lowered=LOW_FEATURE if y == -4.0 else 0.0) for y in (-12.0, -4.0, 4.0, 12.0)]
    holes = [pad((x, y), radius=2.5, height=top).translate((0, 0, holes_floor))
             for x in (-6.0, 6.0) for y in (-12.0, 0.0, 12.0)]
    return union([body, *ridges]) - union(holes)


def ridge(y: float, *, lowered: float, floor: float = 3.0) -> Manifold:
    """Ridge of object 5, along x; `lowered` is how far it stays behind the contact plane."""
    bar_ = path([(-6.5, y), (6.5, y)], width=3.5, height=floor + OVERLAP - lowered)
    return raised(bar_, lowered)


def object_6() -> Manifold:
    """Cylinder with 19 small bosses on its flat end, six of which are 0.5 mm lower."""
    floor, pitch, boss_radius = 3.0, 5.0, 1.9
    body = raised(pad((0, 0), radius=14.0, height=20.0, edge=0.5, round_top=True), floor)
    inner = corner_points(6, pitch)
    outer = [*corner_points(6, 2 * pitch), *corner_points(6, np.sqrt(3) * pitch, start_deg=120.0)]
    high = [(0.0, 0.0), *outer]
    bosses = [pad(centre, radius=boss_radius, height=floor + OVERLAP) for centre in high]
    low = [raised(pad(centre, radius=boss_radius, height=floor + OVERLAP - LOW_FEATURE), LOW_FEATURE)
           for centre in inner]
    return union([body, *bosses, *low])


def key() -> Manifold:
    """Key lying flat: a bow with its hole, a blade, and four bits of different lengths."""
    thickness = 2.3
    bits = [path([(0, y), (reach, y)], width=1.8, height=thickness)
            for y, reach in ((-5.0, 4.4), (-8.0, 3.4), (-11.0, 4.8), (-14.0, 3.8))]
    return union([ring(outer=18, inner=7, height=thickness, centre=(0.0, 8.0)),
                  path([(0, 0), (0, -15)], width=5.0, height=thickness), *bits])


def bolt_head() -> Manifold:
    """Head of a socket bolt: a hexagon with chamfered corners and a hexagonal hole, its shank behind."""
    head = polygon(corner_points(6, 9.6), height=7.0, edge=0.6)
    shank = raised(pad((0, 0), radius=5.0, height=20.5), 6.5)
    socket = raised(polygon(corner_points(6, 4.6, start_deg=0.0), height=5.0), -1.0)
    return union([head, shank]) - socket


def coin() -> Manifold:
    """Coin: a raised rim, and a star in relief that stays 0.05 mm behind it."""
    body = raised(pad((0, 0), radius=9.8, height=1.6, edge=0.2, round_top=True), 0.3)
    relief = [raised(polygon([(0, 0), *tips], height=0.6, edge=0.15), 0.05) for tips in _rays(points=8, outer=7.0, half_deg=12.0)]
    return union([body, ring(outer=19.6, inner=15.6, height=1.0), *relief])


def _rays(*, points, outer, half_deg):
    """Pairs of corners, counter-clockwise, that make narrow triangles with the centre."""
    for start in 360.0 * np.arange(points) / points:
        yield [outer * np.array([np.cos(angle), np.sin(angle)]) for angle in np.radians([start - half_deg, start + half_deg])]


def spanner() -> Manifold:
    """Open-ended spanner lying flat: jaws, and a handle that ends in a round."""
    thickness = 4.0
    jaws = raised(arc(radius=6.2, width=4.5, start_deg=130, end_deg=410, height=thickness), 0.0).translate((0.0, 8.0, 0.0))
    return union([jaws, path([(0, 1), (0, -15)], width=6.0, height=thickness)])


def bottle_cap() -> Manifold:
    """Screw cap, open side down: a wall with 24 ridges around it, closed behind."""
    height = 11.0
    wall = ring(outer=19.0, inner=14.5, height=height)
    ridges = [pad(centre, radius=0.6, height=height - 0.5).translate((0.0, 0.0, 0.5)) for centre in corner_points(24, 9.3)]
    return union([wall, raised(pad((0, 0), radius=9.0, height=1.5), height - 1.5), *ridges])


def egg() -> Manifold:
    """Egg on its side: a ball, stretched along y and narrower towards one end."""
    points = trimesh.creation.icosphere(subdivisions=4).vertices
    narrow = 1.0 - 0.16 * points[:, 1]
    shaped = np.column_stack([20.0 * narrow * points[:, 0], 27.0 * points[:, 1], 20.0 * narrow * points[:, 2]])
    return hull(shaped - [0.0, 0.0, shaped[:, 2].min()])


def tube() -> Manifold:
    """Tube lying across the sensor's short side and beyond it on both."""
    angle = 2 * np.pi * np.arange(360) / 360
    ring_points = np.column_stack([14.0 * np.cos(angle), 14.0 + 14.0 * np.sin(angle)])
    return hull(np.vstack([np.column_stack([np.full(360, x), ring_points]) for x in (-18.0, 18.0)]))


EVERYDAY = {"Key": key, "Bolt Head": bolt_head, "Coin": coin, "Spanner": spanner, "Bottle Cap": bottle_cap, "Egg": egg}
# Wider than the sensor, as most of what a gripper takes hold of: across its short side, and over all of it.
WIDE: dict[str, Callable[[], Manifold]] = {"Ruler": lambda: block(34.0, 12.0, 3.0), "Tube": tube,
                                           "Carton": lambda: block(30.0, 44.0, 8.0)}
GRASPED = {f"Object {number}": shape for number, shape in
           enumerate([object_1, object_2, object_3, object_4, object_5, object_6], start=1)} | EVERYDAY | WIDE

# set -> (folder, shapes, what every shape of the set gets)
SETS: dict[str, tuple[str, dict[str, Callable[[], Manifold]], Callable[[Manifold], Manifold]]] = {
    "indenters": ("indenters", INDENTERS, on_plate),
    "unseen": ("unseen", UNSEEN, on_plate),
    "grasps": ("grasped", GRASPED, lambda solid: solid),
}


def file_name(label: str) -> str:
    """Name of an item as it stands in paths: `Circle G` -> `circle_g`."""
    return label.lower().replace(" ", "_")


def make_mesh(set_name: str, label: str) -> trimesh.Trimesh:
    """Mesh of one object of the study in mm, as a `trimesh.Trimesh`."""
    _, shapes, finish = SETS[set_name]
    return to_mesh(finish(shapes[label]()))


def write_objects(out: Path | str) -> Path:
    """Write every STL file and `catalogue.yaml` below the folder `out`; return the catalogue's path."""
    out = Path(out)
    lines = ["# Objects of the study, one a line: name in paths, file beside this one, unit of the mesh, set, label.",
             "# A new object is one STL file and one line."]
    for set_name, (folder, shapes, _) in SETS.items():
        for label in shapes:
            file = f"{folder}/{file_name(label)}.stl"
            _write_stl(out / file, make_mesh(set_name, label))
            lines.append(f"- {{name: {file_name(label)}, file: {file}, unit: mm, set: {set_name}, label: {label}}}")
    catalogue = out / "catalogue.yaml"
    with atomic_path(catalogue) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return catalogue


def _write_stl(file, mesh):
    with atomic_path(file) as temporary:
        temporary.write_bytes(mesh.export(file_type="stl"))


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Write the study's objects as STL files with their catalogue.")
    parser.add_argument("--out", default="config/objects", type=Path, help="folder to write to")
    print(write_objects(parser.parse_args(arguments).out))


if __name__ == "__main__":
    main()
