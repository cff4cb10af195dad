"""The sixteen objects of the paper, generated: stand-ins for its files, which are not for redistribution, and its hemisphere.

Each is a shape of 5 mm height on a plate of 15 x 15 x 5 mm, as the files measure; the shapes' sides and radii are the files' to
0.1 mm. Frame of a mesh, as of the files: y is up, the plate lies at y = 0, and the origin is at its middle. All in mm.
"""

from collections.abc import Callable

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold

PLATE_MM, HEIGHT_MM = 5.0, 5.0
_SIDE_MM, _RADIUS_MM = 15.0, 5.0
_SEGMENTS = 96  # of a full circle
_SMALLEST_MM = 1e-3  # thinner facets, which a union leaves, are merged


def _prism(outline: CrossSection) -> Manifold:
    """The outline, raised from the plate; z is up here."""
    return outline.extrude(HEIGHT_MM)


def _polygon(*corners: tuple[float, float]) -> CrossSection:
    return CrossSection([np.array(corners)])


def _box(x: float, y: float) -> CrossSection:
    return CrossSection.square((x, y), center=True)


def _disc(radius: float) -> CrossSection:
    return CrossSection.circle(radius, _SEGMENTS)


def _sector(radius: float, start_deg: float, end_deg: float) -> CrossSection:
    angles = np.radians(np.linspace(start_deg, end_deg, _SEGMENTS // 2))
    return _polygon((0.0, 0.0), *((radius * np.cos(a), radius * np.sin(a)) for a in angles))


def _star() -> CrossSection:
    angles, radii = np.arange(10) * np.pi / 5, np.tile([_RADIUS_MM, 1.91], 5)
    return _polygon(*zip(radii * np.cos(angles), radii * np.sin(angles), strict=True))


def _letter_s() -> CrossSection:
    """Two arcs of 240 degrees, 2 mm wide, outer radius 3.1 mm, one turned against the other."""
    upper = ((_disc(3.1) - _disc(1.1)) ^ _sector(6.0, 0.0, 240.0)).translate((0.0, 2.1))
    return (upper + upper.rotate(180.0)).simplify(0.005)


def _dome() -> Manifold:
    ball = Manifold.sphere(_RADIUS_MM, _SEGMENTS)
    return ball.trim_by_plane((0.0, 0.0, 1.0), 0.0)


def _ball_on_stem() -> Manifold:
    return Manifold.sphere(2.0, _SEGMENTS).translate((0.0, 0.0, 3.0)) + _disc(1.5).extrude(3.0)


def _torus() -> Manifold:
    """A ring of radius 4 mm with a round top of radius 1 mm, on a wall of 1 mm."""
    wall = CrossSection.square((1.0, 4.0)).translate((3.5, 0.0))
    return (wall + CrossSection.circle(1.0, _SEGMENTS // 2).translate((4.0, 4.0))).revolve(_SEGMENTS)


def _roof() -> Manifold:
    return Manifold.hull_points(
        np.array([[x, y, 0.0] for x in (-7.5, 7.5) for y in (-7.5, 7.5)] + [[0.0, y, HEIGHT_MM] for y in (-7.5, 7.5)])
    )


def _pyramid() -> Manifold:
    corners = [[_RADIUS_MM * np.cos(a), _RADIUS_MM * np.sin(a), 0.0] for a in 2 * np.pi * np.arange(3) / 3]
    return Manifold.hull_points(np.array([*corners, [0.0, 0.0, HEIGHT_MM]]))


_SHAPES: dict[str, Callable[[], Manifold]] = {
    "circleshell": lambda: _prism(_disc(5.0) - _disc(4.0)),
    "cone": lambda: Manifold.cylinder(HEIGHT_MM, _RADIUS_MM, 0.0, _SEGMENTS),
    "cross": lambda: _prism(_box(10.0, 2.0) + _box(2.0, 10.0)),
    "cubehole": lambda: _prism(_box(8.0, 8.0) - _disc(2.5)),
    "cuboid": lambda: _prism(_box(10.0, 5.0)),
    "cylinder": lambda: _prism(_disc(5.0)),
    "doubleslope": _roof,
    "hemisphere": _dome,
    "line": lambda: _prism(_box(15.0, 1.0)),
    "pacman": lambda: _prism(_sector(5.0, 30.0, 330.0)),
    "S": lambda: _prism(_letter_s()),
    "sphere": _ball_on_stem,
    "squareshell": lambda: _prism(_box(10.0, 10.0) - _box(8.0, 8.0)),
    "star": lambda: _prism(_star()),
    "tetrahedron": _pyramid,
    "torus": _torus,
}
OBJECTS = tuple(_SHAPES)


def generated_object(name: str) -> trimesh.Trimesh:
    """The object of a name of OBJECTS, y up, plate at y = 0."""
    plate = CrossSection.square((_SIDE_MM, _SIDE_MM), center=True).extrude(PLATE_MM)
    solid = (plate + _SHAPES[name]().translate((0.0, 0.0, PLATE_MM))).simplify(_SMALLEST_MM)
    found = solid.rotate((-90.0, 0.0, 0.0)).to_mesh()  # z up becomes y up
    return trimesh.Trimesh(found.vert_properties[:, :3], found.tri_verts, process=True)
