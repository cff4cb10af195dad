"""A sensor's layers as a solid on frusta, under a rigid object that is pressed, twisted and rolled."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.frustum_laws import made_up

import softtact
from softtact.errors import InputError
from softtact.models.solid.frusta import FrustumItem
from softtact.press.solid_pad import SolidPad


@pytest.mark.parametrize("fine", [None, np.array([[-3.0, -2.0], [3.0, 2.0]])], ids=["even", "finer"])
def test_every_frustum_stands_below_the_sheet_once_and_follows_its_mean_descent(fine):
    sensor = replace(softtact.load_sensor("coro"), prepared_models={"frustum": made_up()})
    pad = SolidPad(sensor, fine=fine)
    body = pad.with_rigid(trimesh.creation.box((4, 4, 4)), threads=1)
    frusta = [item for item in body.items if isinstance(item, FrustumItem)]
    assert sum(len(item.nodes) for item in frusta) == 18 * 30 and (len(frusta) > 1) == (fine is not None)
    down = np.zeros_like(body.points)
    down[:, 2] = -0.1 - 0.01 * body.points[:, 0]
    for item in frusta:
        middle = 0.5 * (body.points[item.nodes].min(axis=1) + body.points[item.nodes].max(axis=1))
        np.testing.assert_allclose(item.compressions(down), 0.1 + 0.01 * middle[:, 0], atol=1e-12)


def test_an_object_beside_the_sensor_is_refused():
    sensor = softtact.load_sensor("pad4x4")
    far = trimesh.creation.box((1, 1, 1)).apply_translation((30, 0, 0))
    with pytest.raises(InputError, match="nothing of it is over the 10 x 16 mm footprint"):
        SolidPad(sensor).with_rigid(far, threads=1)
