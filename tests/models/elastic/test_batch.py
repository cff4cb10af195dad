"""The elastic surface on a torch device: what it does to forces at all nodes is what the compliance's own matrix does."""

import numpy as np
import pytest
import torch
from support.sensors import CORO

from softtact.models.elastic.batch import DeviceSurface
from softtact.models.elastic.compliance import elastic_compliance


@pytest.fixture(scope="module", params=[(13, 13), (9, 17)])
def compliance(request):
    sides = tuple(0.6 * (count - 1) for count in request.param[::-1])
    return elastic_compliance(CORO.model_copy(update={"footprint_mm": sides, "map_shape": request.param}))


def forces_on(grid):
    return np.random.default_rng(1).standard_normal((grid.count, 3))


def test_displacements_are_those_of_the_dense_compliance(compliance):
    nodes = np.arange(compliance.grid.count)
    places, force = compliance.grid.quarter(nodes), forces_on(compliance.grid)
    expected = compliance.blocks.between(*places, *places).astype(float) @ force
    surface = DeviceSurface(compliance, "cpu")
    scale = np.abs(expected).max()
    # the dense matrix is rounded to single precision once more, when four blocks are added
    np.testing.assert_allclose(surface.double(torch.as_tensor(force)).numpy(), expected, rtol=0, atol=1e-6 * scale)
    np.testing.assert_allclose(surface.single(torch.as_tensor(force).float()).numpy(), expected, rtol=0, atol=1e-5 * scale)


def test_the_preconditioner_is_the_compliances_stencil(compliance):
    force = forces_on(compliance.grid).astype(np.float32)
    expected = compliance.stencil.on(compliance.grid, np.arange(compliance.grid.count))(force)
    got = DeviceSurface(compliance, "cpu").precondition(torch.as_tensor(force)).numpy()
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-5 * np.abs(expected).max())
