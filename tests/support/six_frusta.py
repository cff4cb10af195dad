"""A sensor of 3 x 2 frusta on a coarse mesh, for tests of single cells."""

import numpy as np
from support.bodies import COARSE
from support.laws import POLYURETHANE as LAW
from support.sensors import CORO

from softtact.models.hyperelastic.build import build_sensor_body
from softtact.sensors.fields import Edge

# Its sides are held up to the surface: all of so small a sensor's cover is rim, and free it has modes ten times as soft.
SMALL = CORO.model_copy(update={"footprint_mm": (3.6, 2.4), "map_shape": (5, 7), "edge": Edge(held="sides")})


def plate(x, y):
    """A load step plate over everything."""
    return np.zeros(len(x)), np.tile([0.0, 0.0, -1.0], (len(x), 1))


def six_frusta(**changes):
    """The body at rest; changes: of its specification."""
    return build_sensor_body(SMALL.model_copy(update=changes), dielectric_law=LAW, cover_law=LAW, mesh=COARSE)


def bent(body, *, by_mm, depth_mm):
    """The body under a plate held at a depth, some frusta bent sideways in their middle, {frustum: mm}."""
    slab, support = body.rest()
    z = body.support.coordinates[0, :, 2]
    middle = np.sin(np.pi * (z - z.min()) / np.ptp(z))
    for frustum, much in by_mm.items():
        support[frustum, :, 0] += much * middle
    return body.evaluate(slab, support, depth_mm, body.slab.project(slab, plate))
