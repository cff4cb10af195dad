"""Cuts of irregular graphs: as few nodes as can be, and nothing joins the two sides."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.spatial import Delaunay

from softtact.linalg.symbolic import dissect, lay_out, least_cover, shortened


@pytest.fixture(scope="module")
def cloud():
    """Points at random in a box, and the pattern of the edges of their tetrahedra, both directions and each point with itself."""
    points = np.random.default_rng(2).random((1500, 3))
    corners = Delaunay(points).simplices
    pairs = np.concatenate([corners[:, [i, j]] for i in range(4) for j in range(4)])
    graph = sp.csr_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    graph.data[:] = 1.0
    return points, graph


def joined(graph, side):
    return graph[side < 0][:, side > 0].nnz


def test_a_cover_touches_every_edge_with_as_many_nodes_as_edges_that_share_none(cloud):
    points, graph = cloud
    beyond = points[:, 0] > 0.4
    side = least_cover(graph, beyond)
    assert not joined(graph, side)
    assert np.array_equal(side[side != 0] > 0, beyond[side != 0])
    # No cover has fewer nodes than there are edges without a common node; Koenig 1931: one has as many.
    pairs = maximum_bipartite_matching(graph[~beyond][:, beyond].tocsr(), perm_type="column")
    assert np.count_nonzero(side == 0) == np.count_nonzero(pairs >= 0)


def test_a_cut_is_shortened_and_its_sides_stay_apart_and_alike(cloud):
    points, graph = cloud
    near = points[:, 0] <= 0.5
    layer = near & (graph @ (~near).astype(float) > 0)
    plane = np.where(layer, 0, np.where(near, -1, 1))

    def cost(side):
        return np.count_nonzero(side == 0) + (0 if abs(side.sum()) < 0.2 * len(side) else np.inf)

    assert not joined(graph, plane)
    found = shortened(graph, plane, cost)
    assert not joined(graph, found)
    assert cost(found) < 0.8 * cost(plane)


def test_a_body_of_irregular_tetrahedra_is_dissected_with_a_fifth_less_operations_than_by_planes(cloud, monkeypatch):
    points, graph = cloud
    upper = sp.triu(graph, format="csr")
    upper.sort_indices()
    monkeypatch.setattr("softtact.linalg.symbolic._SMALLEST", 20)     # whole parts of 200 would outweigh all cuts

    def operations():
        fronts, _ = lay_out(upper.indptr, upper.indices, dissect(upper.indptr, upper.indices, points))
        pivots, boundary = np.diff(fronts.pivot_at).astype(float), np.diff(fronts.boundary_at)
        return np.sum(pivots**3 / 3 + pivots**2 * boundary + pivots * boundary**2)

    with monkeypatch.context() as patched:
        patched.setattr("softtact.linalg.symbolic.shortened", lambda graph, side, cost: side)
        plane = operations()
    assert operations() < 0.8 * plane     # the larger the body, the more: 0.4 of a ball of 49,000 unknowns
