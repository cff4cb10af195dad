"""Meshes of 20-node hexahedra made by lifting a plan of 8-node quadrilaterals through levels of height."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PlanMesh:
    """points (n, 2), of which the first `corners` are element corners; quads (q, 8): corners, then mid-sides."""

    points: np.ndarray
    quads: np.ndarray
    corners: int


@dataclass(frozen=True)
class HexMesh:
    """points (n, 3) in mm; hexes (e, 20), layer by layer from below; `planes` (levels, plan points): node numbers."""

    points: np.ndarray
    hexes: np.ndarray
    planes: np.ndarray

    @property
    def layers(self):
        """Number of element layers."""
        return len(self.planes) - 1

    def layer(self, index):
        """Hexes of one layer (q, 20)."""
        return self.hexes.reshape(self.layers, -1, 20)[index]


def extrude(plan, levels, *, scale=None):
    """Lift a plan mesh through `levels` (increasing z in mm); `scale(z)` multiplies the plan's coordinates."""
    levels = np.asarray(levels, dtype=float)
    scale = scale or (lambda z: 1.0)
    middles = 0.5 * (levels[:-1] + levels[1:])

    def lifted(points, z):
        return np.column_stack([points * scale(z), np.full(len(points), z)])

    count = len(plan.points)
    planes = np.arange(len(levels) * count).reshape(len(levels), count)
    between = planes.size + np.arange(len(middles) * plan.corners).reshape(len(middles), plan.corners)
    points = np.vstack([lifted(plan.points, z) for z in levels]
                       + [lifted(plan.points[: plan.corners], z) for z in middles])
    corners, mids = plan.quads[:, :4], plan.quads[:, 4:]
    hexes = [np.hstack([low[corners], high[corners], low[mids], high[mids], edge[corners]])
             for low, high, edge in zip(planes[:-1], planes[1:], between, strict=True)]
    return HexMesh(points=points, hexes=np.vstack(hexes), planes=planes)


def grid_plan(x_lines, y_lines):
    """Rectangles between grid lines (increasing, mm), numbered x fastest."""
    nx, ny = len(x_lines), len(y_lines)
    corner = np.arange(nx * ny).reshape(ny, nx)
    along_x = nx * ny + np.arange((nx - 1) * ny).reshape(ny, nx - 1)
    along_y = nx * ny + (nx - 1) * ny + np.arange(nx * (ny - 1)).reshape(ny - 1, nx)
    xm, ym = 0.5 * (x_lines[:-1] + x_lines[1:]), 0.5 * (y_lines[:-1] + y_lines[1:])

    def points(x, y):
        gx, gy = np.meshgrid(x, y)
        return np.column_stack([gx.ravel(), gy.ravel()])

    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1],
                      along_x[:-1], along_y[:, 1:], along_x[1:], along_y[:, :-1]], axis=-1).reshape(-1, 8)
    return PlanMesh(np.vstack([points(x_lines, y_lines), points(xm, y_lines), points(x_lines, ym)]), quads, nx * ny)


# A quadratic arc over 90 degrees encloses 1.2 % too little; corners moved out to this radius make the disc's
# area exactly pi while the mid-side nodes stay on the unit circle: 8/3 sqrt(2) c - 2/3 c^2 = pi.
DISC_CORNER_RADIUS = (8 * np.sqrt(2) - np.sqrt(128 - 24 * np.pi)) / 4
_CORE_RADIUS = 0.5   # of the inner square's corners: all five quads of similar size


def disc_plan():
    """Unit disc as an O-grid of five quads; the outer mid-side nodes lie at 0, 90, 180 and 270 degrees."""
    diagonal = np.deg2rad([-45, 45, 135, 225])
    axis = np.deg2rad([0, 90, 180, 270])

    def ring(radius, angles):
        return radius * np.column_stack([np.cos(angles), np.sin(angles)])

    inner, outer = ring(_CORE_RADIUS, diagonal), ring(DISC_CORNER_RADIUS, diagonal)
    inner_mid = ring(0.5 * (_CORE_RADIUS * np.cos(np.pi / 4) + 0.5 * _CORE_RADIUS), axis)
    points = np.vstack([inner, outer, inner_mid, ring(1.0, axis), 0.5 * (inner + outer)])
    quads = [[3, 0, 1, 2, 11, 8, 9, 10]]
    for k in range(4):   # the ring quad around the direction of `axis[k]`; its outer side is the side xi = 1
        n = (k + 1) % 4
        quads.append([k, 4 + k, 4 + n, n, 16 + k, 12 + k, 16 + n, 8 + k])
    return PlanMesh(points, np.array(quads), 8)
