"""Conversion of linear elements to quadratic ones by nodes at the centres of edges, quadrilateral faces and hexahedra, and back."""

from collections.abc import Iterable, Sequence

import numpy as np
import scipy.sparse as sp

from softtact.fem.elements import HEX27, QUAD9, TET10, TRI6, WEDGE18, Element

QUADRATIC = {"tetra": TET10, "hexahedron": HEX27, "wedge": WEDGE18, "triangle": TRI6, "quad": QUAD9}
_LINEAR = {element.meshio_name: kind for kind, element in QUADRATIC.items()}


def raised(points: np.ndarray, cells: Sequence[tuple[str, np.ndarray]]) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Quadratic elements of linear cells [(meshio's name, corners (e, c))] at points (n, 3).

    Returns points (n', 3), nodes (e, m) of each of the cells, and the new number (n,) of each old point, -1 where no cell uses it.
    A new node is at the mean of the corners of its edge, face or element.
    """
    members = [_members(kind) for kind, _ in cells]
    width = max(int(mask.sum(axis=1).max()) for mask in members)
    keys = [_keys(corners, mask, width) for (_, corners), mask in zip(cells, members, strict=True)]
    between, place = np.unique(np.concatenate([key.reshape(-1, width) for key in keys]), axis=0, return_inverse=True)
    there = between >= 0
    new = np.where(there[..., None], points[between], 0.0).sum(axis=1) / there.sum(axis=1)[:, None]
    nodes, start = [], 0
    for key in keys:
        count = key.shape[0] * key.shape[1]
        nodes.append(place.ravel()[start:start + count].reshape(key.shape[:2]))
        start += count
    corner = np.flatnonzero(there.sum(axis=1) == 1)
    number = np.full(len(points), -1)
    number[between[corner, -1]] = corner
    return new, nodes, number


def shares_of_corners(count: int, parts: Iterable[tuple[Element, np.ndarray]]) -> sp.csr_matrix | None:
    """Matrix (count, count) that interpolates nodal values from the corners of elements [(element, nodes (e, m))].

    A node takes the mean of the corners of its edge, face or element; a corner keeps its value; rows of other nodes are empty.
    None for elements such as HEX20 that have faces without a centre node.
    """
    rows, columns, values = [np.empty(0, int)], [np.empty(0, int)], [np.empty(0)]
    known = np.zeros(count, dtype=bool)
    for element, nodes in parts:
        if element.meshio_name not in _LINEAR:
            return None
        kind = _LINEAR[element.meshio_name]
        members, corners = _members(kind), nodes[:, element.vtk_order[:element.corners]]
        new, first = np.unique(nodes, return_index=True)
        first = first[~known[new]]     # each node once, also if several elements share it
        known[new] = True
        at, member = members.shape[0], members[first % members.shape[0]]
        element_corners = corners[first // at]
        rows.append(np.repeat(nodes.ravel()[first], member.sum(axis=1)))
        columns.append(element_corners[member])
        values.append((member / member.sum(axis=1, keepdims=True))[member])
    return sp.csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(count, count))


def _keys(corners, members, width):
    """The corners (e, m, width) of the edge, face or element of each node, in rising order after entries of -1."""
    keys = np.sort(np.where(members[None], corners[:, None, :], -1), axis=2)[..., -width:]
    return np.pad(keys, ((0, 0), (0, 0), (width - keys.shape[2], 0)), constant_values=-1)


def _members(kind: str) -> np.ndarray:
    """Which corners (m, c) span the smallest face of the cell that holds each node of its quadratic element."""
    element = QUADRATIC[kind]
    sides = _sides(element)
    corners = sides[element.vtk_order[:element.corners]]
    on_side = np.isclose(sides, 0)                                   # (m, s)
    return (np.isclose(corners, 0)[None] | ~on_side[:, None]).all(axis=2)


def _sides(element: Element) -> np.ndarray:
    """Linear functions (m, s) of the element's nodes, each zero on one of its sides."""
    x = element.nodes
    if element is WEDGE18:
        return np.column_stack([x[:, :2], 1 - x[:, 0] - x[:, 1], 1 + x[:, 2], 1 - x[:, 2]])
    if element in (TET10, TRI6):
        return np.column_stack([x, 1 - x.sum(axis=1)])
    return np.column_stack([1 + x, 1 - x])
