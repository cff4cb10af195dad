"""Structured meshes of simple bodies: boxes, plates, rings, cylinders and spheres of full quadratic elements; heights of layers."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from softtact.errors import InputError
from softtact.fem.elements import HEX27, QUAD9, TET10
from softtact.fem.solid_mesh import Facets, SolidMesh, thickness_of


def box(
    low: Sequence[float],
    high: Sequence[float],
    divisions: Sequence[int],
    *,
    region: str = "body",
    grading: Sequence | None = None,
    geometry: str | None = None,
    thickness_mm: float | None = None,
) -> SolidMesh:
    """A box (three numbers each) of HEX27, or a rectangle (two numbers each) of QUAD9, with faces x0, x1, y0, y1 (, z0, z1).

    low, high: opposite corners in mm;  divisions: elements along each side;  grading: for each side None, or the elements' ends as
    rising shares from 0 to 1;  geometry, thickness_mm: of a rectangle, plane_strain (by default) or axisymmetric
    Raises InputError for sizes, divisions and grading that make no box, and options that have no effect on it.
    """
    d = len(low)
    kind = geometry or ("solid" if d == 3 else "plane_strain")
    lines = [_line("xyz"[i], low[i], high[i], divisions[i], grading[i] if grading else None) for i in range(d)]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, d)
    sizes = [len(line) for line in lines]
    numbers = np.arange(len(grid)).reshape(sizes)
    element = HEX27 if d == 3 else QUAD9
    offsets = (element.nodes + 1).round().astype(int)  # 0, 1, 2 along each side
    first = np.stack(np.meshgrid(*[2 * np.arange(n) for n in divisions], indexing="ij"), axis=-1).reshape(-1, 1, d)
    cells = numbers[tuple(np.moveaxis(first + offsets, -1, 0))]
    points = np.column_stack([grid, np.zeros((len(grid), 3 - d))])
    mesh = SolidMesh(points, ((region, element.meshio_name, cells),), geometry=kind, thickness_mm=thickness_of(kind, thickness_mm))
    tolerance = 1e-9 * max(h - l for l, h in zip(low, high, strict=True))
    rules = {}
    for i, axis in enumerate("xyz"[:d]):
        for end, value in enumerate((low[i], high[i])):
            rules[f"{axis}{end}"] = lambda x, i=i, value=value: np.abs(x[:, i] - value) < tolerance
    return mesh.with_faces(**rules)


def _line(axis, low, high, count, shares):
    """Nodes along an axis of `count` quadratic elements between two places."""
    if not (low < high and np.isfinite([low, high]).all()):
        raise InputError(f"A box cannot go from {low:g} to {high:g} mm along {axis}; give finite numbers, the lower one first.")
    if not (count >= 1 and count == int(count)):
        raise InputError(f"A box cannot have {count} divisions along {axis}; give a whole number from 1 on.")
    shares = np.linspace(0, 1, count + 1) if shares is None else np.asarray(shares, float)
    if len(shares) != count + 1 or not (np.diff(shares) > 0).all() or not np.allclose(shares[[0, -1]], [0, 1]):
        raise InputError(f"The grading along {axis} does not fit {count} divisions; give {count + 1} rising shares from 0 to 1.")
    ends = low + (high - low) * shares
    out = np.empty(2 * count + 1)
    out[::2], out[1::2] = ends, 0.5 * (ends[1:] + ends[:-1])
    return out


def square_to_disc(xy: np.ndarray) -> np.ndarray:
    """Map points (n, 2) of the square [-1, 1]^2 to the unit disc, its sides to the circle.

    Elliptical grid mapping: smooth; the four corners are mapped to the circle's diagonals. (Nowell; Fong, arXiv:1509.06344.)
    """
    x, y = xy.T
    return np.column_stack([x * np.sqrt(1 - 0.5 * y * y), y * np.sqrt(1 - 0.5 * x * x)])


def cylinder(
    radius_mm: float, height_mm: float, divisions: tuple[int, int], *, region: str = "body", grading: Sequence | None = None
) -> SolidMesh:
    """A cylinder around z from z = 0 up, of HEX27, with the faces side, z0 and z1.

    divisions: elements across the diameter and along the height;  grading: of the height, see `box`
    """
    if not 0 < radius_mm < np.inf:
        raise InputError(f"A cylinder cannot have the radius {radius_mm:g} mm; give a positive number.")
    mesh = box(
        (-1, -1, 0), (1, 1, height_mm), (divisions[0], divisions[0], divisions[1]), region=region, grading=(None, None, grading)
    )

    def transform(points):
        return np.column_stack([radius_mm * square_to_disc(points[:, :2]), points[:, 2]])

    side = {kind: np.concatenate([mesh.faces[name][kind] for name in ("x0", "x1", "y0", "y1")]) for kind in mesh.faces["x0"]}
    whole = mesh.moved(transform)
    return SolidMesh(whole.points, whole.cells, {"side": side, "z0": mesh.faces["z0"], "z1": mesh.faces["z1"]})


def in_tetrahedra(mesh: SolidMesh) -> SolidMesh:
    """A mesh of hexahedra HEX27 with each one cut into six quadratic tetrahedra on the same nodes; faces keep their names.

    The diagonals run from each element's first corner to the opposite one (Kuhn), so that neighbours conform in meshes made
    from a grid. Raises InputError for other elements.
    """
    if other := [kind for _, kind, _ in mesh.cells if kind != HEX27.meshio_name]:
        raise InputError(f"Elements {other[0]!r} cannot be cut into tetrahedra; give a mesh of {HEX27.meshio_name!r}.")
    cells = tuple((region, TET10.meshio_name, nodes[:, _kuhn()].reshape(-1, 10)) for region, _, nodes in mesh.cells)
    whole = replace(mesh, cells=cells, faces={})
    return replace(whole, faces={name: _facets_within(whole.boundary, face) for name, face in mesh.faces.items()})


def _kuhn() -> np.ndarray:
    """Local nodes (6, 10) of HEX27 that are the nodes of its six tetrahedra."""
    number = {tuple(place): k for k, place in enumerate((HEX27.nodes + 1).round().astype(int).tolist())}
    shares = np.column_stack([1 - TET10.nodes.sum(axis=1), TET10.nodes])      # of the four corners at the ten nodes
    out = []
    for order in permutations(range(3)):
        corners = np.vstack([np.zeros(3), np.cumsum(2 * np.eye(3)[list(order)], axis=0)])
        if np.linalg.det(corners[1:]) < 0:
            corners[[1, 2]] = corners[[2, 1]]
        out.append([number[tuple(place)] for place in (shares @ corners).round().astype(int).tolist()])
    return np.array(out)


def _facets_within(boundary: Facets, face: Facets) -> Facets:
    """The facets of a boundary all of whose nodes belong to a face."""
    of_face = np.unique(np.concatenate([nodes.ravel() for nodes in face.values()]))
    found = {kind: nodes[np.isin(nodes, of_face).all(axis=1)] for kind, nodes in boundary.items()}
    return {kind: nodes for kind, nodes in found.items() if len(nodes)}


def mirrored(mesh: SolidMesh, axis: int) -> SolidMesh:
    """The mesh mirrored at the plane through the origin normal to an axis (0, 1, 2); faces keep their names."""
    sign = np.ones(3)
    sign[axis] = -1.0
    cells = []
    for region, element, nodes in mesh.parts():
        exchanged = element.nodes[:, [1, 0, 2][:element.nodes.shape[1]]]      # swapped parent coordinates reverse the orientation
        order = np.abs(element.nodes[:, None] - exchanged[None]).sum(axis=2).argmin(axis=1)
        cells.append((region, element.meshio_name, nodes[:, order]))
    whole = replace(mesh, points=mesh.points * sign, cells=tuple(cells), faces={})
    return replace(whole, faces={name: _facets_within(whole.boundary, face) for name, face in mesh.faces.items()})


def with_level(levels: np.ndarray, level: float) -> np.ndarray:
    """Rising levels (n,) in mm that contain `level`: the nearest level is moved to it, or, where that is an end, it is inserted.

    Unchanged if `level` is not between the first and the last.
    """
    levels = np.asarray(levels, dtype=float)
    if not levels[0] + 1e-9 < level < levels[-1] - 1e-9 or np.abs(levels - level).min() < 1e-9:
        return levels
    above = int(np.searchsorted(levels, level))
    nearest = above if levels[above] - level < level - levels[above - 1] else above - 1
    if 0 < nearest < len(levels) - 1:
        return np.concatenate([levels[:nearest], [level], levels[nearest + 1:]])
    return np.insert(levels, above, level)
