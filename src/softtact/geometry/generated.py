"""Objects that a study generates: smooth caps, and stepped ones of which one feature stands back by a known height.

A stepped object has three features side by side under a plate; they end level but for one, whose lower face is `step_mm` higher.
A smooth one is a single convex cap, z = x^2 / (2 R_x) + y^2 / (2 R_y) on a rectangle with round corners. All lengths scale with
the sensor's shorter side, all edges that press are rounded, and each object follows from its seed alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from manifold3d import Manifold, OpType

EDGE_MM = 0.25          # radius of the rounded lower edges: a sharp one puts an infinite pressure on a soft layer
_SIDE_MM = 22.0         # shorter side of the sensor that the lengths below are for
_FACE_MM = 4.0          # from the pressing face to the plate, which must not touch
_PLATE_MM = 3.0
_OVERLAP_MM = 0.5       # that a feature reaches into the plate
_EDGE_STEPS = 3         # straight pieces of a rounded edge, seen from the side
_CORNER_STEPS = 6       # of a round corner, seen from above
_CAP_POINTS = 13        # along each side of a cap
_LENGTH, _WIDTH, _GAP = (7.0, 12.0), (3.0, 5.0), (1.5, 3.0)     # mm, of a feature and between two
_TURN_DEG = 30.0
_CAP_SIDE, _CAP_RADIUS = (11.0, 17.0), (35.0, 150.0)     # mm


@dataclass(frozen=True)
class Feature:
    """A convex part of an object, from its lower face up to the plate."""

    x_mm: float
    """Centre of its lower face."""
    y_mm: float
    length_mm: float
    """Along x before the object is turned."""
    width_mm: float
    """Along y."""
    lift_mm: float
    """Height of its lower face over the object's lowest point."""
    radius_mm: tuple[float, float] | None = None
    """Radii of curvature of its lower face along x and y; None: it is flat."""


@dataclass(frozen=True)
class GeneratedObject:
    """A rigid object, lowest point at z = 0, with the plate above."""

    name: str
    """In paths."""
    step_mm: float
    """By how much its lower feature stands back; 0 of a smooth object."""
    turn_deg: float
    """Of the whole about z."""
    features: tuple[Feature, ...]
    """Its parts; of a stepped object one has the lift `step_mm`, the others none."""

    @property
    def stepped(self) -> bool:
        """Whether it has a lower feature."""
        return self.step_mm > 0

    def solid(self, *, edge_length_mm: float | None = None) -> Manifold:
        """The solid; edge_length_mm: longest edge of its facets, which are split without moving the surface."""
        parts = [Manifold.hull_points(_points(feature)) for feature in self.features]
        whole = Manifold.batch_boolean([*parts, _plate(self.features)], OpType.Add).rotate((0.0, 0.0, self.turn_deg))
        return whole if edge_length_mm is None else whole.refine_to_length(edge_length_mm)

    def mesh(self, *, edge_length_mm: float | None = None) -> trimesh.Trimesh:
        """`solid` as a mesh in mm."""
        found = self.solid(edge_length_mm=edge_length_mm).to_mesh()
        return trimesh.Trimesh(found.vert_properties[:, :3], found.tri_verts, process=True)


def draw_objects(smooth: int, stepped: int, *, steps_mm: Sequence[float], side_mm: float, seed: int) -> list[GeneratedObject]:
    """So many objects of each kind for a sensor with the shorter side `side_mm`; the same seed gives the same ones.

    steps_mm: [least, most] height of a step: those of the stepped objects are spread evenly over it
    """
    least, most = steps_mm
    steps = np.linspace(least, most, stepped) if stepped > 1 else np.full(stepped, 0.5 * (least + most))
    return [*(draw_cap(f"smooth_{k + 1:02d}", side_mm=side_mm, seed=[seed, 0, k]) for k in range(smooth)),
            *(draw_stepped(f"stepped_{k + 1:02d}", float(np.round(step, 3)), side_mm=side_mm, seed=[seed, 1, k])
              for k, step in enumerate(steps))]


def draw_cap(name: str, *, side_mm: float, seed: Sequence[int]) -> GeneratedObject:
    """A smooth object: one convex cap."""
    rng, scale = np.random.default_rng(seed), side_mm / _SIDE_MM
    length, width = (scale * rng.uniform(*_CAP_SIDE, 2)).round(2)
    least, most = np.log(_CAP_RADIUS)
    radii = (scale * np.exp(rng.uniform(least, most, 2))).round(1)
    turn = round(float(rng.uniform(-_TURN_DEG, _TURN_DEG)), 1)
    cap = Feature(0.0, 0.0, float(length), float(width), 0.0, (float(radii[0]), float(radii[1])))
    return GeneratedObject(name, 0.0, turn, (cap,))


def draw_stepped(name: str, step_mm: float, *, side_mm: float, seed: Sequence[int]) -> GeneratedObject:
    """A stepped object: three flat features side by side along y, one of them by `step_mm` higher."""
    rng, scale = np.random.default_rng(seed), side_mm / _SIDE_MM
    lengths, widths, gaps = ((scale * rng.uniform(*limits, count)).round(2) for limits, count in
                             ((_LENGTH, 3), (_WIDTH, 3), (_GAP, 2)))
    turn, low = round(float(rng.uniform(-_TURN_DEG, _TURN_DEG)), 1), int(rng.integers(3))
    ends = np.concatenate([[0.0], np.cumsum(widths[:-1] + gaps)])
    middles = ends + widths / 2 - 0.5 * (ends[-1] + widths[-1])
    return GeneratedObject(name, step_mm, turn, tuple(
        Feature(0.0, float(y), float(length), float(width), step_mm if k == low else 0.0)
        for k, (y, length, width) in enumerate(zip(middles, lengths, widths, strict=True))))


def _points(feature):
    """Points (n, 3) whose convex hull is the feature."""
    return _cap_points(feature) if feature.radius_mm else _flat_points(feature)


def _flat_points(feature):
    """Of a flat feature: a rectangle with round corners, and with a rounded lower edge."""
    corner = min(0.5, 0.25 * min(feature.length_mm, feature.width_mm))
    edge = min(EDGE_MM, 0.5 * corner)
    angle = np.linspace(0, np.pi / 2, _EDGE_STEPS + 1)
    rings = [(corner - edge + edge * np.sin(a), edge - edge * np.cos(a)) for a in angle]
    rings.append((corner, _FACE_MM + _OVERLAP_MM - feature.lift_mm))
    return np.concatenate([_outline(feature, corner, radius, feature.lift_mm + z) for radius, z in rings])


def _outline(feature, corner, radius, z):
    """A rectangle's outline (n, 3) at the height z: circles of `radius` about the centres of its corners."""
    around = np.linspace(0, 2 * np.pi, 4 * _CORNER_STEPS, endpoint=False)
    x, y = 0.5 * feature.length_mm - corner, 0.5 * feature.width_mm - corner
    points = [np.column_stack([sx * x + radius * np.cos(around), sy * y + radius * np.sin(around)])
              for sx in (-1, 1) for sy in (-1, 1)]
    flat = np.concatenate(points) + [feature.x_mm, feature.y_mm]
    return np.column_stack([flat, np.full(len(flat), z)])


def _cap_points(feature):
    """Of a cap: its curved lower face, and the same outline below the plate."""
    half = np.linspace(-0.5, 0.5, _CAP_POINTS)
    x, y = (grid.ravel() for grid in np.meshgrid(feature.length_mm * half, feature.width_mm * half))
    inside = (np.abs(x) / (0.5 * feature.length_mm))**4 + (np.abs(y) / (0.5 * feature.width_mm))**4 <= 1 + 1e-9
    x, y = x[inside], y[inside]
    z = x**2 / (2 * feature.radius_mm[0]) + y**2 / (2 * feature.radius_mm[1])
    place = [feature.x_mm, feature.y_mm, feature.lift_mm]
    top = np.full(len(x), max(_FACE_MM, float(z.max())) + _OVERLAP_MM)
    return np.concatenate([np.column_stack([x, y, z]), np.column_stack([x, y, top])]) + place


def _plate(features):
    """A box that covers all features, above their faces."""
    low = np.min([[f.x_mm - 0.5 * f.length_mm, f.y_mm - 0.5 * f.width_mm] for f in features], axis=0)
    high = np.max([[f.x_mm + 0.5 * f.length_mm, f.y_mm + 0.5 * f.width_mm] for f in features], axis=0)
    base = max([_FACE_MM, *(_points(f)[:, 2].max() - _OVERLAP_MM for f in features if f.radius_mm)])
    return Manifold.cube((*(high - low + 0.2), _PLATE_MM)).translate((*(low - 0.1), float(base)))


def object_of_values(values: dict[str, Any]) -> GeneratedObject:
    """The object of the plain values that `dataclasses.asdict` makes of one."""
    features = (Feature(**{**one, "radius_mm": tuple(one["radius_mm"]) if one["radius_mm"] else None})
                for one in values["features"])
    return GeneratedObject(**{**values, "features": tuple(features)})
