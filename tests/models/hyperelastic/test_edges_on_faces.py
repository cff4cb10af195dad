"""The hyperelastic press feels a punch's edge where it is, wherever it crosses an element of the cover."""

import numpy as np
import pytest
import trimesh
from support.laws import LAWS
from support.sensors import CORO

from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.sensor import Sensor

SMALL = CORO.model_copy(update={"footprint_mm": (4.8, 4.8), "map_shape": (17, 17)})      # 4 x 4 frusta
LAYERS = {"cover_heights": (0.0, 0.45, 0.8, 1.0), "frustum_heights": (0.0, 0.35, 1.0)}
COARSE = MeshSettings(cover_splits=(1, 1, 2), **LAYERS)      # elements of 0.3 mm at the edge
FINE = MeshSettings(cover_splits=(1, 1, 4), **LAYERS)        # of 0.075 mm


def pressed(mesh, half_width):
    punch = trimesh.creation.box((2 * half_width, 2 * half_width, 2.0), trimesh.transformations.translation_matrix((0, 0, 1)))
    return Sensor(SMALL, LAWS, mesh=mesh).press(punch, force_n=0.6, model="hyperelastic")


@pytest.mark.parametrize("half_width", [1.26, 1.35, 1.44])
def test_an_edge_is_felt_where_it_is_wherever_it_crosses_an_element(half_width):
    """The finer mesh's own error is a quarter of the coarse one's. Held or free as a whole, rows of points are off by 6 to 8 %."""
    coarse, fine = pressed(COARSE, half_width), pressed(FINE, half_width)
    difference, largest = coarse.deformation_map_mm[0] - fine.deformation_map_mm[0], fine.deformation_map_mm.max()
    assert coarse.indentation_mm[0] == pytest.approx(fine.indentation_mm[0], rel=0.015)
    assert np.abs(difference).max() < 0.015 * largest


@pytest.mark.slow
def test_the_indentation_falls_evenly_as_a_punch_gets_wider():
    """Without soft edges it stayed for half an element and then fell by a tenth."""
    indentation = np.array([pressed(COARSE, half).indentation_mm[0] for half in np.linspace(1.24, 1.48, 7)])
    falls = -np.diff(np.log(indentation))
    assert (falls > 0.5 * falls.mean()).all() and (falls < 1.6 * falls.mean()).all()
