"""A small elastic layer and rigid objects for the tests of contact."""

from functools import cache

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.underside import Underside
from softtact.geometry.pose import Pose
from softtact.models.elastic.compliance import surface_grid
from softtact.models.quarter_symmetry import PARITIES, LinearLayer, ParityBlocks, QuarterSlab

SIDE, THICKNESS = 12.0, 2.5     # mm
LAYER = LinearLayer(THICKNESS, bulk_modulus=0.66, shear_modulus=0.55, shares=(0.5, 0.3, 0.2))     # E 1.29 MPa, nu 0.17


@cache
def layer_compliance():
    """The `NodeGrid` of a layer's top, nodes 0.75 mm apart, and the compliance (n, n) among them in mm/N."""
    slab = QuarterSlab((SIDE, SIDE), [LAYER], (4, 4), base_held=True)
    kept = 3 * slab.top.ravel() + 2
    blocks = ParityBlocks(np.stack([slab.compliance(slab.stiffness, kept, parity) for parity in PARITIES]))
    grid = surface_grid(slab)
    places = grid.quarter(np.arange(grid.count))
    return grid, blocks.between(*places, *places)


def placed(mesh, values=(0, 0, 0, 0, 0, 0)):
    """A copy of a mesh turned and moved sideways by a pose's six values, its lowest point at z = 0."""
    mesh = mesh.copy()
    mesh.vertices = Pose.from_values(values).apply(mesh.vertices)
    mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
    return mesh


def underside(mesh, grid):
    """`Underside` of a placed mesh over a grid."""
    return Underside(HeightField(mesh), grid)


def ball(radius):
    return trimesh.creation.icosphere(subdivisions=4, radius=radius)


def flat_box(x, y):
    return trimesh.creation.box((x, y, 4.0))


def punch(radius, sections=128):
    return trimesh.creation.cylinder(radius=radius, height=4.0, sections=sections)
