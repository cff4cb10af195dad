"""The preconditioner's stencil is the whole top's stiffness about its middle, though it is computed from the nodes around alone."""

import numpy as np
import pytest

from softtact import load_sensor
from softtact.models.elastic import compliance


def test_the_stencil_from_the_nodes_around_is_that_from_all_nodes(monkeypatch):
    layer = compliance.elastic_compliance(load_sensor("coro").spec, cells=(12, 16))
    shape = tuple(count // 2 + 1 for count in layer.grid.shape)
    monkeypatch.setattr(compliance, "_MARGIN", max(shape))
    from_all = compliance._stencil(layer.blocks.blocks, shape).values
    # Nodes more than eight away change it by less than 1e-6; single precision adds as much.
    assert layer.stencil.values == pytest.approx(from_all, abs=3e-6 * np.abs(from_all).max())
