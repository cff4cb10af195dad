"""What the points face after a step that is longer than a step may be."""

from types import SimpleNamespace

import numpy as np
import pytest

from softtact.models.hyperelastic.newton_step import StepContact


class OneNode:
    """A slab of one node, whose points lie under an edge where it has moved along x by more than `edge_mm`."""

    unknowns = np.arange(3)

    def __init__(self, edge_mm):
        self.edge_mm, self.faced = edge_mm, None

    def project(self, displacement, surface, indentation):
        overrun = np.array([displacement[0, 0] > self.edge_mm])
        return SimpleNamespace(at=(displacement[0, 0], indentation), overrun=overrun)

    def linear_gaps(self, displacement, projection, indentation, history):
        self.faced = projection.at


@pytest.mark.parametrize(("edge_mm", "faced"), [(0.5, (0.12, 0.03)), (2.0, (1.2, 0.3))], ids=["under an edge", "beside it"])
def test_a_step_that_is_cut_before_it_runs_under_an_edge_faces_what_lies_where_it_is_cut(edge_mm, faced):
    state = SimpleNamespace(projection=SimpleNamespace(at=None), displacement=np.zeros((1, 3)), history=None)
    slab = OneNode(edge_mm)
    contact = StepContact(slab, state, 0.0, "any surface", largest_mm=0.12)
    assert contact.follow(np.array([1.2, 0.0, 0.0]), 0.3)
    assert slab.faced == pytest.approx(faced)
