"""Fields of a solid's state at its nodes: volume ratio, von Mises stress, contact pressure."""

import numpy as np

from softtact.contact.pair import ContactPair, PairHistory, PairState
from softtact.fem.elements import Element
from softtact.fem.solid_mesh import ELEMENTS, SolidMesh
from softtact.models.solid.body import SolidBody, SolidState

_VOIGT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


def nodal_fields(body: SolidBody, state: SolidState) -> tuple[np.ndarray, np.ndarray]:
    """Volume ratio J and von Mises stress of the Cauchy stress in MPa at the mesh's nodes (n,); nan where no element is.

    In each element the values at the points of quadrature are fitted by a linear function, which gives those at its nodes; a node
    has the mean of its elements, by their volumes.
    """
    n = len(body.mesh.points)
    sums, weights = np.zeros((2, n)), np.zeros(n)
    for element, (_, nodes, block) in zip(_elements(body.mesh), body.blocks, strict=True):
        deformed = block.loops.deformation(state.displacement[nodes], block.at_rest)
        S = block.law.isochoric(deformed.C, tangent=False).stress[:, _VOIGT].reshape(deformed.F.shape)
        cauchy = np.einsum("egik,egkl,egjl->egij", deformed.F, S, deformed.F, optimize=True) / deformed.J[..., None, None]
        mean = np.trace(cauchy, axis1=2, axis2=3) / 3
        deviator = cauchy - mean[..., None, None] * np.eye(3)     # the stress of U(J) is hydrostatic: no part of it
        mises = np.sqrt(1.5 * (deviator**2).sum(axis=(2, 3)))
        to_nodes = _linear_fit(element, block.at_rest.volumes.shape[1])
        volume = np.repeat(block.at_rest.volumes.sum(axis=1)[block.at_rest.shapes], nodes.shape[1])
        weights += np.bincount(nodes.ravel(), volume, n)
        for own, values in zip(sums, (deformed.J, mises), strict=True):
            own += np.bincount(nodes.ravel(), volume * (values @ to_nodes.T).ravel(), n)
    J, mises = np.where(weights > 0, sums / np.where(weights > 0, weights, 1.0), np.nan)
    return J, np.maximum(mises, 0.0)      # an extrapolation may fall below


def _elements(mesh: SolidMesh) -> list[Element]:
    return [ELEMENTS[kind] for _, kind, nodes in mesh.cells if len(nodes)]


def _linear_fit(element: Element, points: int) -> np.ndarray:
    """Matrix (m, g) that takes values at the points of the rule of so many points to the nodes."""
    rule = next(rule for rule in (element.quadrature, element.reduced) if rule is not None and len(rule.weights) == points)
    return _linear(element.nodes) @ np.linalg.pinv(_linear(rule.points))


def _linear(x):
    return np.column_stack([np.ones(len(x)), x])


def pressure_at_nodes(pair: ContactPair, history: PairHistory, state: PairState, count: int) -> np.ndarray:
    """Contact pressure of a pair in MPa, per area at rest, at `count` nodes: 0 where its surface is open, nan off the surface.

    A node has the mean of the points around it, by their areas and its shape function at them.
    """
    points = history.points
    there = points.nodes >= 0
    weight = np.where(there, np.abs(points.values[:, :points.nodes.shape[1]]), 0.0) * points.weight[:, None]
    total = np.bincount(points.nodes[there], weight[there], count)
    sums = np.bincount(points.nodes[there], (weight * state.pressure[:, None])[there], count)
    out = np.full(count, np.nan)
    own = pair.surface.used[pair.surface.used < count]
    out[own] = sums[own] / np.where(total[own] > 0, total[own], 1.0)
    return out
